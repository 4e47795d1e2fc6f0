"""Damper models as the Rust core declares them, with their parameters, current laws, published sets and conversions."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
