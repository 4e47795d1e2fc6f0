"""Motions, parameters and tests that the damper contracts share: seeded, at the scale of a bench test."""

from dataclasses import replace
from functools import cache

import numpy as np

import mrwork as mr
from mrwork.identification.equivalent import identifiable_form

DT = 1e-3
N_TIME = 801
STROKE = 0.01
DURATION = DT * (N_TIME - 1)
TIME = DT * np.arange(N_TIME)


def sine(*, amplitude=STROKE, frequency=2.5, n_time=N_TIME, dt=DT):
    """A sinusoid from mid-stroke, with its exact velocity; the default has 400 samples per cycle."""
    phase = 2.0 * np.pi * frequency * dt * np.arange(n_time)
    return mr.Loading(
        dt=dt,
        displacement=amplitude * np.sin(phase),
        velocity=2.0 * np.pi * frequency * amplitude * np.cos(phase),
    )


def sweep():
    """1 to 12 Hz at falling amplitude; the velocity is the derivative of the displacement's spline."""
    start, end = 1.0, 12.0
    phase = 2.0 * np.pi * (start * TIME + (end - start) / (2.0 * DURATION) * TIME**2)
    return mr.Loading(dt=DT, displacement=STROKE / (1.0 + 4.0 * TIME / DURATION) * np.sin(phase))


def noise():
    """Noise in the band up to 12 Hz, as a sum of sinusoids of random phase, swelling from rest."""
    rng = np.random.default_rng(5)
    frequency = np.arange(1.0, 12.0, 0.7)[:, None]
    waves = np.sin(2.0 * np.pi * (frequency * TIME + rng.random(frequency.shape))) / frequency
    shape = waves.sum(axis=0) * np.sin(0.5 * np.pi * np.minimum(TIME / 0.1, 1.0)) ** 2
    return mr.Loading(dt=DT, displacement=STROKE * shape / np.max(np.abs(shape)))


MOTIONS = {"sine": sine, "sweep": sweep, "noise": noise}


def noise_free_test(spec, loading):
    """Record of the nominal damper on a rig without noise."""
    velocity = np.gradient(loading.displacement, loading.dt) if loading.velocity is None else loading.velocity
    return mr.DamperTest(
        name=f"{spec.name} without noise",
        path="memory",
        sha256="0" * 64,
        dt=loading.dt,
        start_time=0.0,
        displacement=loading.displacement,
        velocity=velocity,
        force=mr.simulate_force(spec, spec.nominal, replace(loading, velocity=velocity)),
        velocity_source="measured",
        synthetic=True,
    )


@cache
def _scaled_box(name):
    spec = next(spec for spec in mr.damper_models() if spec.name == name)
    bounds = mr.Box.of(spec)
    box = mr.identification.search_box(spec, bounds, (noise_free_test(spec, sine()),))
    narrowed = {}
    for index, parameter in enumerate(spec.parameters):
        admissible = (bounds.lower[index], bounds.upper[index])
        if (box.lower[index], box.upper[index]) != admissible:
            continue
        # The record has no scale for this unit; the neighbourhood of the nominal value stands in.
        if parameter.scale == "log":
            around = (parameter.nominal / 3.0, parameter.nominal * 3.0)
        else:
            around = (parameter.nominal - abs(parameter.nominal), parameter.nominal + abs(parameter.nominal))
        if around[0] < around[1]:
            narrowed[parameter.name] = (max(around[0], admissible[0]), min(around[1], admissible[1]))
    return box.with_bounds(narrowed)


def scaled_box(spec):
    """Ranges that a test of this stroke and force can ask for: where models are used."""
    return _scaled_box(spec.name)


def random_theta(spec, n_batch, *, rng):
    """Parameters drawn evenly from the scaled box, shape (n_batch, n_params).

    A redundant model is drawn in the form in which it is identified: its own ranges, each at its scale, combine to
    dampers that no test asks for.
    """
    form = identifiable_form(spec, {})
    box = scaled_box(form.spec)
    return form.to_model(box.theta_from_unit(np.random.default_rng(rng).random((n_batch, len(box.free)))))


def without_offsets(spec, theta):
    """The same parameters with every offset at zero, where an odd model is odd."""
    offset = np.array([parameter.scale == "offset" for parameter in spec.parameters])
    return np.where(offset, 0.0, theta)
