"""How many dampers keep a limit of a study: the least count, as many everywhere or by storey, by bisection."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import ClassVar, Literal

import numpy as np

from mrwork.base.arguments import Count, Threads, Whole, checked
from mrwork.base.numbers import counted
from mrwork.base.plotted import Plotted
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.buildings.groups import commanded
from mrwork.closed_loop.evaluation import Scales, criterion
from mrwork.closed_loop.responses import in_command_unit, quantity_named
from mrwork.errors import Interrupted, SettingError
from mrwork.study.constant import n_constant
from mrwork.study.course import StudyProgress
from mrwork.study.fragilities import limit_of
from mrwork.study.named_laws import designed
from mrwork.study.reading import counted_study
from mrwork.study.run import run_study
from mrwork.study.study import Kind, Study

By = Literal["uniform", "storey"]
"""Whether each place has as many dampers, or a count of its own."""

MOST = 64
"""Most dampers of a [[damper]]."""

_KINDS: tuple[Kind, ...] = ("uncontrolled", "passive_off", "passive", "best_passive", "controller")


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

    Where the row does not keep it, they are those tried with the lowest value.
    """

    label: str
    kind: Kind
    keeps: bool
    counts: tuple[Whole, ...]
    value: float
    dampers: Whole


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DamperCounts(Plotted, Summarised):
    """Least counts of dampers with which the rows of a study keep a limit, and every count that was tried.

    `bare` is the value of the criterion without dampers, `places` are the names of the dampers that follow a command,
    `runs` the simulated runs, with those that chose constant commands and settings of laws.
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
    def notes(self) -> tuple[str, ...]:
        """A sentence on rows that do not keep the limit, and on what was simulated."""
        missed = (
            f"{each.label} does not keep the limit with up to {self.most} dampers in each place: the lowest value is "
            f"{self.in_words(each.value)}, with {_counts_in_words(each.counts)}."
            for each in self.rows
            if not each.keeps
        )
        return (
            *missed,
            f"{counted(self.runs, 'run')} with {counted(len(self.tried), 'count')}, for each of which the constant "
            "command was chosen and the laws were designed anew.",
        )

    def _summary(self) -> Summary:
        name = criterion(self.criterion).title
        own = self.places if self.by == "storey" and len(self.places) > 1 else ("in each place",)
        return Summary(
            title=f"Least dampers that keep {name[:1].lower()}{name[1:]} within {self.in_words(self.limit)}",
            facts=(
                ("places", list_names(self.places)),
                ("without dampers", self.in_words(self.bare)),
            ),
            cautions=["the building keeps the limit without dampers."] if self.bare <= self.limit else (),
            columns=("arrangement", *own, "dampers", criterion(self.criterion).short),
            rows=[
                (
                    each.label,
                    *(str(count) if each.keeps else "-" for count in each.counts[: len(own)]),
                    str(each.dampers) if each.keeps else "not kept",
                    self.in_words(each.value),
                )
                for each in self.rows
            ],
            notes=self.notes,
        )


def _counts_in_words(counts: tuple[int, ...]) -> str:
    if len(set(counts)) == 1:
        return f"{counts[0]} in each place"
    return f"{' + '.join(map(str, counts))} dampers"


@dataclass(kw_only=True)
class _Trials:
    """A study with other counts of its dampers, each simulated once."""

    study: Study
    name: str
    threads: int
    on_progress: Callable[[StudyProgress], None] | None
    tried: dict[tuple[int, ...], TriedCounts] = field(default_factory=dict)
    runs: int = 0

    def values(self, counts: tuple[int, ...]) -> TriedCounts:
        """The criterion of every row with so many dampers in each place."""
        if counts not in self.tried:
            self.tried[counts] = self._simulate(counts)
        return self.tried[counts]

    def _simulate(self, counts: tuple[int, ...]) -> TriedCounts:
        def report(progress: StudyProgress) -> None:
            if self.on_progress is not None:
                label = f"{_counts_in_words(counts)}, {progress.label}"
                self.on_progress(replace(progress, label=label))

        study = counted_study(self.study, counts)
        kept = tuple(each for each in study.arrangements if each.row.kind in _KINDS)
        study = designed(replace(study, arrangements=kept), on_progress=report)
        results = run_study(study, on_progress=report, threads=self.threads)
        taken = [each.taken.runs for each in study.arrangements if each.taken is not None]
        # Settings are taken from the runs at i = 0 and at the largest command, and scans.
        searched = [n_constant(each) for each in study.arrangements if each.law is None]
        chosen = sum(searched) + (2 if taken else 0)
        self.runs += int(results.quantities.done.sum()) + chosen * len(study.chosen_on) + sum(taken)
        of_rows = results.labelled.up_to_collapse(self.name)[:, list(results.judged_motions), 0].max(axis=1)
        return TriedCounts(counts=counts, values=tuple(np.where(np.isnan(of_rows), np.inf, of_rows).tolist()))


@checked
def damper_counts(
    study: Study,
    *,
    limit: Mapping[str, float | str] | None = None,
    by: By = "uniform",
    most: Count = MOST,
    on_progress: Callable[[StudyProgress], None] | None = None,
    threads: Threads = 0,
) -> DamperCounts:
    """Find how many dampers keep a limit of a criterion under every motion that a study is judged on.

    The count of the ``[[damper]]`` that follow a command is changed; for each count the best constant command is chosen
    and the laws are designed anew. Counts are doubled from 1 until a row keeps the limit, and then halved between: of
    a criterion that more dampers may raise, as an acceleration, the count is the least of those tried. By storey, the
    count of each place is then halved while the others stay, from the highest storey down.

    Parameters
    ----------
    limit
        One criterion of the building with its limit, as ``{"peak_drift_ratio": 0.01}`` or ``{"peak_acceleration":
        "3 m/s2"}``; by default that of the study, `report.limit` or `drift_limit` of the building.
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
    given = study.limit if limit is None else limit
    if not given:
        raise SettingError(
            'the study has no limit; give one, as report.limit = { peak_drift_ratio = "1 %" }, or drift_limit of '
            "[building]"
        )
    ((name, value),) = limit_of(given, study.command_unit, Scales.of(study.building)).items()
    if quantity_named(criterion(name).quantity).axis == "device":
        raise SettingError(
            f"{name} is of the dampers; give a limit on the building, as peak_drift or peak_acceleration"
        )
    devices = commanded(study.devices)
    if not devices or not devices[0].is_commanded:
        raise SettingError("the study has no damper that follows a command; give a [[damper]]")
    trials = _Trials(study=study, name=name, threads=threads, on_progress=on_progress)
    rows = [each.row for each in study.arrangements if each.row.kind in _KINDS]
    names = [study.building.storey_name(each.storey) for each in study.table.damper[: len(devices)]]
    storeys = tuple(map(study.building.storey_names.index, names))
    try:
        found = [_least_of(trials, row, value, by, most, storeys) for row in range(1, len(rows))]
    except KeyboardInterrupt:
        raise Interrupted(None, "count of dampers") from None
    each_has = [2 if device.differential else 1 for device in devices]
    return DamperCounts(
        criterion=name,
        limit=value,
        unit=in_command_unit(criterion(name).unit, study.command_unit),
        by=by,
        most=most,
        bare=next(iter(trials.tried.values())).values[0],
        places=tuple(device.name for device in devices),
        rows=tuple(
            RowCount(
                label=row.label,
                kind=row.kind,
                keeps=trials.values(counts).values[number] <= value,
                counts=counts,
                value=trials.values(counts).values[number],
                dampers=sum(count * size for count, size in zip(counts, each_has, strict=True)),
            )
            for number, (row, counts) in enumerate(zip(rows[1:], found, strict=True), start=1)
        ),
        tried=tuple(trials.tried[counts] for counts in sorted(trials.tried)),
        runs=trials.runs,
    )


def _least_of(
    trials: _Trials, row: int, limit: float, by: By, most: int, storeys: tuple[int, ...]
) -> tuple[int, ...]:
    """The least counts with which a row keeps a limit; without any those tried with the lowest value."""
    n_places = len(storeys)

    def keeps(counts: tuple[int, ...]) -> bool:
        # Without any damper the row is the building itself.
        return any(counts) and trials.values(counts).values[row] <= limit

    def uniform(count: int) -> bool:
        return keeps((count,) * n_places)

    below, count = 0, 1
    while not uniform(count):
        if count == most:
            every = [each for each in trials.tried.values() if each.uniform is not None]
            return min(every, key=lambda each: each.values[row]).counts
        below, count = count, min(2 * count, most)
    counts = (_bisect(uniform, below, count),) * n_places
    if by == "uniform" or n_places == 1:
        return counts

    def with_own(counts: tuple[int, ...], place: int, count: int) -> bool:
        return keeps((*counts[:place], count, *counts[place + 1 :]))

    for place in sorted(range(n_places), key=lambda place: -storeys[place]):
        own = _bisect(partial(with_own, counts, place), -1, counts[place])
        counts = (*counts[:place], own, *counts[place + 1 :])
    return counts


def _bisect(keeps: Callable[[int], bool], below: int, count: int) -> int:
    """The least count that keeps a limit, of those tried between one that does not and one that does."""
    while count - below > 1:
        middle = (below + count) // 2
        below, count = (below, middle) if keeps(middle) else (middle, count)
    return count
