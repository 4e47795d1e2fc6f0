"""The line of progress tells where a run stands, how fast it goes and how long it may take."""

from __future__ import annotations

from dataclasses import replace

import pytest

from mrwork.cli.output import progress_line
from mrwork.identification import Progress
from mrwork.identification.progress import since

pytestmark = pytest.mark.words

BEGAN = Progress(
    stage="search",
    count=60,
    unit="simulations",
    fit_percent=50.0,
    share=0.1,
    seconds=1.0,
    generation=30,
    median_percent=-20.0,
    evaluations=60,
    steps=120_000,
)
NOW = replace(
    BEGAN,
    fit_percent=92.083,
    share=0.4,
    seconds=3.0,
    generation=120,
    median_percent=81.5,
    evaluations=5060,
    steps=10_120_000,
)


def test_a_search_tells_generation_best_median_rates_and_time_left() -> None:
    # 5000 evaluations and ten million steps in two seconds; 0.3 of the allowance took these, 0.6 are left.
    assert since(BEGAN, NOW).in_words == (
        "search 120, best 92.08 %, median 81.50 %, 2.5k evaluations/s, 5M steps/s, 3 s, "
        "at most 4 s of this stage left"
    )


def test_the_time_left_is_not_told_before_a_second_or_without_progress() -> None:
    assert since(BEGAN, replace(NOW, seconds=1.9)).left is None
    assert since(BEGAN, replace(NOW, share=0.1)).left is None
    assert since(BEGAN, replace(NOW, share=1.2)).left == 0.0


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
