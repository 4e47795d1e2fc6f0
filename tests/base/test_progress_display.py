"""Progress tells where a run stands, how fast it goes and how long it may take, in a display for each place."""

from dataclasses import replace
from typing import Any

import pytest

from mrwork.base.progress import (
    Progress,
    ProgressLine,
    note_compilation,
    notebook_bar,
    plain_lines,
    since,
    terminal_bar,
    time_left,
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


BEGAN = Progress(
    stage="search",
    said=("search 120", "best 92.08 %"),
    share=0.1,
    at_most=True,
    seconds=1.0,
    numbers={"evaluations": 60, "steps": 120_000},
    rated=("evaluations", "steps"),
)
NOW = replace(BEGAN, share=0.4, seconds=3.0, numbers={"evaluations": 5060, "steps": 10_120_000})


def test_a_stage_tells_its_rates_and_the_time_left() -> None:
    # 5000 evaluations and ten million steps in two seconds; 0.3 of the allowance took these, 0.6 are left.
    assert since(BEGAN, NOW).in_words == (
        "search 120, best 92.08 %, 2.5k evaluations/s, 5M steps/s, 3 s, at most 4 s left"
    )


def test_the_time_left_is_not_told_before_a_second_or_without_progress() -> None:
    assert since(BEGAN, replace(NOW, seconds=1.9)).left is None
    assert since(BEGAN, replace(NOW, share=0.1)).left is None
    assert since(BEGAN, replace(NOW, share=1.2)).left == 0.0


def test_kinds_of_work_have_rates_of_their_own() -> None:
    assert (
        time_left({"core": 10.0, "Python": 2.0}, {"core": 5.0, "Python": 1.0}, {"core": 1.0, "Python": 30.0})
        == 62.0
    )
    assert time_left({"core": 10.0, "Python": 2.0}, {"core": 5.0}, {"core": 1.0}) is None
    assert time_left({}, {}, {}) == 0.0


def test_a_log_has_a_line_every_half_minute(clock: list[float]) -> None:
    written: list[str] = []
    with ProgressLine(plain_lines(written.append)) as line:
        for number in range(80):
            clock[0] = float(number)
            line(replace(BEGAN, seconds=clock[0]))
    assert written == [f"10 %, {replace(BEGAN, seconds=seconds).in_words}" for seconds in (30.0, 60.0)]
