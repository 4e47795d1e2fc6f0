"""Derivative-free searches on the unit cube, their registry by name, and the rules that end them."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
