"""How many dampers, dashpots or tuned masses keep a limit of a study: the least count, everywhere or by storey."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, Final, Literal

import numpy as np

from mrwork.base.arguments import Count, Threads, Whole, checked
from mrwork.base.keys import Arguments
from mrwork.base.numbers import counted, format_rounded
from mrwork.base.plotted import Plotted
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, named
from mrwork.base.table import Column, Table
from mrwork.base.values import Floats
from mrwork.buildings.groups import commanded
from mrwork.closed_loop.evaluation import Scales, criterion, on_request, searched
from mrwork.closed_loop.responses import in_command_unit, quantity_named
from mrwork.errors import Interrupted, SettingError
from mrwork.study.arrangements import baseline_building
from mrwork.study.comparison import small_first
from mrwork.study.fragilities import limit_of
from mrwork.study.loop_case import LoopCase, criterion_scales
from mrwork.study.reading import counted_study
from mrwork.study.row_kinds import Kind
from mrwork.study.run_reports import n_constant
from mrwork.study.running import run_study
from mrwork.study.runs import asking, asks_for_weighted, candidate_axes, runs_of
from mrwork.study.schema import BaselineTable
from mrwork.study.study import Arrangement, Row, Study
from mrwork.study.trials import designed

By = Literal["uniform", "storey"]
"""Whether each place has as many dampers, or a count of its own."""

MOST = 64
"""Most dampers of a [[damper]]."""
# Times as many of what a baseline states, which is a part of what is sought; step of slopes of a sum of damping.
_PARTS, _SLOPE = 2**10, 1e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class TriedCounts:
    """Dampers of each place, and the criterion of a row under them: the largest over the motions."""

    counts: tuple[Whole, ...]
    value: float

    @property
    def uniform(self) -> int | None:
        """The count of every place; `None` where they differ."""
        return self.counts[0] if len(set(self.counts)) == 1 else None


@dataclass(frozen=True, slots=True, kw_only=True)
class RowCount:
    """The least dampers of each place with which a row keeps the limit, and the value of the criterion under them.

    Where the row does not keep it, they have the lowest value of all that were `tried`. `total` in this `unit` is the
    damping [N s/m] or mass [kg] of a baseline; of dampers that follow a command it is their number.
    """

    label: str
    kind: Kind
    keeps: bool
    places: tuple[str, ...]
    counts: tuple[Whole, ...]
    value: float
    total: float
    unit: str
    tried: tuple[TriedCounts, ...]


_KEPT_BARE: Final = RemarkKind(
    "limit_kept_bare", "the building keeps the limit without dampers", "give a limit that it exceeds"
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DamperCounts(Plotted, Summarised):
    """Least counts of dampers with which the rows of a study keep a limit, and every count that was tried.

    `bare` is the value of the criterion without dampers, `runs` counts the simulated runs, also to choose constant
    commands and settings of laws.
    """

    _made_by: ClassVar[str] = "mr.study.damper_counts(study)"

    criterion: str
    limit: float
    unit: str
    by: By
    most: Whole
    bare: float
    rows: tuple[RowCount, ...]
    runs: Whole

    @checked
    def in_words(self, value: float) -> str:
        """A value of the criterion with its unit."""
        return criterion(self.criterion).in_words(value, self.unit)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """Whether the building keeps the limit without dampers."""
        measured = Measured(self.bare, self.unit)
        return (_KEPT_BARE.remark(measured=measured),) if self.bare <= self.limit else ()

    def document(self) -> dict[str, Any]:
        """What `mrwork tune --size --json` prints."""
        return asdict(self) | named(self, "remarks")

    def _summary(self) -> Summary:
        judged = criterion(self.criterion)
        columns = (
            Column("label", "arrangement"),
            Column(heading="count", of=lambda row: _counts_in_words(row.counts, row.places)),
            Column(
                heading="in all",
                of=lambda row: f"{format_rounded(row.total)} {row.unit}" if row.keeps else "not kept",
            ),
            Column("value", judged.short, shown=self.in_words),
        )
        most = f"up to {self.most} dampers in each place, or {self.most * _PARTS} of a baseline"
        missed = f"Where the limit is not kept with {most}, the value is the lowest."
        return Summary(
            title=f"Least dampers that keep {small_first(judged.title)} within {self.in_words(self.limit)}",
            facts=(("without dampers", self.in_words(self.bare)),),
            remarks=self.remarks,
            tables=[Table.of(columns, self.rows)],
            notes=[
                "" if all(row.keeps for row in self.rows) else missed,
                f"{counted(self.runs, 'run')}; for each number of dampers that follow a command the constant one was "
                "chosen and the laws were designed anew.",
            ],
        )


def _counts_in_words(counts: tuple[int, ...], places: tuple[str, ...]) -> str:
    if len({*counts}) == 1:
        return f"{counts[0]}{' in each place' * (len(counts) > 1)}"
    return ", ".join(f"{at}: {count}" for count, at in zip(counts, places, strict=True))


@dataclass(kw_only=True)
class _Trials:
    """A study with other counts of its dampers, each simulated once; a criterion is to keep a limit.

    `one` is what a count of 1 in each place has, in the `unit` of the total.
    """

    study: Study
    criterion: str
    limit: float
    threads: int
    on_progress: OnProgress | None
    rows: Sequence[Row]
    places: tuple[str, ...]
    order: Sequence[int]
    one: Sequence[float]
    unit: str
    tried: dict[tuple[int, ...], list[float]] = field(default_factory=dict)
    runs: int = 0

    def values(self, counts: tuple[int, ...]) -> list[float]:
        """The criterion of every row with so many dampers in each place."""
        if counts not in self.tried:
            self.tried[counts] = self._simulate(counts)
        return self.tried[counts]

    def _simulate(self, counts: tuple[int, ...]) -> list[float]:
        def report(progress: Progress) -> None:
            if self.on_progress is not None:
                self.on_progress(
                    replace(progress, said=(_counts_in_words(counts, self.places), *progress.said))
                )

        study = asking(counted_study(self.study, counts), (self.criterion,))
        compared = tuple(arrangement for arrangement in study.arrangements if arrangement.row.what.is_counted)
        study = designed(replace(study, arrangements=compared), on_progress=report)
        results = run_study(study, on_progress=report, threads=self.threads)
        taken = [settings.runs for _, settings in study.taken_settings]
        # Settings are taken from the runs at i = 0 and at the largest command, and scans.
        chosen = sum(n_constant(arrangement) for arrangement in study.arrangements if arrangement.law is None)
        self.runs += results.done + (chosen + (2 if taken else 0)) * len(study.chosen_on) + sum(taken)
        values = results.criteria_of_runs.up_to_collapse(self.criterion)[:, list(results.judged_motions), 0]
        return list(map(float, searched(values.max(axis=1))))

    def least(self, row: int, most: int, order: Sequence[int]) -> tuple[int, ...]:
        """The least count of every place with which a row keeps the limit, and then of each place in this order.

        Where no count keeps the limit they have the lowest value of all that were tried.
        """

        def keeps(below: tuple[int, ...], places: int, above: tuple[int, ...], count: int) -> bool:
            counts = (*below, *(count,) * places, *above)
            # Without any damper the row is the building itself.
            return any(counts) and self.values(counts)[row] <= self.limit

        n_places = len(self.places)
        everywhere = partial(keeps, (), n_places, ())
        doubled = sorted({*(2**power for power in range(most.bit_length())), most})
        enough = next(filter(everywhere, doubled), None)
        if enough is None:
            alike = [counts for counts in self.tried if len({*counts}) == 1]
            return min(alike, key=lambda counts: self.tried[counts][row])
        counts = (bisect_left(range(enough), True, key=everywhere),) * n_places
        for place in order:
            below, above = counts[:place], counts[place + 1 :]
            own = partial(keeps, below, 1, above)
            counts = (*below, bisect_left(range(counts[place]), True, key=own), *above)
        return counts

    def found(self, number: int, by: By, most: int) -> RowCount:
        """The least counts of a row by its number."""
        counts = self.least(number, most, self.order if by == "storey" else ())
        tried = {each: values[number] for each, values in sorted(self.tried.items())}
        return RowCount(
            **named(self.rows[number], "label", "kind"),
            **named(self, "places", "unit"),
            keeps=tried[counts] <= self.limit,
            counts=counts,
            value=tried[counts],
            total=float(np.dot(self.one, counts)),
            tried=tuple(TriedCounts(counts=each, value=value) for each, value in tried.items()),
        )


@dataclass(kw_only=True)
class _Stated(_Trials):
    """A baseline with other counts of the devices that it states in the table `kind`, of which `key` is the size."""

    arrangement: Arrangement
    baseline: BaselineTable
    devices: Sequence[Arguments]
    kind: str
    key: str

    def reached(self, counts: Sequence[float]) -> Floats:
        """The criterion of each motion in each floor or storey, with so many times what is stated, over the limit."""
        sized: dict[str, Any] = {
            self.kind: tuple(
                replace(device, given={**device.given, self.key: float(count) * one})
                for device, count, one in zip(self.devices, counts, self.one, strict=True)
                if count
            )
        }
        table, study = replace(self.baseline.building, **sized), self.study
        motions = [motion.ground for motion in study.motions if motion.facts.use == "test"] or study.grounds
        try:
            building = baseline_building(table, study.table, study.origin.folder)
        except SettingError:
            # No optimum is known of a tuned mass that weighs more than its mode.
            return np.array([np.inf])
        of = replace(self.arrangement, building=building)
        asked = on_request((self.criterion,))
        case = LoopCase(arrangement=of, motions=motions, hardware=study.hardware, threads=self.threads)
        responses = case.responses(histories=asks_for_weighted(asked))
        runs = runs_of(responses, of, candidate_axes(1, motions, 1), asked)
        self.runs += len(motions)
        judged = criterion(self.criterion)
        # Dashpots that a search takes out have no stroke.
        numbers = judged.value if self.criterion == "peak_stroke" else judged.of_places
        return searched(numbers(runs, criterion_scales(of))).ravel() / self.limit

    def _simulate(self, counts: tuple[int, ...]) -> list[float]:
        return [float(self.reached(counts).max()) * self.limit]

    def least(self, row: int, most: int, order: Sequence[int]) -> tuple[int, ...]:
        """As of dampers; of dashpots in several places the sum is the least, by SLSQP from as many in each."""
        is_sum = self.kind == "viscous" and len(order) > 1
        alike = super().least(row, most * _PARTS, () if is_sum else order)
        if not is_sum or self.values(alike)[row] > self.limit:
            return alike
        import scipy.optimize

        shares, many = np.array(self.one) / sum(self.one), alike[0]
        inside = {"type": "ineq", "fun": lambda factors: 1.0 - self.reached(many * factors)}
        options: dict[str, Any] = {"method": "SLSQP", "options": {"eps": _SLOPE, "ftol": 1e-8}}
        options |= {"constraints": inside, "bounds": [(0.0, None)] * len(shares)}
        found = scipy.optimize.minimize(shares.dot, np.ones(len(shares)), **options)
        own = tuple(np.ceil(many * found.x - _SLOPE).astype(int).tolist())
        is_less = any(own) and shares.dot(own) < shares.dot(alike)
        return own if is_less and self.values(own)[row] <= self.limit else alike


_SIZES: Final = (
    ("viscous", "damping", "N s/m"), ("tuned_mass", "mass", "kg"), ("tuned_mass", "mass_ratio", "of the mass"),
)  # fmt: skip
"""Devices of a baseline that are counted, the key of their size, and its unit."""


def _stated(arrangement: Arrangement, baseline: BaselineTable, of_all: Any) -> Iterator[_Stated]:
    """The trials of a baseline with dashpots or tuned masses, none where it has neither."""
    for kind, key, unit in _SIZES:
        given = getattr(baseline.building, kind) or ()
        devices = given if isinstance(given, tuple) else (given,)
        if devices and all(key in device.given for device in devices):
            at = "storey" if kind == "viscous" else "floor"
            places = [device.given[at] for device in devices]
            yield _Stated(
                **of_all,
                rows=(arrangement.row,),
                places=tuple(place if isinstance(place, str) else f"{at} {place}" for place in places),
                order=range(len(devices))[::-1],
                one=[device.given[key] for device in devices],
                unit=unit,
                arrangement=arrangement,
                baseline=baseline,
                devices=devices,
                kind=kind,
                key=key,
            )


@checked
def damper_counts(
    study: Study,
    *,
    limit: Mapping[str, float | str] | None = None,
    by: By = "uniform",
    most: Count = MOST,
    on_progress: OnProgress | None = None,
    threads: Threads = 0,
) -> DamperCounts:
    """Find how many dampers keep a limit of a criterion under every motion that a study is judged on.

    The count of the ``[[damper]]`` that follow a command is changed; for each count the best constant command is chosen
    and the laws are designed anew. So is the number of dashpots or tuned masses of each ``[[baseline]]``, of the
    ``damping``, ``mass`` or ``mass_ratio`` that it states, which may be small: 1 kN s/m. Counts are doubled from 1
    until a row keeps the limit, and then halved between: of a criterion that more dampers may raise, as an
    acceleration, the count is the least that was tried. By storey, the count of each place is then halved while the
    others stay, from the highest storey down; of dashpots the sum of damping is the least.

    Parameters
    ----------
    limit
        One criterion of the building with its limit, as ``{"peak_drift_ratio": 0.01}`` or ``{"peak_acceleration":
        "3 m/s2"}``; by default the limit of the study, `report.limit` or `drift_limit` of the building.
    by
        As many dampers in each place, or a count of each.
    most
        Most dampers in a place, and 1024 times as many dashpots or tuned masses.
    on_progress
        Called with the progress of each count.

    Returns
    -------
    DamperCounts
        The least count of the constant commands, of each law and baseline, what is reached where none keeps the limit,
        and every count that was tried.

    Raises
    ------
    SettingError
        If there is no limit, or it is not on the building, or the study has nothing that is counted.

    Examples
    --------
    >>> import mrwork as mr
    >>> study = mr.read_study("study.toml")  # doctest: +SKIP
    >>> mr.study.damper_counts(study, limit={"peak_drift_ratio": "1 %"})  # doctest: +SKIP
    """
    limits = study.limit if limit is None else limit
    if not limits:
        raise SettingError(
            'the study has no limit; give one, as report.limit = { peak_drift_ratio = "1 %" }, or drift_limit of '
            "[building]"
        )
    ((name, value),) = limit_of(limits, study.command_unit, Scales.of(study.building)).items()
    of_isolators = name == "peak_stroke" and study.arrangements[0].strokes
    if quantity_named(criterion(name).quantity).axis == "device" and not of_isolators:
        raise SettingError(
            f"{name} is of the dampers; give a limit on the building, as peak_drift or peak_acceleration, or "
            "peak_stroke of one with isolators or a tuned mass"
        )
    of_all: dict[str, Any] = {"study": study, "criterion": name, "limit": value, "threads": threads}
    of_all["on_progress"] = on_progress
    driven = [device for device in commanded(study.devices) if device.is_commanded]
    devices = [] if any(device.is_actuator for device in driven) else driven
    storeys = [study.building.storey_name(damper.storey) for damper in study.table.damper[: len(devices)]]
    heights = [study.building.storey_names.index(storey) for storey in storeys]
    dampers = _Trials(
        **of_all,
        rows=[arrangement.row for arrangement in study.arrangements if arrangement.row.what.is_counted],
        places=tuple(device.name for device in devices),
        order=sorted(range(len(devices)), key=lambda place: -heights[place]),
        one=[2 if device.differential else 1 for device in devices],
        unit="dampers",
    )
    others = [arrangement for arrangement in study.arrangements if arrangement.row.kind == "baseline"]
    pairs = zip(others, study.table.baseline, strict=True)
    stated = [trials for pair in pairs for trials in _stated(*pair, of_all)]
    if not devices and not stated:
        raise SettingError(
            "the study has nothing that is counted; give a [[damper]] that follows a command, or a [[baseline]] with "
            "viscous or tuned_mass"
        )
    try:
        rows = [dampers.found(number, by, most) for number in range(1, len(dampers.rows)) if devices]
        rows += [trials.found(0, by, most) for trials in stated]
        # Without dampers to count the building is simulated alone.
        bare = dampers.values(min(dampers.tried, default=()))[0]
    except KeyboardInterrupt:
        raise Interrupted(None, "count of dampers") from None
    return DamperCounts(
        criterion=name,
        limit=value,
        unit=in_command_unit(criterion(name).unit, study.command_unit),
        by=by,
        most=most,
        bare=bare,
        rows=tuple(rows),
        runs=sum(trials.runs for trials in (dampers, *stated)),
    )
