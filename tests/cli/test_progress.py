"""The line of progress tells where a run stands, how fast it goes and how long it may take."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from mrwork.cli.output import progress_line
from mrwork.identification import Progress
from mrwork.identification.progress import Pace

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
    pace = Pace(BEGAN)
    pace.of(BEGAN)
    assert pace.of(NOW).in_words == (
        "search 120, best 92.08 %, median 81.50 %, 2.5k evaluations/s, 5M steps/s, 3 s, "
        "at most 4 s of this stage left"
    )


def test_the_time_left_runs_down_without_leaps_and_never_below_zero() -> None:
    pace = Pace(BEGAN)
    # A search that is at a tenth after 10 s, ends its first half early, takes more than allowed, and begins anew.
    shares = [*np.linspace(0.0, 0.1, 50), *np.linspace(0.5, 1.2, 50), *np.linspace(0.0, 0.5, 50)]
    left = [
        pace.of(replace(BEGAN, share=float(share), seconds=1.0 + 0.2 * number)).left
        for number, share in enumerate(shares)
    ]
    known = [seconds for seconds in left if seconds is not None]
    assert min(known) >= 0.0
    # Lines are 0.2 s apart.
    leaps = [after - before for before, after in pairwise(known) if before < 60.0 and after < 60.0]
    assert max(map(abs, leaps)) <= 5.0


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
