"""Profile likelihood: exact on a parabola, minima at every point, open intervals, results after Ctrl-C."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

import mrwork as mr
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.records import DamperTest, cut
from mrwork.uncertainty import Profiles
from mrwork.uncertainty.identifiability.profile import Profile
from mrwork.uncertainty.identifiability.walks import Point, WalkRules, signed_root

SPEC = mr.damper("static_hysteretic")


@pytest.fixture(scope="module")
def test() -> DamperTest:
    return cut(mr.synthetic_test("rd1005_1a"), every=4)


@pytest.fixture(scope="module")
def fit(test: DamperTest) -> mr.Fit:
    return mr.identify(SPEC, test, rng=1)


@pytest.fixture(scope="module")
def found(fit: mr.Fit, test: DamperTest) -> Profiles:
    return mr.profile(fit, [test], threads=1)


def by_name(found: Profiles) -> dict[str, Profile]:
    return {each.name: each for each in found.profiles}


def walked(normal: NDArray[np.float64], way: Literal[-1, 1], dof: float) -> list[Point]:
    """The points of a walk of the first parameter on a paraboloid of this curvature, of misfit 1 at its origin."""
    origin = np.full(len(normal), 0.5)
    names = tuple(f"p{index}" for index in range(len(normal)))
    box = mr.Box(names=names, lower=(0.0,) * 3, upper=(1.0,) * 3, log=(False,) * 3)
    errors = np.sqrt(np.diag(np.linalg.inv(normal)) / dof)
    points = [Point(position=origin, squared=1.0)]
    going = WalkRules(box=box, first=0.5 * errors, limit=1.96, dof=dof).walk(0, way, points)
    wanted: NDArray[np.float64] | None = next(going)
    while wanted is not None:
        moved = wanted - origin
        moved[1:] = -np.linalg.solve(normal[1:, 1:], normal[1:, 0] * moved[0])
        try:
            wanted = going.send(Point(position=origin + moved, squared=1.0 + moved @ normal @ moved))
        except StopIteration as ended:
            wanted, end = None, ended.value
    assert end == "closed"
    return points


@pytest.mark.parametrize("way", [-1, 1])
def test_a_walk_on_a_parabola_brackets_the_limit(way: Literal[-1, 1]) -> None:
    jacobian = np.random.default_rng(4).standard_normal((30, 3))
    points = walked(jacobian.T @ jacobian, way, dof=200.0)
    roots = [signed_root(place.squared, 1.0, 200.0) for place in points]
    assert roots == sorted(roots)
    assert roots[-2] < 1.96 < roots[-1]
    # Steps of 0.6 in the root, after a first one of a half, and two points about the limit.
    assert 4 <= len(points) <= 8


def test_intervals_are_those_of_the_information_where_the_data_are_plenty(
    fit: mr.Fit, test: DamperTest, found: Profiles
) -> None:
    for name in ("c", "k", "alpha", "beta", "f0"):
        profile = by_name(found)[name]
        assert profile.verdict.word == "identifiable"
        assert profile.interval.lower is not None
        assert profile.interval.upper is not None
        half = 0.5 * (profile.interval.upper - profile.interval.lower)
        assert half == pytest.approx(1.96 * (fit.parameters[name].standard_error or 0.0), rel=0.03)


@pytest.mark.long
def test_intervals_hold_the_truth_as_often_as_they_say(fit: mr.Fit, test: DamperTest) -> None:
    loading = mr.Loading(dt=test.dt, displacement=test.displacement, velocity=test.velocity)
    clean = mr.simulate_force(SPEC, SPEC.nominal, loading)
    rng = np.random.default_rng(12)
    truth = dict(zip(SPEC.names, SPEC.nominal, strict=True))
    start = replace(fit, estimates=tuple(replace(each, value=truth[each.name]) for each in fit.estimates))
    names, n_records = ("alpha", "beta"), 30
    inside = 0
    for _ in range(n_records):
        noisy = replace(test, force=clean + 8.0 * rng.standard_normal(clean.size))
        for profile in mr.profile(start, [noisy], parameters=names).profiles:
            inside += (
                (profile.interval.lower or np.inf) < truth[profile.name] < (profile.interval.upper or -np.inf)
            )
    # 95 % of 60, less three standard deviations; not more than all but one, or the intervals are too wide.
    assert 52 <= inside <= 59


def test_no_other_minimisation_finds_less_at_a_point(fit: mr.Fit, test: DamperTest, found: Profiles) -> None:
    profile = by_name(found)["k"]
    objective = mr.identification.Objective.of(SPEC, (test,))
    value, misfit = profile.values[1], profile.misfit[1]
    box = mr.Box.of(SPEC).with_bounds({"k": (value, value)})
    start = np.array(fit.theta)
    start[SPEC.names.index("k")] = value
    other = find_minima(objective, box, start[None], max_iterations=60)
    fall = 2.0 * found.n_effective * np.log(misfit / other.misfit[0])
    assert fall < 0.02


def test_an_interval_is_open_where_the_data_do_not_object(found: Profiles) -> None:
    # tanh(x/x_s) is a straight line from some x_s on: only delta/x_s is seen, up to the bound.
    delta = by_name(found)["delta"]
    assert (delta.interval.upper, delta.interval.upper_end) == (None, "bound")
    assert delta.verdict.word in ("weakly identifiable", "not identifiable")
    assert "above: " in delta.verdict.reason or "open above" in delta.verdict.reason
    assert delta.values[-1] == SPEC.parameters[SPEC.names.index("delta")].upper or delta.ratio[-1] > 0.0


def test_values_go_upwards_through_the_estimate_and_cross_where_the_interval_ends(found: Profiles) -> None:
    for profile in found.profiles:
        assert list(profile.values) == sorted(profile.values)
        assert profile.estimate in profile.values
        for value, ratio in zip(profile.values, profile.ratio, strict=True):
            if profile.interval.lower is not None and profile.interval.upper is not None:
                inside = profile.interval.lower < value < profile.interval.upper
                assert (ratio <= found.threshold) == inside or value == profile.estimate


def test_a_higher_level_has_a_wider_interval(fit: mr.Fit, test: DamperTest, found: Profiles) -> None:
    wider = mr.profile(fit, [test], parameters=["beta"], level=0.99)
    (beta,) = wider.profiles
    narrow = by_name(found)["beta"]
    assert beta.interval.lower is not None
    assert narrow.interval.lower is not None
    assert beta.interval.upper is not None
    assert narrow.interval.upper is not None
    assert beta.interval.lower < narrow.interval.lower < narrow.interval.upper < beta.interval.upper


def test_threads_change_no_bit(fit: mr.Fit, test: DamperTest, found: Profiles) -> None:
    again = mr.profile(fit, [test], threads=2)
    assert again.profiles == found.profiles


def test_a_fixed_parameter_has_no_profile(test: DamperTest) -> None:
    held = mr.identify(SPEC, test, rng=1, bounds={"x_s": (0.1, 0.1)})
    found = mr.profile(held, [test])
    assert [each.name for each in found.profiles] == [name for name in SPEC.names if name != "x_s"]
    # What delta lacked was x_s.
    assert by_name(found)["delta"].verdict.word == "identifiable"


def test_a_parameter_on_its_bound_goes_one_way(test: DamperTest) -> None:
    bounded = mr.identify(SPEC, test, rng=1, bounds={"beta": (100.0, 300.0), "x_s": (0.1, 0.1)})
    (beta,) = mr.profile(bounded, [test], parameters=["beta"]).profiles
    assert (beta.interval.lower, beta.interval.lower_end, beta.interval.upper_end) == (
        None,
        "bound",
        "closed",
    )
    assert min(beta.values) == pytest.approx(100.0)


def test_a_spring_changes_its_sign_with_the_displacement_at_which_it_is_free() -> None:
    test = cut(mr.synthetic_test("spencer1997_fast"), every=4)
    model = mr.damper("normalised_bouc_wen")
    fit = mr.identify(model, test, rng=1)
    (k,) = mr.profile(fit, [test], parameters=["k"], level=0.9999999).profiles
    assert (k.interval.lower_end, k.interval.upper_end) == ("closed", "closed")
    # The stroke of 4 mm hardly tells k, so at such a level the interval reaches across zero or nearly so; wherever it
    # ends, the ratio rises smoothly to it.
    roots = np.sqrt(k.ratio)
    assert np.max(np.abs(np.diff(roots))) < 1.6


def test_an_interrupt_keeps_what_there_is(fit: mr.Fit, test: DamperTest, found: Profiles) -> None:
    def stop(progress: mr.Progress) -> None:
        if progress.numbers["points"] >= 10:
            raise KeyboardInterrupt

    with pytest.raises(mr.errors.Interrupted) as interrupt:
        mr.profile(fit, [test], on_progress=stop)
    kept = interrupt.value.result
    assert kept.status == "interrupted"
    assert sum(len(each.values) - 1 for each in kept.profiles) >= 10
    assert {each.interval.lower_end for each in kept.profiles} <= {"interrupted", "closed", "bound"}
    whole = by_name(found)
    for each in kept.profiles:
        # A point beyond the limit is replaced by a nearer one.
        assert set(each.values[1:-1]) <= set(whole[each.name].values)


def test_a_fit_short_of_its_minimum_is_told(fit: mr.Fit, test: DamperTest) -> None:
    moved = tuple(
        replace(each, value=1.2 * each.value) if each.name == "alpha" else each for each in fit.estimates
    )
    (f0,) = (found := mr.profile(replace(fit, estimates=moved), [test], parameters=["f0"])).profiles
    assert [each.code for each in found.remarks] == ["better_fit_found"]
    assert found.better is not None
    assert found.better.nrmse == pytest.approx(fit.nrmse, rel=1e-4)
    assert found.better.status == "lower_minimum_possible"
    assert "a profile of its parameters found it" in found.better.status_in_words
    assert f0.verdict.word == "identifiable"
    assert found.misfit == pytest.approx(fit.nrmse, rel=1e-4)
