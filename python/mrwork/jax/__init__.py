"""Simulation and objectives as functions of JAX, with exact derivatives, for losses and methods of one's own."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
