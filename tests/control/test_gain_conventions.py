"""A finished gain in the convention of another program: what fits is named, and nothing is chosen."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag, expm, solve_continuous_are, solve_discrete_are

import mrwork as mr
from mrwork.base.remark import Remark
from mrwork.base.values import Floats
from mrwork.control.laws.gain_conventions import gain_remarks

FRAME = mr.buildings.shear_building(
    name="three storeys", masses=[1e5] * 3, stiffnesses=[1.2e8, 1e8, 0.8e8], storey_damping=[4e5] * 3
)
N = FRAME.n_coordinates


def lqr(pushed: Floats, weight: float = 1e-12, drifts: float = 1e3) -> Floats:
    """K of `u = -K x` as MATLAB and python-control return it, for forces that push along `pushed`, shape (n, m)."""
    A, _, _ = FRAME.state_matrices(FRAME.storeys[:1])
    B = np.vstack([np.zeros_like(pushed), np.linalg.solve(FRAME.mass, pushed)])
    D = FRAME.storeys
    Q, R = block_diag(drifts * D.T @ D, 0.1 * drifts * np.eye(N)), weight * np.eye(pushed.shape[1])
    return np.asarray(np.linalg.solve(R, B.T @ solve_continuous_are(A, B, Q, R)))


def remarks(gain: Floats, *storeys: int) -> list[Remark]:
    rows = FRAME.storeys[list(storeys or (0,))]
    return list(gain_remarks(mr.control.plant_of(FRAME, rows), gain))


RESISTING = -lqr(FRAME.storeys[:1].T)


def test_the_gain_of_a_regulator_is_taken_as_it_is() -> None:
    for weight in (1e-14, 1e-12, 1e-9):
        for rows in (FRAME.storeys[:1], FRAME.storeys[1:], FRAME.storeys):
            plant = mr.control.plant_of(FRAME, rows)
            gain = lqr(-rows.T, weight)
            assert not list(gain_remarks(plant, gain))
            # As a text with four digits has it.
            assert not list(gain_remarks(plant, np.vectorize(lambda k: float(f"{k:.3e}"))(gain)))


@pytest.mark.parametrize(
    ("gain", "words"),
    [
        (lqr(FRAME.storeys[:1].T), "-K, which is K of `lqr`"),
        (-RESISTING.reshape(1, 2, N).transpose(0, 2, 1).reshape(1, -1), "-K and displacement and velocity"),
        (RESISTING.reshape(1, 2, N).transpose(0, 2, 1).reshape(1, -1), "displacement and velocity of each"),
        (RESISTING.reshape(1, 2, N)[:, :, ::-1].reshape(1, -1), "the coordinates from the top down"),
        (RESISTING @ np.linalg.inv(block_diag(FRAME.storeys, FRAME.storeys)), "drifts of the storeys"),
        (np.hstack([RESISTING[:, N:], RESISTING[:, :N]]), "velocities before displacements"),
    ],
    ids=["sign", "interleaved, sign", "interleaved", "top down", "drifts", "velocities first"],
)
def test_another_sign_or_order_is_named(gain: Floats, words: str) -> None:
    (told,) = remarks(gain)
    assert told.code == "gain_convention"
    assert words in told.words[2]


def test_one_coordinate_has_two_conventions_and_an_undamped_frame_at_rest_none() -> None:
    mass = mr.buildings.shear_building(name="mass", masses=[1e5], stiffnesses=[1e8])
    plant = mr.control.plant_of(mass, mass.storeys)
    assert not list(gain_remarks(plant, np.zeros((1, 2))))
    assert not list(gain_remarks(plant, np.array([[0.0, -1e6]])))
    (told,) = gain_remarks(plant, np.array([[0.0, 1e6]]))
    assert told.words[2].startswith("-K, which")
    assert " or " not in told.words[2]


def test_an_actuator_the_other_way_round_is_named() -> None:
    gain = -lqr(FRAME.storeys[:2].T)
    gain[1] *= -1.0
    (told,) = remarks(gain, 0, 1)
    assert told.words[2] == "the other sign of device 2 alone"


def test_a_gain_that_fits_in_no_convention_is_told() -> None:
    gain = 1e9 * np.array([[1.3, 0.9, -0.7, -1.3, -0.6, 0.0]])
    assert {each.code for sign in (1.0, -1.0) for each in remarks(sign * gain)} == {"gain_unstable"}


def test_results_tell_of_the_sign_and_of_a_loop_that_samples_break() -> None:
    pushing = lqr(FRAME.storeys[:1].T)
    laws = {"pushing": pushing, "resisting": -pushing, "late": -300.0 * pushing}
    study = mr.study_of(
        building=FRAME,
        dampers=[{"storey": 1, "preset": "kwok2006", "count": 50}],
        laws=[{"law": "clipped_optimal", "label": label, "gain": gain} for label, gain in laws.items()],
        motions=[mr.synthetic_motion(rng=1, duration=2.0, peak=3.0)],
        hardware={"delay": 0.001},
    )
    told = {
        remark.words[0]: remark.code for remark in mr.run_study(study).remarks if "gain" in remark.message
    }
    assert told == {"pushing": "gain_convention", "late": "loop_held_unstable"}


def test_a_law_without_a_design_tells_it_with_its_responses() -> None:
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    damper = mr.Device(
        name="storey 1", spec=preset.spec, theta=preset.theta, row=FRAME.storeys[0], largest_command=1.88
    )
    motion = mr.synthetic_motion(rng=1, duration=1.0, peak=0.1)
    for gain, codes in ((RESISTING, []), (-RESISTING, ["gain_convention"])):
        law = mr.ControlLaw(name="clipped_optimal", gains={"gain": gain})
        assert [each.code for each in mr.simulate_loop(FRAME, [damper], law, [motion]).remarks] == codes


def test_velocities_first_are_named_where_they_are_a_regulator_in_our_order_too() -> None:
    """A gain that gives hardly any force for displacements is one of velocities; one that weighs them alone stays."""
    plant = mr.control.plant_of(FRAME, FRAME.storeys[:1])
    gain = mr.control.regulator_of_outputs(plant, mr.control.drifts(plant), 1.0, 1e-17).gain
    (told,) = remarks(np.hstack([gain[:, N:], gain[:, :N]]))
    assert told.words == (
        "is a regulator of velocities alone",
        "is one of both",
        "velocities before displacements",
    )
    of_velocities = mr.control.regulator_of_outputs(plant, mr.control.velocities(plant), 1.0, 1e-14).gain
    assert not remarks(gain) + remarks(of_velocities)


def test_a_gain_of_samples_is_no_gain_of_another_convention() -> None:
    """K of `dlqr` at 80 ms: its loop is stable in such samples, and not with continuous forces."""
    plant = mr.control.plant_of(FRAME, FRAME.storeys)
    whole = expm(0.08 * np.block([[plant.A, plant.B], [np.zeros((N, 3 * N))]]))
    F, G, R = whole[: 2 * N, : 2 * N], whole[: 2 * N, 2 * N :], 1e-20 * np.eye(N)
    P = solve_discrete_are(F, G, plant.energy * 1e-8, R)
    gain = np.linalg.solve(R + G.T @ P @ G, G.T @ P @ F)
    assert [each.code for each in gain_remarks(plant, gain, sample_time=0.08)] == ["gain_of_samples"]
    assert [each.code for each in gain_remarks(plant, gain)] == ["gain_convention"]
    (told,) = gain_remarks(plant, -gain, sample_time=0.08)
    assert told.words[2].startswith("-K, which is K of `lqr`")
