"""A long call that ends after any step goes on from its journal to the same bits, and recalls what was recorded.

The journal of a finished call is cut after each of its lines; several journals are lines of one after another.
"""

import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
import tuning_samples
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr

pytestmark = pytest.mark.contract
Open = Callable[[str], mr.Journal]
SEARCH = mr.search.EfficientGA(population=8, stop=mr.search.StopRules(max_generations=3))
PLAIN = sinusoidal_test("bingham", (670.0, 5e-3, 5000.0, -95.0), MOTIONS[0], noise=0.02)
TESTS = [
    sinusoidal_test(
        "viscous_dahl", (800.0, 200.0 + 480.0 * ampere, 2000.0, 20.0), motion, noise=0.02, command=ampere
    )
    for motion in MOTIONS[:2]
    for ampere in (0.0, 1.0)
]


def numbers(*fits: mr.Fit) -> list[object]:
    return [(fit.theta, fit.nrmse, fit.evaluations, fit.refinement_steps, fit.remarks) for fit in fits]


def descents(opened: Open) -> object:
    return numbers(mr.identify("bingham", PLAIN, rng=1, threads=1, journal=opened("fit")))


def search(opened: Open) -> object:
    return numbers(mr.identify("bingham", PLAIN, search=SEARCH, rng=1, threads=1, journal=opened("fit")))


def joint(opened: Open) -> object:
    spec = mr.damper("viscous_dahl").with_current_laws({"k_w": "linear"})
    return numbers(mr.identify(spec, TESTS, search=SEARCH, rng=1, threads=1, journal=opened("fit")))


def laws(opened: Open) -> object:
    settings = mr.identification.FitSettings(search=SEARCH)
    found = mr.choose_laws("viscous_dahl", TESTS, settings=settings, threads=1, journal_of=opened)
    return [*numbers(found.best, *found.best.others), found.ranking.sentence]


def models(opened: Open) -> object:
    settings = mr.identification.FitSettings(search=SEARCH)
    found = mr.choose_model(TESTS[:1], ["bingham", "dahl"], settings=settings, threads=1, journal_of=opened)
    return [*numbers(*found.fits), found.ranking.sentence]


def chain(opened: Open) -> object:
    fit = mr.identify("bingham", PLAIN, search=SEARCH, threads=1)
    found = mr.sample(fit, PLAIN, walkers=16, most_steps=8, threads=1, journal=opened("chain"))
    return found.chains.tolist(), found.densities.tolist()


def study(opened: Open) -> object:
    found = mr.run_study(
        tuning_samples.small_study(), check_step=True, threads=1, journal=opened("study")
    ).criteria_of_runs.numbers
    return {name: array.tobytes() for name, array in found.items()}


@cache
def tuned_study() -> mr.Study:
    with TemporaryDirectory() as folder:
        motions = tuning_samples.motion("A", 1, "training") + tuning_samples.motion("B", 2, "test")
        short = motions.replace("duration = 3", "duration = 1")
        return mr.read_study(
            tuning_samples.study_file(Path(folder), motions=short, building=tuning_samples.TWO_STOREYS)
        )


def tuning(opened: Open) -> object:
    journal, study = opened("tuning"), tuned_study()
    found = mr.tune(study, threads=1, journal=journal)
    judged = mr.tuning.judge(study, found, threads=1, journal=journal)
    return [
        (law.settings, law.least, judged.judgement(law, "test")) for law in (*found.laws, *found.references)
    ]


class Journals:
    """Journals in a folder, each resumed where it is there, in the order in which they were opened."""

    def __init__(self, folder: Path, lines: list[tuple[str, bytes]]) -> None:
        self.folder, self.steps, self.kept = folder, list[str](), lines
        folder.mkdir()
        for step, line in lines:
            with self.path(step).open("ab") as file:
                file.write(line)
        self.open_ones: list[mr.Journal] = []

    def path(self, step: str) -> Path:
        return self.folder / f"{step.replace('/', '-')}.jsonl"

    def __call__(self, step: str) -> mr.Journal:
        if step not in self.steps:
            self.steps.append(step)
        journal = mr.Journal(self.path(step), resume=self.path(step).exists())
        self.open_ones.append(journal)
        return journal

    def lines(self) -> list[tuple[str, bytes]]:
        for journal in self.open_ones:
            journal.close()
        written = [step for step in self.steps if self.path(step).exists()]
        return [
            (step, line)
            for step in written
            for line in self.path(step).read_bytes().splitlines(keepends=True)
        ]


def named(lines: list[tuple[str, bytes]]) -> list[tuple[str, str]]:
    return [(journal, json.loads(line)["step"]) for journal, line in lines]


@pytest.mark.long
@pytest.mark.parametrize("call", [descents, search, joint, laws, models, chain, study, tuning])
def test_a_call_goes_on_from_any_line_of_its_journals_to_the_same_bits(
    call: Callable[[Open], object], tmp_path: Path
) -> None:
    undisturbed = Journals(tmp_path / "whole", [])
    whole = call(undisturbed)
    lines = undisturbed.lines()
    assert len(lines) >= 4
    # A choice has a hundred lines, of which few are tried.
    for count in range(0, len(lines) + 1, 1 if len(lines) < 30 else len(lines) // 5):
        journals = Journals(tmp_path / str(count), lines[:count])
        assert call(journals) == whole
        # What was recorded was not computed again, which would have taken another time.
        assert journals.lines()[:count] == lines[:count]
        assert named(journals.lines()) == named(lines)
