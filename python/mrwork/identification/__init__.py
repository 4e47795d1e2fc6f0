"""From tests to an identified damper: global search, least squares with exact derivatives, standard errors."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
