"""Stability margins: at each of them the sampled loop itself, built sample by sample, is at its limit of stability."""

import numpy as np
import pytest
import scipy

import mrwork as mr
from mrwork.base.values import Floats

STEP = 1e-3


def plant_with(devices: int) -> mr.control.Plant:
    frame = mr.building("uts")
    return mr.control.plant_of(frame, frame.storeys[:devices])


def spectral_radius(
    plant: mr.control.Plant, gain: Floats, *, delay: int, rate: float | None, factors: Floats, held: Floats
) -> float:
    """Largest pole of the loop with the desired forces times factors, `held` the samples that each is late."""
    m, n = plant.n_devices, len(plant.A)
    A, B = plant.A, plant.B
    if rate is not None:
        A = np.block([[A, B], [np.zeros((m, n)), -rate * np.eye(m)]])
        B = np.vstack([np.zeros((n, m)), rate * np.eye(m)])
    F, G, *_ = scipy.signal.cont2discrete((A, B, np.eye(len(A)), np.zeros((len(A), m))), STEP)
    late = [delay + int(each) for each in held]
    size = len(A) + sum(late)
    loop = np.zeros((size, size))
    loop[: len(A), : len(A)] = F
    K = np.hstack([factors[:, None] * gain, np.zeros((m, len(A) - n))])
    start = len(A)
    for number, samples in enumerate(late):
        if not samples:
            loop[: len(A), : len(A)] -= np.outer(G[:, number], K[number])
            continue
        loop[: len(A), start] = G[:, number]
        loop[start : start + samples - 1, start + 1 : start + samples] = np.eye(samples - 1)
        loop[start + samples - 1, : len(A)] = -K[number]
        start += samples
    return float(np.abs(np.linalg.eigvals(loop)).max())


CASES = [(1, 0, None), (1, 0, 190.0), (1, 4, 190.0), (2, 2, None), (2, 3, 190.0)]


def margins_of(
    devices: int, delay: int, rate: float | None
) -> tuple[mr.control.Plant, Floats, mr.control.LoopMargins]:
    plant = plant_with(devices)
    gain = mr.control.regulator_of_state(plant, plant.energy, 1e-5).gain
    rates = (rate,) * devices
    found = mr.control.loop_margins(plant, gain, sample_time=STEP, delay=delay * STEP, driver_rates=rates)
    assert found.stable
    return plant, gain, found


@pytest.mark.parametrize(("devices", "delay", "rate"), CASES)
def test_the_loop_is_at_its_limit_with_the_gain_times_its_margin(
    devices: int, delay: int, rate: float | None
) -> None:
    plant, gain, found = margins_of(devices, delay, rate)
    for number, margins in enumerate(found.devices):
        for factor in (margins.gain_up, margins.gain_down):
            if not 0.0 < factor < np.inf:
                continue
            radii = []
            for share in (1.0 - 1e-4, 1.0, 1.0 + 1e-4):
                factors = np.ones(devices)
                factors[number] = share * factor
                radii.append(
                    spectral_radius(
                        plant, gain, delay=delay, rate=rate, factors=factors, held=np.zeros(devices)
                    )
                )
            assert radii[1] == pytest.approx(1.0, abs=1e-7)
            assert min(radii[0], radii[2]) < 1.0 < max(radii[0], radii[2])


@pytest.mark.parametrize(("devices", "delay", "rate"), CASES)
def test_the_loop_is_stable_up_to_its_delay_margin(devices: int, delay: int, rate: float | None) -> None:
    plant, gain, found = margins_of(devices, delay, rate)
    for number, margins in enumerate(found.devices):
        whole = int(margins.delay / STEP)
        for more, stable in ((whole, True), (whole + 1, False)):
            held = np.zeros(devices)
            held[number] = more
            radius = spectral_radius(plant, gain, delay=delay, rate=rate, factors=np.ones(devices), held=held)
            assert (radius < 1.0) == stable


def test_a_regulator_of_the_state_without_lag_has_sixty_degrees() -> None:
    """Its return difference is at least 1 (Kalman 1964); sampling at 0.1 ms takes a little of it."""
    plant = plant_with(1)
    gain = mr.control.regulator_of_state(plant, plant.energy, 1e-5).gain
    (margins,) = mr.control.loop_margins(plant, gain, sample_time=1e-4).devices
    assert margins.phase > 59.0
    assert margins.gain_down == 0.0


def test_an_unstable_loop_is_said_to_be_so_and_has_no_margins() -> None:
    plant = plant_with(1)
    gain = mr.control.regulator_of_outputs(plant, mr.control.drifts(plant), 1.0, 1e-14).gain
    found = mr.control.loop_margins(plant, gain, sample_time=1e-3, delay=5e-3, driver_rates=[190.0])
    assert not found.stable
    assert not found.devices
    assert "is not stable" in found.in_words


def test_a_delay_of_part_of_a_sample_lies_between_those_of_whole_samples() -> None:
    plant = plant_with(1)
    gain = mr.control.regulator_of_state(plant, plant.energy, 1e-5).gain
    delays = [
        mr.control.loop_margins(plant, gain, sample_time=STEP, delay=share * STEP).devices[0].delay
        for share in (0.0, 0.5, 1.0)
    ]
    assert delays[0] - delays[1] == pytest.approx(0.5 * STEP, rel=0.02)
    assert delays[0] - delays[2] == pytest.approx(STEP, rel=1e-6)


def test_rounding_is_no_decay_and_no_margin() -> None:
    """An undamped frame at rest is not stable, and with a dashpot it has no least gain."""
    frame = mr.buildings.shear_building(name="four", masses=[300.0] * 4, stiffnesses=[4e5] * 4)
    plant = mr.control.plant_of(frame, frame.storeys[:1])
    assert not mr.control.loop_margins(plant, np.zeros((1, 8))).stable
    regulator = mr.control.regulator_of_state(plant, plant.energy, 1e-5)
    margins = mr.control.loop_margins(plant, regulator.gain)
    assert margins.stable
    assert margins.devices[0].gain_down == 0.0
