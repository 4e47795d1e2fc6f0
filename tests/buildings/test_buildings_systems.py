"""State spaces: buildings that come back from theirs, and reduction to modes."""

from collections.abc import Sequence

import measured_data
import numpy as np
import pytest
from numpy.typing import NDArray
from refusals import refusal
from scipy.io import loadmat

from mrwork.buildings import Building, building, buildings, modal_truncation, shear_building, with_brace
from mrwork.buildings.state_space import building_of

UTS = building("uts")
FREQUENCY = np.geomspace(0.1, 50.0, 400)
SLICOT = measured_data.DATA / "buildings/slicot_building.mat"


def largest(response: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Largest singular value at each frequency, shape (n_frequencies,)."""
    return np.linalg.svd(response, compute_uv=False)[:, 0]


def displacements(frame: Building, devices: Sequence[int] = ()) -> NDArray[np.complex128]:
    """Displacements of floors for the ground and forces in storeys, (n_frequencies, n_floors, n_inputs)."""
    rows = np.array([frame.storeys[storey - 1] for storey in devices]).reshape(-1, frame.n_coordinates)
    A, B, E = frame.state_matrices(rows)
    s = 2j * np.pi * FREQUENCY[:, None, None]
    states = np.linalg.solve(s * np.eye(len(A)) - A, np.column_stack([E, B])[None])
    return frame.floors @ states[:, : frame.n_coordinates]


@pytest.mark.parametrize("known", buildings(), ids=lambda known: known.name)
def test_a_building_comes_back_from_its_state_space(known: Building) -> None:
    A, _, E = known.state_matrices(known.storeys[:1])
    given = {"influence": -E[known.n_coordinates :], "floors": known.floors, "storeys": known.storeys}
    again = building_of(A, name="again", mass=known.mass, **given)
    for field in ("mass", "damping", "stiffness", "influence"):
        np.testing.assert_allclose(getattr(again, field), getattr(known, field), rtol=1e-9, atol=1e-6)
    # Without the mass, the motion is the same.
    unweighed = building_of(A, name="again", **given)
    np.testing.assert_allclose(displacements(unweighed), displacements(known), rtol=1e-7, atol=1e-12)


def test_a_device_keeps_its_effect_where_the_mass_had_to_be_made() -> None:
    frame = shear_building(name="frame", masses=[3.0, 2.0, 1.0], stiffnesses=[900.0, 600.0, 300.0])
    A, B, _ = frame.state_matrices(frame.storeys[1:2])
    again = building_of(
        A, name="again", influence=frame.influence, floors=frame.floors, storeys=frame.storeys
    )
    assert np.abs(again.mass - frame.mass).max() > 0.1
    row = -(again.mass @ B[3:]).T
    np.testing.assert_allclose(again.state_matrices(row)[1], B, atol=1e-12)


def oscillator(stiffness: list[list[float]]) -> NDArray[np.float64]:
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-np.array(stiffness), -np.eye(2)]])


@pytest.mark.parametrize(
    ("A", "mass", "word"),
    [
        (-np.eye(4), None, "0 of the 4 rows"),
        (oscillator([[2.0, -1.0], [1.0, 2.0]]), None, "no real shapes"),
        (oscillator([[2.0, -1.0], [-2.0, 2.0]]), np.eye(2), "not symmetric, by 1 N/m"),
        (oscillator([[1.0, 0.0], [0.0, 1.0]]), np.eye(3), "not 2 x 2"),
    ],
)
def test_a_system_that_is_no_building_is_refused(
    A: NDArray[np.float64], mass: NDArray[np.float64] | None, word: str
) -> None:
    given = {"influence": np.ones(2), "floors": np.eye(2), "storeys": np.eye(2), "mass": mass}
    refusal(building_of, A, name="none", **given, match=word)


# Fewer states


def test_all_modes_of_a_building_are_the_building() -> None:
    braced = with_brace(UTS, storey=1, stiffness=5e6, mass=0.3, damping=50.0)
    whole = modal_truncation(braced, n_modes=6)
    np.testing.assert_allclose(
        displacements(whole, [1, 6]), displacements(braced, [1, 6]), rtol=1e-6, atol=1e-10
    )


def test_fewer_modes_keep_frequencies_and_damping_and_lose_the_more_the_fewer_they_are() -> None:
    full = displacements(UTS)
    errors = []
    for n_modes in (1, 2, 3, 4):
        few = modal_truncation(UTS, n_modes=n_modes)
        np.testing.assert_allclose(few.frequencies, UTS.frequencies[:n_modes], rtol=1e-9)
        np.testing.assert_allclose(few.damping_ratios, UTS.damping_ratios[:n_modes], rtol=1e-9)
        difference = displacements(few) - full
        errors.append(float(largest(difference).max()))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-3 * largest(full).max()


def test_no_modes_are_refused() -> None:
    refusal(modal_truncation, UTS, n_modes=0, match="from 1 to 5")


# The hospital building of the SLICOT collection


@pytest.mark.skipif(not SLICOT.is_file(), reason=f"the SLICOT building is not at {SLICOT} (set MRWORK_DATA)")
def test_the_hospital_building_is_a_building_with_a_force_on_its_first_coordinate() -> None:
    stored = loadmat(SLICOT, spmatrix=False)
    A, B = stored["A"].toarray(), stored["B"]
    first = np.eye(24)[:1]
    hospital = building_of(A, name="hospital", influence=np.ones(24), floors=first, storeys=first)
    np.testing.assert_allclose(
        hospital.frequencies, np.sort(np.abs(np.linalg.eigvals(A)))[::2] / (2.0 * np.pi), rtol=1e-8
    )
    assert hospital.damping_ratios.min() == pytest.approx(0.023, abs=5e-4)
    back, pushed, _ = hospital.state_matrices(-(hospital.mass @ B[24:]).T)
    np.testing.assert_allclose(back, A, atol=1e-9 * np.abs(A).max())
    np.testing.assert_allclose(pushed, B, atol=1e-12)
