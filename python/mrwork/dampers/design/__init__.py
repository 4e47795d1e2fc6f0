"""Dampers from fluid and coil: fluids and steels, flow through the slot, magnetic circuit, forces, sizing."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
