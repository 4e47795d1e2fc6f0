"""JAX twins of the damper models: the same equations, differentiable.

A twin is a module with the name of its model, a NamedTuple `Theta` in spec order and two functions:
`rate(theta, state, displacement, velocity)` and `force(theta, state, displacement, velocity)`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
