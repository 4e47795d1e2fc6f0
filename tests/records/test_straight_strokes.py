"""Slow loops of few samples a stroke: the motion is straight between samples, and these alone are compared."""

import itertools
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from record_files import codes

import mrwork as mr
from mrwork.identification.suspicious import force_noise

Floats = NDArray[np.float64]
# Turning points of a protocol of growing strokes [m].
TURNS = 1e-3 * np.array([0.0, 20, -20, 20, -20, 40, -40, 40, -40, 60, -60, 60, -60, 0.0])
K, K_W, RHO, SIGMA, N = 2e5, 5e4, 60.0, 0.5, 2.0
NOISE = 300.0


def strokes(per_stroke: int = 20) -> Floats:
    parts = [
        np.linspace(first, last, per_stroke, endpoint=False) for first, last in itertools.pairwise(TURNS)
    ]
    return np.append(np.concatenate(parts), TURNS[-1])


def slow_loop(displacement: Floats) -> Floats:
    """Force of a loop that does not depend on the speed, integrated along straight lines in a hundred steps each."""
    state, force = 0.0, [0.0]
    for before, after in itertools.pairwise(displacement):
        step = (after - before) / 100.0
        for _ in range(100):
            way = np.sign(step)
            state += step * RHO * (1.0 - (SIGMA * np.sign(way * state) + 1.0 - SIGMA) * abs(state) ** N)
        force.append(K * after + K_W * state)
    return np.array(force)


def test_the_motion_is_straight_between_samples_and_these_are_compared() -> None:
    displacement = strokes()
    test = mr.test_from_arrays(np.arange(displacement.size) * 1.0, displacement, slow_loop(displacement))
    assert "strokes_straight" in codes(test)
    assert test.dt == pytest.approx(1.0 / 8.0)
    np.testing.assert_allclose(test.displacement[::8], displacement)
    within = np.setdiff1d(np.arange(test.n_time), np.arange(0, test.n_time, 8))
    slopes = np.repeat(np.diff(displacement), 7)
    np.testing.assert_allclose(test.velocity[within], slopes, rtol=1e-9)
    compared = np.arange(test.n_time)[test.counted]
    assert (compared % 8 == 0).all()


def test_small_strokes_before_large_ones_are_no_rest() -> None:
    displacement = np.concatenate([0.02 * strokes(), strokes()[1:]])
    test = mr.test_from_arrays(np.arange(displacement.size) * 1.0, displacement, 1e6 * displacement)
    assert "rest_before_motion" not in codes(test)


@pytest.mark.parametrize("per_stroke", [10, 20, 45, 400])
def test_sines_and_well_sampled_strokes_are_as_they_were(per_stroke: int) -> None:
    time = np.arange(20 * per_stroke) * 1e-2
    sine = 0.01 * np.sin(np.pi * np.arange(time.size) / per_stroke)
    for displacement in (sine, strokes(400)[: time.size] if per_stroke == 400 else sine):
        test = mr.test_from_arrays(
            time[: displacement.size], displacement, 1e4 * displacement + 5e5 * displacement**3
        )
        assert "strokes_straight" not in codes(test)


@pytest.mark.long
def test_a_loop_that_does_not_depend_on_the_speed_has_no_dashpot() -> None:
    """A smooth curve through its samples gave a dashpot of eight standard errors, and k_w five errors low."""
    displacement = strokes()
    force = slow_loop(displacement) + NOISE * np.random.default_rng(2).standard_normal(displacement.size)
    test = mr.test_from_arrays(np.arange(displacement.size) * 1.0, displacement, force)
    assert force_noise((test,)) == pytest.approx(NOISE, rel=3.0)
    fit = mr.identify("normalised_bouc_wen", test, threads=2)
    found = {each.name: each for each in fit.estimates}
    for name, true in {"c": 0.0, "k": K, "k_w": K_W, "rho": RHO, "sigma": SIGMA, "n": N}.items():
        error = found[name].standard_error
        assert error is not None
        assert abs(found[name].value - true) < 4.0 * error, name


@pytest.mark.parametrize("step", ["1 s", "10 s"])
def test_a_slow_loop_at_a_stated_step_has_no_average_and_no_doubt_of_its_unit(
    tmp_path: Path, step: str
) -> None:
    """Twenty samples a stroke: what is put between them is no average, and who types seconds means them."""
    loop = np.r_[np.linspace(0.0, 10.0, 11), np.linspace(9.0, -10.0, 20), np.linspace(-9.0, 0.0, 10)]
    noise = np.random.default_rng(0).normal(0.0, 3.0, loop.size)
    force = 50.0 * loop + 300.0 * np.sign(np.gradient(loop)) + noise
    rows = np.column_stack([np.tile(loop, 3), np.tile(force, 3)])
    np.savetxt(tmp_path / "loop.csv", rows, "%.3f", ",", header="Displacement (mm),Force (N)", comments="")
    test = mr.read_damper_test(tmp_path / "loop.csv", columns={"time": step})
    found = {remark.code for remark in test.remarks}
    assert "strokes_straight" in found
    assert not found & {"moving_average", "motion_averaged", "time_unusual"}
    assert test.smoothing is None
