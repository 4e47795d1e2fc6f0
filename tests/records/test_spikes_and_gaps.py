"""Samples that no sensor gave, in spikes and gaps, are told, and neither compared nor part of the tested ranges."""

from dataclasses import replace

import numpy as np
import pytest
from record_files import AMPLITUDE, DT, FREQUENCY, Columns, built, clean_columns, codes, message
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.dampers import damper
from mrwork.records import Observation, cut
from mrwork.records.damper_test import range_of_test
from mrwork.records.reading import SYNTHETIC_TESTS, synthetic_test
from mrwork.records.repairs import repair
from mrwork.records.window import spikes_of

MODEL = "viscous_dahl"
# Samples, in the middle of the record, and their height by the largest one.
PLACES = {
    "three apart": ((150, 210, 300), 12.0),
    "three in a row": ((200, 201, 202), -2.5),
    "one": ((250,), 12.0),
}


def noisy_columns() -> Columns:
    """A record of a Dahl damper at its published parameters, with the noise of a good rig."""
    columns = clean_columns()
    spec = damper(MODEL)
    motion = {"displacement": columns["displacement_m"], "velocity": columns["velocity_mps"]}
    rng = np.random.default_rng(1)
    force = mr.simulate_force(spec, spec.nominal, mr.Loading(dt=DT, **motion))
    return columns | {"force_n": force + 8.0 * rng.standard_normal(force.size)}


def with_spikes(columns: Columns, places: tuple[int, ...], channel: str, times: float) -> Columns:
    samples = columns[channel].copy()
    samples[list(places)] = times * np.abs(samples).max()
    return columns | {channel: samples}


def without(columns: Columns, first: int, last: int) -> Columns:
    kept = np.ones(columns["t_s"].size, dtype=bool)
    kept[first:last] = False
    return {name: samples[kept] for name, samples in columns.items()}


def within_errors(fit: mr.Fit) -> bool:
    """Whether the estimates are the parameters of the record within four standard errors."""
    return all(
        each.standard_error is not None and abs(each.value - true) < 4.0 * each.standard_error
        for each, true in zip(fit.estimates, damper(MODEL).nominal, strict=True)
    )


@pytest.mark.parametrize("channel", ["force_n", "displacement_m", "velocity_mps"])
@pytest.mark.parametrize(("places", "times"), PLACES.values(), ids=PLACES)
def test_spikes_change_neither_fit_nor_tested_ranges(
    channel: str, places: tuple[int, ...], times: float
) -> None:
    columns = noisy_columns()
    clean, test = built(columns), built(with_spikes(columns, places, channel, times))
    assert codes(test) == ["spikes"]
    compared = np.arange(test.n_time)[test.counted]
    assert not set(places) & set(compared.tolist())
    assert test.n_counted == clean.n_counted - len(places)
    ranges = [range_of_test(each, None) for each in (clean, test)]
    assert ranges[1].force == pytest.approx(ranges[0].force, rel=0.02)
    assert ranges[1].velocity == pytest.approx(ranges[0].velocity, rel=0.02)
    assert ranges[1].stroke == pytest.approx(ranges[0].stroke, rel=0.02)
    fit = mr.identify(MODEL, test, threads=1)
    assert within_errors(fit)
    assert fit.quality[0].n_time == test.n_counted


@pytest.mark.parametrize("name", SYNTHETIC_TESTS)
def test_a_good_record_has_no_spikes(name: str) -> None:
    test = synthetic_test(name)
    for channel in (test.displacement, test.velocity, test.force):
        assert not spikes_of(channel).any()


@pytest.mark.parametrize("per_cycle", [8, 20, 400])
def test_steps_reversals_and_rest_are_no_spikes(per_cycle: int) -> None:
    phase = 2.0 * np.pi * np.arange(10 * per_cycle) / per_cycle
    rest = np.zeros(10 * per_cycle)
    for force in (np.sign(np.sin(phase)), np.tanh(20.0 * np.sin(phase)), np.sin(phase) ** 7):
        assert not spikes_of(force).any()
        assert not spikes_of(np.concatenate([rest, force, rest])).any()


def test_a_gap_is_not_compared_nor_the_force_that_depends_on_its_motion() -> None:
    columns = noisy_columns()
    first, last = 150, 210
    test = built(without(columns, first, last))
    assert codes(test) == ["gaps", "resampled"]
    assert "is not compared" in message(test, "gaps")
    ((begin, end),) = test.uncompared
    assert begin == first
    travel = np.abs(np.diff(test.displacement[last:end])).sum()
    assert travel == pytest.approx(0.5 * np.ptp(test.displacement), rel=0.1)
    # Straight across the gap the velocity says nothing of whether the columns belong together.
    fit = mr.identify(MODEL, test, threads=1)
    assert within_errors(fit)


def test_a_gap_of_a_few_samples_costs_a_few_samples() -> None:
    test = built(without(noisy_columns(), 200, 204))
    ((begin, end),) = test.uncompared
    assert (begin, end <= 215) == (200, True)


def test_the_spans_move_with_a_part_of_the_record() -> None:
    test = built(with_spikes(noisy_columns(), (200, 201, 202, 250), "force_n", 9.0))
    assert test.uncompared == ((200, 203), (250, 251))
    assert test.part(190, 240).uncompared == ((10, 13),)
    assert test.part(201, 400, 2).uncompared == ((0, 1),)
    part = test.part(200, 400, 2)
    assert (part.uncompared, part.dt) == (((0, 2), (25, 26)), 2.0 * test.dt)
    assert part.start_time == pytest.approx(200 * DT)
    assert test.part(203, 250).uncompared == ()
    shorter = cut(test, start=190 * DT)
    assert shorter.uncompared == ((10, 13), (60, 61))


def test_every_path_of_the_misfit_leaves_the_spans_out() -> None:
    """A force that is wrong in them alone changes no misfit, no residual and no derivative."""
    spec = damper(MODEL)
    theta = np.array([spec.nominal, 1.1 * np.array(spec.nominal)])
    test = sinusoidal_test(MODEL, spec.nominal, (AMPLITUDE, FREQUENCY), noise=0.01)
    spans = ((70, 75), (100, 120))
    wrong = test.force.copy()
    for first, last in spans:
        wrong[first:last] = 1e5
    for observation in (Observation(), Observation(average_seconds=0.02)):
        found = [
            mr.identification.Objective.of(
                spec, (replace(test, force=force, uncompared=spans, observation=observation),), threads=1
            )
            for force in (test.force, wrong)
        ]
        one, other = found
        np.testing.assert_array_equal(one(theta), other(theta))
        shares = np.ones((2, 1))
        np.testing.assert_array_equal(one(theta, shares), other(theta, shares))
        np.testing.assert_array_equal(one.residuals(theta), other.residuals(theta))
        np.testing.assert_allclose(np.linalg.norm(one.residuals(theta), axis=1), one(theta), rtol=1e-12)
        assert one.residuals(theta).shape[1] == one.tests[0].n_counted


def corner_test(displacement: np.ndarray, velocity: np.ndarray, dt: float) -> mr.records.DamperTest:
    """2000 v + 5000 x with noise of 2 um and of 1 N."""
    rng = np.random.default_rng(20)
    noisy = displacement + rng.normal(0.0, 2e-6, displacement.size)
    force = 2000.0 * velocity + 5000.0 * displacement + rng.normal(0.0, 1.0, displacement.size)
    return mr.test_from_arrays(dt * np.arange(displacement.size), noisy, force)


def test_corners_of_a_ramp_are_not_compared_and_leave_its_stiffness_right() -> None:
    time = 1e-3 * np.arange(20_000)
    displacement = np.interp(time, [0.0, 1.0, 1.2], [0.0, 0.0, 0.02])
    test = corner_test(displacement, np.where((time >= 1.0) & (time < 1.2), 0.1, 0.0), 1e-3)
    (told,) = [remark for remark in test.remarks if remark.code == "velocity_leaps"]
    assert told.measured is not None
    assert told.measured.value == sum(last - first for first, last in test.uncompared) < 40
    assert "2 times, first at 1 s" in told.message
    given = replace(
        test, velocity=test.velocity + 1e-3, velocity_source="measured", uncompared=(), remarks=()
    )
    repaired, _ = repair(given, ["velocity"])
    assert repaired.uncompared == test.uncompared
    columns = np.stack([test.velocity, test.displacement, np.ones(test.n_time)], axis=1)[test.counted]
    found = np.linalg.lstsq(columns, test.force[test.counted], rcond=None)[0]
    errors = np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
    # With these samples the stiffness is 5 % low, by nine standard errors.
    assert abs(found[1] - 5000.0) < 3.0 * errors[1]


@pytest.mark.parametrize(("noise", "source"), [(None, "derived"), (0.0, "measured"), (2e-4, "derived")])
def test_a_loop_keeps_its_state_through_a_corner_for_the_rest_of_the_record(
    noise: float | None, source: str
) -> None:
    # Two cycles that end at full speed, and rest. The force is of a step forty times finer.
    spec = mr.damper("normalised_bouc_wen")
    theta = np.array(
        [
            {"c": 1e3, "k": 0.0, "x0": 0.0, "k_w": 700.0, "rho": 800.0, "sigma": 0.5, "n": 1.0}[name]
            for name in spec.names
        ]
    )
    time = 5e-5 * np.arange(160_000)
    moves = time < 2.0 - 1e-9
    displacement = np.where(moves, 0.01 * np.sin(2.0 * np.pi * time), 0.0)
    velocity = np.where(moves, 0.02 * np.pi * np.cos(2.0 * np.pi * time), 0.0)
    exact = mr.simulate_force(spec, theta, mr.Loading(dt=5e-5, displacement=displacement, velocity=velocity))
    rng = np.random.default_rng(1)
    noisy = displacement[::40] + 1e-6 * rng.standard_normal(4000)
    measured = None if noise is None else velocity[::40] + noise * rng.standard_normal(4000)
    test = mr.test_from_arrays(time[::40], noisy, exact[::40] + rng.standard_normal(4000), velocity=measured)
    # Noise of a velocity at rest makes the loop forget its force.
    assert test.velocity_source == source
    assert "velocity_leaps" in codes(test)
    force = mr.simulate_force(spec, theta, mr.Loading(dt=2e-3, displacement=noisy, velocity=test.velocity))
    # A derivative across the corner has waves of which the loop keeps 11 N.
    assert abs(np.mean((test.force - force)[1100:])) < 2.0


def test_a_triangle_has_no_mass_and_tells_friction_from_no_dashpot() -> None:
    time = 2e-3 * np.arange(4000)
    phase = (0.5 * time) % 1.0
    displacement, way = 0.02 * (1.0 - 4.0 * np.abs(phase - 0.5)), np.where(phase < 0.5, 1.0, -1.0)
    rng = np.random.default_rng(4)
    noisy = displacement + 3e-6 * rng.standard_normal(time.size)
    test = mr.test_from_arrays(time, noisy, 500.0 * way + 2.0 * rng.standard_normal(time.size))
    assert "moving_mass" not in codes(test)
    told = {each.code: each.measured for each in mr.identify("bingham", test).remarks}
    assert "damper_linear" not in told
    assert (speed := told["one_speed"]) is not None
    assert speed.value == pytest.approx(40.0, rel=0.01)


@pytest.mark.parametrize("dt", [5e-3, 1e-3, 2e-4])
def test_a_smooth_motion_has_no_corners(dt: float) -> None:
    omega = 2.0 * np.pi * 2.0
    time = dt * np.arange(round(3.0 / dt))
    test = corner_test(0.01 * np.sin(omega * time), 0.01 * omega * np.cos(omega * time), dt)
    assert not test.uncompared
    assert "velocity_leaps" not in codes(test)


def test_a_corner_without_a_leap_of_the_force_is_compared() -> None:
    time = 1e-3 * np.arange(4000)
    triangle = 0.01 * (1.0 - 2.0 * np.abs(time % 1.0 - 0.5))
    rng = np.random.default_rng(3)
    test = mr.test_from_arrays(
        time,
        triangle + rng.normal(0.0, 2e-6, time.size),
        5e4 * triangle + rng.normal(0.0, 1.0, time.size),
    )
    assert not test.uncompared
