"""Buildings: matrices from a file, a shear frame or a publication, and additions such as dampers and isolators."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
