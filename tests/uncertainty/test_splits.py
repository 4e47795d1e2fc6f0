"""Splits of a choice and motions kept for test: ends of the tested motions stay together, errors weigh the same."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.dampers import damper
from mrwork.identification.result import BuildingCost
from mrwork.identification.settings import FitSettings
from mrwork.records import DamperTest
from mrwork.uncertainty.bands.held_out import median_place, uses_of
from mrwork.uncertainty.choice.dependence_search import prepare_search
from mrwork.uncertainty.choice.objections import objections_to
from mrwork.uncertainty.choice.splits import splits_of

# Peak velocities of 31, 63, 63, 94 and 126 mm/s.
MOTIONS = ((0.010, 0.5), (0.010, 1.0), (0.005, 2.0), (0.005, 3.0), (0.020, 1.0))
CHEAP = BuildingCost(steps=2)


def sinusoids(*commands: float, motions: tuple[tuple[float, float], ...] = MOTIONS) -> tuple[DamperTest, ...]:
    return tuple(
        sinusoidal_test("viscous_dahl", (800.0, 300.0, 2000.0, 20.0), motion, noise=0.02, command=command)
        for motion, command in product(motions, commands)
    )


def test_the_fastest_the_slowest_and_the_largest_motions_are_left_out_with_what_lies_beyond() -> None:
    splits = splits_of(sinusoids(0.0, 1.0), "motion")
    beyond = {each.members: each.beyond for each in splits.splits if each.beyond}
    # The largest motion is the fastest, too.
    assert beyond == {(8, 9): ("fastest", "largest"), (0, 1): ("slowest",)}
    assert len(splits.splits) == len(MOTIONS)
    assert splits.units == (0, 0, 1, 1, 2, 2, 3, 3, 4, 4)
    assert "each predicted without the tests of its motion" in splits.in_words


def test_three_motions_that_are_all_ends_keep_the_degrees_of_all_commands() -> None:
    tests = sinusoids(0.0, 0.5, 1.0, motions=((0.010, 0.5), (0.005, 3.0), (0.012, 1.0)))
    assert all(split.beyond for split in splits_of(tests, "motion").splits)
    plain = damper("viscous_dahl").without_laws
    search = prepare_search(plain, tests, {}, "A", None, FitSettings(), threads=1)
    assert (search.folds.splits.fold, search.most) == ("motion", 2)


def test_an_end_that_takes_too_much_is_dropped_and_said() -> None:
    both = (*sinusoids(0.0), *sinusoids(1.0, motions=MOTIONS[-1:]))
    splits = splits_of(both, "test")
    assert [each for split in splits.splits for each in split.beyond] == ["slowest"]
    assert [each.words[0] for each in splits.remarks] == ["fastest", "largest"]


def test_both_kinds_weigh_the_same_motion_by_motion() -> None:
    splits = splits_of(sinusoids(0.0), "motion")
    inside = [0.2 if not split.beyond else 0.4 for split in splits.splits]
    errors = splits.errors([np.array([each]) for each in inside])
    assert errors.shape == (5,)
    assert errors.mean() == pytest.approx(0.3)
    assert splits.means([np.array([each]) for each in inside]) == pytest.approx((0.2, 0.4))


def test_a_law_that_vanishes_and_a_force_that_falls_are_objections() -> None:
    tests = sinusoids(0.0, 1.0)
    spec = damper("viscous_dahl").with_current_laws({"k_w": "linear"})
    assert not [*objections_to(spec, np.array([800.0, 200.0, 300.0, 2000.0, 0.0]), tests, CHEAP)]
    (dying,) = objections_to(spec, np.array([800.0, 1e-3, 300.0, 2000.0, 0.0]), tests, CHEAP)
    assert (dying.code, dying.words) == ("law_leaves_range", ("k_w",))
    thinning = damper("shear_thinning_modified_bouc_wen")
    values = {"c0": 1e-3, "c2": 5000.0, "v_s": 0.03, "k0": 1e-3, "c1": 1e7, "k_w": 50.0}
    theta = np.array(
        [values.get(name, value) for name, value in zip(thinning.names, thinning.nominal, strict=True)]
    )
    (falling,) = objections_to(thinning, theta, tests, CHEAP)
    assert falling.code == "force_falls"
    (costly,) = objections_to(
        spec, np.array([800.0, 200.0, 300.0, 2000.0, 0.0]), tests, BuildingCost(steps=np.inf)
    )
    assert costly.code == "too_stiff_for_building"


COMMANDS = (0.0, 0.5, 1.0)


def sinusoid(amplitude: float, frequency: float, current: float) -> DamperTest:
    """A sinusoid of a viscous damper; amplitude in mm."""
    time = np.arange(0.0, 3.0 / frequency, 0.005 / frequency)
    phase = 2.0 * np.pi * frequency * time
    velocity = 2e-3 * np.pi * frequency * amplitude * np.cos(phase)
    return mr.test_from_arrays(
        name=f"{amplitude:g}mm{frequency:g}Hz{current:g}A",
        time=time,
        displacement=1e-3 * amplitude * np.sin(phase),
        velocity=velocity,
        force=(1.0 + current) * 1e3 * velocity + 20.0 * np.sin(3.0 * phase),
        current=current,
    )


def uses(*motions: tuple[float, float]) -> dict[tuple[float, float], str]:
    """The use of each motion, which is that of all its commands."""
    every = [(motion, sinusoid(*motion, current)) for motion in motions for current in COMMANDS]
    found = uses_of([test for _, test in every])
    by_motion: dict[tuple[float, float], set[str]] = {}
    for (motion, _), use in zip(every, found, strict=True):
        by_motion.setdefault(motion, set()).add(use)
    assert all(len(each) == 1 for each in by_motion.values()), "a motion is split"
    return {motion: each.pop() for motion, each in by_motion.items()}


def test_extremes_are_fitted_and_whole_motions_between_them_are_kept() -> None:
    found = uses((25, 0.1), (25, 0.25), (25, 0.5), (10, 1), (5, 3), (2, 5))
    assert {found[25, 0.1], found[2, 5], found[5, 3]} == {"fit"}
    assert sorted(found.values()) == ["calibration", "fit", "fit", "fit", "fit", "test"]


@pytest.mark.parametrize("motions", [[(10, 1)], [(10, 1), (2, 5)]], ids=["one", "extremes"])
def test_where_no_motion_lies_between_others_all_are_fitted(motions: list[tuple[float, float]]) -> None:
    assert set(uses(*motions).values()) == {"fit"}


def test_a_record_of_a_varying_command_is_fitted() -> None:
    """It alone shows the lag of the driver, and lies between the extremes of the others."""
    tests = [sinusoid(*motion, 0.5) for motion in ((25, 0.1), (25, 0.25), (25, 0.5), (10, 1), (5, 3), (2, 5))]
    middle = sinusoid(12, 0.8, 0.5)
    switched = replace(middle, current=np.where(middle.time % 0.7 < 0.3, 0.0, 1.0), name="switched")
    found = uses_of([*tests, switched])
    assert found[-1] == "fit"
    assert {"test", "calibration"} <= {*found}
    assert uses_of(tests) == found[:-1]


def test_a_single_motion_between_others_is_kept_for_test() -> None:
    found = uses((20, 0.2), (8, 1), (3, 4))
    assert (found[8, 1], list(found.values()).count("fit")) == ("test", 2)


def test_the_median_of_two_is_the_other() -> None:
    assert [median_place(count) for count in (1, 2, 3, 4, 5)] == [0, 1, 1, 1, 2]
