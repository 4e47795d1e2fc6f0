"""Pages of runs: a fit, a study or a tuning."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
