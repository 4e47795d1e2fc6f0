"""Runs of a study: the numbers, history and demand of one, and the numbers of many over named axes.

A run is one arrangement under one ground motion. Arrays over named axes are what a study and a tuning hold, and what
pages, terminal, files and xarray read.
"""

from __future__ import annotations

import math
import re
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, labels_of
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.evaluation import Scales, criteria, values
from mrwork.closed_loop.responses import (
    ENERGY_TOLERANCE,
    History,
    Labelled,
    Quantity,
    Responses,
    axis_of,
    demand_of,
    description_of,
    history_signals,
    in_command_unit,
    run_quantities,
    unit_of,
)
from mrwork.dampers.simulation import Outcome
from mrwork.dampers.spec import worst_laws
from mrwork.dampers.tested_range import Exceedance, OperatingRange, Outside, least_stroke, worst_of
from mrwork.errors import RecordError
from mrwork.motions import GroundMotion
from mrwork.store.codec import array_of, built, plain
from mrwork.store.journal import Journal
from mrwork.store.output_file import replacing
from mrwork.store.run_folder import HISTORIES
from mrwork.store.run_writer import RunAtWork
from mrwork.study.study import Arrangement, Realisations, Study, StudyLaw, commands_force

_OUTCOMES = {
    Outcome.FINISHED: "finished",
    Outcome.DIVERGED: "diverged",
    Outcome.UNRESOLVED: "could not be resolved",
    Outcome.ABANDONED: "was abandoned",
    Outcome.FAILED_SAFE: "failed safe",
}


OutcomeName = str
"""How a run ended, as results files have it."""

FINISHED = ("finished", "failed_safe")
"""Outcomes of runs that have results."""


# What a quantity of devices is called for passive elements, which results have behind the devices.
_OF_ELEMENTS = {
    "peak_force": "peak_element_force", "peak_stroke": "peak_element_stroke", "device_energy": "element_energy",
}  # fmt: skip
_COMMANDS = ("peak_current", "mean_current", "rms_current", "command_travel", "switching_rate")
_LEFT_OUT = {"rms_force", *_OF_ELEMENTS.values()}
# Signals of no use to pages, and energies, which a history has in one array.
_SIGNALS_LEFT_OUT = {"input_energy", "damping_energy", "device_energy"}
_N_ENERGIES = 5


@array_dataclass()
class RunResult(Labelled):
    """How a run ended, and its quantities, each an attribute; those of floors, storeys and devices have an axis.

    They are those of `run_quantities`; force, stroke and energy of devices are those of the dampers, then those of the
    passive devices of the building, of which storeys that yield are none.

    `outcome` is "finished", "failed_safe" if a sensor failed and the dampers had no command, or the reason why the run
    did not finish. `energy_error` is the imbalance of energy over the largest energy. `steps` is the number of
    integration steps per sample. `least_stroke` is that of `OperatingRange` [m] for each damper, empty where no
    damper was tested with a least stroke.
    """

    outcome: str
    steps: int
    numbers: Mapping[str, Any]
    least_stroke: Floats = field(default_factory=lambda: np.empty(0))

    @property
    def finished(self) -> bool:
        """Whether the run has results."""
        return self.outcome in FINISHED

    @property
    def end(self) -> str:
        """The outcome as words that follow the name of the run, with a remedy."""
        outcome = Outcome[self.outcome.upper()]
        remedy = "" if outcome is Outcome.FINISHED else f": {outcome.remedy}"
        return f"{_OUTCOMES[outcome]}{remedy}"

    @property
    def balanced(self) -> bool:
        """Whether the energies balance."""
        return bool(self.energy_error <= ENERGY_TOLERANCE)

    def as_record(self) -> dict[str, Any]:
        """Its line of a journal, see `read_recorded`."""
        own = {"outcome": self.outcome, "steps": self.steps, "least_stroke": self.least_stroke}
        return {name: plain(value) for name, value in (*self.numbers.items(), *own.items())}


@array_dataclass()
class RunHistory(Labelled):
    """The history of a run, each signal an attribute: shapes (n_time,), for floors, storeys and devices (n_time, n).

    They are those of `history_signals` that pages draw. `energy` has the columns input, kinetic, strain, damping and
    devices [J], cumulative from the start; passive devices count among them. The rest of the input is in storeys that
    yield.
    """

    time: Floats
    numbers: Mapping[str, Floats]


def kept_quantities() -> list[Quantity]:
    """Quantities that a run of a study has."""
    return [each for each in run_quantities() if each.name not in _LEFT_OUT]


def kept_signals() -> list[Quantity]:
    """Signals of a history that a study stores."""
    named = (each for each in history_signals() if each.name not in _SIGNALS_LEFT_OUT)
    return [each for each in named if each.axis not in ("state", "element")]


def own_numbers(responses: Responses, arrangement: Arrangement, law: StudyLaw | None) -> dict[str, Floats]:
    """Quantities of all runs, for the floors and storeys of the bare building and all that is built into it."""
    numbers = {}
    for quantity in kept_quantities():
        values = _own_columns(responses, quantity, arrangement)
        if quantity.name == "peak_stroke" and not arrangement.devices:
            # Added storeys without devices, such as isolators, have a stroke, too.
            others = [number for number in arrangement.strokes if number < responses.peak_drift.shape[1]]
            values = responses.peak_drift[:, others]
        if quantity.name in _OF_ELEMENTS:
            of_elements = responses.numbers[_OF_ELEMENTS[quantity.name]]
            values = np.concatenate([values, of_elements[:, arrangement.passive_devices]], axis=1)
        if quantity.name in _COMMANDS and commands_force(law):
            # The command of an ideal actuator is a force, not a current.
            values = values[:, :0]
        numbers[quantity.name] = values
    return numbers


def _own_places(arrangement: Arrangement) -> dict[str, list[int]]:
    """Columns of the bare building and of the devices of the arrangement, by axis."""
    devices = range(len(arrangement.devices))
    return {"floor": [*arrangement.floors], "storey": [*arrangement.storeys], "device": [*devices]}


def _own_columns(of: Labelled, quantity: Quantity, arrangement: Arrangement) -> Floats:
    """A quantity or a signal, for the bare building and the devices of the arrangement."""
    places = _own_places(arrangement)
    values: Floats = of.numbers[quantity.name]
    return values[:, places[quantity.axis]] if quantity.axis in places else values


def _shape_of(quantity: Quantity, arrangement: Arrangement) -> tuple[int, ...]:
    """Shape of a quantity of a run, or of one sample of a signal."""
    places = _own_places(arrangement)
    return (len(places[quantity.axis]),) if quantity.axis in places else ()


def results_of(responses: Responses, arrangement: Arrangement) -> list[RunResult]:
    """The result of each run of a batch, for the floors and storeys of the bare building."""
    own = own_numbers(responses, arrangement, arrangement.law)
    return [
        RunResult(
            outcome=Outcome(int(outcome)).name.lower(),
            steps=int(responses.steps[run]),
            numbers={name: values[run] for name, values in own.items()},
            least_stroke=_least_strokes(responses, run, arrangement),
        )
        for run, outcome in enumerate(responses.outcome)
    ]


def knows_least_strokes(arrangement: Arrangement) -> bool:
    """Whether a damper's tested range has a least stroke, which small strokes leave."""
    return any(device.knows_least_stroke for device in arrangement.devices) and not arrangement.has_actuators


def _least_strokes(responses: Responses, run: int, arrangement: Arrangement) -> Floats:
    # Those of others would depend on which histories are kept.
    needed = knows_least_strokes(arrangement) and np.isfinite(responses.energy_error[run])
    if responses.histories is None or not needed:
        return np.empty(0)
    strokes = responses.histories[run].deformation[:, : len(arrangement.devices)]
    return np.array([least_stroke(each) for each in strokes.T])


def read_recorded(record: Mapping[str, Any], arrangement: Arrangement) -> RunResult:
    """The result of a run from its line of a journal."""
    quantities = kept_quantities()
    numbers = {
        # One that came after the journal was written is unknown.
        each.name: array_of(record[each.name])[()]
        if each.name in record
        else np.full(_shape_of(each, arrangement), np.nan)
        for each in quantities
    }
    own = {name: value for name, value in record.items() if name not in numbers}
    result: RunResult = built(RunResult, {**own, "numbers": numbers})
    _ = Outcome[result.outcome.upper()]
    for quantity in quantities:
        shape, expected = np.shape(numbers[quantity.name]), _shape_of(quantity, arrangement)
        if quantity.name in _COMMANDS and arrangement.has_actuators:
            expected = (0,)
        if quantity.name in _OF_ELEMENTS:
            expected = (len(arrangement.devices) + len(arrangement.passive_devices),)
        if quantity.name == "peak_stroke" and not arrangement.devices and len(shape) == 1:
            # Of the added storeys, if there are any.
            continue
        if shape != expected:
            raise ValueError(f"{quantity.name} has the shape {shape} where {expected} was expected")
    if result.least_stroke.shape not in ((0,), (len(arrangement.devices),)):
        raise ValueError(f"least_stroke has the shape {result.least_stroke.shape}")
    return result


def history_of(history: History, arrangement: Arrangement) -> RunHistory:
    """The history of a run, for the floors and storeys of the bare building."""
    energies = (
        history.input_energy,
        history.kinetic_energy(arrangement.building),
        history.strain_energy(arrangement.building),
        history.damping_energy,
        history.device_energy[:, : len(arrangement.devices)].sum(axis=1)
        + history.element_energy[:, arrangement.passive_devices].sum(axis=1),
    )
    kept = {each.name: _own_columns(history, each, arrangement) for each in kept_signals()}
    return RunHistory(time=history.time, numbers={**kept, "energy": np.stack(energies, axis=1)})


@dataclass(frozen=True, slots=True, kw_only=True)
class DeviceDemand:
    """Demand of a run on one damper of a device, and what of it lies outside its tested ranges."""

    device: str
    demand: OperatingRange
    outside: Outside


def demands_of(run: RunResult, devices: Sequence[Device], seconds: float) -> tuple[DeviceDemand, ...]:
    """The demand of a run that lasts `seconds` [s] on each device; none without dampers, or with actuators instead."""
    # Actuators have forces but no currents; a run that did not finish has no peaks.
    if not run.finished or len(run.peak_current) != len(devices):
        return ()
    demands = []
    for number, device in enumerate(devices):
        least = float(run.least_stroke[number]) if run.least_stroke.size else None
        demand = demand_of(device, run.numbers, number, seconds=seconds, least_stroke=least)
        demands.append(DeviceDemand(device=device.name, demand=demand, outside=device.outside(demand)))
    return tuple(demands)


def worst_by_quantity(demands: Sequence[DeviceDemand]) -> tuple[Exceedance, ...]:
    """The worst exceedance of each quantity over the devices."""
    every = [(each.device, exceedance) for each in demands for exceedance in each.outside.exceedances]
    return tuple(worst for worst, _, _ in worst_of(every))


def damper_warnings(demands: Mapping[tuple[str, str], Sequence[DeviceDemand]]) -> tuple[str, ...]:
    """A sentence for each quantity outside the tested ranges, its worst run, and for each law out of its range.

    `demands` are those of each run by the labels of its row and its motion.
    """
    every, laws = [], []
    for (row, motion), devices in demands.items():
        for quantity in worst_by_quantity(devices):
            names = [each.device for each in devices if quantity in each.outside.exceedances]
            every.append((f"{names[0]} under {motion} with {row}", quantity))
        laws += [limit for each in devices for limit in each.outside.laws]
    n_runs = sum(1 for devices in demands.values() if devices)
    return (
        *(
            f"{worst.in_words}: {label}; {'beyond the rating' if worst.rated else 'outside the tested range'} in "
            f"{count} of {n_runs} runs with dampers."
            for worst, label, count in worst_of(every)
        ),
        *(f"{each.in_words}." for each in worst_laws(laws)),
    )


class Histories:
    """Histories of the study that is made in a run folder, in single precision except for time."""

    def __init__(self, work: RunAtWork, study: Study) -> None:
        self._work = work
        self._study = study
        rows = [_stem_of(each.label) for each in study.rows]
        motions = [_stem_of(each.name) for each in study.motions]
        self._names = {
            (row, motion): f"{HISTORIES}/{stem_of_history(row, motion)}-{label}-{name}.npz"
            for row, label in enumerate(rows)
            for motion, name in enumerate(motions)
        }

    @property
    def names(self) -> tuple[str, ...]:
        """Paths in the run folder, also of those that are not stored."""
        return tuple(self._names.values())

    def is_stored(self, row: int, motion: int) -> bool:
        """Whether the history of a run is stored and whole; a damaged one will be written again."""
        path = self._work.grown(self._names[row, motion])
        if not path.is_file():
            return False
        try:
            self._check(read_stored_history(path), row, motion)
        except RecordError:
            return False
        return True

    def keep(self, row: int, motion: int, history: RunHistory) -> None:
        """Store the history of a run, whole or not at all."""
        arrays = {name: np.asarray(values, dtype=np.float32) for name, values in history.numbers.items()}
        with replacing(self._work.growing(self._names[row, motion])) as stream:
            np.savez(stream, time=history.time, **arrays)  # type: ignore[arg-type] # none is called allow_pickle

    def _check(self, history: RunHistory, row: int, motion: int) -> None:
        study = self._study
        arrangement = study.arrangements[row] if row < len(study.arrangements) else study.at_zero
        _check_time(history.time, study.grounds[motion].duration, study.hardware.sample_time)
        for each in kept_signals():
            expected = (history.time.size, *_shape_of(each, arrangement))
            if history.numbers[each.name].shape != expected:
                raise RecordError(
                    f"{each.name} of a history has another shape than {expected}; run without --resume"
                )


def read_stored_history(path: Path) -> RunHistory:
    """The history in a file."""
    try:
        # From a stream of ours, which NumPy leaves open where the file is damaged.
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
            names = (*(each.name for each in kept_signals()), "energy")
            numbers = {name: arrays[name].astype(np.float64) for name in names}
            return RunHistory(time=arrays["time"], numbers=numbers)
    except (KeyError, OSError, ValueError, zipfile.BadZipFile, zlib.error) as reason:
        raise RecordError(
            f"{path} is not the history of a run ({reason}); run `mrwork respond` again"
        ) from None


def _check_time(time: Floats, duration: float, sample_time: float) -> None:
    """Check that there is a sample at every step, from the start of a motion to its end [s]."""
    # A motion need not end at a sample.
    whole = abs(duration / sample_time - time.size) < 2.0
    if not (whole and np.array_equal(time, np.arange(time.size) * sample_time)):
        raise RecordError(
            f"a history has not the samples every {sample_time:g} s of {duration:g} s; run without --resume"
        )


def stem_of_history(row: int, motion: int) -> str:
    """First part of the name of the file of a history."""
    return f"{row + 1:02d}-{motion + 1:02d}"


def _stem_of(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9.]+", "_", name).strip("._") or "run"


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
        """Every criterion of a run that is known."""
        found = ((entry, float(self.numbers[entry.name][place])) for entry in criteria())
        return {entry.name: value for entry, value in found if not (entry.optional and math.isnan(value))}

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
    scales: Sequence[Scales],
) -> LabelledRuns:
    """The criteria of runs, and of the rows that were simulated with realisations, the last ones of that axis.

    `scales` are those of the building of each row.
    """
    labelled = criteria_of_runs(axes, command_unit=command_unit)
    for place, run in runs.items():
        named = values(run, scales[place[0]]) if run.finished else dict.fromkeys(labelled.numbers, np.inf)
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
    journal: Journal | None, step: str, inputs: str, axes: Axes, compute: Callable[[], LabelledRuns]
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
