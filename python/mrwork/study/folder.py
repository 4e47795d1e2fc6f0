"""The folder of a study: its results, tables and histories; and the results read back."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.base import arguments
from mrwork.base.arguments import Count, Positive, Whole
from mrwork.base.table import csv_text
from mrwork.closed_loop.evaluation import Spread, criteria
from mrwork.closed_loop.responses import unit_of
from mrwork.dampers.tested_range import Exceedance, OperatingRange, covering
from mrwork.errors import RecordError
from mrwork.store.codec import json_document
from mrwork.store.input_file import exists
from mrwork.store.run_folder import (
    CRITERIA_TABLE,
    ENSEMBLE,
    HISTORIES,
    JOURNAL,
    PROFILES_TABLE,
    REALISATIONS,
    RESULTS,
    STUDY,
    STUDY_RUN,
    RunFolder,
)
from mrwork.store.run_writer import RunAtWork
from mrwork.study.comparison import (
    QuantityChange,
    StudyComparison,
    compared,
    findings,
    judged_in_words,
    motion_groups,
)
from mrwork.study.results import (
    BuildingFacts,
    DamperFacts,
    Ensemble,
    MotionFacts,
    RealisationBand,
    StudyResults,
    criterion_band,
    score_band,
)
from mrwork.study.run_result import (
    FINISHED,
    HALF_STEP,
    NOMINAL,
    DeviceDemand,
    Histories,
    LabelledRuns,
    OutcomeName,
    RunHistory,
    RunResult,
    criteria_of_runs,
    numbered,
    read_stored_history,
    stem_of_history,
    worst_by_quantity,
)
from mrwork.study.run_result import Place as PlaceOfRun
from mrwork.study.study import Kind, Row, Study, StudyFile


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredChanges:
    """A row in the results file: its rank, its score, and the changes of every quantity by name.

    The references are the building without dampers and the passive damper with the lowest score. `worse` are the
    quantities that increase on average.
    """

    controller: str
    kind: Kind
    rank: str
    place: Count
    score: float
    against_uncontrolled: dict[str, QuantityChange]
    worse_than_uncontrolled: tuple[str, ...]
    against_best_passive: dict[str, QuantityChange]
    worse_than_best_passive: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredGroup:
    """A group of motions in the results file, and the score of each row under them."""

    name: str
    motions: tuple[str, ...]
    scores: dict[str, float]


def _store_changes(comparison: StudyComparison) -> Iterator[StoredChanges]:
    """Changes of every row, the rows of each rank together, the lowest score first."""
    results = comparison.results

    def against(row: int, reference: int | None) -> dict[str, QuantityChange]:
        return {} if reference in (None, row) else comparison.tables[row, reference]

    for rank, rows in comparison.ranks:
        for place, row in enumerate(rows, start=1):
            bare, passive = against(row, comparison.uncontrolled), against(row, comparison.passive)
            yield StoredChanges(
                controller=results.rows[row].label,
                kind=results.rows[row].kind,
                rank=rank.name,
                place=place,
                score=results.score(row),
                against_uncontrolled=bare,
                worse_than_uncontrolled=_increases(bare),
                against_best_passive=passive,
                worse_than_best_passive=_increases(passive),
            )


def _increases(changes: Mapping[str, QuantityChange]) -> tuple[str, ...]:
    return tuple(name for name, change in changes.items() if change.worse)


# Beside the quantities of a run.
_LEAST_STROKE = "least_stroke"


# Every criterion by name; NaN if the run has none.
_Criteria = dict[str, float]
_Quantities = dict[str, tuple[float, ...] | float]


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredStepCheck:
    """A run with half the step in the results file, and the relative change of each criterion."""

    outcome: OutcomeName
    steps: Whole
    largest: float | None
    changes: _Criteria
    criteria: _Criteria
    energy_error: float
    quantities: _Quantities


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredStudyRun:
    """A run in the results file: its criteria and their ratios to other rows under the same motion.

    These are the building without dampers, i = 0, and the passive damper with the lowest score.

    `outside_tested_range` are the quantities in which the demand on a damper lies outside its tested ranges, `None` if
    these are unknown; `exceedances` are the worst of each. `demand` is the largest on one damper, `demands` are those
    on each device. `bands` are those of the criteria over the realisations of [uncertainty]. `quantities` are those of
    `RunResult`, with `least_stroke`.
    """

    controller: str
    kind: Kind
    motion: str
    outcome: OutcomeName
    criteria: _Criteria
    over_uncontrolled: _Criteria
    over_passive_off: _Criteria
    energy_error: float
    steps: Whole
    step_check: StoredStepCheck | None
    over_best_passive: _Criteria
    outside_tested_range: tuple[str, ...] | None
    exceedances: tuple[Exceedance, ...]
    demand: OperatingRange | None
    demands: tuple[DeviceDemand, ...]
    bands: dict[str, RealisationBand]
    quantities: _Quantities


def _result(run: StoredStudyRun | StoredStepCheck) -> RunResult:
    """The run itself."""
    numbers = {name: np.array(value)[()] for name, value in run.quantities.items()}
    least_stroke = numbers.pop(_LEAST_STROKE)
    return RunResult(outcome=run.outcome, steps=run.steps, numbers=numbers, least_stroke=least_stroke)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Document:
    """The results file; its fields are the keys of the JSON object.

    `scores` are means over the motions that `judged_on` names, `spreads` the least, quartiles and most of the scores
    under single motions. `changes` has the rows of each rank together, the lowest score first. `floors` and `storeys`
    are the names along the quantities of the runs.
    """

    title: str
    complete: bool
    command_unit: str
    rows: tuple[Row, ...]
    motions: tuple[MotionFacts, ...]
    scores: _Criteria
    warnings: tuple[str, ...]
    study_warnings: tuple[str, ...]
    damper_warnings: tuple[str, ...]
    floors: tuple[str, ...]
    storeys: tuple[str, ...]
    results: tuple[StoredStudyRun, ...]
    best_passive: str | None
    judged_on: str
    chosen_on: tuple[str, ...]
    design_levels: tuple[str, ...] = ()
    limit: dict[str, Positive] = field(default_factory=dict)
    spreads: dict[str, Spread]
    groups: tuple[StoredGroup, ...]
    changes: tuple[StoredChanges, ...]
    realisations: Whole
    score_bands: dict[str, RealisationBand]
    findings: tuple[str, ...]
    building: BuildingFacts | None
    dampers: tuple[DamperFacts, ...]
    choices: tuple[str, ...]
    facts: tuple[tuple[str, str], ...]
    detailed: Whole
    with_histories: tuple[Whole, ...]


# What it has as the results have it.
_OF_DOCUMENT = (
    "title", "rows", "motions", "command_unit", "building", "dampers", "choices", "facts", "detailed", "with_histories",
    "study_warnings", "damper_warnings", "chosen_on", "design_levels", "limit",
)  # fmt: skip


@arguments.checked
def read_results(folder: str | Path) -> StudyResults:
    """Read the results of a study back from its folder, as `mr.load` does.

    Raises
    ------
    RecordError
        If it is not the folder of a study, or the file of its results is damaged.

    Examples
    --------
    >>> from mrwork.study import read_results
    >>> results = read_results("out/study")  # doctest: +SKIP
    >>> results.criteria(0, 0)["peak_drift"]  # doctest: +SKIP
    0.0123
    """
    return results_of_folder(RunFolder.open(folder, STUDY_RUN))


def results_of_folder(run: RunFolder) -> StudyResults:
    """The results of a study in the folder of a study or of a tuning."""
    document = run.read(_Document, RESULTS)
    if document is None:
        raise RecordError(f"{run.path} has no {RESULTS}; run `mrwork {run.kind.verb}` again")
    labels, names = [row.label for row in document.rows], [motion.name for motion in document.motions]
    runs = {(labels.index(run.controller), names.index(run.motion)): run for run in document.results}
    halved = {key: run.step_check for key, run in runs.items() if run.step_check is not None}
    steps = (NOMINAL, *([HALF_STEP] if halved else []))
    axes = {
        "row": tuple(labels),
        "motion": tuple(names),
        "realisation": (*steps, *numbered(document.realisations)),
    }
    labelled = criteria_of_runs(axes, command_unit=document.command_unit)
    both: dict[PlaceOfRun, StoredStudyRun | StoredStepCheck] = {(*key, 0): run for key, run in runs.items()}
    both |= {(*key, 1): run for key, run in halved.items()}
    for key, stored in both.items():
        ended = stored.criteria if stored.outcome in FINISHED else dict.fromkeys(stored.criteria, math.inf)
        for name, value in {**ended, "energy_error": stored.energy_error}.items():
            labelled.numbers[name][key] = value
    if document.realisations:
        _read_realisations(run, labelled, document.realisations)
    return StudyResults(
        labelled=labelled,
        runs={key: _result(run) for key, run in runs.items()},
        halved={key: _result(run) for key, run in halved.items()} or None,
        demanded={key: run.demands for key, run in runs.items()},
        floor_names=document.floors,
        storey_names=document.storeys,
        ensemble=run.read(Ensemble, ENSEMBLE, verb="respond --ensemble"),
        **{name: getattr(document, name) for name in _OF_DOCUMENT},
    )


def _read_realisations(run: RunFolder, labelled: LabelledRuns, count: int) -> None:
    """Fill in the criteria of the realisations, the last ones of their axis; a row without any has NaN."""
    arrays = run.arrays(REALISATIONS) or {}
    for name in arrays.keys() & labelled.numbers.keys():
        labelled.numbers[name][..., -count:] = arrays[name]


def _realisations(results: StudyResults) -> dict[str, bytes]:
    """The file of the criteria over realisations, if there are any."""
    if not results.n_realisations:
        return {}
    stream = BytesIO()
    realised = {name: each[..., -results.n_realisations :] for name, each in results.labelled.numbers.items()}
    np.savez_compressed(stream, **realised)  # type: ignore[arg-type] # none is called allow_pickle
    return {REALISATIONS: stream.getvalue()}


def read_history(place: Path, results: StudyResults, row: int, motion: int) -> RunHistory | None:
    """The history of a run in the folder of a study, if it is stored."""
    results.check_place(row, motion)
    # The rest of the name is that of the row before its command was chosen.
    run, stem = RunFolder.open(place), f"{HISTORIES}/{stem_of_history(row, motion)}-"
    name = next((each for each in run.files if each.startswith(stem)), None)
    return None if name is None or not exists(run.file(name)) else read_stored_history(run.file(name))


def write_study(
    work: RunAtWork,
    results: StudyResults,
    *,
    study_file: StudyFile,
    manifest: Mapping[str, object],
    histories: Histories,
    further: Mapping[str, object] | None = None,
) -> None:
    """Commit the folder of a study without its page, in place of an earlier one."""
    files = study_files(results, study_file)
    if further and "ensemble" in further:
        files[ENSEMBLE] = json_document(further["ensemble"]).encode()
    work.commit(files, manifest, grown=(JOURNAL, *histories.names), flush=results.complete)


def study_files(results: StudyResults, study_file: StudyFile) -> dict[str, bytes]:
    """The files of a study by name, but its manifest, journal, histories and page."""
    tables = {
        RESULTS: json_document(study_document(results)),
        CRITERIA_TABLE: _criteria_csv(results),
        PROFILES_TABLE: _profiles_csv(results),
    }
    return {STUDY: study_file.content, **_realisations(results)} | {
        name: text.encode() for name, text in tables.items()
    }


def study_document(results: StudyResults) -> dict[str, Any]:
    """The results as a JSON object."""
    comparison = compared(results)
    passive = comparison.passive
    document = _Document(
        complete=results.complete,
        scores={row.label: results.score(number) for number, row in enumerate(results.rows)},
        warnings=tuple(results.warnings()),
        floors=results.floor_names,
        storeys=results.storey_names,
        results=tuple(_store_run(results, *key, passive) for key in sorted(results.runs)),
        best_passive=None if passive is None else results.rows[passive].label,
        judged_on=judged_in_words(results),
        spreads={row.label: results.spread(number) for number, row in enumerate(results.rows)},
        groups=tuple(
            StoredGroup(
                name=group.name,
                motions=tuple(results.motions[motion].name for motion in group.motions),
                scores={
                    row.label: results.score_under(number, group.motions)
                    for number, row in enumerate(results.rows)
                },
            )
            for group in motion_groups(results)
        ),
        changes=tuple(_store_changes(comparison)),
        realisations=results.n_realisations,
        score_bands={
            row.label: band
            for number, row in enumerate(results.rows)
            if (band := score_band(results, number))
        },
        findings=findings(results),
        **{name: getattr(results, name) for name in _OF_DOCUMENT},
    )
    return asdict(document)


def design_document(study: Study) -> dict[str, Any]:
    """Settings that laws lacked, designs of weights and linear loops as a JSON object; empty where there are none."""
    taken = [
        {"controller": label, "notes": each.in_words, "settings": dict(each.settings)}
        for label, each in study.taken_settings
    ]
    weights = [
        {"controllers": labels, "notes": (*each.in_words, each.advice), **each.document()}
        for labels, each in study.designs
    ]
    loops = [
        {
            "controller": label,
            "notes": (*law.notes, *law.shaping_notes),
            "margins": None if law.margins is None else asdict(law.margins),
        }
        for label, law in study.laws
        if law.notes or law.shaping_notes
    ]
    document: dict[str, Any] = {"settings": taken, "weights": weights, "loops": loops}
    return {name: value for name, value in document.items() if value}


def _criteria_csv(results: StudyResults) -> str:
    """The criteria as a table, a line for each controller and motion; the header has the units."""
    known = criteria()
    heads = [f"{entry.name} [{results.labelled.units[entry.name]}]" for entry in known]
    lines: list[list[str]] = [["controller", "motion", "use", "outcome", "energy_error", "score", *heads]]
    for (row, motion), run in sorted(results.runs.items()):
        ratios = results.criteria(row, motion) or {}
        cells = [ratios.get(entry.name, math.nan) for entry in known]
        numbers = ["" if math.isnan(cell) else f"{cell:.9g}" for cell in cells]
        facts, score = results.motions[motion], results.score_under(row, (motion,))
        run_is = [run.outcome, f"{run.energy_error:.3g}", "" if math.isnan(score) else f"{score:.6g}"]
        lines.append([results.rows[row].label, facts.name, facts.use, *run_is, *numbers])
    return csv_text(lines)


def _profiles_csv(results: StudyResults) -> str:
    """Peaks and root mean squares of every floor and storey as a table, a line for each; drifts at the end."""
    lines: list[list[str]] = [["controller", "motion", "quantity", "where", "peak", "rms", "unit"]]
    for (row, motion), run in sorted(results.runs.items()):
        if not run.finished:
            continue
        labels = results.rows[row].label, results.motions[motion].name
        for quantity, names, peaks, squares, unit in (
            ("displacement", results.floor_names, run.peak_displacement, run.rms_displacement, "m"),
            ("drift", results.storey_names, run.peak_drift, run.rms_drift, "m"),
            ("acceleration", results.floor_names, run.peak_acceleration, run.rms_acceleration, "m/s2"),
        ):
            for name, peak, rms in zip(names, peaks, squares, strict=True):
                lines.append([*labels, quantity, name, f"{peak:.9g}", f"{rms:.9g}", unit])
        for quantity in ("peak_storey_shear", "peak_frame_shear", "peak_overturning", "residual_drift"):
            title, unit = quantity.removeprefix("peak_").replace("_", " "), unit_of(quantity)
            for name, peak in zip(results.storey_names, getattr(run, quantity), strict=True):
                if not math.isnan(peak):
                    lines.append([*labels, title, name, f"{peak:.9g}", "", unit])
    return csv_text(lines)


def _store_run(results: StudyResults, row: int, motion: int, passive: int | None) -> StoredStudyRun:
    run, demands = results.runs[row, motion], results.demands(row, motion)
    known = not demands or any(each.outside.known for each in demands)
    outside = tuple(dict.fromkeys(name for each in demands for name in each.outside.names))
    return StoredStudyRun(
        controller=results.rows[row].label,
        kind=results.rows[row].kind,
        motion=results.motions[motion].name,
        outcome=run.outcome,
        criteria=_every_criterion(results.criteria(row, motion)),
        over_uncontrolled=_every_criterion(results.ratios(row, motion, "uncontrolled")),
        over_passive_off=_every_criterion(results.ratios(row, motion, "passive_off")),
        over_best_passive=_every_criterion(results.ratios_to(row, motion, passive)),
        energy_error=run.energy_error,
        steps=run.steps,
        step_check=_store_step_check(results, row, motion),
        outside_tested_range=outside if known else None,
        exceedances=worst_by_quantity(demands),
        demand=covering([each.demand for each in demands]) if demands else None,
        demands=demands,
        bands={
            entry.name: band
            for entry in criteria()
            if (band := criterion_band(results, row, motion, entry.name))
        },
        quantities=_quantities_of(run),
    )


def _quantities_of(run: RunResult) -> _Quantities:
    every = {**run.numbers, _LEAST_STROKE: run.least_stroke}
    return {name: np.asarray(value).tolist() for name, value in every.items()}


def _store_step_check(results: StudyResults, row: int, motion: int) -> StoredStepCheck | None:
    half = (results.halved or {}).get((row, motion))
    if half is None:
        return None
    changes = results.step_changes(row, motion)
    return StoredStepCheck(
        outcome=half.outcome,
        steps=half.steps,
        largest=None if changes is None else max(changes.values()),
        changes=_every_criterion(changes),
        criteria=_every_criterion(results.labelled.criteria((row, motion, 1)) if half.finished else None),
        energy_error=half.energy_error,
        quantities=_quantities_of(half),
    )


def _every_criterion(numbers: Mapping[str, float] | None) -> _Criteria:
    values = numbers or {}
    named = (entry.name for entry in criteria() if not entry.optional or entry.name in values)
    return {name: values.get(name, math.nan) for name in named}
