"""Uncertainty of an identification: identifiability, posterior draws, calibrated bands, choice of model, next test."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
