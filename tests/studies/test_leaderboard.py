"""The leaderboard: what entries are given, what becomes of those that fail, and that data are the listed ones."""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import measured_data
import numpy as np
import pytest
from command_line import ran

import mrwork as mr
from mrwork.errors import RecordError, SettingError
from studies.boucwen_benchmark.multisine import newmark
from studies.common.frame import FRAME, HARDWARE, pair
from studies.leaderboard import measured
from studies.leaderboard.benchmark_score import (
    DT,
    TRUE,
    BenchmarkSignals,
    errors,
    published_signals,
    simulated_sweep,
)
from studies.leaderboard.best_constant import best_constant, constant_commands, training_scores
from studies.leaderboard.damper_scores import (
    DamperScore,
    damper_rows,
    fit_percent,
    folds,
    score_damper,
    without_force,
)
from studies.leaderboard.entries import DAMPERS, LAWS, Entry, Kind, Row, attempt, files_of, load, row_of
from studies.leaderboard.law_scores import bench, score_law, synthetic_motions, training_motions
from studies.leaderboard.rigs import CURRENTS, MOTIONS, synthetic_rig, utfsm_rig
from studies.leaderboard.tables import damper_table, law_table

STUDY = measured_data.ROOT / "studies" / "leaderboard" / "study.py"
FILES = [(kind, file) for kind in (DAMPERS, LAWS) for file in files_of(kind).values()]


@pytest.fixture(scope="module")
def tests() -> tuple[mr.DamperTest, ...]:
    return synthetic_rig()


def entry(function: object) -> Entry:
    return Entry(name="mine", title="Mine", function=function, n_params=None)  # type: ignore[arg-type] # of either table


def file_of(folder: Path, text: str) -> Path:
    file = folder / "mine.py"
    file.write_text(text, encoding="utf-8")
    return file


@pytest.mark.parametrize(("kind", "file"), FILES, ids=[f"{k.folder.name}/{f.stem}" for k, f in FILES])
def test_every_file_has_a_docstring_and_the_function(kind: Kind, file: Path) -> None:
    loaded = load(file, kind)
    assert loaded.title
    documentation = file.read_text(encoding="utf-8").split('"""')[1]
    assert "Authors: " in documentation
    assert "Reference: " in documentation


def test_no_two_entries_share_a_name() -> None:
    assert not files_of(DAMPERS).keys() & files_of(LAWS).keys()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("def identify(tests, rng): ...", "no docstring"),
        ('"""A method."""', "no function identify"),
        ('"""A method."""\ndef identify(tests): ...', "takes (tests)"),
        ('"""A method."""\nimport no_such_module', "no_such_module"),
        ('"""A method."""\ndef identify(tests, rng): return 1 / 0', "ZeroDivisionError"),
        ('"""A method."""\ndef identify(tests, rng): raise SystemExit(3)', "SystemExit"),
        ('"""A method."""\ndef identify(tests, rng): return lambda test: test.force[1:]', "shape"),
        ('"""A method."""\ndef identify(tests, rng): return lambda test: test.force / 0', "not finite"),
    ],
)
@pytest.mark.filterwarnings("ignore:invalid value")
def test_an_entry_that_fails_is_a_row_with_its_reason(
    tests: tuple[mr.DamperTest, ...], tmp_path: Path, text: str, said: str
) -> None:
    row = row_of(file_of(tmp_path, text), DAMPERS, lambda loaded: score_damper(loaded, tests))
    assert row.score is None
    assert said in row.failure
    (cells,) = damper_table("rig", [row]).rows
    assert cells[0] == "mine"
    assert said in cells[1]


def test_an_entry_that_never_ends_is_a_row_with_its_reason() -> None:
    def endless() -> None:
        while True:
            pass

    row = attempt("endless", endless, limit=0.2)
    assert row.failure.startswith("TimeoutError: the row took longer than 0.2 s")


def test_a_law_that_fails_is_a_row_with_its_reason(tmp_path: Path) -> None:
    text = '"""A law."""\ndef design(building, damper, motions, hardware, rng): return 3.0'
    row = row_of(file_of(tmp_path, text), LAWS, lambda loaded: score_law(loaded, []))
    assert "returned a float" in row.failure
    assert law_table("motions", [row]).rows[0][1].startswith("failed: SettingError")


def test_nothing_of_a_held_out_force_is_handed_over(tests: tuple[mr.DamperTest, ...]) -> None:
    forces = {test.name: test.force for test in tests}
    seen: list[str] = []

    def identify(rest, rng):
        training = {test.name for test in rest}

        def predict(test):
            assert test.name not in training
            assert not test.force.any()
            assert (test.findings, test.smoothing, test.original) == ((), None, None)
            assert (test.path, test.sha256, test.uncompared) == ("", "", ())
            seen.append(test.name)
            return np.full_like(test.displacement, forces[test.name].mean())

        return predict

    score = score_damper(entry(identify), tests)
    assert sorted(seen) == sorted(forces)
    # The mean of a force explains none of its deviation.
    assert all(abs(fit) < 1.0 for fit in score.fits.values())


def test_rows_of_workers_are_those_of_this_process(tests: tuple[mr.DamperTest, ...], tmp_path: Path) -> None:
    fails = file_of(tmp_path, '"""A method."""\ndef identify(tests, rng): return 1 / 0')
    files = [files_of(DAMPERS)["linear_regression"], fails]

    def rows() -> list[Row[DamperScore]]:
        return [replace(row, seconds=0.0) for row in damper_rows(files, tests, lambda name: None)]

    here = rows()
    with mr.local_workers(1) as pool, mr.working_on(pool):
        assert rows() == here
    assert here[0].score is not None
    assert here[1].failure == "ZeroDivisionError: division by zero"


def test_a_motion_is_left_out_at_every_current(tests: tuple[mr.DamperTest, ...]) -> None:
    parts = list(folds(tests))
    assert len(parts) == len(MOTIONS)
    for rest, held_out in parts:
        assert len(held_out) == len(CURRENTS)
        assert len({(test.amplitude, test.frequency) for test in held_out}) == 1
        assert not {(t.amplitude, t.frequency) for t in rest} & {(t.amplitude, t.frequency) for t in held_out}


def test_the_fit_of_the_recorded_force_itself_is_100(tests: tuple[mr.DamperTest, ...]) -> None:
    assert fit_percent(tests[0], tests[0].force) == 100.0
    assert without_force(tests[0]).observation == tests[0].observation
    with pytest.raises(SettingError, match="shape"):
        fit_percent(tests[0], tests[0].force[1:])


def test_the_synthetic_rig_has_the_same_bits_again(tests: tuple[mr.DamperTest, ...]) -> None:
    for one, again in zip(tests, synthetic_rig(), strict=True):
        np.testing.assert_array_equal(one.force, again.force)


def test_the_score_of_an_entry_repeats_itself(tests: tuple[mr.DamperTest, ...]) -> None:
    drawn: list[float] = []

    def identify(rest, rng):
        drawn.append(rng.random())
        return lambda test: np.zeros_like(test.force)

    for _ in range(2):
        score_damper(entry(identify), tests)
    assert drawn[: len(MOTIONS)] == drawn[len(MOTIONS) :]


def test_test_motions_are_not_among_the_training_motions() -> None:
    training = {motion.acceleration.tobytes() for motion in training_motions()}
    unseen = synthetic_motions()
    assert len(unseen) >= 16
    assert not training & {motion.acceleration.tobytes() for motion in unseen}


def test_the_references_have_ratios_of_one() -> None:
    over = bench(synthetic_motions()[:1], threads=1)

    def optimal_passive(building, damper, motions, hardware, rng):
        return best_constant(building, damper, motions, hardware)

    def off(building, damper, motions, hardware, rng):
        return constant_commands([0.0])

    (best,) = score_law(entry(optimal_passive), [over])
    (passive,) = score_law(entry(off), [over])
    assert all(ratio == 1.0 for score in best.values() for ratio in score.to_best_constant.values())
    assert all(score.score == 1.0 for score in passive.values())


def test_the_best_constant_command_has_the_least_training_score() -> None:
    motions = training_motions()[:2]
    chosen = best_constant(FRAME, pair(), motions, HARDWARE)
    levels = constant_commands(np.linspace(0.0, pair().largest_command, 5))
    (least,) = training_scores(chosen, FRAME, pair(), motions, HARDWARE)
    assert (least <= training_scores(levels, FRAME, pair(), motions, HARDWARE)).all()


def test_a_law_with_several_candidates_is_refused() -> None:
    over = bench(synthetic_motions()[:1], threads=1)
    several = entry(lambda building, damper, motions, hardware, rng: constant_commands([0.0, 1.0]))
    with pytest.raises(SettingError, match="2 candidates"):
        score_law(several, [over])


def test_true_parameters_have_the_error_of_the_integration_under_a_sweep() -> None:
    n_time = 512
    at_rest = np.append(simulated_sweep(n_time), np.zeros(n_time))
    sweep = (simulated_sweep(n_time), newmark(TRUE, at_rest, DT)[:n_time])
    test = BenchmarkSignals(multisine=(at_rest, newmark(TRUE, at_rest, DT)), sweep=sweep, source="here")
    size = float(np.sqrt(np.mean(sweep[1] ** 2)))
    assert max(errors(TRUE, test, DT)) < 2e-3 * size
    assert errors(TRUE._replace(m=2.2), test, DT)[1] > 2e-2 * size


def test_published_test_signals_are_read_where_all_are_there(tmp_path: Path) -> None:
    from scipy.io import savemat

    assert published_signals(tmp_path) is None
    for name, length in (("multisine", 8), ("sinesweep", 20)):
        for channel in "uy":
            variable = f"{channel}val_{name}"
            savemat(tmp_path / f"{variable}.mat", {variable: np.arange(float(length))[None]})
    found = published_signals(tmp_path)
    assert found is not None
    assert found.source == "published test signals"
    assert (found.multisine[0].shape, found.sweep[1].shape) == ((8,), (20,))
    savemat(tmp_path / "yval_sinesweep.mat", {"yval_sinesweep": np.arange(19.0)})
    with pytest.raises(RecordError, match="differ in length"):
        published_signals(tmp_path)


@pytest.fixture
def listed_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Two listed files of a folder of data."""
    monkeypatch.setenv("MRWORK_DATA", str(tmp_path))
    folder = tmp_path / "records"
    folder.mkdir()
    files = [folder / "a.csv", folder / "b.csv"]
    lines = []
    for file in files:
        file.write_text(f"{file.stem}\n", encoding="utf-8")
        lines.append(f"{hashlib.sha256(file.read_bytes()).hexdigest()}  records/{file.name}\n")
    hashes = tmp_path / "records.sha256"
    hashes.write_text("".join(lines), encoding="utf-8")
    monkeypatch.setattr(measured, "HASHES", hashes)
    return files


def test_listed_files_are_used_where_all_are_there(listed_files: list[Path]) -> None:
    assert measured.measured_files("records") == listed_files
    listed_files[1].unlink()
    assert measured.measured_files("records") == []
    assert "1 of 2 files" in measured.absent_sentence("records")


def test_a_changed_file_is_refused_even_where_another_is_absent(listed_files: list[Path]) -> None:
    listed_files[0].write_text("other\n", encoding="utf-8")
    listed_files[1].unlink()
    with pytest.raises(RecordError, match="SHA-256"):
        measured.measured_files("records")


@pytest.mark.skipif(
    not (measured_data.DATA / "dampers" / "utfsm").is_dir(), reason=f"no UTFSM tests at {measured_data.DATA}"
)
def test_the_utfsm_files_are_the_listed_ones() -> None:
    rig = utfsm_rig()
    assert len(rig) == 30
    assert len(list(folds(rig))) == 6


def run(tmp_path: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    return ran(
        *(sys.executable, STUDY, "--quick", "--out", tmp_path / "out", *arguments),
        env=os.environ | {"MRWORK_DATA": str(tmp_path)},
    )


def test_the_quick_form_writes_a_row_of_each_table(tmp_path: Path) -> None:
    names = ("linear_regression", "passive_on", "boucwen_benchmark")
    result = run(tmp_path, "--json", *(part for name in names for part in ("--only", name)))
    assert result.returncode == 0, result.stderr
    printed = json.loads(result.stdout)
    partial = tmp_path / "out" / "partial"
    written = json.loads((partial / "leaderboard.json").read_text(encoding="utf-8"))
    rows = [
        *written["dampers"]["synthetic rig"],
        *written["laws"]["synthetic motions"],
        *written["benchmark"],
    ]
    assert [row["name"] for row in rows] == list(names)
    assert not any(row["failure"] for row in rows)
    assert printed["benchmark"] == written["benchmark"]
    assert "simulated stand-in" in (partial / "report.html").read_text(encoding="utf-8")


def test_a_changed_record_ends_the_study_before_any_row(tmp_path: Path) -> None:
    folder = tmp_path / "records"
    folder.mkdir()
    (folder / "el_centro_1940_ns.csv").write_text("time,acceleration\n", encoding="utf-8")
    result = run(tmp_path)
    assert result.returncode == 2
    assert "SHA-256" in result.stderr
    assert not (tmp_path / "out").exists()


def test_an_unknown_entry_is_refused_with_those_that_there_are(tmp_path: Path) -> None:
    result = run(tmp_path, "--only", "nobody")
    assert result.returncode == 2
    assert "passive_on" in result.stderr


def test_a_table_without_its_data_says_so() -> None:
    table = damper_table("rig", [], absent="No rows: the files are absent.")
    assert table.rows == ()
    assert "No rows" in table.markdown()


def test_rows_are_ranked_and_failures_are_last(tests: tuple[mr.DamperTest, ...]) -> None:
    def score_of(factor: float):
        def identify(rest, rng):
            forces = {test.name: test.force for test in tests}
            return lambda test: factor * forces[test.name]

        return lambda: score_damper(entry(identify), tests)

    rows = [attempt("fails", lambda: 1 / 0), attempt("half", score_of(0.5)), attempt("most", score_of(0.9))]
    rows = [replace(row, n_params=3) for row in rows]
    assert [row[0] for row in damper_table("rig", rows).rows] == ["most", "half", "fails"]  # type: ignore[arg-type] # rows without a page
