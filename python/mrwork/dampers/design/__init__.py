"""Dampers from fluid and coil: fluids and steels, flow through the slot, magnetic circuit, forces, sizing."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
