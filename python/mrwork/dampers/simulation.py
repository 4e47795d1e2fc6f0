"""Simulation of dampers under a loading history by the Rust core: single runs, batches, misfits, sensitivities.

The core runs on the fastest vector instructions that build and machine have in common, see `instruction_set`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from functools import lru_cache
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.base.arguments import (
    AnyArrayLike,
    AnyNumbers,
    NotNegative,
    Samples,
    Shape,
    Threads,
    Whole,
    checked,
)
from mrwork.base.hints import InUnit, Says, Within
from mrwork.base.summary import Summarised, Summary
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass, keep_arrays
from mrwork.dampers.command import Command
from mrwork.dampers.dependence import Dependence
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SettingError, SimulationError


class Outcome(IntEnum):
    """How the simulation of one candidate ended."""

    FINISHED = 0
    DIVERGED = 1
    UNRESOLVED = 2
    ABANDONED = 3
    FAILED_SAFE = 4

    @property
    def remedy(self) -> str:
        """Advice to the user."""
        return {
            Outcome.FINISHED: "nothing",
            Outcome.DIVERGED: "the state left the finite numbers; move the parameters towards their nominal values, "
            "or lower the gains of the control law",
            Outcome.UNRESOLVED: "it is too stiff for the sampling step; resample the record more finely, "
            "or shorten the step of the loop",
            Outcome.ABANDONED: "it reached the limit it was given; raise the limit to know its misfit",
            Outcome.FAILED_SAFE: "its control law received a reading that is not a number, or its controller gave no "
            "command, so its command was invalid; check the sensor, or the controller",
        }[self]


@checked
@array_dataclass(repr=False)
class Loading(Summarised):
    """Imposed motion of a damper: displacement [m] and velocity [m/s], shape (n_time,), every `dt` [s].

    Both are interpolated by C2 cubic splines; without a velocity, the derivative of the displacement spline is used.
    The `command` is one number, or one per sample, held until the next; `command_unit` is
    amperes, volts or the unit of another scalar.
    """

    dt: float
    displacement: Samples
    velocity: Samples | None = None
    command: Samples | float | None = None
    command_unit: CommandUnit | None = None

    _units: ClassVar[Mapping[str, str]] = {"dt": "s", "displacement": "m", "velocity": "m/s"}

    def __post_init__(self) -> None:
        keep_arrays(self, "displacement", "velocity", "command")

    def history(self) -> _rust.LoadingHistory:
        """Spline representation of the history, as simulations use it."""
        displacement = np.ascontiguousarray(self.displacement, dtype=np.float64)
        velocity = None if self.velocity is None else np.ascontiguousarray(self.velocity, dtype=np.float64)
        command = None
        if self.command is not None:
            values = np.array(np.broadcast_to(np.asarray(self.command, dtype=np.float64), displacement.shape))
            sent = Command(values, self.command_unit or "A")
            if wrong := sent.impossibility:
                raise SettingError(f"`command` {wrong}")
            command = np.ascontiguousarray(sent.without_ringing().values)
        return _rust.LoadingHistory(self.dt, displacement, velocity, command)


StepFactor = Annotated[int, Within(least=1, most=64)]
"""How many times as many steps a simulation takes, a power of two; the core has no finer ones."""

# The longest stroke, in isolated buildings, is about 1 m.
Amplitude = Annotated[float, Within(least=1e-6, most=1.0), InUnit("m")]
# A slower test lasts for hours, and no rig runs a faster one.
Frequency = Annotated[float, Within(least=1e-4, most=1e3), InUnit("Hz")]
_OF_FIGURE = Says("of the motion of the figure")
LoopAmplitude = Annotated[Amplitude, _OF_FIGURE]
LoopFrequency = Annotated[Frequency, _OF_FIGURE]


@checked
def sinusoid(
    amplitude: float,
    velocity: float,
    *,
    cycles: int,
    per_cycle: int,
    command: float | None = None,
    command_unit: CommandUnit | None = None,
) -> Loading:
    """Whole cycles of a sinusoid of this amplitude [m] and peak velocity [m/s], from mid-stroke outward and back to it.

    It has `per_cycle` samples a cycle, and one more at its end.
    """
    phase = 2.0 * np.pi * np.arange(cycles * per_cycle + 1) / per_cycle
    return Loading(
        dt=2.0 * np.pi * amplitude / velocity / per_cycle,
        displacement=amplitude * np.sin(phase),
        velocity=velocity * np.cos(phase),
        command=command,
        command_unit=command_unit,
    )


@array_dataclass()
class Misfits:
    """Sums of squared residuals [N^2] of a batch, shape (n_batch,); infinite for candidates that did not finish.

    `steps` is the number of time steps simulated for each candidate.
    """

    squared_error: Floats
    outcome: NDArray[np.uint8]
    substeps: NDArray[np.uint32]
    steps: NDArray[np.uint64]


@array_dataclass()
class ForceHistories:
    """Forces [N] of a batch, shape (n_batch, n_time), and their derivatives with respect to columns of `theta`.

    `jacobian` has shape (n_batch, n_columns, n_time), in newtons per unit of each column, with no columns from
    `simulate_forces`. Force and derivatives of rows that did not finish are infinite; a row whose derivatives are not
    finite counts as diverged.
    """

    force: Floats
    jacobian: Floats
    outcome: NDArray[np.uint8]
    substeps: NDArray[np.uint32]


@checked
def stiffness_shares(spec: DamperSpec, theta: AnyArrayLike, history: _rust.LoadingHistory) -> Floats:
    """Stiffness of a batch, shape (n_batch,), as a share of the largest that is simulated at the step of this loading.

    A candidate above 1 ends as unresolved; so does one whose stiffness is not a number. Parameters as in
    `simulate_misfits`.
    """
    return _rust.stiffness_shares(spec.core_name, _rows(spec, theta), history, *_laws(spec))


@checked
def simulate_misfits(
    spec: DamperSpec,
    theta: AnyArrayLike,
    history: _rust.LoadingHistory,
    force: Annotated[AnyNumbers, Shape(("n_time",))],
    *,
    first: Whole = 0,
    threads: Threads = 0,
) -> Misfits:
    """Misfits of a batch of parameters in spec order, shape (n_batch, n_params), to a measured `force` [N], (n_time,).

    Samples before `first` are simulated and not compared.
    """
    squared_error, outcome, substeps, steps = _rust.misfits(
        spec.core_name, _rows(spec, theta), history, force, first, *_laws(spec), threads=threads
    )
    return Misfits(squared_error=squared_error, outcome=outcome, substeps=substeps, steps=steps)


@checked
def simulate_forces(
    spec: DamperSpec,
    theta: AnyArrayLike,
    history: _rust.LoadingHistory,
    *,
    substep_factor: StepFactor = 1,
    threads: Threads = 0,
) -> ForceHistories:
    """Simulate a batch and return its force histories; parameters as in `simulate_misfits`.

    `substep_factor`, a power of two up to 64, multiplies the number of sub-steps from the stiffness bound.
    """
    rows = _rows(spec, theta)
    force, outcome, substeps = _rust.force_histories(
        spec.core_name, rows, history, *_laws(spec), substep_factor, threads
    )
    none = np.empty((len(force), 0, history.n_time))
    return ForceHistories(force=force, jacobian=none, outcome=outcome, substeps=substeps)


@checked
def simulate_sensitivities(
    spec: DamperSpec,
    theta: AnyArrayLike,
    history: _rust.LoadingHistory,
    *,
    columns: Sequence[Whole] | None = None,
    threads: Threads = 0,
) -> ForceHistories:
    """Simulate a batch with the exact derivatives of its forces; other parameters as in `simulate_misfits`.

    The forces have the same bits as from `simulate_forces`. The derivatives are exact up to rounding for the discrete
    equations with the same sub-steps; at a kink the branch that the value takes is differentiated. They are with
    respect to `columns` of `theta`, counted from 0; all if `None`.

    Examples
    --------
    >>> import numpy as np, mrwork as mr
    >>> from mrwork.dampers.simulation import simulate_sensitivities
    >>> spec = mr.damper("bingham")
    >>> history = mr.Loading(dt=0.001, displacement=0.01 * np.sin(np.arange(0, 6, 0.001))).history()
    >>> simulate_sensitivities(spec, [spec.nominal], history, columns=[0, 2]).jacobian.shape
    (1, 2, 6000)
    """
    rows = _rows(spec, theta)
    wanted = None if columns is None else [int(column) for column in columns]
    force, jacobian, outcome, substeps = _rust.sensitivities(
        spec.core_name, rows, history, wanted, *_laws(spec), threads=threads
    )
    return ForceHistories(force=force, jacobian=jacobian, outcome=outcome, substeps=substeps)


@checked
def simulate_force(
    spec: DamperSpec, theta: ArrayLike, loading: Loading, *, substep_factor: StepFactor = 1
) -> Floats:
    """Simulate one damper and return its force [N], shape (n_time,).

    Its states begin at zero, and the current in its coil at the first command.

    Raises
    ------
    SimulationError
        If the simulation diverges or cannot be resolved.

    Examples
    --------
    >>> import numpy as np, mrwork as mr
    >>> spec = mr.damper("static_hysteretic")
    >>> time = np.arange(0, 1, 0.001)
    >>> force = mr.simulate_force(spec, spec.nominal, mr.Loading(dt=0.001, displacement=0.01 * np.sin(6.28 * time)))
    >>> force.shape
    (1000,)
    """
    refuse_other_unit(loading, spec)
    if np.ndim(theta) != 1:
        raise SettingError(
            f"`theta` has shape {np.shape(theta)}, one {spec.name} takes ({len(spec.parameters)},); "
            "simulate several with mr.simulate"
        )
    histories = simulate_forces(
        spec, np.reshape(theta, (1, -1)), loading.history(), substep_factor=substep_factor
    )
    refuse_failure(spec.name, histories.outcome[0])
    return np.asarray(histories.force[0])


@checked
def refuse_failure(what: str, outcome: int) -> None:
    """Refuse a simulation that did not finish."""
    ended = Outcome(outcome)
    if ended is not Outcome.FINISHED:
        raise SimulationError(f"{what} ended as {ended.name.lower()}: {ended.remedy}")


@checked
def refuse_other_unit(loading: Loading, spec: DamperSpec) -> None:
    """Refuse a loading without the command that the model follows."""
    if spec.command_unit is not None and loading.command_unit != spec.command_unit:
        raise SettingError(
            f"this {spec.name} takes its command in {spec.command_unit}, the loading's is in "
            f"{loading.command_unit or 'no stated unit'}; set `command` and `command_unit`"
        )


def _laws(spec: DamperSpec) -> tuple[list[str], int]:
    return [*_texts(spec.laws)], spec.n_rates


@lru_cache(maxsize=64)
def _texts(laws: tuple[Dependence, ...]) -> tuple[str, ...]:
    return tuple(map(str, laws))


def _rows(spec: DamperSpec, theta: ArrayLike) -> Floats:
    rows = np.ascontiguousarray(theta, dtype=np.float64)
    if rows.ndim != 2 or rows.shape[1] != len(spec.parameters):
        raise SettingError(
            f"`theta` has shape {rows.shape}, {spec.name} takes (n_batch, {len(spec.parameters)}); see `spec.names`"
        )
    return rows


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class InstructionSets(Summarised):
    """Vector instructions by name, as `"avx512"`, `"avx2"` or `"plain"`; results have the same bits with each.

    Simulations run on the set `used`; the compiled module has the sets `built`, and this processor the sets `machine`,
    fastest first.
    """

    used: str
    built: tuple[str, ...]
    machine: tuple[str, ...]

    @property
    def faster(self) -> tuple[str, ...]:
        """Those of this processor that are faster than the one used and that the build left out, fastest first."""
        sets = self.machine[: self.machine.index(self.used)]
        return tuple(name for name in sets if name not in self.built)

    def __str__(self) -> str:
        """The sets in use and built, and faster ones of the machine if there are any, in one line."""
        text = f"simulates with {self.used}; this build has {', '.join(self.built)}"
        if not self.faster:
            return text
        return f"{text}; this machine has {', '.join(self.faster)}, which is faster: build with MRWORK_BUILD_SETS=all"

    def _summary(self) -> Summary:
        return Summary(title="Instruction sets", notes=[str(self)])


def instruction_set() -> InstructionSets:
    """Tell with which vector instructions simulations run, and which this build and this machine have.

    Returns
    -------
    InstructionSets
        A wheel has every set of its architecture, a build from source the best one of its machine, or what
        `MRWORK_BUILD_SETS` asked for (`all`, or names as `avx2,plain`). `MRWORK_INSTRUCTION_SET` chooses among them.
    """
    built, machine = _rust.instruction_sets()
    return InstructionSets(used=_rust.instruction_set(), built=tuple(built), machine=tuple(machine))


@checked
def fma_peak(threads: Threads = 1, seconds: NotNegative = 0.04) -> float:
    """Measure the peak rate of this machine [1/s]: floating-point operations of independent fused multiply-adds.

    A fused multiply-add counts as two operations. With `flops_per_step` it tells what share of the machine a simulation
    uses.

    Parameters
    ----------
    threads
        Threads that compute at once, 0 for all; the rate is for all together.
    seconds
        Time of the measurement [s].

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.dampers.fma_peak(seconds=0.001) > 1e6
    True
    """
    return _rust.fma_peak(threads, seconds)


@checked
def flops_per_step(model: DamperSpec | str, theta: Annotated[AnyNumbers, Shape(("n_params",))]) -> int:
    """Count the floating-point operations of one Runge-Kutta step of a damper model and of its residual.

    Additions, multiplications and divisions are counted by running them; a fused multiply-add counts as two. A model
    without states has no step: then the operations of force and residual are counted.

    Parameters
    ----------
    model
        A model without current laws, or its name.
    theta
        Parameters in the order of `mr.damper(name).names`, shape (n_params,), in SI units.

    Raises
    ------
    SettingError
        Where the parameters do not fit the model, or it has current laws.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.dampers.flops_per_step("bingham", mr.damper("bingham").nominal) > 10
    True
    """
    spec = damper(model) if isinstance(model, str) else model
    if spec.command_unit is not None:
        raise SettingError(f"operations of {spec.name} are not counted; give a model without current laws")
    return _rust.flops_per_step(spec.core_name, np.ascontiguousarray(theta, dtype=np.float64))
