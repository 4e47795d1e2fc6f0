"""Linear systems: from and to buildings, exchange with python-control, reduction to modes."""

from __future__ import annotations

import sys
from pathlib import Path

import measured_data
import numpy as np
import pytest
from numpy.typing import NDArray
from refusals import refusal
from scipy.io import loadmat, savemat

from mrwork.buildings import (
    Building,
    LinearSystem,
    building,
    building_of,
    buildings,
    from_control,
    modal_truncation,
    read_system,
    shear_building,
    system_of,
    with_brace,
)
from mrwork.buildings.state_space import OUTPUTS

UTS = building("uts")
FREQUENCY = np.geomspace(0.1, 50.0, 400)
SLICOT = measured_data.DATA / "buildings/slicot_building.mat"


def largest(response: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Largest singular value at each frequency, shape (n_frequencies,)."""
    return np.linalg.svd(response, compute_uv=False)[:, 0]


def response(system: LinearSystem, frequency: NDArray[np.float64] = FREQUENCY) -> NDArray[np.complex128]:
    """Frequency response at frequencies [Hz], shape (n_frequencies, n_outputs, n_inputs)."""
    s = 2j * np.pi * frequency[:, None, None]
    return system.C @ np.linalg.solve(s * np.eye(system.n_states) - system.A, system.B[None]) + system.D


# From a building


def test_outputs_at_rest_and_far_above_are_what_mechanics_says() -> None:
    # The building follows a slow ground motion, and does not move in space under a fast one.
    system = system_of(UTS, outputs=["acceleration", "displacement"])
    slow, quick = response(system, np.array([1e-4, 1e4]))[:, :, 0]
    np.testing.assert_allclose(slow[:5], 1.0, rtol=1e-6)
    np.testing.assert_allclose(quick[:5], 0.0, atol=1e-3)
    np.testing.assert_allclose(quick[5:] * (2.0 * np.pi * 1e4) ** 2, 1.0, rtol=1e-3)


def test_a_pair_of_equal_and_opposite_forces_moves_the_storey_by_its_stiffness() -> None:
    static = response(system_of(UTS, outputs=["drift"], devices=[2]), np.array([1e-6]))[0, :, 1].real
    np.testing.assert_allclose(static, [0.0, -1.0 / 1.448e6, 0.0, 0.0, 0.0], atol=1e-15)


def test_rates_are_the_derivatives_of_what_they_are_named_after() -> None:
    found = response(system_of(UTS, outputs=tuple(OUTPUTS), devices=[1, "storey 3"]))
    s = 2j * np.pi * FREQUENCY[:, None, None]
    displacement, velocity, acceleration, drift, drift_rate = np.split(found, 5, axis=1)
    np.testing.assert_allclose(velocity, s * displacement, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(drift_rate, s * drift, rtol=1e-6, atol=1e-12)
    ground = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(acceleration, s**2 * displacement + ground, rtol=1e-6, atol=1e-9)


# And back


@pytest.mark.parametrize("known", buildings(), ids=lambda known: known.name)
def test_a_building_comes_back_from_its_linear_system(known: Building) -> None:
    system = system_of(known, outputs=["displacement"])
    n = known.n_coordinates
    given = {"influence": -system.B[n:, 0], "floors": known.floors, "storeys": known.storeys}
    again = building_of(system, name="again", mass=known.mass, **given)
    for field in ("mass", "damping", "stiffness", "influence"):
        np.testing.assert_allclose(getattr(again, field), getattr(known, field), rtol=1e-9, atol=1e-6)
    # Without the mass, the motion is the same.
    unweighed = system_of(building_of(system, name="again", **given), outputs=["displacement"])
    np.testing.assert_allclose(response(unweighed), response(system), rtol=1e-7, atol=1e-12)


def test_a_device_keeps_its_effect_where_the_mass_had_to_be_made() -> None:
    frame = shear_building(name="frame", masses=[3.0, 2.0, 1.0], stiffnesses=[900.0, 600.0, 300.0])
    system = system_of(frame, outputs=["drift"], devices=[2])
    again = building_of(
        system, name="again", influence=frame.influence, floors=frame.floors, storeys=frame.storeys
    )
    assert np.abs(again.mass - frame.mass).max() > 0.1
    row = -(again.mass @ system.B[3:, 1])
    np.testing.assert_allclose(again.state_matrices(row[None])[1][:, 0], system.B[:, 1], atol=1e-12)


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
    system = LinearSystem(A=A, B=np.ones((len(A), 1)), C=np.eye(len(A)), D=np.zeros((len(A), 1)))
    given = {"influence": np.ones(2), "floors": np.eye(2), "storeys": np.eye(2), "mass": mass}
    refusal(building_of, system, name="none", **given, match=word)


def test_a_system_is_read_from_a_file(tmp_path: Path) -> None:
    system = system_of(UTS, outputs=["acceleration"])
    savemat(tmp_path / "plant.mat", {"A": system.A, "B": system.B, "C": system.C, "D": system.D})
    again = read_system(tmp_path / "plant.mat")
    for title in ("A", "B", "C", "D"):
        np.testing.assert_array_equal(getattr(again, title), getattr(system, title))
    savemat(tmp_path / "half.mat", {"A": system.A})
    refusal(read_system, tmp_path / "half.mat", match="needs A, B and C; found A")


# python-control


def test_a_system_goes_to_python_control_and_comes_back_to_the_bit() -> None:
    system = system_of(
        with_brace(UTS, storey=1, stiffness=5e6, mass=0.3), outputs=tuple(OUTPUTS), devices=[1]
    )
    there = system.to_control()
    again = from_control(there)
    for title in ("A", "B", "C", "D"):
        np.testing.assert_array_equal(getattr(again, title), getattr(system, title))
    assert (again.input_names, again.output_names) == (system.input_names, system.output_names)
    theirs = there(2j * np.pi * FREQUENCY).transpose(2, 0, 1)
    ours = response(system)
    np.testing.assert_allclose(ours, theirs, rtol=1e-7, atol=1e-12 * np.abs(theirs).max())


def test_a_discrete_system_of_python_control_is_refused() -> None:
    import control

    discrete = control.StateSpace([[0.5]], [[1.0]], [[1.0]], [[0.0]], 0.01)
    refusal(from_control, discrete, match="discrete time with a step of 0.01 s")


def test_without_python_control_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    refusal(system_of(UTS).to_control, match=r"pip install 'mrwork\[control\]'")


# Fewer states


def test_all_modes_of_a_building_are_the_building() -> None:
    braced = with_brace(UTS, storey=1, stiffness=5e6, mass=0.3, damping=50.0)
    whole = system_of(modal_truncation(braced, n_modes=6), outputs=tuple(OUTPUTS), devices=[1, 6])
    expected = response(system_of(braced, outputs=tuple(OUTPUTS), devices=[1, 6]))
    np.testing.assert_allclose(response(whole), expected, rtol=1e-6, atol=1e-10)


def test_fewer_modes_keep_frequencies_and_damping_and_lose_the_more_the_fewer_they_are() -> None:
    full = response(system_of(UTS, outputs=["displacement"]))
    errors = []
    for n_modes in (1, 2, 3, 4):
        few = modal_truncation(UTS, n_modes=n_modes)
        np.testing.assert_allclose(few.frequencies, UTS.frequencies[:n_modes], rtol=1e-9)
        np.testing.assert_allclose(few.damping_ratios, UTS.damping_ratios[:n_modes], rtol=1e-9)
        difference = response(system_of(few, outputs=["displacement"])) - full
        errors.append(float(largest(difference).max()))
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-3 * largest(full).max()


def test_no_modes_are_refused() -> None:
    refusal(modal_truncation, UTS, n_modes=0, match="from 1 to 5")


# The hospital building of the SLICOT collection

measured = pytest.mark.skipif(
    not SLICOT.is_file(), reason=f"the SLICOT building is not at {SLICOT} (set MRWORK_DATA)"
)


@measured
def test_the_hospital_building_reads_as_scipy_reads_it_and_has_the_spectrum_that_comes_with_it() -> None:
    stored = loadmat(SLICOT, spmatrix=False)
    system = read_system(SLICOT)
    np.testing.assert_array_equal(system.A, stored["A"].toarray())
    np.testing.assert_array_equal(system.B, stored["B"])
    frequency = stored["w"].ravel() / (2.0 * np.pi)
    spectrum = np.abs(response(system, frequency)[:, 0, 0])
    np.testing.assert_allclose(spectrum, stored["mag"].ravel(), rtol=1e-6)


@measured
def test_the_hospital_building_is_a_building_with_a_force_on_its_first_coordinate() -> None:
    system = read_system(SLICOT)
    first = np.eye(24)[:1]
    hospital = building_of(system, name="hospital", influence=np.ones(24), floors=first, storeys=first)
    np.testing.assert_allclose(
        hospital.frequencies, np.sort(np.abs(np.linalg.eigvals(system.A)))[::2] / (2.0 * np.pi), rtol=1e-8
    )
    assert hospital.damping_ratios.min() == pytest.approx(0.023, abs=5e-4)
    A, B, _ = hospital.state_matrices(-(hospital.mass @ system.B[24:]).T)
    scale = np.abs(system.A).max()
    np.testing.assert_allclose(A, system.A, atol=1e-9 * scale)
    np.testing.assert_allclose(B, system.B, atol=1e-12)
