"""JAX twins of the damper models: the same equations, differentiable.

A twin is a module with the name of its model and two functions of parameters `p` (by their names in the spec), state,
displacement and velocity: `rate(p, state, x, v)`, not needed without states, and `force(p, state, x, v)`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
