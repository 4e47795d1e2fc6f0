"""Results of a study: its runs and the criteria that follow, bands over realisations, and the check of the step."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar, Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from mrwork.base import arguments
from mrwork.base.arguments import NotNegative, Positive, Whole
from mrwork.base.labelled import NamedArrays, tree_of
from mrwork.base.numbers import counted, format_rounded
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, list_names, named
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.device import Device
from mrwork.closed_loop.evaluation import (
    SCORE,
    STANDARD_GRAVITY,
    Scales,
    Spread,
    criteria,
    criterion,
    searched,
)
from mrwork.closed_loop.responses import ENERGY_TOLERANCE
from mrwork.dampers.simulation import Outcome
from mrwork.dampers.tested_range import OperatingRange, Outside
from mrwork.errors import SettingError
from mrwork.study.judged_motions import JudgedMotions
from mrwork.study.row_kinds import Kind
from mrwork.study.runs import NOT_RUN, Runs
from mrwork.study.schema import Use
from mrwork.study.study import Row, Study

if TYPE_CHECKING:
    from mrwork.base.labelled import DataFrame, DataTree

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


_UNBALANCED: Final = RemarkKind(
    "energies_unbalanced",
    f"the energies of {{runs}} do not balance to {ENERGY_TOLERANCE:.0e} of the largest energy, by up to {{value:.1e}}, "
    "{0} under {1}; runs of {rows}: a law chatters, or the step is too long",
    "half the step tells which (--check-step)",
)
_IN_WORDS = {Outcome.UNRESOLVED: "could not be resolved", Outcome.ABANDONED: "was abandoned"}
_UNFINISHED: Final = RemarkKind("run_unfinished", "{0} under {under} {ended}{without}", "{cure}")
_NO_CRITERIA: Final = ", and a run that does not finish has no criteria"
_BEST_PASSIVE_MISSING: Final = RemarkKind(
    "best_passive_missing",
    "against i = 0 alone most laws look good, and the best constant command is missing beside them",
    'leave out references = "none"',
)


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperFacts:
    """Dampers at one place: name, model with its laws, how many, largest command, their storey, tested ranges.

    `place` is the name of the storey, which may be of isolators, and stands `on_ground` or on a floor. The drift times
    `share`, the cosine of their angle, stretches them, and so much of their force is along the motion of the ground,
    whichever way they face. It is 0 of dampers that only turn a plan.
    """

    name: str
    model: str
    count: Positive
    largest_command: NotNegative
    storey: Whole
    tested: OperatingRange | None
    share: float = 1.0
    command_unit: str = "A"
    place: str = ""
    on_ground: bool = False

    @staticmethod
    def of(device: Device, building: Building, storey: int | str) -> DamperFacts:
        """The facts of a device in a storey of the building without dampers, with its laws that follow the command."""
        spec, row = device.spec, building.storey_row(storey)
        # Behind the coordinates of the building come the coordinates of braces.
        stretch = np.asarray(device.row)[: row.size]
        following = [f"{name} {law}" for name, law in spec.laws_by_name.items() if not law.is_constant]
        return DamperFacts(
            name=device.name,
            model=f"{spec.name}, {', '.join(following) or 'all constant'}",
            count=device.count,
            largest_command=device.largest_command,
            storey=building.storey_names.index(building.storey_name(storey)),
            tested=device.tested,
            share=_share_along(building.influence, row, stretch),
            command_unit=device.command_unit or "A",
            place=building.storey_name(storey),
            on_ground=bool(row @ building.influence),
        )


def _share_along(influence: Floats, row: Floats, stretch: Floats) -> float:
    """Force of a damper along the motion of the ground over its force, of its `stretch` and the `row` of its storey.

    On the ground it is the force on all coordinates together, between floors that in the direction of their storey;
    rotations have no part in it.
    """
    if row @ influence:
        return abs(float(stretch @ influence))
    moved = np.where(influence != 0.0, row, 0.0)
    moved = moved if moved.any() else row
    return abs(float(stretch @ moved / (moved @ moved)))


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingFacts:
    """A building in numbers: mass of each floor [kg], stiffness of each storey [N/m], periods [s], damping ratios.

    `heights` belong to the storeys [m], if they are known, `yield_drifts` drifts at which they yield [m] and `loads`
    weights on them [N] with P-delta, if there are; `drift_limit` is a drift ratio to be kept, or 0. `passive` are the
    passive devices, and `passive_storeys` the storeys that such devices stand across; `total_mass` moves with the
    ground [kg], or is that of all coordinates where nothing `follows_ground`. Of a structure whose storeys all have
    names of their own, as tyre and suspension, `parts` are these: it is not called a building, nor they storeys.

    There are no stiffnesses where it is no chain of storeys, and the masses are then the diagonal of the matrix, with
    moments of inertia.
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
    total_mass: float = 0.0
    parts: tuple[str, ...] = ()
    follows_ground: bool = True

    def __post_init__(self) -> None:
        # Of a run folder without it.
        if not self.total_mass:
            object.__setattr__(self, "total_mass", sum(self.masses))

    @property
    def scales(self) -> Scales:
        """What criteria are divided by."""
        arrays = named(self, "heights", "yield_drifts", "loads").items()
        weight = self.total_mass * STANDARD_GRAVITY if self.follows_ground else np.nan
        return Scales(weight=weight, **{name: np.array(array) for name, array in arrays})

    @property
    def has_ratios(self) -> bool:
        """Whether every storey has a height, so that each of its drifts is a drift ratio."""
        return bool(self.heights) and min(self.heights) > 0.0

    @staticmethod
    def of(building: Building) -> BuildingFacts:
        """The facts of a building without dampers."""
        devices = [element for element in building.elements if not element.in_stiffness]
        names, numbered = building.storey_names, {f"storey {n}" for n in range(1, 1 + len(building.storeys))}
        across = (np.flatnonzero((building.chain == device.row).all(axis=1)).tolist() for device in devices)
        numbers = {
            "masses": np.diag(building.mass),
            "stiffnesses": building.storey_stiffnesses,
            **named(building, "periods", "damping_ratios"),
            **named(Scales.of(building), "heights", "yield_drifts", "loads"),
        }
        return BuildingFacts(
            name=building.name,
            **{name: tuple(array.tolist()) for name, array in numbers.items()},
            drift_limit=building.drift_limit,
            total_mass=building.reference_mass,
            follows_ground=building.follows_ground,
            passive=tuple(device.name for device in devices),
            passive_storeys=tuple(storey for storeys in across for storey in storeys[:1]),
            parts=() if numbered.intersection(names) else names,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceDemand:
    """Demand of a run on one damper of a device, and what of it lies outside its tested ranges."""

    device: str
    demand: OperatingRange
    outside: Outside


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyVerdict:
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
        pairs = enumerate(zip(self.answers, self.values, strict=True), start=1)
        parts = (f"{answer} ({value:.3g}) with set {number}" for number, (answer, value) in pairs)
        return f"{self.subject}: {', '.join(parts)}"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Ensemble(Summarised):
    """A study with each of the `sets` of laws of its dampers, the chosen one first, and its verdicts."""

    _made_by: ClassVar[str] = "mr.load(folder).ensemble"

    sets: tuple[str, ...]
    verdicts: tuple[StudyVerdict, ...]

    @property
    def in_words(self) -> tuple[str, ...]:
        """The sets, and each verdict that changes, a sentence each."""
        sets = (f"set {number}: {words}" for number, words in enumerate(self.sets, start=1))
        changing = [f"verdict changes: {verdict.in_words}" for verdict in self.verdicts if verdict.changes]
        return *sets, *(changing or [f"none of {len(self.verdicts)} verdicts changes"])

    def _summary(self) -> Summary:
        return Summary(
            title=f"The study with {len(self.sets)} sets of laws that predict nearly as well",
            notes=self.in_words,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class PageContent:
    """What the page of a study has beside its results: lines of `facts`, histories of the motion `detailed`.

    Those are of the rows `with_histories`.
    """

    facts: tuple[tuple[str, str], ...] = ()
    detailed: Whole = 0
    with_histories: tuple[Whole, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StudyResults(Plotted, Summarised):
    """Runs of a study, as far as they are done, of `run_study` or read back from its folder.

    `quantities` are given over row, motion and realisation: the nominal one and, if it is checked, half the step;
    `criteria_of_runs` has the criteria, also of the realisations of what is uncertain. The first rows are the building
    without dampers and i = 0. `demanded` are the demands on each device by (row, motion), of runs with dampers that
    finished. `limit` is the criterion with its limit of which the page has the fragility, `scored` the criteria
    of the score, `choices` are sentences on
    constant commands that were chosen. `study_remarks` come from the study, `damper_remarks` are on demand outside the
    tested ranges, on laws out of their range, on the size of dampers, and on storeys. `ensemble` is the study with each
    set of laws that predicts nearly as well, `None` if run without ``--ensemble``.
    """

    _made_by: ClassVar[str] = "mr.run_study(study) or mr.load(folder)"

    title: str
    rows: tuple[Row, ...]
    motions: JudgedMotions
    quantities: Runs
    criteria_of_runs: Runs
    command_unit: str
    building: BuildingFacts
    dampers: tuple[DamperFacts, ...] = ()
    demanded: Mapping[tuple[int, int], tuple[DeviceDemand, ...]] = field(default_factory=dict)
    limit: Mapping[str, float] = field(default_factory=dict)
    scored: tuple[str, ...] = SCORE
    choices: tuple[str, ...] = ()
    study_remarks: tuple[Remark, ...] = ()
    damper_remarks: tuple[Remark, ...] = ()
    page: PageContent
    ensemble: Ensemble | None = None

    @staticmethod
    @arguments.checked
    def of(
        study: Study, rows: Sequence[Row], runs: Runs, criteria: Runs, choices: Sequence[str]
    ) -> StudyResults:
        """Results of runs of a study, without the demands on its dampers."""
        drawn, bare = study.table.report.controllers, study.building
        shown = tuple(number for number, row in enumerate(rows) if not drawn or row.label in drawn)
        return StudyResults(
            **named(study, "title", "limit", "command_unit", "scored"),
            rows=tuple(rows),
            motions=JudgedMotions(
                motions=tuple(motion.facts for motion in study.motions),
                chosen_on=tuple(ground.name for ground in study.chosen_on),
                design_levels=study.design_levels,
            ),
            quantities=runs,
            criteria_of_runs=criteria,
            building=BuildingFacts.of(bare),
            dampers=tuple(
                DamperFacts.of(device, bare, table.storey)
                for device, table in zip(study.devices, study.table.damper, strict=True)
            ),
            choices=tuple(choices),
            study_remarks=study.remarks,
            page=PageContent(**named(study, "facts", "detailed"), with_histories=shown),
        )

    @property
    def step_checked(self) -> bool:
        """Whether the runs were repeated with half the step, or are to be."""
        return self.quantities.shape[2] > 1

    @arguments.checked
    def criteria(self, row: int, motion: int, realisation: Whole = 0) -> dict[str, float] | None:
        """Every criterion of a run that finished, by default of the nominal one."""
        if not self.quantities.finished[row, motion, realisation]:
            return None
        return known_criteria(self.criteria_of_runs.at(row, motion, realisation))

    @arguments.checked
    def step_changes(self, row: int, motion: int) -> dict[str, float] | None:
        """Relative change of every criterion with half the step; `None` unless both runs finished."""
        whole, half = self.criteria(row, motion), self.criteria(row, motion, 1) if self.step_checked else None
        if whole is None or half is None:
            return None
        # Histories of the half step are not kept.
        both = {name: (half[name], value) for name, value in whole.items() if name in half}
        changes = {name: (abs(half - value), abs(value)) for name, (half, value) in both.items()}
        return {
            name: change / size if size else math.inf if change else 0.0
            for name, (change, size) in changes.items()
        }

    @property
    def has_own_score(self) -> bool:
        """Whether the study states what it is scored by."""
        return self.scored != SCORE

    @property
    def n_realisations(self) -> int:
        """Number of realisations of what is uncertain, beside the nominal one."""
        return self.criteria_of_runs.shape[2] - self.quantities.shape[2]

    @property
    def realised(self) -> Runs:
        """Criteria with the realisations of what is uncertain."""
        return self.criteria_of_runs.part(realisations=slice(self.quantities.shape[2], None))

    @property
    def realised_rows(self) -> list[int]:
        """The rows that were simulated with realisations."""
        done = self.realised.done[:, list(self.judged_motions)].all(axis=(1, 2))
        return np.flatnonzero(done).tolist() if self.n_realisations else []

    def _named_groups(self) -> dict[str, NamedArrays]:
        groups = {"criteria": self.criteria_of_runs, "quantities": self.quantities}
        return {name: runs._named_arrays() for name, runs in groups.items()}

    @arguments.checked
    def to_xarray(self, *, by_record: bool = False) -> DataTree:
        """Criteria and quantities as two data sets "criteria" and "quantities" over named axes, with units.

        Quantities are of the nominal realisation, and of half the step where it was checked.

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
        groups = {name: group.to_xarray() for name, group in self._named_groups().items()}
        if by_record:
            at = self.motions.by_record
            if len(at.measures) > 1 or at.levels.size < 2 or (at.places < 0).any():
                raise SettingError(
                    f"not each of {counted(len(at.records), 'record')} has the same levels, several of one measure of "
                    "intensity; give all the same pga or sa, or leave by_record out"
                )
            levels = ("intensity", at.levels, {"units": at.unit, "long_name": at.measure})
            groups = {
                name: group.isel(motion=(("record", "intensity"), at.places))
                .drop_vars("motion")
                .assign_coords(record=list(at.records), intensity=levels)
                for name, group in groups.items()
            }
        return tree_of(self.title, groups)

    def to_pandas(self) -> DataFrame:
        """Criteria as a table: a row for each row of the study, motion and realisation; units are in `attrs`.

        `quantities.to_pandas()` is the table of the quantities, with storeys, floors and devices as columns.
        """
        return self.criteria_of_runs.to_pandas()

    @property
    def done(self) -> int:
        """Number of runs that are done, also with half the step."""
        return int(self.quantities.done.sum())

    @property
    def total(self) -> int:
        """Number of runs of the whole study."""
        return self.quantities.outcome.size

    @property
    def complete(self) -> bool:
        """Whether all runs are done, also with realisations."""
        return self.done == self.total and bool(self.realised.done[:, list(self.judged_motions)].all())

    @property
    def status(self) -> Literal["finished", "interrupted"]:
        """Whether all runs are done, in a word of a manifest."""
        return "finished" if self.complete else "interrupted"

    @property
    def judged_motions(self) -> tuple[int, ...]:
        """Indices of the motions that scores and changes stand on, as `motions.judged`."""
        return self.motions.judged

    @arguments.checked
    def finished_rows(self, motion: int) -> list[int]:
        """The rows whose run under a motion finished."""
        return np.flatnonzero(self.quantities.finished[:, motion, 0]).tolist()

    @arguments.checked
    def finished_under(self, row: int, motions: Sequence[int]) -> bool:
        """Whether the runs of a row under these motions, one or more, finished."""
        return bool(motions) and bool(self.quantities.finished[row, list(motions), 0].all())

    @arguments.checked
    def row_of(self, kind: Kind) -> int | None:
        """The first row of a kind, if there is one."""
        return next((number for number, row in enumerate(self.rows) if row.kind == kind), None)

    @arguments.checked
    def ratios(self, row: int, motion: int, against: Kind | Whole | None) -> dict[str, float]:
        """Ratio of every criterion to a row, or the first of a kind; NaN without one, or if a run did not finish."""
        reference = self.row_of(against) if isinstance(against, str) else against
        if reference is None:
            return dict.fromkeys((entry.name for entry in self.criteria_of_runs.entries), math.nan)
        return {name: float(ratios[row, motion]) for name, ratios in self.ratios_over(reference).items()}

    @arguments.checked
    def ratios_over(self, reference: int) -> dict[str, Floats]:
        """Ratio of every criterion of the runs to a reference row, shape (n_rows, n_motions)."""
        bare, nominal = self.rows[reference].kind == "uncontrolled", self._nominal
        ratios = nominal.over(nominal.of_row(reference), bare=bare)
        return {name: ratio[:, :, 0] for name, ratio in ratios.items()}

    @property
    def _nominal(self) -> Runs:
        return self.criteria_of_runs.part(realisations=slice(1))

    @property
    def at_zero(self) -> int | None:
        """The row that scores are over: i = 0; with actuators alone, which at rest do nothing, the bare building."""
        off = self.row_of("passive_off")
        return self.row_of("uncontrolled") if off is None and self.dampers else off

    @arguments.checked
    def scores(self, row: int) -> Floats:
        """Score of a row under each motion, shape (n_motions,); NaN where a run did not finish."""
        reference, nominal = self.at_zero, self._nominal
        if reference is None:
            return np.full(len(self.motions), math.nan)
        return np.asarray(nominal.of_row(row).scores(nominal.of_row(reference), self.scored)[0, :, 0])

    @arguments.checked
    def score(self, row: int, motions: Sequence[int] | None = None) -> Spread:
        """Mean and spread of the scores of a row under motions, by their indices, by default the `judged_motions`.

        They are NaN unless all these runs finished.
        """
        chosen = self.judged_motions if motions is None else motions
        return Spread.of(self.scores(row)[list(chosen)].tolist())

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On energies, levels, what laws are compared with, the study, dampers, storeys and unfinished runs."""
        return (
            *self._unbalanced(),
            *self.motions.remarks,
            *([] if self.is_compared else [_BEST_PASSIVE_MISSING.remark()]),
            *self.study_remarks,
            *self.damper_remarks,
            *self._unfinished(),
        )

    @property
    def is_compared(self) -> bool:
        """Whether control laws, if there are any, are compared with the best constant command."""
        return self.row_of("controller") is None or self.row_of("best_passive") is not None

    def _unbalanced(self) -> Iterator[Remark]:
        off = ~self.quantities.balanced[:, :, 0]
        if not off.any():
            return
        # An energy error that is not a number counts as the largest.
        errors = np.where(off, searched(self.quantities.energy_error[:, :, 0]), 0.0)
        worst, motion = divmod(int(errors.argmax()), errors.shape[1])
        yield _UNBALANCED.remark(
            self.rows[worst].label,
            self.motions[motion].name,
            measured=Measured(float(errors[worst, motion]), ""),
            runs=counted(int(off.sum()), "run"),
            rows=list_names([self.rows[number].label for number in np.flatnonzero(off.any(axis=1))]),
        )

    def _unfinished(self) -> Iterator[Remark]:
        outcomes = self.quantities.outcome[:, :, 0]
        for number, row in enumerate(self.rows):
            simulated = np.flatnonzero(outcomes[number] != NOT_RUN).tolist()
            ends: dict[Outcome, list[str]] = {}
            for motion in simulated:
                ends.setdefault(Outcome(int(outcomes[number, motion])), []).append(self.motions[motion].name)
            for outcome, (first, *more) in ends.items():
                if outcome is not Outcome.FINISHED:
                    under = f"{1 + len(more)} of {len(simulated)} motions, as {first}" if more else first
                    (ended, cure), name = self._end(row, outcome), outcome.name.lower()
                    without = "" if outcome is Outcome.FAILED_SAFE else _NO_CRITERIA
                    yield _UNFINISHED.remark(
                        row.label, name, under=under, ended=ended, without=without, cure=cure
                    )

    def _end(self, row: Row, outcome: Outcome) -> tuple[str, str]:
        if outcome is Outcome.DIVERGED and self.building.yield_drifts:
            step = "a shorter step of [hardware] says whether it is that"
            return "diverged, as a frame does that collapses", step
        if outcome is Outcome.DIVERGED and row.kind in ("uncontrolled", "baseline"):
            building = "check [building], and the step of [hardware]"
            return "diverged without dampers that follow a command", building
        return _IN_WORDS.get(outcome, outcome.name.lower().replace("_", " ")), outcome.remedy

    def _summary(self) -> Summary:
        shown = range(min(len(self.motions), _MOTIONS_SHOWN))
        drifts = self.criteria_of_runs.numbers["peak_drift"][:, list(shown), 0]
        return Summary(
            title=f"{self.title}: {self.done} of {counted(self.total, 'run')}",
            facts=(
                ("dampers", list_names([damper.name for damper in self.dampers])),
                *(
                    (f"{use} motions", list_names([facts.name for facts in self.motions if facts.use == use]))
                    for use in get_args(Use)
                ),
            ),
            remarks=self.remarks,
            tables=[
                Table(
                    columns=("peak drift [m]", *(self.motions[motion].name for motion in shown)),
                    rows=[
                        (row.label, *map(format_rounded, of_row))
                        for row, of_row in zip(self.rows, drifts.tolist(), strict=True)
                    ],
                )
            ],
        )


# What criteria of runs have beside them.
_ERROR: Final = "energy_error"
# Most motions of which a summary has the drifts.
_MOTIONS_SHOWN: Final = 5


def known_criteria(numbers: Mapping[str, Any]) -> dict[str, float]:
    """Every criterion, NaN where there is none, and an optional one only where it is known."""
    names = dict.fromkeys(
        [*(entry.name for entry in criteria()), *(name for name in numbers if name != _ERROR)]
    )
    values = {criterion(name): float(numbers.get(name, math.nan)) for name in names}
    return {
        entry.name: value for entry, value in values.items() if not (entry.optional and math.isnan(value))
    }


def criterion_band(results: StudyResults, row: int, motion: int, name: str) -> RealisationBand | None:
    """Band of a criterion of a row under a motion; `None` for a row without realisations, or if it is not known."""
    realised = results.realised
    is_known = results.n_realisations and realised.done[row, motion].all()
    return _band(realised.numbers[name][row, motion], realised.finished[row, motion]) if is_known else None


def bands_over(results: StudyResults, row: int, reference: int | None) -> dict[str, RealisationBand]:
    """Bands of the score and of the ratios to a reference row in the same realisation, means over the judged motions.

    There are none for a row without realisations, and none of a criterion that is not known.
    """
    realised, motions = results.realised, list(results.judged_motions)
    if reference is None or not results.n_realisations:
        return {}
    both = realised.part([row, reference], motions)
    if not both.done.all():
        return {}
    runs, other = both.of_row(0), both.of_row(1)
    ratios = {**runs.over(other), "score": runs.scores(other, results.scored)}
    bands = {name: _band(ratio[0].mean(axis=0), both.finished) for name, ratio in ratios.items()}
    return {name: band for name, band in bands.items() if band is not None}


def _band(values: Floats, finished: NDArray[np.bool_]) -> RealisationBand | None:
    # What is not known of runs that all finished is no band.
    return None if finished.all() and np.isnan(values).any() else RealisationBand.of(values)


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
        names = [motion.name for motion in results.motions]
        parts = [f"{criterion(self.criterion).title}, {names[self.motion]}"] if self.criterion else []
        others = ", ".join(names[motion] for motion in self.unfinished)
        return "; ".join([*parts, *([f"not compared: {others}"] if others else [])])


def largest_step_changes(results: StudyResults) -> tuple[StepChange, ...]:
    """The largest change of each row that was repeated with half the step."""
    worst: list[StepChange] = []
    repeated = np.asarray(results.quantities.done[:, :, 1:].any(axis=2))
    for row in np.flatnonzero(repeated.any(axis=1)).tolist():
        changes = {
            motion: results.step_changes(row, motion) for motion in np.flatnonzero(repeated[row]).tolist()
        }
        # A count jumps by more than the step does.
        compared = [
            (change, name, motion)
            for motion, of_run in changes.items()
            for name, change in (of_run or {}).items()
            if not (criterion(name).counted or math.isnan(change))
        ]
        change, name, motion = max(compared, key=lambda item: item[0], default=(0.0, "", 0))
        unfinished = tuple(motion for motion, of_run in changes.items() if of_run is None)
        worst.append(StepChange(row=row, change=change, criterion=name, motion=motion, unfinished=unfinished))
    return tuple(worst)
