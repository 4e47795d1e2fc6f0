"""Buildings with dampers and controllers under ground motions, simulated in batches; evaluation criteria by name."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
