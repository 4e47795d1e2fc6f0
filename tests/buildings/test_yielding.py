"""Frames that yield: what is simulated beside the elastic matrices, P-delta, and the push sideways."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from loop_samples import nothing
from refusals import refusal

import mrwork as mr
from mrwork.base.values import Floats

of = mr.buildings
MASSES, STIFFNESSES, HEIGHTS = [3e4, 2e4], [2e7, 1.5e7], [4.0, 3.0]
YIELD = 0.01


def frame() -> mr.Building:
    built = of.shear_building(name="frame", masses=MASSES, stiffnesses=STIFFNESSES, heights=HEIGHTS)
    return of.with_rayleigh_damping(built, ratios=(0.03, 0.03))


def yielding(sharpness: float = 4.0) -> mr.Building:
    return of.with_storeys_that_yield(
        frame(), yield_drift=YIELD, post_yield_ratio=[0.05, 0.1], sharpness=sharpness
    )


def shaken(building: mr.Building, peak: float) -> mr.Responses:
    """Without dampers, under a pulse that rings and rests."""
    time = np.arange(0.0, 6.0, 0.01)
    pulse = mr.GroundMotion(
        name="pulse", dt=0.01, acceleration=peak * np.sin(12.0 * time) * np.exp(-1.5 * time)
    )
    return mr.simulate_loop(building, *nothing(building), [pulse], histories=True)


def test_loops_take_the_place_of_their_stiffness_and_the_matrices_stay_elastic() -> None:
    elastic, yields = frame(), of.with_p_delta(yielding())
    np.testing.assert_array_equal(yields.stiffness, elastic.stiffness)
    np.testing.assert_array_equal(yields.periods, elastic.periods)
    rows = elastic.storeys
    loops = sum(
        each.yield_force / each.yield_displacement * np.outer(each.row, each.row) for each in yields.elements
    )
    weights = mr.closed_loop.STANDARD_GRAVITY * np.array([sum(MASSES), MASSES[1]])
    np.testing.assert_allclose(yields.loads, weights)
    geometric = rows.T @ np.diag(weights / HEIGHTS) @ rows
    np.testing.assert_allclose(yields.site_stiffness + loops + geometric, elastic.stiffness, rtol=1e-12)


def test_storeys_yield_at_a_drift_at_a_share_of_their_height_or_at_a_shear() -> None:
    ratio = of.with_storeys_that_yield(frame(), yield_drift_ratio=0.005)
    np.testing.assert_allclose(ratio.yield_drifts, [0.02, 0.015])
    shear = of.with_storeys_that_yield(frame(), yield_shear=[4e5, 1.5e5])
    np.testing.assert_allclose(shear.yield_drifts, [0.02, 0.01])


def test_a_frame_that_hardly_moves_is_elastic() -> None:
    small = shaken(yielding(), 0.05), shaken(frame(), 0.05)
    np.testing.assert_allclose(small[0].peak_drift, small[1].peak_drift, rtol=1e-6)
    np.testing.assert_allclose(small[0].peak_frame_shear, small[1].peak_frame_shear, rtol=1e-6)


def test_a_frame_that_yields_moves_as_in_plain_steps() -> None:
    """Runge-Kutta of the same equations, written once more."""
    building = of.with_p_delta(yielding())
    found = shaken(building, 12.0)
    history = (found.histories or ())[0]
    assert found.peak_drift.max() > 3.0 * YIELD
    ground = history.ground_acceleration
    loops = [each.numbers[3:6] for each in building.elements]

    def slopes(state: Floats, pushed: float) -> Floats:
        q, v, w = state.reshape(3, 2)
        rate = building.storeys @ v
        turning = np.array(
            [
                (r - 0.5 * (abs(r) * abs(x) ** (n - 1.0) * x + r * abs(x) ** n)) * slope
                for r, x, (_, slope, n) in zip(rate, w, loops, strict=True)
            ]
        )
        resisting = (
            building.site_stiffness @ q
            + building.damping @ v
            + building.storeys.T @ (w * [force for force, *_ in loops])
        )
        return np.concatenate([v, -resisting / MASSES - pushed, turning])

    step, state, drifts = float(history.time[1]), np.zeros(6), [np.zeros(2)]
    for start, end in pairwise(ground):
        middle = 0.5 * (start + end)
        first = slopes(state, start)
        second = slopes(state + 0.5 * step * first, middle)
        third = slopes(state + 0.5 * step * second, middle)
        state = state + step / 6.0 * (first + 2.0 * (second + third) + slopes(state + step * third, end))
        drifts.append(building.storeys @ state[:2])
    # The core takes two steps where this takes one.
    np.testing.assert_allclose(history.drift, drifts, atol=2e-6)


def test_what_the_frame_dissipates_is_the_work_on_it_less_what_it_gives_back() -> None:
    found = shaken(yielding(), 12.0)
    balance = found.input_energy - found.kinetic_energy - found.strain_energy - found.damping_energy
    np.testing.assert_allclose(found.element_energy.sum(axis=1), balance, rtol=1e-6)
    # At rest the loops hold what their force at the end says: f^2 / (2 k).
    history = (found.histories or ())[0]
    building = yielding()
    springs = [each.stiffness for each in building.elements]
    held = [
        (force - spring * drift) ** 2 / (2.0 * each.yield_force / each.yield_displacement)
        for force, spring, drift, each in zip(
            history.element_force[-1], springs, history.drift[-1], building.elements, strict=True
        )
    ]
    np.testing.assert_allclose(found.storey_energy[0], found.element_energy[0] - held, rtol=1e-3)
    np.testing.assert_allclose(found.residual_drift[0], history.drift[-1], atol=1e-5)


def test_laws_are_designed_for_the_elastic_frame() -> None:
    rows = frame().storeys
    plants = [mr.control.plant_of(each, rows[:1], ["one"]) for each in (frame(), of.with_p_delta(yielding()))]
    np.testing.assert_array_equal(plants[0].A, plants[1].A)


@pytest.mark.parametrize("weight", [0.0, 1e6])
def test_a_storey_that_is_pushed_follows_its_loop(weight: float) -> None:
    """With the sharpness 1 the loop is 1 - exp(-d / d_y)."""
    one = of.shear_building(name="one", masses=[1e4], stiffnesses=[1e7], heights=[4.0])
    one = replace(one, loads=np.array([weight]))
    yields = of.with_storeys_that_yield(one, yield_shear=1e5, post_yield_ratio=0.1, sharpness=1.0)
    found = of.pushover(yields, roof=0.06, steps=400)
    carried = 0.1 * 1e7 * found.roof + 0.9 * 1e5 * (1.0 - np.exp(-found.roof / 0.01))
    np.testing.assert_allclose(found.shears[:, 0], carried, rtol=1e-4)
    np.testing.assert_allclose(found.base_shear, carried - weight / 4.0 * found.roof, rtol=1e-4)


def test_a_push_begins_with_the_elastic_frame_and_reaches_what_is_asked_for() -> None:
    found = of.pushover(yielding(), pattern="uniform")
    building = frame()
    force = np.array(MASSES) / sum(MASSES)
    elastic = 1.0 / float(building.floors[-1] @ np.linalg.solve(building.stiffness, force))
    assert found.base_shear[1] / found.roof[1] == pytest.approx(elastic, rel=1e-3)
    assert found.roof[-1] == pytest.approx(0.04 * sum(HEIGHTS))
    # In equilibrium with the forces above each storey.
    np.testing.assert_allclose(found.shears[:, 1], found.base_shear * force[1], rtol=2e-3, atol=10.0)


@pytest.mark.parametrize("weighs", [False, True])
def test_a_frame_without_stiffness_after_yield_ends_at_its_strength_or_falls(weighs: bool) -> None:
    tall = of.shear_building(name="tall", masses=[5e4] * 10, stiffnesses=[6e7] * 10, heights=[3.5] * 10)
    plastic = of.with_storeys_that_yield(tall, yield_drift=0.02, post_yield_ratio=0.0)
    found = of.pushover(of.with_p_delta(plastic) if weighs else plastic, pattern="uniform")
    strength = 6e7 * 0.02
    assert found.base_shear.max() == pytest.approx(strength, rel=0.1 if weighs else 1e-6)
    # It falls where the weight on the lowest storey overturns what that carries.
    falls = strength * 3.5 / (5e5 * 9.80665)
    assert found.drifts[-1, 0] == pytest.approx(falls if weighs else 0.04 * 35.0 - 0.018 * 9, rel=0.1)
    assert (found.base_shear[-1] <= 0.0) == weighs


def test_shears_and_springs_are_those_of_the_storeys_also_with_additions() -> None:
    braced = of.with_brace(frame(), storey=1, stiffness=1e8, mass=10.0)
    tuned = of.with_tuned_mass(braced, floor=2, mass=500.0, frequency=2.0, ratio=0.1)
    slab = of.with_base_isolation(tuned, mass=5e3, stiffness=1e6, damping=1e4)
    np.testing.assert_allclose(tuned.storey_springs[:2], STIFFNESSES)
    np.testing.assert_allclose(slab.storey_springs[:3], [1e6, *STIFFNESSES])
    above = slab.unit_drifts @ slab.mass @ slab.influence
    np.testing.assert_allclose(above[:3], [5e3 + 5e4 + 500.0, 5e4 + 500.0, 2e4 + 500.0])
    assert not mr.building("sac3").storey_springs.any()


BARE = replace(frame(), heights=np.empty(0))
YIELDS_AT = {"yield_drift": 0.01}


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: of.with_storeys_that_yield(mr.building("sac3"), **YIELDS_AT), "no chain of floors"),
        (lambda: of.with_storeys_that_yield(BARE, yield_drift_ratio=0.005), "stands on heights"),
        (lambda: of.with_p_delta(BARE), "P-delta stands on heights"),
        (
            lambda: of.with_p_delta(replace(frame(), stiffness=1e-3 * frame().stiffness)),
            "falls under its weight: in storey 1 P / h is 1.226e.05",
        ),
        (lambda: of.pushover(of.modal_truncation(frame(), n_modes=1)), "a pushover is of one"),
        (lambda: replace(BARE, loads=np.array([1.0, 1.0])), "heights of the storeys"),
        (lambda: of.with_storeys_that_yield(yielding(), **YIELDS_AT), "yield already"),
        (
            lambda: replace(yielding(), stiffness=0.5 * frame().stiffness).check(),
            "stiffer than the stiffness matrix",
        ),
    ],
)
def test_frames_that_cannot_yield_or_stand_are_refused(call: Callable[[], object], word: str) -> None:
    refusal(call, match=word)
