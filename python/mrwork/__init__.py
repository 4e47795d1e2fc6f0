"""Identify magnetorheological dampers from test records, and control structures with them.

The public names stand in `__init__.pyi`, here and in each namespace; a module is loaded when one of its names is first
used, so that `import mrwork` costs little more than the interpreter.
"""

from __future__ import annotations

from mrwork.base.plotted import Plotted as _Plotted


def _figures_of(result: _Plotted) -> object:
    """Figures of the result, the functions of `mr.plots` that take it."""
    # By name, because modules that import the package for its binary would seem to import figures with it.
    from importlib import import_module

    return import_module("mrwork.plots.accessor").Plots(result)


_Plotted.plot = property(_figures_of)


def __getattr__(name: str) -> object:
    # The reader of stubs takes longer to load than all else of a command that has only started.
    from mrwork.base.namespace import attach

    load, names, listed = attach(__name__, __file__)
    globals().update(__getattr__=load, __dir__=names, __all__=listed)
    return listed if name == "__all__" else load(name)


def __dir__() -> list[str]:
    __getattr__("__all__")
    return sorted(globals()["__all__"])
