"""Numbers of runs over named axes: what a study and a tuning hold, and pages, terminal, files and xarray read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, labels_of
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import array_dataclass
from mrwork.closed_loop.evaluation import criteria, values
from mrwork.closed_loop.responses import Labelled, axis_of, description_of, in_command_unit, unit_of
from mrwork.motions import GroundMotion
from mrwork.store.codec import array_of, plain
from mrwork.store.journal import Journal
from mrwork.study.run_result import RunResult, kept_quantities
from mrwork.study.study import Realisations

T = TypeVar("T")

NOMINAL = "nominal"
"""The realisation without anything uncertain."""

HALF_STEP = "half the step"
"""The nominal realisation again, with half the integration step."""

Place = tuple[int, int, int]
"""Indices of a run along the first three axes: row or candidate, motion, realisation."""

Axes = Mapping[str, tuple[str, ...]]
"""Labels along each axis by its name."""

_N_FIRST = 3
# How a run ended, beside its quantities.
_ENDS = {
    "outcome": ("", "how the run ended"),
    "steps": ("1", "integration steps per sample"),
    "least_stroke": ("m", "least stroke of a cycle"),
}


@array_dataclass(repr=False)
class LabelledRuns(Labelled, WithAxes, Summarised):
    """Quantities or criteria of runs, each an array over named axes and an attribute; NaN where there is no such run.

    `axes` are rows of a study or candidates of a tuning, motions and realisations, with the labels along each. Criteria
    are infinite where a run did not finish. Quantities of floors, storeys or devices have a fourth axis; of devices it
    has the dampers and then the passive elements, and NaN behind the last of a row. `seconds` is the time inside the
    simulation.
    """

    axes: Axes
    numbers: Mapping[str, NDArray[Any]]
    units: Mapping[str, str]
    seconds: float = 0.0

    def __post_init__(self) -> None:
        for name, array in self.numbers.items():
            expected = tuple(len(self.axes[axis]) for axis in self.axes_of(name))
            if array.shape != expected:
                raise ValueError(f"{name} has the shape {array.shape} where {expected} was expected")

    @property
    def shape(self) -> tuple[int, ...]:
        """Numbers of rows or candidates, of motions and of realisations."""
        return tuple(map(len, self.axes.values()))[:_N_FIRST]

    def axes_of(self, name: str) -> tuple[str, ...]:
        """Names of the axes of a number."""
        first = tuple(self.axes)[:_N_FIRST]
        if self.numbers[name].ndim <= _N_FIRST:
            return first
        return (*first, "device" if name in _ENDS else axis_of(name))

    def criteria(self, place: Place) -> dict[str, float]:
        """Every criterion of a run."""
        return {entry.name: float(self.numbers[entry.name][place]) for entry in criteria()}

    def _named_arrays(self) -> NamedArrays:
        first = tuple(self.axes)[:_N_FIRST]
        return NamedArrays(
            title=f"Runs by {list_names(first)}",
            rows=first,
            labels={axis: labels_of(list(labels)) for axis, labels in self.axes.items()},
            arrays={
                name: NamedArray.of(
                    array, *self.axes_of(name), unit=self.units[name], long_name=_in_words(name, array.ndim)
                )
                for name, array in self.numbers.items()
            },
        )

    def _summary(self) -> Summary:
        return Summary(
            title=f"Runs by {list_names(list(self.axes))}",
            facts=[(name, list_names(labels)) for name, labels in self.axes.items()],
        )


def _in_words(name: str, n_axes: int) -> str:
    """Words for a criterion, which is one number of a run, or for a quantity."""
    titles = {entry.name: entry.title for entry in criteria()} if n_axes <= _N_FIRST else {}
    return _ENDS[name][1] if name in _ENDS else titles.get(name) or description_of(name)


def numbered(count: int) -> tuple[str, ...]:
    """Labels of candidates, realisations or devices, which have no names."""
    return tuple(str(number) for number in range(1, count + 1))


def candidate_axes(n_candidates: int, motions: Sequence[GroundMotion], realisations: Realisations) -> Axes:
    """Axes of the runs of candidates under motions with realisations."""
    return {
        "candidate": numbered(n_candidates),
        "motion": tuple(motion.name for motion in motions),
        "realisation": numbered(len(realisations)),
    }


def criteria_of_runs(axes: Axes, value: float = np.nan, *, command_unit: str = "") -> LabelledRuns:
    """Every criterion and the error of energy over three axes, with one value, to be filled."""
    shape = tuple(map(len, axes.values()))
    units = {entry.name: entry.unit for entry in criteria()} | {"energy_error": unit_of("energy_error")}
    units = _with_command(units, command_unit) if command_unit else units
    return LabelledRuns(axes=axes, numbers={name: np.full(shape, value) for name in units}, units=units)


def criteria_of_study(
    runs: Mapping[Place, RunResult],
    realised: Mapping[int, LabelledRuns],
    axes: Axes,
    command_unit: str,
    *,
    weight: float,
) -> LabelledRuns:
    """The criteria of runs, and of the rows that were simulated with realisations, the last ones of that axis."""
    labelled = criteria_of_runs(axes, command_unit=command_unit)
    for place, run in runs.items():
        named = values(run, weight=weight) if run.finished else dict.fromkeys(labelled.numbers, np.inf)
        for name, value in {**named, "energy_error": run.energy_error}.items():
            labelled.numbers[name][place] = value
    for row, part in realised.items():
        for name, array in part.numbers.items():
            labelled.numbers[name][row, :, -part.shape[2] :] = array[0]
    return labelled


def quantities_of_runs(runs: Mapping[Place, RunResult], axes: Axes, command_unit: str) -> LabelledRuns:
    """The quantities of runs over three axes, of floors and of storeys; that of devices is as long as a run needs."""
    of_devices = [quantity.name for quantity in kept_quantities() if quantity.axis == "device"]
    sizes = (np.size(run.numbers[name]) for run in runs.values() for name in of_devices)
    n_devices = max(sizes, default=0)
    axes = {**axes, "device": numbered(n_devices)}
    shape = tuple(map(len, axes.values()))[:_N_FIRST]
    numbers: dict[str, NDArray[Any]] = {
        quantity.name: np.full(
            (*shape, *([len(axes[quantity.axis])] if quantity.axis in axes else [])), np.nan
        )
        for quantity in kept_quantities()
    }
    numbers |= {
        "outcome": np.full(shape, "", dtype="U16"),
        "steps": np.zeros(shape, dtype=np.int64),
        "least_stroke": np.full((*shape, n_devices), np.nan),
    }
    for place, run in runs.items():
        ends = {"outcome": run.outcome, "steps": run.steps, "least_stroke": run.least_stroke}
        for name, value in {**run.numbers, **ends}.items():
            numbers[name][place + (slice(np.size(value)),) * np.ndim(value)] = value
    units = {quantity.name: quantity.unit for quantity in kept_quantities()}
    units |= {name: unit for name, (unit, _) in _ENDS.items()}
    return LabelledRuns(axes=axes, numbers=numbers, units=_with_command(units, command_unit))


def recall_or_compute(
    journal: Journal | None,
    step: str,
    inputs: str,
    kind: type[T],
    compute: Callable[[], T],
    *,
    agrees: Callable[[T], bool] | None = None,
) -> T:
    """The result of a step from the journal, or computed, and then recorded; see `Journal.once`."""
    return compute() if journal is None else journal.once(step, inputs, kind, compute, agrees=agrees)


def recall_or_compute_runs(
    journal: Journal | None,
    step: str,
    inputs: str,
    axes: Axes,
    compute: Callable[[], LabelledRuns],
) -> LabelledRuns:
    """Criteria over these axes from the journal, whose lines have no labels, or computed, and then recorded."""
    if journal is None:
        return compute()

    def read(record: Mapping[str, Any]) -> LabelledRuns:
        empty = criteria_of_runs(axes)
        numbers, error = array_of(record["numbers"]), array_of(record["energy_error"])
        if numbers.shape != (len(criteria()), *empty.shape) or error.shape != empty.shape:
            raise ValueError("it is of another size than its inputs")
        named = {entry.name: array for entry, array in zip(criteria(), numbers, strict=True)}
        return replace(empty, numbers={**named, "energy_error": error}, seconds=float(record["seconds"]))

    runs = journal.recall(step, inputs, read)
    if runs is None:
        runs = compute()
        stacked = np.stack([runs.numbers[entry.name] for entry in criteria()])
        record = {"numbers": stacked, "energy_error": runs.energy_error, "seconds": runs.seconds}
        journal.record(step, inputs, plain(record))
    return runs


def _with_command(units: Mapping[str, str], command_unit: str) -> dict[str, str]:
    return {name: in_command_unit(unit, command_unit) for name, unit in units.items()}
