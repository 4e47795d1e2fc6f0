"""Results of closed-loop simulations: peaks, mean squares and energies; histories if requested."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar, Literal, cast

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.base.arguments import checked
from mrwork.base.keys import look_up
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes
from mrwork.base.numbers import counted, format_rounded
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Remark
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device
from mrwork.buildings.groups import BOTH_UNITS, commanded, joined_units
from mrwork.buildings.plane_building import Building
from mrwork.dampers.spec import LAW_BEYOND, worst_laws
from mrwork.dampers.tested_range import OperatingRange, Outside, least_stroke, outside_remark, worst_of
from mrwork.errors import SettingError

ENERGY_TOLERANCE = 1e-6
"""Energy errors above this are reported: 1e-8 is normal, a chattering law or a long step gives more."""


COMMAND_UNIT = "A or V"
"""Unit of quantities of the command, whatever the dampers."""
_COMMAND_RATE_UNIT = "A/s or V/s"

Axis = Literal["run", "floor", "storey", "device", "element", "state"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A quantity of a run or a signal of its history, as the core declares it.

    `axis` is its second axis: floors, storeys, devices, passive elements or states; "run" for one number a run.
    """

    name: str
    axis: Axis
    unit: str
    description: str

    @property
    def own_axes(self) -> tuple[str, ...]:
        """Its axis beside the axes of runs or of time; empty where it has none."""
        # The signal `state` has entries of its own name.
        return () if self.axis == "run" else ("entry",) if self.axis == "state" else (self.axis,)

    def array(self, values: NDArray[Any], *axes: str, command_unit: str = BOTH_UNITS) -> NamedArray:
        """Values over these axes and its own, with the unit of commands of the dampers at hand."""
        unit = in_command_unit(self.unit, command_unit)
        return NamedArray.of(values, *axes, *self.own_axes, unit=unit, long_name=self.description)


@cache
def run_quantities() -> tuple[Quantity, ...]:
    """Quantities that the core returns for a run, in the order of its columns."""
    return _make_quantities(_rust.run_quantities())


@cache
def history_signals() -> tuple[Quantity, ...]:
    """Signals that the core returns for the history of a run, in the order of its columns."""
    return _make_quantities(_rust.history_signals())


def _make_quantities(entries: Sequence[tuple[str, str, str, str]]) -> tuple[Quantity, ...]:
    return tuple(
        Quantity(name=name, axis=cast("Axis", axis), unit=unit, description=description)
        for name, axis, unit, description in entries
    )


WEIGHTED = Quantity(
    name="weighted_acceleration",
    axis="floor",
    unit="m/s^2",
    description="rms of the absolute acceleration weighted by W_k, from the history",
)
"""What a run has where its history is kept and a criterion of it is asked for."""


@cache
def quantity_named(name: str) -> Quantity:
    """A quantity of a run or a signal of its history."""
    return {signal.name: signal for signal in (*history_signals(), *run_quantities(), WEIGHTED)}[name]


def in_command_unit(unit: str, command_unit: str) -> str:
    """A unit; where it is the general unit of commands or of their rate, with the A or V of the dampers at hand."""
    if command_unit in (COMMAND_UNIT, BOTH_UNITS):
        return unit
    return {COMMAND_UNIT: command_unit, _COMMAND_RATE_UNIT: f"{command_unit}/s"}.get(unit, unit)


def columns_by_name(
    rows: Floats, quantities: Sequence[Quantity], counts: Sequence[tuple[str, int]]
) -> dict[str, Floats]:
    """Columns of the core by name, of which `counts` has the numbers; a quantity of axis "run" has no second axis."""
    by_name: dict[str, Floats] = {}
    start = 0
    for quantity, (_, count) in zip(quantities, counts, strict=True):
        columns = rows[:, start : start + count]
        by_name[quantity.name] = columns[:, 0] if quantity.axis == "run" else columns
        start += count
    return by_name


class Labelled:
    """A result whose numbers have names: `result.peak_drift` is `result.numbers["peak_drift"]`.

    The names with their units and last axes are declared once, by the core (`run_quantities`, `history_signals`);
    the class has the axes before, as of runs or of time.
    """

    __slots__ = ()

    numbers: Mapping[str, Any]

    def __getattr__(self, name: str) -> Any:
        if name != "numbers" and name in self.numbers:
            return self.numbers[name]
        raise AttributeError(f"{type(self).__name__} has no {name!r}")

    def __dir__(self) -> Iterable[str]:
        return [*object.__dir__(self), *self.numbers]


def command_unit_of(devices: Sequence[Device]) -> str:
    """Unit of the commands of these devices; "A or V" where none follows a command."""
    return joined_units(device.command_unit for device in commanded(devices)) or COMMAND_UNIT


def _labels_of_axes(numbers: Mapping[str, Floats], devices: Sequence[Device]) -> dict[str, NamedArray]:
    """Labels along the second axes of quantities: names of the devices, numbers from 1 for storeys and floors."""
    sizes = {
        axis: values.shape[1] for name, values in numbers.items() for axis in quantity_named(name).own_axes
    }
    named = {"device": [device.name for device in devices]}
    return {
        axis: NamedArray.of(
            named[axis] if len(set(named.get(axis, ()))) == size and size else np.arange(1, size + 1)
        )
        for axis, size in sizes.items()
    }


# A command with a mean above this share of its peak is constant but for the lag of the driver.
_CONSTANT = 0.9


def demand_of(
    device: Device, numbers: Mapping[str, Floats], place: int, *, seconds: float, least_stroke: float | None
) -> OperatingRange:
    """Demand of a run of so many seconds on one damper of the device at this place among all, by its quantities.

    The frequency belongs to a sinusoid with the peak velocity and the peak stroke. A command whose mean is within
    10 % of its peak is taken for constant, any other to start from zero, as every run does. `least_stroke` is
    defined in `OperatingRange`; `None` where the run has no history.
    """
    names = ("peak_stroke", "peak_rate", "peak_force", "device_energy", "peak_current", "mean_current")
    stroke, velocity, force, energy, peak, mean = (float(numbers[name][place]) for name in names)
    n_dampers = device.count * (2.0 if device.differential else 1.0)
    frequency = velocity / (2.0 * np.pi * stroke) if stroke > 0.0 else None
    command = None if device.command is None else (device.command, device.command)
    if command is None and device.spec.follows_command:
        command = (peak if mean > _CONSTANT * peak else 0.0, peak)
    return OperatingRange(
        stroke=stroke,
        velocity=velocity,
        frequency=None if frequency is None else (frequency, frequency),
        command=command,
        command_unit=None if command is None else device.spec.command_unit,
        force=force / n_dampers,
        power=max(0.0, energy / n_dampers / seconds),
        least_stroke=least_stroke,
    )


# Quantities in the summary.
_IN_SUMMARY = ("peak_drift", "peak_acceleration", "peak_force", "peak_current", "energy_error")
_SHOWN_SIGNALS = ("drift", "acceleration", "force", "current")


@array_dataclass(repr=False)
class History(Plotted, Labelled, WithAxes, Summarised):
    """One run over time, at the control samples and at the end; first axis n_time.

    The signals and their units are declared by the core, see `history_signals`. At the end the last command is still
    held. Energies are accumulated from the start [J]; `state` is [q; q'], shape (n_time, 2n).
    """

    _made_by: ClassVar[str] = "mr.simulate_loop(..., histories=True).histories"

    time: Floats
    numbers: Mapping[str, Floats]

    @checked
    def kinetic_energy(self, building: Building) -> Floats:
        """Kinetic energy of the motion relative to the ground [J], shape (n_time,)."""
        velocity = self.state[:, len(building.mass) :]
        return np.asarray(0.5 * np.einsum("ti,ij,tj->t", velocity, building.mass, velocity))

    @checked
    def strain_energy(self, building: Building) -> Floats:
        """Strain energy of the building without its elements, less the work of weights [J], shape (n_time,)."""
        displacement = self.state[:, : len(building.mass)]
        return np.asarray(0.5 * np.einsum("ti,ij,tj->t", displacement, building.site_stiffness, displacement))

    def _named_arrays(self) -> NamedArrays:
        return NamedArrays(
            title="History of a closed loop",
            rows=("time",),
            labels={
                "time": NamedArray.of(self.time, unit="s", long_name="time"),
                **_labels_of_axes(self.numbers, ()),
            },
            arrays={
                name: quantity_named(name).array(values, "time") for name, values in self.numbers.items()
            },
        )

    def _summary(self) -> Summary:
        rows = [
            (
                name.replace("_", " "),
                format_rounded(float(np.abs(getattr(self, name)).max())),
                quantity_named(name).unit,
            )
            for name in _SHOWN_SIGNALS
        ]
        return Summary(
            title=f"History of one run: {len(self.time)} samples, {self.time[-1]:g} s",
            tables=[Table(columns=("quantity", "largest", "unit"), rows=rows)],
        )


@array_dataclass(repr=False)
class Responses(Plotted, Labelled, WithAxes, Summarised):
    """Runs in the order candidate, motion, draw, the last varying fastest; infinite for a run that did not finish.

    `to_xarray` and `over_axes` have the quantities over candidate, motion and realisation, which is a draw of the
    dampers, and then floor, storey, device or element.

    The quantities and their units are declared by the core, see `run_quantities`. Each is an attribute; of
    floors, storeys, devices and passive elements it has a second axis. Peaks are taken at the starts of all
    integration steps and at the end, mean squares at the starts; accelerations are absolute. `energy_error` is the
    largest imbalance of input, kinetic, strain, damping, device and element energy during the run, relative to the
    largest energy. `steps` is the number of integration steps per sample, `shape` the numbers of candidates, motions
    and draws. `devices` are the dampers, none where actuators replace them; `seconds` are the lengths of the motions.
    `slopes` are the exact derivatives of the `numbers` along each direction in the gains that the `LoopVariation` has.
    `law_remarks` are on a gain that no design has looked at; commands are in `command_unit`, those of actuators in N.
    """

    shape: tuple[int, int, int]
    outcome: NDArray[np.uint8]
    steps: NDArray[np.uint32]
    numbers: Mapping[str, Floats]
    histories: tuple[History, ...] | None = None
    devices: tuple[Device, ...] = ()
    seconds: tuple[float, ...] = ()
    motions: tuple[str, ...] = ()
    slopes: tuple[Mapping[str, Floats], ...] = ()
    law_remarks: tuple[Remark, ...] = ()
    command_unit: str = COMMAND_UNIT

    @checked
    def over_axes(self, name: str) -> Floats:
        """A quantity over its axes, shape (n_candidates, n_motions, n_draws) and its own axis, if it has one."""
        numbers = look_up(name, self.numbers, f"a run has no quantity {name!r}")
        return np.asarray(self._over_axes(numbers))

    def _over_axes(self, values: NDArray[Any]) -> NDArray[Any]:
        return values.reshape(*self.shape, *values.shape[1:])

    def _named_arrays(self) -> NamedArrays:
        first = ("candidate", "motion", "realisation")
        candidates, motions, draws = (NamedArray.of(range(count)) for count in self.shape)
        ends: dict[str, tuple[NDArray[Any], str]] = {
            "outcome": (self.outcome, "how the run ended"),
            "steps": (self.steps, "integration steps per sample"),
        }
        return NamedArrays(
            title="Responses of closed loops",
            rows=first,
            labels={
                "candidate": candidates,
                # Names that two motions have would be ambiguous labels.
                "motion": NamedArray.of(self.motions) if len(set(self.motions)) == self.shape[1] else motions,
                "realisation": draws,
                **_labels_of_axes(self.numbers, self.devices),
            },
            arrays={
                name: quantity_named(name).array(
                    self._over_axes(values), *first, command_unit=self.command_unit
                )
                for name, values in self.numbers.items()
            }
            | {
                name: NamedArray.of(self._over_axes(values), *first, long_name=words)
                for name, (values, words) in ends.items()
            },
        )

    @checked
    def demand(self, run: int, device: int) -> OperatingRange:
        """Demand of a run on one damper of a device.

        Raises
        ------
        SettingError
            If there is no such run or device, or the run did not finish.
        """
        if not (0 <= run < len(self.outcome) and 0 <= device < len(self.devices)):
            raise SettingError(
                f"there are {len(self.outcome)} runs and {len(self.devices)} dampers, counted from 0; give one of "
                f"each, not run {run} and damper {device}"
            )
        if not np.isfinite(self.energy_error[run]):
            raise SettingError(f"run {run} did not finish, and has no demand; give another")
        _, n_motions, n_draws = self.shape
        return demand_of(
            self.devices[device],
            {name: values[run] for name, values in self.numbers.items()},
            device,
            seconds=self.seconds[run // n_draws % n_motions],
            least_stroke=self._least_stroke(run, device),
        )

    @checked
    def outside(self, run: int) -> tuple[Outside, ...]:
        """Quantities of the demand of a finished run outside the tested ranges of each device."""
        return tuple(device.outside(self.demand(run, number)) for number, device in enumerate(self.devices))

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On the gain, each quantity outside the tested ranges of the devices, and each law out of its range."""
        finished = np.flatnonzero(np.isfinite(self.energy_error))
        # One of the runs with the largest or the smallest value of a quantity is the worst.
        cases = [
            (device.name, device.outside(self.demand(run, number)))
            for number, device in enumerate(self.devices)
            for run in self._extreme(finished, number)
        ]
        worst = (outside_remark(exceedance, f", {name}") for exceedance, name, _ in worst_of(cases))
        limits = worst_laws(limit for _, case in cases for limit in case.laws)
        return (*self.law_remarks, *worst, *(limit.remark(LAW_BEYOND) for limit in limits))

    def _least_stroke(self, run: int, device: int) -> float | None:
        return None if self.histories is None else least_stroke(self.histories[run].deformation[:, device])

    def _extreme(self, runs: NDArray[np.intp], device: int) -> list[int]:
        """The runs with the largest and the smallest value of a quantity of a device."""
        if not runs.size:
            return []
        _, n_motions, n_draws = self.shape
        seconds = np.array(self.seconds)[runs // n_draws % n_motions]
        signals = (self.peak_stroke, self.peak_rate, self.peak_force, self.peak_current, self.device_energy)
        columns = [signal[runs, device] for signal in signals]
        columns[-1] = columns[-1] / seconds
        columns.append(columns[1] / np.maximum(columns[0], np.finfo(float).tiny))
        if self.histories is not None:
            columns.append(np.array([self._least_stroke(run, device) for run in runs.tolist()]))
        ends = {int(runs[pick(column)]) for column in columns for pick in (np.argmax, np.argmin)}
        return sorted(ends)

    def _summary(self) -> Summary:
        candidates, motions, draws = self.shape
        finished = np.isfinite(self.energy_error)
        asked = "current" if self.devices else "command"
        rows = [
            (
                name.replace("_", " ").replace("current", asked),
                *(format_rounded(float(value)) for value in np.quantile(largest, [0.0, 0.5, 1.0])),
                in_command_unit(quantity_named(name).unit, self.command_unit),
            )
            for name in _IN_SUMMARY
            for values in [getattr(self, name).reshape(len(finished), -1).max(axis=1, initial=0.0)]
            for largest in [values[finished] if finished.any() else np.array([np.nan])]
        ]
        return Summary(
            title=f"Responses of {counted(len(self.outcome), 'run')}: {counted(candidates, 'candidate')} x "
            f"{counted(motions, 'motion')} x {counted(draws, 'draw')}",
            facts=(
                ("finished", f"{int(finished.sum())} of {len(self.outcome)}"),
                ("histories", "none" if self.histories is None else counted(len(self.histories), "run")),
            ),
            tables=[Table(columns=("largest of a run", "least", "median", "largest", "unit"), rows=rows)],
            remarks=self.remarks,
        )
