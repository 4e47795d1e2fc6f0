"""A study in a TOML file: a building, its dampers, control laws and ground motions, and how they respond."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
