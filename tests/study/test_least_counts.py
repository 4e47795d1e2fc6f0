"""How many dampers keep a limit: the least count that was tried, everywhere or by storey, and what is reached."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from refusals import refusal

import mrwork as mr
from mrwork.study.reading import counted_study

DASHPOT = {"f_c": [0.0, 1.0], "v_s": 0.01, "c0": [40.0, 160.0], "f0": 0.0}


def study(**changes: object) -> mr.Study:
    """Two storeys with a damper in each that is a dashpot in effect, so that more of them lower the drifts."""
    given = {
        "building": {
            "masses": [500.0, 500.0],
            "stiffnesses": [2e5, 1e5],
            "modal_damping": {"ratios": [0.01]},
        },
        "dampers": [
            {"storey": storey, "model": "bingham", "parameters": DASHPOT, "largest_command": 1.0}
            for storey in (1, 2)
        ],
        "laws": [{"law": "passive_on"}, {"law": "clipped_optimal"}],
        "motions": [mr.synthetic_motion(rng=seed, duration=3.0, peak=2.0, name=f"{seed}") for seed in (0, 1)],
        "report": {"limit": {"peak_drift": "17 mm"}},
    }
    return mr.study_of(**{**given, **changes})


@pytest.fixture(scope="module")
def found() -> mr.study.DamperCounts:
    return mr.study.damper_counts(study(), most=16, threads=1)


def peak_drifts(counts: tuple[int, ...]) -> np.ndarray:
    results = mr.run_study(counted_study(study(), counts), threads=1)
    return results.criteria_of_runs.peak_drift[:, :, 0].max(axis=1)


def test_the_count_keeps_the_limit_and_one_damper_fewer_does_not(found: mr.study.DamperCounts) -> None:
    rows = {each.label: each for each in found.rows}
    assert [*rows] == ["Passive-off", "Optimal passive", "Passive-on", "Clipped-optimal"]
    on = rows["Passive-on"]
    assert on.keeps
    assert 1 < on.counts[0] < 16
    place = [*rows].index("Passive-on") + 1
    values = [peak_drifts((count, count))[place] for count in (on.counts[0], on.counts[0] - 1)]
    assert values[0] == on.value <= found.limit < values[1]
    assert found.bare == peak_drifts((1, 1))[0] > found.limit
    # Less command takes more dampers, and the best constant command no more than the largest.
    assert rows["Passive-off"].dampers > on.dampers >= rows["Optimal passive"].dampers


def test_counts_by_storey_are_no_more_and_no_single_one_can_be_less(found: mr.study.DamperCounts) -> None:
    by_storey = mr.study.damper_counts(study(laws=["passive_on"]), by="storey", most=16, threads=1)
    (own,) = (each for each in by_storey.rows if each.label == "Passive-on")
    (alike,) = (each for each in found.rows if each.label == "Passive-on")
    assert own.dampers <= alike.dampers
    values = {each.counts: each.values[3] for each in by_storey.tried}
    assert values[own.counts] <= by_storey.limit
    for place, count in enumerate(own.counts):
        fewer = (*own.counts[:place], count - 1, *own.counts[place + 1 :])
        assert count == 0 or values.get(fewer, np.inf) > by_storey.limit


def test_a_limit_that_is_not_kept_is_told_with_what_is_reached(tmp_path: Path) -> None:
    given = study(laws=[], report={"limit": {"peak_acceleration": "0.5 m/s2"}})
    found = mr.study.damper_counts(given, most=4, threads=1)
    (off, best) = found.rows
    assert not off.keeps
    assert best.value == min(each.values[2] for each in found.tried)
    assert "limit is not kept with up to 4 dampers in each place, the value is the lowest" in str(found)
    # Three rows under two motions and 21 constant commands under two.
    assert found.runs == len(found.tried) * (3 * 2 + 21 * 2)
    given.to_toml(tmp_path / "study.toml")
    printed(
        "respond", tmp_path / "study.toml", "--size", "count", "--figure", tmp_path / "counts.svg", "--quiet"
    )
    assert (tmp_path / "counts.svg").read_bytes().startswith(b"<")
    stored = json.loads(printed("respond", tmp_path / "study.toml", "--size", "storey", "--json"))
    assert [each["keeps"] for each in stored["rows"]] == [False, False]


def test_what_has_no_count_is_refused() -> None:
    counts = mr.study.damper_counts
    refusal(counts, study(report={}), match="the study has no limit")
    refusal(counts, study(), limit={"peak_force": 1e3}, match="of the dampers")
    refusal(counts, study(), limit={"peak_drift_ratio": 0.01}, match="height")
    bare = study(dampers=[], laws=[])
    refusal(counts, bare, match="no damper that follows a command")
