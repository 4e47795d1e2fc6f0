"""Held-out tests stay out: of a table of tests, no verb looks at the forces of a use that is not its own."""

import json
import shutil
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from record_files import write_test
from refusals import refusal
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.identification.fit_file import reopen
from mrwork.identification.identify import identify_with
from mrwork.uncertainty import predict_left_out
from mrwork.uncertainty.candidate_tests import Candidate

# Commands [A] and frequencies [Hz] of the tests for each use.
USES = {"fit": ((0.0, 1.0), (0.5, 1.6), (1.0, 1.0)), "calibration": ((0.5, 0.7),), "test": ((1.0, 2.2),)}
SMALL = ("--generations", "3", "--threads", "1", "--quiet", "--json")
# What differs from one run to the next of the same command.
OF_THE_RUN = ("seconds", "out", "fits")


class Rig:
    """A folder with the records of a viscous Dahl damper and the table of their uses."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        self.tests: dict[tuple[str, str], mr.DamperTest] = {}
        for use, given in USES.items():
            for number, (command, frequency) in enumerate(given):
                theta, motion = (200.0, 100.0 + 400.0 * command, 1500.0, 200.0), (0.01, frequency)
                self.tests[use, f"{use}{number}.csv"] = sinusoidal_test(
                    "viscous_dahl", theta, motion, noise=0.02, rng=len(self.tests), command=command
                )
        rows = "".join(f"{name},{use}\n" for use, name in self.tests)
        (folder / "tests.csv").write_text(f"file,use\n{rows}")
        self.with_noise_for(())

    def with_noise_for(self, uses: Sequence[str]) -> None:
        """Write the records: of the tests for these uses, noise in the place of the force."""
        rng = np.random.default_rng(9)
        for (use, name), test in self.tests.items():
            noise = rng.normal(0.0, test.force.std(), test.n_time)
            write_test(self.folder / name, replace(test, force=noise) if use in uses else test)


def outcome(*arguments: object) -> Any:
    """What a command prints as JSON, less what no two runs share."""
    text = printed(*arguments)
    return _same_for_every_run(json.loads(text))


def _same_for_every_run(document: Any) -> Any:
    if isinstance(document, list):
        return [_same_for_every_run(entry) for entry in document]
    if not isinstance(document, dict):
        return document
    return {name: _same_for_every_run(entry) for name, entry in document.items() if name not in OF_THE_RUN}


LAW = ("--model", "viscous_dahl", "--law", "k_w=linear")


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitted:
    """A rig with a run folder of a fit to it, and what `identify` printed."""

    rig: Rig
    run: Path
    printed: Any


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Fitted:
    place = tmp_path_factory.mktemp("held_out")
    rig = Rig(place / "rig")
    printed = outcome("identify", rig.folder, *LAW, *SMALL, "--out", place / "run")
    return Fitted(rig=rig, run=place / "run", printed=printed)


@pytest.fixture
def fitted(made: Fitted) -> Fitted:
    made.rig.with_noise_for(())
    return made


@pytest.mark.long
def test_an_identification_sees_the_tests_for_fit_alone(fitted: Fitted, tmp_path: Path) -> None:
    fitted.rig.with_noise_for(("calibration", "test"))
    again = ("identify", fitted.rig.folder, *LAW, *SMALL, "--out")
    assert outcome(*again, tmp_path / "same") == fitted.printed
    # So that the equality says something.
    fitted.rig.with_noise_for(("fit",))
    assert outcome(*again, tmp_path / "other") != fitted.printed


@pytest.mark.long
@pytest.mark.parametrize(
    "options",
    [
        ("--model", "viscous_dahl", "--law", "auto"),
        ("--model", "viscous_dahl,bingham", "--law", "k_w=linear", "--law", "f_c=linear"),
    ],
    ids=["of laws", "of models"],
)
def test_a_choice_sees_the_tests_for_fit_alone(
    fitted: Fitted, options: tuple[str, ...], tmp_path: Path
) -> None:
    def chosen(name: str) -> Any:
        return outcome("identify", fitted.rig.folder, *options, *SMALL, "--out", tmp_path / name)

    before = chosen("before")
    fitted.rig.with_noise_for(("calibration", "test"))
    assert chosen("after") == before


def test_bands_are_calibrated_on_and_predictions_compared_with_the_tests_for_that_alone(
    fitted: Fitted,
) -> None:
    rig, run = fitted.rig, fitted.run
    commands = {
        "calibration": ("calibrate", run, rig.folder, "--quiet", "--json"),
        "test": ("predict", run, rig.folder, "--level", "0.9", "--json"),
    }
    before = {use: outcome(*command) for use, command in commands.items()}
    rig.with_noise_for(("fit", "test"))
    assert outcome(*commands["calibration"]) == before["calibration"]
    rig.with_noise_for(("fit", "calibration"))
    assert outcome(*commands["test"]) == before["test"]
    rig.with_noise_for(("calibration", "test"))
    assert {use: outcome(*command) for use, command in commands.items()} != before
    assert outcome(*commands["test"]) != before["test"]


def test_what_is_computed_from_a_run_depends_on_the_tests_of_its_fit_alone(fitted: Fitted) -> None:
    """`sample`, `profile`, `plan` and `calibrate` without files take no tests but those that a run opens with."""

    def results() -> Any:
        opened = reopen(fitted.run)
        fit, tests = opened.fit, opened.tests
        candidate = Candidate(amplitude=0.02, frequency=1.0, command=0.5)
        folds = predict_left_out(
            tests,
            "test",
            lambda rest: identify_with(fit.spec, rest, fit.settings.again, threads=1, warns=False),
        )
        return (
            mr.sample(fit, tests, walkers=16, most_steps=20, threads=1).theta.tolist(),
            asdict(mr.profile(fit, tests, parameters=["k_w@1A"], threads=1)) | {"seconds": None},
            asdict(mr.plan(fit, tests, [candidate], threads=1)),
            [prediction.model_force.tolist() for prediction in folds],
        )

    before = results()
    fitted.rig.with_noise_for(("calibration", "test"))
    assert results() == before
    fitted.rig.with_noise_for(("fit",))
    refusal(reopen, fitted.run, match="fit0.csv has changed")


@pytest.mark.usefixtures("pages")
def test_held_out_tests_accumulate_and_each_counts_once(fitted: Fitted, tmp_path: Path) -> None:
    run = tmp_path / "run"
    # Tests before this one may have added to the run.
    added = shutil.ignore_patterns("calibration*", "predictions*", "held_out*")
    shutil.copytree(fitted.run, run, ignore=added)

    def held_out(*records: Path) -> dict[str, float]:
        printed("predict", run, *records, "--json")
        found = mr.load(run, mr.StoredRun).held_out
        assert found is not None
        return {each.test.name: each.fit_percent for each in found.predictions}

    names = [fitted.rig.folder / f"{name}.csv" for name in ("test0", "calibration0", "fit0")]
    first = held_out(names[0])
    assert [*first] == ["test0"]
    # One that was fitted never counts, whatever its name.
    copy = tmp_path / "another.csv"
    shutil.copy(names[2], copy)
    both = held_out(names[1], names[2], copy)
    assert both == first | {"calibration0": both["calibration0"]}
    shutil.copy(names[0], copy)
    assert held_out(copy) == {"calibration0": both["calibration0"], "another": first["test0"]}
    spread = mr.load(run, mr.StoredRun).held_out.spread
    assert f"{spread.median_percent:.1f} % in the median" in (run / "report.html").read_text()
