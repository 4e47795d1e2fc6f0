"""The study judges what a tuning has found: its laws and references as rows, on training and test motions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar, Final

from mrwork.base.arguments import Threads, checked
from mrwork.base.numbers import apart, significant, with_decimals
from mrwork.base.progress import OnProgress
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.closed_loop.evaluation import Spread
from mrwork.control.laws.law_settings import design_law, settings_of
from mrwork.errors import Interrupted, SettingError
from mrwork.store.journal import Journal
from mrwork.study.histories import RunHistory
from mrwork.study.results import StudyResults
from mrwork.study.running import run_study
from mrwork.study.runs import asking
from mrwork.study.schema import Use
from mrwork.study.study import Arrangement, Row, Study
from mrwork.tuning.law_plan import check_controllable
from mrwork.tuning.placing import placed_study
from mrwork.tuning.space import LawCandidate
from mrwork.tuning.tuned_laws import Front, FrontPoint, TunedLaw, TuningResults
from mrwork.workers.engine import Workers, on_executor

_NOT_HELD_OUT: Final = RemarkKind(
    "motions_not_held_out",
    "no motion is for testing only: every score is of the motions that the settings were tuned on",
    'give some motions use = "training" and others use = "test"',
)
_EXCEEDS: Final = RemarkKind(
    "limits_exceeded_on_test",
    "{0} keeps its limits on the training motions and exceeds them by {percent} % of the limits in all on the test "
    "motions",
    warns=True,
)
_BEATEN: Final = RemarkKind(
    "law_beaten",
    "{0} does not reach the score of {1} on the {on} motions ({own} against {other})",
    warns=True,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """What a law is worth under some motions, of the nominal study.

    `score` is the study's, whatever was minimised, and `criteria` are ratios of the criteria to i = 0. `objective` and
    `violation` are what the tuning has minimised, with its risk, and over the realisations where it is robust.
    """

    score: Spread
    criteria: dict[str, Spread]
    objective: float
    violation: float


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TunedStudy(StudyResults):
    """Results of a study with the laws and references that a tuning has found as rows; `tuned` is the tuning."""

    _made_by: ClassVar[str] = "mr.tuning.judge(study, mr.tune(study)) or mr.load(folder)"

    tuned: TuningResults

    @checked
    def motions_of(self, use: Use) -> tuple[int, ...]:
        """Indices of the motions on which laws were tuned, or of the judged ones; the same where none was held out."""
        training = tuple(
            number for number, motion in enumerate(self.motions) if motion.name in self.tuned.training
        )
        return training if use == "training" else tuple(self.judged_motions)

    @property
    def held_out(self) -> bool:
        """Whether laws are judged on motions that they were not tuned on."""
        return not set(self.motions_of("training")) & set(self.judged_motions)

    @checked
    def judgement(self, law: TunedLaw, use: Use) -> Judgement | None:
        """What a law or a reference is worth on the training or the test motions; `None` where it has not run there."""
        row, motions, relative_to = self.row_of_law(law), self.motions_of(use), law.objective.relative_to
        off, against = self.row_of("passive_off"), self.row_of(relative_to)
        if row is None or off is None or against is None or (use == "test" and not self.held_out):
            return None
        if not motions or not self.quantities.done[row, list(motions), 0].all():
            return None
        ratios, names = (
            self.ratios_over(off),
            [entry.name for entry in self.criteria_of_runs.entries if entry.ratio],
        )
        robust = law.robust and self.n_realisations
        realisations = slice(-self.n_realisations, None) if robust else slice(1)
        runs = self.criteria_of_runs.part([row, against], list(motions), realisations)
        scores = law.objective.scores(runs.of_row(0), {relative_to: runs.of_row(1)})
        return Judgement(
            score=self.score(row, motions),
            criteria={name: Spread.of(ratios[name][row, list(motions)].tolist()) for name in names},
            objective=float(scores.objective[0]),
            violation=float(scores.violation[0]),
        )

    @checked
    def row_of_law(self, law: TunedLaw) -> int | None:
        """Index of the row of a law or a reference; `None` where it is no row."""
        if law.kind in ("passive_off", "best_passive"):
            return self.row_of(law.kind)
        return next((number for number, row in enumerate(self.rows) if row.label == law.label), None)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Those of study and tuning, each code of both once, and on what scores cannot say or a law does not reach."""
        of_study = super(TunedStudy, self).remarks
        codes = {remark.code for remark in of_study}
        of_tuning = (remark for remark in self.tuned.remarks if remark.code not in codes)
        held_out = () if self.held_out else (_NOT_HELD_OUT.remark(),)
        return (
            *of_study,
            *held_out,
            *of_tuning,
            *(found for law in self.tuned.laws for found in self._judged(law)),
        )

    def _judged(self, law: TunedLaw) -> Iterator[Remark]:
        judged = self.judgement(law, "test")
        if judged is not None and judged.violation > 0.0 and not law.violation:
            percent, measured = significant(100.0 * judged.violation, 2), Measured(judged.violation, "")
            yield _EXCEEDS.remark(law.label, measured=measured, percent=percent)
        rows = {each.label: self.row_of_law(each) for each in (law, *self.tuned.references)}
        scores = {label: self.score(row).mean for label, row in rows.items() if row is not None}
        own = scores.get(law.label, math.nan)
        lower = {label: score for label, score in scores.items() if score < own}
        if lower:
            best = min(lower, key=lambda label: lower[label])
            shown, other = apart(with_decimals, own, lower[best], 3)
            on = "test" if self.held_out else "training"
            yield _BEATEN.remark(law.label, best, on=on, own=shown, other=other)


@checked
@on_executor
def judge(
    study: Study,
    tuned: TuningResults,
    *,
    journal: Journal | None = None,
    kept: Callable[[int, int], bool] = lambda row, motion: True,
    keep: Callable[[int, int, RunHistory], None] = lambda row, motion, history: None,
    on_progress: OnProgress | None = None,
    threads: Threads = 0,
    executor: Executor | Workers | None = None,  # noqa: ARG001, of the decorator
) -> TunedStudy:
    """Run a study with the laws and references of its tuning as rows, and every point of their fronts.

    Where placements were compared, the dampers stand at the best. All other arguments are as in `run_study`.

    Returns
    -------
    TunedStudy
        The results of the study, with the tuning, whose fronts have the objectives on the test motions.

    Raises
    ------
    Interrupted
        On Ctrl-C, with the `TunedStudy` so far.

    Examples
    --------
    >>> import mrwork as mr
    >>> study = mr.read_study("study.toml")  # doctest: +SKIP
    >>> results = mr.tuning.judge(study, mr.tune(study))  # doctest: +SKIP
    >>> results.judgement(results.tuned.laws[0], "test").score.mean  # doctest: +SKIP
    0.655
    """
    objectives = (law.objective for law in tuned.laws)
    asked = (name for objective in objectives for name in (*objective.weights, *objective.limits))
    of_fronts = (name for front in tuned.fronts for name in front.objectives)
    wider = asking(with_tuned_rows(study, tuned), (*asked, *of_fronts))
    try:
        results = run_study(
            wider, journal=journal, kept=kept, keep=keep, on_progress=on_progress, threads=threads
        )
    except Interrupted as interrupt:
        raise Interrupted(with_tuning(interrupt.result, tuned), "study") from None
    made = with_tuning(results, tuned)
    if not made.held_out:
        return made
    try:
        fronts = [_judge_front(front, wider, tuned, journal, threads) for front in tuned.fronts]
    except Interrupted:
        raise Interrupted(made, "fronts") from None
    return replace(made, tuned=replace(tuned, fronts=tuple(fronts)))


def with_tuning(results: StudyResults, tuned: TuningResults) -> TunedStudy:
    """The results of a study with the tuning that its rows are from."""
    return TunedStudy(
        **{field.name: getattr(results, field.name) for field in fields(StudyResults)}, tuned=tuned
    )


def _judge_front(
    front: Front, study: Study, tuned: TuningResults, journal: Journal | None, threads: int
) -> Front:
    """A front whose points have their objectives on the test motions, from a study with the points as rows."""
    law = next(law for law in tuned.laws if law.label == front.label)
    constant = next(reference for reference in tuned.references if reference.kind == "best_passive")
    points = tuple(
        replace(law, label=f"point {number}", settings=point.settings)
        for number, point in enumerate(front.points, start=1)
    )
    realisations = study.realisations if law.robust else None
    alone = replace(study, arrangements=(study.at_zero,), histories=(), realisations=realisations)
    of_points = replace(tuned, laws=points, references=(constant,), fronts=())
    results = judge(alone, of_points, journal=journal, threads=threads)

    def judged(point: FrontPoint, found: TunedLaw) -> FrontPoint:
        parts = {name: replace(law.objective, weights={name: 1.0}) for name in front.objectives}
        of_parts = {
            name: results.judgement(replace(found, objective=part), "test") for name, part in parts.items()
        }
        return replace(
            point,
            test={name: judgement.objective for name, judgement in of_parts.items() if judgement is not None},
        )

    return replace(front, points=tuple(map(judged, front.points, points)))


def with_tuned_rows(study: Study, tuned: TuningResults) -> Study:
    """The study, with its dampers at the best placement, with the references and laws of a tuning as further rows.

    One that has them already stays as it is.
    """
    if tuned.places and study.table.places is not None:
        study = placed_study(study, tuned.places[0].storeys)
    kinds, labels = {row.kind for row in study.rows}, {row.label for row in study.rows}
    rows: list[Arrangement] = []
    for law in (*tuned.references, *tuned.laws):
        if law.label in labels or (law.kind in ("passive_off", "best_passive") and law.kind in kinds):
            continue
        # Settings that make no law have no row, which the tuning warns of.
        with suppress(SettingError):
            row = Row(label=law.label, kind=law.kind, description=law.origin)
            rows.append(_arrange(study, law.law, law.settings, row))
    return replace(study, is_whole=False, arrangements=(*study.arrangements, *rows))


def _arrange(study: Study, law: str, settings: Mapping[str, Any], row: Row) -> Arrangement:
    """The dampers of a study under a law with these settings, as `mrwork respond` simulates it."""
    candidate = LawCandidate(settings)
    limited = study.problem.limited_to(candidate.largest_command)
    designed = design_law(law, limited, settings_of(law, candidate.of_law))
    dead_zone, slope = candidate.shape
    return replace(
        study.at_zero,
        row=row,
        devices=limited.all_devices,
        law=replace(designed, dead_zone=dead_zone, command_slope=slope),
    )


@checked
def with_tuned_law(
    study: Study, found: TunedLaw | Front, point: FrontPoint | None = None, *, label: str = ""
) -> Study:
    """The study with a law that `tune` has found as one more row, for `run_study`.

    Parameters
    ----------
    found
        A law of `TuningResults.laws`, or a front of `TuningResults.fronts`.
    point
        A point of the front; by default `Front.pick()`.
    label
        Name of the row; by default the label of the law.

    Raises
    ------
    SettingError
        If the study has a row of this name or no damper that follows a command, or a point goes with no front.

    Examples
    --------
    >>> import mrwork as mr
    >>> front = mr.tune(study).fronts[0]  # doctest: +SKIP
    >>> picked = mr.tuning.with_tuned_law(study, front, front.pick({"peak_drift": 1.0}))  # doctest: +SKIP
    >>> mr.run_study(picked).to_pandas().loc[front.label]  # doctest: +SKIP
    """
    check_controllable(study)
    if isinstance(found, TunedLaw) and point is not None:
        raise SettingError(f"`point` is of a front, and `found` is the law {found.label}; leave it out")
    chosen = found if isinstance(found, TunedLaw) else point or found.pick()
    name = label or found.label
    if name in (row.label for row in study.rows):
        raise SettingError(f"the study has a row called {name!r} already; give another `label`")
    arrangement = _arrange(study, found.law, chosen.settings, Row(label=name, kind="controller"))
    return replace(study, is_whole=False, arrangements=(*study.arrangements, arrangement))
