"""Runs of a study or a tuning as one labelled array: quantities or criteria over row, motion and realisation.

A row is an arrangement of a study or a candidate of a tuning. Quantities of floors, storeys and devices have a fourth
axis, with the labels of all rows together. What a row does not have is NaN, and so are all numbers of a run without an
end; `outcome` says which.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.closed_loop.evaluation import (
    SCORE,
    Criterion,
    Scales,
    criteria,
    criterion,
    on_request,
    ratio,
    values,
)
from mrwork.closed_loop.frequency_weighting import frequency_weighted
from mrwork.closed_loop.responses import (
    ENERGY_TOLERANCE,
    WEIGHTED,
    History,
    Labelled,
    Quantity,
    Responses,
    command_unit_of,
    in_command_unit,
    quantity_named,
    run_quantities,
)
from mrwork.dampers.simulation import Outcome
from mrwork.dampers.tested_range import least_stroke
from mrwork.motions import GroundMotion
from mrwork.store.codec import array_of, plain
from mrwork.store.journal import Journal
from mrwork.study.study import Arrangement, Study, commands_force, replaces_dampers

Axes = Mapping[str, tuple[str, ...]]
"""Labels along each axis by its name."""

NOMINAL = "nominal"
"""The realisation without anything uncertain."""

HALF_STEP = "half the step"
"""The nominal realisation again, with half the integration step."""

NOT_RUN = 255
"""Outcome of what was not simulated."""

_ENDS = {NOT_RUN: "", **{int(outcome): outcome.name.lower() for outcome in Outcome}}
_FINISHED = (Outcome.FINISHED, Outcome.FAILED_SAFE)
_ERROR = "energy_error"
_N_FIRST = 3
_REALISATION = 2
_ALL = slice(None)
# Columns of dampers behind which stand columns of passive elements, which are devices, too.
_OF_ELEMENTS = {
    "peak_force": "peak_element_force", "peak_stroke": "peak_element_stroke", "device_energy": "element_energy",
}  # fmt: skip
_COMMANDS = ("peak_current", "mean_current", "rms_current", "command_travel", "switching_rate")
_LEFT_OUT = {"rms_force", *_OF_ELEMENTS.values()}
# What a study knows of a run beside the quantities of the core.
_FURTHER = (
    Quantity(name="steps", axis="run", unit="1", description="integration steps per sample"),
    Quantity(name="least_stroke", axis="device", unit="m", description="least stroke of a cycle"),
)


def asks_for_weighted(asked: Iterable[str]) -> bool:
    """Whether a criterion among those that are asked for is from weighted accelerations."""
    return any(criterion(name).quantity == WEIGHTED.name for name in asked)


def study_quantities(command_unit: str, asked: Sequence[str] = ()) -> tuple[Quantity, ...]:
    """Quantities that a study keeps of each run; those of the command are in `command_unit`."""
    quantities = (*(quantity for quantity in run_quantities() if quantity.name not in _LEFT_OUT), *_FURTHER)
    quantities += (WEIGHTED,) if asks_for_weighted(asked) else ()
    return tuple(
        replace(quantity, unit=in_command_unit(quantity.unit, command_unit)) for quantity in quantities
    )


def study_criteria(command_unit: str, asked: Sequence[str] = ()) -> tuple[Quantity, ...]:
    """Every criterion as a quantity of a run, those asked for behind, and the error of its energies."""
    entries = (*criteria(), *map(criterion, asked))
    units = {entry: in_command_unit(entry.declared_unit, command_unit) for entry in entries}
    named = (
        Quantity(name=entry.name, axis="run", unit=unit, description=entry.title)
        for entry, unit in units.items()
    )
    return *named, quantity_named(_ERROR)


@array_dataclass(repr=False)
class Runs(Labelled, WithAxes, Summarised):
    """Numbers of runs by name, each an attribute; NaN where a run has none, and `outcome` says why.

    `axes` are rows of a study or candidates of a tuning, motions and realisations, with the labels along each, and then
    floors, storeys and devices. Devices are the dampers, and then the passive devices of the building, of which storeys
    that yield are none. `declared` are the quantities or criteria with axis, unit and words; `outcome` has the shape of
    the first three axes.
    """

    _made_by: ClassVar[str] = "mr.run_study(study)"

    axes: Axes
    declared: tuple[Quantity, ...]
    numbers: Mapping[str, Floats]
    outcome: NDArray[np.uint8]

    @staticmethod
    def empty(axes: Axes, declared: Sequence[Quantity]) -> Runs:
        """Runs of which none was simulated: numbers of NaN, and the outcome `NOT_RUN`."""
        first = tuple(map(len, axes.values()))[:_N_FIRST]
        return Runs(
            axes=axes,
            declared=tuple(declared),
            numbers={
                quantity.name: np.full((*first, *(len(axes[name]) for name in quantity.own_axes)), np.nan)
                for quantity in declared
            },
            outcome=np.full(first, NOT_RUN, dtype=np.uint8),
        )

    @property
    def shape(self) -> tuple[int, int, int]:
        """Numbers of rows or candidates, of motions and of realisations."""
        rows, motions, realisations = self.outcome.shape
        return rows, motions, realisations

    @property
    def finished(self) -> NDArray[np.bool_]:
        """Whether each run has results, also where it failed safe."""
        return np.isin(self.outcome, _FINISHED)

    @property
    def done(self) -> NDArray[np.bool_]:
        """Whether each run was simulated, to whatever end."""
        return np.asarray(self.outcome != NOT_RUN)

    @property
    def balanced(self) -> NDArray[np.bool_]:
        """Whether the energies of each run balance, or it has none."""
        return ~self.finished | (self.numbers[_ERROR] <= ENERGY_TOLERANCE)

    @property
    def n_done(self) -> int:
        """Number of runs that were simulated, to whatever end."""
        return int(self.done.sum())

    def put(self, part: Runs, row: int, motions: slice | list[int] = _ALL) -> None:
        """Fill in the one row of a part, under these motions."""
        self.outcome[row, motions] = part.outcome[0]
        for name, array in part.numbers.items():
            self.numbers[name][row, motions] = array[0]

    def part(
        self, rows: slice | list[int] = _ALL, motions: slice | list[int] = _ALL, realisations: slice = _ALL
    ) -> Runs:
        """The runs of some rows, motions and realisations with their labels; of all where none are given."""
        here = dict(zip(self.axes, (rows, motions, realisations), strict=False))
        return replace(
            self,
            axes={
                axis: tuple(np.array(labels, dtype=object)[here.get(axis, _ALL)])
                for axis, labels in self.axes.items()
            },
            numbers={
                name: array[rows][:, motions][:, :, realisations] for name, array in self.numbers.items()
            },
            outcome=self.outcome[rows][:, motions][:, :, realisations],
        )

    def with_labels(self, axis: str, labels: Sequence[str]) -> Runs:
        """The same with other labels along an axis."""
        return replace(self, axes={**self.axes, axis: tuple(labels)})

    def beside(self, others: Runs) -> Runs:
        """The same rows and motions with further realisations."""
        axis = [*self.axes][_REALISATION]
        together = replace(
            self,
            numbers={
                name: np.concatenate([array, others.numbers[name]], axis=_REALISATION)
                for name, array in self.numbers.items()
            },
            outcome=np.concatenate([self.outcome, others.outcome], axis=_REALISATION),
        )
        return together.with_labels(axis, [*self.axes[axis], *others.axes[axis]])

    def of_row(self, row: int) -> Runs:
        """The runs of one row; the axis of rows stays, of length 1."""
        return self.part(slice(row, row + 1))

    def up_to_collapse(self, criterion: str) -> Floats:
        """A criterion of each run, infinite for one that diverged."""
        return np.where(self.outcome == Outcome.DIVERGED, np.inf, self.numbers[criterion])

    def at(self, row: int, motion: int, realisation: int = 0) -> Mapping[str, Any]:
        """The numbers of one run by name."""
        return {name: array[row, motion, realisation] for name, array in self.numbers.items()}

    @property
    def entries(self) -> tuple[Criterion, ...]:
        """The criteria that these runs have, where they have criteria: every one, and those asked for behind."""
        return tuple(criterion(quantity.name) for quantity in self.declared if quantity.name != _ERROR)

    def criteria(self, scales: Scales, command_unit: str, asked: Sequence[str] = ()) -> Runs:
        """Every criterion of each run and those asked for, over the `scales` of its row; NaN where a run has none."""
        numbers = {**values(self, scales, asked), _ERROR: self.numbers[_ERROR]}
        entries = (*criteria(), *map(criterion, asked))
        unknown = [entry.name for entry in entries if entry.unknown_in(command_unit)]
        numbers |= {name: np.full_like(numbers[name], np.nan) for name in unknown}
        ended = self.finished
        return replace(
            self,
            axes=dict([*self.axes.items()][:_N_FIRST]),
            declared=study_criteria(command_unit, asked),
            numbers={name: np.where(ended, array, np.nan) for name, array in numbers.items()},
        )

    def over(self, reference: Runs, *, bare: bool = False) -> dict[str, Floats]:
        """Ratio of every criterion to the one row of a reference, under the same motion and realisation.

        `bare` says that the reference is the building without dampers, over which some criteria have another one.
        """
        named = {entry.name: entry.reference_criterion if bare else entry.name for entry in self.entries}
        unknown = np.full(self.outcome.shape, np.nan)
        return {
            name: ratio(self.numbers[name], reference.numbers[other]) if other else unknown
            for name, other in named.items()
        }

    def scores(self, at_zero: Runs, scored: Sequence[str] = SCORE) -> Floats:
        """Score of each run: mean over the `scored` criteria of their ratios to those of the dampers at i = 0.

        The latter are under the same motion and realisation.
        """
        ratios = [ratio(self.numbers[name], at_zero.numbers[name]) for name in scored]
        return np.asarray(np.mean(ratios, axis=0))

    def recalled(
        self, journal: Journal | None, step: str, inputs: str, simulate: Callable[[Runs], Runs]
    ) -> Runs:
        """Runs in the place of these empty ones: from the journal, which has no labels, or simulated and recorded."""

        def read(record: Mapping[str, Any]) -> Runs:
            numbers = {name: array_of(column) for name, column in record["numbers"].items()}
            return self._filled(numbers, np.array(record["outcome"], dtype=np.uint8))

        recalled = None if journal is None else journal.recall(step, inputs, read)
        if recalled is not None:
            return recalled
        runs = simulate(self)
        if journal is not None:
            journal.record(step, inputs, {"outcome": runs.outcome.tolist(), "numbers": plain(runs.numbers)})
        return runs

    @staticmethod
    def from_arrays(named: NamedArrays, declared: Sequence[Quantity], realisation: str = "") -> Runs:
        """The runs of a file; runs of one `realisation` have no axis for it."""
        labels = {axis: tuple(map(str, label.values)) for axis, label in named.labels.items()}
        extra_axes = dict.fromkeys(axis for quantity in declared for axis in quantity.own_axes)
        axes = {axis: labels.get(axis, ()) for axis in ("row", "motion", "realisation", *extra_axes)}
        numbers = {name: array.values for name, array in named.arrays.items()}
        codes = {name: code for code, name in _ENDS.items()}
        outcome = np.array([codes[name] for name in numbers["outcome"].ravel()], dtype=np.uint8)
        axes["realisation"] = axes["realisation"] or (realisation,)
        return Runs.empty(axes, declared)._filled(numbers, outcome)

    def _filled(self, numbers: Mapping[str, Any], outcome: NDArray[np.uint8]) -> Runs:
        """These empty runs with numbers; a quantity that was not declared when they were written is unknown."""
        arrays = {
            name: array.reshape(self.numbers[name].shape)
            for name, array in numbers.items()
            if name in self.numbers
        }
        return replace(self, numbers={**self.numbers, **arrays}, outcome=outcome.reshape(self.shape))

    def _named_arrays(self) -> NamedArrays:
        first = tuple(self.axes)[:_N_FIRST]
        return NamedArrays(
            title=f"Runs by {list_names(first)}",
            rows=first,
            labels={axis: NamedArray.of(list(labels)) for axis, labels in self.axes.items()},
            arrays={
                quantity.name: quantity.array(self.numbers[quantity.name], *first)
                for quantity in self.declared
            }
            | {"outcome": NamedArray.of(outcome_names(self.outcome), *first, long_name="how the run ended")},
        )

    def _summary(self) -> Summary:
        return Summary(
            title=f"Runs by {list_names(list(self.axes))}",
            facts=[(name, list_names(labels)) for name, labels in self.axes.items()],
        )


def outcome_names(outcomes: NDArray[np.uint8]) -> NDArray[np.str_]:
    """Names of outcomes as files have them, empty where nothing was simulated."""
    names = [_ENDS[code] for code in outcomes.ravel().tolist()]
    return np.array(names, dtype="U12").reshape(outcomes.shape)


def runs_of(responses: Responses, arrangement: Arrangement, axes: Axes, asked: Sequence[str] = ()) -> Runs:
    """The runs of an arrangement or of candidates of its law over these axes, with the floors of the bare building.

    Of criteria that are `asked` for it has the quantities.
    """
    axes = {**axes, **{name: labels for name, labels in own_axes([arrangement]).items() if name not in axes}}
    runs = Runs.empty(axes, study_quantities(command_unit_of(arrangement.devices), asked))
    runs = replace(runs, outcome=responses.outcome.reshape(runs.shape))
    ended = runs.finished.ravel()
    dampers, strokes, elements = _device_labels(arrangement)

    def fill(name: str, columns: Floats, labels: Sequence[str] | None = None) -> None:
        numbers = np.where(ended.reshape(-1, *[1] * (columns.ndim - 1)), columns, np.nan)
        if labels is None:
            runs.numbers[name][...] = numbers.reshape(runs.numbers[name].shape)
        else:
            places = [axes["device"].index(label) for label in labels]
            runs.numbers[name][..., places] = numbers.reshape(*runs.shape, len(places))

    fill("steps", responses.steps.astype(np.float64))
    # Least strokes of others would depend on which histories are kept.
    if responses.histories is not None and knows_least_strokes(arrangement):
        deformations = (history.deformation[:, : len(dampers)] for history in responses.histories)
        least = [[least_stroke(deformation) for deformation in columns.T] for columns in deformations]
        fill("least_stroke", np.array(least), dampers)
    if responses.histories is not None and WEIGHTED.name in runs.numbers:
        floors = arrangement.places["floor"]
        fill(WEIGHTED.name, np.array([_weighted_rms(history, floors) for history in responses.histories]))
    fill("peak_stroke", responses.peak_drift[:, arrangement.strokes], strokes)
    for name, source in _OF_ELEMENTS.items():
        fill(name, responses.numbers[source][:, arrangement.passive_devices], elements)
    for quantity in runs.declared:
        name, columns = quantity.name, responses.numbers.get(quantity.name)
        if columns is not None and quantity.axis != "device":
            places = arrangement.places.get(quantity.axis)
            fill(name, columns if places is None else columns[:, places])
        # What is asked of an ideal actuator in the place of dampers is a force, and no command of theirs.
        elif columns is not None and not (name in _COMMANDS and replaces_dampers(arrangement)):
            fill(name, columns[:, : len(dampers)], dampers)
    return runs


def _weighted_rms(history: History, floors: Sequence[int]) -> Floats:
    """Rms of the weighted accelerations of floors over a history, shape (n_floors,)."""
    # A run without an end has none, whatever it has here.
    acceleration = np.nan_to_num(history.acceleration[:, floors], nan=0.0, posinf=0.0, neginf=0.0)
    weighted = frequency_weighted(acceleration, float(history.time[1] - history.time[0]))
    return np.asarray(np.sqrt(np.mean(weighted**2, axis=0)))


def knows_least_strokes(arrangement: Arrangement) -> bool:
    """Whether a damper's tested range has a least stroke, which small strokes leave, as histories alone show."""
    least = (device.tested and device.tested.least_stroke for device in arrangement.devices)
    return any(stroke is not None for stroke in least) and not commands_force(arrangement)


def _device_labels(arrangement: Arrangement) -> tuple[list[str], list[str], list[str]]:
    """Labels of the dampers, of added storeys with a stroke and of the passive devices of an arrangement."""
    building = arrangement.building
    taken = Counter[str]()

    def distinct(names: Iterable[str]) -> list[str]:
        labels = []
        for name in names:
            taken[name] += 1
            labels.append(name if taken[name] == 1 else f"{name} ({taken[name]})")
        return labels

    return (
        distinct(device.name for device in arrangement.devices),
        distinct(building.storey_names[index] for index in arrangement.strokes),
        distinct(building.elements[index].name for index in arrangement.passive_devices),
    )


def own_axes(arrangements: Sequence[Arrangement]) -> dict[str, tuple[str, ...]]:
    """Labels of floors and storeys of the bare building, and of the devices of all arrangements, dampers first."""
    groups = [_device_labels(arrangement) for arrangement in arrangements]
    devices = dict.fromkeys(name for kind in zip(*groups, strict=True) for labels in kind for name in labels)
    bare = arrangements[0].bare
    return {"floor": bare.frame_floors, "storey": bare.drift_names, "device": tuple(devices)}


def asking(study: Study, names: Iterable[str]) -> Study:
    """The study with the criteria of these names, too; refused where it has no such place, or not what one is over."""
    names = tuple(names)
    asked = on_request((*study.asked, *names))
    axes, scales = own_axes(study.arrangements), Scales.of(study.building)
    for name in names:
        criterion(name).check_place(axes)
        criterion(name).check_scale(scales)
    return replace(study, asked=asked)


def numbered(count: int) -> tuple[str, ...]:
    """Labels of candidates and realisations, which have no names."""
    return tuple(str(number) for number in range(1, count + 1))


def candidate_axes(
    n_candidates: int, motions: Sequence[GroundMotion], n_realisations: int
) -> dict[str, tuple[str, ...]]:
    """Axes of the runs of a tuning: candidates and realisations by number from 1, motions by name."""
    return {
        "candidate": numbered(n_candidates),
        "motion": tuple(motion.name for motion in motions),
        "realisation": numbered(n_realisations),
    }
