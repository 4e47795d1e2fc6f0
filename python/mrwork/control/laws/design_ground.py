"""Ground and damper forces of a design, taken from its problem, and the force that a gain asks for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.base.numbers import of_unit
from mrwork.base.summary import list_names
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device
from mrwork.control.laws.law_problem import DesignProblem
from mrwork.control.linear.riccati import LyapunovEquations, mean_squares
from mrwork.control.weights.limits import LimitedOutputs, sine_force
from mrwork.control.weights.system import DesignSystem, design_system
from mrwork.control.weights.weight_certificate import rms_under_gain
from mrwork.errors import SettingError
from mrwork.motions.spectral_density import SpectralDensity, SpectrumKind, StationaryGround, stationary_ground

PEAK_FACTOR = 3.0
"""Peak of a stationary response over its rms, about the largest of some hundred cycles."""
# Modes of a tall building from which its rms motion and force are computed.
_MODES = 20


def ground_of(
    problem: DesignProblem,
    kind: SpectrumKind = "kanai_tajimi",
    frequency: float | None = None,
    damping: float | None = None,
) -> StationaryGround:
    """The stationary ground of the motions of a problem, which keeps it."""
    return problem._keep(
        (kind, frequency, damping),
        lambda: stationary_ground(problem.motions, kind, frequency=frequency, damping=damping),
    )


def source_in_words(problem: DesignProblem) -> str:
    """Which motions the ground of a design is fitted to."""
    count = len(problem.motions)
    part, motions = ("part", "") if count == 1 else ("parts", f"{count} ")
    motions += f"{'' if problem.judged else 'training '}motion{'' if count == 1 else 's'}"
    judged = " on which the laws are judged, too, since none is for training" if problem.judged else ""
    return f"fitted to the strong {part} of the {motions}{judged}"


def shaken_system(problem: DesignProblem, spectrum: SpectralDensity) -> DesignSystem:
    """The building, of a tall one its lowest modes, with its devices under a ground, without limited outputs."""
    none = LimitedOutputs(names=(), units=(), settings=(), limits=np.empty(0))
    return design_system(problem.plant, none, spectrum, n_modes=_MODES)


@array_dataclass()
class DamperForces:
    """Forces of each device with all its dampers [N]: the largest at the largest command, and the rms at none.

    `over` says over which motion.
    """

    largest: Floats
    idle: Floats
    over: str

    @property
    def budgets(self) -> Floats:
        """Rms force of each device [N] whose peaks are the largest force."""
        return self.largest / PEAK_FACTOR


def damper_forces(problem: DesignProblem, spectrum: SpectralDensity) -> DamperForces:
    """Forces of the dampers over their tested range, the motion that is expected of them, or that under a ground.

    The motion is a sinusoid of the largest amplitude and velocity; where neither ranges nor expected motions are known,
    of three times the rms elongation and rate without control.
    """
    devices = tuple(problem.whole.devices)
    if any(device.tested is None for device in devices) and (
        problem.amplitude is None or problem.velocity is None
    ):
        system = shaken_system(problem, spectrum)
        X = LyapunovEquations(system.A).covariance(system.ground)
        elongations = problem.plant.attachment @ system.state[: problem.plant.n_coordinates]
        rms = [np.sqrt(mean_squares(rows, X)) for rows in (elongations, system.rates)]
    else:
        rms = [np.ones(len(devices)), np.ones(len(devices))]
    strokes = [
        _stroke(problem, *row) for row in zip(devices, *(value.tolist() for value in rms), strict=True)
    ]
    forces = [
        [sine_force(device, amplitude, velocity, command) for command in (device.largest_command, 0.0)]
        for device, (amplitude, velocity, _) in zip(devices, strokes, strict=True)
    ]
    return DamperForces(
        largest=np.array([np.abs(on).max() for on, _ in forces]),
        idle=np.array([np.sqrt(np.mean(np.square(off))) for _, off in forces]),
        over=list_names(tuple(dict.fromkeys(origin for _, _, origin in strokes))),
    )


def _stroke(
    problem: DesignProblem, device: Device, elongation: float, rate: float
) -> tuple[float, float, str]:
    """Amplitude [m] and peak velocity [m/s] of a sinusoid, and their origin in words."""
    tested = device.tested
    if tested is not None and min(tested.stroke, tested.velocity) > 0.0:
        return tested.stroke, tested.velocity, "over its tested range"
    if problem.amplitude is not None and problem.velocity is not None:
        return problem.amplitude[1], problem.velocity[1], "over the expected motion"
    amplitude, velocity = max(PEAK_FACTOR * elongation, 1e-9), max(PEAK_FACTOR * rate, 1e-9)
    return amplitude, velocity, f"at {PEAK_FACTOR:g} times the rms stroke without control"


def forces_in_words(devices: Sequence[Device], forces: DamperForces) -> str:
    """The largest force of each device, with its command and motion."""
    parts = []
    for device, largest in zip(devices, forces.largest, strict=True):
        unit = device.spec.command_unit
        command = "" if unit is None else f" at {device.largest_command:.3g} {unit}"
        parts.append(f"{of_unit(float(largest), 'N')}, the largest force of {device.name}{command}")
    return f"{list_names(tuple(parts))} {forces.over}"


# Rms desired force over the rms damper force at i = 0, and over the largest damper force, below which a law is idle.
_IDLE, _IDLE_OF_LARGEST = 0.05, 0.003


@array_dataclass()
class AskedForce:
    """Rms force that a gain asks for [N], with ideal forces under the ground of a problem, beside damper forces.

    `idle` are the rms forces of the dampers at i = 0 and `budgets` the rms forces whose peaks are the largest forces of
    the dampers; all of shape (n_devices,).
    """

    devices: tuple[str, ...]
    wanted: Floats
    idle: Floats
    budgets: Floats

    @property
    def asks_for_none(self) -> bool:
        """Whether the dampers resist with much more than the law asks for, also without a command."""
        return bool(np.all(self.wanted < np.maximum(_IDLE * self.idle, _IDLE_OF_LARGEST * self.budgets)))

    @property
    def share(self) -> float:
        """Desired force over that from which a law acts: the force of the dampers at i = 0, or a tenth of the most."""
        return float(np.min(self.wanted / np.maximum(self.idle, 0.1 * self.budgets)))

    @property
    def in_words(self) -> str:
        """The rms desired force of each device, and what its dampers give."""
        return list_names(
            tuple(
                f"{wanted:.3g} N rms of {name}, which resists with {idle:.3g} N rms at i = 0 and can give "
                f"{budget:.3g} N"
                for name, wanted, idle, budget in zip(
                    self.devices, self.wanted, self.idle, self.budgets, strict=True
                )
            )
        )


def asked_forces(problem: DesignProblem, gains: Sequence[Floats]) -> list[AskedForce | None]:
    """The force that each gain asks for; `None` where the ground is not known or the loop is not stable."""
    try:
        spectrum = ground_of(problem).spectrum
        forces, system = damper_forces(problem, spectrum), shaken_system(problem, spectrum)
    except SettingError:
        return [None] * len(gains)
    names, wanted = (
        problem.plant.device_names,
        [rms_under_gain(system, gain @ system.state)[1] for gain in gains],
    )
    return [
        AskedForce(devices=names, wanted=rms, idle=forces.idle, budgets=forces.budgets)
        if np.isfinite(rms).all()
        else None
        for rms in wanted
    ]
