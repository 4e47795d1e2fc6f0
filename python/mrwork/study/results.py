"""Results of a study: its runs, the criteria that follow from them, the check of the step, and the size of its dampers.

Dampers are of a size with their building if their force is considerable beside its base shear, and their strokes are
not next to nothing.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, ClassVar, Literal, get_args

import numpy as np

from mrwork.base import arguments
from mrwork.base.arguments import NotNegative, Positive, Whole
from mrwork.base.labelled import NamedArrays, labels_of, tree_of
from mrwork.base.numbers import counted, format_rounded, round_to
from mrwork.base.plotted import Plots
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.evaluation import (
    SCORE,
    STANDARD_GRAVITY,
    Scales,
    Spread,
    criteria,
    criterion,
    ratio,
    score,
)
from mrwork.closed_loop.responses import ENERGY_TOLERANCE
from mrwork.control.weights.limits import sine_force
from mrwork.dampers.parameters import polynomial_laws
from mrwork.dampers.spec import DamperSpec
from mrwork.dampers.tested_range import OperatingRange
from mrwork.errors import SettingError
from mrwork.motions.spectrum import Intensity
from mrwork.study.levels import RecordLevels
from mrwork.study.run_result import (
    DeviceDemand,
    LabelledRuns,
    RunResult,
    damper_warnings,
    demands_of,
    quantities_of_runs,
)
from mrwork.study.schema import Use
from mrwork.study.study import Kind, MotionOfStudy, Row, level_warnings

if TYPE_CHECKING:
    from mrwork.base.labelled import DataFrame, DataTree

Key = tuple[int, int]
"""Indices of the row and the motion of a run."""


BAND = 0.9
"""Share of the realisations within a band."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RealisationBand:
    """A number over realisations: median, and the ends between which 90 % of them lie; infinite where a run failed."""

    lower: float
    median: float
    upper: float

    @staticmethod
    def of(values: Floats) -> RealisationBand:
        """The band of one value for each realisation, shape (n,)."""
        if not np.isfinite(values).all():
            return RealisationBand(lower=math.nan, median=math.nan, upper=math.inf)
        lower, median, upper = np.quantile(values, (0.5 * (1.0 - BAND), 0.5, 0.5 * (1.0 + BAND))).tolist()
        return RealisationBand(lower=lower, median=median, upper=upper)


# Motions in the summary.
_MOTIONS_SHOWN = 5

OFF_BALANCE = (
    "Energies that do not balance indicate that a law chatters or that the step is too long: "
    "halve the step and compare, as --check-step does."
)
"""Advice for runs whose energies do not balance."""
_NO_CRITERIA = " A run that does not finish has no criteria."


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionFacts:
    """A ground motion in tables: peak [m/s^2], duration [s], source, processing, use, groups, record and intensity.

    The intensity is in the measure that the motion was scaled to, else its peak; `None` in results of former versions.
    `level` is what it was scaled to in words, as "0.3 g" or "factor 2"; `copy_of` names the record that its own is a
    copy of.
    """

    name: str
    peak: NotNegative
    duration: NotNegative
    source: str = ""
    changes: tuple[str, ...] = ()
    synthetic: bool = False
    use: Use = "test"
    groups: tuple[str, ...] = ()
    record: str = ""
    intensity: Intensity | None = None
    level: str = ""
    copy_of: str = ""

    @property
    def at_level(self) -> tuple[str, Intensity]:
        """The record, and the intensity; of results without one the peak ground acceleration."""
        return self.record or self.name, self.intensity or Intensity(measure="pga", value=self.peak)

    @staticmethod
    def of(motion: MotionOfStudy) -> MotionFacts:
        """Those of a motion of a study."""
        own = ("name", "peak", "duration", "source", "changes", "groups")
        facts = {name: getattr(motion.ground, name) for name in own}
        intensity = motion.intensity or Intensity(measure="pga", value=motion.ground.peak)
        of_study = {name: getattr(motion, name) for name in ("synthetic", "use", "record", "copy_of")}
        return MotionFacts(**facts, **of_study, intensity=intensity, level=motion.level_in_words)


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperFacts:
    """Dampers at one place: name, model with its laws, how many, largest command, their storey, tested ranges.

    `share` is that of the drift by which they are stretched, and of their force along it: the cosine of their angle.
    """

    name: str
    model: str
    count: Positive
    largest_command: NotNegative
    storey: Whole
    tested: OperatingRange | None
    share: float = 1.0


def _damper_in_words(spec: DamperSpec) -> str:
    """The model and the laws of the parameters that follow the command."""
    laws = () if spec.current is None else zip(spec.without_laws.names, spec.current.laws, strict=True)
    following = {name: law for name, law in laws if law != polynomial_laws()[0]}
    return f"{spec.name}, {', '.join(f'{name} {law}' for name, law in following.items()) or 'all constant'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingFacts:
    """A building in numbers: mass of each floor [kg], stiffness of each storey [N/m], periods [s], damping ratios.

    `heights` are those of the storeys [m], if they are known, `yield_drifts` drifts at which they yield [m] and `loads`
    weights on them [N] with P-delta, if there are; `drift_limit` is a drift ratio to be kept, or 0. `passive` are the
    passive devices, and `passive_storeys` the indices of those that stand across a storey.

    There are no stiffnesses where it is no chain of storeys, and the masses are then those of the diagonal.
    """

    name: str
    masses: tuple[float, ...]
    stiffnesses: tuple[float, ...]
    periods: tuple[float, ...]
    damping_ratios: tuple[float, ...]
    heights: tuple[float, ...] = ()
    yield_drifts: tuple[float, ...] = ()
    loads: tuple[float, ...] = ()
    drift_limit: float = 0.0
    passive: tuple[str, ...] = ()
    passive_storeys: tuple[int, ...] = ()

    @property
    def scales(self) -> Scales:
        """What criteria are divided by."""
        return Scales(
            weight=sum(self.masses) * STANDARD_GRAVITY,
            heights=np.array(self.heights),
            yield_drifts=np.array(self.yield_drifts),
            loads=np.array(self.loads),
        )

    @property
    def has_ratios(self) -> bool:
        """Whether every storey has a height, so that each of its drifts is a drift ratio."""
        return bool(self.heights) and min(self.heights) > 0.0

    @staticmethod
    def of(building: Building) -> BuildingFacts:
        """Those of a building without dampers."""
        devices = [each for each in building.elements if not each.in_stiffness]
        across = (np.flatnonzero((building.drifts == each.row).all(axis=1)).tolist() for each in devices)
        return BuildingFacts(
            passive=tuple(each.name for each in devices),
            passive_storeys=tuple(storey for storeys in across for storey in storeys[:1]),
            name=building.name,
            masses=tuple(np.diag(building.mass).tolist()),
            stiffnesses=tuple(building.storey_stiffnesses.tolist()),
            periods=tuple(building.periods.tolist()),
            damping_ratios=tuple(building.damping_ratios.tolist()),
            heights=tuple(building.drift_heights.tolist()),
            yield_drifts=tuple(building.yield_drifts[: len(building.drifts)].tolist()),
            loads=tuple(building.loads[: len(building.drifts)].tolist()),
            drift_limit=building.drift_limit,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """What a study decides with each set of laws, of which the first is the chosen one.

    `values` are lowest scores, or differences of scores and relative changes of quantities against the reference.
    """

    subject: str
    answers: tuple[str, ...]
    values: tuple[float, ...]

    @property
    def changes(self) -> bool:
        """Whether the sets do not agree."""
        return len(set(self.answers)) > 1

    @property
    def in_words(self) -> str:
        """Text such as "lowest score of control laws: LQG (0.71) with set 1, skyhook (0.69) with set 2"."""
        parts = [
            f"{answer} ({value:.3g}) with set {number}"
            for number, (answer, value) in enumerate(zip(self.answers, self.values, strict=True), start=1)
        ]
        return f"{self.subject}: {', '.join(parts)}"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Ensemble(Summarised):
    """A study with each of the `sets` of laws of its dampers, the chosen one first, and its verdicts."""

    _made_by: ClassVar[str] = "mr.load(folder).ensemble"

    sets: tuple[str, ...]
    verdicts: tuple[Verdict, ...]

    @property
    def in_words(self) -> tuple[str, ...]:
        """The sets, and each verdict that changes, a sentence each."""
        changing = [f"verdict changes: {each.in_words}" for each in self.verdicts if each.changes]
        return (
            *(f"set {number}: {words}" for number, words in enumerate(self.sets, start=1)),
            *(changing or [f"none of {len(self.verdicts)} verdicts changes"]),
        )

    def _summary(self) -> Summary:
        return Summary(
            title=f"The study with {len(self.sets)} sets of laws that predict nearly as well",
            notes=self.in_words,
        )


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StudyResults(Summarised):
    """Runs of a study, as far as they are done: those of `run_study`, or read back from its folder.

    `labelled` has the criteria over row, motion and realisation, of which the first is the nominal one. The first rows
    are the building without dampers and i = 0. `runs` are the runs by (row, motion), and `halved` those with half the
    step, if it is checked, which are the second realisation of `quantities`. `demanded` are the demands on the dampers
    by (row, motion). `chosen_on` are the names of the motions that the best constant command is chosen on,
    `design_levels` their levels where the study names one or its records have several, `limit` is the criterion with
    its limit of which the page has the fragility, `choices` sentences on constant commands that were chosen,
    `study_warnings` are those of the study, `damper_warnings` sentences on demand outside the tested ranges, on laws
    out of their range and on the size of dampers. `facts` are further lines of the page. `detailed` is the motion whose
    histories the page shows, of the rows `with_histories`. `ensemble` is the study with each set of laws that predicts
    nearly as well, `None` if run without ``--ensemble``.
    """

    _made_by: ClassVar[str] = "mr.run_study(study) or mr.load(folder)"

    title: str
    rows: tuple[Row, ...]
    motions: tuple[MotionFacts, ...]
    labelled: LabelledRuns
    runs: Mapping[Key, RunResult]
    halved: Mapping[Key, RunResult] | None = None
    floor_names: tuple[str, ...]
    storey_names: tuple[str, ...]
    command_unit: str
    building: BuildingFacts | None = None
    dampers: tuple[DamperFacts, ...] = ()
    demanded: Mapping[Key, tuple[DeviceDemand, ...]] = field(default_factory=dict)
    chosen_on: tuple[str, ...] = ()
    design_levels: tuple[str, ...] = ()
    limit: Mapping[str, float] = field(default_factory=dict)
    choices: tuple[str, ...] = ()
    study_warnings: tuple[str, ...] = ()
    damper_warnings: tuple[str, ...] = ()
    facts: tuple[tuple[str, str], ...] = ()
    detailed: Whole = 0
    with_histories: tuple[Whole, ...] = ()
    ensemble: Ensemble | None = None

    @property
    def plot(self) -> Plots[StudyResults]:
        """Figures of the runs, see `mr.plots`."""
        return Plots(self)

    @property
    def device_names(self) -> tuple[str, ...]:
        """Names of the dampers."""
        return tuple(each.name for each in self.dampers)

    @property
    def checked(self) -> frozenset[Key] | None:
        """Runs that were repeated with half the step; `None` if the step is not to be checked."""
        return None if self.halved is None else frozenset(self.halved)

    @arguments.checked
    def criteria(self, row: int, motion: int) -> dict[str, float] | None:
        """Every criterion of a run that finished."""
        self.check_place(row, motion)
        run = self.runs.get((row, motion))
        return self.labelled.criteria((row, motion, 0)) if run is not None and run.finished else None

    @arguments.checked
    def step_changes(self, row: int, motion: int) -> dict[str, float] | None:
        """Relative change of every criterion with half the step; `None` unless both runs finished."""
        whole = self.criteria(row, motion)
        half = (self.halved or {}).get((row, motion))
        if whole is None or half is None or not half.finished:
            return None
        other = self.labelled.criteria((row, motion, 1))
        return {name: _relative_change(value, other[name]) for name, value in whole.items()}

    @arguments.checked
    def demands(self, row: int, motion: int) -> tuple[DeviceDemand, ...]:
        """Demand of a run on each device; none for a run without dampers or that did not finish."""
        self.check_place(row, motion)
        return self.demanded.get((row, motion), ())

    @property
    def n_realisations(self) -> int:
        """Number of realisations of what is uncertain, beside the nominal one."""
        return self.labelled.shape[2] - (1 if self.halved is None else 2)

    @property
    def realised_rows(self) -> list[int]:
        """The rows that were simulated with realisations."""
        rows = range(len(self.rows))
        return [row for row in rows if _values(self, row, self.judged_motions, "energy_error") is not None]

    @property
    def record_levels(self) -> RecordLevels:
        """The test motions, or all where there are none, by record and intensity; copies are of the first record."""
        motions = {number: self.motions[number] for number in self._test_motions}
        levels = {
            number: (each.copy_of or each.at_level[0], each.at_level[1]) for number, each in motions.items()
        }
        return RecordLevels.of(levels)

    def _named_groups(self) -> dict[str, NamedArrays]:
        groups = {"criteria": self.labelled, "quantities": self.quantities}
        return {name: runs._named_arrays() for name, runs in groups.items()}

    @property
    def quantities(self) -> LabelledRuns:
        """Quantities of the runs over row, motion and realisation, and then floor, storey or device."""
        steps = [self.runs] if self.halved is None else [self.runs, self.halved]
        axes = {**self.labelled.axes, "floor": self.floor_names, "storey": self.storey_names}
        axes["realisation"] = axes["realisation"][: len(steps)]
        runs = {(*key, number): run for number, each in enumerate(steps) for key, run in each.items()}
        return quantities_of_runs(runs, axes, self.command_unit)

    @arguments.checked
    def to_xarray(self, *, by_record: bool = False) -> DataTree:
        """Criteria and quantities as two data sets "criteria" and "quantities" over named axes, with units.

        Quantities are those of the nominal realisation, and of half the step where it was checked.

        Parameters
        ----------
        by_record
            Whether the judged motions have the axes "record" and "intensity" [m/s^2] instead of "motion".

        Raises
        ------
        SettingError
            If they are to have these axes, and not every record has the same levels.

        Examples
        --------
        >>> import mrwork as mr
        >>> results = mr.run_study(mr.read_study("study.toml"))  # doctest: +SKIP
        >>> drift = results.to_xarray()["criteria/peak_drift"]  # doctest: +SKIP
        >>> drift.sel(realisation="nominal").max("motion")  # doctest: +SKIP
        """
        groups = self._named_groups()
        if by_record:
            at = self.record_levels
            if not at.is_full:
                raise SettingError(
                    f"not each of {counted(len(at.records), 'record')} has the same levels, several of one measure of "
                    "intensity; give all the same pga or sa, or leave by_record out"
                )
            axes = {
                "record": labels_of(at.records),
                "intensity": labels_of(at.levels, unit="m/s^2", long_name=at.measure),
            }
            groups = {name: each.split_axis("motion", at.places, axes) for name, each in groups.items()}
        return tree_of(self.title, groups)

    def to_pandas(self) -> DataFrame:
        """Criteria as a table: a row for each row of the study, motion and realisation; units are in `attrs`.

        `quantities.to_pandas()` is the table of the quantities, with storeys, floors and devices as columns.
        """
        return self.labelled.to_pandas()

    @arguments.checked
    def check_place(self, row: int, motion: int) -> None:
        """Refuse a row or a motion that the study has not."""
        if not (0 <= row < len(self.rows) and 0 <= motion < len(self.motions)):
            raise SettingError(
                f"there are {len(self.rows)} rows and {len(self.motions)} motions, counted from 0; give one of each, "
                f"not row {row} and motion {motion}"
            )

    @property
    def done(self) -> int:
        """Number of runs that are done, including those with half the step."""
        return len(self.runs) + len(self.checked or ())

    @property
    def total(self) -> int:
        """Number of runs of the whole study."""
        return len(self.rows) * len(self.motions) * (1 if self.checked is None else 2)

    @property
    def complete(self) -> bool:
        """Whether all runs are done, those with realisations, too."""
        wanted = len(self.rows) if self.n_realisations else 0
        return self.done == self.total and len(self.realised_rows) == wanted

    @property
    def status(self) -> Literal["finished", "interrupted"]:
        """Whether all runs are done, in a word of a manifest."""
        return "finished" if self.complete else "interrupted"

    @property
    def judged_motions(self) -> tuple[int, ...]:
        """Indices of the motions that scores and changes stand on: the test motions, or all where there are none.

        Of records at several levels they are those of the level for which laws are designed, where the study names it.
        """
        at_level = tuple(
            each for each in self._test_motions if [self.motions[each].level] == [*self.design_levels]
        )
        return at_level or self._test_motions

    @property
    def _test_motions(self) -> tuple[int, ...]:
        test = tuple(number for number, motion in enumerate(self.motions) if motion.use == "test")
        return test or tuple(range(len(self.motions)))

    @arguments.checked
    def finished_rows(self, motion: int) -> list[int]:
        """The rows whose run under a motion finished."""
        runs = ((row, self.runs.get((row, motion))) for row in range(len(self.rows)))
        return [row for row, run in runs if run is not None and run.finished]

    @arguments.checked
    def row_of(self, kind: Kind) -> int | None:
        """The first row of a kind, if there is one."""
        return next((number for number, row in enumerate(self.rows) if row.kind == kind), None)

    @arguments.checked
    def ratios(self, row: int, motion: int, against: Kind) -> dict[str, float]:
        """Ratio of every criterion to that of the first row of a kind; NaN if there is no such row."""
        return self.ratios_to(row, motion, self.row_of(against))

    @arguments.checked
    def ratios_to(self, row: int, motion: int, reference: int | None) -> dict[str, float]:
        """Ratio of every criterion to that of a reference row; NaN if there is none or a run did not finish."""
        above = self.criteria(row, motion)
        below = None if reference is None else self.criteria(reference, motion)
        if above is None or below is None or reference is None:
            return {entry.name: float("nan") for entry in criteria()}
        bare = self.rows[reference].kind == "uncontrolled"
        named = {entry.name: entry.reference_criterion if bare else entry.name for entry in criteria()}
        return {
            name: float(ratio(np.array(above[name]), np.array(below[other]))) if other in below else math.nan
            for name, other in named.items()
            if name in above
        }

    @arguments.checked
    def score(self, row: int) -> float:
        """Mean over `judged_motions` of the criteria over those at i = 0; NaN unless all these runs finished."""
        return self.score_under(row, self.judged_motions)

    @arguments.checked
    def score_under(self, row: int, motions: Sequence[int]) -> float:
        """The score of a row under some motions, by their indices; NaN unless all these runs finished."""
        reference = self.row_of("passive_off")
        if reference is None:
            return float("nan")
        runs = [self.runs.get((each, motion)) for each in (row, reference) for motion in motions]
        if not runs or not all(run is not None and run.finished for run in runs):
            return float("nan")
        return float(
            score(*([self._criteria(each, motion) for motion in motions] for each in (row, reference)))
        )

    def _criteria(self, row: int, motion: int) -> dict[str, Floats]:
        return {name: np.asarray(self.labelled.numbers[name][row, motion, 0]) for name in SCORE}

    @arguments.checked
    def spread(self, row: int, motions: Sequence[int] | None = None) -> Spread:
        """Spread of the scores of a row under single motions, by default those of `judged_motions`."""
        chosen = self.judged_motions if motions is None else motions
        return Spread.of([self.score_under(row, (motion,)) for motion in chosen])

    @property
    def balanced(self) -> bool:
        """Whether the energies of all runs that finished balance."""
        return all(run.balanced for run in self.runs.values() if run.finished)

    def warnings(self) -> list[str]:
        """Warnings on modes, levels, dampers out of tested ranges, runs that did not finish or do not balance."""
        warnings = [*self.study_warnings, *level_warnings(self.design_levels), *self.damper_warnings]
        for number, row in enumerate(self.rows):
            named = ((each.name, self.runs.get((number, motion))) for motion, each in enumerate(self.motions))
            runs = [(name, run) for name, run in named if run is not None]
            ends: dict[str, list[str]] = {}
            for name, run in runs:
                if run.outcome != "finished":
                    end = f"{self._end(row, run)}.{'' if run.finished else _NO_CRITERIA}"
                    ends.setdefault(end, []).append(name)
            for end, (first, *more) in ends.items():
                under = f"{1 + len(more)} of {len(runs)} motions, as {first}," if more else first
                warnings.append(f"{row.label} under {under} {end}")
            # An energy error that is not a number counts as the largest.
            off = [(run.energy_error, name) for name, run in runs if run.finished and not run.balanced]
            if off:
                worst, name = max(off, key=lambda each: math.inf if math.isnan(each[0]) else each[0])
                warnings.append(
                    f"{row.label}: the energies do not balance, by up to {worst:.1e} of the largest energy, under "
                    f"{name}; {len(off)} of {len(runs)} runs are above {ENERGY_TOLERANCE:.0e}."
                )
        return warnings

    def _end(self, row: Row, run: RunResult) -> str:
        if run.outcome == "diverged" and self.building is not None and self.building.yield_drifts:
            return "diverged, as a frame does that collapses; a shorter step of [hardware] says whether it is that"
        if run.outcome == "diverged" and row.kind in ("uncontrolled", "baseline"):
            return (
                "diverged without dampers that follow a command: check [building], and the step of [hardware]"
            )
        return run.end

    def _summary(self) -> Summary:
        shown = range(min(len(self.motions), _MOTIONS_SHOWN))
        every = [[self.criteria(row, motion) or {} for motion in shown] for row in range(len(self.rows))]
        return Summary(
            title=f"{self.title}: {self.done} of {counted(self.total, 'run')}",
            facts=(
                *([("dampers", list_names(self.device_names))] if self.device_names else []),
                *(
                    (f"{use} motions", list_names([each.name for each in self.motions if each.use == use]))
                    for use in get_args(Use)
                ),
            ),
            columns=("peak drift [m]", *(motion.name for motion in self.motions[:_MOTIONS_SHOWN])),
            rows=[
                (row.label, *(format_rounded(each.get("peak_drift")) for each in own))
                for row, own in zip(self.rows, every, strict=True)
            ],
            notes=[f"warning: {each}" for each in self.warnings()],
        )


def _relative_change(value: float, other: float) -> float:
    if value == other:
        return 0.0
    return abs(other - value) / abs(value) if value != 0.0 else math.inf


def criterion_band(results: StudyResults, row: int, motion: int, name: str) -> RealisationBand | None:
    """Band of a criterion of a row under a motion; `None` for a row without realisations."""
    realised = _values(results, row, (motion,), name)
    return None if realised is None else RealisationBand.of(realised[0])


def ratio_band(results: StudyResults, row: int, reference: int | None, name: str) -> RealisationBand | None:
    """Band of the mean ratio of a criterion over the judged motions, to a reference row in the same realisation."""
    ratios = _mean_ratios(results, row, reference, name)
    return None if ratios is None else RealisationBand.of(ratios)


def score_band(results: StudyResults, row: int) -> RealisationBand | None:
    """Band of the score over the judged motions, against i = 0 in the same realisation."""
    parts = [_mean_ratios(results, row, results.row_of("passive_off"), name) for name in SCORE]
    known = [each for each in parts if each is not None]
    return RealisationBand.of(np.mean(known, axis=0)) if len(known) == len(SCORE) else None


def _values(results: StudyResults, row: int, motions: Sequence[int], name: str) -> Floats | None:
    """A criterion over motions and realisations; `None` for a row that was not simulated with these."""
    if not results.n_realisations:
        return None
    realised: Floats = results.labelled.numbers[name][row, list(motions), -results.n_realisations :]
    return None if np.isnan(realised).any() else realised


def _mean_ratios(results: StudyResults, row: int, reference: int | None, name: str) -> Floats | None:
    above = _values(results, row, results.judged_motions, name)
    below = None if reference is None else _values(results, reference, results.judged_motions, name)
    return None if above is None or below is None else np.asarray(ratio(above, below).mean(axis=0))


ON_OFF = (
    "On/off laws at a coarse step move most: quantities that jump with the command, such as accelerations, are "
    "evaluated at the steps only."
)
"""Note on the check of the step."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StepChange:
    """The largest relative change of a criterion of a row with half the step, and its motion.

    `unfinished` are the motions under which one of the two runs did not finish; `criterion` is empty if these are all.
    """

    row: int
    change: float
    criterion: str
    motion: int
    unfinished: tuple[int, ...]

    def in_words(self, results: StudyResults) -> str:
        """The criterion and the motion, and the motions that are not compared."""
        value = ""
        if self.criterion:
            value = f"{criterion(self.criterion).title}, {results.motions[self.motion].name}"
        others = ", ".join(results.motions[motion].name for motion in self.unfinished)
        return "; ".join(part for part in (value, f"not compared: {others}" if others else "") if part)


def largest_step_changes(results: StudyResults) -> tuple[StepChange, ...]:
    """The largest change of each row that was repeated with half the step."""
    checked = sorted(results.checked or ())
    rows = dict.fromkeys(row for row, _ in checked)
    return tuple(_largest(results, row, [motion for each, motion in checked if each == row]) for row in rows)


def _largest(results: StudyResults, row: int, motions: list[int]) -> StepChange:
    largest: list[tuple[float, str, int]] = []
    unfinished = []
    for motion in motions:
        changes = results.step_changes(row, motion)
        if changes is None:
            unfinished.append(motion)
            continue
        # A criterion that the file does not have is not compared, nor a count, which jumps by more than the step does.
        compared = [each for each in changes if not criterion(each).counted]
        name = max(compared, key=lambda each: -1.0 if math.isnan(changes[each]) else changes[each])
        largest.append((changes[name], name, motion))
    change, name, motion = max(largest, key=lambda each: each[0], default=(0.0, "", 0))
    return StepChange(row=row, change=change, criterion=name, motion=motion, unfinished=tuple(unfinished))


# Share of the base shear below which dampers hardly change a response: with 2 % of it the peak drift of a frame of six
# storeys under El Centro decreases by 5 % at the most.
_WEAK = 0.02
_ADVISED = 0.1
# Peak force over peak stroke beside the stiffness of the storey, above which a damper acts as a rigid brace. In frames
# of one and six storeys under El Centro, by the number of dampers: below 1 where the score is least, accelerations of
# the six storeys exceed those without dampers above 2, and above 5 less than half of the energy that the best number
# dissipates is left.
_RIGID = 5.0
_NAMED = 3

_COMMANDED = ("passive_off", "passive", "best_passive", "controller")


@dataclass(frozen=True, slots=True, kw_only=True)
class DevicePlace:
    """Index and stiffness [N/m] of the storey where a device stands, and the first natural frequency [Hz].

    `share` is that of `DamperFacts`.
    """

    storey: int
    stiffness: float
    frequency: float
    share: float

    @staticmethod
    def of(building: Building, storey: int, stretch: Floats) -> DevicePlace:
        """Of a storey of the building without dampers, its stiffness against opposite forces at its two ends.

        `stretch` is the row of the device, which has the coordinates of its braces behind those of the building.
        """
        row = building.storeys[storey]
        return DevicePlace(
            storey=storey,
            stiffness=1.0 / float(row @ np.linalg.solve(building.stiffness, row)),
            frequency=float(building.frequencies[0]),
            share=float(stretch[: row.size] @ row / (row @ row)),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reach:
    """Largest forces of the dampers by the index of their storey, and the base shear without them [N]."""

    motion: int
    forces: Mapping[int, float]
    shear: float

    @property
    def force(self) -> float:
        """That on the base; storeys stand on each other, so that forces of others do not add to it."""
        return self.forces[0] if 0 in self.forces else max(self.forces.values())

    @property
    def share(self) -> float:
        return self.force / self.shear


def shares_in_words(results: StudyResults) -> tuple[str, ...]:
    """A sentence on the force of the dampers beside the base shear of the building without them."""
    reaches = _reaches(results)
    if not reaches:
        return ()
    least, most = (choose(reaches, key=lambda each: each.share) for choose in (min, max))
    shares = dict.fromkeys(_percent(each.share) for each in (least, most))
    under = results.motions[most.motion].name
    if len(reaches) > 1:
        under = f"{counted(len(reaches), 'motion')}, most under {under}"
    by_storey = [
        f"{round_to(1e-3 * force, 3):g} kN in {results.storey_names[storey]}"
        for storey, force in sorted(most.forces.items())
    ]
    largest = f"; {'on the base' if 0 in most.forces else 'at most'} {round_to(1e-3 * most.force, 3):g} kN"
    return (
        f"The dampers reach {list_names(by_storey, _NAMED)}{largest if len(by_storey) > 1 else ''}, "
        f"{' to '.join(shares)} % of the peak base shear of the building without them "
        f"({round_to(1e-3 * most.shear, 3):g} kN), under {under}.",
    )


def judged_by_demand(
    results: StudyResults, devices: Sequence[Device], building: Building, storeys: Sequence[int]
) -> StudyResults:
    """Results with the demands on their devices, which stand in these storeys, and with the warnings on them."""
    motions = results.motions
    places = [
        DevicePlace.of(building, storey, np.asarray(device.row))
        for device, storey in zip(devices, storeys, strict=True)
    ]
    demanded = {key: demands_of(run, devices, motions[key[1]].duration) for key, run in results.runs.items()}
    results = replace(
        results,
        demanded=demanded,
        building=BuildingFacts.of(building),
        dampers=tuple(
            DamperFacts(
                name=device.name,
                model=_damper_in_words(device.spec),
                count=device.count,
                largest_command=device.largest_command,
                storey=place.storey,
                tested=device.tested,
                share=place.share,
            )
            for device, place in zip(devices, places, strict=True)
        ),
    )
    named = {
        (results.rows[row].label, motions[motion].name): each for (row, motion), each in demanded.items()
    }
    warnings = (*damper_warnings(named), *_weak(results), *_locked_storeys(results, devices, places))
    return replace(results, damper_warnings=warnings)


def _weak(results: StudyResults) -> Iterator[str]:
    """A sentence on dampers that are too weak for their building."""
    most = max(_reaches(results), key=lambda each: each.share, default=None)
    if most is None or not most.share < _WEAK:
        return
    yield (
        f"the dampers reach {_percent(most.share)} % of the base shear at most, and below {_percent(_WEAK)} % they "
        f"hardly change the response: {_counts(results, _ADVISED / most.share)} would reach {_percent(_ADVISED)} %, "
        "or larger dampers."
    )


def _locked_storeys(
    results: StudyResults, devices: Sequence[Device], places: Sequence[DevicePlace]
) -> Iterator[str]:
    """A sentence for each device that locks its storey at i = 0, else with a law or a constant command."""
    off = results.row_of("passive_off")
    for device, place in enumerate(places):
        ratios = {key: _stiffness(results, key, device, place) for key in results.runs}
        stiff = {key: ratio for key, ratio in ratios.items() if ratio > _RIGID}
        at_zero = {key: ratio for key, ratio in stiff.items() if key[0] == off}
        chosen = at_zero or stiff
        if not chosen:
            continue
        worst = max(chosen, key=lambda key: chosen[key])
        labels = list(dict.fromkeys(results.rows[row].label for row, _ in chosen))
        others = [f"{len(labels) - _NAMED} more"] if len(labels) > _NAMED + 1 else labels[_NAMED:]
        named = list_names([*labels[:_NAMED], *others])
        when, remedy = (
            ("already at i = 0", _fewer(results, devices[device], place, worst[1]))
            if at_zero
            else (f"with {named}", "; a smaller largest_command of the law or fewer dampers free it")
        )
        run = results.runs[worst]
        stroke, force = float(run.peak_stroke[device]), float(run.peak_force[device])
        yield (
            f"{results.device_names[device]} locks its storey {when}: {round_to(1e-3 * force, 3):g} kN at a stroke of "
            f"{round_to(1e3 * stroke, 2):g} mm is {round_to(chosen[worst], 2):g} times the stiffness of the storey "
            f"(under {results.motions[worst[1]].name} with {results.rows[worst[0]].label}). It acts as a rigid "
            f"brace, which dissipates little and may raise accelerations{remedy}."
        )


def _stiffness(results: StudyResults, key: Key, device: int, place: DevicePlace) -> float:
    """Peak force over peak stroke of a device over the stiffness of its storey; 0 for runs without these."""
    run = results.runs[key]
    commanded = run.finished and results.rows[key[0]].kind in _COMMANDED
    if not commanded or not run.peak_stroke[device] > 0.0:
        return 0.0
    return place.share**2 * float(run.peak_force[device] / run.peak_stroke[device]) / place.stiffness


def _fewer(results: StudyResults, device: Device, place: DevicePlace, motion: int) -> str:
    """How many dampers have a tenth of the base shear at the drift without dampers."""
    bare = results.runs.get((0, motion))
    # A storey of what was built in, such as a tuned mass, is none of the building without dampers.
    if bare is None or not bare.finished or place.storey >= bare.peak_drift.size:
        return ""
    drift = place.share * float(bare.peak_drift[place.storey])
    rate = 2.0 * math.pi * place.frequency * drift
    force = place.share * float(np.abs(sine_force(device, drift, rate, device.largest_command)).max())
    count = device.count * _ADVISED * float(bare.peak_base_shear) / force
    if count < 1.0:
        return f"; one alone has {_percent(_ADVISED / count)} % of the base shear, take a smaller damper"
    return (
        f"; count = {_round_count(count)} has {_percent(_ADVISED)} % of the base shear at the largest command"
    )


def _reaches(results: StudyResults) -> list[_Reach]:
    reaches = []
    for motion in results.judged_motions:
        bare = results.runs.get((0, motion))
        if bare is None or not bare.finished or not bare.peak_base_shear > 0.0 or not results.dampers:
            continue
        of_runs = []
        for (row, other), run in results.runs.items():
            if other == motion and run.finished and results.rows[row].kind in _COMMANDED:
                forces: dict[int, float] = {}
                # Passive elements of the building are behind the devices.
                for damper, force in zip(results.dampers, run.peak_force.tolist(), strict=False):
                    forces[damper.storey] = forces.get(damper.storey, 0.0) + damper.share * force
                of_runs.append(_Reach(motion=motion, forces=forces, shear=float(bare.peak_base_shear)))
        reaches += [max(of_runs, key=lambda each: each.force)] if of_runs else []
    return reaches


def _counts(results: StudyResults, factor: float) -> str:
    counts = {device.count for device in results.dampers}
    if len(counts) == 1:
        where = "the" if len(results.dampers) == 1 else "each"
        return f"count = {_round_count(counts.pop() * factor)} in {where} [[damper]]"
    return f"{_round_count(factor)} times the count of each [[damper]]"


def _round_count(count: float) -> int:
    """A whole number of dampers, to two digits."""
    return math.ceil(round_to(count, 2))


def _percent(share: float) -> str:
    return f"{round_to(100.0 * share, 2):g}" if share < 1.0 else f"{100.0 * share:.0f}"
