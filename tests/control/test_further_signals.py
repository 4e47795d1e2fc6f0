"""Accelerations and running root mean squares as signals of laws of measured signals: as in NumPy, with their bits."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from loop_samples import LARGEST, at_samples, devices, five_storeys, law_with_gains, plant_with, rd1005, sweep

from mrwork.buildings import Building
from mrwork.closed_loop import Hardware, History, LoopSample, UserLaw, simulate_loop
from mrwork.control import ControlLaw, FurtherSignal
from mrwork.dampers.simulation import Outcome

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
