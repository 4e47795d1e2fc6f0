"""Figures of results by their attribute `plot`: `fit.plot.loops()` is `mr.plots.loops(fit)`.

Figures know every result and load Matplotlib, so they stand above all: they are named here alone, and loaded when one
is asked for. What takes a result is told by the annotation of its first argument, `result`.
"""

from __future__ import annotations

from importlib import import_module
from types import MethodType
from typing import TYPE_CHECKING, Any, Self, get_type_hints

if TYPE_CHECKING:
    from mrwork.plots.accessor import Plots as Plots
else:

    class Plots:
        """Figures of a result: the functions of `mr.plots` that take it, by their names."""

        __slots__ = ("_result",)

        def __init__(self, result: object) -> None:
            self._result = result

        def __getattr__(self, name: str) -> Any:
            if name.startswith("_"):
                # Notebooks and copies ask for such names, and must not load Matplotlib.
                raise AttributeError(name)
            function = getattr(import_module("mrwork.plots"), name, None)
            if function is None or not _takes(function, self._result):
                kind = type(self._result).__name__
                raise AttributeError(f"a {kind} has no figure {name!r}; it has {', '.join(dir(self))}")
            return MethodType(function, self._result)

        def __dir__(self) -> list[str]:
            plots = import_module("mrwork.plots")
            return [name for name in dir(plots) if _takes(getattr(plots, name), self._result)]

        def __repr__(self) -> str:
            return f"Figures of a {type(self._result).__name__}: {', '.join(dir(self))}"


class Plotted:
    """A result with figures."""

    __slots__ = ()

    @property
    def plot(self) -> Plots[Self]:
        """Figures of the result, the functions of `mr.plots` that take it."""
        return Plots(self)


def _takes(function: Any, result: object) -> bool:
    """Whether a function of `mr.plots` draws a figure of this result."""
    return "result" in function.__annotations__ and isinstance(result, get_type_hints(function)["result"])


def building_html(building: object) -> str:
    """The drawing of a building, for a notebook."""
    return str(import_module("mrwork.plots.of_buildings").building_html(building))
