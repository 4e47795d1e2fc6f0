"""Run folders of a fit, with every file that a verb adds, made in little time."""

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import mrwork as mr
from mrwork.identification import Fit
from mrwork.identification.fit_file import others_content, write_run
from mrwork.store.codec import json_document
from mrwork.store.run_folder import CHAIN, DRAWS, FIT_RUN, NEAR_SETS, PLAN, PROFILES, RANKING, RunFolder
from mrwork.store.run_writer import RunAtWork, add_to_run, addition_journal
from mrwork.uncertainty.bands.calibration_files import StoredBands, write_bands
from mrwork.uncertainty.bands.held_out import write_held_out
from mrwork.uncertainty.bands.prediction import UNSEEN
from mrwork.uncertainty.candidate_tests import Candidate
from mrwork.uncertainty.choice.ranking import Ranking, Standing
from mrwork.uncertainty.posterior.draws import draws_content

WALKERS = 12


def write_fit(place: Path, fit: Fit) -> Path:
    """The run folder of a fit."""
    with RunAtWork(place, FIT_RUN) as work:
        write_run(work, fit=fit, manifest={})
    return place


def add_every_file(
    place: Path, fit: Fit, test: mr.DamperTest, others: Sequence[mr.DamperTest], *, steps: int
) -> None:
    """Add to the run folder of a `fit` to one test whatever a verb may add.

    A chain of so many `steps` and its draws, profiles, bands calibrated on the `others`, a plan; and, made up, a
    ranking, a choice of laws and another set of laws.
    """
    with addition_journal(place, CHAIN, resume=False, replace=False, note=print) as journal:
        draws = mr.sample(
            fit, test, walkers=WALKERS, most_steps=steps, tempering="effective", threads=1, journal=journal
        )
        add_to_run(place, {DRAWS: draws_content(draws)}, grown=[CHAIN])
    predictions = mr.predict(fit, others).predictions
    write_bands(place, StoredBands.of(predictions, held_out=UNSEEN))
    write_held_out(RunFolder.open(place), fit, predictions)
    contents = {
        PROFILES: json_document(asdict(mr.profile(fit, test, threads=1))).encode(),
        PLAN: json_document(asdict(_plan(fit, test))).encode(),
        RANKING: json_document(asdict(ranking_of_two(fit.model))).encode(),
        NEAR_SETS: json_document(others_content([fit])).encode(),
    }
    add_to_run(place, contents)


def _plan(fit: Fit, test: mr.DamperTest) -> object:
    candidates = [Candidate(amplitude=amplitude, frequency=1.0) for amplitude in (0.005, 0.01, 0.02)]
    return mr.plan(fit, test, candidates, threads=1)


def ranking_of_two(model: str) -> Ranking:
    """A model that is better than another one."""
    candidates = [
        Standing(
            model=each, title=each, n_params=n, status="converged", seconds=1.0, left_out=(0.1 * n, 0.2 * n)
        )
        for each, n in ((model, 4), ("static_hysteretic", 7))
    ]
    return Ranking.of(candidates, held_out="tests", n_folds=2)


def choice_of_laws(model: str) -> Ranking:
    """Laws of one model; another one failed."""
    row = Standing(
        model=model, title=model, laws={"c": "linear"}, n_params=5, fit_percent=90.0, left_out=(0.2, 0.3)
    )
    failed = Standing(
        model="static_hysteretic",
        title="static_hysteretic",
        n_params=6,
        reason="no candidate could be simulated",
    )
    return Ranking.of([row, failed], held_out="tests", n_folds=2, unit="A")
