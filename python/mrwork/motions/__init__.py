"""Ground motions: read from strong-motion formats or generated from a seed, then scaled, cut and corrected."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
