"""Branches of force loops: what they are for a known force, and what noise, delays and other motions make of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records import DamperTest, build_damper_test
from studies.chapter_5.loop_branches import branches

AMPLITUDE, FREQUENCY, PER_CYCLE = 0.01, 1.0, 400
OMEGA = 2.0 * np.pi * FREQUENCY
DAMPING, STIFFNESS = 2000.0, 5000.0
TIME = np.arange(5 * PER_CYCLE + PER_CYCLE // 3) / (FREQUENCY * PER_CYCLE)

Floats = NDArray[np.float64]


def recorded(
    force: Floats, *, phase: float = 0.7, middle: float = 0.0, current: float | Floats = 1.0
) -> DamperTest:
    return build_damper_test(
        name="rig",
        time=TIME,
        displacement=middle + displacement(phase),
        velocity=velocity(phase),
        force=force,
        current=current,
    )


def displacement(phase: float = 0.7) -> Floats:
    return np.asarray(AMPLITUDE * np.sin(OMEGA * TIME + phase))


def velocity(phase: float = 0.7) -> Floats:
    return np.asarray(AMPLITUDE * OMEGA * np.cos(OMEGA * TIME + phase))


@pytest.mark.parametrize("phase", [0.0, 0.7, 2.9, 5.1])
@pytest.mark.parametrize("middle", [0.0, 0.02])
def test_a_spring_is_thickness_and_a_dashpot_the_mean_over_the_velocity(phase: float, middle: float) -> None:
    test = recorded(STIFFNESS * displacement(phase) + DAMPING * velocity(phase), phase=phase, middle=middle)
    loop = branches(test)
    assert len(loop.thickness) == 4
    from_middle = np.sqrt(AMPLITUDE**2 - (loop.abscissa / OMEGA) ** 2)
    for thickness, mean in zip(loop.thickness, loop.mean, strict=True):
        # Close to the largest velocity, where the branches meet steeply, a chord between samples is no arc.
        np.testing.assert_allclose(thickness[2:-2], 2.0 * STIFFNESS * from_middle[2:-2], rtol=1e-3)
        np.testing.assert_allclose(mean, DAMPING * loop.abscissa, atol=1e-3 * DAMPING * AMPLITUDE * OMEGA)


@pytest.mark.parametrize("middle", [0.0, 0.02])
def test_a_dashpot_is_thickness_and_a_spring_the_mean_over_the_displacement(middle: float) -> None:
    loop = branches(
        recorded(STIFFNESS * displacement() + DAMPING * velocity(), middle=middle), over="displacement"
    )
    from_middle = loop.abscissa - loop.abscissa[loop.abscissa.size // 2]
    assert loop.abscissa[loop.abscissa.size // 2] == pytest.approx(middle, abs=1e-2 * AMPLITUDE)
    speed = OMEGA * np.sqrt(AMPLITUDE**2 - from_middle**2)
    inner = abs(from_middle) < 0.9 * AMPLITUDE
    np.testing.assert_allclose(loop.thickness.mean(axis=0)[inner], 2.0 * DAMPING * speed[inner], rtol=0.01)
    np.testing.assert_allclose(
        loop.mean.mean(axis=0)[inner], STIFFNESS * from_middle[inner], atol=0.01 * STIFFNESS * AMPLITUDE
    )


def test_the_width_is_that_of_the_loop_of_the_static_model() -> None:
    """alpha tanh(beta v +- delta): the difference falls to its half where cosh(2 beta v) = 2 + cosh(2 delta)."""
    beta, delta = 150.0, 0.8
    side = np.sign(displacement())
    loop = branches(recorded(700.0 * np.tanh(beta * velocity() + delta * side)))
    exact = np.arccosh(2.0 + np.cosh(2.0 * delta)) / beta
    assert loop.width == pytest.approx(exact, rel=0.01)
    middle = loop.abscissa.size // 2
    np.testing.assert_allclose(loop.thickness[:, middle], 2.0 * 700.0 * np.tanh(delta), rtol=0.01)


def test_without_a_loop_there_is_no_width() -> None:
    assert np.isnan(branches(recorded(velocity()), force=np.zeros(TIME.size)).width)
    # The thickness of a spring falls to its half close to the largest velocity, that of dry friction nowhere.
    assert branches(recorded(STIFFNESS * displacement())).width == pytest.approx(
        2.0 * np.sqrt(0.75) * AMPLITUDE * OMEGA, rel=0.01
    )
    friction = 100.0 * np.sign(displacement())
    assert np.isnan(branches(recorded(friction)).width)


def test_noise_scatters_the_cycles_by_what_the_docstring_says() -> None:
    noise = 5.0
    rng = np.random.default_rng(0)
    scatter = [branches(recorded(noise * rng.standard_normal(TIME.size))).thickness for _ in range(60)]
    deviation = np.std(np.concatenate(scatter), axis=0)
    # 240 cycles: a standard deviation scatters by 5 %, and there are 81 of them.
    assert np.all((0.8 * noise < deviation) & (deviation < 1.2 * np.sqrt(2.0) * noise))


def test_a_late_force_adds_to_the_thickness_what_the_docstring_says() -> None:
    late = 5
    force = 300.0 * np.tanh(40.0 * velocity())
    loop = branches(recorded(np.roll(force, late)))
    middle = loop.abscissa.size // 2
    delay = late / (FREQUENCY * PER_CYCLE)
    expected = 2.0 * delay * AMPLITUDE * OMEGA**2 * 300.0 * 40.0
    np.testing.assert_allclose(loop.thickness[:, middle], expected, rtol=0.05)
    assert np.all(np.abs(branches(recorded(force)).thickness[:, middle]) < 0.02 * abs(expected))


def test_a_force_on_the_same_motion_is_split_alike() -> None:
    first, second = 100.0 * velocity(), 300.0 * velocity()
    given = branches(recorded(first), force=second)
    own = branches(recorded(second))
    np.testing.assert_array_equal(given.mean, own.mean)
    np.testing.assert_array_equal(given.abscissa, own.abscissa)


def test_samples_before_the_damper_has_settled_do_not_count() -> None:
    force = np.where(TIME < 1.5, 1e6, 100.0 * velocity())
    test = replace(recorded(force), n_settle=int(1.5 * PER_CYCLE))
    assert np.all(np.abs(branches(test).positive) < 1e3)


def test_a_motion_without_cycles_has_no_branches() -> None:
    test = recorded(velocity())
    rng = np.random.default_rng(0)
    for other in (
        replace(test, n_settle=4 * PER_CYCLE),
        replace(test, n_settle=TIME.size),
        replace(test, displacement=np.cumsum(rng.standard_normal(TIME.size))),
    ):
        with pytest.raises(RecordError, match="not periodic"):
            branches(other)
