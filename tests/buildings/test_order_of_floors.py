"""Matrices in any order of coordinates are one building: floors are read from the ground up, or asked about."""

from collections.abc import Callable
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import scipy
from refusals import refusal
from scipy.io import savemat

import mrwork as mr
from mrwork.buildings import Building, read_building
from mrwork.buildings.building_remarks import coordinate_remarks

MASS = np.diag([15e3, 15e3, 10e3])
SPRINGS = np.array([24e6, 18e6, 12e6])
DRIFTS = np.eye(3) - np.eye(3, k=-1)
STIFFNESS = DRIFTS.T @ np.diag(SPRINGS) @ DRIFTS
DAMPING = 1e-3 * STIFFNESS
STEP = 0.002
PULSE = np.interp(np.arange(0.0, 0.6, STEP), np.arange(7) * 0.1, [0.0, 0.0, 3.0, -3.0, 2.0, -2.0, 1.0])

Entrance = Callable[[Path, np.ndarray], str]


def ordered(matrix: np.ndarray, order: np.ndarray) -> np.ndarray:
    return matrix[np.ix_(order, order)]


def own_drifts() -> np.ndarray:
    """Peak drift of each storey, lowest first, under the pulse, linear between samples: exact exponential."""
    zero, one = np.zeros((3, 3)), np.eye(3)
    plant = scipy.signal.StateSpace(
        np.block([[zero, one], [-np.linalg.solve(MASS, STIFFNESS), -np.linalg.solve(MASS, DAMPING)]]),
        np.append(np.zeros(3), -np.ones(3))[:, None],
        np.hstack([DRIFTS, zero]),
        np.zeros((3, 1)),
    )
    _, drifts, _ = scipy.signal.lsim(plant, PULSE, STEP * np.arange(len(PULSE)))
    return np.asarray(np.abs(drifts).max(axis=0))


def as_toml(path: Path, order: np.ndarray) -> str:
    given = {"mass": MASS, "damping": DAMPING, "stiffness": STIFFNESS}
    return "".join(f"{name} = {ordered(matrix, order).tolist()}\n" for name, matrix in given.items())


def as_mat(path: Path, order: np.ndarray) -> str:
    letters = {"M": MASS, "C": DAMPING, "K": STIFFNESS}
    savemat(path / "frame.mat", {letter: ordered(matrix, order) for letter, matrix in letters.items()})
    return 'file = "frame.mat"\n'


def as_files(path: Path, order: np.ndarray) -> str:
    for letter, matrix in {"M": MASS, "C": DAMPING, "K": STIFFNESS}.items():
        np.savetxt(path / f"{letter}.csv", ordered(matrix, order), delimiter=",")
    return 'mass = "M.csv"\ndamping = "C.csv"\nstiffness = "K.csv"\n'


def as_folder(path: Path, order: np.ndarray) -> str:
    as_files(path, order)
    return f"file = '{path}'\n"


def as_state_space(path: Path, order: np.ndarray) -> str:
    mass, damping, stiffness = (ordered(matrix, order) for matrix in (MASS, DAMPING, STIFFNESS))
    A, *_ = Building(name="", mass=mass, damping=damping, stiffness=stiffness).state_matrices()
    savemat(path / "space.mat", {"A": A, "M": mass})
    return 'system = "space.mat"\n'


@pytest.mark.parametrize("entrance", [as_toml, as_mat, as_files, as_folder, as_state_space])
def test_matrices_in_any_order_are_one_building(tmp_path: Path, entrance: Entrance) -> None:
    found = {}
    for name, order in {"up": [0, 1, 2], "down": [2, 1, 0], "mixed": [1, 2, 0]}.items():
        building = entrance(tmp_path, np.array(order))
        path = tmp_path / f"{name}.toml"
        motion = f"[[motion]]\nacceleration = {PULSE.tolist()}\ndt = {STEP}\n"
        damper = '[[damper]]\nstorey = 1\npreset = "kwok2006"\n[[controller]]\nlaw = "passive_on"\n'
        path.write_text(f"[building]\n{building}height = 3.0\n{motion}{damper}")
        study = mr.read_study(path)
        assert ("floors_ordered" in [remark.code for remark in study.remarks]) == (name != "up")
        peaks = mr.run_study(study).to_xarray()["quantities"].to_dataset()["peak_drift"]
        np.testing.assert_allclose(peaks.sel(row="uncontrolled").values.ravel(), own_drifts(), rtol=1e-3)
        found[name] = peaks.values
    np.testing.assert_allclose(found["down"], found["up"], rtol=1e-7)
    np.testing.assert_allclose(found["mixed"], found["up"], rtol=1e-7)


@pytest.mark.parametrize("order", list(permutations(range(3))))
@pytest.mark.parametrize("name", ["dyke1996", "sac3", "bends"])
def test_frames_that_are_no_chain_of_springs_are_ordered_too(name: str, order: tuple[int, ...]) -> None:
    """A published K of three digits, a condensed one of a moment frame, and a cantilever that bends alone."""
    if name == "bends":
        low, high = np.minimum(*np.mgrid[1:4, 1:4]), np.maximum(*np.mgrid[1:4, 1:4])
        stiffness = 1e7 * np.linalg.inv(low**2 * (3.0 * high - low) / 6.0)
    else:
        stiffness = mr.building(name).stiffness
    where = np.array(order)
    built = Building(name="frame", mass=1e4 * np.eye(3), stiffness=ordered(stiffness, where))
    np.testing.assert_allclose(built.floors @ built.stiffness @ built.floors.T, stiffness, rtol=1e-9)
    assert [remark.code for remark in built.ordering] == ["floors_ordered"] * (order != (0, 1, 2))
    assert not [*coordinate_remarks(built)]


def test_names_go_with_their_coordinates_and_unlike_heights_are_asked_about(tmp_path: Path) -> None:
    """A quarter car with its body first."""
    car = "mass = [[280, 0], [0, 36]]\nstiffness = [[21e3, -21e3], [-21e3, 181e3]]\n"
    names = 'floor_names = ["body", "wheel"]\nstorey_names = ["suspension", "tyre"]\n'
    (tmp_path / "car.toml").write_text(car + names)
    built = read_building(tmp_path / "car.toml")
    assert (built.floor_names, built.storey_names) == (("wheel", "body"), ("tyre", "suspension"))
    np.testing.assert_array_equal(built.storey_row("suspension"), [1.0, -1.0])
    np.testing.assert_array_equal(built.storey_row("tyre"), [0.0, 1.0])
    np.testing.assert_allclose(built.storey_stiffnesses, [160e3, 21e3])
    in_python = Building(
        name="car", mass=np.diag([280.0, 36.0]), stiffness=built.stiffness, floor_names=("body", "wheel")
    )
    assert in_python.floor_names == ("wheel", "body")
    path = tmp_path / "heights.toml"
    path.write_text(f"{car}heights = [3, 4]\n")
    refusal(read_building, path, match=r"coordinate 2, which stands .* give floors = \[\[0, 1\], \[1, 0\]\]")
    path.write_text(f"{car}heights = [3, 4]\nfloors = [[0, 1], [1, 0]]\n")
    stated = read_building(path)
    assert stated.heights.tolist() == [3.0, 4.0]
    np.testing.assert_allclose(stated.storey_stiffnesses, [160e3, 21e3])
    assert not stated.ordering


def codes(mass: np.ndarray, stiffness: np.ndarray, **rows: np.ndarray) -> list[str]:
    built = Building(name="frame", mass=mass, stiffness=stiffness, **rows)
    return [remark.code for remark in (*built.ordering, *coordinate_remarks(built))]


def test_a_frame_whose_order_is_not_to_be_read_is_asked_about_with_the_roof_first() -> None:
    """A tuned mass on the second floor is a branch; the roof first, storey 1 has no spring to the ground."""
    mass = np.diag([15e3, 15e3, 10e3, 400.0])
    row = np.array([0.0, -1.0, 0.0, 1.0])
    stiffness = np.pad(STIFFNESS, (0, 1)) + 4e5 * np.outer(row, row)
    roof_first = np.array([2, 1, 0, 3])
    assert codes(mass, stiffness) == []
    found = codes(ordered(mass, roof_first), ordered(stiffness, roof_first))
    assert found == ["lowest_storey_in_doubt"]
    floors = np.eye(4)[[2, 1, 0]]
    rows = {"floors": floors, "storeys": np.vstack([np.diff(floors, axis=0, prepend=0.0), row[roof_first]])}
    assert codes(ordered(mass, roof_first), ordered(stiffness, roof_first), n_strokes=1, **rows) == []
    # With the tuned mass on the roof it is the last of a chain, wherever it is listed.
    row = np.array([0.0, 0.0, -1.0, 1.0])
    chain = np.pad(STIFFNESS, (0, 1)) + 4e5 * np.outer(row, row)
    first = np.array([3, 0, 1, 2])
    assert codes(mass, chain) == []
    assert codes(ordered(mass, first), ordered(chain, first)) == ["floors_ordered"]


def test_towers_braces_to_the_ground_and_isolators_are_silent() -> None:
    two = scipy.linalg.block_diag(STIFFNESS, STIFFNESS)
    assert codes(scipy.linalg.block_diag(MASS, MASS), two) == []
    braced = STIFFNESS.copy()
    braced[1, 1] += 3e7
    assert codes(MASS, braced) == []
    isolated = np.diag([1e5, 15e3, 15e3, 10e3])
    rows = np.eye(4) - np.eye(4, k=-1)
    assert codes(isolated, rows.T @ np.diag([2e5, *SPRINGS]) @ rows) == []
