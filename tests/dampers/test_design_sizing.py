"""Sizing: what it promises, whatever the search; refusals."""

import math
import signal
import sys
from dataclasses import replace
from types import FrameType

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from refusals import refusal

from mrwork import Progress
from mrwork.dampers.design import DamperWishes, fluid, size_damper, steel, twenty_ton_damper
from mrwork.dampers.design.sizing import N_FREE, SizedDamper, candidate
from mrwork.errors import Interrupted

WISHES = DamperWishes(
    force=2e3,
    dynamic_range=8.0,
    stroke=0.025,
    velocity=0.1,
    outer_diameter=0.08,
    length=0.2,
    voltage=12.0,
    current=2.0,
    friction=30.0,
)
FLUID, STEEL = fluid("MRF-132DG"), steel("AISI 1010")


@pytest.fixture(scope="module")
def sized() -> SizedDamper:
    """A damper for the wishes."""
    return size_damper(WISHES, fluid=FLUID, steel=STEEL, budget=400)


def test_sized_damper_meets_every_wish(sized: SizedDamper) -> None:
    design = sized.design
    assert WISHES.missed(design) == {}
    assert design.largest_force >= WISHES.force
    assert design.dynamic_range >= WISHES.dynamic_range
    assert design.outer_diameter <= WISHES.outer_diameter
    assert design.chamber_length <= WISHES.length
    assert design.resistance * design.largest_current <= WISHES.voltage * (1.0 + 1e-9)
    assert design.largest_current <= WISHES.current
    assert design.current_density <= WISHES.current_density * (1.0 + 1e-9)
    assert design.gap >= WISHES.least_gap
    assert (design.stroke, design.velocity, design.friction) == (0.025, 0.1, 30.0)
    # The rod carries the desired force.
    assert WISHES.force / (math.pi / 4.0 * design.rod**2) == pytest.approx(WISHES.stress)
    assert sized.evaluations <= 400


def test_sizing_finds_a_small_damper(sized: SizedDamper) -> None:
    rng = np.random.default_rng(0)
    drawn = [candidate(rng.uniform(size=N_FREE), WISHES, FLUID, STEEL) for _ in range(300)]
    good = [
        each.envelope_volume
        for each in drawn
        if each is not None and not WISHES.missed(each, flow_model="plates")
    ]
    assert sized.design.envelope_volume < 0.7 * min(good)


def test_a_faster_damper_can_be_asked_for(sized: SizedDamper) -> None:
    limit = 0.5 * sized.design.response_time(WISHES.voltage)
    faster = replace(WISHES, response_time=limit)
    found = size_damper(faster, fluid=FLUID, steel=STEEL, budget=400)
    assert found.design.response_time(WISHES.voltage) <= limit


def test_missed_names_what_is_missed() -> None:
    missed = WISHES.missed(twenty_ton_damper())
    assert {"outer_diameter", "length", "voltage"} <= set(missed)
    assert missed["outer_diameter"] == pytest.approx(0.2632 / 0.08 - 1.0)
    # It is stronger than was wished, and wide enough.
    assert not {"force", "least_gap"} & set(missed)


@pytest.mark.parametrize(
    ("name", "most"),
    [
        *((name, False) for name in ("force", "dynamic_range", "velocity", "stroke", "least_gap")),
        *(
            (name, True)
            for name in ("outer_diameter", "length", "voltage", "current", "stress", "current_density")
        ),
    ],
)
def test_a_wish_that_is_missed_by_a_tenth_is_told_with_its_share(
    sized: SizedDamper, name: str, most: bool
) -> None:
    design = sized.design
    reached = {
        **{"force": design.largest_force, "dynamic_range": design.dynamic_range, "velocity": design.velocity},
        **{"stroke": design.stroke, "least_gap": design.gap, "outer_diameter": design.outer_diameter},
        **{"length": design.chamber_length, "current": design.largest_current},
        **{"voltage": design.resistance * design.largest_current, "current_density": design.current_density},
        # A thin ring under the pressure of the force.
        "stress": design.largest_force / design.piston_area * design.bore / (2.0 * design.wall),
    }[name]
    wishes = replace(WISHES, **{name: reached / 1.1 if most else reached / 0.9})
    assert wishes.missed(design)[name] == pytest.approx(0.1)


def test_impossible_wishes_are_refused_with_what_is_missed() -> None:
    wishes = replace(WISHES, force=1e5, stress=1e10)
    refusal(size_damper, wishes, fluid=FLUID, steel=STEEL, budget=120, match="best misses force by")


def test_sizing_repeats_itself_and_progress_tells_candidates_and_the_smallest_volume(
    sized: SizedDamper,
) -> None:
    seen: list[Progress] = []
    told = size_damper(WISHES, fluid=FLUID, steel=STEEL, budget=400, on_progress=seen.append)
    assert told == sized
    assert [each.stage for each in seen] == ["smallest"] * len(seen)
    assert [each.numbers["evaluations"] for each in seen] == sorted(
        each.numbers["evaluations"] for each in seen
    )
    assert (seen[-1].numbers["evaluations"], seen[-1].share) == (told.evaluations, told.evaluations / 400)
    assert seen[-1].numbers["volume"] == pytest.approx(told.design.envelope_volume)
    found = [each.numbers["volume"] for each in seen if not math.isnan(each.numbers["volume"])]
    assert found == sorted(found, reverse=True)


def test_a_callback_ends_the_sizing_with_what_it_has_found() -> None:
    ended = size_damper(
        WISHES,
        fluid=FLUID,
        steel=STEEL,
        on_progress=lambda progress: not math.isnan(progress.numbers["volume"]),
    )
    assert WISHES.missed(ended.design) == {}
    assert ended.evaluations < 4000


class Calls:
    """Calls of Python functions, and items that generators yield, between `begin` and `end`."""

    def __init__(self) -> None:
        self.count = 0
        self._former = sys.getprofile()

    def begin(self) -> None:
        sys.setprofile(self._called)

    def end(self) -> int:
        sys.setprofile(self._former)
        return self.count

    def _called(self, frame: FrameType, event: str, argument: object) -> None:
        self.count += event == "call"


def test_ctrl_c_ends_a_sizing_soon() -> None:
    """Within few calls, in the middle of whatever the search does: sixty candidates make a hundred thousand."""
    calls = Calls()

    def interrupt(*_: object) -> None:
        calls.begin()
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGVTALRM, interrupt)
    signal.setitimer(signal.ITIMER_VIRTUAL, 0.5)
    try:
        with pytest.raises(Interrupted):
            size_damper(WISHES, fluid=FLUID, steel=STEEL, budget=100_000)
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
        calls.end()
    assert 0 < calls.count < 40_000


@given(unit=st.lists(st.floats(0.0, 1.0), min_size=N_FREE, max_size=N_FREE))
@examples(25)
def test_every_point_of_the_cube_is_a_damper_within_its_supply_or_none(unit: list[float]) -> None:
    design = candidate(np.array(unit), WISHES, FLUID, STEEL)
    if design is not None:
        missed = WISHES.missed(design, flow_model="sum")
        assert not {"voltage", "current", "current_density", "least_gap"} & set(missed)
        assert 1 <= design.stages <= 4
        assert 8 <= design.wire_gauge <= 32
