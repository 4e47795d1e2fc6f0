"""Control laws, and the regulators, Lyapunov functions, observers, surfaces and networks they are designed with."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
