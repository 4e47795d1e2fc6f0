"""The line of progress tells where a run stands, how fast it goes and how long it may take."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mrwork.base.progress import Progress, since, time_left
from mrwork.cli.output import progress_line

pytestmark = pytest.mark.words

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


def test_without_a_terminal_a_plain_line_is_written_every_half_minute(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seconds = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: seconds[0])
    with progress_line(quiet=False) as line:
        for number in range(80):
            seconds[0] = float(number)
            line(replace(BEGAN, seconds=seconds[0]))
    first, second = capsys.readouterr().err.splitlines()
    assert first == f"mrwork: 10 %, {replace(BEGAN, seconds=30.0).in_words}"
    assert second == f"mrwork: 10 %, {replace(BEGAN, seconds=60.0).in_words}"
    with progress_line(quiet=True) as silent:
        seconds[0] = 300.0
        silent(BEGAN)
    assert capsys.readouterr().err == ""
