"""Several run folders of one kind side by side: fits, studies or tunings."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.numbers import NOTHING, format_fixed, value_and_error
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.table import Table
from mrwork.errors import MrworkError, SettingError
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.runs.load import StoredRun, load
from mrwork.uncertainty.bands.prediction import predict_test

if TYPE_CHECKING:
    from mrwork.study.results import StudyResults
    from mrwork.tuning.results import TuningResults

_PEAKS = ("peak_drift", "peak_acceleration")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class RunsComparison(Summarised):
    """Runs side by side: a sentence on what can be compared, tables, and remarks on what cannot.

    `fits` are those of the runs by their names, empty for studies and tunings.
    """

    _made_by = "mr.compare_runs([run, run])"

    title: str
    verdict: str
    tables: tuple[Table, ...]
    remarks: tuple[str, ...] = ()
    fits: Mapping[str, Fit] = field(default_factory=dict)

    def _summary(self) -> Summary:
        first = self.tables[0]
        return Summary(
            title=f"{self.title}. {self.verdict}", columns=first.columns, rows=first.rows, notes=self.remarks
        )


@checked
def compare_runs(runs: Sequence[str | Path], *, tests: Sequence[DamperTest] = ()) -> RunsComparison:
    """Compare run folders of one verb.

    Parameters
    ----------
    runs
        Two or more folders, as of `load`.
    tests
        Of fits: tests that each predicts, where none of them was fitted to it. By default those that every folder has
        from ``mrwork predict``.

    Returns
    -------
    RunsComparison
        Of fits the accuracy on tests that none of them has seen, models, bands and parameters; of studies and tunings
        the scores and peaks of the laws that they have in common, on the motions that they have in common.

    Raises
    ------
    SettingError
        Where there are fewer than two folders, or they are of different verbs.
    RecordError
        Where one is no run folder.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.compare_runs(["out/one", "out/other"])  # doctest: +SKIP
    """
    places = [Path(run) for run in runs]
    if len(places) < 2:
        raise SettingError(f"a comparison takes two or more run folders, and {len(places)} came")
    held = [load(place) for place in places]
    kinds = {type(each).__name__ for each in held}
    if len(kinds) > 1:
        raise SettingError(
            f"the folders are of different verbs, {list_names(sorted(kinds))}; give those of one verb"
        )
    short = [place.resolve().name for place in places]
    names = short if len(set(short)) == len(short) else [str(place) for place in places]
    if isinstance(held[0], StoredRun):
        return _of_fits(names, [each for each in held if isinstance(each, StoredRun)], tests)
    if tests:
        raise SettingError("tests are predicted by fits, and these are no fits; leave the tests out")
    # The wing of control, which fits do not need.
    from mrwork.study.results import StudyResults
    from mrwork.tuning.results import TuningResults

    if isinstance(held[0], StudyResults):
        return _of_studies(names, [each for each in held if isinstance(each, StudyResults)])
    return _of_tunings(names, [each for each in held if isinstance(each, TuningResults)])


def _of_fits(names: Sequence[str], runs: Sequence[StoredRun], tests: Sequence[DamperTest]) -> RunsComparison:
    percents, remarks = _predicted(runs, tests) if tests else _stored(runs)
    tables = []
    if percents:
        columns = np.array([*percents.values()])
        tables.append(
            Table(
                title="Fit of tests that none was fitted to (%)",
                columns=("Test", *names),
                rows=tuple(
                    (name, *(format_fixed(each, 2) for each in row)) for name, row in percents.items()
                ),
                foot=("Median", *(format_fixed(float(each), 2) for each in np.median(columns, axis=0))),
            )
        )
        medians, worst = np.median(columns, axis=0), columns.min(axis=0)
        parts = [
            f"{name} to {median:.1f} % in the median, {least:.1f} % at worst"
            for name, median, least in zip(names, medians.tolist(), worst.tolist(), strict=True)
        ]
        verdict = f"Of {len(percents)} tests that none was fitted to, {'; '.join(parts)}."
    else:
        verdict = (
            "Their accuracy cannot be compared: there is no test that none of them was fitted to. Give tests that all "
            "of them have to predict."
        )
    tables.append(
        Table(
            title="Fits",
            columns=("Run", "Model", "Follow the command", "Fit (%)", "Tests", "Bands", "Status"),
            rows=tuple(
                (
                    name,
                    run.fit.spec.title,
                    ", ".join(run.fit.spec.following) or "none",
                    format_fixed(run.fit.fit_percent, 2),
                    str(len(run.fit.quality)),
                    "none" if run.calibration is None else f"{len(run.calibration.tests)} tests",
                    run.fit.status.replace("_", " "),
                )
                for name, run in zip(names, runs, strict=True)
            ),
            words=(1, 2, 5, 6),
            note="The fit is that of the tests of each run, which are not the same tests.",
        )
    )
    tables.append(_parameters(names, runs))
    return RunsComparison(
        title=f"{len(names)} fits",
        verdict=verdict,
        tables=tuple(tables),
        remarks=tuple(remarks),
        fits={name: run.fit for name, run in zip(names, runs, strict=True)},
    )


def _parameters(names: Sequence[str], runs: Sequence[StoredRun]) -> Table:
    every = dict.fromkeys(estimate.name for run in runs for estimate in run.fit.estimates)
    of_runs = [{each.name: each for each in run.fit.estimates} for run in runs]

    def cell(name: str, of_run: int) -> str:
        estimate = of_runs[of_run].get(name)
        if estimate is None:
            return NOTHING
        value, error = value_and_error(estimate.value, estimate.standard_error)
        return f"{value} ± {error}" if error != NOTHING else value

    differ = len({run.fit.model for run in runs}) > 1
    meanings = " Parameters of different models have different meanings, also under one name."
    return Table(
        title="Parameters",
        columns=("Parameter", *names),
        rows=tuple((name, *(cell(name, number) for number in range(len(runs)))) for name in every),
        note=f"With standard errors.{meanings if differ else ''}",
    )


def _stored(runs: Sequence[StoredRun]) -> tuple[dict[str, list[float]], list[str]]:
    """Fits of the tests that every folder has as held out."""
    found = [
        {each.name: each.fit_percent for each in run.held_out.tests} if run.held_out else {} for run in runs
    ]
    fitted = {Path(each.test).stem for run in runs for each in run.fit.quality}
    common = [name for name in found[0] if all(name in each for each in found) and name not in fitted]
    return {name: [each[name] for each in found] for name in common}, []


def _predicted(
    runs: Sequence[StoredRun], tests: Sequence[DamperTest]
) -> tuple[dict[str, list[float]], list[str]]:
    """Fits of tests as every run predicts them, without those that any of them was fitted to."""
    percents: dict[str, list[float]] = {}
    seen, failed = [], []
    for test in tests:
        if any(run.fit.seen(run.fit.observed(test)) for run in runs):
            seen.append(test.name)
            continue
        row = []
        for run in runs:
            try:
                row.append(predict_test(run.fit, test).fit_percent)
            except MrworkError:
                row.append(math.nan)
                failed.append(test.name)
        percents[test.name] = row
    remarks = [f"Left out, because a fit has seen them: {list_names(seen)}."] if seen else []
    return percents, remarks + ([f"Not predicted by every fit: {list_names(failed)}."] if failed else [])


def _of_studies(names: Sequence[str], studies: Sequence[StudyResults]) -> RunsComparison:
    of_all = [
        motion.name
        for motion in studies[0].motions
        if all(motion.name in [each.name for each in study.motions] for study in studies)
    ]
    rows_of = [{row.label: number for number, row in enumerate(study.rows)} for study in studies]
    common = [label for label in rows_of[0] if all(label in rows for rows in rows_of)]
    places = [
        [number for number in study.judged_motions if study.motions[number].name in of_all]
        for study in studies
    ]
    if not (common and all(places)):
        raise SettingError(
            "the studies have no law or no motion of the same name in common; give studies that do, or label them alike"
        )

    def numbers(study: StudyResults, row: int, motions: Sequence[int]) -> list[float]:
        ratios = [study.ratios(row, motion, "passive_off") for motion in motions]
        return [
            study.score_under(row, motions),
            *(float(np.mean([each[name] for each in ratios])) for name in _PEAKS),
        ]

    laws = {
        label: [
            numbers(study, rows[label], own)
            for study, rows, own in zip(studies, rows_of, places, strict=True)
        ]
        for label in common
    }
    left_out = {motion.name for study in studies for motion in study.motions} - set(of_all)
    others = {label for rows in rows_of for label in rows} - set(common)
    remarks = [
        *([f"Not under every study, and left out: {list_names(sorted(left_out))}."] if left_out else []),
        *([f"Not in every study: {list_names(sorted(others))}."] if others else []),
    ]
    note = f"Over i = 0 of each study, means over {len(places[0])} motions that they have in common."
    return RunsComparison(
        title=f"{len(names)} studies",
        verdict=f"Lowest score of the laws that all have, over the motions that all have: {_leading(names, laws)}.",
        tables=(_law_table("Laws of all studies", names, laws, note),),
        remarks=tuple(remarks),
    )


def _of_tunings(names: Sequence[str], tunings: Sequence[TuningResults]) -> RunsComparison:
    found = [{law.label: law.judged for law in tuning.ranked} for tuning in tunings]
    laws = {
        label: [
            [each[label].score, *(each[label].criteria.get(name, math.nan) for name in _PEAKS)]
            if label in each
            else [math.nan] * (1 + len(_PEAKS))
            for each in found
        ]
        for label in dict.fromkeys(label for each in found for label in each)
    }
    motions = {tuple(sorted(tuning.testing or tuning.training)) for tuning in tunings}
    apart = "They are not judged on the same motions, so their scores are not comparable."
    return RunsComparison(
        title=f"{len(names)} tunings",
        verdict=f"Lowest score on test motions: {_leading(names, laws)}.",
        tables=(
            _law_table("Laws of the tunings", names, laws, "Over i = 0, on the test motions of each tuning."),
        ),
        remarks=(apart,) if len(motions) > 1 else (),
    )


_Laws = Mapping[str, Sequence[Sequence[float]]]
"""Score and both peaks over those at i = 0, of each law in every run; NaN where a run does not have it."""


def _law_table(title: str, names: Sequence[str], laws: _Laws, note: str) -> Table:
    return Table(
        title=title,
        columns=("", *(("Score", "Drift", "Acc.") * len(names))),
        rows=tuple(
            (label, *(format_fixed(each, 3) for numbers in of_runs for each in numbers))
            for label, of_runs in laws.items()
        ),
        over=(("", 1), *((name, 3) for name in names)),
        note=note,
    )


def _leading(names: Sequence[str], laws: _Laws) -> str:
    """The law with the lowest score in each run."""
    scores = [{label: of_runs[number][0] for label, of_runs in laws.items()} for number in range(len(names))]
    best = [min(each, key=lambda label: (math.isnan(each[label]), each[label])) for each in scores]
    return "; ".join(f"{label} in {name}" for name, label in zip(names, best, strict=True))
