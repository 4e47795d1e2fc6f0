"""Free settings of every law: a tuning of a law needs nothing but its name."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from sentences import Refused

import mrwork as mr
from mrwork import Device
from mrwork.control import SETTINGS, DesignProblem, ReferencePeaks, design_candidates, settings_of
from mrwork.control.laws.law_problem import Magnitudes
from mrwork.study import TuneTable
from mrwork.tuning.space import LARGEST, FreeSetting, space_of

MAGNITUDES = Magnitudes(
    drift=5e-3,
    displacement=0.02,
    velocity=0.4,
    acceleration=3.0,
    energy=300.0,
    force=2000.0,
    stroke=5e-3,
    rate=0.1,
    ground=1.0,
    command=1.88,
    constant_drift=2e-3,
    constant_acceleration=2.0,
)


def _problem() -> DesignProblem:
    frame = mr.building("uts")
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    device = Device(
        name="pair",
        spec=preset.spec,
        theta=preset.theta,
        row=frame.storeys[0],
        largest_command=1.88,
        differential=True,
    )
    return DesignProblem(
        building=frame,
        devices=[device],
        sample_time=1e-3,
        reference_peaks=lambda: ReferencePeaks(command=0.5, drift=2e-3, acceleration=3.0),
    )


# The network is trained for a second.
@pytest.mark.parametrize("law", [law for law in SETTINGS if law != "inverse_network"])
def test_every_law_can_be_tuned_by_its_name_alone(law: str) -> None:
    space = space_of(TuneTable(laws=(law,)), law, MAGNITUDES)
    candidates = [space.candidate(np.full(len(space.free), place)) for place in (0.2, 0.5, 0.8)]
    settings = [settings_of(law, each.settings) for each in candidates]
    designed = design_candidates(law, _problem(), settings)
    assert designed.law is not None
    assert len(designed.designed) == 3, designed.refusals


@pytest.mark.parametrize("law", list(SETTINGS))
def test_candidate_and_point_of_the_cube_are_inverse(law: str) -> None:
    space = space_of(TuneTable(laws=(law,)), law, MAGNITUDES)
    for unit in np.random.default_rng(0).uniform(size=(20, len(space.free))):
        candidate = space.candidate(unit)
        back = space.unit(candidate)
        assert back is not None
        assert space.candidate(back) == candidate


def test_batch_designs_are_those_of_single_settings() -> None:
    settings = [settings_of("clipped_optimal", {"drifts": 1.0, "control_weight": R}) for R in (1e-14, 1e-12)]
    designed = design_candidates("clipped_optimal", _problem(), settings)
    assert designed.law is not None
    for place, each in enumerate(settings):
        gain = np.asarray(designed.law.gains["gain"])[place]
        assert np.array_equal(gain, each.design(_problem()).gains["gain"])


def test_settings_that_make_no_law_are_refused_by_their_index() -> None:
    settings = [
        settings_of("clipped_optimal", {"drifts": w, "control_weight": 1e-13}) for w in (1.0, (1.0, 2.0))
    ]
    designed = design_candidates("clipped_optimal", _problem(), settings)
    assert designed.designed == (0,)
    assert "5 storeys" in designed.refusals[1]


def test_held_settings_are_not_searched_and_ranges_of_the_table_are() -> None:
    table = TuneTable(
        laws=("clipped_optimal",),
        settings={"drifts": 2.0},
        free={"control_weight": (1e-14, 1e-12), LARGEST: ()},
    )
    space = space_of(table, "clipped_optimal", MAGNITUDES)
    assert [each.name for each in space.free] == ["control_weight", LARGEST]
    assert space.candidate(np.zeros(2)).settings == {"drifts": 2.0, "control_weight": 1e-14}
    assert space.candidate(np.ones(2)).largest_command == 1.88


def test_a_space_that_cannot_be_searched_is_refused(refused: Refused) -> None:
    for keys in (
        {"free": {"controll_weight": (1.0, 2.0)}},
        {"free": {"control_weight": (2.0, 1.0)}},
        {"free": {"control_weight": (0.0, 1.0)}},
        {"free": {LARGEST: (0.5, 3.0)}},
        {"free": {"drifts": ()}},
        {"settings": {"drift": 1.0}},
        {"settings": {"drifts": 1.0}, "free": {"drifts": ()}},
    ):
        refused(space_of, TuneTable(laws=("clipped_optimal",), **keys), "clipped_optimal", MAGNITUDES)  # type: ignore[arg-type] # of several keys


def test_a_setting_that_candidates_share_is_not_freed(refused: Refused) -> None:
    table = TuneTable(laws=("predictive_rollout",), free={"drift": (), "horizon": ()})
    refused(space_of, table, "predictive_rollout", MAGNITUDES)


@pytest.mark.parametrize(
    ("lower", "upper", "scale", "levels"),
    [(1.0, 1.0, "linear", 0), (0.0, 1.0, "log", 0), (1e-300, 1e90, "log", 0), (0.0, 1.0, "linear", 1)],
)
def test_a_stored_range_that_cannot_be_searched_contradicts_itself(
    lower: float, upper: float, scale: Literal["linear", "log"], levels: int
) -> None:
    free = FreeSetting(name="gain", lower=lower, upper=upper, scale=scale, levels=levels)
    assert free.disagreement() == f"gain cannot be searched from {lower:g} to {upper:g}"
    assert not FreeSetting(name="gain", lower=1e-9, upper=1.0, levels=10).disagreement()
