"""Ground motions: read from strong-motion formats or generated from a seed, then scaled, cut and corrected."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
