"""Realisations of building, delay and noise run side by side, each with the bits that it has alone."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from loop_samples import devices, five_storeys, friction, law_with_gains, plant_with, rd1005, sweep
from refusals import refusal

from mrwork.buildings import Building, with_yielding_damper
from mrwork.closed_loop import Hardware, LoopSample, Responses, UserLaw, simulate_loop
from mrwork.closed_loop.core_loop import RunsOfLoop
from mrwork.closed_loop.simulate import LoopVariation
from mrwork.control import ControlLaw
from mrwork.motions import GroundMotion

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
STIFFNESS = (1.0, 0.8, 1.3, 0.95, 1.0, 1.1, 0.8, 1.2, 0.7, 1.05)
DELAY = 1e-3 * np.array([0.0, 1.0, 0.5, 4.0, 4.0, 0.0, 2.5, 1.0, 7.0, 0.5])
SEED = np.array([0, 5, 2, 2, 3, 1, 0, 9, 8, 4])
HARDWARE = {
    "state": Hardware(),
    "noisy observer": Hardware(
        feedback="observer", acceleration_noise=0.01, force_noise=1.0, delay=2e-3, command_rate=100.0, seed=3
    ),
}
CASES = (
    ("clipped_optimal", "state"),
    ("maximum_energy_dissipation", "state"),
    ("inverse_network", "noisy observer"),
    ("predictive_rollout", "noisy observer"),
)


def scaled(building: Building, factor: float) -> Building:
    return replace(building, stiffness=factor * building.stiffness, damping=factor**0.5 * building.damping)


def dense(building: Building) -> Building:
    """A building whose rows are not those of a chain."""
    coupling = 0.02 * building.stiffness[0, 0] * np.ones_like(building.stiffness)
    return replace(building, stiffness=building.stiffness + coupling)


BUILDINGS = {
    "chain": five_storeys(),
    "every floor to every other": dense(five_storeys()),
    "yielding": with_yielding_damper(five_storeys(), storey=1, yield_force=500.0, yield_displacement=2e-3),
}


def law_of(name: str) -> ControlLaw:
    return law_with_gains(name, plant_with(devices(rd1005())))


def realised(
    building: Building, law: ControlLaw | UserLaw, hardware: Hardware, *, model: str = "rd1005"
) -> tuple[Responses, list[Responses]]:
    """All realisations in one call, and each in a call of its own, in the building and with the hardware that it is."""
    loop = devices(rd1005() if model == "rd1005" else friction())
    motions: list[GroundMotion] = [sweep(0.3), sweep(0.4)]
    buildings = [building if factor == 1.0 else scaled(building, factor) for factor in STIFFNESS]
    nominal = building if hardware.feedback == "observer" else None
    together = simulate_loop(
        building,
        loop,
        law,
        motions,
        hardware,
        nominal=nominal,
        variation=LoopVariation(buildings=tuple(buildings), delay=DELAY, seed=SEED),
        threads=2,
    )
    alone = [
        simulate_loop(
            own,
            loop,
            law,
            motions,
            replace(hardware, delay=hardware.delay + delay, seed=hardware.seed + int(seed)),
            nominal=nominal,
            threads=1,
        )
        for own, delay, seed in zip(buildings, DELAY, SEED, strict=True)
    ]
    return together, alone


def assert_same_bits(together: Responses, alone: list[Responses]) -> None:
    for place, each in enumerate(alone):
        for name, numbers in each.numbers.items():
            packed = together.numbers[name][place :: len(alone)]
            if name == "peak_frame_shear" and np.isnan(packed).all():
                continue  # not known of elements beside springs that differ
            np.testing.assert_array_equal(packed, numbers, err_msg=f"{name} of realisation {place}")
        np.testing.assert_array_equal(together.steps[place :: len(alone)], each.steps)


@pytest.mark.parametrize(("name", "hardware"), CASES)
def test_a_realisation_has_the_bits_that_it_has_alone(name: str, hardware: str) -> None:
    together, alone = realised(five_storeys(), law_of(name), HARDWARE[hardware])
    assert_same_bits(together, alone)
    assert np.unique(together.peak_drift[:, 0]).size > len(STIFFNESS)


@pytest.mark.parametrize("building", BUILDINGS.values(), ids=BUILDINGS)
def test_every_form_of_a_building_is_packed(building: Building) -> None:
    assert_same_bits(*realised(building, law_of("clipped_optimal"), Hardware(delay=1e-3)))


def test_dampers_without_a_driver_and_with_states_are_packed() -> None:
    """A driver without lag passes its command at once: it hears those of other delays between its own."""
    law = law_of("maximum_energy_dissipation")
    assert_same_bits(*realised(five_storeys(), law, Hardware(delay=1e-3), model="friction"))


def test_a_law_in_python_sees_the_realisations() -> None:
    def command(sample: LoopSample, memory: Floats) -> Floats:
        memory[:, 0] += 1.0
        return np.where(sample.force * sample.rate > 0.0, sample.largest, 1e-3 * memory[:, :1])

    law = UserLaw(name="dissipation", command=command, n_memory=1)
    assert_same_bits(*realised(five_storeys(), law, Hardware()))


def test_instruction_sets_change_no_bit(
    of_instruction_sets: Callable[[Callable[[], Responses]], list[Responses]],
) -> None:
    *others, plain = of_instruction_sets(
        lambda: realised(five_storeys(), law_of("clipped_optimal"), Hardware())[0]
    )
    for other in others:
        for name, numbers in plain.numbers.items():
            np.testing.assert_array_equal(other.numbers[name], numbers, err_msg=name)


def test_what_is_no_realisation_is_refused() -> None:
    building, loop, law = five_storeys(), devices(rd1005()), law_of("clipped_optimal")
    heavier = replace(building, name="heavier", mass=2.0 * building.mass)
    still = {"delay": np.zeros(2), "seed": np.zeros(2, dtype=np.int64)}
    drawn = [replace(each, theta=np.tile(each.draws, (3, 1))) for each in loop]
    for given, other, word in (
        (loop, heavier, "stiffness and damping only"),
        (drawn, building, "3 draws, and there are 2 realisations"),
    ):
        variation = LoopVariation(buildings=(building, other), **still)
        refusal(simulate_loop, building, given, law, [sweep(0.1)], variation=variation, match=word)


def test_a_part_of_the_runs_has_the_rows_that_it_uses() -> None:
    candidate, motion, draw = np.indices((6, 2, 3), dtype=np.uint32).reshape(3, -1)
    zeros = np.zeros_like(motion)
    whole = RunsOfLoop(
        runs=np.column_stack([candidate, motion, draw, zeros, zeros]),
        streams=np.arange(36, dtype=np.uint64),
        gains=np.arange(12.0).reshape(6, 2),
        settings=np.arange(6.0)[:, None],
        shaping=None,
        theta=(np.arange(12.0).reshape(3, 1, 4),),
    )
    for which in (slice(0, 2), slice(7, 15), slice(30, 36)):
        part = whole.part(which)
        assert len(part.gains) == len({*candidate[which]})
        np.testing.assert_array_equal(part.gains[part.runs[:, 0]], whole.gains[candidate[which]])
        np.testing.assert_array_equal(part.settings[part.runs[:, 0], 0], candidate[which])
        np.testing.assert_array_equal(part.theta[0][part.runs[:, 2]], whole.theta[0][draw[which]])
        np.testing.assert_array_equal(part.streams, whole.streams[which])
