"""How many dampers keep a limit of a study: the least count, as many everywhere or by storey, by bisection."""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import Any, ClassVar, Final, Literal

from mrwork.base.arguments import Count, Threads, Whole, checked
from mrwork.base.numbers import counted
from mrwork.base.plotted import Plotted
from mrwork.base.progress import OnProgress, Progress
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, list_names, named
from mrwork.base.table import Column, Table
from mrwork.buildings.groups import commanded
from mrwork.closed_loop.evaluation import Scales, criterion, searched
from mrwork.closed_loop.responses import in_command_unit, quantity_named
from mrwork.errors import Interrupted, SettingError
from mrwork.study.comparison import small_first
from mrwork.study.course import n_constant
from mrwork.study.fragilities import limit_of
from mrwork.study.reading import counted_study
from mrwork.study.row_kinds import Kind
from mrwork.study.run import run_study
from mrwork.study.study import Study
from mrwork.study.trials import designed

By = Literal["uniform", "storey"]
"""Whether each place has as many dampers, or a count of its own."""

MOST = 64
"""Most dampers of a [[damper]]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TriedCounts:
    """Dampers of each place, and the criterion of each row under them: the largest over the motions."""

    counts: tuple[Whole, ...]
    values: tuple[float, ...]

    @property
    def uniform(self) -> int | None:
        """The count of every place; `None` where they differ."""
        return self.counts[0] if len(set(self.counts)) == 1 else None


@dataclass(frozen=True, slots=True, kw_only=True)
class RowCount:
    """The least dampers of each place with which a row keeps the limit, and the value of the criterion under them.

    Where the row does not keep it, they have the lowest value of all that were tried.
    """

    label: str
    kind: Kind
    keeps: bool
    counts: tuple[Whole, ...]
    value: float
    dampers: Whole


_KEPT_BARE: Final = RemarkKind(
    "limit_kept_bare", "the building keeps the limit without dampers", "give a limit that it exceeds"
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DamperCounts(Plotted, Summarised):
    """Least counts of dampers with which the rows of a study keep a limit, and every count that was tried.

    `bare` is the value of the criterion without dampers, `places` are the names of the dampers that follow a command,
    `runs` counts the simulated runs, also to choose constant commands and settings of laws.
    """

    _made_by: ClassVar[str] = "mr.study.damper_counts(study)"

    criterion: str
    limit: float
    unit: str
    by: By
    most: Whole
    bare: float
    places: tuple[str, ...]
    rows: tuple[RowCount, ...]
    tried: tuple[TriedCounts, ...]
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
        """What `mrwork respond --size --json` prints."""
        return asdict(self) | named(self, "remarks")

    def _summary(self) -> Summary:
        judged = criterion(self.criterion)
        heads = self.places if self.by == "storey" and len(self.places) > 1 else ("in each place",)
        columns = (
            Column("label", "arrangement"),
            *(
                Column(heading=head, of=partial(lambda at, row: row.counts[at], at))
                for at, head in enumerate(heads)
            ),
            Column(heading="dampers", of=lambda row: row.dampers if row.keeps else "not kept"),
            Column("value", judged.short, shown=self.in_words),
        )
        missed = f"Where the limit is not kept with up to {self.most} dampers in each place, the value is the lowest."
        return Summary(
            title=f"Least dampers that keep {small_first(judged.title)} within {self.in_words(self.limit)}",
            facts=(("places", list_names(self.places)), ("without dampers", self.in_words(self.bare))),
            remarks=self.remarks,
            tables=[Table.of(columns, self.rows)],
            notes=[
                "" if all(row.keeps for row in self.rows) else missed,
                f"{counted(self.runs, 'run')} with {counted(len(self.tried), 'count')}, for each of which the constant "
                "command was chosen and the laws were designed anew.",
            ],
        )


def _counts_in_words(counts: tuple[int, ...]) -> str:
    return f"{counts[0]} in each place" if len({*counts}) == 1 else f"{' + '.join(map(str, counts))} dampers"


@dataclass(kw_only=True)
class _Trials:
    """A study with other counts of its dampers, each simulated once; a criterion is to keep a limit."""

    study: Study
    criterion: str
    limit: float
    threads: int
    on_progress: OnProgress | None
    tried: dict[tuple[int, ...], TriedCounts] = field(default_factory=dict)
    runs: int = 0

    def values(self, counts: tuple[int, ...]) -> tuple[float, ...]:
        """The criterion of every row with so many dampers in each place."""
        if counts not in self.tried:
            self.tried[counts] = TriedCounts(counts=counts, values=tuple(self._simulate(counts)))
        return self.tried[counts].values

    def _simulate(self, counts: tuple[int, ...]) -> list[float]:
        def report(progress: Progress) -> None:
            if self.on_progress is not None:
                self.on_progress(replace(progress, said=(_counts_in_words(counts), *progress.said)))

        study = counted_study(self.study, counts)
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

        n_places = len(commanded(self.study.devices))
        everywhere = partial(keeps, (), n_places, ())
        doubled = sorted({*(2**power for power in range(most.bit_length())), most})
        enough = next(filter(everywhere, doubled), None)
        if enough is None:
            alike = [trial for trial in self.tried.values() if trial.uniform is not None]
            return min(alike, key=lambda trial: trial.values[row]).counts
        counts = (bisect_left(range(enough), True, key=everywhere),) * n_places
        for place in order:
            below, above = counts[:place], counts[place + 1 :]
            own = partial(keeps, below, 1, above)
            counts = (*below, bisect_left(range(counts[place]), True, key=own), *above)
        return counts


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
    and the laws are designed anew. Counts are doubled from 1 until a row keeps the limit, and then halved between: of
    a criterion that more dampers may raise, as an acceleration, the count is the least that was tried. By storey, the
    count of each place is then halved while the others stay, from the highest storey down.

    Parameters
    ----------
    limit
        One criterion of the building with its limit, as ``{"peak_drift_ratio": 0.01}`` or ``{"peak_acceleration":
        "3 m/s2"}``; by default the limit of the study, `report.limit` or `drift_limit` of the building.
    by
        As many dampers in each place, or a count of each.
    most
        Most dampers in a place.
    on_progress
        Called with the progress of each count.

    Returns
    -------
    DamperCounts
        The least count of the constant commands and of each law, what is reached where none keeps the limit, and every
        count that was tried.

    Raises
    ------
    SettingError
        If there is no limit, or it is not on the building, or the study has no damper that follows a command.

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
    if quantity_named(criterion(name).quantity).axis == "device":
        raise SettingError(
            f"{name} is of the dampers; give a limit on the building, as peak_drift or peak_acceleration"
        )
    devices = commanded(study.devices)
    if not devices or not devices[0].is_commanded or devices[0].is_actuator:
        raise SettingError("the study has no damper that follows a command; give a [[damper]]")
    trials = _Trials(study=study, criterion=name, limit=value, threads=threads, on_progress=on_progress)
    compared = [arrangement.row for arrangement in study.arrangements if arrangement.row.what.is_counted]
    storeys = [study.building.storey_name(damper.storey) for damper in study.table.damper[: len(devices)]]
    heights = [study.building.storey_names.index(storey) for storey in storeys]
    highest_first = sorted(range(len(devices)), key=lambda place: -heights[place])
    rows = []
    try:
        for number, row in enumerate(compared[1:], start=1):
            counts = trials.least(number, most, highest_first if by == "storey" else ())
            reached = trials.values(counts)[number]
            sizes = (2 if device.differential else 1 for device in devices)
            rows.append(
                RowCount(
                    **named(row, "label", "kind"),
                    keeps=reached <= value,
                    counts=counts,
                    value=reached,
                    dampers=sum(count * size for count, size in zip(counts, sizes, strict=True)),
                )
            )
    except KeyboardInterrupt:
        raise Interrupted(None, "count of dampers") from None
    tried = tuple(trials.tried[counts] for counts in sorted(trials.tried))
    return DamperCounts(
        criterion=name,
        limit=value,
        unit=in_command_unit(criterion(name).unit, study.command_unit),
        by=by,
        most=most,
        bare=tried[0].values[0],
        places=tuple(device.name for device in devices),
        rows=tuple(rows),
        tried=tried,
        runs=trials.runs,
    )
