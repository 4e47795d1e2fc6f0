"""Coordinates far stiffer than the step, or without mass, that nothing names: condensed, said, or refused."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
import scipy
from refusals import refusal

import mrwork as mr
from mrwork.base.values import Floats
from mrwork.buildings import Building, read_building, static_condensation

STOREYS, BAYS, HEIGHT, WIDTH = 5, 3, 3.5, 6.0
COLUMN, BEAM = {"EA": 3.0e9, "EI": 1.2e8}, {"EA": 4.0e9, "EI": 1.6e8}
STEP = 5e-4


def beam_element(start: Floats, end: Floats, EA: float, EI: float) -> Floats:
    """Stiffness of an Euler-Bernoulli element in u, v and the rotation of both ends, shape (6, 6)."""
    length = float(np.hypot(*(end - start)))
    c, s = (end - start) / length
    bending = np.array([[12.0, 6.0 * length], [6.0 * length, 4.0 * length**2]]) * EI / length**3
    local = np.zeros((6, 6))
    local[np.ix_([0, 3], [0, 3])] = EA / length * np.array([[1.0, -1.0], [-1.0, 1.0]])
    local[np.ix_([1, 2], [1, 2])] = bending
    local[np.ix_([4, 5], [4, 5])] = bending * np.array([[1.0, -1.0], [-1.0, 1.0]])
    local[np.ix_([1, 2], [4, 5])] = (
        np.array([[-12.0, 6.0 * length], [-6.0 * length, 2.0 * length**2]]) * EI / length**3
    )
    local[np.ix_([4, 5], [1, 2])] = local[np.ix_([1, 2], [4, 5])].T
    turn = scipy.linalg.block_diag(*[np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])] * 2)
    return np.asarray(turn.T @ local @ turn)


def frame(inertia: float) -> dict[str, Any]:
    """A frame of three bays and five storeys as a structural program writes it: u, v and rotation of 20 nodes."""
    places = [(WIDTH * bay, HEIGHT * level) for level in range(STOREYS + 1) for bay in range(BAYS + 1)]
    nodes, wide = np.array(places), BAYS + 1
    stiffness = np.zeros((3 * len(nodes), 3 * len(nodes)))
    columns = [(node, node + wide, COLUMN) for node in range(len(nodes) - wide)]
    beams = [(node, node + 1, BEAM) for node in range(wide, len(nodes)) if node % wide < BAYS]
    for first, last, section in columns + beams:
        at = np.r_[3 * first : 3 * first + 3, 3 * last : 3 * last + 3]
        stiffness[np.ix_(at, at)] += beam_element(nodes[first], nodes[last], **section)
    free = slice(3 * wide, None)
    n = STOREYS * wide
    floors = np.zeros((STOREYS, 3 * n))
    floors[range(STOREYS), [3 * wide * level for level in range(STOREYS)]] = 1.0
    return {
        "mass": np.diag([8e3, 8e3, inertia] * n),
        "stiffness": stiffness[free, free],
        "influence": np.array([1.0, 0.0, 0.0] * n),
        "floors": floors,
        "storeys": np.diff(floors, axis=0, prepend=0.0),
    }


def rayleigh(matrices: Mapping[str, Floats], ratio: float = 0.02) -> tuple[float, float]:
    """a0 and a1 of C = a0 M + a1 K that damp the two lowest modes, of the frame with its rotations."""
    low, high = np.sqrt(scipy.linalg.eigh(matrices["stiffness"], matrices["mass"], eigvals_only=True)[:2])
    return 2.0 * ratio * low * high / (low + high), 2.0 * ratio / (low + high)


def peaks_of_all_modes(matrices: Mapping[str, Floats], motion: mr.GroundMotion) -> tuple[Floats, Floats]:
    """Peak drifts [m] and peak absolute accelerations [m/s2], every mode integrated exactly by its exponential."""
    squares, shapes = scipy.linalg.eigh(matrices["stiffness"], matrices["mass"])
    a0, a1 = rayleigh(matrices)
    driven = shapes.T @ matrices["mass"] @ matrices["influence"]
    time = np.arange(round(motion.duration / STEP) + 1) * STEP
    ground = np.interp(time, np.arange(len(motion.acceleration)) * motion.dt, motion.acceleration)
    slopes = np.diff(ground) / STEP
    moved, held = (np.zeros((len(time), len(squares))) for _ in range(2))
    for mode, (square, drive) in enumerate(zip(squares, driven, strict=True)):
        rates = np.array(
            [
                [0.0, 1.0, 0.0, 0.0],
                [-square, -a0 - a1 * square, -drive, 0.0],
                [0.0, 0.0, 0.0, 1.0],
                [0.0] * 4,
            ]
        )
        ahead, state = scipy.linalg.expm(rates * STEP), np.zeros(2)
        for sample, (acceleration, slope) in enumerate(zip(ground, slopes, strict=False)):
            state = ahead[:2, :2] @ state + ahead[:2, 2] * acceleration + ahead[:2, 3] * slope
            moved[sample + 1, mode] = state[0]
            held[sample + 1, mode] = -square * state[0] - (a0 + a1 * square) * state[1]
    drifts, absolute = moved @ (matrices["storeys"] @ shapes).T, held @ (matrices["floors"] @ shapes).T
    return np.abs(drifts).max(axis=0), np.abs(absolute).max(axis=0)


def study_of(matrices: Mapping[str, Floats], **changes: Any) -> mr.Study:
    a0, a1 = rayleigh(matrices)
    table = {name: matrix.tolist() for name, matrix in matrices.items()}
    given: dict[str, Any] = {"name": "frame", **table, "rayleigh": {"a0": a0, "a1": a1}}
    motion = mr.synthetic_motion(rng=4, duration=6.0, peak=3.0)
    return mr.study_of(building={**given, **changes}, motions=[motion])


def test_a_frame_with_rotations_has_the_peaks_of_all_its_coordinates() -> None:
    matrices = frame(inertia=1.0)
    study = study_of(matrices)
    assert (len(matrices["mass"]), study.building.n_coordinates) == (60, 40)
    results = mr.run_study(study, threads=1)
    drifts, accelerations = peaks_of_all_modes(matrices, study.grounds[0])
    found = results.quantities.at(0, 0)
    np.testing.assert_allclose(found["peak_drift"], drifts, rtol=1e-4)
    np.testing.assert_allclose(found["peak_acceleration"], accelerations, rtol=1e-4)
    (said,) = (remark for remark in study.remarks if remark.code == "coordinates_condensed")
    assert "20 coordinates" in said.message
    assert said.measured is not None
    assert 0.0 < said.measured.value < 1e-6
    assert said.severity == "note"


def test_with_every_coordinate_the_step_is_too_long() -> None:
    results = mr.run_study(study_of(frame(inertia=0.05), condense=False), threads=1)
    assert not results.quantities.finished[0, 0, 0]


def test_coordinates_without_mass_are_condensed_exactly_and_before_damping() -> None:
    matrices = frame(inertia=0.0)
    table = {name: matrix.tolist() for name, matrix in matrices.items()}
    study = mr.study_of(
        building={**table, "modal_damping": {"ratios": [0.02]}},
        motions=[mr.synthetic_motion(rng=3, duration=1.0)],
    )
    rotations = np.arange(60) % 3 == 2
    K = matrices["stiffness"]
    own = K[~rotations][:, ~rotations] - K[~rotations][:, rotations] @ np.linalg.solve(
        K[rotations][:, rotations], K[rotations][:, ~rotations]
    )
    np.testing.assert_allclose(study.building.stiffness, own, rtol=1e-9, atol=1e-3)
    np.testing.assert_array_equal(study.building.influence, [1.0, 0.0] * 20)
    (said,) = (remark for remark in study.remarks if remark.code == "coordinates_condensed")
    assert "periods up to 0 s; the largest change of a kept frequency is 0 %" in said.message


def test_all_that_nothing_names_are_condensed_on_demand() -> None:
    matrices = frame(inertia=500.0)
    few, as_they_are = study_of(matrices, condense=True).building, study_of(matrices).building
    # Columns that stretch have mass: their modes are lost, and how far that goes is told.
    assert (few.n_coordinates, as_they_are.n_coordinates) == (20, 60)
    assert few.frequencies[0] == pytest.approx(as_they_are.frequencies[0], rel=2e-3)
    changes = few.frequencies / as_they_are.frequencies[:20] - 1.0
    (measured,) = (remark.measured for remark in few.remarks if remark.code == "coordinates_condensed")
    assert measured is not None
    assert measured.value == pytest.approx(changes.max(), rel=1e-6)
    own = frame(inertia=500.0)
    named = {name: own[name].tolist() for name in ("mass", "stiffness")}
    refusal(mr.study_of, building={**named, "condense": True}, motions=[], match="name every coordinate")


LIGHT = {
    "mass": [[1e4, 0.0], [0.0, 1e-6]],
    "stiffness": [[3e6, -2e6], [-2e6, 2e6]],
    "floors": [[1.0, 0.0]],
    "storeys": [[1.0, 0.0]],
    "influence": [1.0, 0.0],
}
DAMPER = {"storey": 1, "preset": "kwok2006"}


def building_with(row: tuple[float, ...] | None = None, **changes: Any) -> Building:
    motion = mr.synthetic_motion(rng=0, duration=1.0)
    damper = {**DAMPER, **({} if row is None else {"row": row})}
    study = mr.study_of(building={**LIGHT, **changes}, dampers=[damper], motions=[motion])
    assert all(device.row.shape == (study.building.n_coordinates,) for device in study.devices)
    return study.building


def test_what_a_damper_or_a_dashpot_names_stays() -> None:
    assert building_with().n_coordinates == 1
    assert building_with(row=(1.0, 0.0)).n_coordinates == 1
    assert building_with(row=(1.0, -1.0)).n_coordinates == 2
    assert building_with(damping=[[0.0, 0.0], [0.0, 1e5]]).n_coordinates == 2
    # Damping in proportion to the stiffness moves with the spring.
    assert building_with(rayleigh={"a0": 0.1, "a1": 1e-3}).n_coordinates == 1
    massless = {"mass": [[1e4, 0.0], [0.0, 0.0]]}
    refusal(building_with, row=(1.0, -1.0), **massless, match="has no mass and is condensed")
    refusal(building_with, floors=np.eye(2).tolist(), **massless, match="leave it out of floors")


def test_numbers_of_coordinates_are_those_of_the_file() -> None:
    massless = {**LIGHT, "mass": [[0.0, 0.0], [0.0, 1e4]], "stiffness": [[2e6, -2e6], [-2e6, 3e6]]}
    ends = {"floors": [[0.0, 1.0]], "storeys": [[0.0, 1.0]], "influence": [0.0, 1.0]}
    isolation = {"mass": 1e3, "period": 2.0, "ratio": 0.1}
    motion = mr.synthetic_motion(rng=0, duration=1.0)
    study = mr.study_of(
        building={**massless, **ends, "isolation": isolation},
        dampers=[{"storey": 2, "preset": "kwok2006", "row": (-1.0, 0.0, 1.0)}],
        motions=[motion],
    )
    assert study.building.condensed == (2,)
    assert study.devices[0].row.tolist() == [-1.0, 1.0]


def test_matrices_of_a_folder_get_their_rows_before_what_has_no_mass_is_judged(tmp_path: Any) -> None:
    for letter, name in (("M", "mass"), ("K", "stiffness")):
        np.savetxt(tmp_path / f"{letter}.csv", frame(inertia=0.0)[name], delimiter=",")
    refusal(read_building, tmp_path, match="mass matrix is singular")
    rows = {name: frame(0.0)[name].tolist() for name in ("influence", "floors", "storeys")}
    motion = mr.synthetic_motion(rng=0, duration=1.0)
    study = mr.study_of(building={"file": str(tmp_path), **rows}, motions=[motion])
    assert study.building.n_coordinates == 40


def test_condensed_twice_numbers_and_names_stay() -> None:
    middle = np.array([[0.0, 1.0, 0.0]])
    once = Building(
        name="three",
        mass=np.diag([0.0, 1e4, 1e-6]),
        stiffness=1e6 * (2.0 * np.eye(3) - np.eye(3, k=1) - np.eye(3, k=-1)),
        influence=middle[0],
        floors=middle,
        storeys=middle,
    )
    whole = static_condensation(static_condensation(once), shortest_period=1e-3)
    assert whole.condensed == (1, 3)
    assert whole.kept.tolist() == [1]
    assert whole.stiffness[0, 0] == pytest.approx(1e6)


def test_a_gain_of_all_coordinates_is_told_which_are_condensed() -> None:
    motion = mr.synthetic_motion(rng=0, duration=1.0)
    law = {"law": "clipped_optimal", "gain": [[1e5, 0.0, 1e6, 0.0]]}
    refusal(
        mr.study_of,
        building={**LIGHT, "rayleigh": {"a0": 0.1, "a1": 1e-3}},
        dampers=[DAMPER],
        laws=[law],
        motions=[motion],
        match="gain is 1 x 4, and the law takes 1 x 2.*of which 2 are condensed",
    )
