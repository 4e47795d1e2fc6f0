"""Dampers at one place of a building that follow one command: a device."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import inf
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import May, NotNegative, Positive, checked
from mrwork.base.hints import Within
from mrwork.base.numbers import format_rounded
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table
from mrwork.base.values import Floats, array_dataclass, keep_arrays
from mrwork.buildings.plane_building import Building
from mrwork.dampers.dependence import Dependence
from mrwork.dampers.parameters import Lag, ParamSpec
from mrwork.dampers.spec import DamperSpec, with_other_dependences
from mrwork.dampers.tested_range import OperatingRange, Outside, beyond_rating, outside_of
from mrwork.errors import SettingError

_FORCE = ParamSpec(
    name="f", unit="N", scale="linear", lower=-1e300, upper=1e300, nominal=0.0, description="resisting force"
)
_ACTUATOR = DamperSpec(
    name="ideal_actuator",
    title="Ideal actuator",
    equation="f = u",
    description="Exerts the commanded force at once, up to its limit, and may add energy to the building.",
    source="the bound of every semi-active law",
    nominal_source="none",
    n_states=0,
    spring=None,
    plain=(_FORCE,),
    parameters=(replace(_FORCE, name="f.0"), replace(_FORCE, name="f.1", unit="1", nominal=1.0)),
    laws=(Dependence(1),),
)


@checked
@array_dataclass(repr=False)
class Device(Summarised):
    """Dampers at one place that follow one command between 0 and `largest_command`.

    `theta` belongs to one damper. The force of the device in responses and laws, and the weights and slopes of a law,
    count all its dampers together.

    Parameters
    ----------
    spec, theta
        Damper model and its parameters, shape (n_params,), or one row per draw.
    row
        Elongation = row @ q, shape (n,): a row of `building.storeys`.
    largest_command
        Largest command of the driver [A or V]; a passive model, which follows no command, needs none. The largest force
        of an actuator, see `mr.buildings.ideal_actuator` [N].
    count
        Number of dampers in parallel.
    differential
        Whether as many dampers act in the opposite direction, so that constant forces cancel.
    tested
        Ranges in which one of the dampers was tested, as `Fit.tested`; `None` if unknown.
    lag
        Rate of a first-order lag of the driver [1/s], or its rates of a rising and of a falling current, in place of
        the lag in `theta`, if there is one. Rates become the last parameters of `spec` and `theta`.
    command
        Command that the dampers hold [A or V], whatever a law sends; `None` where a law commands them.
    rated_force, rated_stroke, rated_command
        Force [N], stroke [m] and largest command [A or V] that one of the dampers is made for, beyond which runs are
        told; `None` if unknown.
    sprung
        Displacement of the sprung mass = sprung @ q, shape (n,): the row of a floor, as of the body of a car, whose
        absolute motion laws such as `mixed_skyhook` read; by default they read that of the upper end of the device less
        that of its lower end.
    """

    _made_by: ClassVar[str] = "mr.Device(name=..., spec=..., theta=..., row=..., largest_command=...)"

    name: str
    spec: DamperSpec
    theta: ArrayLike
    row: ArrayLike
    largest_command: Annotated[float, May.BE_INFINITE] = 0.0
    count: Positive = 1.0
    differential: bool = False
    tested: OperatingRange | None = None
    lag: Positive | tuple[Positive, Positive] | None = None
    command: NotNegative | None = None
    rated_force: Positive | None = None
    rated_stroke: Positive | None = None
    rated_command: Positive | None = None
    sprung: ArrayLike | None = None

    def __post_init__(self) -> None:
        if not self.spec.follows_command:
            for name in ("lag", "command"):
                if getattr(self, name) is not None:
                    raise SettingError(f"{self.name}: a passive damper takes no command; leave `{name}` out")
            # Nothing follows it.
            object.__setattr__(self, "largest_command", self.largest_command or 1.0)
        elif self.lag is not None:
            # From then on the rates of the lag are among the parameters.
            theta = np.atleast_1d(np.array(self.theta, dtype=np.float64))
            theta = theta[..., : theta.shape[-1] - self.spec.n_rates]
            rates = np.broadcast_to(self.lag, (*theta.shape[:-1], np.size(self.lag)))
            lag: Lag = "two_rates" if isinstance(self.lag, tuple) else "one_rate"
            object.__setattr__(self, "spec", with_other_dependences(self.spec, lag=lag))
            object.__setattr__(self, "theta", np.concatenate([theta, rates], axis=-1))
            object.__setattr__(self, "lag", None)
        keep_arrays(self, "theta", "row", *(["sprung"] if self.sprung is not None else []))
        n_params = len(self.spec.parameters)
        if self.draws.ndim != 2 or self.draws.shape[1] != n_params:
            raise SettingError(
                f"{self.name}: `theta` has shape {np.shape(self.theta)}, {self.spec.name} takes ({n_params},) or "
                f"(n_draws, {n_params})"
            )
        if not self.largest_command > 0.0:
            raise SettingError(
                f"{self.name}: the largest command is {self.largest_command}; give a positive number"
            )
        if self.command is not None and self.command > self.largest_command:
            raise SettingError(
                f"{self.name}: it is to hold {self.command:g}, and its driver gives {self.largest_command:g} at most"
            )

    @property
    def is_actuator(self) -> bool:
        """Whether it is an ideal actuator, whose command is its force of either sign [N]."""
        return self.spec == _ACTUATOR

    @property
    def command_unit(self) -> str | None:
        """Unit of its command: A or V of dampers, N of actuators; `None` of what follows none."""
        return "N" if self.is_actuator else self.spec.command_unit

    @property
    def is_commanded(self) -> bool:
        """Whether a law commands the dampers: they follow a command, and hold none."""
        return self.spec.follows_command and self.command is None

    @property
    def draws(self) -> Floats:
        """Parameters of each draw, shape (n_draws, n_params); one draw where `theta` is one set."""
        return np.atleast_2d(np.asarray(self.theta, dtype=np.float64))

    @checked
    def outside(self, demand: OperatingRange) -> Outside:
        """Quantities of a demand outside the tested ranges and ratings; laws are at the median of the draws."""
        outside = outside_of(self.spec, np.median(self.draws, axis=0), self.tested, demand)
        rated = beyond_rating(
            demand, force=self.rated_force, stroke=self.rated_stroke, command=self.rated_command
        )
        return replace(outside, exceedances=(*rated, *outside.exceedances))

    def _summary(self) -> Summary:
        values = dict(zip(self.spec.names, np.median(self.draws, axis=0).tolist(), strict=True))
        columns = (
            Column("name", "parameter"),
            Column("name", "value", shown=lambda name: format_rounded(values[name])),
            Column("unit", "unit"),
        )
        return Summary(
            title=f"Device {self.name}: {self.spec.name}",
            facts=(
                ("dampers", f"{self.count:g}{', and as many in opposition' if self.differential else ''}"),
                ("command", f"{'force +-' if self.is_actuator else '0 to '}{self.largest_command:g}"),
                ("draws", str(len(self.draws))),
                ("tested", self.tested.in_words if self.tested else "not known"),
            ),
            tables=[Table.of(columns, self.spec.parameters)],
        )


@checked
def ideal_actuator(
    *, name: str, row: ArrayLike, largest_force: Annotated[float, Within(above=0.0), May.BE_INFINITE] = inf
) -> Device:
    """An actuator that exerts the force which a law commands, of either sign, and saturates at its largest force.

    The law `active` commands it, or a law in Python, whose commands are then forces. A positive force resists the
    lengthening row @ q, of shape (n,), as a row of `building.storeys`; `largest_force` is in N, to either side.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame = mr.building("uts")
    >>> mr.buildings.ideal_actuator(name="storey 1", row=frame.storeys[0], largest_force=2e3).command_unit
    'N'
    """
    return Device(name=name, spec=_ACTUATOR, theta=(0.0, 1.0), row=row, largest_command=largest_force)


def as_actuators(devices: Sequence[Device], most: float) -> tuple[Device, ...]:
    """The actuators among devices, and actuators in the places of the dampers, each with at most this force [N]."""
    forces = [device.largest_command if device.is_actuator else inf for device in devices]
    return tuple(
        ideal_actuator(name=device.name, row=device.row, largest_force=min(force, most))
        for device, force in zip(devices, forces, strict=True)
    )


def elongation_rows(building: Building, devices: Sequence[Device]) -> Floats:
    """Rows that give elongations of devices from coordinates, shape (n_devices, n); refused where one does not fit."""
    building.check()
    if not devices:
        raise SettingError(f"no device was given for {building.name}; give one or more")
    return _rows(building, devices, "row", "storeys")


def sprung_rows(building: Building, devices: Sequence[Device]) -> Floats:
    """Rows of the sprung masses of devices, shape (n_devices, n), zeros where one has none; refused as those above."""
    return _rows(building, devices, "sprung", "floors")


def _rows(building: Building, devices: Sequence[Device], name: str, of: str) -> Floats:
    rows = np.zeros((len(devices), building.n_coordinates))
    for row, device in zip(rows, devices, strict=True):
        given = getattr(device, name)
        if given is not None and (np.shape(given) != row.shape or not np.any(given)):
            raise SettingError(
                f"{device.name}: `{name}` has shape {np.shape(given)}; {building.name} takes {row.shape}, not all "
                f"zero: a row of `building.{of}`"
            )
        row[:] = 0.0 if given is None else given
    return rows
