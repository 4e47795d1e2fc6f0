"""Pages with blank pictures: most of the time of a verb that writes a page is spent by Matplotlib on their strokes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import pytest

_BLANK = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 360 270"></svg>'


@cache
def _matplotlib() -> tuple[type, dict[str, Any]]:
    """Matplotlib's figure, and what it does."""
    from matplotlib.figure import Figure

    return Figure, {name: getattr(Figure, name) for name in ("savefig", "findobj")}


@contextmanager
def blank() -> Iterator[None]:
    """Our code lays figures out as ever; what Matplotlib writes of them is a blank picture."""
    figure, does = _matplotlib()

    def savefig(drawn: Any, target: Any, *, format: str, **given: Any) -> None:
        if format == "svg":
            target.write(_BLANK)
        else:
            does["savefig"](drawn, target, format=format, **given)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(figure, "savefig", savefig)
        # Looking for texts makes every tick.
        patch.setattr(figure, "findobj", lambda *_: [])
        yield


@contextmanager
def drawn() -> Iterator[None]:
    """Pictures are drawn all the same."""
    figure, does = _matplotlib()
    with pytest.MonkeyPatch.context() as patch:
        for name, function in does.items():
            patch.setattr(figure, name, function)
        yield
