"""Inverse model of a damper as a small neural network: the command for a desired force.

It is trained on random motions with the commands that give the desired forces.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Annotated, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import Positive, Seed, checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.dampers.spec import DamperSpec, with_changed_laws
from mrwork.errors import SettingError

N_SAMPLES = 2000
# Least weight of a sample, for those at which the command hardly changes the force.
_LEAST_IMPORTANCE = 0.05
# Desired forces beyond the range of the damper, in units of its width, as powers of ten: a regulator wants a bit more
# or ten times as much.
_BEYOND = (-1.5, 1.0)
# Scale of the forces, over the largest that the damper gave.
_FORCE_MARGIN = 1.2
# Tones of the random motion lie within this factor of the middle frequency.
_N_TONES = 24
_BAND = 5.0
# Resolves the peaks of the fastest tone within 1 %.
_PER_CYCLE = 100


_Samples = tuple[Floats, Floats, Floats]
"""Inputs, shape (n, n_inputs); the right command as a share of the largest; and the weight of each sample."""


def random_loading(
    *,
    amplitude: float,
    velocity: float,
    largest_command: float,
    command_unit: CommandUnit,
    dt: float,
    n_cycles: int,
    rng: np.random.Generator,
) -> Loading:
    """A random motion with the given peaks, and a random command between 0 and the largest.

    The motion is a sum of tones with random phases, log-uniform frequencies about the f of
    `2 pi f amplitude = velocity`, and equal velocities; its time axis is scaled so that both peaks [m, m/s] are met.
    The command is the same kind of noise plus random steps, clipped to its range, where it stays a third of the time.
    """
    # Normalised time: the tones lie about 1 Hz, and the motion lasts `n_cycles` seconds.
    frequencies = _BAND ** rng.uniform(-1.0, 1.0, _N_TONES)
    phases = rng.uniform(0.0, 2.0 * np.pi, _N_TONES)

    def motion(time: Floats) -> tuple[Floats, Floats]:
        angle = 2.0 * np.pi * np.outer(time, frequencies) + phases
        return (np.sin(angle) / (2.0 * np.pi * frequencies)).sum(axis=1), np.cos(angle).sum(axis=1)

    x, v = motion(np.linspace(0.0, n_cycles, _PER_CYCLE * n_cycles))
    stretch = (velocity / amplitude) / (np.abs(v).max() / np.abs(x).max())
    time = np.arange(0.0, n_cycles, stretch * dt)
    x, v = motion(time)
    size = amplitude / np.abs(x).max()
    wander = np.sin(2.0 * np.pi * np.outer(time, 1.7 * frequencies[::2]) + phases[::2]).sum(axis=1)
    jumps = rng.uniform(-1.0, 1.0, n_cycles)[time.astype(int)]
    share = np.clip(0.5 + 0.35 * wander / wander.std() + 0.5 * jumps, 0.0, 1.0)
    return Loading(
        dt=dt,
        displacement=size * x,
        velocity=stretch * size * v,
        command=largest_command * share,
        command_unit=command_unit,
    )


@array_dataclass()
class _DamperGroup:
    """`count` equal dampers in parallel; with `differential` as many act in opposition, with the same command."""

    spec: DamperSpec
    theta: Floats
    count: float = 1.0
    differential: bool = False

    def force(self, loading: Loading) -> Floats:
        """Force of all dampers together [N], shape (n_time,)."""
        one = simulate_force(self.spec, self.theta, loading)
        if self.differential:
            assert loading.velocity is not None
            opposed = replace(
                loading,
                displacement=-np.asarray(loading.displacement),
                velocity=-np.asarray(loading.velocity),
            )
            one = one - simulate_force(self.spec, self.theta, opposed)
        return np.asarray(self.count * one)


def _draw_samples(
    group: _DamperGroup, loading: Loading, largest_command: float, n_previous: int, rng: np.random.Generator
) -> tuple[_Samples, float]:
    """Samples with desired forces within, above and below the range of the damper, and a scale of force [N]."""
    force = group.force(loading)
    least = group.force(replace(loading, command=0.0))
    most = group.force(replace(loading, command=largest_command))
    span = np.abs(most - least)
    usual = float(np.sqrt(np.mean(span**2)))
    if usual == 0.0:
        raise SettingError(
            f"the command does not change the force of this {group.spec.name}; there is nothing to invert"
        )
    importance = np.maximum(span / usual, _LEAST_IMPORTANCE)
    excess, lack = (10.0 ** rng.uniform(*_BEYOND, force.size) * (most - least) for _ in range(2))
    kinds = (
        (force, np.asarray(loading.command) / largest_command, 0.7),
        (most + excess, np.ones(force.size), 0.15),
        (least - lack, np.zeros(force.size), 0.15),
    )
    parts = []
    for wanted, share, portion in kinds:
        rows = rng.integers(1, force.size, round(portion * N_SAMPLES))
        inputs = _network_inputs(loading, wanted, n_previous)[rows]
        parts.append((inputs, share[rows], importance[rows]))
    inputs, share, importance = (np.concatenate(each) for each in zip(*parts, strict=True))
    return (inputs, share, importance), _FORCE_MARGIN * float(np.abs(most).max())


def _scale_inputs(inputs: Floats, scale: Floats) -> Floats:
    """Inputs over their scales, clipped to [-1, 1]."""
    return np.asarray(np.clip(inputs / scale, -1.0, 1.0), dtype=np.float64)


def _network_inputs(loading: Loading, wanted: Floats, n_previous: int) -> Floats:
    """Deformation, velocity and desired force, then those one sample before; shape (n_time, 3 or 6)."""
    assert loading.velocity is not None
    now = np.column_stack([loading.displacement, loading.velocity, wanted])
    return np.hstack([now] + [np.vstack([now[:1], now[:-1]])] * n_previous)


# Called with the number of steps and the root mean square error of the command, as a share of the largest.
OnTrainingStep = Callable[[int, float], None]

_N_CYCLES = 60
# Of the middle frequency in a sample; fewer make a long history, more leave nothing of it between two samples.
_FEWEST_CYCLES, _MOST_CYCLES = 1e-5, 0.5
_MAX_STEPS = 200
# Ridge penalty of the weights, per sample: keeps units bounded that the data do not determine.
_RIDGE = 1e-8


@array_dataclass(repr=False)
class InverseNetwork(Summarised):
    """`command = output_scale clip(w2 tanh(W1 clip(inputs/input_scale, -1, 1) + b1) + b2, 0, 1)`.

    Inputs outside the training range are clipped to it. They are deformation [m], velocity [m/s] and desired force [N],
    then those one `sample_time` before. W1 has the shape (n_hidden, n_inputs), b1 and w2 (n_hidden,).

    `fit_percent` is 100 (1 - |f_c - f| / |f_c - mean f_c|) on a test motion, with f the force of the damper at the
    command of the network and f_c the desired force, which is within the range of the damper. `command_error` is the
    root mean square error of the command there, as a share of the largest. It may be large although the fit is good:
    near rest the command hardly changes the force.
    """

    _units: ClassVar[Mapping[str, str]] = {"sample_time": "s", "fit_percent": "%"}

    names: tuple[str, ...]
    W1: Floats
    b1: Floats
    w2: Floats
    b2: float
    input_scale: Floats
    output_scale: float
    sample_time: float
    fit_percent: float
    command_error: float

    def command(self, inputs: ArrayLike) -> Floats:
        """The command for inputs in the order of `names`, shape (..., n_inputs)."""
        given = np.asarray(inputs, dtype=np.float64)
        if given.shape[-1:] != self.input_scale.shape:
            raise SettingError(
                f"`inputs` has shape {given.shape}; give (..., {len(self.names)}), {', '.join(self.names)}"
            )
        hidden = np.tanh(_scale_inputs(given, self.input_scale) @ self.W1.T + self.b1)
        return self.output_scale * np.clip(hidden @ self.w2 + self.b2, 0.0, 1.0)


@checked
def train_inverse_network(
    spec: DamperSpec,
    theta: ArrayLike,
    *,
    largest_command: Positive,
    amplitude: Positive,
    velocity: Positive,
    sample_time: Positive,
    n_hidden: Annotated[int, Within(least=1, most=1000)] = 12,
    n_previous: Literal[0, 1] = 1,
    count: Positive = 1.0,
    differential: bool = False,
    rng: Seed = 0,
    on_step: OnTrainingStep | None = None,
) -> InverseNetwork:
    """Train a network with one hidden layer on simulated forces under random motions and commands.

    Networks of this kind are the inverse models of Chang & Zhou, J. Struct. Eng. 128(2), 2002, 231-239. This
    one is fitted by the Levenberg-Marquardt method with an exact Jacobian. An error of the command is weighted by the
    force that it causes. Further samples have desired forces above and below the range of the damper, for which the
    command is the largest and zero. The lag of the driver is not inverted: the command is the current in the coil.

    Parameters
    ----------
    spec, theta
        A damper with current laws, and its parameters, shape (n_params,).
    largest_command
        In the unit of the model.
    amplitude, velocity
        Expected peak deformation [m] and velocity [m/s] of the device.
    sample_time
        Sample time of the controller [s], the time between present and previous inputs.
    n_previous
        Number of earlier samples among the inputs, 0 or 1.
    count, differential
        Number of dampers in parallel, and whether as many act in opposition, as in `Device`; the desired force is that
        of all together.
    rng
        Seed of the motions, the commands and the initial weights.

    Raises
    ------
    SettingError
        If the model does not follow a command, or the motion does not fit the sample time.
    SimulationError
        If the damper cannot be simulated at these motions.

    Examples
    --------
    >>> import mrwork as mr
    >>> from mrwork.control.laws.inverse_network import train_inverse_network
    >>> rd1005 = mr.damper("static_hysteretic").preset("kwok2006")
    >>> network = train_inverse_network(rd1005.spec, rd1005.theta, largest_command=1.88, amplitude=0.01,
    ...                                 velocity=0.2, sample_time=0.001, n_hidden=4)  # doctest: +SKIP
    """
    _check(spec, amplitude, velocity, sample_time)
    spec, values = _without_lag(spec, theta)
    assert spec.command_unit is not None
    generator = np.random.default_rng(rng)
    # A long sample time needs more cycles for the same number of samples.
    n_cycles = max(_N_CYCLES, int(2.0 * N_SAMPLES * sample_time * velocity / (2.0 * np.pi * amplitude)))
    training, held_out = (
        random_loading(
            amplitude=amplitude,
            velocity=velocity,
            largest_command=largest_command,
            command_unit=spec.command_unit,
            dt=sample_time,
            n_cycles=n_cycles,
            rng=generator,
        )
        for n_cycles in (n_cycles, n_cycles // 3)
    )
    group = _DamperGroup(spec=spec, theta=values, count=count, differential=differential)
    samples, force_scale = _draw_samples(group, training, largest_command, n_previous, generator)
    scale = np.tile([amplitude, velocity, force_scale], 1 + n_previous)
    W1, b1, w2, b2 = _train(samples, scale, n_hidden, generator, on_step)
    current = ("deformation", "velocity", "desired force")
    network = InverseNetwork(
        names=current + tuple(f"previous {name}" for name in current) * n_previous,
        W1=W1,
        b1=b1,
        w2=w2,
        b2=b2,
        input_scale=scale,
        output_scale=largest_command,
        sample_time=sample_time,
        fit_percent=np.nan,
        command_error=np.nan,
    )
    return _test(network, group, held_out, n_previous)


def _check(spec: DamperSpec, amplitude: float, velocity: float, sample_time: float) -> None:
    if spec.command_unit is None:
        raise SettingError(
            f"{spec.name} does not follow a command, so there is nothing to invert; give a model with current laws"
        )
    cycles = sample_time * velocity / (2.0 * np.pi * amplitude)
    if not _FEWEST_CYCLES <= cycles <= _MOST_CYCLES:
        raise SettingError(
            f"a motion of {amplitude:g} m and {velocity:g} m/s has {cycles:g} cycles in a sample of {sample_time:g} s; "
            f"give numbers with {_FEWEST_CYCLES:g} to {_MOST_CYCLES:g}"
        )


def _without_lag(spec: DamperSpec, theta: ArrayLike) -> tuple[DamperSpec, Floats]:
    """The damper without the lag of its driver: its command is the current in the coil."""
    values = np.asarray(theta, dtype=np.float64)
    if values.shape != (len(spec.names),):
        raise SettingError(
            f"`theta` has shape {values.shape}, {spec.name} takes ({len(spec.names)},); see `spec.names`"
        )
    return (with_changed_laws(spec, lagged=False), values[:-1]) if spec.lagged else (spec, values)


def _train(
    samples: _Samples, scale: Floats, n_hidden: int, rng: np.random.Generator, on_step: OnTrainingStep | None
) -> tuple[Floats, Floats, Floats, float]:
    """W1, b1, w2 and b2 by weighted least squares.

    Previous samples are nearly equal to the present ones, so the network is trained on their scaled differences.
    """
    inputs, right, importance = samples
    features = _scale_inputs(inputs, scale)
    to_features = np.eye(len(scale))
    if len(scale) > 3:
        size = 3.0 * (features[:, :3] - features[:, 3:]).std(axis=0)
        to_features[3:, :3], to_features[3:, 3:] = np.diag(1.0 / size), -np.diag(1.0 / size)
        features = features @ to_features.T
    n_inputs = features.shape[1]
    weight = importance / np.sqrt(len(features))
    shapes = n_hidden * n_inputs
    none_wanted, all_wanted = right <= 0.0, right >= 1.0
    steps = 0

    def hidden_and_share(parameters: Floats) -> tuple[Floats, Floats, Floats]:
        W1 = parameters[:shapes].reshape(n_hidden, n_inputs)
        hidden = np.tanh(features @ W1.T + parameters[shapes : shapes + n_hidden])
        w2 = parameters[shapes + n_hidden : -1]
        share = hidden @ w2 + parameters[-1]
        # The command is clipped, so an output beyond the right end of the range has no error.
        wrong = ~((none_wanted & (share < 0.0)) | (all_wanted & (share > 1.0)))
        return hidden, share, wrong * weight

    def residuals(parameters: Floats) -> Floats:
        _, share, counted = hidden_and_share(parameters)
        return np.concatenate([counted * (share - right), np.sqrt(_RIDGE) * parameters])

    def jacobian(parameters: Floats) -> Floats:
        nonlocal steps
        hidden, share, counted = hidden_and_share(parameters)
        slope = counted[:, None] * (1.0 - hidden**2) * parameters[shapes + n_hidden : -1]
        rows = np.hstack(
            [
                (slope[:, :, None] * features[:, None, :]).reshape(len(features), shapes),
                slope,
                counted[:, None] * hidden,
                counted[:, None],
            ]
        )
        steps += 1
        if on_step is not None:
            on_step(steps, float(np.linalg.norm(counted * (share - right))))
        return np.vstack([rows, np.sqrt(_RIDGE) * np.eye(parameters.size)])

    start = np.concatenate(
        [
            rng.standard_normal(shapes),
            rng.uniform(-1.0, 1.0, n_hidden),
            rng.standard_normal(n_hidden) / np.sqrt(n_hidden),
            [0.5],
        ]
    )
    from scipy.optimize import least_squares

    solution = least_squares(residuals, start, jac=jacobian, method="lm", max_nfev=_MAX_STEPS).x
    W1 = solution[:shapes].reshape(n_hidden, n_inputs) @ to_features
    return W1, solution[shapes : shapes + n_hidden], solution[shapes + n_hidden : -1], float(solution[-1])


def _test(network: InverseNetwork, group: _DamperGroup, loading: Loading, n_previous: int) -> InverseNetwork:
    wanted = group.force(loading)
    command = network.command(_network_inputs(loading, wanted, n_previous))
    given = group.force(replace(loading, command=command))
    fit = 1.0 - np.linalg.norm(given - wanted) / np.linalg.norm(wanted - wanted.mean())
    error = (command - np.asarray(loading.command)) / network.output_scale
    return replace(network, fit_percent=float(100.0 * fit), command_error=float(np.sqrt(np.mean(error**2))))
