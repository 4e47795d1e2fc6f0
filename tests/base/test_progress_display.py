"""Progress is a bar on a terminal, widgets in a notebook, and lines elsewhere; compilation is told in the end."""

from __future__ import annotations

from typing import Any

import pytest

from mrwork.base.progress import (
    Progress,
    ProgressLine,
    note_compilation,
    notebook_bar,
    plain_lines,
    terminal_bar,
)


def report_of(said: str, share: float | None = None) -> Progress:
    return Progress(stage="work", said=(said,), share=share)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    seconds = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: seconds[0])
    return seconds


def test_a_terminal_has_a_bar_where_the_share_is_known(clock: list[float]) -> None:
    written: list[str] = []
    with ProgressLine(terminal_bar(written.append, written.append)) as shown:
        for clock[0], report in (
            (0.0, report_of("begins")),
            (0.1, report_of("lost")),
            (0.3, report_of("on", 0.5)),
        ):
            shown(report)
    assert written[:2] == ["\rbegins", "\r[##########----------] on"]
    assert written[2].strip("\r ") == ""
    assert len(written) == 3


def test_a_notebook_has_one_bar_that_moves(clock: list[float]) -> None:
    widgets = pytest.importorskip("ipywidgets")
    displayed: list[Any] = []
    with ProgressLine(notebook_bar(widgets, displayed.append)) as shown:
        for clock[0], report in (
            (0.0, report_of("begins")),
            (1.0, report_of("half", 0.5)),
            (2.0, report_of("all", 1.3)),
        ):
            shown(report)
            ((bar, text),) = (each.children for each in displayed)
            assert text.value == report.in_words
            assert bar.value == min(report.share or 0.0, 1.0)
            assert bar.layout.visibility == ("hidden" if report.share is None else "visible")
    assert bar.layout.display == "none"


def test_the_time_of_compilation_is_told_in_the_end() -> None:
    written: list[str] = []
    with ProgressLine(plain_lines(written.append)):
        note_compilation("/jax/core/compile/backend_compile_duration", 3.4)
        note_compilation("/jax/core/compile/jaxpr_trace_duration", 50.0)
    with ProgressLine(plain_lines(written.append)):
        note_compilation("/jax/core/compile/backend_compile_duration", 0.2)
    assert written == ["JAX compiled for 3 s"]
