"""Accelerations and running root mean squares as signals of laws of measured signals: as in NumPy, with their bits."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tuning_samples
from loop_samples import LARGEST, at_samples, devices, five_storeys, law_with_gains, plant_with, rd1005, sweep
from refusals import refusal

import mrwork as mr
from mrwork.buildings import Building
from mrwork.closed_loop import Fault, Hardware, History, LoopSample, UserLaw, simulate_loop
from mrwork.control import ControlLaw, DesignProblem, FurtherSignal, design_law, settings_of
from mrwork.dampers.simulation import Outcome
from mrwork.study import TuneTable
from mrwork.study.study import fingerprint_of
from mrwork.tuning.problem import Clock, benches_of, magnitudes_of
from mrwork.tuning.space import space_of

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
TS, TIME = 1e-3, 0.05
SIGNALS = (
    FurtherSignal(source="acceleration"),
    FurtherSignal(source="ground_acceleration"),
    FurtherSignal(source="rate", time_constant=TIME),
    FurtherSignal(source="ground_acceleration", time_constant=2.0 * TIME),
    FurtherSignal(source="floor_acceleration", floor=4),
    FurtherSignal(source="floor_acceleration", floor=2, time_constant=TIME),
)
SCALES = np.array([3.0, 2.0, 0.05, 2.0, 3.0, 3.0])
MOTION = sweep(0.6)


def network_of() -> ControlLaw:
    law = law_with_gains("signal_network", plant_with(devices(rd1005())))
    rng = np.random.default_rng(11)
    n_devices = len(np.asarray(law.gains["network"]))
    further = rng.normal(size=(n_devices, len(SIGNALS), 4)) / SCALES[:, None]
    return replace(law, signals=SIGNALS, gains={**law.gains, "further": further.reshape(n_devices, -1)})


def polynomial_of() -> ControlLaw:
    law = law_with_gains("signal_polynomial", plant_with(devices(rd1005())))
    powers = np.zeros((4, 4 + len(SIGNALS)))
    powers[1, [2, 4]] = powers[2, [6, 7]] = 1.0
    powers[3, [8, 9]] = 2.0, 1.0
    return replace(
        law,
        signals=SIGNALS,
        tables={
            "terms": np.column_stack([[0.1, 1.5, 4.0, 3.0], powers]),
            "reach": [2e-3, 0.05, 1e3, 1e3, *SCALES],
        },
    )


def fading(readings: Floats, constant: float) -> Floats:
    left, square, roots = np.exp(-TS / constant), np.zeros(readings.shape[1]), []
    for reading in readings:
        square = left * square + (1.0 - left) * reading**2
        roots.append(np.sqrt(square))
    return np.array(roots)


def further_in_numpy(building: Building, history: History) -> Floats:
    """The further signals, shape (n_signals, n_time, n_devices)."""
    rows = np.array([device.row for device in devices(rd1005())])
    of_device = history.acceleration @ np.linalg.pinv(building.floors).T @ rows.T
    ground = np.repeat(np.reshape(history.ground_acceleration, (-1, 1)), len(rows), axis=1)

    def floor(number: int) -> Floats:
        return np.repeat(history.acceleration[:, [number]], len(rows), axis=1)

    return np.stack(
        [
            of_device,
            ground,
            fading(history.rate, TIME),
            fading(ground, 2.0 * TIME),
            floor(4),
            fading(floor(2), TIME),
        ]
    )


def run_of(law: ControlLaw, hardware: Hardware | None = None) -> History:
    found = simulate_loop(five_storeys(), devices(rd1005()), law, [MOTION], hardware, histories=True)
    assert found.outcome[0] == Outcome.FINISHED
    return at_samples(found)


def signals_in_numpy(law: ControlLaw, history: History) -> Floats:
    wanted = -history.state @ np.asarray(law.gains["gain"]).T
    return np.stack([history.deformation, history.rate, history.force, wanted])


def test_a_network_takes_the_signals_that_numpy_takes() -> None:
    law = network_of()
    history = run_of(law)
    own, further = signals_in_numpy(law, history), further_in_numpy(five_storeys(), history)
    is_rms = np.array([each.time_constant is not None for each in SIGNALS])
    expected = []
    for device, network in enumerate(np.asarray(law.gains["network"])):
        weights = np.asarray(law.gains["further"])[device].reshape(len(SIGNALS), 4)
        total = network[-1]
        for unit, (bias, *of_own, output) in enumerate(network[:-1].reshape(4, 6)):
            odd = np.tensordot(of_own, own[..., device], 1)
            odd = odd + np.tensordot(weights[~is_rms, unit], further[~is_rms][..., device], 1)
            even = bias + np.tensordot(weights[is_rms, unit], further[is_rms][..., device], 1)
            total = total + output * (np.tanh(even + odd) + np.tanh(even - odd))
        expected.append(0.5 * LARGEST * (1.0 + np.tanh(total)))
    # The history has the force and the accelerations after the first command, which the first sample does not know.
    np.testing.assert_allclose(history.command[1:], np.column_stack(expected)[1:], rtol=1e-9, atol=1e-12)
    plain = run_of(law_with_gains("signal_network", plant_with(devices(rd1005()))))
    assert np.abs(plain.command - history.command).max() > 0.1


def test_a_polynomial_takes_the_signals_that_numpy_takes() -> None:
    law = polynomial_of()
    history = run_of(law)
    inputs = np.concatenate([signals_in_numpy(law, history), further_in_numpy(five_storeys(), history)])
    inputs = np.clip(inputs / np.reshape(law.tables["reach"], (-1, 1, 1)), -1.0, 1.0)
    share = sum(
        term[0] * np.prod(inputs ** term[1:, None, None], axis=0) for term in np.asarray(law.tables["terms"])
    )
    expected = np.clip(share, 0.0, 1.0) * LARGEST
    np.testing.assert_allclose(history.command[1:], expected[1:], rtol=1e-9, atol=1e-12)
    assert np.ptp(history.command) > 0.1


@pytest.mark.parametrize("law", [network_of(), polynomial_of()], ids=["network", "polynomial"])
def test_signals_have_the_same_bits_alone_and_in_a_batch(law: ControlLaw, instruction_set: str) -> None:
    hardware = Hardware(acceleration_noise=0.01, ground_acceleration_noise=0.01, delay=1e-3)
    alone = simulate_loop(five_storeys(), devices(rd1005()), law, [MOTION], hardware, threads=1)
    factors = np.linspace(0.5, 1.5, 11)
    factors[7] = 1.0
    gains = {name: np.multiply.outer(factors, np.asarray(gain)) for name, gain in law.gains.items()}
    batch = replace(law, gains=gains)
    many = simulate_loop(five_storeys(), devices(rd1005()), batch, [MOTION, sweep(0.3)], hardware, threads=2)
    for name, numbers in alone.numbers.items():
        np.testing.assert_array_equal(many.numbers[name][2 * 7], numbers[0], err_msg=name)


def test_a_reading_that_is_no_number_sends_nothing_and_leaves_the_mean() -> None:
    dead = Fault(channel="ground_acceleration", start=0.2, end=0.21, value=np.nan)
    law = network_of()
    found = simulate_loop(
        five_storeys(), devices(rd1005()), law, [MOTION], Hardware(faults=(dead,)), histories=True
    )
    assert found.outcome[0] == Outcome.FAILED_SAFE
    command = found.histories[0].command
    np.testing.assert_array_equal(command[200:210], 0.0)
    assert np.all(np.isfinite(command))
    assert np.all(command[210:] > 0.0)


def test_a_law_in_python_reads_the_same_running_root_mean_squares() -> None:
    seen: list[Floats] = []

    def command(sample: LoopSample, memory: Floats) -> Floats:
        seen.append(
            np.hstack([sample.rms.rate[0], sample.rms.ground_acceleration[0], sample.rms.acceleration[0]])
        )
        return np.minimum(10.0 * sample.rms.rate, sample.largest)

    law = UserLaw(name="severity", command=command, rms_time=TIME)
    found = simulate_loop(five_storeys(), devices(rd1005()), law, [MOTION], histories=True)
    history = at_samples(found)
    readings = np.hstack(
        [history.rate, np.reshape(history.ground_acceleration, (-1, 1)), history.acceleration]
    )
    np.testing.assert_allclose(np.array(seen)[-len(readings) :], fading(readings, TIME), rtol=1e-9)
    many = simulate_loop(five_storeys(), devices(rd1005()), replace(law, n_candidates=9), [MOTION])
    for name, numbers in found.numbers.items():
        np.testing.assert_array_equal(many.numbers[name][5], numbers[0], err_msg=name)


def problem(building: Building | None = None) -> DesignProblem:
    return DesignProblem(
        building=building or five_storeys(), devices=tuple(devices(rd1005())), sample_time=TS
    )


SCALED = {"control_weight": 1e-12, "deformation": 2e-3, "rate": 0.05, "force": 1e3}


def test_settings_name_the_signals_in_their_order() -> None:
    settings = {
        "signals": ("rms_rate", "acceleration"),
        "floors": (5, 1),
        "rms_floors": (2,),
        "acceleration": 4.0,
        "time_constant": 0.5,
    }
    weights = np.arange(20.0)
    law = design_law(
        "signal_network",
        problem(),
        {**SCALED, **settings, "network": [0.1] * 25, "further": weights.tolist()},
    )
    assert law.signals == (
        FurtherSignal(source="rate", time_constant=0.5),
        FurtherSignal(source="acceleration"),
        FurtherSignal(source="floor_acceleration", floor=4),
        FurtherSignal(source="floor_acceleration", floor=0),
        FurtherSignal(source="floor_acceleration", floor=1, time_constant=0.5),
    )
    expected = (weights.reshape(5, 4) / np.array([0.05, 4.0, 4.0, 4.0, 4.0])[:, None]).ravel()
    np.testing.assert_array_equal(law.gains["further"], np.tile(expected, (2, 1)))
    assert law.reads_acceleration
    polynomial = design_law(
        "signal_polynomial", problem(), {**SCALED, **settings, "terms": [[1.0, 0, 0, 1, 1]]}
    )
    np.testing.assert_array_equal(polynomial.tables["terms"], [1.0, 0, 0, 1, 1, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(
        polynomial.tables["reach"], [2e-3, 0.05, 1e3, 1e3, 0.05, 4.0, 4.0, 4.0, 4.0]
    )


def test_signals_that_no_law_or_building_has_are_told() -> None:
    network = {**SCALED, "network": [0.1] * 25}
    for given, word in (
        ({"signals": ["acceleration"], "further": [0.0] * 4}, "give acceleration"),
        ({"signals": ["rms_rate"], "time_constant": 1.0}, "further has 0 numbers"),
        ({"floors": [6], "acceleration": 1.0}, r"floors are \[6\]"),
    ):
        refusal(settings_of("signal_network", {**network, **given}).design, problem(), match=word)
    refusal(
        ControlLaw, name="passive", gains={"command": [1.0]}, signals=SIGNALS, match="leave `signals` out"
    )
    missing = replace(
        network_of(), signals=(*SIGNALS[:-1], FurtherSignal(source="floor_acceleration", floor=5))
    )
    refusal(simulate_loop, five_storeys(), devices(rd1005()), missing, [MOTION], match="floor of a signal 5")


CONTROLLER = """
[[controller]]
law = "signal_polynomial"
settings = {{ control_weight = 1e-12, deformation = "2 mm", rate = 0.05, force = 1e3, {} }}
"""


def read(folder: Path, more: str) -> mr.Study:
    motions = tuning_samples.motion("A", 1)
    return mr.read_study(tuning_samples.study_file(folder, tune="", motions=motions, more=more))


def test_a_study_reads_signals_with_their_units_and_runs_them(tmp_path: Path) -> None:
    noise = 'acceleration_noise = "0.05 m/s2"\n'
    ground = CONTROLLER.format(
        'terms = [[1.0, 0, 0, 0, 0, 1]], signals = ["rms_ground_acceleration"], acceleration = "0.1 g", '
        'time_constant = "500 ms"'
    )
    floors = CONTROLLER.format('terms = [[1.0, 0, 0, 0, 0, 2]], floors = [5], acceleration = "0.3 g"')
    # No accelerometer is read by the first one.
    refusal(read, tmp_path, noise + ground, match="line 14: `acceleration_noise` has no effect")
    study = read(tmp_path, noise + floors)
    other = read(tmp_path, noise + floors.replace("[5]", "[4]"))
    assert fingerprint_of(study) != fingerprint_of(other)
    found = mr.run_study(
        read(tmp_path, floors + ground.replace("[[controller]]", '[[controller]]\nlabel = "g"'))
    )
    for row in (3, 4):
        assert found.runs[row, 0].finished
        assert found.runs[row, 0].command_travel.max() > 0.0
    unmeasured = 'feedback = "observer"\nmeasured_floors = [1, 2]\n'
    refusal(read, tmp_path, unmeasured + floors, match="floor 5, .* has no accelerometer")


def test_a_space_without_further_signals_is_what_it_was(tmp_path: Path) -> None:
    study = mr.read_study(tuning_samples.study_file(tmp_path))
    bench = benches_of(study, journal=None, threads=1, clock=Clock()).training
    magnitudes = magnitudes_of(bench)
    plain = space_of(TuneTable(laws=("signal_network",)), "signal_network", magnitudes)
    assert not {"further", "acceleration"} & {*plain.held, *(each.name for each in plain.free)}
    signals = {"signals": ("acceleration",), "floors": (1, 2)}
    more = space_of(TuneTable(laws=("signal_network",), settings=signals), "signal_network", magnitudes)
    further = [each for each in more.free if each.name == "further"]
    assert len(further) == 12
    assert more.candidate(more.start).settings["further"] == (0.0,) * 12
    assert more.held["acceleration"] == pytest.approx(magnitudes.acceleration, rel=1e-3)
