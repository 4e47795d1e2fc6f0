"""Buildings: matrices from a file, a shear frame or a publication, and additions such as dampers and isolators."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
