"""Modes of one frequency, as of equal towers: only the space of their shapes is determined."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy
from numpy.testing import assert_allclose
from refusals import refusal

import mrwork as mr
from mrwork import buildings
from mrwork.buildings.plane_building import Building
from mrwork.buildings.state_space import building_of, mass_of_forces

STIFFNESS = 2e6


def tower(count: int = 1) -> Building:
    """Equal, uncoupled towers of two storeys in one set of matrices."""
    one = buildings.shear_building(name="tower", masses=[1e3] * 2, stiffnesses=[STIFFNESS] * 2)

    def blocks(matrix: Any) -> Any:
        return scipy.linalg.block_diag(*[matrix] * count)

    return Building(
        name="towers",
        mass=blocks(one.mass),
        damping=blocks(one.damping),
        stiffness=blocks(one.stiffness),
        storeys=blocks(one.storeys),
    )


@pytest.mark.parametrize("mode", [1, 2])
@pytest.mark.parametrize("floor", [2, 4])
def test_a_tuned_mass_on_one_of_two_equal_towers_is_that_of_the_tower_alone(floor: int, mode: int) -> None:
    """Independent: the same mass on one tower, of twice the ratio, as the building has half the mass."""
    of_two = buildings.with_optimal_tuned_mass(tower(2), floor=floor, mass_ratio=0.02, mode=mode)
    alone = buildings.with_optimal_tuned_mass(tower(1), floor=2, mass_ratio=0.04)
    assert of_two.mass[-1, -1] == pytest.approx(80.0)
    # From the case that was worked out by hand.
    assert of_two.stiffness[-1, -1] == pytest.approx(53_028.0, rel=1e-4)
    for name in ("mass", "stiffness", "damping"):
        assert_allclose(getattr(of_two, name)[-1, -1], getattr(alone, name)[-1, -1], rtol=1e-9)


def test_a_mode_that_does_not_move_a_floor_is_still_refused() -> None:
    stiffer = tower(2)
    stiffer = replace(stiffer, stiffness=np.diag([1.0, 1.0, 1.5, 1.5]) @ stiffer.stiffness)
    refusal(buildings.with_optimal_tuned_mass, stiffer, floor=4, mass_ratio=0.02, match="does not move")


def test_the_first_of_equal_modes_has_all_their_participation() -> None:
    two, one = tower(2), tower(1)
    assert_allclose(two.effective_masses[[0, 2]], 2.0 * one.effective_masses, rtol=1e-9)
    assert_allclose(two.effective_masses[[1, 3]], 0.0, atol=1e-9)
    assert_allclose(two.participation.sum(), 1.0)
    assert buildings.with_modal_damping(two, ratios=[0.02]).remarks == ()


def test_equal_modes_with_one_damped_tower_have_the_ratios_of_each_tower() -> None:
    damped = buildings.with_viscous_damper(tower(2), storey=1, damping=1e3)
    alone = buildings.with_viscous_damper(tower(1), storey=1, damping=1e3)
    ratios = np.sort(damped.damping_ratios[:2])
    # Shapes lean to the driven one by a millionth.
    assert_allclose(ratios, [0.0, alone.damping_ratios[0]], atol=1e-5 * alone.damping_ratios[0])


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: buildings.with_modal_damping(tower(2), ratios=[0.02, 0.05, 0.02, 0.02]), "one ratio"),
        (lambda: buildings.modal_truncation(tower(2), n_modes=1), "keep 2 modes"),
        (lambda: buildings.modal_truncation(tower(2), n_modes=3), "keep 2 or 4 modes"),
        (lambda: buildings.with_rayleigh_damping(tower(2), ratios=(0.02, 0.02)), "two different"),
    ],
)
def test_what_cuts_a_space_is_refused(make: Any, word: str) -> None:
    refusal(make, match=word)


def test_ratios_that_agree_within_a_space_are_taken() -> None:
    damped = buildings.with_modal_damping(tower(2), ratios=[0.02, 0.02, 0.05, 0.05])
    assert_allclose(damped.damping_ratios, [0.02, 0.02, 0.05, 0.05])
    assert buildings.modal_truncation(damped, n_modes=2).n_coordinates == 2


def test_masses_of_equal_towers_follow_from_forces_of_their_dampers() -> None:
    """A state space of equal towers, whose eigenvectors are any of a space, gives back M and K."""
    two = buildings.with_modal_damping(tower(2), ratios=[0.02])
    A, B, _ = two.state_matrices(two.storeys)
    mass = mass_of_forces(A, B, two.storeys, "towers")
    assert_allclose(mass, two.mass, atol=1e-6 * two.mass.max())
    back = building_of(A, name="towers", influence=two.influence, floors=two.floors, storeys=two.storeys)
    assert_allclose(back.frequencies, two.frequencies, rtol=1e-6)


def test_frames_with_distinct_modes_keep_their_shapes() -> None:
    frame = mr.building("uts")
    _, modes = scipy.linalg.eigh(frame.stiffness, frame.mass)
    assert_allclose(np.abs(frame.modes), np.abs(modes), rtol=0.0, atol=0.0)
