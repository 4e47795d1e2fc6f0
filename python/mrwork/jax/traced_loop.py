"""The closed loop as a function of JAX: numbers of the law, parameters, matrices, ground and commands are operands."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mrwork import _rust
from mrwork.base.arguments import checked
from mrwork.base.hints import Within
from mrwork.base.recording import NotRecordedError
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.buildings.device import Device
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.laws_of_users import loop_shape
from mrwork.closed_loop.recorded_law import record_law
from mrwork.closed_loop.simulate import simulate_loop
from mrwork.control.laws.control_law import ControlLaw
from mrwork.control.laws.own_formula import OwnFormula
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.twins.loop_ground import at_samples, stage_values
from mrwork.twins.loop_laws import LAWS, Gains, Measurement
from mrwork.twins.loop_twin import (
    MATRICES,
    STRETCH,
    Devices,
    LoopDevice,
    LoopPlant,
    LoopResult,
    LoopRun,
    believed_devices,
    simulate_run,
    with_theta,
)
from mrwork.twins.model_twins import on_processor
from mrwork.twins.tape_twin import TapeLaw

_PRESCRIBED = ""
# What a step of a sample may be multiplied by, as the core does.
_MOST_STEPS = 10_000


class LoopInputs(NamedTuple):
    """Inputs by which a loop is differentiable, a pytree: change it by `_replace`, and give it to the loop.

    `gains` are the numbers of the law by name, `theta` the parameters of each device, (n_params,), `mass` [kg],
    `damping` [N s/m] and `stiffness` [N/m] the matrices of the building, (n, n), `acceleration` the ground acceleration
    at the samples of the motion, (n_time,) [m/s^2], and `commands` a table of commands, (n_samples, n_devices) [A or
    V].
    """

    gains: dict[str, Any]
    theta: tuple[Any, ...]
    mass: Any
    damping: Any
    stiffness: Any
    acceleration: Any
    commands: Any = None


class LoopOutputs(NamedTuple):
    """Results of a loop, a pytree of arrays with the names, shapes and units of `mr.simulate_loop`.

    `numbers` are quantities of the run, as "peak_drift", (n_storeys,) [m]; `history` has the signals at the control
    samples and at the end, as "drift", (n_samples + 1, n_storeys) [m].
    """

    numbers: dict[str, Array]
    history: dict[str, Array]


# JAX keeps functions by weak references, and ends the process where an object allows none.
@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False, weakref_slot=True)
class Loop(Summarised):
    """A controlled building as a function of `LoopInputs` for JAX, see `mr.jax.loop`.

    Attributes
    ----------
    inputs
        Inputs made from the building, the devices, the law and the motion.
    steps
        Integration steps of a control sample.
    time
        Time of the history [s], shape (n_samples + 1,).
    """

    _made_by: ClassVar[str] = "mr.jax.loop(building, devices, law, motion)"

    inputs: LoopInputs
    steps: int
    time: Floats
    law: str
    own: TapeLaw | None
    memory: Floats
    carried: Floats
    dt: float
    hardware: Hardware
    matrices: dict[str, Floats]
    devices: Devices
    believed: Devices | None
    largest: Floats
    shaping: tuple[float, float]

    def __call__(self, inputs: LoopInputs | None = None, *, histories: bool = True) -> LoopOutputs:
        """The results for inputs, by default its own; without `histories` the history is empty."""
        inputs, hardware, steps = self.inputs if inputs is None else inputs, self.hardware, self.steps
        n_samples = len(self.time) - 1
        n_kept = 1 << (max(n_samples, STRETCH) - 1).bit_length()
        delay = hardware.delay_steps * (steps // hardware.steps)
        with on_processor():
            ground = stage_values(
                inputs.acceleration, self.dt, hardware.sample_time / steps, n_samples * steps
            )
            sensed = at_samples(
                inputs.acceleration,
                self.dt,
                hardware.sample_time,
                hardware.sample_time / hardware.steps,
                n_samples,
            )
            commands = inputs.commands
            if commands is not None:
                sent = jnp.asarray(commands)[:n_samples]
                commands = jnp.pad(sent, ((0, n_kept - len(sent)), (0, 0)), mode="edge")
            result = _simulate(
                inputs._replace(
                    acceleration=jnp.pad(ground.ravel(), (0, 3 * steps * (n_kept - n_samples))),
                    commands=commands,
                ),
                {name: self.matrices[name] for name in MATRICES[3:]},
                self.devices,
                self.believed,
                self.largest,
                self.shaping,
                hardware.sample_time,
                n_samples,
                self.memory,
                jnp.pad(sensed, ((0, n_kept - n_samples), (0, 0))),
                self.carried,
                law=self.law if self.own is None else self.own,
                steps=steps,
                n_kept=n_kept,
                delay=delay,
                histories=histories,
            )
            return LoopOutputs(result.numbers, self._history(result, n_samples) if histories else {})

    def _history(self, result: LoopResult, n_samples: int) -> dict[str, Array]:
        """Signals by name, from the rows in the order of the core."""
        n, widths = len(self.inputs.mass), Counter(run=1, device=len(self.devices))
        widths.update(state=2 * n, floor=len(self.matrices["floors"]), storey=len(self.matrices["storeys"]))
        signals = [(name, axis) for name, axis, *_ in _rust.history_signals()]
        rows = jnp.concatenate([result.rows[:n_samples], result.end[None]])
        parts = jnp.split(rows, np.cumsum([widths[axis] for _, axis in signals])[:-1], axis=1)
        return {name: part for (name, axis), part in zip(signals, parts, strict=True) if widths[axis]}

    def _summary(self) -> Summary:
        inputs = self.inputs._asdict() | {f"gains {name}": gain for name, gain in self.inputs.gains.items()}
        inputs |= {f"theta {number}": row for number, row in enumerate(self.inputs.theta)}
        shapes = {name: np.shape(array) for name, array in inputs.items() if name not in ("gains", "theta")}
        rows = [(name, str(shape)) for name, shape in shapes.items() if inputs[name] is not None]
        return Summary(
            title=f"Closed loop for JAX, {self.law or 'prescribed commands'}",
            facts=(
                ("samples", f"{len(self.time) - 1} of {self.hardware.sample_time:g} s"),
                ("steps of a sample", str(self.steps)),
            ),
            tables=[Table(columns=("input", "shape"), rows=rows)],
        )


@partial(jax.jit, static_argnames=("law", "steps", "n_kept", "delay", "histories"))
def _simulate(
    inputs: LoopInputs,
    matrices: dict[str, Array],
    devices: Devices,
    believed: Devices | None,
    largest: Array,
    shaping: tuple[float, float],
    sample_time: float,
    n_samples: int,
    memory: Array,
    sensed: Array,
    carried: Array,
    *,
    law: str | TapeLaw,
    steps: int,
    n_kept: int,
    delay: int,
    histories: bool,
) -> LoopResult:
    """Simulate with the ground of all steps, and padded commands, in place of the inputs of these names.

    `carried`, (2n,), is the state that laws of the registry read per velocity of the ground.
    """
    plant = {"mass": inputs.mass, "damping": inputs.damping, "stiffness": inputs.stiffness}
    run = LoopRun(
        plant=LoopPlant.of(plant | matrices),
        devices=with_theta(devices, inputs.theta),
        believed=believed,
        law=partial(_of_registry, LAWS[law], inputs.gains, carried)
        if isinstance(law, str)
        else partial(law, inputs.gains),
        memory=memory,
        largest=largest,
        dead_zone=shaping[0],
        furthest=shaping[1],
        delay=delay,
        sample_time=sample_time,
        ground=inputs.acceleration,
        sensed=sensed,
    )
    depth = 1 + -(-delay // steps)
    return simulate_run(
        run, n_samples, steps, n_kept=n_kept, depth=depth, prescribed=inputs.commands, histories=histories
    )


def _of_registry(
    law: Callable[[Gains, Measurement], Array],
    gains: Gains,
    carried: Array,
    measured: Measurement,
    memory: Array,
) -> tuple[Array, Array]:
    state = measured.state + carried * measured.ground_velocity
    return law(gains, replace(measured, state=state)), memory


@checked
def loop(
    building: Building,
    devices: Sequence[Device],
    law: ControlLaw | Floats,
    motion: GroundMotion,
    hardware: Hardware | None = None,
    *,
    steps: Annotated[int, Within(least=1, most=_MOST_STEPS)] | None = None,
) -> Loop:
    """The closed loop of a building with dampers as a function for JAX, by the equations of `mr.simulate_loop`.

    It has derivatives, forward and in reverse, in everything of `LoopInputs`, goes into `jax.jit` and `jax.vmap`, and
    its results agree with the core to rounding. In reverse mode the states of every 128th control sample are kept. One
    compilation serves all motions of about one length. Commands of laws that switch jump with their numbers, so that
    derivatives in these say nothing.

    Parameters
    ----------
    building
        Without passive elements, yield and P-delta; with coordinates and storeys of any kind.
    devices
        Dampers of the package or of the user, each of a model of its own. Of draws the first counts.
    law
        A law with one candidate: passive, clipped_optimal, modified_clipped_optimal, lyapunov, proportional_direct or
        signal_network; a law of the user, see `mrwork.own_law`, whose settings are its numbers; or commands at the
        control samples, shape (n_samples, n_devices) [A or V], of which the last is held until the end.
    motion
        Its acceleration is an input; its step is not.
    hardware
        Sample time, delay and limit of the rate; with an ideal feedback of the state.
    steps
        Integration steps of a control sample, a multiple of the steps of the hardware; by default as many as
        `mr.simulate_loop` takes.

    Returns
    -------
    Loop
        A function of `LoopInputs` that returns `LoopOutputs`; its attribute `inputs` has the values of these arguments.

    Raises
    ------
    SettingError
        If the loop in JAX does not have the law, or something of the building or the hardware.

    Examples
    --------
    >>> import jax
    >>> import mrwork as mr
    >>> frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
    >>> damper = mr.Device(
    ...     name="storey 1", spec=rd1005.spec, theta=rd1005.theta, row=frame.storeys[0], largest_command=1.88
    ... )
    >>> half = mr.ControlLaw(name="passive", gains={"command": [0.94]})
    >>> loop = mr.jax.loop(frame, [damper], half, mr.synthetic_motion(duration=2.0))
    >>> def rms_drift(inputs):
    ...     return loop(inputs, histories=False).numbers["rms_drift"][0]
    >>> value, slope = jax.value_and_grad(rms_drift)(loop.inputs)
    >>> slope.gains["command"].shape, slope.theta[0].shape, slope.stiffness.shape
    ((1,), (13,), (5, 5))
    """
    hardware = Hardware() if hardware is None else hardware
    name = law.name if isinstance(law, ControlLaw) else _PRESCRIBED
    formula = law.spec.own if isinstance(law, ControlLaw) else None
    if not devices:
        raise SettingError("the loop in JAX has at least one device; give one")
    if held := [device.name for device in devices if device.command is not None]:
        raise SettingError(
            f"the loop in JAX sends its own commands to {list_names(held)}; leave out the `command` of the device, and "
            "give a table of commands for all"
        )
    if lacking := _lacking(building, hardware, "" if formula else name, motion):
        raise SettingError(
            f"the loop in JAX cannot have {', or '.join(lacking)}; simulate it by mr.simulate_loop"
        )
    n_samples = max(int(motion.duration / hardware.sample_time * (1.0 + 1e-12)), 1)
    largest = np.array([device.largest_command for device in devices])
    loop_devices = tuple(LoopDevice.of(device) for device in devices)
    gains, believed, shaping, commands = {}, None, (0.0, np.inf), None
    own, memory, carried = None, np.zeros(0), np.zeros(2 * building.n_coordinates)
    if isinstance(law, ControlLaw):
        if law.reads_absolute(motion):
            carried[building.n_coordinates :] = building.influence
        widths = len(devices), 2 * building.n_coordinates
        if len(law.gain_rows(*widths)) != 1:
            raise SettingError(f"the gains of {name} are of several candidates; give gains of one")
        gains = {
            gain.name: np.asarray(law.gains[gain.name], dtype=float).reshape(gain.shape_for(*widths))
            for gain in law.spec.gains
        }
        believed = believed_devices(loop_devices, law.curve)
        shaping = law.shaping or shaping
        if formula is not None:
            own, memory = _on_tape(formula, law, building, devices, hardware)
    else:
        commands = law
        if law.ndim != 2 or not len(law) or law.shape[1] != len(devices):
            raise SettingError(
                f"`law` has shape {law.shape}; give commands (n_samples, {len(devices)}), or a law"
            )
    if steps is None:
        steps = _steps_of(building, devices, law, motion, hardware)
    if steps % hardware.steps:
        raise SettingError(
            f"`steps` is {steps}; give a multiple of {hardware.steps}, the steps of the hardware"
        )
    matrices = {name: np.asarray(getattr(building, name), dtype=np.float64) for name in MATRICES}
    return Loop(
        inputs=LoopInputs(
            gains=gains,
            theta=tuple(device.theta for device in loop_devices),
            **{name: matrices[name] for name in MATRICES[:3]},
            acceleration=np.asarray(motion.acceleration, dtype=np.float64),
            commands=commands,
        ),
        steps=steps,
        time=hardware.sample_time * np.arange(n_samples + 1, dtype=np.float64),
        law=name,
        own=own,
        memory=memory,
        carried=carried,
        dt=motion.dt,
        hardware=hardware,
        matrices=matrices,
        devices=loop_devices,
        believed=believed,
        largest=largest,
        shaping=(shaping[0], min(shaping[1], hardware.command_rate) * hardware.sample_time),
    )


def _on_tape(
    formula: OwnFormula, law: ControlLaw, building: Building, devices: Sequence[Device], hardware: Hardware
) -> tuple[TapeLaw, Floats]:
    """A law of the user, and its memory at the start."""
    settings = law.gain_rows(len(devices), 2 * building.n_coordinates)
    try:
        recorded, _ = record_law(formula, loop_shape(building, devices, hardware), settings)
    except NotRecordedError as reason:
        raise SettingError(
            f"{formula.name} cannot be recorded, as the loop in JAX needs it: {reason}"
        ) from None
    return (
        TapeLaw(
            tape=recorded.tape,
            inputs=tuple((name, place) for name, place, _ in recorded.inputs),
            settings=tuple(gain.name for gain in law.spec.gains),
            storeys=tuple(hardware.measured_storeys),
        ),
        np.array(recorded.start),
    )


def _lacking(building: Building, hardware: Hardware, law: str, motion: GroundMotion) -> list[str]:
    """What the loop in JAX does not have, in words."""
    noisy = any(noise or resolution for noise, resolution in hardware.sensors)
    return [
        name
        for name, wanted in (
            (f"the law {law}", law not in (_PRESCRIBED, *LAWS)),
            ("passive elements, yield or P-delta", bool(building.elements or building.nonlinear)),
            ("an observer", hardware.feedback != "state"),
            ("sensors with noise or a resolution", noisy),
            ("faults", bool(hardware.faults)),
            ("forces on floors", bool(motion.forces.size)),
        )
        if wanted
    ]


def _steps_of(
    building: Building,
    devices: Sequence[Device],
    law: ControlLaw | Floats,
    motion: GroundMotion,
    hardware: Hardware,
) -> int:
    """Integration steps of a sample that `simulate_loop` takes; for a table, with its mean commands."""
    if not isinstance(law, ControlLaw):
        law = ControlLaw(name="passive", gains={"command": law.mean(axis=0)})
    run = simulate_loop(
        building, [replace(device, theta=device.draws[0]) for device in devices], law, [motion], hardware
    )
    if not run.steps[0]:
        raise SettingError(
            "the loop is too stiff for its step; give a shorter `step` of the hardware, or `steps`"
        )
    return int(run.steps[0])
