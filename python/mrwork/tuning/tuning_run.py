"""Tune the laws of a study: first candidates, a search, the chosen settings judged on the test motions."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from functools import partial
from itertools import chain, product
from typing import Any, Literal

import numpy as np

from mrwork.base.arguments import Seed, Threads, checked
from mrwork.base.keys import given_in
from mrwork.base.places import Place, keyed, read_each
from mrwork.base.progress import OnProgress, Progress
from mrwork.closed_loop.evaluation import Scales
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.search.registry import library
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall
from mrwork.study.loop_case import training_case
from mrwork.study.motions import refuse_same
from mrwork.study.run_options import TunedLaws
from mrwork.study.runs import asking
from mrwork.study.schema import Risk, TuneTable
from mrwork.study.study import Study, constant_share, study_fingerprint
from mrwork.study.trials import designed, magnitudes_of_runs
from mrwork.tuning.law_plan import Bench, LawPlan, check_controllable, without_gradient
from mrwork.tuning.law_tuning import (
    check_settings,
    constant_references,
    first_candidates,
    front_of,
    regulator_shapes,
    tune_law,
    weights_of_regulators,
)
from mrwork.tuning.placing import compare_places, placed_study, placements_of
from mrwork.tuning.space import LawCandidate, TuningObjective, space_of, tuning_objective
from mrwork.tuning.tuned_laws import Front, Placement, TunedLaw, TuningResults
from mrwork.workers.engine import Workers, by_whom, on_executor


@checked
@on_executor
def tune(
    study: Study,
    tables: Sequence[TuneTable] = (),
    *,
    laws: TunedLaws = (),
    risk: Risk = "mean",
    budget: int | None = None,
    rng: Seed = 0,
    journal: Journal | None = None,
    threads: Threads = 0,
    on_progress: OnProgress | None = None,
    executor: Executor | Workers | None = None,  # noqa: ARG001, of the decorator
) -> TuningResults:
    """Tune the settings of control laws on the training motions of a study; `mr.tuning.judge` judges them.

    Where the study has a table of places, the placements of its dampers are compared first, and laws are tuned at the
    best placement. First candidates (equal and published weights, the energy) and a search on the free settings are
    scored by the objective of the table, and the best is chosen, beside references that no search has touched.
    `mr.tuning.judge` judges the tuned laws on other motions, as rows of the study. In Python `laws` has several names.

    Parameters
    ----------
    tables
        What to tune; by default the [[tune]] tables of the study file.
    risk, budget
        With `laws`, the risk, and the candidates of each law.
    rng
        Seed, added to the `seed` of each table.
    journal
        Records every generation, and recalls the generations of a tuning that was interrupted.
    on_progress
        Called with the progress after every generation; where it returns true the tuning is interrupted.
    executor
        Does the runs in chunks: an executor of `concurrent.futures`, Dask, mpi4py or loky, or `Workers`. The results
        have the same bits. By default this process does them, and always the runs of laws of the user.

    Raises
    ------
    WorkerError
        If the executor or one of its workers is lost; a journal keeps what was finished.
    SettingError
        If nothing is to be tuned, the study has no damper that follows a command, or a table is wrong.
    Interrupted
        On Ctrl-C, with the `TuningResults` so far.
    JournalError
        If the journal belongs to another tuning.

    Examples
    --------
    >>> import mrwork as mr
    >>> study = mr.read_study("study.toml")  # doctest: +SKIP
    >>> tuned = mr.tune(study, laws=["clipped_optimal"], rng=1)  # doctest: +SKIP
    >>> tuned.laws[0].settings["largest_command"]  # doctest: +SKIP
    1.316
    """
    tables = tables_of(study, tables, laws=laws, risk=risk, budget=budget)
    check_tables(study, tables)
    study = designed(asking(study, (name for table in tables for name in table.judged_by)), journal=journal)
    if journal is not None:
        stated = {"tune": [*map(given_in, tables)], "places": study.table.places, "rng": rng}
        journal.agree("tuning", {**study_fingerprint(study), **stated})
    places, references = list[Placement](), list[TunedLaw]()
    # Laws that are done, and the law that is searched.
    tuned, searched, fronts = list[TunedLaw](), list[TunedLaw](), list[Front]()
    total = sum((1 + bool(table.objectives)) * len(table.laws) for table in tables)
    total += study.table.places is not None

    def found(status: Literal["finished", "interrupted"] = "interrupted") -> TuningResults:
        return TuningResults(
            title=study.title,
            status=status,
            laws=(*tuned, *searched),
            references=tuple(references),
            training=tuple(motion.name for motion in study.chosen_on),
            command_unit=study.command_unit,
            fronts=tuple(fronts),
            places=tuple(places),
            seconds=call.seconds,
        )

    call = LongCall[TuningResults](journal=journal, on_progress=on_progress, so_far=found)

    def report(label: str, candidates: int, most: int, least: float = math.nan) -> None:
        done = bool(places) + len(tuned) + len(fronts)
        call.report(
            Progress(
                stage="tuning",
                said=(
                    f"{label}{by_whom()}: {candidates} of {most} candidates, least objective {least:.4f}",
                    f"{done} of {total} searches done",
                ),
                share=(done + min(candidates / most, 1.0)) / total,
                numbers={"candidates": candidates},
            )
        )

    def advance(law: TunedLaw, most: int) -> None:
        searched[:] = [law]
        report(law.label, law.candidates, most, law.least)

    with call.keeping("tuning"):
        if study.table.places is not None:
            compare = partial(report, "placements")
            places += compare_places(study, call=call, threads=threads, on_compared=compare)
            study = placed_study(study, places[0].storeys)
        plans, untuned = _plan(study, tables, call, threads)
        # One by one, so that an interrupt finds those that are done.
        references.extend(untuned)
        for plan in plans:
            tuned.append(tune_law(plan, rng=rng, advance=advance))
            searched.clear()
            if plan.table.objectives:
                fronts.append(front_of(plan, rng=rng, report=partial(report, plan.label)))
    return found("finished")


def plan_of(study: Study, table: TuneTable, threads: int) -> LawPlan:
    """The one law of a table as `tune` plans it."""
    check_tables(study, [table])
    return _plan(asking(study, table.judged_by), [table], LongCall(), threads)[0][0]


def _plan(
    study: Study, tables: Sequence[TuneTable], call: LongCall[Any], threads: int
) -> tuple[list[LawPlan], Iterator[TunedLaw]]:
    """The laws of tables, and the references, those with weights still to be simulated."""
    case = training_case(study, threads=threads)
    bench = Bench(study=study, case=case, call=call)
    constants = constant_references(bench)
    baselines: dict[str, LawCandidate] = {law.kind: law.candidate for law in constants}
    benches = [bench.with_baselines(baselines)]
    if any(table.robust for table in tables):
        robust = replace(case, realisations=study.realisations)
        benches.append(replace(bench, case=robust).with_baselines(baselines))
    off, on = (benches[0].baselines[kind] for kind in ("passive_off", "passive"))
    if study.building.isolates.any():
        # Of the dampers, not of the isolators.
        off = replace(case, dampers_only=True).under(constant_share(study.devices, 0.0)).criteria()
    magnitudes = magnitudes_of_runs(study.building, study.chosen_on, off, on, study.devices)
    chooses = any(SETTINGS[law].chooses_levels for table in tables for law in table.laws)
    if chooses and study.problem.reference_peaks is not None:
        # Of the frame of the default model.
        peaks = study.problem.reference_peaks(True)
        magnitudes = replace(magnitudes, constant_drift=peaks.drift, constant_acceleration=peaks.acceleration)
    shapes = regulator_shapes(study.problem, magnitudes)

    def plan(table: TuneTable, law: str, objective: TuningObjective) -> LawPlan:
        space = space_of(table, law, magnitudes)
        return LawPlan(
            table=table,
            space=space,
            objective=objective,
            bench=benches[table.robust],
            firsts=first_candidates(space, shapes, magnitudes),
        )

    plans = list[LawPlan]()
    with _place_of(study, tables).prefix_errors():
        for number, table in enumerate(tables):
            with keyed("tune", number):
                objective = objective_for(table, study)
                for law in table.laws:
                    plans.append(plan(table, law, objective))
                    check_settings(plans[-1])
                _check_ratios(table, objective, benches[table.robust])
        # The study file with the chosen settings has all of them as rows.
        labels = [*(row.label for row in study.rows), *(plan.label for plan in plans)]
        refuse_same(labels, "tune", "results", "label")
    if not plans:
        return plans, iter(constants)
    law, over_zero = "clipped_optimal", replace(plans[0].objective, relative_to="passive_off")
    return plans, chain(constants, weights_of_regulators(plan(TuneTable(laws=(law,)), law, over_zero)))


def _check_ratios(table: TuneTable, objective: TuningObjective, bench: Bench) -> None:
    """Refuse a criterion that is zero or missing under the baseline: no candidate would have a score."""
    runs, motions = bench.baselines[objective.relative_to], bench.study.chosen_on
    for key, names in (("criteria", objective.weights), ("objectives", table.objectives or ())):
        for name, (index, motion) in product(names, enumerate(motions)):
            if not np.all(runs.numbers[name][:, index] > 0.0):
                sentence = f"{name} is 0 or missing {objective.baseline_in_words} under {motion.name}"
                remedy = "limit it among the constraints"
                raise InvalidSettingError(key, f"{sentence}, so no ratio to it exists; {remedy}")


def _place_of(study: Study, tables: Sequence[TuneTable]) -> Place:
    """What is refused of the tables of a study begins with their place in it."""
    return study.origin.place if tuple(tables) == study.tunes else Place()


def tables_of(
    study: Study,
    tables: Sequence[TuneTable] = (),
    *,
    laws: Sequence[str] = (),
    risk: Risk = "mean",
    budget: int | None = None,
) -> tuple[TuneTable, ...]:
    """What `tune` tunes of a study with these arguments."""
    if laws and tables:
        raise SettingError("`laws` are given besides `tables`; give the laws in the tables")
    if laws:
        made = TuneTable(laws=tuple(laws), risk=risk)
        return (made if budget is None else replace(made, budget=budget),)
    tables_of_laws = tuple(tables) or study.tunes
    if not tables_of_laws and study.table.places is None:
        raise SettingError(
            f"study {study.title!r} has nothing to tune; give it a [[tune]], as "
            'laws = ["clipped_optimal"], or [places]'
        )
    return tables_of_laws


def check_tables(study: Study, tables: Sequence[TuneTable]) -> None:
    """Refuse tables which the study is not fit for, and placements; nothing is simulated."""
    check_controllable(study)
    if study.table.places is not None:
        with study.origin.place.prefix_errors():
            placements_of(study)

    def check(number: int) -> None:
        with keyed("tune", number):
            objective_for(tables[number], study)

    with _place_of(study, tables).prefix_errors():
        read_each(check, range(len(tables)))


def objective_for(table: TuneTable, study: Study) -> TuningObjective:
    """The objective of a table, which the study must be fit for."""
    if table.robust and study.realisations is None:
        raise InvalidSettingError(
            "robust", "robust needs an [uncertainty] in the study; give one, or leave robust out"
        )
    if table.objectives:
        try:
            library("pymoo.algorithms.moo.nsga2")
        except SettingError as reason:
            sentence = f"a front over several objectives takes NSGA-II: {reason}"
            raise InvalidSettingError("objectives", sentence) from None
    if table.gradient_steps and (lacking := without_gradient(study, table)):
        raise InvalidSettingError("gradient_steps", f"{lacking}, or leave gradient_steps out")
    return tuning_objective(table, study.command_unit, Scales.of(study.building), study.scored)
