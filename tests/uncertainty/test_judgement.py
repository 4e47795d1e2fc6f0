"""The one rule of verdicts: what a standard error or an interval says of a parameter."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mrwork.identification.fit import FittedParameter
from mrwork.identification.interval import Interval, Verdict, Word
from mrwork.identification.verdicts import DEVIATIONS, NEGLIGIBLE, Scale, judge_error, judge_interval
from mrwork.uncertainty.identifiability.profile import Profile

# A stiffness that may have either sign.
SPRING = Scale(
    name="k",
    unit="N/m",
    value=0.0,
    size=9e4,
    of_range=True,
    lower=-9e4,
    upper=9e4,
    log=False,
    bounds=(-1e6, 1e6),
)
DAMPING = replace(SPRING, name="c", unit="N s/m", of_range=False, log=True, bounds=(1e-3, 1e9))
SHARE = replace(SPRING, name="share", unit="1", bounds=(0.0, 1.0))
# Deviations of the force per unit.
SENSITIVITY = {"k": 1e-5, "c": 1e-4, "share": 0.5}
# Parameters that hardly change the force.
SEAL, GHOST, SHADE = (
    replace(scale, name=name) for name, scale in (("seal", DAMPING), ("ghost", SPRING), ("shade", SHARE))
)
SENSITIVITY |= {"seal": 1e-30, "ghost": 1e-10, "shade": 1e-6}


def interval(lower: float | None, upper: float | None) -> Interval:
    """An interval of the level of standard errors."""
    return Interval(kind="profile", level=0.95, lower=lower, upper=upper)


@pytest.mark.parametrize(
    ("scale", "value", "error", "verdict"),
    [
        (SPRING, 2500.0, 21.0, "identifiable"),
        # The two that were once identifiable because they are small beside the range of the tests.
        (SPRING, -6431.0, 16_000.0, "sign unknown"),
        (SPRING, 5312.0, 5100.0, "sign unknown"),
        (SPRING, 5312.0, 2000.0, "weakly identifiable"),
        (SPRING, 318.0, 190.0, "negligible"),
        (SPRING, 0.0, 1e-3, "negligible"),
        (SPRING, 0.0, 1e4, "sign unknown"),
        (SPRING, 19_992.0, 1.2e18, "sign unknown"),
        # Small beside the force, and known all the same.
        (SPRING, 10.0, 0.1, "identifiable"),
        (replace(SPRING, bounds=(0.0, 1e6)), 5312.0, 5100.0, "weakly identifiable"),
        (replace(SPRING, bounds=(100.0, 1e6)), 318.0, 190.0, "weakly identifiable"),
        (DAMPING, 5000.0, 3.0, "identifiable"),
        (DAMPING, 5000.0, 5001.0, "weakly identifiable"),
        (DAMPING, 5000.0, 5.8e9, "weakly identifiable"),
        (SEAL, 5000.0, 1e7, "weakly identifiable"),
        (SHARE, 0.003, 4.6e4, "weakly identifiable"),
        (SHADE, 0.003, 4.6e4, "negligible"),
    ],
)
def test_a_standard_error_has_one_verdict(scale: Scale, value: float, error: float, verdict: Word) -> None:
    judged = judge_error(error, replace(scale, value=value), SENSITIVITY[scale.name])
    assert judged.word == verdict
    assert bool(judged.reason) == (verdict != "identifiable")


@pytest.mark.parametrize(
    ("coherent", "verdict"), [(1.0, "identifiable"), (9.9, "identifiable"), (10.1, "model-dependent")]
)
def test_what_a_force_of_twice_the_residual_could_move_by_a_quarter_depends_on_the_model(
    coherent: float, verdict: Word
) -> None:
    # An error of 2.5 % of the value, as an error and as the interval of it.
    scale = replace(SPRING, value=4000.0)
    by_error = judge_error(100.0, scale, SENSITIVITY["k"], coherent)
    ends = interval(4000.0 - 100.0 * DEVIATIONS, 4000.0 + 100.0 * DEVIATIONS)
    assert (by_error, judge_interval(ends, scale, SENSITIVITY["k"], coherent)) == (by_error, by_error)
    assert by_error.word == verdict


@pytest.mark.parametrize(
    ("scale", "ends", "verdict"),
    [
        (SPRING, (2400.0, 2600.0), "identifiable"),
        (SPRING, (-38_000.0, 25_000.0), "sign unknown"),
        (SPRING, (-77.5, 641.0), "negligible"),
        (SPRING, (0.2, 681.0), "negligible"),
        (SPRING, (1000.0, 9000.0), "weakly identifiable"),
        (SPRING, (1000.0, None), "weakly identifiable"),
        (SPRING, (-1000.0, None), "sign unknown"),
        (SPRING, (None, None), "not identifiable"),
        (GHOST, (None, None), "negligible"),
        (DAMPING, (4990.0, 5010.0), "identifiable"),
        (DAMPING, (500.0, 50_000.0), "weakly identifiable"),
        (DAMPING, (500.0, None), "weakly identifiable"),
        (DAMPING, (None, None), "not identifiable"),
    ],
)
def test_an_interval_has_one_verdict(
    scale: Scale, ends: tuple[float | None, float | None], verdict: Word
) -> None:
    assert judge_interval(interval(*ends), scale, SENSITIVITY[scale.name]).word == verdict


_VALUES = st.floats(-1e9, 1e9)


@given(_VALUES, st.floats(1e-9, 1e12), st.floats(0.0, 1.0))
def test_what_is_identifiable_has_a_sign_and_a_value(value: float, error: float, sensitivity: float) -> None:
    scale = replace(SPRING, value=value, bounds=(-1e30, 1e30))
    verdict = judge_error(error, scale, sensitivity).word
    assert (verdict == "identifiable") == (error <= 0.25 * abs(value))
    if verdict != "identifiable":
        small = sensitivity * (abs(value) + DEVIATIONS * error) <= NEGLIGIBLE
        assert (verdict == "negligible") == small
        if not small:
            assert (verdict == "sign unknown") == (DEVIATIONS * error > abs(value))


@given(_VALUES, st.floats(1e-9, 1e12), st.floats(0.0, 1.0))
def test_an_interval_of_a_standard_error_is_judged_as_that_error(
    value: float, error: float, sensitivity: float
) -> None:
    scale = replace(SPRING, value=value, bounds=(-1e30, 1e30))
    # Not where rounding decides.
    if (
        abs(error / (abs(value) or 1.0) - 0.25) < 1e-6
        or abs(DEVIATIONS * error / (abs(value) or 1.0) - 1.0) < 1e-6
    ):
        return
    half = DEVIATIONS * error
    judged = judge_interval(interval(value - half, value + half), scale, sensitivity)
    assert judged.word == judge_error(error, scale, sensitivity).word


def test_an_interval_brings_its_verdict_and_leaves_the_standard_error() -> None:
    spring = FittedParameter(
        name="k",
        value=5312.0,
        unit="N/m",
        standard_error=5100.0,
        lower=-1e6,
        upper=1e6,
        verdict=Verdict("sign unknown", "zero"),
    )
    profile = Profile(
        name="k",
        unit="N/m",
        estimate=5312.0,
        log=False,
        values=(5312.0,),
        misfit=(0.1,),
        ratio=(0.0,),
        interval=interval(100.0, 9000.0),
        verdict=Verdict("weakly identifiable", "wide"),
    )
    found = spring.judged_by(profile, counts_more=False)
    assert (found.verdict, found.interval, found.standard_error) == (
        profile.verdict,
        profile.interval,
        5100.0,
    )
    # Where the error of the fit, which is larger, counts more than the interval does, its verdict stays.
    kept = spring.judged_by(profile, counts_more=True)
    assert (kept.verdict, kept.interval) == (spring.verdict, profile.interval)
    unjudged = replace(profile, verdict=Verdict())
    tied = replace(spring, verdict=Verdict("tied"), tie="2*c").judged_by(unjudged, counts_more=False)
    assert (tied.verdict.word, tied.interval) == ("tied", profile.interval)
    assert spring.judged_by(None, counts_more=False) == spring


def test_a_verdict_is_equal_to_its_word_and_to_one_with_the_same_reason():
    verdict = Verdict("sign unknown", "zero")
    assert verdict == "sign unknown" != Verdict("identifiable")
    assert verdict != Verdict("sign unknown", "wide")
    assert verdict in {"sign unknown"}
