"""A finished gain in the convention of another program: what fits is named, and nothing is chosen."""

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


def test_rows_in_the_other_order_are_named() -> None:
    (told,) = remarks(-lqr(FRAME.storeys[[2, 0]].T), 0, 2)
    assert "rows of the devices in the other order" in told.words[2]
    assert "-K" not in told.words[2]


def test_a_gain_in_kilonewtons_that_does_nothing_is_told() -> None:
    (told,) = remarks(1e-3 * RESISTING)
    assert (told.code, told.severity) == ("gain_weak", "warning")
    # What the remark says: no period and no damping ratio is another one.
    A, B, _ = FRAME.state_matrices(FRAME.storeys[:1])
    poles, moved = (np.sort_complex(np.linalg.eigvals(each)) for each in (A, A - 1e-3 * B @ RESISTING))
    assert (np.abs(moved - poles) < 0.05 * np.abs(poles.real)).all()
    assert not remarks(RESISTING)


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


def dlqr(sample_time: float, weight: float, rows: Floats = FRAME.storeys) -> Floats:
    """K of `u = -K x` of samples for forces that resist, with the energy as weight."""
    plant = mr.control.plant_of(FRAME, rows)
    m = len(rows)
    whole = expm(sample_time * np.block([[plant.A, plant.B], [np.zeros((m, 2 * N + m))]]))
    F, G, R = whole[: 2 * N, : 2 * N], whole[: 2 * N, 2 * N :], weight * np.eye(m)
    P = solve_discrete_are(F, G, plant.energy * 1e-8, R)
    return np.asarray(np.linalg.solve(R + G.T @ P @ G, G.T @ P @ F))


def test_a_gain_of_samples_is_no_gain_of_another_convention() -> None:
    """K of `dlqr` at 80 ms: its loop is stable in such samples, and not with continuous forces."""
    plant, gain = mr.control.plant_of(FRAME, FRAME.storeys), dlqr(0.08, 1e-20)
    assert [each.code for each in gain_remarks(plant, gain, sample_time=0.08)] == ["gain_of_samples"]
    assert [each.code for each in gain_remarks(plant, gain)] == ["gain_convention"]
    (told,) = gain_remarks(plant, -gain, sample_time=0.08)
    assert told.words[2].startswith("-K, which is K of `lqr`")


@pytest.mark.parametrize("n_devices", [1, 3])
def test_a_gain_of_samples_that_is_stable_with_continuous_forces_names_both(n_devices: int) -> None:
    """At 50 ms it costs 1.6 and 4.4 times the optimum of the same weights, with forces that follow at once."""
    rows = FRAME.storeys[:n_devices]
    plant, gain = mr.control.plant_of(FRAME, rows), dlqr(0.05, 1e-21, rows)
    assert np.linalg.eigvals(plant.A - plant.B @ gain).real.max() < 0.0
    (told,) = gain_remarks(plant, gain)
    assert (told.code, told.words[2]) == ("gain_convention", "K of `dlqr` in samples of 0.05 s")
    (held,) = gain_remarks(plant, gain, sample_time=0.05)
    assert (held.code, held.words[0]) == ("gain_of_samples", "0.05")
    # A regulator of other costs of the forces fits at no sample time.
    R = np.diag(1e-18 * 10.0 ** np.arange(n_devices))
    P = solve_continuous_are(plant.A, plant.B, plant.energy * 1e-8, R)
    assert not list(gain_remarks(plant, np.linalg.solve(R, plant.B.T @ P)))
