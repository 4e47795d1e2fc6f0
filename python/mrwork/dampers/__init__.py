"""Damper models declared by the Rust core: parameters, current laws, sets, conversions; their `design`."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
