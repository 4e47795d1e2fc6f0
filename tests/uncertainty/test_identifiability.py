"""Identifiability: the redundancy of the Spencer form is found and named; the normalised form has none."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import mrwork as mr
from mrwork.identification.covariance import Covariance, Slopes, covariance
from mrwork.identification.fit import Direction, FittedParameter, ParameterChange
from mrwork.identification.problem import Problem
from mrwork.identification.verdicts import (
    WEAK,
    Scale,
    changes_along,
    fitted_parameters,
    judged,
    simple_combinations,
    sparse_basis,
)

TEST = mr.synthetic_test("spencer1997_fast")

Judged = tuple[tuple[FittedParameter, ...], tuple[Direction, ...]]


@pytest.fixture(scope="module")
def normalised() -> mr.Fit:
    return mr.identify("normalised_bouc_wen", TEST, rng=1)


@pytest.fixture(scope="module")
def static() -> tuple[mr.Fit, mr.DamperTest]:
    test = mr.synthetic_test("rd1005_1a")
    return mr.identify("static_hysteretic", test, rng=1), test


def at(model: str, theta: NDArray[np.float64], test: mr.DamperTest) -> Judged:
    """The parameters of a model at these values, judged by a test."""
    problem = Problem.of(mr.damper(model), (test,), mr.identification.FitSettings())
    there = problem.inside(theta)
    covariance = Covariance.of(Slopes.at(problem.objective, problem.form, there))
    return fitted_parameters(problem, there, covariance)


def scales(names: str) -> list[Scale]:
    """Parameters of value 1, which are positive."""
    limits = {"of_range": False, "lower": 0.0, "upper": 2.0, "log": True, "bounds": (1e-3, 1e3)}
    return [
        Scale(name=name, unit="m", value=1.0, size=1.0, **limits)  # type: ignore[arg-type] # of several kinds
        for name in names
    ]


def judge(
    columns: NDArray[np.float64], names: str | list[Scale], *, misfit: float = 1e-9, n_effective: float = 60.0
) -> Judged:
    """From derivatives in units of the scales, (n_time, n_params), and the misfit."""
    own = scales(names) if isinstance(names, str) else names
    rows = [
        FittedParameter(name=each.name, value=1.0, unit="m", standard_error=None, lower=1e-3, upper=1e3)
        for each in own
    ]
    cov = covariance(columns, misfit) * len(columns) / n_effective
    return judged(rows, columns, cov, scales=own)


def verdicts(found: Judged) -> dict[str, str]:
    return {each.name: each.verdict.word for each in found[0]}


def test_the_redundancy_of_the_spencer_form_is_found_and_said(normalised: mr.Fit) -> None:
    found = at("bouc_wen", mr.dampers.bouc_wen_from_normalised(np.array(normalised.theta), 120.0), TEST)
    (unseen,) = [each for each in found[1] if not each.seen]
    shares = {each.name: each.percent for each in unseen.changes}
    # z is multiplied by s: A by s, alpha by 1/s, gamma and beta by s^(1 - n).
    n = dict(zip(normalised.spec.names, normalised.theta, strict=True))["n"]
    assert shares == pytest.approx({"alpha": 1.0, "gamma": n - 1.0, "beta": n - 1.0, "A": -1.0}, rel=1e-4)
    assert unseen.effect < 1e-6
    for words in ("A down 1 %", "alpha A", "gamma/beta"):
        assert words in unseen.sentence
    # What is held to settle the scale makes the others identifiable.
    assert unseen.sentence.endswith("; A was held fixed for this reason")
    assert (verdicts(found)["A"], verdicts(found)["alpha"]) == ("fixed", "identifiable")


def test_the_normalised_form_has_no_redundancy(normalised: mr.Fit) -> None:
    assert all(each.seen for each in normalised.directions)
    assert "not identifiable" not in verdicts((normalised.estimates, ())).values()
    assert normalised.parameters["k_w"].verdict.word == "identifiable"


def test_a_ratio_that_alone_is_seen_is_named(static: tuple[mr.Fit, mr.DamperTest]) -> None:
    # 10 mm of stroke on x_s = 0.1 m: tanh(x/x_s) is a straight line of slope 1/x_s.
    # The fit is at the end of that valley, at a bound of delta; half of both gives nearly the same force.
    fit, test = static
    halves = [0.5 * each.value if each.name in ("delta", "x_s") else each.value for each in fit.estimates]
    found = at("static_hysteretic", np.array(halves), test)
    # delta may have either sign, x_s is positive.
    assert (verdicts(found)["delta"], verdicts(found)["x_s"]) == ("sign unknown", "weakly identifiable")
    (weak,) = found[1]
    assert weak.seen
    assert {each.name for each in weak.changes} == {"delta", "x_s"}
    assert weak.sentence.endswith("; delta/x_s is better identifiable")
    reasons = {each.name: each.verdict.reason for each in found[0]}
    assert "x_s can compensate for it" in reasons["delta"]


def test_a_parameter_on_its_bound_is_bounded_from_one_side(static: tuple[mr.Fit, mr.DamperTest]) -> None:
    _, test = static
    bounded = mr.identify("static_hysteretic", test, rng=1, bounds={"beta": (100.0, 300.0)})
    beta = bounded.parameters["beta"]
    assert (beta.verdict.word, beta.standard_error) == ("weakly identifiable", None)
    assert beta.verdict.reason.startswith("at lower bound")


@pytest.fixture
def columns() -> NDArray[np.float64]:
    return np.random.default_rng(0).standard_normal((60, 4)) * [1.0, 1e-8, 1e6, 1.0]


def test_the_size_of_a_column_does_not_make_it_unseen(columns: NDArray[np.float64]) -> None:
    found = judge(columns, "abcd")
    assert found[1] == ()
    assert {each.verdict.word for each in found[0]} == {"identifiable"}


def test_two_redundancies_are_told_one_by_one(columns: NDArray[np.float64]) -> None:
    # p = a b and q = c/d: two products, four parameters.
    both = np.stack([columns[:, 0], columns[:, 0], columns[:, 3], -columns[:, 3]], axis=1)
    found = judge(both, "abcd")
    assert sorted("".join(each.name for each in one.changes) for one in found[1]) == ["ab", "cd"]
    text = " ".join(each.sentence for each in found[1])
    assert "a b" in text
    assert "c/d" in text
    assert set(verdicts(found).values()) == {"not identifiable"}


def test_a_parameter_that_nothing_feels_is_named(columns: NDArray[np.float64]) -> None:
    deaf = columns.copy()
    deaf[:, 2] = 0.0
    found = judge(deaf, "abcd")
    assert verdicts(found)["c"] == "not identifiable"
    assert [each.sentence for each in found[1]] == ["the residuals do not depend on c"]


def test_a_weak_direction_begins_with_what_it_leaves_open_most(columns: NDArray[np.float64]) -> None:
    # a is told ten times better than b along a + 10 b, which is all but a multiple of the third column.
    nearly = columns / np.linalg.norm(columns, axis=0)
    nearly[:, 0] = -10.0 * nearly[:, 1] + 1e-3 * nearly[:, 0]
    found = judge(nearly, "abcd", misfit=0.1)
    weak = found[1][0]
    assert weak.seen
    assert [each.name for each in weak.changes] == ["b", "a"]
    assert [each.percent for each in weak.changes] == pytest.approx([1.0, 0.1], rel=0.05)
    assert "so along it the standard error of b is" in weak.sentence


def test_correlated_residuals_widen_standard_errors(columns: NDArray[np.float64]) -> None:
    few, many = (judge(columns, "abcd", n_effective=n)[0] for n in (15.0, 60.0))
    for one, other in zip(few, many, strict=True):
        assert one.standard_error == pytest.approx(2.0 * (other.standard_error or 0.0))


def test_a_verdict_turns_weak_at_the_stated_share() -> None:
    column = np.ones((101, 1)) / np.sqrt(101.0)
    # One column of unit length: the standard error is misfit / sqrt(100).
    for factor, verdict in ((0.99, "identifiable"), (1.01, "weakly identifiable")):
        found = judge(column, "a", misfit=10.0 * WEAK * factor, n_effective=101.0)
        assert found[0][0].verdict.word == verdict
        assert found[0][0].standard_error == pytest.approx(WEAK * factor)


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
    (found,) = judge(springs, "abc")[1]
    assert [each.name for each in found.changes] == ["a", "b"]
    assert found.changes[1].percent == pytest.approx(-1e-3)
