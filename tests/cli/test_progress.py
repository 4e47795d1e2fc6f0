"""The line of progress tells where a run stands, how fast it goes and how long it may take."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from mrwork.cli.progress import ProgressLine, choice_described, described
from mrwork.identification.progress import Progress
from mrwork.uncertainty.choice.choose import ChoiceProgress

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
    assert described(NOW, BEGAN) == (
        "search 120, best 92.08 %, median 81.50 %, 2.5k evaluations/s, 5M steps/s, 3 s, "
        "at most 4 s of this stage left"
    )


def test_what_cannot_be_told_yet_is_left_out() -> None:
    assert described(BEGAN, BEGAN) == "search 30, best 50.00 %, median -20.00 %, 1 s"
    refining = replace(
        BEGAN, stage="refinement", count=7, unit="steps", generation=0, median_percent=math.nan, share=0.0
    )
    assert described(refining, refining) == "refinement, best 50.00 %, 7 steps, 1 s"


@pytest.mark.parametrize(
    ("seconds", "left"), [(34.0, "at most 1 min"), (131.0, "at most 4 min"), (7201.0, "at most 4.0 h")]
)
def test_long_times_are_in_minutes_and_hours(seconds: float, left: str) -> None:
    now = replace(NOW, seconds=seconds)
    assert left in described(now, BEGAN)


def test_a_comparison_tells_which_model_how_many_there_are_and_how_long_it_may_take() -> None:
    progress = ChoiceProgress(
        model="dahl",
        number=3,
        n_models=15,
        task="left out 2 of 6",
        seconds=65.0,
        seconds_left=600.0,
        within=NOW,
    )
    assert choice_described(progress) == (
        "dahl, model 3 of 15, left out 2 of 6, best 92.08 %, 1 min, about 10 min left"
    )
    assert choice_described(replace(progress, within=None, seconds_left=None)) == (
        "dahl, model 3 of 15, left out 2 of 6, 1 min"
    )


def test_without_a_terminal_a_plain_line_is_written_once_a_minute(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seconds = [0.0]
    monkeypatch.setattr("time.monotonic", lambda: seconds[0])
    line: ProgressLine[int] = ProgressLine("step {}".format, quiet=False)
    for number in range(150):
        seconds[0] = float(number)
        line(number)
    line.close()
    assert capsys.readouterr().err == "mrwork: step 60\nmrwork: step 120\n"
    silent: ProgressLine[int] = ProgressLine("step {}".format, quiet=True)
    seconds[0] = 300.0
    silent(1)
    assert capsys.readouterr().err == ""
