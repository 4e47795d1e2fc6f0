"""What `mrwork check` knows of a record, every verb says that it matters to: all declared kinds of remarks."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from pkgutil import iter_modules
from typing import Any, get_args

import numpy as np
import pytest
from command_line import mrwork, printed
from odd_files import MM, NEWTON, TIME, write_table
from record_files import Columns, codes, write_text
from sinusoidal_tests import harmonic

import mrwork as mr
from mrwork.base.remark import RemarkKind, Verb
from mrwork.identification.minimise import polish, race
from mrwork.records.remarks import remarks_for

VERBS: tuple[Verb, ...] = get_args(Verb)
# Remarks of tests together, which stand in no test.
OF_THE_SET = ("command_mislabelled", "record_repeated", "repeat_differs")


PLAIN = mr.synthetic_test("spencer1997_fast")


def declared() -> dict[str, RemarkKind]:
    """Every kind of remark that a module of the records declares, by its code."""
    modules = [import_module(f"mrwork.records.{each.name}") for each in iter_modules(mr.records.__path__)]
    values = [value for module in modules for value in vars(module).values()]
    values += [inner for value in values if isinstance(value, dict) for inner in value.values()]
    return {value.code: value for value in values if isinstance(value, RemarkKind)}


DECLARED = declared()


def has_remark(code: str, **changes: Any) -> mr.DamperTest:
    remark = replace(DECLARED[code], text=f"it has {code}", cure="do something").remark()
    return replace(PLAIN, **{"remarks": (remark,), "sha256": code, **changes})


@pytest.mark.parametrize("verb", VERBS)
@pytest.mark.words
def test_a_verb_says_a_remark_where_the_table_has_it(verb: Verb) -> None:
    for code, kind in DECLARED.items():
        alone = [has_remark(code), replace(PLAIN, remarks=(), sha256="another")]
        said = [each.code for each in remarks_for(verb, set_with(code) if code in OF_THE_SET else alone)]
        assert said == ([code] if verb in kind.verbs else [])


def set_with(code: str) -> list[mr.DamperTest]:
    plain = replace(PLAIN, remarks=(), current=1.0)
    if code == "record_repeated":
        return [replace(plain, name="first", path="a.csv"), replace(plain, name="second", path="b.csv")]
    weak = replace(plain, name="weak", sha256="4", force=0.5 * plain.force)
    if code == "repeat_differs":
        return [plain, weak]
    others = [replace(plain, name=f"{number}", sha256=f"{number}") for number in range(3)]
    # A motion of another period is no repeat.
    return [*others, replace(weak, dt=1.1 * plain.dt, velocity=plain.velocity / 1.1)]


@pytest.mark.words
def test_check_says_everything_and_identify_all_that_it_does_not_refuse() -> None:
    assert {code for code, kind in DECLARED.items() if "check" not in kind.verbs} == set()
    assert {code for code, kind in DECLARED.items() if "identify" not in kind.verbs} == {
        "velocity_factor",
        "time_factor",
    }


def recorded(frequency: float, *, amplitude: float = 0.01, n_time: int = 400, rng: int = 0) -> Columns:
    """A record of a Bingham damper, with the noise of a good rig."""
    spec = mr.damper("bingham")
    time = 0.005 * np.arange(n_time)
    motion = harmonic(time, (amplitude, frequency))
    force = mr.simulate_force(spec, spec.nominal, motion)
    noise = np.random.default_rng(rng).standard_normal((3, n_time))
    return {
        "t_s": time,
        "displacement_m": motion.displacement + 5e-6 * noise[0],
        "velocity_mps": motion.velocity + 1e-4 * noise[1],
        "force_n": force + 5.0 * noise[2],
    }


def strange_records(folder: Path) -> list[Path]:
    """Records of one rig, each with several faults."""
    folder.mkdir()
    gaps, clipped, coarse = recorded(1.0, rng=1), recorded(1.3, rng=2), recorded(17.0, amplitude=0.002, rng=4)
    gaps["force_n"][250] = 2e4
    gaps = {name: np.delete(samples, slice(100, 140)) for name, samples in gaps.items()}
    top = 0.8 * clipped["force_n"].max()
    clipped["force_n"] = -np.clip(clipped["force_n"], -top, top)
    clipped["velocity_mps"] = 1.3 * clipped["velocity_mps"]
    del coarse["velocity_mps"]
    made = {"gaps": gaps, "clipped": clipped, "coarse_30mm1Hz": coarse}
    return [write_text(folder / f"{name}.csv", each) for name, each in made.items()]


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """A run folder of a fit to strange records, and their remarks by code."""

    folder: Path
    files: Sequence[Path]
    found: frozenset[str]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Run:
    place = tmp_path_factory.mktemp("concerns")
    files = strange_records(place / "rig")
    found = frozenset(code for file in files for code in codes(mr.read_damper_test(file)))
    small = ("--model", "bingham", "--generations", "3", "--threads", "1", "--quiet", "--json")
    text = printed("identify", *files, *small, "--out", place / "run")
    assert told(json.loads(text)) == {code for code in found if "identify" in DECLARED[code].verbs}
    return Run(folder=place / "run", files=files, found=found)


def told(document: Any) -> set[str]:
    return {each["code"] for each in document["test_remarks"]}


def arguments_of(verb: Verb, run: Run) -> tuple[object, ...]:
    if verb == "predict":
        return ("predict", run.folder, *run.files)
    others: dict[Verb, tuple[object, ...]] = {
        "calibrate": ("--leave-out", "test", "--threads", "1"),
        "intervals": ("--parameter", "f_c", "--threads", "1"),
        "plan": ("--amplitudes", "0.01", "--frequencies", "1,2", "--threads", "1"),
        "report": (),
    }
    return (verb, run.folder, *others[verb], "--quiet")


@pytest.mark.parametrize("verb", [verb for verb in VERBS if verb not in ("check", "identify")])
@pytest.mark.words
def test_the_verb_says_what_matters_to_it(made: Run, verb: Verb) -> None:
    """On stderr, once each; with --json in the object and nowhere else."""
    mattering = {code for code in made.found if verb in DECLARED[code].verbs}
    # So that the equality says something: some are said, and not all.
    assert len(mattering) >= 6
    assert len(mattering) < len(made.found)
    plain = mrwork(*arguments_of(verb, made))
    assert plain.returncode == 0, plain.stderr
    begins = ("mrwork: warning in", "mrwork: note in")
    lines = [line for line in plain.stderr.splitlines() if line.startswith(begins)]
    assert len(lines) == len(set(lines)) >= len(mattering)
    ended = mrwork(*arguments_of(verb, made), "--json")
    assert ended.returncode == 0, ended.stderr
    assert told(json.loads(ended.stdout)) == mattering
    assert " in " not in ended.stderr


@pytest.mark.words
def test_a_record_under_two_names_is_named(made: Run, tmp_path: Path) -> None:
    twin = tmp_path / "copy.csv"
    twin.write_bytes(Path(made.files[0]).read_bytes())
    for command in (("check",), ("predict", made.folder)):
        ended = mrwork(*command, made.files[0], twin)
        assert ended.returncode == 0
        said = " ".join(f"{ended.stdout} {ended.stderr}".split())
        assert said.count("are the same record, byte for byte") == 1
        assert said.index(str(made.files[0])) < said.index(str(twin))


def test_a_test_of_another_condition_counts_as_held_out(tmp_path: Path) -> None:
    """A hot damper under a fitted motion: of the fit's motion, and not seen by it."""
    cold, hot = recorded(1.0), recorded(1.0, rng=1)
    files = [
        write_text(tmp_path / "cold.csv", cold),
        write_text(tmp_path / "hot.csv", hot | {"force_n": 0.7 * hot["force_n"]}),
        write_text(tmp_path / "again.csv", recorded(1.0, rng=2)),
    ]
    small = ("--model", "bingham", "--generations", "3", "--quiet")
    printed("identify", files[0], *small, "--out", tmp_path / "run")
    rows = json.loads(mrwork("predict", tmp_path / "run", *files[1:], "--json").stdout)
    assert [row["seen"] is None for row in rows["files"]] == [True, False]
    assert [row["other_condition"] is None for row in rows["files"]] == [False, True]
    assert [each["code"] for each in rows["remarks"]].count("condition_differs") == 1
    calibrated = mrwork("calibrate", tmp_path / "run", *files[1:], "--quiet", "--json")
    assert json.loads(calibrated.stdout)["tests"] == [str(files[1])]
    assert "temperature, pressure, pre-load?" in calibrated.stderr


@pytest.mark.words
def test_a_fit_that_has_not_converged_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for minimisation in (race, polish):
        monkeypatch.setattr(minimisation, "_MOST_ITERATIONS", 1)
    record = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM, "F_N": NEWTON})
    search = ("--search", "particle_swarm", "--generations", 2, "--population", 10, "--every", 4)
    text = printed("identify", record, "--model", "bouc_wen", *search, "--out", tmp_path / "run")
    assert "not converged (the final fit ended at its most steps, " in text
    assert "the final fit ended at its most steps" in mr.load(tmp_path / "run").fit.status_in_words
