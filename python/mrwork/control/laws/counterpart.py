"""Static hysteretic model of a damper, for laws that need its force as a function of the command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import Positive
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.dampers.simulation import Loading, simulate_force, sinusoid
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SettingError

# Model of a counterpart, and the published set whose current laws it has. The name is compared because the laws of the
# core are written for the equation of this model; other static models have other equations.
_COUNTERPART_MODEL = "static_hysteretic"
_COUNTERPART_SET = "kwok2006"

_N_COMMANDS = 7
_N_MOTIONS = 3  # number of amplitudes, and of peak velocities at each
_PER_CYCLE = 160
# The first cycle starts from rest; the second is used.
_CYCLES = 2


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StaticCounterpart(Summarised):
    """A static hysteretic model with current laws, its parameters, and its agreement with the damper.

    `fit_percent` is 100 (1 - |F - F^| / |F - mean F|) over the cycles of the fit; 100 for a damper that is
    static hysteretic itself.
    """

    _units: ClassVar[Mapping[str, str]] = {"fit_percent": "%"}

    spec: DamperSpec
    theta: tuple[float, ...]
    fit_percent: float


_Cycles = tuple[Floats, Floats, Floats, Floats]
"""Displacement, velocity, command and force of a damper at all motions and commands, shape (n_samples,) each."""


def static_counterpart(
    spec: DamperSpec,
    theta: ArrayLike,
    *,
    largest_command: Positive,
    amplitude: tuple[Positive, Positive],
    velocity: tuple[Positive, Positive],
) -> StaticCounterpart:
    """Fit `f = c v + k x + alpha tanh(beta v + delta tanh(x/x_s)) + f0` to a damper in steady cycles.

    c, k, delta and f0 are linear in the command and alpha is quadratic, as in Kwok et al., Sens. Actuators A 132, 2006,
    441-451, so that the force is F0 + G i + H i^2 except for delta. For given beta, delta and x_s the other parameters
    are linear and eliminated (Golub & Pereyra, SIAM J. Numer. Anal. 10(2), 1973, 413-432). A static hysteretic damper
    with such laws is returned unchanged, with the lag of its driver; a fitted one has no lag: its command is the
    current in the coil. It is fitted to commands from 0 to the largest one and to sinusoids from the smallest to the
    largest `amplitude` [m] and peak `velocity` [m/s].
    """
    if spec.command_unit is None:
        raise SettingError(
            f"{spec.name} does not follow a command; give a model with current laws, which a law can drive"
        )
    if np.shape(theta) != (len(spec.names),):
        raise SettingError(
            f"`theta` has shape {np.shape(theta)}, {spec.name} takes ({len(spec.names)},); see `spec.names`"
        )
    values = tuple(np.asarray(theta, dtype=np.float64).tolist())
    for name, (low, high) in {"amplitude": amplitude, "velocity": velocity}.items():
        if low > high:
            raise SettingError(f"`{name}` is {low} to {high}; give the smaller number first")
    if is_curve(spec):
        return StaticCounterpart(spec=spec, theta=values, fit_percent=100.0)
    cycles = _simulate(spec, values, largest_command, amplitude, velocity)
    model = damper(_COUNTERPART_MODEL)
    laws = model.preset(_COUNTERPART_SET).spec.laws_by_name
    fitted_spec = model.with_current_laws(laws, unit=spec.command_unit)
    fitted = _fit(fitted_spec, cycles, largest_command)
    return StaticCounterpart(
        spec=fitted_spec, theta=fitted, fit_percent=_fit_percent(fitted_spec, fitted, cycles)
    )


def is_curve(spec: DamperSpec) -> bool:
    """Whether a model gives the force as a function of the command: static hysteretic, with any current laws."""
    return spec.name == _COUNTERPART_MODEL and spec.command_unit is not None


def _simulate(
    spec: DamperSpec,
    theta: Sequence[float],
    largest_command: float,
    amplitude: tuple[float, float],
    velocity: tuple[float, float],
) -> _Cycles:
    last = slice(-_PER_CYCLE, None)
    parts = []
    for size in np.geomspace(*amplitude, _N_MOTIONS):
        for speed in np.geomspace(*velocity, _N_MOTIONS):
            motion = sinusoid(
                size, speed, cycles=_CYCLES, per_cycle=_PER_CYCLE, command_unit=spec.command_unit
            )
            for command in np.linspace(0.0, largest_command, _N_COMMANDS):
                force = simulate_force(spec, theta, replace(motion, command=command))
                samples = motion.displacement, motion.velocity, np.full_like(force, command), force
                parts.append([np.asarray(values)[last] for values in samples])
    x, v, u, f = np.concatenate(parts, axis=1)
    return x, v, u, f


def _fit(spec: DamperSpec, cycles: _Cycles, largest: float) -> tuple[float, ...]:
    """Coefficients in the order of the spec, by variable projection from several starting points."""
    stroke, speed = (float(np.abs(values).max()) for values in cycles[:2])
    limits = {parameter.name: (parameter.lower, parameter.upper) for parameter in spec.plain}
    # Logarithms of beta and x_s; delta at zero and at the largest command.
    lower = np.array([np.log(0.1 / speed), np.log(1e-4 * stroke), limits["delta"][0], limits["delta"][0]])
    upper = np.array([np.log(1e4 / speed), np.log(10.0 * stroke), limits["delta"][1], limits["delta"][1]])

    def residuals(shape: Floats) -> Floats:
        return _project(cycles, shape, largest, None)[1]

    from scipy.optimize import least_squares

    starts = [
        np.array([np.log(steepness / speed), np.log(width * stroke), delta, delta])
        for steepness, delta in ((5.0, 0.5), (50.0, 1.0), (500.0, 3.0))
        for width in (0.01, 0.3)
    ]
    best = min(
        (
            least_squares(residuals, start, bounds=(lower, upper), x_scale=1.0, max_nfev=60)
            for start in starts
        ),
        key=lambda result: float(result.cost),
    )
    nodes, _ = _project(cycles, best.x, largest, limits)
    c, k, alpha, f0 = nodes[:2], nodes[2:4], nodes[4:7], nodes[7:]
    steepness, width = np.exp(best.x[:2])
    coefficients = {
        "c": _linear(c, largest),
        "k": _linear(k, largest),
        "alpha": _quadratic(alpha, largest),
        "beta": (steepness,),
        "delta": _linear(best.x[2:], largest),
        "x_s": (width,),
        "f0": _linear(f0, largest),
    }
    return tuple(float(value) for parameter in spec.plain for value in coefficients[parameter.name])


def _project(
    cycles: _Cycles, shape: Floats, largest: float, limits: dict[str, tuple[float, float]] | None
) -> tuple[Floats, Floats]:
    """Values of c, k, alpha and f0 at zero, half and the largest command for a shape, and the residual [N].

    `limits` keeps the values in the range of the model, which refuses a negative viscosity, for example.
    """
    displacement, velocity, command, force = cycles
    share = command / largest
    steepness, width = np.exp(shape[:2])
    delta = shape[2] + (shape[3] - shape[2]) * share
    hysteresis = np.tanh(steepness * velocity + delta * np.tanh(displacement / width))
    ends = np.stack([1.0 - share, share], axis=1)
    middle = np.stack(
        [(1.0 - share) * (1.0 - 2.0 * share), 4.0 * share * (1.0 - share), share * (2.0 * share - 1.0)],
        axis=1,
    )
    both = velocity[:, None], displacement[:, None]
    columns = np.hstack([*(ends * each for each in both), middle * hysteresis[:, None], ends])
    sizes = np.linalg.norm(columns, axis=0)
    scaled = columns / sizes
    if limits is None:
        solution = np.linalg.lstsq(scaled, force, rcond=None)[0]
    else:
        from scipy.optimize import lsq_linear

        names = ("c", "c", "k", "k", "alpha", "alpha", "alpha", "f0", "f0")
        low, high = (np.array([limits[name][side] for name in names]) * sizes for side in (0, 1))
        solution = lsq_linear(scaled, force, bounds=(low, high), method="bvls").x
    return solution / sizes, scaled @ solution - force


def _linear(nodes: Floats, largest: float) -> tuple[float, float]:
    return nodes[0], (nodes[1] - nodes[0]) / largest


def _quadratic(nodes: Floats, largest: float) -> tuple[float, float, float]:
    """Coefficients of the parabola through its values at 0, half and the largest command."""
    none, half, whole = nodes
    return none, (4.0 * half - 3.0 * none - whole) / largest, 2.0 * (none + whole - 2.0 * half) / largest**2


def _fit_percent(spec: DamperSpec, theta: Sequence[float], cycles: _Cycles) -> float:
    # A static model has no memory, so all cycles can be simulated in one history of any step.
    x, v, u, force = cycles
    loading = Loading(dt=1.0, displacement=x, velocity=v, command=u, command_unit=spec.command_unit)
    residual, deviation = simulate_force(spec, theta, loading) - force, force - force.mean()
    return float(100.0 * (1.0 - np.linalg.norm(residual) / np.linalg.norm(deviation)))
