"""JAX twins of the damper models and of the closed loop: the same equations, differentiable."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
