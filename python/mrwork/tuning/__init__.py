"""Laws of a study tuned on its training motions and judged on its test motions."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
