"""How progress is shown: by widgets in a notebook, a bar on a terminal, elsewhere a line from time to time.

Every report of a computation is a `ProgressReport`, which says itself in words and knows the share that is done.
"""

from __future__ import annotations

import contextlib
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Self

from mrwork.base.arguments import NotNegative, checked
from mrwork.base.numbers import duration_in_words
from mrwork.errors import escape_text

Write = Callable[[str], None]

_BAR = 20
COMPILATIONS: list[float] = []
"""Durations of the compilations of this process [s]; `twins` lets JAX report them, where it is loaded."""


def note_compilation(event: str, duration_secs: float, **_: str | int) -> None:
    """Note an event that JAX reports, where it is a compilation."""
    if event == "/jax/core/compile/backend_compile_duration":
        COMPILATIONS.append(duration_secs)


class ProgressReport(ABC):
    """Progress of a computation; a report that has its share as a field declares it by `field()`."""

    __slots__ = ()

    @property
    @abstractmethod
    def in_words(self) -> str:
        """The work and how far it is, in one line, as the progress line shows it."""

    @property
    def share(self) -> float | None:
        """Share of the work that is done, from 0 to 1; `None` where it is not known."""
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Display:
    """Where progress is shown after `patience` [s], then at most once in `every` [s].

    `show` takes a text, and the share that is done where it is known; `close` clears what is shown, and leaves a last
    sentence behind, if there is one.
    """

    show: Callable[[str, float | None], None]
    close: Callable[[str], None]
    patience: float = 0.0
    every: float = 0.2


def terminal_bar(write: Write, note: Write) -> Display:
    """One line of a terminal, written again and again."""
    width = 0

    def show(text: str, share: float | None) -> None:
        nonlocal width
        filled = int(_BAR * (share or 0.0))
        line = text if share is None else f"[{'#' * filled}{'-' * (_BAR - filled)}] {text}"
        write("\r" + line.ljust(width))
        width = len(line)

    def close(last: str) -> None:
        if width:
            write("\r" + " " * width + "\r")
        if last:
            note(last)

    return Display(show=show, close=close)


def plain_lines(note: Write) -> Display:
    """Lines of a file, as of the log of a batch job."""
    return Display(
        show=lambda text, share: note(text if share is None else f"{100.0 * share:.0f} %, {text}"),
        close=lambda last: note(last) if last else None,
        patience=30.0,
        every=30.0,
    )


def notebook_bar(widgets: Any, display: Callable[[Any], object]) -> Display:
    """A bar of `ipywidgets` with the text beside it, which `display` shows below the cell; the text stays."""
    bar, label = widgets.FloatProgress(value=0.0, min=0.0, max=1.0), widgets.Label(value="")
    box = widgets.HBox([bar, label])

    def show(text: str, share: float | None) -> None:
        if not label.value:
            display(box)
        label.value = text
        bar.layout.visibility = "hidden" if share is None else "visible"
        bar.value = share or 0.0

    def close(last: str) -> None:
        if last:
            show(last, None)
        bar.layout.display = "none"

    return Display(show=show, close=close)


def display_here(*, write: Write, note: Write) -> Display:
    """Widgets in a notebook that has them, a bar where stderr is a terminal, elsewhere lines."""
    # A kernel has loaded IPython.
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    if getattr(shell, "kernel", None) is not None and find_spec("ipywidgets") is not None:
        return notebook_bar(import_module("ipywidgets"), import_module("IPython.display").display)
    return terminal_bar(write, note) if sys.stderr.isatty() else plain_lines(note)


class ProgressLine:
    """Shows the latest report of a computation in a display; without one nothing.

    It appears after `patience` [s]. In the end it says for how long JAX compiled meanwhile, from 1 s on.
    """

    def __init__(self, display: Display | None, *, patience: float = 0.0) -> None:
        self._display = display
        self._next = time.monotonic() + max(patience, display.patience if display is not None else 0.0)
        self._n_compiled = len(COMPILATIONS)

    def __call__(self, progress: ProgressReport) -> None:
        """Show a progress report; nothing within `patience`, or `every` seconds after the last one shown."""
        if self._display is None or time.monotonic() < self._next:
            return
        self._next = time.monotonic() + self._display.every
        share = progress.share
        text = escape_text(progress.in_words)
        self._display.show(text, None if share is None else min(max(share, 0.0), 1.0))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Clear the line, and say how long JAX compiled."""
        compiled = sum(COMPILATIONS[self._n_compiled :])
        if self._display is not None:
            text = f"JAX compiled for {duration_in_words(compiled)}" if compiled >= 1.0 else ""
            self._display.close(text)


@checked
def show_progress(*, patience: NotNegative = 0.5) -> ProgressLine:
    """Progress of a computation below a cell of a notebook, on a terminal, or in lines of a log; for `on_progress`.

    In a notebook it is a widget where `ipywidgets` is installed, on a terminal a bar, elsewhere a line every 30 s. In
    the end it says for how long JAX compiled.

    Parameters
    ----------
    patience
        Seconds until it appears.

    Examples
    --------
    >>> import mrwork as mr
    >>> with mr.show_progress() as shown:
    ...     fit = mr.identify("bingham", mr.synthetic_test("spencer1997"), on_progress=shown)
    """
    display = display_here(write=_write_stderr, note=lambda sentence: _write_stderr(f"{sentence}\n"))
    return ProgressLine(display, patience=patience)


def _write_stderr(text: str) -> None:
    with contextlib.suppress(OSError, ValueError):
        print(text, end="", file=sys.stderr, flush=True)
