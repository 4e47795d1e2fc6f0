"""How progress is shown: by widgets in a notebook, a bar on a terminal, elsewhere a line from time to time.

Every computation reports `Progress`, which says itself in words and knows the share that is done.
"""

from __future__ import annotations

import contextlib
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from importlib.util import find_spec
from typing import Any, Self, TypeVar

from mrwork.base.arguments import NotNegative, checked
from mrwork.base.numbers import duration_in_words, format_rate
from mrwork.errors import escape_text

Kind = TypeVar("Kind", bound=str)
Write = Callable[[str], None]

_BAR = 20
COMPILATIONS: list[float] = []
"""Durations of the compilations of this process [s]; `twins` lets JAX report them, where it is loaded."""


def note_compilation(event: str, duration_secs: float, **_: str | int) -> None:
    """Note an event that JAX reports, where it is a compilation."""
    if event == "/jax/core/compile/backend_compile_duration":
        COMPILATIONS.append(duration_secs)


# Seconds until the remaining time of a stage is first estimated.
_FIRST_ESTIMATE = 1.0


def time_left(
    left: Mapping[Kind, float], done: Mapping[Kind, float], seconds: Mapping[Kind, float]
) -> float | None:
    """Time that is left [s]: each kind of work goes on at its rate; `None` where a kind that is left has none yet."""
    rates = {kind: seconds[kind] / work for kind, work in done.items() if work > 0.0}
    return sum(left[kind] * rates[kind] for kind in left) if left.keys() <= rates.keys() else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """Progress of a computation: its `stage`, the `share` of the stage that is done, and what is `said` of it.

    `numbers` are what it has found and counted so far, by name; the rates of those `rated` are told. `seconds` have
    passed; `left` is the time that the stage still takes [s], or takes at most. `None` and 0 are not known yet.
    """

    stage: str
    said: tuple[str, ...] = ()
    share: float | None = None
    numbers: Mapping[str, float] = field(default_factory=dict)
    rated: tuple[str, ...] = ()
    rates: tuple[float, ...] = ()
    seconds: float = 0.0
    left: float | None = None
    at_most: bool = False

    @property
    def in_words(self) -> str:
        """What is said, rates and times in one line; what is unknown is left out."""
        rates = zip(self.rated, self.rates, strict=False)
        parts = [*self.said, *(f"{format_rate(rate)} {name}/s" for name, rate in rates)]
        if self.seconds:
            parts.append(duration_in_words(self.seconds))
        if self.left is not None:
            parts.append(f"{'at most' if self.at_most else 'about'} {duration_in_words(self.left)} left")
        return ", ".join(parts)


def since(began: Progress, progress: Progress) -> Progress:
    """The progress with its rates and the time that is left, where the stage goes on as since it `began` here."""
    running, left = progress.seconds - began.seconds, progress.left
    if running <= 0.0:
        return progress
    rates = tuple((progress.numbers[name] - began.numbers[name]) / running for name in progress.rated)
    if left is None and progress.share is not None and running >= _FIRST_ESTIMATE:
        share = min(progress.share, 1.0)
        done = {progress.stage: share - (began.share or 0.0)}
        left = time_left({progress.stage: 1.0 - share}, done, {progress.stage: running})
    return replace(progress, rates=rates, left=left)


OnProgress = Callable[[Progress], bool | None]
"""Takes the progress of a computation, which ends where this returns true."""


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

    def __call__(self, progress: Progress) -> None:
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
