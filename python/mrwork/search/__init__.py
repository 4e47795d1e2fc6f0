"""Derivative-free searches on the unit cube, their registry by name, and the rules that end them."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
