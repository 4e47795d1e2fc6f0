"""The course of a study: what it says of its time, and what it leaves as it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tuning_samples

import mrwork as mr
from mrwork.closed_loop import simulate
from mrwork.study.course import Course, Part, StudyProgress, excerpt_of

UNCERTAIN = "[uncertainty]\nrealisations = 100\nstiffness = 0.1\n"
CONTROLLER = """
[[controller]]
law = "best_passive"
"""


def study(folder: Path) -> mr.Study:
    return mr.read_study(tuning_samples.study_file(folder, tune=CONTROLLER, more=UNCERTAIN))


def test_progress_is_told_within_a_call_and_changes_no_bit(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given, seen = study(tmp_path), list[StudyProgress]()
    silent = mr.run_study(given, threads=1, check_step=True)
    told = mr.run_study(given, threads=1, on_progress=seen.append, check_step=True)
    # Nor do blocks of another size.
    monkeypatch.setattr(simulate, "_BLOCK_SECONDS", 0.0)
    small = mr.run_study(given, threads=1, on_progress=lambda progress: None, check_step=True)
    for name, array in silent.labelled.numbers.items():
        for other in (told, small):
            assert np.array_equal(array, other.labelled.numbers[name], equal_nan=True), name
    # All of its time is known after the trials, and why it is long.
    assert all(progress.reasons and progress.left is not None for progress in seen[1:])
    assert any("realisations 64 of " in progress.label for progress in seen)
    shares = [progress.share for progress in seen if progress.share is not None]
    assert 0.0 <= min(shares) <= max(shares) <= 1.0


def course(clock: list[float], expected: float) -> tuple[Course, list[StudyProgress]]:
    """A course of two parts, of which the trials of a share take this time of all."""
    seen: list[StudyProgress] = []

    def trial(share: float) -> tuple[float, int]:
        tried = max(share, 1e-4)
        clock[0] += 0.01 + tried * expected
        return tried, 4

    part = Part(n_runs=100, trial=trial)
    reasons: Any = lambda n_runs, steps: (f"{n_runs} runs of {steps} steps",)  # noqa: E731
    return Course({(0, "runs"): part, (1, "runs"): part}, seen.append, total=200, reasons=reasons), seen


def test_trials_tell_the_time_of_all_and_runs_correct_it(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr("mrwork.study.course.time.perf_counter", lambda: clock[0])
    told, seen = course(clock, expected=50.0)
    told.begin((0, "runs"), "first", 0)
    assert seen[-1].left == pytest.approx(100.0, rel=0.01)
    assert seen[-1].reasons == ("200 runs of 4 steps",)
    # The trials took no more than their share.
    assert seen[-1].seconds < 0.05 * 100.0
    clock[0] += 40.0
    told.advance(50, 100)
    assert seen[-1].left == pytest.approx(40.0 + 50.0, rel=0.01)
    clock[0] += 40.0
    told.begin((1, "runs"), "second", 100)
    # The first took 80 s instead of 50.
    assert seen[-1].left == pytest.approx(80.0, rel=0.01)
    assert seen[-1].later(30.0).left == pytest.approx(50.0, rel=0.01)
    assert "left" not in seen[-1].later(90.0).in_words


def test_an_excerpt_is_the_part_with_the_most_energy() -> None:
    motion = mr.synthetic_motion(duration=10.0)
    part = excerpt_of(motion, 0.1, 1e-3)
    assert part.duration == pytest.approx(1.0, rel=0.02)
    assert np.mean(part.acceleration**2) > np.mean(motion.acceleration**2)
    assert excerpt_of(motion, 1.0, 1e-3) is motion
    coarse = mr.GroundMotion(name="coarse", dt=10.0, acceleration=np.sin(np.arange(50.0)))
    assert excerpt_of(coarse, 1e-4, 1e-3).duration == pytest.approx(0.049, rel=0.1)
