"""Control laws, and the regulators, Lyapunov functions, observers, surfaces and networks they are designed with."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
