"""Equations of the damper models in JAX, the same as in the Rust core, differentiable; and JAX in this process.

A model is its force as a function of parameters `p` (by their names in the spec), state, displacement and velocity,
under the name of the model. Decorated with `@_twin(rate=...)` it has the rate of its states, a function of the same
arguments; a model without states has none. Models that differ in one term are entered by one function.
"""

from __future__ import annotations

import os
import platform
from collections import namedtuple
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Protocol, TypeVar

import jax
import jax.numpy as jnp
from jax import Array

from mrwork.base.progress import note_compilation
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import LibraryError, SettingError, UnknownNameError
from mrwork.twins.powers import power
from mrwork.twins.tape_twin import equations_of

jax.monitoring.register_event_duration_secs_listener(note_compilation)
# The Rust core computes in double precision, and the twins must agree with it.
jax.config.update("jax_enable_x64", True)  # type: ignore[no-untyped-call] # jax leaves it unannotated


class Parameters(Protocol):
    """Parameters of a model by their names in its spec."""

    def __getattr__(self, name: str) -> Array: ...


T = TypeVar("T")
Equation = Callable[[Parameters, Array, Array, Array], Array]

EQUATIONS: dict[str, tuple[Equation, Equation]] = {}
"""Rate and force by model."""


def _without_states(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    return state


def _twin(*, rate: Equation = _without_states) -> Callable[[Equation], Equation]:
    """Enter the decorated force and its rate in `EQUATIONS`, under the name of the function."""

    def enter(force: Equation) -> Equation:
        EQUATIONS[force.__name__] = (rate, force)
        return force

    return enter


@_twin()
def bingham(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = f_c tanh(v/v_s) + c0 v + f0 (Stanway, Sproston and Stevens 1987)."""
    return p.f_c * jnp.tanh(v / p.v_s) + p.c0 * v + p.f0


def _extended_bingham_rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """x_b' = sgn(q) max(|q| - f_c, 0) / c0, x_k' = (a (x - x_b - x_k) - x_k) / tau."""
    q = _spring_force(p, state, x)
    flowing = jnp.sign(q) * jnp.maximum(jnp.abs(q) - p.f_c, 0.0)
    return jnp.stack([flowing / p.c0, (p.a * (x - state[0] - state[1]) - state[1]) / p.tau])


@_twin(rate=_extended_bingham_rate)
def extended_bingham(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = q + f0 (Gamota and Filisko)."""
    return _spring_force(p, state, x) + p.f0


def _spring_force(p: Parameters, state: Array, x: Array) -> Array:
    """q = rho f_c (x - x_b - x_k)."""
    return p.rho * p.f_c * (x - state[0] - state[1])


def _elasto_visco_plastic_rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """u' = (rho f_y (v - u) - r q(u)) / q'(u)."""
    u = state[0]
    e = jnp.exp(-2.0 * jnp.abs(u) / p.v_r)
    slope = p.f_y / p.v_r * 4.0 * e / (1.0 + e) ** 2 + p.c
    return jnp.stack([(p.rho * p.f_y * (v - u) - p.r * _yielding_flow(p, u)) / slope])


@_twin(rate=_elasto_visco_plastic_rate)
def elasto_visco_plastic(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = q(u) + k x + f0: a spring in series with a core that yields smoothly."""
    return _yielding_flow(p, state[0]) + p.k * x + p.f0


def _yielding_flow(p: Parameters, u: Array) -> Array:
    """q(u) = f_y tanh(u/v_r) + c u."""
    return p.f_y * jnp.tanh(u / p.v_r) + p.c * u


@_twin()
def orifice(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = d |v| v + c v + f0: a loss of head that grows with the square of the velocity."""
    return p.d * jnp.abs(v) * v + p.c * v + p.f0


@_twin(rate=lambda p, state, x, v: jnp.stack([v - state[0] / p.tau]))
def maxwell(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = k z + c v + f0, z' = v - z/tau: a spring in series with a dashpot."""
    return p.k * state[0] + p.c * v + p.f0


@_twin()
def hyperbolic_tangent_gavin(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = f_o tanh(v/V_r + x/d_r) + k0 x + c0 v + f0 (Gavin 2001)."""
    return p.f_o * jnp.tanh(v / p.V_r + x / p.d_r) + p.k0 * x + p.c0 * v + p.f0


@_twin()
def hyperbolic_tangent_guo(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = A1 tanh(A3 (v + omega x)) + A2 (v + omega x) + f0 (Guo, Yang and Pan 2006)."""
    shifted = v + p.omega * x
    return p.A1 * jnp.tanh(p.A3 * shifted) + p.A2 * shifted + p.f0


@_twin()
def static_hysteretic(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c v + k x + alpha tanh(beta v + delta tanh(x/x_s)) + f0 (Kwok et al. 2006)."""
    return p.c * v + p.k * x + p.alpha * jnp.tanh(p.beta * v + p.delta * jnp.tanh(x / p.x_s)) + p.f0


@_twin()
def polynomial_fitting(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = F_m + tanh(x/x_s) T/2: over velocity the mean is a sigmoid, 2/(1 + exp(-y)) - 1 = tanh(y/2), T a Gaussian."""
    mean = p.a * jnp.tanh(0.5 * p.b * (v - p.v0)) + p.c * v + p.f0
    thickness = p.h * jnp.exp(-0.5 * ((v - p.v1) / p.w) ** 2)
    return mean + 0.5 * jnp.tanh(x / p.x_s) * thickness


def _dahl_rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """w' = rho (v - |v| w)."""
    return jnp.stack([p.rho * (v - jnp.abs(v) * state[0])])


@_twin(rate=_dahl_rate)
def dahl(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = k_w w + f0 (Dahl 1968)."""
    return p.k_w * state[0] + p.f0


@_twin(rate=_dahl_rate)
def viscous_dahl(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = k_x v + k_w w + f0 (Ikhouane and Dyke 2007)."""
    return p.k_x * v + p.k_w * state[0] + p.f0


def _lugre_rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """z' = v - a0 |v| z."""
    return jnp.stack([v - p.a0 * jnp.abs(v) * state[0]])


@_twin(rate=_lugre_rate)
def lugre(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = sigma_0 z + sigma_1 z' + sigma_2 v + f0 (Jimenez and Alvarez-Icaza 2005)."""
    return p.sigma_0 * state[0] + p.sigma_1 * _lugre_rate(p, state, x, v)[0] + p.sigma_2 * v + p.f0


def _spencer_loop(p: Parameters, z: Array, v: Array) -> Array:
    """z' = -gamma |v| z |z|^(n-1) - beta v |z|^n + A v (Spencer et al. 1997)."""
    z_n: Array = power(jnp.abs(z), p.n)
    return -p.gamma * jnp.abs(v) * jnp.sign(z) * z_n - p.beta * v * z_n + p.A * v


def _normalised_loop(p: Parameters, w: Array, v: Array) -> Array:
    """w' = rho (v - sigma |v| |w|^(n-1) w + (sigma - 1) v |w|^n) (Ikhouane and Rodellar)."""
    w_n: Array = power(jnp.abs(w), p.n)
    return p.rho * (v - p.sigma * jnp.abs(v) * jnp.sign(w) * w_n + (p.sigma - 1.0) * v * w_n)


@_twin(rate=lambda p, state, x, v: jnp.stack([_spencer_loop(p, state[0], v)]))
def bouc_wen(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c0 v + k0 (x - x0) + alpha z."""
    return p.c0 * v + p.k0 * (x - p.x0) + p.alpha * state[0]


@_twin(rate=lambda p, state, x, v: jnp.stack([_normalised_loop(p, state[0], v)]))
def normalised_bouc_wen(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c v + k (x - x0) + k_w w."""
    return p.c * v + p.k * (x - p.x0) + p.k_w * state[0]


_WIDTH = 2e-4
"""s [m]: the slope of the dead zone changes from 0 to 1 over it."""


def _behind_play(g: Array, x: Array) -> tuple[Array, Array]:
    """u/v and d, with tanh and cosh by r = exp(-2 g/s) and q = exp(-2 |x|/s), which do not overflow."""
    r, q = jnp.exp(-2.0 * g / _WIDTH), jnp.exp(-2.0 * jnp.abs(x) / _WIDTH)
    above, below = 1.0 + q * r, q + r
    slope = r * (1.0 + q * (q + 2.0 * r)) / (above * below)
    return slope, jnp.sign(x) * (jnp.abs(x) - 0.5 * _WIDTH * jnp.log(above / below))


@_twin(rate=lambda p, state, x, v: jnp.stack([_normalised_loop(p, state[0], _behind_play(p.g, x)[0] * v)]))
def backlash_bouc_wen(p: Parameters, state: Array, x: Array, v: Array) -> Array:
    """f = c u + k (d - x0) + k_w w, w' for u: the normalised model behind a dead zone of the displacement."""
    slope, displacement = _behind_play(p.g, x)
    return p.c * slope * v + p.k * (displacement - p.x0) + p.k_w * state[0]


def _enter_shifted(model: str, side: Equation) -> None:
    """Enter f = c (v - share mu s) + k (x - x0) + k_w w, with the loop for the velocity v - mu s (Kwok et al.)."""

    def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
        return jnp.stack([_normalised_loop(p, state[0], v - p.mu * side(p, state, x, v))])

    def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
        shifted = v - p.share * p.mu * side(p, state, x, v)
        return p.c * shifted + p.k * (x - p.x0) + p.k_w * state[0]

    EQUATIONS[model] = (rate, force)


_enter_shifted("non_symmetric_bouc_wen", lambda p, state, x, v: jnp.tanh(state[0] / p.w_s))
_enter_shifted("non_symmetric_bouc_wen_displacement", lambda p, state, x, v: jnp.tanh(x / p.x_s))


def _enter_series(model: str, loop: Equation, loop_force: Equation, damping: Equation) -> None:
    """Enter a loop in series with the dashpot c1, state (y, z): f = c1 y' + k1 (x - x0) (Spencer et al. 1997).

    y' = (f_loop + c v + k0 (x - y)) / (c + c1), and z' follows the loop's rate at the velocity v - y'.
    """

    def rate_of_y(p: Parameters, state: Array, x: Array, v: Array) -> Array:
        c = damping(p, state, x, v)
        return (loop_force(p, state, x, v) + c * v + p.k0 * (x - state[0])) / (c + p.c1)

    def rate(p: Parameters, state: Array, x: Array, v: Array) -> Array:
        y_rate = rate_of_y(p, state, x, v)
        return jnp.stack([y_rate, loop(p, state[1], x, v - y_rate)])

    def force(p: Parameters, state: Array, x: Array, v: Array) -> Array:
        return p.c1 * rate_of_y(p, state, x, v) + p.k1 * (x - p.x0)

    EQUATIONS[model] = (rate, force)


_enter_series(
    "modified_bouc_wen",
    loop=lambda p, z, x, v: _spencer_loop(p, z, v),
    loop_force=lambda p, state, x, v: p.alpha * state[1],
    damping=lambda p, state, x, v: p.c0,
)
for _model, _damping in (
    ("normalised_modified_bouc_wen", lambda p, state, x, v: p.c0),
    ("shear_thinning_modified_bouc_wen", lambda p, state, x, v: p.c0 + p.c2 * jnp.exp(-jnp.abs(v) / p.v_s)),
):
    _enter_series(
        _model,
        loop=lambda p, w, x, v: _normalised_loop(p, w, v),
        loop_force=lambda p, state, x, v: p.k_w * state[1],
        damping=_damping,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Twin:
    """Equations of a damper model, of `Theta` in spec order: `rate` of the states, (n_states,), and `force` [N]."""

    Theta: Any
    rate: Equation
    force: Equation


@cache
def twin_of(spec: DamperSpec) -> Twin:
    """Return the twin of a model: its equations, with the parameters of the spec."""
    if spec.command_unit is not None:
        return twin_of(spec.without_laws)
    if spec.own is not None:
        return _twin_with(spec, *equations_of(spec.own))
    if spec.name not in EQUATIONS:
        raise UnknownNameError(
            f"{spec.name} has no JAX twin; write its equations in mrwork/twins/model_twins.py"
        )
    rate, force = EQUATIONS[spec.name]
    return _twin_with(spec, force, rate)


def _twin_with(spec: DamperSpec, force: Equation, rate: Equation | None) -> Twin:
    names: Any = spec.names
    return Twin(Theta=namedtuple("Theta", names), rate=rate or _without_states, force=force)


def left_of_lag(spec: DamperSpec, theta: Array, current: Array, command: Array, time: Array | float) -> Array:
    """Share of the difference of the current in the coil and a held command that is left after a time [s].

    `theta` is (..., n_params), current and command (...,); the share is zero without a lag.
    """
    rates = theta[..., theta.shape[-1] - spec.n_rates :]
    if not spec.n_rates:
        return jnp.zeros(theta.shape[:-1])
    left: Array = jnp.exp(-jnp.where(current < command, rates[..., 0], rates[..., -1]) * time)
    return left


def parameters_at(spec: DamperSpec, theta: Array, received: Array) -> Any:
    """Parameters of the plain model, as `Theta` of the twin, for a command received by the coil."""
    values, start = [], 0
    for parameter, law in spec.law_pairs:
        coefficients = theta[start : start + law.n_coefficients]
        start += law.n_coefficients
        if law.is_constant:
            values.append(coefficients[0])
            continue
        value = law.values(coefficients, received, xp=jnp)
        values.append(jnp.clip(value, parameter.lower, parameter.upper))
    return twin_of(spec).Theta(*values)


# Environment variable; "off" disables the cache.
_SWITCH = "MRWORK_COMPILATION_CACHE"
# Shortest compilation time of a cached function [s].
_WORTH_KEEPING = 0.1
# The process that has used JAX: this process, or the parent that it was forked from.
_process: int | None = None


def begin() -> None:
    """Prepare JAX in this process: called before every computation on a twin."""
    global _process  # one JAX for each process
    if _process is None:
        try:
            _processor()
        except RuntimeError as error:
            reason = str(error).partition("\n")[0]
            raise LibraryError(
                f"JAX does not start on this machine ({reason}); unset JAX_PLATFORMS, or set it to cpu"
            ) from None
        _process = os.getpid()
        keep_compiled()
    elif _process != os.getpid():
        raise SettingError(
            "this process was forked from a process that has used JAX, where no computation with JAX can end; start "
            'processes by multiprocessing.get_context("spawn")'
        )


@cache
def _processor() -> Any:
    """The device of JAX on which the package computes: its programs are loops over time, for which others are slow."""
    return jax.local_devices(backend="cpu")[0]


@contextmanager
def on_processor() -> Iterator[None]:
    """Prepare JAX, and compute on the processor in the block, whatever JAX's default device is.

    The default device is one of each thread.
    """
    begin()
    with jax.default_device(_processor()):
        yield


def evaluate_on_processor(function: Callable[..., T], point: Array, *operands: Any) -> T:
    """Value of a function of arrays, computed on the processor and given back on the device of `point`.

    In a program of the caller, and for a point that lies on several devices, JAX decides where to compute.
    """
    home = _device_of(point)
    if home is None:
        begin()
        return function(point, *operands)
    with on_processor():
        if home == _processor():
            return function(point, *operands)
        moved = jax.device_put(point, _processor(), src=home)
        value: T = jax.device_put(
            function(moved, *jax.device_put(operands, _processor())), home, src=_processor()
        )
        return value


def _device_of(point: Any) -> Any:
    """The device of an array, also where it is differentiated or batched; `None` for several, or within a program."""
    while isinstance(point, jax.core.Tracer):
        point = getattr(point, "primal", getattr(point, "val", None))
    devices = point.devices() if isinstance(point, Array) else set()
    return devices.pop() if len(devices) == 1 else None


@cache
def keep_compiled() -> None:
    """Enable JAX's compilation cache in $XDG_CACHE_HOME or ~/.cache, unless one is configured, or none is writable."""
    is_given = jax.config.values["jax_compilation_cache_dir"] is not None
    if is_given or os.environ.get(_SWITCH) == "off" or (folder := _folder()) is None:
        return
    jax.config.update("jax_compilation_cache_dir", str(folder))  # type: ignore[no-untyped-call] # as above
    if "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS" not in os.environ:
        jax.config.update("jax_persistent_cache_min_compile_time_secs", _WORTH_KEEPING)  # type: ignore[no-untyped-call] # as above


def _folder() -> Path | None:
    try:
        above = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
        # Machines that share a home folder may have different processors, and compiled functions need not run on both.
        folder = above / "mrwork" / "twins" / (platform.node() or "here")
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # nowhere to write, or no home
        return None
    return folder if os.access(folder, os.W_OK) else None
