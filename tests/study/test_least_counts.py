"""How many dampers, dashpots or tuned masses keep a limit: the least count, everywhere or by storey."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
import scipy
from command_line import printed
from refusals import refusal

import mrwork as mr
from mrwork.base.values import Floats
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
    assert rows["Passive-off"].total > on.total >= rows["Optimal passive"].total


def test_dampers_across_isolators_are_counted_to_a_limit_of_the_stroke() -> None:
    isolation = {"mass": 500.0, "period": 1.0, "ratio": 0.05}
    frame = {
        "masses": [500.0],
        "stiffnesses": [1e6],
        "modal_damping": {"ratios": [0.01]},
        "isolation": isolation,
    }
    isolated = study(
        building=frame,
        dampers=[{"storey": 1, "model": "bingham", "parameters": DASHPOT, "largest_command": 1.0}],
        laws=["passive_on"],
        report={},
    )
    sized = mr.study.damper_counts(isolated, limit={"peak_stroke": 0.03}, most=64, threads=1)
    on = next(row for row in sized.rows if row.label == "Passive-on")
    strokes = [
        mr.run_study(counted_study(isolated, (count,)), threads=1).criteria_of_runs.peak_stroke[:, :, 0]
        for count in (on.counts[0], on.counts[0] - 1)
    ]
    assert on.value == strokes[0][3].max() <= 0.03 < strokes[1][3].max() < sized.bare == strokes[0][0].max()


def test_counts_by_storey_are_no_more_and_no_single_one_can_be_less(found: mr.study.DamperCounts) -> None:
    by_storey = mr.study.damper_counts(study(laws=["passive_on"]), by="storey", most=16, threads=1)
    (own,) = (each for each in by_storey.rows if each.label == "Passive-on")
    (alike,) = (each for each in found.rows if each.label == "Passive-on")
    assert own.total <= alike.total
    values = {each.counts: each.value for each in own.tried}
    assert values[own.counts] <= by_storey.limit
    for place, count in enumerate(own.counts):
        fewer = (*own.counts[:place], count - 1, *own.counts[place + 1 :])
        assert count == 0 or values.get(fewer, np.inf) > by_storey.limit


def test_a_limit_that_is_not_kept_is_told_with_what_is_reached(tmp_path: Path) -> None:
    given = study(laws=[], report={"limit": {"peak_acceleration": "0.5 m/s2"}})
    found = mr.study.damper_counts(given, most=4, threads=1)
    (off, best) = found.rows
    assert not off.keeps
    assert best.value == min(each.value for each in best.tried)
    assert "limit is not kept with up to 4 dampers in each place" in " ".join(str(found).split())
    # Three rows under two motions and 21 constant commands under two.
    assert found.runs == len(best.tried) * (3 * 2 + 21 * 2)
    given.to_toml(tmp_path / "study.toml")
    printed(
        "tune", tmp_path / "study.toml", "--size", "count", "--figure", tmp_path / "counts.svg", "--quiet"
    )
    assert (tmp_path / "counts.svg").read_bytes().startswith(b"<")
    stored = json.loads(printed("tune", tmp_path / "study.toml", "--size", "storey", "--json"))
    assert [each["keeps"] for each in stored["rows"]] == [False, False]


def test_what_has_no_count_is_refused() -> None:
    counts = mr.study.damper_counts
    refusal(counts, study(report={}), match="the study has no limit")
    refusal(counts, study(), limit={"peak_force": 1e3}, match="of the dampers")
    refusal(counts, study(), limit={"peak_drift_ratio": 0.01}, match="height")
    bare = study(dampers=[], laws=[])
    refusal(counts, bare, match="nothing that is counted")


MASS, SPRINGS, STEP, LIMIT = 2.5e4, (3.75e7, 2.5e7), 5e-4, 0.005
SUITE = [mr.synthetic_motion(rng=seed, duration=6.0, peak=4.0, name=f"{seed}") for seed in (1, 2)]


def with_baselines(*baselines: dict[str, object], **changes: object) -> mr.Study:
    """A frame of two storeys with devices of baselines alone."""
    given = {
        "building": {
            "masses": [MASS, MASS],
            "stiffnesses": SPRINGS,
            "rayleigh": {"ratios": [0.05, 0.05]},
        },
        "baselines": [{"label": f"{number}", "building": table} for number, table in enumerate(baselines)],
        "motions": SUITE,
        "report": {"limit": {"peak_drift": LIMIT}},
    }
    return mr.study_of(**{**given, **changes})


def exact_drifts(damping: Sequence[float]) -> Floats:
    """Peak drifts of that frame with dashpots under each motion, by the exponential of its state matrix, (2, 2)."""

    def across(values: Sequence[float]) -> Floats:
        return np.array([[values[0] + values[1], -values[1]], [-values[1], values[1]]])

    stiffness, mass = across(SPRINGS), MASS * np.eye(2)
    low, high = np.sqrt(scipy.linalg.eigh(stiffness, mass, eigvals_only=True))
    own = 2.0 * 0.05 * (low * high * mass + stiffness) / (low + high)
    rates = np.zeros((6, 6))
    rates[:2, 2:4], rates[4, 5], rates[2:4, 4] = np.eye(2), 1.0, -1.0
    rates[2:4, :2], rates[2:4, 2:4] = -stiffness / MASS, -(own + across(damping)) / MASS
    ahead = scipy.linalg.expm(rates * STEP)
    peaks = []
    for motion in SUITE:
        time = np.arange(round(motion.duration / STEP) + 1) * STEP
        ground = np.interp(time, np.arange(len(motion.acceleration)) * motion.dt, motion.acceleration)
        driven = np.outer(ground[:-1], ahead[:4, 4]) + np.outer(np.diff(ground) / STEP, ahead[:4, 5])
        poles, shapes = np.linalg.eig(ahead[:4, :4])
        pushed = np.linalg.solve(shapes, driven.T.astype(complex))
        states = [
            scipy.signal.lfilter([1.0], [1.0, -pole], push) for pole, push in zip(poles, pushed, strict=True)
        ]
        moved = (shapes[:2] @ states).real.T
        peaks.append(np.abs(np.diff(moved, axis=1, prepend=0.0)).max(axis=0))
    return np.array(peaks)


def test_dashpots_by_storey_have_the_least_sum_of_damping() -> None:
    """Against an optimum of SciPy on an own integration, from three starts."""
    unit = 5e3
    stated = {"viscous": [{"storey": storey, "damping": unit} for storey in (1, 2)]}
    study = with_baselines(stated)
    (alike,) = mr.study.damper_counts(study, threads=1).rows
    fewer, many = (exact_drifts([unit * (alike.counts[0] - less)] * 2).max() for less in (1, 0))
    assert many <= LIMIT < fewer
    (own,) = mr.study.damper_counts(study, by="storey", threads=1).rows
    assert own.keeps
    assert own.unit == "N s/m"
    assert own.total == pytest.approx(unit * sum(own.counts))
    best = min(
        (
            scipy.optimize.minimize(
                np.sum,
                start,
                bounds=[(0.0, None)] * 2,
                constraints={"type": "ineq", "fun": lambda c: 1.0 - exact_drifts(1e6 * c).ravel() / LIMIT},
                method="SLSQP",
                options={"eps": 1e-4},
            )
            for start in ([1.0, 1.0], [2.0, 0.5], [0.5, 2.0])
        ),
        key=lambda found: found.fun if exact_drifts(1e6 * found.x).max() < 1.0001 * LIMIT else np.inf,
    )
    assert exact_drifts(unit * np.array(own.counts)).max() <= LIMIT
    # Up to one of each more, as they are counted.
    assert 0.0 < own.total - 1e6 * best.fun < 2.0 * unit < alike.total - own.total
    np.testing.assert_allclose(unit * np.array(own.counts), 1e6 * best.x, atol=unit)


def test_tuned_masses_are_counted_and_tuned_anew() -> None:
    unit = {"floor": 2, "mass_ratio": 0.002}
    study = with_baselines({"tuned_mass": unit}, report={"limit": {"rms_drift": 0.0022}})
    found = mr.study.damper_counts(study, threads=1)
    (row,) = found.rows
    assert row.keeps
    assert row.total == pytest.approx(0.002 * row.counts[0])
    for count, keeps in ((row.counts[0], True), (row.counts[0] - 1, False)):
        one = {"floor": 2, "mass_ratio": 0.002 * count}
        results = mr.run_study(with_baselines({"tuned_mass": one}), threads=1)
        assert (float(results.criteria_of_runs.rms_drift[1].max()) <= 0.0022) is keeps
    assert found.bare == results.criteria_of_runs.rms_drift[0].max()
    # No optimum is known of masses beyond the mass of the mode.
    (heavy,) = mr.study.damper_counts(study, limit={"rms_drift": 0.0012}, threads=1).rows
    assert not heavy.keeps


def test_dampers_and_devices_of_baselines_are_counted_side_by_side(tmp_path: Path) -> None:
    dashpots = {"label": "Dashpots", "building": {"viscous": {"storey": 1, "damping": 100.0}}}
    given = study(laws=[], baselines=[dashpots], report={"limit": {"peak_acceleration": "4.2 m/s2"}})
    found = mr.study.damper_counts(given, most=8, threads=1)
    assert [row.unit for row in found.rows] == ["dampers", "dampers", "N s/m"]
    assert found.bare > 4.2
    last = found.rows[-1]
    assert last.keeps
    assert "N s/m" in str(found)
    given.to_toml(tmp_path / "study.toml")
    figure = tmp_path / "counts.svg"
    printed("tune", tmp_path / "study.toml", "--size", "count", "--figure", figure, "--quiet")
    assert figure.is_file()
