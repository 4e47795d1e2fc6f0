"""Identifiability: the redundancy of the Spencer form is found and named; the normalised form has none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from mrwork import identify
from mrwork.dampers import bouc_wen_from_normalised, damper
from mrwork.identification import Fit
from mrwork.identification.fit import Estimate, Identifiability, ParameterChange
from mrwork.identification.result import covariance
from mrwork.records import DamperTest
from mrwork.records.reading import synthetic_test
from mrwork.uncertainty import identifiability_of
from mrwork.uncertainty.identifiability.verdicts import (
    WEAK,
    ParameterScale,
    changes_along,
    identifiability_from,
    simple_combinations,
    sparse_basis,
)

TEST = synthetic_test("spencer1997_fast")


@pytest.fixture(scope="module")
def normalised() -> Fit:
    return identify("normalised_bouc_wen", TEST, rng=1)


@pytest.fixture(scope="module")
def static() -> tuple[Fit, DamperTest]:
    test = synthetic_test("rd1005_1a")
    return identify("static_hysteretic", test, rng=1), test


def spencer(fit: Fit, scale: float, *, held: bool) -> Fit:
    """The same damper in the Spencer form, with `A` = `scale`; free, or held as an identification holds it."""
    theta = bouc_wen_from_normalised(np.array(fit.theta), scale)
    estimates = tuple(
        Estimate(
            name=parameter.name,
            unit=parameter.unit,
            value=float(value),
            standard_error=None,
            lower=parameter.lower,
            upper=parameter.upper,
            remark="fixed" if held and parameter.name == "A" else "",
        )
        for parameter, value in zip(damper("bouc_wen").parameters, theta, strict=True)
    )
    return replace(fit, model="bouc_wen", estimates=estimates)


def scales(names: str) -> list[ParameterScale]:
    """Parameters of value 1, which are positive."""
    limits = {"of_range": False, "lower": 0.0, "upper": 2.0, "log": True, "bounds": (1e-3, 1e3)}
    return [
        ParameterScale(name=name, unit="m", value=1.0, size=1.0, sensitivity=1.0, **limits)  # type: ignore[arg-type] # of several kinds
        for name in names
    ]


def judged(
    columns: NDArray[np.float64],
    names: str | list[ParameterScale],
    *,
    misfit: float = 1e-9,
    n_effective: float = 60.0,
) -> Identifiability:
    """From derivatives in units of the scales, (n_time, n_params), and the misfit."""
    own = scales(names) if isinstance(names, str) else names
    cov = covariance(columns, misfit) * len(columns) / n_effective
    return identifiability_from(columns, cov, scales=own, n_effective=n_effective)


def verdicts(found: Identifiability) -> dict[str, str]:
    return {each.name: each.verdict for each in found.verdicts}


def test_the_redundancy_of_the_spencer_form_is_found_and_said(normalised: Fit) -> None:
    found = identifiability_of(spencer(normalised, 120.0, held=False), [TEST])
    (unseen,) = [each for each in found.directions if not each.seen]
    shares = {each.name: each.percent for each in unseen.changes}
    # z is multiplied by s: A by s, alpha by 1/s, gamma and beta by s^(1 - n).
    n = dict(zip(normalised.spec.names, normalised.theta, strict=True))["n"]
    assert shares == pytest.approx({"alpha": 1.0, "gamma": n - 1.0, "beta": n - 1.0, "A": -1.0}, rel=1e-4)
    assert unseen.effect < 1e-6
    for words in ("A down 1 %", "alpha A", "gamma/beta"):
        assert words in unseen.sentence
    for name in ("alpha", "gamma", "beta", "A"):
        assert verdicts(found)[name] == "not identifiable"
    for name in ("c0", "k0"):
        assert verdicts(found)[name] == "identifiable"


def test_what_was_held_to_settle_a_scale_makes_the_others_identifiable(normalised: Fit) -> None:
    found = identifiability_of(spencer(normalised, 120.0, held=True), [TEST])
    assert "A" not in verdicts(found)
    assert verdicts(found)["alpha"] == "identifiable"
    (unseen,) = [each for each in found.directions if not each.seen]
    assert unseen.sentence.endswith("; A was held fixed for this reason")


def test_the_normalised_form_has_no_redundancy(normalised: Fit) -> None:
    found = identifiability_of(normalised, [TEST])
    assert all(each.seen for each in found.directions)
    assert "not identifiable" not in verdicts(found).values()
    assert verdicts(found)["k_w"] == "identifiable"


def test_standard_errors_and_effective_samples_are_those_of_the_fit(static: tuple[Fit, DamperTest]) -> None:
    fit, test = static
    found = identifiability_of(fit, [test])
    assert found.n_effective == pytest.approx(fit.n_effective, rel=1e-9)
    theirs = {each.name: each.standard_error for each in fit.estimates}
    for each in found.verdicts:
        # None for delta, which is on its bound.
        assert each.standard_error == (theirs[each.name] and pytest.approx(theirs[each.name], rel=1e-5))


def test_a_ratio_that_alone_is_seen_is_named(static: tuple[Fit, DamperTest]) -> None:
    # 10 mm of stroke on x_s = 0.1 m: tanh(x/x_s) is a straight line of slope 1/x_s.
    # The fit is at the end of that valley, at a bound of delta; half of both gives nearly the same force.
    fit, test = static
    halved = tuple(
        replace(each, value=0.5 * each.value) if each.name in ("delta", "x_s") else each
        for each in fit.estimates
    )
    found = identifiability_of(replace(fit, estimates=halved), [test])
    # delta may have either sign, x_s is positive.
    assert (verdicts(found)["delta"], verdicts(found)["x_s"]) == ("sign unknown", "weakly identifiable")
    (weak,) = found.directions
    assert weak.seen
    assert {each.name for each in weak.changes} == {"delta", "x_s"}
    assert weak.sentence.endswith("; delta/x_s is better identifiable")
    reasons = {each.name: each.reason for each in found.verdicts}
    assert "x_s can compensate for it" in reasons["delta"]


def test_a_parameter_on_its_bound_is_bounded_from_one_side(static: tuple[Fit, DamperTest]) -> None:
    fit, test = static
    bounded = identify("static_hysteretic", test, rng=1, bounds={"beta": (100.0, 300.0)})
    found = identifiability_of(bounded, [test])
    (beta,) = [each for each in found.verdicts if each.name == "beta"]
    assert beta.verdict == "weakly identifiable"
    assert beta.reason.startswith("at lower bound")
    assert [each.name for each in found.verdicts] == list(fit.spec.names)


@pytest.fixture
def columns() -> NDArray[np.float64]:
    return np.random.default_rng(0).standard_normal((60, 4)) * [1.0, 1e-8, 1e6, 1.0]


def test_the_size_of_a_column_does_not_make_it_unseen(columns: NDArray[np.float64]) -> None:
    found = judged(columns, "abcd")
    assert found.directions == ()
    assert {each.verdict for each in found.verdicts} == {"identifiable"}


def test_two_redundancies_are_told_one_by_one(columns: NDArray[np.float64]) -> None:
    # p = a b and q = c/d: two products, four parameters.
    both = np.stack([columns[:, 0], columns[:, 0], columns[:, 3], -columns[:, 3]], axis=1)
    found = judged(both, "abcd")
    assert sorted("".join(each.name for each in one.changes) for one in found.directions) == ["ab", "cd"]
    text = " ".join(each.sentence for each in found.directions)
    assert "a b" in text
    assert "c/d" in text


def test_a_parameter_that_nothing_feels_is_named(columns: NDArray[np.float64]) -> None:
    deaf = columns.copy()
    deaf[:, 2] = 0.0
    found = judged(deaf, "abcd")
    assert {each.name: each.verdict for each in found.verdicts}["c"] == "not identifiable"
    assert [each.sentence for each in found.directions] == ["the residuals do not depend on c"]


def test_a_weak_direction_begins_with_what_it_leaves_open_most(columns: NDArray[np.float64]) -> None:
    # a is told ten times better than b along a + 10 b, which is all but a multiple of the third column.
    nearly = columns / np.linalg.norm(columns, axis=0)
    nearly[:, 0] = -10.0 * nearly[:, 1] + 1e-3 * nearly[:, 0]
    found = judged(nearly, "abcd", misfit=0.1)
    weak = found.directions[0]
    assert weak.seen
    assert [each.name for each in weak.changes] == ["b", "a"]
    assert [each.percent for each in weak.changes] == pytest.approx([1.0, 0.1], rel=0.05)
    assert "so along it the standard error of b is" in weak.sentence


def test_correlated_residuals_widen_standard_errors(columns: NDArray[np.float64]) -> None:
    few, many = (judged(columns, "abcd", n_effective=n).verdicts for n in (15.0, 60.0))
    for one, other in zip(few, many, strict=True):
        assert one.standard_error == pytest.approx(2.0 * (other.standard_error or 0.0))


def test_a_verdict_turns_weak_at_the_stated_share() -> None:
    column = np.ones((101, 1)) / np.sqrt(101.0)
    # One column of unit length: the standard error is misfit / sqrt(100).
    for factor, verdict in ((0.99, "identifiable"), (1.01, "weakly identifiable")):
        found = judged(column, "a", misfit=10.0 * WEAK * factor, n_effective=101.0)
        assert found.verdicts[0].verdict == verdict
        assert found.verdicts[0].standard_error == pytest.approx(WEAK * factor)


def test_a_basis_with_few_parameters_spans_the_same_space() -> None:
    rng = np.random.default_rng(2)
    simple = np.array([[1.0, -1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 2.0, 0.0]])
    mixed = rng.standard_normal((2, 2)) @ simple
    basis = sparse_basis(mixed)
    assert np.linalg.matrix_rank(np.concatenate([basis, simple]), tol=1e-9) == 2
    assert sorted((each != 0.0).sum() for each in basis) == [2, 2]


def test_products_and_ratios_have_simple_exponents() -> None:
    changes = changes_along(np.array([0.5, -1.0, 0.5, 0.137, 1e-4]), scales("abcde"))
    assert [each.name for each in changes] == ["a", "b", "c", "d"]
    assert simple_combinations(changes) == ("a^2 b", "a/c")
    assert (
        simple_combinations(
            [*changes, ParameterChange(name="x0", percent=1.0, of_range=True, amount=1e-4, unit="m")]
        )
        == ()
    )
    assert [each.in_words for each in changes[:2]] == ["a up 1 %", "b down 2 %"]


def test_a_change_of_a_parameter_that_may_be_zero_is_in_its_unit() -> None:
    (wide,) = [replace(each, value=1e-3, size=0.02, of_range=True, log=False) for each in scales("a")]
    (change,) = changes_along(np.array([2.0]), [wide])
    assert change.in_words == "a up 0.0002 m"


def test_what_cancels_in_the_force_is_named_however_small_beside_its_range() -> None:
    # Of two springs in parallel only the sum is seen; the second is measured by a range of a thousand times its value.
    column = np.ones((101, 1))
    springs = np.concatenate([column, 1000.0 * column, np.linspace(-1.0, 1.0, 101)[:, None]], axis=1)
    (found,) = judged(springs, "abc").directions
    assert [each.name for each in found.changes] == ["a", "b"]
    assert found.changes[1].percent == pytest.approx(-1e-3)
