"""What a damper shows of its inverse: which command answers which wanted force, in which motion."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.simulate import Loading, simulate_force

Floats = NDArray[np.float64]

N_SAMPLES = 2000
# A sample at which the command changes the force by less than this share of the usual still counts so much.
_LEAST_IMPORTANCE = 0.05
# Powers of ten of how far beyond the range of the damper forces are wanted in training, in units of its width: a
# regulator asks for a little more or for ten times as much.
_BEYOND = (-1.5, 1.0)
# Forces are known up to so much above the largest that the damper gave.
_FORCE_MARGIN = 1.2


@dataclass(frozen=True, slots=True, kw_only=True)
class InverseSamples:
    """Inputs, shape (n, n_inputs), the share of the largest command that answers them, and how much that matters."""

    inputs: Floats
    share: Floats
    importance: Floats


def samples_shown(
    spec: DamperSpec,
    theta: Floats,
    loading: Loading,
    largest_command: float,
    n_previous: int,
    rng: np.random.Generator,
) -> tuple[InverseSamples, float]:
    """Samples of a motion: as commanded, with more wanted than can be given, and with less. And a scale of force [N].

    Raises
    ------
    SettingError
        Where the command does not change the force.
    """
    force = simulate_force(spec, theta, loading)
    least = simulate_force(spec, theta, replace(loading, command=0.0))
    most = simulate_force(spec, theta, replace(loading, command=largest_command))
    span = np.abs(most - least)
    usual = float(np.sqrt(np.mean(span**2)))
    if usual == 0.0:
        raise SettingError(
            f"the command does not change the force of this {spec.name}; there is nothing to invert"
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
        inputs = network_inputs(loading, wanted, n_previous)[rows]
        parts.append((inputs, share[rows], importance[rows]))
    inputs, share, weight = (np.concatenate(each) for each in zip(*parts, strict=True))
    scale = _FORCE_MARGIN * float(np.abs(most).max())
    return InverseSamples(inputs=inputs, share=share, importance=weight), scale


def known(inputs: Floats, scale: Floats) -> Floats:
    """Inputs in units of their scales, those beyond them at the scale."""
    return np.asarray(np.clip(inputs / scale, -1.0, 1.0), dtype=np.float64)


def network_inputs(loading: Loading, wanted: Floats, n_previous: int) -> Floats:
    """Deformation, velocity and wanted force, and the same one sample before, shape (n_time, 3 or 6)."""
    assert loading.velocity is not None
    now = np.column_stack([loading.displacement, loading.velocity, wanted])
    return np.hstack([now] + [np.vstack([now[:1], now[:-1]])] * n_previous)
