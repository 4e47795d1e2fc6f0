"""A study in a TOML file: a building, its dampers, control laws and ground motions, and how they respond."""

from mrwork.base.namespace import attach

__getattr__, __dir__, __all__ = attach(__name__, __file__)
