"""The folder of a study: its runs, its summary and tables; and the results read back."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, get_type_hints

import numpy as np

from mrwork.base import arguments
from mrwork.base.summary import named
from mrwork.base.table import csv_text
from mrwork.dampers.tested_range import covering, worst_of
from mrwork.errors import RecordError
from mrwork.store.codec import built, json_document
from mrwork.store.netcdf import netcdf_of, read_netcdf
from mrwork.store.run_folder import (
    CRITERIA_TABLE,
    ENSEMBLE,
    PROFILES_TABLE,
    RESULTS,
    RUNS,
    STUDY,
    STUDY_RUN,
    RunFolder,
)
from mrwork.study.comparison import Comparison, compared, results_in_words
from mrwork.study.results import (
    DeviceDemand,
    Ensemble,
    StudyResults,
    bands_over,
    criterion_band,
    known_criteria,
)
from mrwork.study.runs import HALF_STEP, NOMINAL, Runs, outcome_names, study_criteria, study_quantities
from mrwork.study.study import Study, StudyFile


def _describe_changes(comparison: Comparison) -> Iterator[dict[str, Any]]:
    """Changes of every row, the rows of each rank together, the lowest score first."""
    results = comparison.results
    for rank, rows in comparison.ranks:
        for position, row in enumerate(rows, start=1):
            described: dict[str, Any] = {
                "controller": results.rows[row].label,
                "kind": results.rows[row].kind,
                "rank": rank.name,
                "place": position,
                "score": results.score(row).mean,
            }
            references = {"uncontrolled": comparison.uncontrolled, "best_passive": comparison.passive}
            for key, reference in references.items():
                changes = {} if reference in (None, row) else comparison.tables[row, reference]
                described[f"against_{key}"] = {name: asdict(change) for name, change in changes.items()}
                described[f"worse_than_{key}"] = tuple(
                    name for name, change in changes.items() if change.worse
                )
            yield described


@dataclass(frozen=True, slots=True, kw_only=True)
class _RunDemand:
    """The demand of a run on each device, by the labels of row and motion, as the file has it."""

    controller: str
    motion: str
    devices: tuple[DeviceDemand, ...]


# Fields of results that files have in another form, and those whose own fields stand beside the others.
_IN_OTHER_FORMS, _PARTS = ("quantities", "criteria_of_runs", "demanded", "ensemble"), ("motions", "page")
# Groups of the file of the runs beside the nominal quantities.
_CRITERIA, _HALF = "criteria", "half_step"


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
    document, content = run.document(RESULTS), run.content(RUNS)
    if document is None or content is None:
        raise RecordError(
            f"{run.path} has no {RUNS if document else RESULTS}; run `mrwork {run.kind.verb}` again"
        )
    with run.explained(RESULTS):
        demands = built(tuple[_RunDemand, ...], document["demands"])
        stated = {
            name: built(kind, document if name in _PARTS else document[name])
            for name, kind in get_type_hints(StudyResults).items()
            if name in document or name in _PARTS
        }
    with run.explained(RUNS):
        groups = read_netcdf(content, run.file(RUNS))
        unit = stated["command_unit"]
        every = {quantity.name for quantity in study_criteria(unit)}
        asked = [name for name in groups[_CRITERIA].arrays if name not in {*every, "outcome"}]
        quantities = Runs.from_arrays(groups[""], study_quantities(unit, asked), NOMINAL)
        if _HALF in groups:
            quantities = quantities.beside(
                Runs.from_arrays(groups[_HALF], study_quantities(unit, asked), HALF_STEP)
            )
        criteria_of_runs = Runs.from_arrays(groups[_CRITERIA], study_criteria(unit, asked))
    labels, names = [row.label for row in stated["rows"]], stated["motions"].names
    return StudyResults(
        quantities=quantities,
        criteria_of_runs=criteria_of_runs,
        demanded={
            (labels.index(demand.controller), names.index(demand.motion)): demand.devices
            for demand in demands
        },
        ensemble=run.read(Ensemble, ENSEMBLE, verb="respond --ensemble"),
        **stated,
    )


def runs_content(results: StudyResults) -> bytes:
    """The quantities and criteria of all runs."""
    runs = results.quantities._named_arrays()
    labels = {axis: label for axis, label in runs.labels.items() if axis != "realisation"}
    named = {}
    for number, name in zip(range(results.quantities.shape[2]), ("", _HALF), strict=False):
        arrays = {
            quantity: replace(
                array, values=array.values[:, :, number], axes=(*array.axes[:2], *array.axes[3:])
            )
            for quantity, array in runs.arrays.items()
        }
        named[name] = replace(runs, labels=labels, arrays=arrays)
    return netcdf_of({**named, _CRITERIA: results.criteria_of_runs._named_arrays()})


def study_files(results: StudyResults, study_file: StudyFile) -> dict[str, bytes]:
    """The files of a study by name, but its manifest, journal, histories and page."""
    ensemble = results.ensemble
    return {
        STUDY: study_file.content,
        RUNS: runs_content(results),
        RESULTS: json_document(_summary(results)).encode(),
        CRITERIA_TABLE: _criteria_csv(results).encode(),
        PROFILES_TABLE: _profiles_csv(results).encode(),
        **({} if ensemble is None else {ENSEMBLE: json_document(asdict(ensemble)).encode()}),
    }


def study_document(results: StudyResults) -> dict[str, Any]:
    """The results as a JSON object: the summary, and the criteria of each run."""
    comparison = compared(results)
    over = {
        f"over_{name}": {} if row is None else results.ratios_over(row)
        for name, row in (
            ("uncontrolled", comparison.uncontrolled),
            ("passive_off", results.row_of("passive_off")),
            ("best_passive", comparison.passive),
        )
    }
    runs = [
        _describe_run(results, row, motion)
        | {
            key: known_criteria({name: ratio[row, motion] for name, ratio in ratios.items()})
            for key, ratios in over.items()
        }
        for row, motion in np.argwhere(results.quantities.done[:, :, 0]).tolist()
    ]
    return {**_summary(results), "results": runs}


def _summary(results: StudyResults) -> dict[str, Any]:
    """What the results say beside the numbers of the runs.

    `scores` are means over the motions that `judged_on` names, `spreads` the least, quartiles and most of the scores
    under single motions. `changes` has the rows of each rank together, the lowest score first.
    """
    comparison, rows = compared(results), list(enumerate(results.rows))
    passive, labels = comparison.passive, [row.label for row in results.rows]
    left_out = {*_IN_OTHER_FORMS, *_PARTS}
    stated = [field.name for field in fields(StudyResults) if field.name not in left_out]
    parts = [getattr(results, name) for name in _PARTS]
    return {
        **named(results, *stated),
        **{field.name: getattr(part, field.name) for part in parts for field in fields(part)},
        "floor_names": results.quantities.axes["floor"],
        "storey_names": results.quantities.axes["storey"],
        "demands": [
            _RunDemand(controller=labels[row], motion=results.motions[motion].name, devices=demands)
            for (row, motion), demands in results.demanded.items()
            if demands
        ],
        "complete": results.complete,
        "scores": {row.label: results.score(number).mean for number, row in rows},
        "spreads": {row.label: asdict(results.score(number)) for number, row in rows},
        "remarks": results.remarks,
        "best_passive": None if passive is None else labels[passive],
        "judged_on": results.motions.in_words,
        "groups": [
            {
                "name": name,
                "motions": [results.motions[motion].name for motion in motions],
                "scores": {row.label: results.score(number, motions).mean for number, row in rows},
            }
            for name, motions in results.motions.groups.items()
        ],
        "changes": list(_describe_changes(comparison)),
        "realisations": results.n_realisations,
        "score_bands": {
            row.label: asdict(bands["score"])
            for number, row in rows
            if (bands := bands_over(results, number, results.at_zero))
        },
        "sentences": results_in_words(results),
    }


def _describe_run(results: StudyResults, row: int, motion: int) -> dict[str, Any]:
    """A run in the JSON object: its criteria, their bands over realisations, the check of its step and its demand.

    `outside_tested_range` are the quantities in which the demand on a damper lies outside its tested ranges, `None` if
    these are unknown; `exceedances` are the worst of each. `demand` is the largest on one damper.
    """
    quantities, demands = results.quantities, results.demanded.get((row, motion), ())
    run = quantities.at(row, motion)
    is_known = not demands or any(demand.outside.known or demand.outside.exceedances for demand in demands)
    return {
        "controller": results.rows[row].label,
        "kind": results.rows[row].kind,
        "motion": results.motions[motion].name,
        "outcome": str(outcome_names(quantities.outcome)[row, motion, 0]),
        "criteria": known_criteria(results.criteria_of_runs.at(row, motion)),
        "energy_error": float(run["energy_error"]),
        "steps": None if np.isnan(run["steps"]) else int(run["steps"]),
        "step_check": _step_check(results, row, motion),
        "outside_tested_range": tuple(
            dict.fromkeys(name for demand in demands for name in demand.outside.names)
        )
        if is_known
        else None,
        "exceedances": tuple(
            asdict(worst) for worst, *_ in worst_of([(demand.device, demand.outside) for demand in demands])
        ),
        "demand": asdict(covering([demand.demand for demand in demands])) if demands else None,
        "bands": {
            entry.name: asdict(band)
            for entry in results.criteria_of_runs.entries
            if (band := criterion_band(results, row, motion, entry.name))
        },
    }


def design_document(study: Study) -> dict[str, Any]:
    """Settings that laws lacked, designs of weights and linear loops as a JSON object; empty where there are none."""
    document: dict[str, Any] = {
        "settings": [
            {"controller": label, "notes": taken.in_words, "settings": dict(taken.settings)}
            for label, taken in study.taken_settings
        ],
        "weights": [
            {"controllers": labels, "notes": weights.in_words, **weights.document()}
            for labels, weights in study.designs
        ],
        "loops": [
            {"controller": label, "notes": notes, "margins": law.margins and asdict(law.margins)}
            for label, law in study.laws
            if (notes := (*law.notes, *law.shaping_notes))
        ],
    }
    return {name: value for name, value in document.items() if value}


def _step_check(results: StudyResults, row: int, motion: int) -> dict[str, Any] | None:
    if not results.step_checked or not results.quantities.done[row, motion, 1]:
        return None
    changes, steps = results.step_changes(row, motion), results.quantities.steps[row, motion, 1]
    return {
        "outcome": str(outcome_names(results.quantities.outcome)[row, motion, 1]),
        "steps": None if np.isnan(steps) else int(steps),
        "largest": None if changes is None else max(changes.values()),
        "changes": known_criteria(changes or {}),
    }


def _criteria_csv(results: StudyResults) -> str:
    entries, quantities = results.criteria_of_runs.entries, results.quantities
    units = {quantity.name: quantity.unit.replace("^", "") for quantity in results.criteria_of_runs.declared}
    heads = [f"{entry.name} [{units[entry.name]}]" for entry in entries]
    lines: list[list[str]] = [["controller", "motion", "use", "outcome", "energy_error", "score", *heads]]
    outcomes = outcome_names(quantities.outcome[:, :, 0])
    scores = [results.scores(row) for row in range(len(results.rows))]
    for row, motion in np.argwhere(quantities.done[:, :, 0]).tolist():
        facts = results.motions[motion]
        error, score = quantities.energy_error[row, motion, 0], scores[row][motion]
        values = (results.criteria_of_runs.numbers[entry.name][row, motion, 0] for entry in entries)
        labels = [results.rows[row].label, facts.name, facts.use, str(outcomes[row, motion])]
        lines.append([*labels, _cell(error, 3), _cell(score, 6), *map(_cell, values)])
    return csv_text(lines)


def _cell(number: float, digits: int = 9) -> str:
    return "" if math.isnan(number) else f"{number:.{digits}g}"


def _profiles_csv(results: StudyResults) -> str:
    axes, numbers = results.quantities.axes, results.quantities.numbers
    shown = [
        quantity
        for quantity in results.quantities.declared
        if quantity.axis in ("floor", "storey") and not quantity.name.startswith("rms_")
    ]
    lines: list[list[str]] = [["controller", "motion", "quantity", "where", "peak", "rms", "unit"]]
    for row, motion in np.argwhere(results.quantities.finished[:, :, 0]).tolist():
        labels = [results.rows[row].label, results.motions[motion].name]
        for quantity in shown:
            name, unit = quantity.name.removeprefix("peak_"), quantity.unit.replace("^", "")
            peaks = numbers[quantity.name][row, motion, 0]
            rms = numbers.get(f"rms_{name}")
            squares = np.full_like(peaks, np.nan) if rms is None else rms[row, motion, 0]
            lines += [
                [*labels, name.replace("_", " "), where, _cell(peak), _cell(square), unit]
                for where, peak, square in zip(
                    axes[quantity.axis], peaks.tolist(), squares.tolist(), strict=True
                )
                if not math.isnan(peak)
            ]
    return csv_text(lines)
