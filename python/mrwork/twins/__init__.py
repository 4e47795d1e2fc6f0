"""JAX twins of the damper models and of the closed loop: the same equations, differentiable."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
