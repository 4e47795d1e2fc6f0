"""Buildings: mass, damping and stiffness from a file, a shear frame or a publication, and what is built into them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
