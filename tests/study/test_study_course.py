"""The course of a study: what it says of its time, and what it leaves as it is."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import tuning_samples

import mrwork as mr
from mrwork.base.progress import ProgressLine, TerminalBar
from mrwork.closed_loop import simulate
from mrwork.study.course import Course, Part, StudyProgress, excerpt_of

UNCERTAIN = "[uncertainty]\nrealisations = 200\nstiffness = 0.1\n"
CONTROLLER = """
[[controller]]
law = "best_passive"
"""


def study(folder: Path) -> mr.Study:
    return mr.read_study(tuning_samples.study_file(folder, tune=CONTROLLER, more=UNCERTAIN))


def test_progress_is_told_within_a_call_and_changes_no_bit(tmp_path: Path) -> None:
    given, seen = study(tmp_path), []
    told = mr.run_study(given, threads=1, on_progress=seen.append, check_step=True)
    silent = mr.run_study(given, threads=1, check_step=True)
    for name, array in silent.labelled.numbers.items():
        assert np.array_equal(array, told.labelled.numbers[name], equal_nan=True), name
    # All of its time is known after the trials, and why it is long.
    assert all(progress.reasons for progress in seen[1:])
    assert all(progress.left is not None for progress in seen[1:])
    within = [progress.label for progress in seen if " of " in progress.label]
    assert any("realisations 64 of " in label for label in within)
    shares = [progress.share for progress in seen if progress.share is not None]
    assert 0.0 <= min(shares) <= max(shares) <= 1.0


def test_blocks_of_any_size_have_equal_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(simulate, "_BLOCK_SECONDS", 0.0)
    given = study(tmp_path)
    small = mr.run_study(given, threads=1, on_progress=lambda progress: None)
    whole = mr.run_study(given, threads=1)
    for name, array in whole.labelled.numbers.items():
        assert np.array_equal(array, small.labelled.numbers[name], equal_nan=True), name


STIFF = """
[building]
n_storeys = 2
masses = [300]
stiffnesses = [400e3]
modal_damping = { ratios = [0.01] }
[[damper]]
storey = 1
model = "normalised_bouc_wen"
largest_command = 1
parameters = { c = [300, 800], k = 0, x0 = 0, k_w = [100, 800], rho = 1e5, sigma = 1e3, n = 1 }
[[controller]]
law = "clipped_optimal"
[[motion]]
synthetic = "kanai_tajimi"
duration = 1
pga = 2
"""


def test_reading_tells_the_time_that_settings_take_and_the_stiff_damper_that_is_why(tmp_path: Path) -> None:
    path, seen = tmp_path / "study.toml", []
    path.write_text(STIFF)
    told = mr.read_study(path, on_progress=seen.append)
    assert told.arrangements[-1].taken == mr.read_study(path).arrangements[-1].taken
    # Those at i = 0 and at the largest command, and 13 candidates.
    assert {progress.total for progress in seen} == {15}
    assert all(progress.left is not None for progress in seen[1:])
    (reasons,) = {progress.reasons for progress in seen[1:]}
    assert "settings of clipped_optimal" in reasons[0]
    assert "n = 1 on a bound of the model" in reasons[1]
    assert "a model without states" in reasons[1]


def test_rows_share_an_observer(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    designed = []
    design = simulate._design_observer
    monkeypatch.setattr(simulate, "_design_observer", lambda *given: designed.append(given) or design(*given))
    simulate._OBSERVERS.clear()
    path = tuning_samples.study_file(tmp_path, tune=CONTROLLER, more="")
    text = path.read_text()
    assert "[hardware]" in text
    path.write_text(text.replace("[hardware]", "[hardware]\nfeedback = 'observer'"))
    mr.run_study(mr.read_study(path), threads=1)
    assert len(designed) == 1


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


def test_a_resumed_study_counts_what_was_recalled(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = [0.0]
    monkeypatch.setattr("mrwork.study.course.time.perf_counter", lambda: clock[0])
    told, seen = course(clock, expected=50.0)
    told.begin((0, "runs"), "first", 0, recalling=True)
    told.begin((1, "runs"), "second", 100)
    # Half of the runs were recalled; a trial of the rest has taken little.
    assert 0.5 <= seen[-1].share < 0.55  # type: ignore[operator] # it is known
    clock[0] += 25.0
    told.advance(50, 100)
    assert seen[-1].share == pytest.approx(0.75, abs=0.03)


def test_an_excerpt_is_the_part_with_the_most_energy() -> None:
    motion = mr.synthetic_motion(duration=10.0)
    part = excerpt_of(motion, 0.1, 1e-3)
    assert part.duration == pytest.approx(1.0, rel=0.02)
    assert np.mean(part.acceleration**2) > np.mean(motion.acceleration**2)
    assert excerpt_of(motion, 1.0, 1e-3) is motion
    coarse = mr.GroundMotion(name="coarse", dt=10.0, acceleration=np.sin(np.arange(50.0)))
    assert excerpt_of(coarse, 1e-4, 1e-3).duration == pytest.approx(0.049, rel=0.1)


def test_a_line_goes_on_while_no_report_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[str] = []
    monkeypatch.setattr("mrwork.base.progress._TICK", 0.01)
    display = TerminalBar(written.append, written.append)
    display.every = 0.0
    report = StudyProgress(done=0, total=3, label="first", seconds=0.0, left=9.0)
    line = ProgressLine(
        lambda progress: progress.in_words, write=written.append, note=written.append, display=display
    )
    with line:
        line(report)
        assert line._ticking is not None
        while len(written) < 5:
            line._ticking.join(0.01)
    assert not line._ticking.is_alive()
    assert all("0 of 3 runs, first" in text for text in written[:5])
