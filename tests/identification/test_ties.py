"""Parameters that are tied to others by an expression: values, derivatives, errors, bounds; what is no expression."""

from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from refusals import command_refusal, refusal
from scipy.optimize import approx_fprime

import mrwork as mr
from mrwork.identification.ties import Ties

TIE = {"f0": "-0.1*f_c + 5"}


@pytest.fixture(scope="module")
def test() -> mr.DamperTest:
    return mr.records.cut(mr.synthetic_test("rd1005_1a"), every=8)


@pytest.fixture(scope="module")
def fit(test: mr.DamperTest) -> mr.Fit:
    return mr.identify("bingham", test, ties=TIE)


def test_a_tied_parameter_is_its_expression_and_its_error_follows(fit: mr.Fit) -> None:
    source, tied = fit.parameters["f_c"], fit.parameters["f0"]
    assert tied.value == pytest.approx(-0.1 * source.value + 5.0, rel=1e-12)
    assert source.standard_error is not None
    assert tied.standard_error == pytest.approx(0.1 * source.standard_error, rel=1e-9)
    assert (tied.tie, tied.verdict.word) == (TIE["f0"], "tied")
    assert (source.tie, fit.status) == ("", "converged")


def test_a_tied_fit_is_that_of_the_tied_model_by_hand(fit: mr.Fit, test: mr.DamperTest) -> None:
    """The parameters are fitted by SciPy to forces that are simulated with the tie written out."""
    from scipy.optimize import minimize

    free = mr.objective("bingham", test)

    def misfit(logs: np.ndarray) -> float:
        f_c, v_s, c0 = np.exp(logs)
        return float(free(np.array([f_c, v_s, c0, -0.1 * f_c + 5.0])))

    start = np.log(np.array(fit.theta)[:3]) + 0.05
    found = minimize(
        misfit, start, method="Nelder-Mead", options={"xatol": 1e-8, "fatol": 1e-12, "maxiter": 4000}
    )
    assert found.fun == pytest.approx(fit.nrmse, rel=1e-6)
    assert np.exp(found.x) == pytest.approx(np.array(fit.theta)[:3], rel=1e-3)


def test_derivatives_go_through_the_tie(test: mr.DamperTest) -> None:
    ties = {"f0": "-0.1*f_c + c0**0.5", "v_s": "f0/f_c + 0.3"}
    objective = mr.objective("bingham", test, ties=ties)
    assert objective.names == ("f_c", "c0")
    point = np.array([700.0, 2500.0])
    assert objective.theta(point) == pytest.approx([700.0, -20.0 / 700.0 + 0.3, 2500.0, -20.0])
    numeric = approx_fprime(point, objective.residuals, [1e-4, 1e-3])
    scale = np.abs(numeric).max(axis=0)
    assert np.abs((objective.jacobian(point) - numeric) / scale).max() < 1e-4


def test_a_value_is_that_of_python_and_its_slope_that_of_differences() -> None:
    spec = mr.damper("bingham")
    expression = "2*(c0 - 3.5)/f_c**2 + -v_s*1e3 - +4"
    ties = Ties.of(spec, {"f0": expression}, mr.Box.of(spec))
    theta = np.array([600.0, 0.01, 4000.0, 0.0])
    f_c, v_s, c0, _ = theta
    assert ties.apply(theta)[3] == pytest.approx(2 * (c0 - 3.5) / f_c**2 + -v_s * 1e3 - +4)
    slope = approx_fprime(theta, lambda each: ties.apply(each)[3], 1e-6 * theta + 1e-9)
    assert ties.conversion.jacobian(theta)[3] == pytest.approx(slope, rel=1e-4, abs=1e-9)
    chains = np.broadcast_to(theta, (2, 3, 4))
    assert ties.apply(chains).shape == (2, 3, 4)


def test_bounds_of_a_tied_parameter_are_kept(test: mr.DamperTest) -> None:
    """Free, f0 would be far below its lower bound, so the minimum is on it."""
    bounds = {"f0": (-20.0, 100.0)}
    fit = mr.identify("bingham", test, ties=TIE, bounds=bounds)
    assert -20.0 <= fit.parameters["f0"].value <= 100.0
    objective = mr.objective("bingham", test, ties=TIE, bounds=bounds)
    assert np.isinf(objective([500.0, 0.01, 5000.0]))
    assert np.isfinite(objective([200.0, 0.01, 5000.0]))


def test_later_verbs_keep_the_tie(fit: mr.Fit, test: mr.DamperTest) -> None:
    assert [each.name for each in fit.estimates if each.verdict.word == "tied"] == ["f0"]
    draws = mr.sample(fit, test, walkers=16, most_steps=20, tempering="effective", threads=1)
    assert draws.theta[:, 3] == pytest.approx(-0.1 * draws.theta[:, 0] + 5.0, rel=1e-12)
    assert np.ptp(draws.theta[:, 3]) > 0.0
    profiles = mr.profile(fit, test, parameters=["f_c"], threads=1)
    assert profiles.misfit == pytest.approx(fit.nrmse, rel=1e-6)


def test_parameters_of_a_fit_are_found_by_name(fit: mr.Fit) -> None:
    assert list(fit.parameters) == ["f_c", "v_s", "c0", "f0"]
    assert "k" not in fit.parameters
    refusal(lambda: fit.parameters["C0"], match="did you mean c0")


@pytest.mark.parametrize(
    ("ties", "word"),
    [
        ({"f0": "2*k"}, "'k'"),
        ({"f0": "__import__('os').system('true')"}, "not understood"),
        ({"f0": "f_c**c0"}, r"f_c \*\* c0"),
        ({"f0": "2*"}, "no expression"),
        ({"f0": "3.0"}, "equal bounds"),
        ({"f0": "c0", "c0": "f_c", "f_c": "f0"}, "ties of f0, c0, f_c go in a circle"),
    ],
)
def test_what_is_no_tie_is_refused_and_never_run(
    test: mr.DamperTest, ties: dict[str, str], word: str
) -> None:
    refusal(mr.identify, "bingham", test, ties=ties, match=word)


def test_ties_of_parameters_that_have_other_values_are_refused(test: mr.DamperTest) -> None:
    refusal(mr.identify, "bingham", test, ties=TIE, bounds={"f0": (0.0, 0.0)}, match="tied and held")
    refusal(mr.identify, "bouc_wen", test, ties={"c0": "2*k0"}, match="tie those of normalised_bouc_wen")
    laws = mr.damper("bingham").with_current_laws({"f_c": "linear"})
    refusal(mr.identify, laws, test, ties={"v_s": "c0"}, match="follow the command")


def test_a_plan_of_tests_with_a_tied_fit_is_refused(fit: mr.Fit, test: mr.DamperTest) -> None:
    candidate = mr.uncertainty.Candidate(amplitude=0.01, frequency=1.0)
    refusal(mr.plan, fit, [test], [candidate], match="tied f0")


def test_the_command_ties_and_writes_the_tie(tmp_path: Path) -> None:
    place = tmp_path / "run"
    common = ("identify", "synthetic:rd1005_1a", "--every=8", "--model=bingham", "--quiet", "--json")
    printed(*common, "--tie=f0=-0.1*f_c + 5", f"--out={place}")
    found = mr.load(place).fit
    assert found.ties == TIE
    assert found.parameters["f0"].value == pytest.approx(-0.1 * found.parameters["f_c"].value + 5.0)
    command_refusal(*common, "--tie=f0=c0", "--tie=f0=f_c", match="--tie gives f0 twice")
    command_refusal(
        *("identify", "synthetic:rd1005_1a", "--model=bingham,viscous_dahl", "--tie=f0=c0"), match="one model"
    )
