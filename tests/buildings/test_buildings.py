"""Building: refusals, modes, state matrices, shear frames and damping from ratios."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refusal
from scipy.io import savemat
from scipy.sparse import eye_array

from mrwork.buildings import (
    Building,
    building,
    pushover,
    read_building,
    shear_building,
    with_modal_damping,
    with_rayleigh_coefficients,
    with_rayleigh_damping,
)


@pytest.fixture
def frame() -> Building:
    return shear_building(
        name="frame",
        masses=[3.0, 2.0, 1.0],
        stiffnesses=[900.0, 600.0, 300.0],
        storey_damping=[3.0, 0.0, 1.0],
    )


def test_modes_diagonalise_mass_and_stiffness(frame: Building) -> None:
    modes, omega = frame.modes, 2.0 * np.pi * frame.frequencies
    np.testing.assert_allclose(modes.T @ frame.mass @ modes, np.eye(3), atol=1e-12)
    np.testing.assert_allclose(modes.T @ frame.stiffness @ modes, np.diag(omega**2), atol=1e-9)
    assert (np.diff(omega) > 0.0).all()


@pytest.mark.parametrize("n", [1, 5, 40])
def test_a_uniform_shear_frame_has_the_frequencies_of_its_closed_form(n: int) -> None:
    # omega_j = 2 sqrt(k / m) sin((2 j - 1) pi / (2 (2 n + 1))), Chopra, Dynamics of Structures, problem of ch. 12
    uniform = shear_building(name="uniform", masses=[2.0] * n, stiffnesses=[50.0] * n)
    exact = 2.0 * np.sqrt(25.0) * np.sin((2.0 * np.arange(1, n + 1) - 1.0) * np.pi / (2.0 * (2.0 * n + 1.0)))
    np.testing.assert_allclose(2.0 * np.pi * uniform.frequencies, exact, rtol=1e-9)


def test_a_floor_pushed_alone_strains_the_storeys_beside_it(frame: Building) -> None:
    displacement = np.array([0.0, 1.0, 0.0])
    np.testing.assert_allclose(frame.storeys @ displacement, [0.0, 1.0, -1.0])
    np.testing.assert_allclose(frame.stiffness @ displacement, [-600.0, 900.0, -300.0])
    np.testing.assert_allclose(frame.damping @ displacement, [0.0, 1.0, -1.0])


def test_state_matrices_are_the_equation_of_motion(frame: Building) -> None:
    rng = np.random.default_rng(1)
    q, rate, forces = rng.normal(size=(3, 3))
    ground = 0.7
    A, B, E = frame.state_matrices()
    slope = A @ np.concatenate([q, rate]) + B @ forces + E * ground
    balance = frame.mass @ slope[3:] + frame.damping @ rate + frame.stiffness @ q
    np.testing.assert_allclose(slope[:3], rate)
    np.testing.assert_allclose(balance, -frame.storeys.T @ forces - frame.mass @ frame.influence * ground)


def test_poles_and_ratios_agree_where_damping_is_classical(frame: Building) -> None:
    damped = with_modal_damping(frame, ratios=[0.01, 0.05, 0.1])
    poles = damped.poles[::2]
    np.testing.assert_allclose(np.abs(poles), 2.0 * np.pi * damped.frequencies, rtol=1e-9)
    np.testing.assert_allclose(-poles.real / np.abs(poles), [0.01, 0.05, 0.1], rtol=1e-9)
    np.testing.assert_allclose(damped.damping_ratios, [0.01, 0.05, 0.1], rtol=1e-9)


def test_rayleigh_damping_has_its_ratios_in_its_two_modes(frame: Building) -> None:
    damped = with_rayleigh_damping(frame, ratios=(0.02, 0.05), modes=(1, 3))
    ratios = damped.damping_ratios
    assert (ratios[0], ratios[2]) == (pytest.approx(0.02), pytest.approx(0.05))
    assert ratios[1] < 0.05


def test_the_rayleigh_coefficients_of_the_five_storey_frame_are_one_percent_in_modes_one_and_three() -> None:
    # The source gives a0 and a1 to six digits.
    uts = building("uts")
    again = with_rayleigh_damping(uts, ratios=(0.01, 0.01), modes=(1, 3))
    np.testing.assert_allclose(uts.damping, again.damping, rtol=1e-5, atol=1e-3)


def test_storeys_and_floors_are_found_by_number_and_by_name(frame: Building) -> None:
    np.testing.assert_array_equal(frame.storey_row(2), [-1.0, 1.0, 0.0])
    np.testing.assert_array_equal(frame.storey_row("storey 2"), frame.storey_row(2))
    np.testing.assert_array_equal(frame.floor_row("floor 3"), [0.0, 0.0, 1.0])
    for storey in (0, 4, "roof"):
        refusal(frame.storey_row, storey, match=f"no storey '?{storey}'?; give a number from 1 to 3")


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"mass": np.diag([3.0, 0.0, 1.0])}, "coordinate 2 is 0 kg"),
        ({"mass": np.ones((3, 3))}, "singular"),
        ({"mass": np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]])}, "not positive definite"),
        ({"stiffness": np.triu(np.ones((3, 3)))}, "entry 1, 2 is 1 and entry 2, 1 is 0"),
        ({"stiffness": -np.eye(3)}, "unstable"),
        ({"floor_names": ("a", "b", "a")}, "two floors are called 'a'"),
    ],
)
def test_what_cannot_be_a_building_is_refused(frame: Building, changes: dict[str, Any], word: str) -> None:
    refusal(lambda: replace(frame, **changes).check(), match=word)


def test_a_building_is_checked_once_where_it_is_first_needed(frame: Building) -> None:
    wrong = replace(frame, stiffness=-np.eye(3))
    for use in (lambda: wrong.periods, lambda: wrong.modes, wrong.state_matrices, wrong.check):
        refusal(use, match="unstable")
    refusal(with_rayleigh_damping, wrong, ratios=(0.02, 0.02), match="unstable")


def test_a_building_that_would_not_fit_into_memory_is_refused_at_once(
    frame: Building, tmp_path: Path
) -> None:
    refusal(replace, frame, mass=np.broadcast_to(1.0, (3001, 3001)), match="at most 3,000 coordinates")
    savemat(tmp_path / "large.mat", {"M": eye_array(3001, format="csc"), "K": eye_array(3001, format="csc")})
    refusal(read_building, tmp_path / "large.mat", match="at most 3,000 coordinates")


def test_a_shear_frame_that_cannot_be_is_refused() -> None:
    refusal(shear_building, masses=[1.0, 1.0], stiffnesses=[1.0], match="1 stiffnesses for 2 masses")
    refusal(shear_building, masses=[0.0], stiffnesses=[1.0], match="give a number above 0")


def test_damping_that_would_drive_a_mode_is_refused(frame: Building) -> None:
    refusal(with_rayleigh_coefficients, frame, a0=-10.0, a1=1e-3, match="drives mode 1")
    refusal(with_rayleigh_damping, frame, ratios=(0.02, 0.02), modes=(1, 1), match="two different modes")
    refusal(with_modal_damping, frame, ratios=[0.01, 0.02], match="2 numbers for 3 modes")
    refusal(with_modal_damping, frame, ratios=[2.0, 0.0, 0.0], match="from 0 to 1")


def test_a_mode_of_a_textbook_frame_has_the_base_shear_of_its_effective_mass() -> None:
    """The shear frame of Chopra's chapters 10 and 13: 2 m on 2 k and m on k, shapes (1/2, 1) and (-1, 1)."""
    m, k = 4e4, 2e7
    frame = shear_building(name="frame", masses=[2.0 * m, m], stiffnesses=[2.0 * k, k])
    squares = np.array([0.5, 2.0]) * k / m
    np.testing.assert_allclose(frame.periods, 2.0 * np.pi / np.sqrt(squares), rtol=1e-12)
    shapes = frame.modes / frame.modes[1]
    np.testing.assert_allclose(shapes, [[0.5, -1.0], [1.0, 1.0]], rtol=1e-12)
    np.testing.assert_allclose(frame.participation, [4.0 / 3.0, -1.0 / 3.0], rtol=1e-12)
    np.testing.assert_allclose(frame.effective_masses, [8.0 / 3.0 * m, m / 3.0], rtol=1e-12)
    # V_b1 = M_1 A_1 at the roof u = Gamma_1 D_1, A_1 = omega_1^2 D_1: (8/3 m) (k / 2 m) u / (4/3) = k u.
    pushed = pushover(frame, pattern="first mode", roof=0.01, steps=2)
    np.testing.assert_allclose(pushed.base_shear, k * pushed.roof, rtol=1e-9)


@pytest.mark.parametrize("storeys", [1, 6, 30])
@pytest.mark.parametrize(("mass", "stiffness"), [(1e3, 1.0), (1.0, 1e-3), (1e-3, 1.0), (1.0, 1e3)])
def test_a_mass_or_stiffness_that_is_off_by_a_thousand_is_asked_about(
    storeys: int, mass: float, stiffness: float
) -> None:
    # 0.1 s a storey: omega_1 = 2 sqrt(k / m) sin(pi / (2 (2 n + 1))).
    lowest = 2.0 * np.sin(np.pi / (2.0 * (2.0 * storeys + 1.0)))
    stiff = 2e4 * (2.0 * np.pi / (0.1 * storeys) / lowest) ** 2

    def frame(heavier: float, stiffer: float) -> Building:
        made = shear_building(
            name="frame", masses=[2e4 * heavier] * storeys, stiffnesses=[stiff * stiffer] * storeys
        )
        return with_modal_damping(made, ratios=[0.02])

    assert frame(1.0, 1.0).remarks == ()
    assert [each.code for each in frame(mass, stiffness).remarks] == ["period_unusual"]


@pytest.mark.parametrize(("stiffer", "asked"), [(1e3, True), (20.0, False)])
def test_a_storey_that_is_far_stiffer_than_the_others_is_asked_about(stiffer: float, asked: bool) -> None:
    frame = shear_building(name="frame", masses=[4e4] * 3, stiffnesses=[6e7, stiffer * 6e7, 6e7])
    said = with_modal_damping(frame, ratios=[0.02]).remarks
    assert ("storey_stiff" in [each.code for each in said if "storey 2" in each.words]) is asked


def test_a_part_that_is_softer_than_its_frame_is_asked_about() -> None:
    frame = shear_building(name="frame", masses=[2e4] * 3 + [10.0], stiffnesses=[1e8] * 3 + [1e3])
    (said,) = with_modal_damping(frame, ratios=[0.02]).remarks
    assert said.code == "part_soft"
    assert "mode 2" in said.message
