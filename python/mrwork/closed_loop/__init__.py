"""Buildings with dampers and controllers under ground motions, simulated in batches; evaluation criteria by name."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
