"""Control laws as the Rust core declares them, and a law with its gains and its model of the loop."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from operator import itemgetter
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from mrwork import _rust
from mrwork.base.arguments import May, NotNegative, checked
from mrwork.base.hints import Within
from mrwork.base.keys import check_known, look_up
from mrwork.base.numbers import format_rounded, of_unit
from mrwork.base.remark import Remark
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device
from mrwork.buildings.groups import commanded, sends_forces, sends_shares
from mrwork.buildings.plane_building import Building
from mrwork.control.laws.own_formula import OwnFormula
from mrwork.control.linear.margins import LoopMargins
from mrwork.control.weights.weight_certificate import DesignedWeights
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion

Shape = Literal["device", "state", "numbers", "loop"]
StateOf = Literal["relative", "absolute"]
"""Whether the velocities of the state that gains multiply are those relative to the ground, q', or q' + r v_g."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GainSpec:
    """A gain of a law: for each device one number, one for each state [q; q'] or `numbers`, or `numbers` for the loop.

    A gain that `is_command` is itself the command of each device; a gain that `scales_with_command` has the unit of the
    command, or that unit per another.
    """

    name: str
    unit: str
    is_command: bool
    scales_with_command: bool
    shape: Shape
    numbers: int
    description: str

    def shape_for(self, n_devices: int, n_states: int) -> tuple[int, ...]:
        """Shape of the gain of one candidate."""
        if self.shape == "loop":
            return (self.numbers,)
        if self.shape == "device":
            return (n_devices,)
        return (n_devices, n_states if self.shape == "state" else self.numbers)


@dataclass(frozen=True, slots=True, kw_only=True)
class ControlLawSpec:
    """A law: its formula, source, gains and tables.

    `tables` are arrays that all candidates share. A law that `needs_curve` evaluates the damper force as a function of
    the command, by a static hysteretic model of the damper. A law that `needs_model` predicts the motion by a model of
    building and dampers. A law that `commands_force` drives ideal actuators, a law that `reads_acceleration` needs
    accelerometers on the floors to which devices are attached, a law that `reads_sprung` the absolute motion of the
    sprung mass of a device, where it has one. The command of a law that `switches` jumps where a
    signal changes sign, so that results have no derivatives in its gains. A law of the user has a formula of its `own`.
    """

    name: str
    title: str
    equation: str
    description: str
    source: str
    gains: tuple[GainSpec, ...]
    tables: tuple[str, ...]
    needs_curve: bool
    needs_model: bool
    commands_force: bool
    reads_acceleration: bool
    reads_sprung: bool
    switches: bool
    own: OwnFormula | None = None

    @property
    def sends_share(self) -> bool:
        """Whether the command scales with the largest command."""
        if self.own is not None:
            return False
        absolute = any(gain.scales_with_command for gain in self.gains)
        return not (absolute or self.tables or self.needs_curve or self.needs_model or self.commands_force)

    @property
    def reads_state(self) -> bool:
        """Whether it has a gain of the state."""
        return any(gain.shape == "state" for gain in self.gains)

    @property
    def takes_both_units(self) -> bool:
        """Whether it commands dampers in A beside others in V: by shares, by a command for each, or forces."""
        by_device = (
            self.own is not None
            or self.needs_model
            or (bool(self.gains) and all(gain.is_command for gain in self.gains))
        )
        return self.sends_share or self.commands_force or by_device


def refuse_units(spec: ControlLawSpec, devices: Sequence[Device]) -> None:
    """Refuse devices of both units where the law sends a command of one unit, and actuators where it sends no force."""
    if sends_forces(devices) and not spec.commands_force and spec.own is None:
        raise SettingError(
            f"{spec.name} sends currents or voltages to dampers, and the command of {commanded(devices)[0].name} is a "
            "force; give the law active, or a law in Python"
        )
    if sends_shares(devices) and not spec.takes_both_units:
        by_unit = {device.command_unit: device.name for device in devices if device.is_commanded}
        words = (f"{name} follows one in {unit}" for unit, name in by_unit.items())
        raise SettingError(
            f"{spec.name} sends one command to all dampers, and {' and '.join(words)}; choose a law whose command "
            "is a share of the largest, as clipped_optimal, or give dampers of one unit"
        )


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LoopModel(Summarised):
    """A building with its devices as a law believes them to be; of draws of a damper it has the first.

    What yields or slips in it and P-delta are predicted too.
    """

    _made_by: ClassVar[str] = "mr.control.design_law('predictive_rollout', problem)"

    building: Building
    devices: Sequence[Device]

    def __post_init__(self) -> None:
        if not self.devices:
            raise SettingError("the model of a loop has no device; give one")


@checked
@array_dataclass(repr=False)
class ControlLaw(Summarised):
    """A law with its gains, for one or several candidates.

    Parameters
    ----------
    name
        Name of the law; see `control_laws`.
    gains
        By name, shape (n_devices,) or (n_devices, 2n), with an optional leading axis for candidates.
    tables
        By name, shape (n,).
    curve
        Model of the damper in the law: static hysteretic with current laws, and its parameters.
    notes
        Sentences on the law that a user should read.
    weights
        The designed weights of its gain, if it has any.
    margins
        Stability margins of its linear loop, if it has one.
    remarks
        On the linear loop of its gain: a sign or an order of the columns that fits better, an unstable loop.
    dead_zone
        Damper velocity below which the command is zero [m/s], by the velocity that the law receives. Near rest a damper
        dissipates next to nothing, and the sign of its velocity, on which laws switch, is random.
    command_slope
        Largest change of the command per time [A/s or V/s, N/s of forces], from sample to sample, after the dead zone.
    largest_force
        Force at which every actuator saturates, of a law that commands forces [N].
    model
        Building and dampers by which the law predicts the motion; they may differ from the simulated ones.
    state
        Velocities of the state [q; q'] of a gain: relative to the ground, or absolute ones, q' + r v_g. By default they
        are relative under earthquakes and forces, and absolute on roads, of which not the acceleration but the velocity
        is near white: only of this state do the next ones depend on nothing before.

    Raises
    ------
    UnknownNameError
        If there is no such law.
    SettingError
        If a gain or table is unknown or missing, is not an array of numbers or has NaN, the law has no `curve` or
        `model` and needs one, or the gains differ in their number of candidates.
    """

    _made_by: ClassVar[str] = "mr.control.design_law(name, problem)"

    name: str
    # The gain of a design without a solution is infinite.
    gains: Mapping[str, Annotated[ArrayLike, May.BE_INFINITE]] = field(default_factory=dict)
    tables: Mapping[str, ArrayLike] = field(default_factory=dict)
    curve: tuple[DamperSpec, ArrayLike] | None = None
    dead_zone: NotNegative = 0.0
    command_slope: Annotated[float, Within(above=0.0), May.BE_INFINITE] = math.inf
    largest_force: Annotated[float, Within(above=0.0), May.BE_INFINITE] = math.inf
    model: LoopModel | None = None
    state: StateOf | None = None
    notes: tuple[str, ...] = ()
    weights: DesignedWeights | None = None
    margins: LoopMargins | None = None
    remarks: tuple[Remark, ...] = ()

    def __post_init__(self) -> None:
        spec = self.spec
        _check_names(spec, "gain", self.gains, [gain.name for gain in spec.gains])
        _check_names(spec, "table", self.tables, spec.tables)
        counts = [count for gain in spec.gains if (count := self._candidates(gain)) > 1]
        if len(set(counts)) > 1:
            raise SettingError(
                f"the gains of {spec.name} have {', '.join(map(str, counts))} candidates; give the same number for "
                "each gain, or one"
            )
        if self.curve is not None and not spec.needs_curve:
            raise SettingError(f"{spec.name} does not use the force of the damper; leave `curve` out")
        if spec.needs_curve and self.curve is None:
            raise SettingError(
                f"{spec.name} needs the force as a function of the command; give it a `curve`: a static_hysteretic "
                "with current laws, of the damper itself or of its static counterpart"
            )
        if math.isfinite(self.largest_force) and not spec.commands_force:
            raise SettingError(f"{spec.name} commands no forces; leave `largest_force` out")
        if self.state is not None and not spec.reads_state:
            raise SettingError(f"{spec.name} has no gain of the state; leave `state` out")
        if self.model is not None and not spec.needs_model:
            raise SettingError(f"{spec.name} does not predict the motion; leave `model` out")
        if spec.needs_model and self.model is None:
            raise SettingError(
                f"{spec.name} predicts the motion by its own model of the loop; give it a `model`, a building with its "
                "devices"
            )

    @property
    def spec(self) -> ControlLawSpec:
        """What the registry declares of the law: its equation and source, gains and tables."""
        return control_law(self.name)

    @property
    def forecasts_ground(self) -> bool:
        """Whether it forecasts the ground acceleration, of an order above zero."""
        return self.spec.needs_model and float(np.ravel(self.tables["forecast"])[0]) > 0.0

    @property
    def reads_acceleration(self) -> bool:
        """Whether it reads absolute accelerations of floors: a prediction does of storeys that yield, or by setting."""
        if self.spec.reads_acceleration or self.model is None:
            return self.spec.reads_acceleration
        return bool(self.model.building.elements) or bool(np.any(np.ravel(self.tables["shears"])[:2]))

    @checked
    def reads_absolute(self, motion: GroundMotion) -> bool:
        """Whether the velocities of its state are absolute under a motion."""
        return motion.is_road if self.state is None else self.state == "absolute"

    @property
    def shaping(self) -> tuple[float, float] | None:
        """Dead zone and slope of the command; `None` where it is sent as it is."""
        plain = self.dead_zone == 0.0 and math.isinf(self.command_slope)
        return None if plain else (float(self.dead_zone), float(self.command_slope))

    @property
    def shaping_notes(self) -> tuple[str, ...]:
        """Sentences on dead zone and slope of the command; none where it is sent as it is."""
        notes = []
        if self.dead_zone > 0.0:
            notes.append(f"The command is zero below a damper velocity of {of_unit(self.dead_zone, 'm/s')}.")
        if math.isfinite(self.command_slope):
            slope = format_rounded(self.command_slope)
            unit = "N" if self.spec.commands_force else "A or V"
            notes.append(f"The command changes by at most {slope} {unit} per second.")
        return tuple(notes)

    @checked
    def gain_rows(self, n_devices: int, n_states: int) -> Floats:
        """The gains as rows, shape (n_candidates, n_gains).

        Raises
        ------
        SettingError
            If a gain is of the wrong shape.
        """
        spec = self.spec
        blocks = []
        for gain in spec.gains:
            shape = gain.shape_for(n_devices, n_states)
            values = np.asarray(self.gains[gain.name], dtype=np.float64)
            if values.shape[-len(shape) :] != shape or values.ndim > len(shape) + 1:
                raise SettingError(
                    f"`{gain.name}` of {spec.name} has shape {values.shape}; give {shape}, "
                    f"or a row of that shape for each candidate"
                )
            blocks.append(values.reshape(-1, int(np.prod(shape))))
        n_candidates = max((len(block) for block in blocks), default=1)
        wide = [np.broadcast_to(block, (n_candidates, block.shape[1])) for block in blocks]
        return np.ascontiguousarray(np.hstack(wide)) if wide else np.zeros((1, 0))

    def table_rows(self) -> list[Floats]:
        """The tables, each flattened, in the order of `spec.tables`."""
        return [np.array(self.tables[name], dtype=np.float64).ravel() for name in self.spec.tables]

    def _candidates(self, gain: GainSpec) -> int:
        """Number of candidates of a gain; 1 if it is the same for all."""
        values = self.gains[gain.name]
        return np.shape(values)[0] if np.ndim(values) > len(gain.shape_for(1, 2)) else 1

    def _summary(self) -> Summary:
        columns = (
            Column("", "number", of=itemgetter(0)),
            Column("", "shape", of=lambda item: str(np.shape(item[1]))),
            Column("", "largest", of=lambda item: float(np.abs(item[1]).max()), shown=format_rounded),
        )
        return Summary(
            title=f"Control law {self.spec.title}",
            facts=(("equation", self.spec.equation), ("source", self.spec.source)),
            tables=[Table.of(columns, (*self.gains.items(), *self.tables.items()))],
            notes=(
                *(() if self.weights is None else self.weights.in_words),
                *self.notes,
                *self.shaping_notes,
            ),
            remarks=self.remarks,
        )


@cache
def control_laws() -> tuple[ControlLawSpec, ...]:
    """Every control law, in the order of the registry."""
    return tuple(
        ControlLawSpec(
            **entry
            | {"tables": tuple(entry["tables"]), "gains": tuple(GainSpec(**gain) for gain in entry["gains"])}
        )
        for entry in _rust.control_laws()
    )


@checked
def control_law(name: str) -> ControlLawSpec:
    """The law of that name.

    Raises
    ------
    UnknownNameError
        If there is none.
    """
    specs = {spec.name: spec for spec in control_laws()} | _OWN_LAWS
    return look_up(name, specs, f"no control law is called {name!r}")


# Laws of the user by name, which has a digest of their text.
_OWN_LAWS: dict[str, ControlLawSpec] = {}


def add_own_law(spec: ControlLawSpec) -> None:
    """Let `control_law` find a law of the user."""
    _OWN_LAWS[spec.name] = spec


def _check_names(
    spec: ControlLawSpec, kind: str, names: Mapping[str, ArrayLike], expected: Sequence[str]
) -> None:
    for name in names:
        sentence = f"{spec.name} has no {kind} {name!r}"
        check_known(name, expected, sentence, otherwise="it has", kind=SettingError)
    for name in expected:
        if name not in names:
            raise SettingError(f"{spec.name} lacks the {kind} {name!r}; give {', '.join(expected)}")
