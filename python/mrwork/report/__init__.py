"""Reports of fits and studies: numbers as text, figures and pages."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
