"""What the attribute `plot` of a result is: functions of `mr.plots` as its methods, loaded when one is asked for.

What takes a result is told by the annotation of its first argument, `result`.
"""

from __future__ import annotations

from types import MethodType
from typing import Any, get_type_hints

from mrwork import plots


class Plots:
    """Figures of a result: the functions of `mr.plots` that take it, by their names."""

    __slots__ = ("_result",)

    def __init__(self, result: Any) -> None:
        self._result = result

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            # Notebooks and copies ask for such names, and must not load Matplotlib.
            raise AttributeError(name)
        function = getattr(plots, name, None)
        if function is None or not _takes(function, self._result):
            kind = type(self._result).__name__
            raise AttributeError(f"a {kind} has no figure {name!r}; it has {', '.join(dir(self))}")
        return MethodType(function, self._result)

    def __dir__(self) -> list[str]:
        return [name for name in dir(plots) if _takes(getattr(plots, name), self._result)]

    def _repr_html_(self) -> str | None:
        """The drawing of a building, for a notebook; what other results have is told by their `repr`."""
        from mrwork.plots.of_buildings import building_html

        return building_html(self._result) if _takes(building_html, self._result) else None

    def __repr__(self) -> str:
        return f"Figures of a {type(self._result).__name__}: {', '.join(dir(self))}"


def _takes(function: Any, result: object) -> bool:
    return "result" in function.__annotations__ and isinstance(result, get_type_hints(function)["result"])
