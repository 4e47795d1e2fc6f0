"""The inverse of a damper as a small network: the command at which it would give a wanted force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.control.excitation import random_loading
from mrwork.control.inverse_samples import N_SAMPLES, InverseSamples, known, network_inputs, samples_shown
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SettingError
from mrwork.simulate import Loading, simulate_force

Floats = NDArray[np.float64]

# Called with the steps so far and the root mean square error of the command, as a share of the largest.
OnStep = Callable[[int, float], None]

_N_CYCLES = 60
_MAX_STEPS = 200
# Of the squares of the weights, per sample: so that no unit runs away where the data leave it free.
_RIDGE = 1e-8


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseNetwork:
    """`command = output_scale clip(w2 tanh(W1 clip(inputs/input_scale, -1, 1) + b1) + b2, 0, 1)`.

    Inputs beyond what it was trained on are taken for the nearest that it knows.

    Parameters
    ----------
    names
        The inputs: deformation [m], velocity [m/s] and wanted force [N], and the same one sample before.
    W1, b1, w2, b2
        Shapes (n_hidden, n_inputs), (n_hidden,), (n_hidden,), ().
    input_scale, output_scale
        Shape (n_inputs,), in the units of the inputs; the largest command.
    sample_time
        Between the inputs and those before [s].
    fit_percent
        On a motion that it was not trained on, of the force that the damper gives at the network's command, compared
        with the wanted one, which it can give: 100 (1 - |f_c - f| / |f_c - mean f_c|).
    command_error
        There, root mean square error of the command as a share of the largest. It may be large where the fit is good:
        near rest no command changes the force.
    """

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
        scaled = known(np.asarray(inputs, dtype=np.float64), self.input_scale)
        hidden = np.tanh(scaled @ self.W1.T + self.b1)
        return self.output_scale * np.clip(hidden @ self.w2 + self.b2, 0.0, 1.0)


def train_inverse_network(
    spec: DamperSpec,
    theta: ArrayLike,
    *,
    largest_command: float,
    amplitude: float,
    velocity: float,
    sample_time: float,
    n_hidden: int = 12,
    n_previous: int = 1,
    rng: int = 0,
    on_step: OnStep | None = None,
) -> InverseNetwork:
    """Train a network of one hidden layer on what the damper does under random motions and commands.

    Networks of this kind are the inverse models of Chang & Zhou, J. Struct. Eng. 128(2), 2002, 231-239. Ours is
    fitted by Levenberg and Marquardt's method with an exact Jacobian. An error of the command counts in proportion to
    the force it makes. To the samples that the damper has shown, others are added in which more is wanted than it can
    give, or less: the answers are the largest command and none. The lag of a driver is not inverted: the command is
    what the coil should get.

    Parameters
    ----------
    spec, theta
        A damper with current laws, and its parameters, shape (n_params,).
    largest_command
        In the unit of the model.
    amplitude, velocity
        Peak deformation [m] and velocity [m/s] that the device is expected to make.
    sample_time
        Of the controller [s]: how long before the previous inputs are.
    n_previous
        0 or 1: how many earlier samples are inputs too.
    rng
        Seed of motions, commands and first weights.

    Raises
    ------
    SettingError
        Where the model does not follow a command, or a setting is not positive.
    SimulationError
        Where the damper cannot be simulated at such motions.

    Examples
    --------
    >>> import mrwork as mr
    >>> from mrwork.control.inverse_network import train_inverse_network
    >>> rd1005 = mr.damper("static_hysteretic").preset("kwok2006")
    >>> network = train_inverse_network(rd1005.spec, rd1005.theta, largest_command=1.88, amplitude=0.01,
    ...                                 velocity=0.2, sample_time=0.001, n_hidden=4)  # doctest: +SKIP
    """
    _check(spec, largest_command, amplitude, velocity, sample_time, n_hidden, n_previous)
    spec, values = _without_lag(spec, theta)
    assert spec.current is not None
    generator = np.random.default_rng(rng)
    # A coarse sample time still wants enough samples to choose from.
    n_cycles = max(_N_CYCLES, int(2.0 * N_SAMPLES * sample_time * velocity / (2.0 * np.pi * amplitude)))
    training, held_out = (
        random_loading(
            amplitude=amplitude,
            velocity=velocity,
            largest_command=largest_command,
            command_unit=spec.current.unit,
            dt=sample_time,
            n_cycles=n_cycles,
            rng=generator,
        )
        for n_cycles in (n_cycles, n_cycles // 3)
    )
    samples, force_scale = samples_shown(spec, values, training, largest_command, n_previous, generator)
    scale = np.tile([amplitude, velocity, force_scale], 1 + n_previous)
    W1, b1, w2, b2 = _trained(samples, scale, n_hidden, generator, on_step)
    current = ("deformation", "velocity", "wanted force")
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
    return _judged(network, spec, values, held_out, n_previous)


def _check(
    spec: DamperSpec,
    largest_command: float,
    amplitude: float,
    velocity: float,
    sample_time: float,
    n_hidden: int,
    n_previous: int,
) -> None:
    if spec.current is None:
        raise SettingError(
            f"{spec.name} does not follow a command, so there is nothing to invert; give a model with current laws"
        )
    settings = np.array([largest_command, amplitude, velocity, sample_time])
    if not (np.isfinite(settings).all() and (settings > 0.0).all()):
        raise SettingError(
            f"largest command {largest_command}, amplitude {amplitude} m, velocity {velocity} m/s and sample "
            f"time {sample_time} s must be positive"
        )
    if n_hidden < 1 or n_previous not in (0, 1):
        raise SettingError(
            f"`n_hidden` is {n_hidden} and `n_previous` {n_previous}; give 1 or more, and 0 or 1"
        )


def _without_lag(spec: DamperSpec, theta: ArrayLike) -> tuple[DamperSpec, Floats]:
    """The damper at the current in its coil."""
    values = np.asarray(theta, dtype=np.float64).ravel()
    if len(values) != len(spec.names):
        raise SettingError(
            f"`theta` has {len(values)} values, {spec.name} takes {len(spec.names)}; see `spec.names`"
        )
    current = spec.current
    if current is None or not current.lagged:
        return spec, values
    laws = dict(zip((parameter.name for parameter in spec.plain), current.laws, strict=True))
    return damper(spec.name).with_current_laws(laws, unit=current.unit), values[:-1]


def _trained(
    samples: InverseSamples, scale: Floats, n_hidden: int, rng: np.random.Generator, on_step: OnStep | None
) -> tuple[Floats, Floats, Floats, float]:
    """W1, b1, w2 and b2 of least weighted squares.

    A previous sample is almost the present one, so the network is trained on their difference, in units of its size.
    """
    features = known(samples.inputs, scale)
    to_features = np.eye(len(scale))
    if len(scale) > 3:
        change = features[:, :3] - features[:, 3:]
        size = 3.0 * change.std(axis=0)
        to_features[3:, :3], to_features[3:, 3:] = np.diag(1.0 / size), -np.diag(1.0 / size)
        features = features @ to_features.T
    n_inputs = features.shape[1]
    weight = samples.importance / np.sqrt(len(features))
    shapes = n_hidden * n_inputs
    none_wanted, all_wanted = samples.share <= 0.0, samples.share >= 1.0
    steps = 0

    def hidden_and_share(parameters: Floats) -> tuple[Floats, Floats, Floats]:
        W1 = parameters[:shapes].reshape(n_hidden, n_inputs)
        hidden = np.tanh(features @ W1.T + parameters[shapes : shapes + n_hidden])
        w2 = parameters[shapes + n_hidden : -1]
        share = hidden @ w2 + parameters[-1]
        # The command is clipped, so an answer beyond the end that is wanted is right.
        wrong = ~((none_wanted & (share < 0.0)) | (all_wanted & (share > 1.0)))
        return hidden, share, wrong * weight

    def residuals(parameters: Floats) -> Floats:
        _, share, counted = hidden_and_share(parameters)
        return np.concatenate([counted * (share - samples.share), np.sqrt(_RIDGE) * parameters])

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
            on_step(steps, float(np.linalg.norm(counted * (share - samples.share))))
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

    found = least_squares(residuals, start, jac=jacobian, method="lm", max_nfev=_MAX_STEPS).x
    W1 = found[:shapes].reshape(n_hidden, n_inputs) @ to_features
    return W1, found[shapes : shapes + n_hidden], found[shapes + n_hidden : -1], float(found[-1])


def _judged(
    network: InverseNetwork, spec: DamperSpec, theta: Floats, loading: Loading, n_previous: int
) -> InverseNetwork:
    """The network with its accuracy on a motion and commands that it has not seen."""
    wanted = simulate_force(spec, theta, loading)
    command = network.command(network_inputs(loading, wanted, n_previous))
    given = simulate_force(spec, theta, replace(loading, command=command))
    fit = 1.0 - np.linalg.norm(given - wanted) / np.linalg.norm(wanted - wanted.mean())
    error = (command - np.asarray(loading.command)) / network.output_scale
    return replace(network, fit_percent=float(100.0 * fit), command_error=float(np.sqrt(np.mean(error**2))))
