"""Progress is a bar on a terminal, widgets in a notebook, and lines elsewhere; compilation is told in the end."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import pytest

import mrwork as mr
from mrwork.base.progress import (
    COMPILE_TIME,
    Display,
    NotebookBar,
    PlainLines,
    ProgressLine,
    ProgressReport,
    TerminalBar,
    display_here,
)


@dataclass(frozen=True, slots=True)
class Report(ProgressReport):
    """A report of a computation."""

    in_words: str = field()
    share: float | None = None


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    seconds = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: seconds[0])
    return seconds


def shown_on(display: Display) -> ProgressLine[Report]:
    return ProgressLine(lambda each: each.in_words, write=print, note=print, display=display)


def test_a_terminal_has_a_bar_where_the_share_is_known(clock: list[float]) -> None:
    written: list[str] = []
    with shown_on(TerminalBar(written.append, written.append)) as shown:
        for clock[0], report in ((0.0, Report("begins")), (0.1, Report("lost")), (0.3, Report("on", 0.5))):
            shown(report)
    assert written[:2] == ["\rbegins", "\r[##########----------] on"]
    assert written[2].strip("\r ") == ""
    assert len(written) == 3


def test_a_log_has_a_line_every_half_minute(clock: list[float]) -> None:
    written: list[str] = []
    with shown_on(PlainLines(written.append)) as shown:
        for clock[0] in range(100):
            shown(Report(f"step {clock[0]}", clock[0] / 100))
    assert written == ["30 %, step 30", "60 %, step 60", "90 %, step 90"]


class _Widgets:
    """Stands for `ipywidgets`, whose widgets need a notebook to be seen."""

    @staticmethod
    def FloatProgress(**values: float) -> Any:  # noqa: N802 - as the library has it
        return SimpleNamespace(layout=SimpleNamespace(), **values)

    @staticmethod
    def Label(value: str) -> Any:  # noqa: N802 - as the library has it
        return SimpleNamespace(value=value)

    @staticmethod
    def HBox(children: list[Any]) -> Any:  # noqa: N802 - as the library has it
        return SimpleNamespace(children=children)


def test_a_notebook_has_one_bar_that_moves(clock: list[float]) -> None:
    displayed: list[Any] = []
    with shown_on(NotebookBar(_Widgets, displayed.append)) as shown:
        for clock[0], report in (
            (0.0, Report("begins")),
            (1.0, Report("half", 0.5)),
            (2.0, Report("all", 1.3)),
        ):
            shown(report)
            ((bar, text),) = (each.children for each in displayed)
            assert text.value == report.in_words
            assert bar.value == min(report.share or 0.0, 1.0)
            assert bar.layout.visibility == ("hidden" if report.share is None else "visible")
    assert bar.layout.display == "none"


def test_the_widgets_are_those_of_ipywidgets() -> None:
    widgets = pytest.importorskip("ipywidgets")
    displayed: list[Any] = []
    display = NotebookBar(widgets, displayed.append)
    display.show("half", 0.5)
    display.close()
    (box,) = displayed
    assert [each.value for each in box.children] == [0.5, "half"]


def test_the_place_decides_what_is_shown(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    assert isinstance(display_here(write=print, note=print), TerminalBar)
    monkeypatch.setattr("sys.stderr.isatty", lambda: False)
    assert isinstance(display_here(write=print, note=print), PlainLines)
    # A kernel, of which the modules are not looked for in files here.
    kernel = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=object()))
    monkeypatch.setitem(sys.modules, "IPython", kernel)
    monkeypatch.setattr("mrwork.base.progress.find_spec", lambda name: None)
    assert isinstance(display_here(write=print, note=print), PlainLines)
    monkeypatch.setattr("mrwork.base.progress.find_spec", lambda name: object())
    monkeypatch.setitem(sys.modules, "ipywidgets", _Widgets)
    monkeypatch.setitem(sys.modules, "IPython.display", SimpleNamespace(display=print))
    assert isinstance(display_here(write=print, note=print), NotebookBar)


def test_the_time_of_compilation_is_told_in_the_end() -> None:
    written: list[str] = []
    with shown_on(PlainLines(written.append)):
        COMPILE_TIME.count("/jax/core/compile/backend_compile_duration", 3.4)
        COMPILE_TIME.count("/jax/core/compile/jaxpr_trace_duration", 50.0)
    with shown_on(PlainLines(written.append)):
        COMPILE_TIME.count("/jax/core/compile/backend_compile_duration", 0.2)
    assert written == ["JAX compiled for 3 s"]


def test_jax_reports_its_compilations() -> None:
    import jax

    import mrwork.twins.models  # noqa: F401  (listens)

    before = COMPILE_TIME.seconds
    jax.jit(lambda x: x * 2.0 + 17.25)(3.0)
    assert COMPILE_TIME.seconds > before


def test_every_computation_tells_its_progress_by_the_public_display(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    test = mr.synthetic_test("spencer1997")
    with mr.show_progress(patience=0.0) as shown:
        mr.identify("bingham", test, threads=1, on_progress=shown)
    assert "best" in capsys.readouterr().err
