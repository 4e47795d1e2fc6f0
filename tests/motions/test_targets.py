"""Target spectra against hand calculation, motions scaled to them, and the check of a suite."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from refusals import refusal

import mrwork as mr
from mrwork.motions import (
    TargetSpectrum,
    asce_7_spectrum,
    check_suite,
    en_1998_spectrum,
    scaled,
    scaled_to_target,
    table_spectrum,
)

G = 9.80665
MOTION = mr.synthetic_motion(rng=0, duration=8.0)
SUITE = [mr.synthetic_motion(rng=seed, duration=8.0, name=f"motion {seed}") for seed in range(3)]
TARGET = en_1998_spectrum(2.0, "B")
TABLE = table_spectrum([0.1, 0.5, 1.0], [5.0, 5.0, 2.0])
STILL = mr.GroundMotion(name="still", dt=0.01, acceleration=np.zeros(9))


# By hand from Tables 3.2 and 3.3: a_g S, 2.5 eta a_g S over T_B to T_C, and T_C / T_D of that at T_D.
@pytest.mark.parametrize(
    ("kind", "ground", "corners", "values"),
    [
        (1, "A", (0.15, 0.4, 2.0), (2.0, 5.0, 5.0, 1.0)),
        (1, "B", (0.15, 0.5, 2.0), (2.4, 6.0, 6.0, 1.5)),
        (1, "C", (0.2, 0.6, 2.0), (2.3, 5.75, 5.75, 1.725)),
        (1, "D", (0.2, 0.8, 2.0), (2.7, 6.75, 6.75, 2.7)),
        (1, "E", (0.15, 0.5, 2.0), (2.8, 7.0, 7.0, 1.75)),
        (2, "A", (0.05, 0.25, 1.2), (2.0, 5.0, 5.0, 1.0416667)),
        (2, "B", (0.05, 0.25, 1.2), (2.7, 6.75, 6.75, 1.40625)),
        (2, "C", (0.1, 0.25, 1.2), (3.0, 7.5, 7.5, 1.5625)),
        (2, "D", (0.1, 0.3, 1.2), (3.6, 9.0, 9.0, 2.25)),
        (2, "E", (0.05, 0.25, 1.2), (3.2, 8.0, 8.0, 1.6666667)),
    ],
)
def test_eurocode_has_the_values_of_its_tables_at_its_corners(
    kind: int, ground: str, corners: tuple[float, ...], values: tuple[float, ...]
) -> None:
    spectrum = en_1998_spectrum(2.0, ground, spectrum_type=kind)  # type: ignore[arg-type]
    assert spectrum.acceleration([0.0, *corners]) == pytest.approx(values, rel=1e-6)


def test_eurocode_follows_its_four_formulas() -> None:
    # Type 1, ground C, 10 %: eta = sqrt(10 / 15), a_g S = 2.3 m/s2.
    spectrum, eta = en_1998_spectrum(2.0, "C", damping=0.1), np.sqrt(10.0 / 15.0)
    expected = [
        2.3 * (1.0 + 0.5 * (2.5 * eta - 1.0)),
        2.3 * 2.5 * eta,
        2.3 * 2.5 * eta * 0.6 / 1.2,
        2.3 * 2.5 * eta * 0.6 * 2.0 / 3.0**2,
    ]
    assert spectrum.acceleration([0.1, 0.4, 1.2, 3.0]) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize(("damping", "eta"), [(0.02, np.sqrt(10.0 / 7.0)), (0.05, 1.0), (0.4, 0.55)])
def test_eurocode_is_corrected_for_damping_down_to_its_bound(damping: float, eta: float) -> None:
    spectrum = en_1998_spectrum(1.0, damping=damping)
    assert spectrum.acceleration([0.0, 0.3]) == pytest.approx([1.0, 2.5 * eta])


def test_asce_7_follows_its_four_formulas() -> None:
    # S_DS = 1.0 g, S_D1 = 0.6 g, T_L = 8 s: T_0 = 0.12 s, T_S = 0.6 s.
    spectrum = asce_7_spectrum(G, 0.6 * G, t_l=8.0)
    periods = [0.0, 0.06, 0.12, 0.4, 0.6, 1.0, 8.0, 10.0]
    expected = [0.4, 0.7, 1.0, 1.0, 1.0, 0.6, 0.075, 0.6 * 8.0 / 100.0]
    assert spectrum.acceleration(periods) / G == pytest.approx(expected, rel=1e-14)


@examples(50)
@given(at=st.floats(0.0, 12.0))
def test_codes_are_continuous_and_a_table_of_them_is_near(at: float) -> None:
    spectrum = en_1998_spectrum(2.0, "D", spectrum_type=2)
    near = spectrum.acceleration([at, at + 1e-9])
    assert near[1] == pytest.approx(near[0], rel=1e-6)
    periods = np.unique(np.concatenate([spectrum.periods, np.linspace(0.0, 13.0, 4000)]))
    table = table_spectrum(periods, spectrum.acceleration(periods))
    assert table.acceleration(at) == pytest.approx(spectrum.acceleration(at), rel=1e-3)


def pseudo_acceleration(motion: mr.GroundMotion, periods: np.typing.ArrayLike, damping: float) -> np.ndarray:
    return mr.response_spectrum(motion, periods, damping=damping).pseudo_acceleration


@pytest.mark.parametrize(
    "target", [TARGET, en_1998_spectrum(2.0, damping=0.1), asce_7_spectrum(9.0, 5.0, t_l=8.0)]
)
def test_a_scaled_motion_has_what_it_was_scaled_to(target: TargetSpectrum) -> None:
    assert scaled_to_target(MOTION, target, by="pga").peak == pytest.approx(target.acceleration(0.0))
    at_period = scaled_to_target(MOTION, target, by="sa", period=0.7)
    assert pseudo_acceleration(at_period, 0.7, target.damping) == pytest.approx(target.acceleration([0.7]))
    periods = np.geomspace(0.14, 1.4, 101)
    fitted = scaled_to_target(MOTION, target, by="least_squares", period=0.7)
    wanted, own = target.acceleration(periods), pseudo_acceleration(fitted, periods, target.damping)
    losses = [((factor * own - wanted) ** 2).sum() for factor in (1.0 - 1e-4, 1.0, 1.0 + 1e-4)]
    assert losses[1] == min(losses)


@pytest.mark.parametrize("by", ["pga", "sa", "least_squares"])
def test_the_scale_that_a_motion_had_does_not_matter(by: str) -> None:
    one, other = (
        scaled_to_target(motion, TARGET, by=by, period=0.7)  # type: ignore[arg-type]
        for motion in (MOTION, scaled(MOTION, -3.7))
    )
    np.testing.assert_allclose(other.acceleration, -one.acceleration, rtol=1e-12)


def test_a_suite_that_is_raised_by_its_factor_just_meets_the_rule() -> None:
    motions = [scaled_to_target(each, TARGET, by="least_squares", period=0.5) for each in SUITE]
    check = check_suite(motions, TARGET, period=0.5)
    assert check.factor > 1.0
    told = [each for each in check.remarks if each.code in ("suite_below_target", "suite_peaks_low")]
    assert told
    assert all(f"a factor of {np.ceil(1e3 * check.factor) / 1e3:g} on" in each.message for each in told)
    raised = check_suite([scaled(each, check.factor) for each in motions], TARGET, period=0.5)
    assert raised.shortcomings == ()
    assert [each.code for each in raised.remarks] == ["suite_worst_response"]
    assert raised.factor == pytest.approx(1.0)
    lower = check_suite([scaled(each, 0.999 * check.factor) for each in motions], TARGET, period=0.5)
    assert lower.shortcomings


def test_the_mean_counts_between_a_fifth_and_twice_the_period() -> None:
    check = check_suite(SUITE, TARGET, period=0.5)
    periods = np.geomspace(0.1, 1.0, 101)
    mean = np.mean([pseudo_acceleration(each, periods, 0.05) for each in SUITE], axis=0)
    ratios = mean / TARGET.acceleration(periods)
    assert check.least == (pytest.approx(ratios.min()), pytest.approx(periods[ratios.argmin()]))
    assert check.peak_ratio == pytest.approx(np.mean([each.peak for each in SUITE]) / 2.4)
    assert check.mean_ratio == pytest.approx(ratios.mean())


@pytest.mark.parametrize(("wanted", "would_be"), [(0.5, "stronger"), (1.0, ""), (2.0, "weaker")])
def test_a_suite_far_from_its_target_is_told(wanted: float, would_be: str) -> None:
    factor = wanted / check_suite(SUITE, TARGET, period=0.5).mean_ratio
    check = check_suite([scaled(each, factor) for each in SUITE], TARGET, period=0.5)
    told = [each for each in check.remarks if each.code == "suite_far_from_target"]
    assert [each.words[1] for each in told] == [would_be][: bool(would_be)]
    assert [each.measured.value for each in told if each.measured] == pytest.approx(
        [wanted][: bool(would_be)]
    )


def test_a_code_wants_its_number_of_records() -> None:
    strong = [scaled(each, 100.0) for each in SUITE]

    def codes(motions: Sequence[mr.motions.GroundMotion], target: TargetSpectrum = TARGET) -> list[str]:
        check = check_suite(motions, target, period=0.5)
        assert ("does not meet" in check.in_words[0]) == bool(check.shortcomings)
        return [each.code for each in check.remarks if each.code != "suite_far_from_target"]

    assert codes(strong[:2]) == ["suite_records_few"]
    assert codes(strong) == ["suite_worst_response"]
    assert (
        codes(
            [scaled(mr.synthetic_motion(rng=seed, duration=8.0, name=str(seed)), 100.0) for seed in range(7)]
        )
        == []
    )
    assert codes(strong, asce_7_spectrum(9.0, 5.0, t_l=8.0)) == ["suite_records_few"]


def test_a_table_without_the_period_zero_asks_nothing_of_the_peaks() -> None:
    check = check_suite(SUITE, TABLE, period=0.5)
    assert check.peak_ratio is None
    assert "suite_peaks_low" not in {each.code for each in check.remarks}
    assert check.periods.min() >= 0.1


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: TABLE.acceleration([0.05, 0.5]), "from 0.1 to 1 s"),
        (lambda: table_spectrum([0.1, 0.1], [1.0, 1.0]), "increasing"),
        (lambda: asce_7_spectrum(10.0, 6.0, t_l=0.5), "S_D1 / S_DS = 0.6 s"),
        (lambda: scaled_to_target(MOTION, TARGET, by="sa"), "give `period`"),
        (lambda: scaled_to_target(MOTION, TABLE, by="pga"), "asked for at 0 s"),
        (lambda: scaled_to_target(STILL, TARGET, by="pga"), "zero throughout"),
        (lambda: check_suite(SUITE, TABLE, period=0.6), "0.12 to 1.2 s"),
    ],
)
def test_what_has_no_sense_is_refused(call: Callable[[], object], word: str) -> None:
    refusal(call, match=word)
