"""Additions to a building: isolators, tuned mass, viscous dampers, brace."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from refusals import refusal
from scipy.linalg import solve_continuous_lyapunov

from mrwork.buildings import (
    Building,
    building,
    shear_building,
    with_base_isolation,
    with_base_isolation_of_period,
    with_brace,
    with_modal_damping,
    with_optimal_tuned_mass,
    with_tuned_mass,
    with_viscous_damper,
)
from mrwork.buildings.passive_devices import TUNINGS, den_hartog, warburton

UTS = building("uts")


def isolated() -> Building:
    return with_base_isolation_of_period(UTS, mass=400.0, period=2.0, ratio=0.1)


def tuned() -> Building:
    return with_optimal_tuned_mass(UTS, floor=5, mass_ratio=0.02)


def braced() -> Building:
    return with_brace(UTS, storey=1, stiffness=5e6, mass=0.3, damping=100.0)


def damped() -> Building:
    return with_viscous_damper(UTS, storey="storey 1", damping=2e3)


ADDITIONS: tuple[Callable[[], Building], ...] = (isolated, tuned, braced, damped)


def response(
    frame: Building, omega: NDArray[np.float64], rows: NDArray[np.float64]
) -> NDArray[np.complex128]:
    """Frequency response of rows of coordinates to a unit ground acceleration, shape (n_omega, n_rows)."""
    pushed = frame.mass @ frame.influence
    return np.stack(
        [
            -rows @ np.linalg.solve(frame.stiffness + 1j * w * frame.damping - w**2 * frame.mass, pushed)
            for w in omega
        ]
    )


@pytest.mark.parametrize("add", ADDITIONS)
def test_an_addition_leaves_floors_and_storeys_where_they_were(add: Callable[[], Building]) -> None:
    changed = add()
    for name, row in zip(UTS.floor_names, UTS.floors, strict=True):
        assert changed.floor_row(name) @ changed.influence == pytest.approx(row @ UTS.influence)
    assert set(UTS.storey_names) <= set(changed.storey_names)
    assert len(changed.chain) == len(changed.storeys) - changed.n_strokes
    assert set(UTS.drift_names) == set(changed.drift_names)
    assert changed.status == "ours"
    assert "added" in changed.source


@pytest.mark.parametrize("add", ADDITIONS)
def test_an_addition_never_makes_a_building_unstable(add: Callable[[], Building]) -> None:
    assert (add().poles.real < 0.0).all()


@pytest.mark.parametrize("add", [tuned, braced, damped])
def test_additions_can_be_put_on_each_other(add: Callable[[], Building]) -> None:
    twice = with_brace(
        with_base_isolation(add(), mass=300.0, stiffness=1e5, damping=1e3), storey=1, stiffness=1e6, mass=1.0
    )
    assert twice.storey_names[0] == "isolation"
    assert twice.storey_names[-1] == "damper in isolation"
    assert twice.floor_names[0] == "base"
    np.testing.assert_allclose(twice.floors @ twice.influence, 1.0)
    strained = twice.storeys @ twice.influence
    np.testing.assert_allclose(strained[0], 1.0)
    np.testing.assert_allclose(strained[1:-1], 0.0, atol=1e-12)


def test_a_stiff_building_on_isolators_has_their_period_and_damping() -> None:
    rigid = with_modal_damping(
        shear_building(name="rigid", masses=[1e3, 2e3], stiffnesses=[1e12, 1e12]), ratios=[0.02]
    )
    on_isolators = with_base_isolation_of_period(rigid, mass=500.0, period=2.5, ratio=0.15)
    assert 1.0 / on_isolators.frequencies[0] == pytest.approx(2.5, rel=1e-6)
    assert on_isolators.damping_ratios[0] == pytest.approx(0.15, rel=1e-6)


def test_isolators_as_stiff_as_rock_give_the_fixed_building_back() -> None:
    fixed = with_base_isolation(UTS, mass=400.0, stiffness=1e13, damping=0.0)
    omega = 2.0 * np.pi * np.array([0.5, 2.9, 3.1, 9.0, 15.0])
    np.testing.assert_allclose(
        response(fixed, omega, fixed.floors[1:]), response(UTS, omega, UTS.floors), rtol=1e-5
    )
    np.testing.assert_allclose(
        response(fixed, omega, fixed.storeys[1:]), response(UTS, omega, UTS.storeys), rtol=1e-5
    )


def test_a_shear_frame_on_isolators_is_a_shear_frame_with_one_storey_more() -> None:
    frame = shear_building(name="two", masses=[2.0, 1.0], stiffnesses=[30.0, 20.0], storey_damping=[0.3, 0.2])
    taller = shear_building(
        name="three", masses=[5.0, 2.0, 1.0], stiffnesses=[7.0, 30.0, 20.0], storey_damping=[0.9, 0.3, 0.2]
    )
    on_isolators = with_base_isolation(frame, mass=5.0, stiffness=7.0, damping=0.9)
    for field in ("mass", "damping", "stiffness", "influence", "floors", "storeys"):
        np.testing.assert_allclose(getattr(on_isolators, field), getattr(taller, field), atol=1e-12)


def test_the_two_peaks_of_den_hartogs_tuning_are_equally_high() -> None:
    # Criterion of Den Hartog: his damping places the peaks of the curve close to its fixed points. The structure is
    # undamped, and the force acts on it alone, unlike a ground motion.
    mu = 0.05
    (f, ratio), g = den_hartog(mu, 0.0), np.linspace(0.6, 1.4, 4001)
    top = (2.0 * ratio * f * g) ** 2 + (g**2 - f**2) ** 2
    bottom = (2.0 * ratio * f * g) ** 2 * (g**2 - 1.0 + mu * g**2) ** 2 + (
        mu * f**2 * g**2 - (g**2 - 1.0) * (g**2 - f**2)
    ) ** 2
    curve = np.sqrt(top / bottom)
    peaks = curve[1:-1][(curve[1:-1] > curve[:-2]) & (curve[1:-1] > curve[2:])]
    assert len(peaks) == 2
    assert peaks[0] == pytest.approx(peaks[1], rel=0.01)
    # At the fixed points the amplification is sqrt(1 + 2 / mu).
    assert peaks.max() == pytest.approx(np.sqrt(1.0 + 2.0 / mu), rel=0.01)


def variance(frequency_ratio: float, damping_ratio: float, mu: float) -> float:
    """Variance of the displacement of an undamped mass with a tuned mass under white ground acceleration."""
    single = shear_building(name="single", masses=[1.0], stiffnesses=[1.0])
    both = with_tuned_mass(
        single, floor=1, mass=mu, frequency=frequency_ratio / (2.0 * np.pi), ratio=damping_ratio
    )
    A, _, E = both.state_matrices()
    return float(solve_continuous_lyapunov(A, -np.outer(E, E))[0, 0])


def test_no_tuning_beside_warburtons_has_less_displacement_under_white_ground_motion() -> None:
    mu = 0.03
    optimum, ratio = warburton(mu, 0.0)
    least = variance(optimum, ratio, mu)
    for factor in (0.98, 1.02):
        assert variance(factor * optimum, ratio, mu) > least
        assert variance(optimum, factor * ratio, mu) > least


def test_sadeks_tuning_damps_both_modes_alike() -> None:
    mu, beta = 0.05, 0.02
    single = shear_building(name="single", masses=[1.0], stiffnesses=[1.0], storey_damping=[2.0 * beta])
    optimum, ratio = TUNINGS["sadek"](mu, beta)
    # By hand, with sqrt(0.05 / 1.05) = 0.21822.
    assert (optimum, ratio) == pytest.approx((0.94822, 0.23727), rel=1e-4)
    both = with_tuned_mass(single, floor=1, mass=mu, frequency=optimum / (2.0 * np.pi), ratio=ratio)
    ratios = -both.poles.real / np.abs(both.poles)
    # The published rule is a fit: the two ratios agree within a tenth, with the mean of beta and the tuned mass ratio.
    assert ratios.min() == pytest.approx(ratios.max(), rel=0.1)
    assert ratios.mean() == pytest.approx((beta + ratio) / 2.0, rel=0.05)


@pytest.mark.parametrize("tuning", TUNINGS)
def test_a_tuned_mass_lowers_the_peak_of_the_mode_it_is_tuned_to(tuning: str) -> None:
    both = with_optimal_tuned_mass(UTS, floor="floor 5", mass_ratio=0.02, tuning=tuning)
    omega = 2.0 * np.pi * np.linspace(2.5, 3.5, 400)
    bare = np.abs(response(UTS, omega, UTS.floors)[:, -1]).max()
    assert np.abs(response(both, omega, both.floors)[:, -1]).max() < 0.25 * bare


def test_the_stroke_of_a_tuned_mass_is_told_and_is_no_drift() -> None:
    both = tuned()
    assert both.storey_names[-1] == "tuned mass"
    assert both.n_strokes == 1
    np.testing.assert_array_equal(both.storeys[-1], [0.0, 0.0, 0.0, 0.0, -1.0, 1.0])
    assert len(both.drifts) == len(both.floors) == 5


def test_a_viscous_damper_dissipates_its_damping_times_the_square_of_the_drift_rate() -> None:
    rate = np.random.default_rng(4).normal(size=5)
    extra = rate @ (damped().damping - UTS.damping) @ rate
    assert extra == pytest.approx(2e3 * float(UTS.storeys[0] @ rate) ** 2)


def test_a_viscous_damper_behind_a_brace_is_a_maxwell_element() -> None:
    # Force of k and c in series for a drift of frequency omega: k i omega c / (k + i omega c).
    stiffness, viscosity = 2e5, 3e3
    behind = with_viscous_damper(
        with_brace(UTS, storey=1, stiffness=stiffness, mass=1e-6),
        storey="damper in storey 1",
        damping=viscosity,
    )
    omega = 2.0 * np.pi * np.array([0.5, 2.0, 3.0, 10.0])
    drift, stroke = response(behind, omega, behind.storeys[[0, -1]]).T
    expected = stiffness / (stiffness + 1j * omega * viscosity)
    np.testing.assert_allclose(stroke / drift, expected, rtol=1e-6)


def test_a_brace_as_stiff_as_rock_leaves_the_whole_drift_to_its_damper() -> None:
    behind = with_viscous_damper(
        with_brace(UTS, storey=2, stiffness=1e13, mass=0.3), storey="damper in storey 2", damping=5e3
    )
    direct = with_viscous_damper(UTS, storey=2, damping=5e3)
    omega = 2.0 * np.pi * np.array([0.5, 3.0, 9.0])
    np.testing.assert_allclose(
        response(behind, omega, behind.floors), response(direct, omega, direct.floors), rtol=1e-6
    )


def test_an_addition_that_cannot_be_is_refused() -> None:
    refusal(with_optimal_tuned_mass, UTS, floor=5, mass_ratio=5.0, match="8.94 times the mass of mode 1")
    refusal(with_optimal_tuned_mass, UTS, floor=5, mass_ratio=0.02, mode=6, match="from 1 to 5")
    refusal(with_optimal_tuned_mass, UTS, floor=5, mass_ratio=0.02, tuning="villaverde", match="den_hartog")
    refusal(with_brace, braced(), storey=1, stiffness=1e6, mass=1.0, match="'damper in storey 1'")
    refusal(with_viscous_damper, UTS, storey="penthouse", damping=1.0, match="no storey 'penthouse'")
