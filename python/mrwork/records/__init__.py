"""Damper test records: reading, checks, conversion to SI, repairs and the observation model."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
