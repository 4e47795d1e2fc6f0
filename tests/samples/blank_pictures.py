"""Pages with blank pictures, and pages that are not drawn: half the time of a short verb is that of its page."""

import io
from argparse import Namespace
from base64 import b64decode
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

_BLANK = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 360 270"></svg>'
# One transparent point.
_BLANK_PNG = b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR4nGNgYGBgAAAABQABh6FO1AAAAABJRU5ErkJggg=="
)


class _NoTicks:
    """An axis without ticks until it is asked for some: Matplotlib makes the first of each for its settings alone."""

    def __init__(self, name: str) -> None:
        self.name = name

    def __get__(self, axis: Any, owner: type) -> Any:
        if axis is None:
            return self
        ticks: list[Any] = []
        setattr(axis, self.name, ticks)
        return ticks


@cache
def _matplotlib() -> tuple[type, type, dict[tuple[type, str], Any]]:
    """Matplotlib's figure and axis, and what they do."""
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

    does = {(Figure, name): getattr(Figure, name) for name in ("savefig", "findobj")}
    return Figure, Axis, does | {(Axis, name): vars(Axis)[name] for name in ("majorTicks", "minorTicks")}


@contextmanager
def blank() -> Iterator[None]:
    """Our code lays figures out as ever; what Matplotlib writes of them is a blank picture."""
    figure, axis, does = _matplotlib()

    def savefig(drawn: Any, target: Any, *, format: str, **given: Any) -> None:
        if format == "svg":
            target.write(_BLANK if isinstance(target, io.TextIOBase) else _BLANK.encode())
        elif format == "png":
            target.write(_BLANK_PNG)
        else:
            does[figure, "savefig"](drawn, target, format=format, **given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figure, "savefig", savefig)
        # Looking for texts makes every tick.
        patch.setattr(figure, "findobj", lambda *_: [])
        for name in ("majorTicks", "minorTicks"):
            patch.setattr(axis, name, _NoTicks(name))
        yield


@contextmanager
def drawn() -> Iterator[None]:
    """Pictures are drawn all the same."""
    *_, does = _matplotlib()
    with pytest.MonkeyPatch.context() as patch:
        for (owner, name), function in does.items():
            patch.setattr(owner, name, function)
        yield


@cache
def _drawing() -> tuple[ModuleType, Callable[..., int]]:
    """What draws the pages of verbs, and where; it loads NumPy, whose threads `conftest` has not set yet."""
    from mrwork.cli import output, report

    # The verb that draws pages keeps the true function.
    assert report.drawing is output.drawing
    return output, output.drawing


@contextmanager
def no_pages() -> Iterator[None]:
    """Verbs write an empty file for the page of their run; `mrwork report` still draws it."""
    from mrwork.store.run_folder import REPORT
    from mrwork.store.run_writer import add_to_run

    output, drawing = _drawing()

    def without_page(options: Namespace, folder: Path, _: object) -> int:
        return drawing(options, folder, lambda _: add_to_run(folder, {REPORT: b""}))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(output, "drawing", without_page)
        yield


@contextmanager
def all_pages() -> Iterator[None]:
    """Verbs draw their pages all the same."""
    output, drawing = _drawing()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(output, "drawing", drawing)
        yield
