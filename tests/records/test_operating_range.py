"""Tested ranges follow from the tests, and demand outside of them is named quantity by quantity."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.base.remark import Measured
from mrwork.dampers import damper
from mrwork.dampers.tested_range import Outside, covering, outside_of, worst_of
from mrwork.records import DamperTest, OperatingRange
from mrwork.records.damper_test import Exceedance, range_of_test, range_of_tests
from mrwork.uncertainty.candidate_tests import excitation_of

BINGHAM = (400.0, 1e-3, 900.0, 0.0)


def a_test(amplitude: float, frequency: float, current: float | None = None):
    test = sinusoidal_test("bingham", BINGHAM, (amplitude, frequency), noise=0.0, cycles=6)
    return replace(test, current=current)


def ranges(**changes: object) -> OperatingRange:
    usual = OperatingRange(
        stroke=0.025,
        velocity=0.088,
        frequency=(0.1, 5.0),
        command=(0.25, 1.0),
        command_unit="A",
        force=1560.0,
        power=60.0,
    )
    return replace(usual, **changes)


@pytest.mark.parametrize("frequency", [0.997, 1.5, 2.5, 3.37])
def test_the_frequency_of_a_sinusoid_does_not_depend_on_where_its_cycles_are_sampled(
    frequency: float,
) -> None:
    time = 0.005 * np.arange(801)
    displacement = 0.01 * np.sin(2.0 * np.pi * frequency * time)
    noise = 5e-6 * np.random.default_rng(1).standard_normal(time.size)
    test = mr.test_from_arrays(
        name="sine", time=time, displacement=displacement + noise, force=1e3 * displacement, synthetic=True
    )
    found = range_of_test(test, None).frequency
    # Noise moves a crossing by 5e-6 / (0.01 x 2 pi) periods, so a length by 1.1e-4 of itself.
    assert found == pytest.approx((frequency, frequency), rel=5e-4)


@pytest.mark.parametrize("cycles", [1.2, 1.7, 2.0])
def test_the_frequency_of_a_record_without_a_whole_cycle_is_that_of_its_halves(cycles: float) -> None:
    time = 0.005 * np.arange(round(cycles / 0.5 / 0.005))
    displacement = 0.01 * np.sin(2.0 * np.pi * 0.5 * time)
    test = mr.test_from_arrays(
        name="slow", time=time, displacement=displacement, force=1e3 * displacement, synthetic=True
    )
    found = range_of_test(test, None).frequency
    # The mean of the displacement moves crossings by up to a tenth of a period.
    assert found == pytest.approx((0.5, 0.5), rel=0.2)


def test_ranges_of_a_sinusoid_are_those_of_its_equation() -> None:
    found = range_of_tests([a_test(0.01, 2.0, 0.5)])
    assert found.stroke == pytest.approx(0.01, rel=1e-6)
    assert found.velocity == pytest.approx(2.0 * np.pi * 2.0 * 0.01, rel=1e-3)
    assert found.frequency is not None
    assert found.frequency == pytest.approx((2.0, 2.0), rel=0.02)
    assert (found.command, found.command_unit) == ((0.5, 0.5), "A")
    # Coulomb friction and viscous damping; the step of the sign takes a little of the peak velocity.
    assert found.force == pytest.approx(400.0 + 900.0 * found.velocity, rel=1e-2)
    assert found.power == pytest.approx(400.0 * 4 * 0.01 * 2.0 + 0.5 * 900.0 * found.velocity**2, rel=0.05)


def test_the_force_of_a_model_counts_where_it_is_compared() -> None:
    """A state at rest under a motion that begins at speed gives one sample of many times the force."""
    test = replace(a_test(0.01, 2.0), n_settle=20, uncompared=((100, 110),))
    force = test.force.copy()
    force[[0, 105]] = -1e5
    found, expected = (range_of_test(test, None, each) for each in (force, test.force))
    assert (found.force, found.power) == (expected.force, expected.power)
    assert found.force < 1e3


def test_an_offset_of_the_displacement_is_no_stroke() -> None:
    moved = replace(a_test(0.01, 2.0), displacement=a_test(0.01, 2.0).displacement + 0.2)
    assert range_of_tests([moved]).stroke == pytest.approx(0.01, rel=1e-6)
    assert excitation_of(moved).amplitude == pytest.approx(0.01, rel=1e-4)


def test_tests_together_cover_each() -> None:
    found = range_of_tests([a_test(0.02, 0.5, 0.25), a_test(0.002, 5.0, 1.0), a_test(0.01, 1.0)])
    assert found.stroke == pytest.approx(0.02, rel=1e-6)
    assert found.frequency == pytest.approx((0.5, 5.0), rel=0.05)
    assert found.command == (0.25, 1.0)


def test_the_unit_is_that_of_the_laws_or_of_most_tests() -> None:
    volts = [replace(a_test(0.01, 1.0), voltage=2.0), replace(a_test(0.01, 1.0, 0.5), voltage=3.0)]
    assert range_of_tests(volts).command == (2.0, 3.0)
    assert range_of_tests(volts, "A").command == (0.5, 0.5)
    assert range_of_tests([a_test(0.01, 1.0)]).command is None


@pytest.mark.parametrize(
    ("changes", "sentences"),
    [
        ({"velocity": 0.313}, ["velocity 313 mm/s, tested to 88 mm/s (3.6 times)"]),
        ({"force": 2870.0}, ["force 2.87 kN, tested to 1.56 kN (1.8 times)"]),
        ({"force": 1650.0}, ["force 1.65 kN, tested to 1.56 kN (1.06 times)"]),
        ({"force": 990.0}, []),
        ({"command": (0.0, 1.0)}, ["command 0 A, tested from 0.25 to 1 A"]),
        ({"command": (0.24, 1.04)}, []),
        ({"command": (0.5, 2.0)}, ["command 2 A, tested from 0.25 to 1 A (2 times)"]),
        ({"frequency": (0.05, 1.0)}, ["frequency 0.05 Hz, tested from 0.1 to 5 Hz"]),
        ({"frequency": (1.0, 10.0)}, ["frequency 10 Hz, tested from 0.1 to 5 Hz (2 times)"]),
        ({"stroke": 0.026, "velocity": 0.09, "power": 62.0}, []),
        (
            {"stroke": 0.05, "power": 120.0},
            ["stroke 50 mm, tested to 25 mm (2 times)", "mean power 120 W, tested to 60 W (2 times)"],
        ),
        ({"command": None}, []),
        ({"command": (0.0, 5.0), "command_unit": "V"}, []),
    ],
)
def test_a_sentence_for_each_quantity_outside_and_no_other(
    changes: dict[str, object], sentences: list[str]
) -> None:
    found = ranges().exceeded_by(ranges(**changes))
    assert [each.in_words for each in found] == sentences


def an_earthquake(large: float, small: float, n_small: int) -> DamperTest:
    """Two cycles of a large amplitude [m], then `n_small` half cycles of a small one, from peak to peak."""
    per_half = 30
    phase = np.pi * np.arange(per_half) / per_half
    ranges = [large] * 4 + [small] * n_small
    direction = np.resize([1.0, -1.0], len(ranges))
    ends = np.concatenate([[0.0], np.cumsum(direction * 2.0 * np.array(ranges))])
    parts = [start + 0.5 * (end - start) * (1.0 - np.cos(phase)) for start, end in pairwise(ends)]
    displacement = np.concatenate([*parts, ends[-1:]])
    test = a_test(large, 1.0)
    return replace(
        test,
        displacement=displacement,
        velocity=np.gradient(displacement, test.dt),
        force=np.resize(test.force, displacement.size),
    )


@pytest.mark.parametrize(("n_small", "warned"), [(0, False), (7, False), (20, True), (80, True)])
def test_travel_in_half_cycles_below_the_smallest_tested_is_named_above_a_fifth(
    n_small: int, warned: bool
) -> None:
    tested = range_of_tests([a_test(0.013, 1.0), a_test(0.038, 0.5)])
    assert tested.least_stroke == pytest.approx(0.013, rel=1e-3)
    demand = range_of_test(an_earthquake(0.030, 0.002, n_small), None)
    below = [each for each in tested.exceeded_by(demand) if each.below and each.quantity == "stroke"]
    assert [
        "2 mm or less, make 20 % of the travel or more, tested from 13 mm" in str(each.in_words)
        for each in below
    ] == [True] * warned


def test_the_share_of_the_travel_counts_without_the_ends_and_without_noise() -> None:
    for cycles in (1, 2, 3, 10):
        test = sinusoidal_test("bingham", BINGHAM, (0.01, 2.0), noise=0.0, cycles=cycles)
        noise = 1e-5 * np.random.default_rng(cycles).standard_normal(test.n_time)
        found = range_of_test(replace(test, displacement=test.displacement + noise), None)
        assert found.least_stroke == pytest.approx(0.01, rel=0.01)


def test_a_single_tested_command_is_named_as_such() -> None:
    (found,) = ranges(command=(0.5, 0.5)).exceeded_by(ranges(command=(1.0, 1.0)))
    assert found.in_words == "command 1 A, tested at 0.5 A (2 times)"
    (found,) = ranges(command=(0.0, 0.0)).exceeded_by(ranges(command=(1.0, 1.0)))
    assert found.in_words == "command 1 A, tested at 0 A"


@given(st.lists(st.floats(0.1, 10.0), min_size=5, max_size=5), st.floats(1.0, 10.0))
def test_what_covers_a_demand_is_not_exceeded_by_it(sizes: list[float], share: float) -> None:
    stroke, velocity, frequency, command, force = sizes
    demand = ranges(
        **{"stroke": stroke, "velocity": velocity, "force": force, "power": stroke, "command_unit": "V"},
        frequency=(frequency, share * frequency),
        command=(command, share * command),
    )
    assert covering([demand, ranges(command_unit="V")]).exceeded_by(demand) == ()


def test_the_worst_of_many_is_kept_with_its_label_and_their_number() -> None:
    found = [
        (
            f"test {number}",
            Outside(exceedances=ranges().exceeded_by(ranges(velocity=velocity, command=(0.0, 0.5)))),
        )
        for number, velocity in enumerate((0.1, 0.3, 0.2))
    ]
    worst = worst_of(found)
    assert [(each.quantity, label, count) for each, label, count in worst] == [
        ("velocity", "test 1", 3),
        ("command", "test 0", 3),
    ]
    assert isinstance(worst[0][0], Exceedance)


def test_a_command_outside_names_the_laws_that_are_extrapolated_and_those_out_of_range() -> None:
    spec = damper("dahl").with_current_laws({"k_w": "linear"}, unit="A")
    found = outside_of(spec, [-100.0, 900.0, 2000.0, 0.0], ranges(), ranges(command=(0.0, 0.0)))
    assert found.names == ("command",)
    command, law = found.remarks
    assert (command.code, command.measured) == ("outside_tested_range", Measured(0.0, "A"))
    assert "tested from 0.25 to 1 A; the law of k_w is extrapolated" in command.message
    assert (law.code, law.words, law.measured) == ("law_leaves_range_beyond", ("k_w",), Measured(-100.0, "N"))
    assert outside_of(spec, [100.0, 900.0, 2000.0, 0.0], ranges(), ranges()).remarks == ()
    unknown = outside_of(spec, [100.0, 900.0, 2000.0, 0.0], None, ranges())
    assert (unknown.known, unknown.names) == (False, ())


@pytest.mark.parametrize(
    ("levels", "gap"),
    [
        ((0.0, 0.5, 1.5), (0.5, 1.5)),
        ((0.0, 0.2, 0.4, 1.0), (0.4, 1.0)),
        ((0.0, 1.5, 2.0, 2.5), (0.0, 1.5)),
        # Even, doubled, few or one to rounding.
        ((0.0, 0.25, 0.5, 0.75, 1.0), None),
        ((0.0, 1.0, 2.0), None),
        ((0.25, 0.5, 1.0, 2.0), None),
        ((0.0, 1.0), None),
        ((0.0, 0.01, 1.5), None),
        ((), None),
    ],
)
def test_a_gap_between_commands_is_far_wider_than_every_other(
    levels: tuple[float, ...], gap: tuple[float, float] | None
) -> None:
    assert ranges(levels=levels).gap == gap


def test_a_command_in_a_gap_of_the_tested_ones_is_outside() -> None:
    tested = range_of_tests([a_test(0.01, 1.0, current) for current in (0.0, 0.5, 1.5)])
    assert tested.levels == (0.0, 0.5, 1.5)
    assert dict(tested.rows())["command"] == "0 to 1.5 A without tests between 0.5 and 1.5 A"
    assert all(
        tested.exceeded_by(range_of_test(a_test(0.01, 1.0, current), "A")) == ()
        for current in (*tested.levels, 0.25)
    )
    (found,) = tested.exceeded_by(range_of_test(a_test(0.01, 1.0, 1.0), "A"))
    assert (found.quantity, found.between) == ("command", True)
    assert found.in_words == "command 1 A, tested up to 0.5 A and from 1.5 A"
    # Of a building only the ends of the command are known.
    assert tested.exceeded_by(replace(tested, levels=())) == ()
    (found,) = tested.exceeded_by(replace(tested, levels=(), command=(0.0, 1.0)))
    assert found.demanded == 1.0
