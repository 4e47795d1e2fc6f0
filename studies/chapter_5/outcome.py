"""The models of the chapter identified at each current, and their parameters as laws in the current."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

import mrwork as mr
from mrwork.dampers import DamperSpec, LawName
from mrwork.identification import Fit, free_run
from mrwork.records import DamperTest
from mrwork.search import EfficientGA
from studies.chapter_5.damper_tests import SIDE_M, STATIC_LAWS, TestSet
from studies.former.arrays import Floats
from studies.former.command import Say

_DEGREES: dict[LawName, int] = {"constant": 0, "linear": 1, "quadratic": 2}


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A model of figure 5.9: the parameters that are held, and the laws of the others where it has any."""

    label: str
    damper: str
    held: dict[str, float]
    laws: dict[str, LawName]

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        return {name: (value, value) for name, value in self.held.items()}

    @property
    def spec(self) -> DamperSpec:
        """The model with its laws."""
        return mr.damper(self.damper).with_current_laws(self.laws)

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the parameters that are not held, in order."""
        return tuple(name for name in mr.damper(self.damper).names if name not in self.held)


# Our definition: the heights quadratic as alpha of the static model, the rest linear.
POLYNOMIAL_LAWS: dict[str, LawName] = {
    "a": "quadratic",
    "b": "linear",
    "v0": "linear",
    "c": "linear",
    "f0": "linear",
    "h": "quadratic",
    "v1": "linear",
    "w": "linear",
}

STATIC = Model(label="static hysteretic", damper="static_hysteretic", held={"x_s": SIDE_M}, laws=STATIC_LAWS)
POLYNOMIAL = Model(
    label="polynomial-fitting", damper="polynomial_fitting", held={"x_s": SIDE_M}, laws=POLYNOMIAL_LAWS
)
BOUC_WEN = Model(label="Bouc-Wen", damper="normalised_bouc_wen", held={}, laws={})

MODELS = (STATIC, POLYNOMIAL, BOUC_WEN)
WITH_LAWS = (STATIC, POLYNOMIAL)


@dataclass(frozen=True, slots=True, kw_only=True)
class PerCurrent:
    """Fits of one model, a current at a time."""

    model: Model
    currents: Floats
    fits: tuple[Fit, ...]

    @property
    def values(self) -> Floats:
        """Parameters, shape (n_currents, n_params)."""
        return np.array([fit.theta for fit in self.fits])

    @property
    def errors(self) -> Floats:
        """Standard errors, shape (n_currents, n_params); NaN where there is none."""
        return np.array(
            [[_or_nan(estimate.standard_error) for estimate in fit.estimates] for fit in self.fits]
        )

    @property
    def rms_n(self) -> Floats:
        """RMS error [N], shape (n_currents,)."""
        return np.array([fit.rmse_n for fit in self.fits])


@dataclass(frozen=True, slots=True, kw_only=True)
class Laws:
    """Parameters of one model as polynomials in the current [A], lowest power first, and what comes of them.

    `errors` of the coefficients are NaN where there is none; `rms_n` [N] has shape (n_currents,).
    """

    coefficients: dict[str, tuple[float, ...]]
    errors: dict[str, tuple[float, ...]]
    rms_n: Floats

    def at(self, name: str, currents: Floats) -> Floats:
        return np.polynomial.polynomial.polyval(currents, self.coefficients[name])


@dataclass(frozen=True, slots=True, kw_only=True)
class LawComparison:
    """The same laws found three ways.

    through
        Least squares through the values identified at each current, as in the thesis.
    weighted
        The same, each value weighing by its standard error.
    joint
        Identified from all tests at once.
    """

    through: Laws
    weighted: Laws
    joint: Laws


@dataclass(frozen=True, slots=True, kw_only=True)
class Fitting:
    """How models are identified, and who is told."""

    search: EfficientGA
    rng: int
    say: Say = lambda what: None

    def fit(self, model: Model, spec: DamperSpec, tests: DamperTest | tuple[DamperTest, ...]) -> Fit:
        """The model, or the model with its laws, identified from one test or all of them."""
        return mr.identify(spec, tests, bounds=model.bounds, observe="none", search=self.search, rng=self.rng)


def identify_each(model: Model, tests: TestSet, fitting: Fitting) -> PerCurrent:
    fits = []
    for test in tests.tests:
        fitting.say(f"{test.name}: {model.label}")
        fits.append(fitting.fit(model, mr.damper(model.damper), test))
    return PerCurrent(model=model, currents=tests.currents, fits=tuple(fits))


def compare_laws(each: PerCurrent, tests: TestSet, fitting: Fitting) -> LawComparison:
    model = each.model
    fitting.say(f"{tests.name}: {model.label}, all currents at once")
    fit = fitting.fit(model, model.spec, tests.tests)
    return LawComparison(
        through=_laws_through(each, tests, weighted=False),
        weighted=_laws_through(each, tests, weighted=True),
        joint=Laws(
            coefficients=_by_parameter(model, fit.theta),
            errors=_by_parameter(model, [_or_nan(estimate.standard_error) for estimate in fit.estimates]),
            rms_n=np.array([quality.rmse_n for quality in fit.quality]),
        ),
    )


def laws_of(model: Model, coefficients: dict[str, tuple[float, ...]], tests: TestSet) -> Laws:
    """Laws with given coefficients, and their errors on the tests."""
    nothing = {name: tuple(np.nan for _ in values) for name, values in coefficients.items()}
    return Laws(coefficients=coefficients, errors=nothing, rms_n=_rms_on(model, coefficients, tests))


def _laws_through(each: PerCurrent, tests: TestSet, *, weighted: bool) -> Laws:
    """Polynomials through per-current values.

    With weights, values without a standard error, which the test does not determine or which lie on a bound, are left
    out.
    """
    model = each.model
    coefficients: dict[str, tuple[float, ...]] = {}
    errors: dict[str, tuple[float, ...]] = {}
    for name, value, error in zip(mr.damper(model.damper).names, each.values.T, each.errors.T, strict=True):
        if name in model.held:
            coefficients[name], errors[name] = (model.held[name],), (np.nan,)
            continue
        degree = _DEGREES[model.laws.get(name, "constant")]
        known = np.isfinite(error) & (error > 0.0) if weighted else np.isfinite(value)
        if np.count_nonzero(known) <= degree:
            known = np.isfinite(value)
            weight = np.ones(value.size)
        else:
            weight = 1.0 / error if weighted else np.ones(value.size)
        found, covariance = _polynomial(each.currents[known], value[known], weight[known], degree)
        coefficients[name], errors[name] = tuple(found), tuple(np.sqrt(np.diag(covariance)))
    return Laws(coefficients=coefficients, errors=errors, rms_n=_rms_on(model, coefficients, tests))


def _polynomial(currents: Floats, values: Floats, weight: Floats, degree: int) -> tuple[Floats, Floats]:
    """Weighted least squares: coefficients, lowest power first, and their covariance from the scatter about them."""
    design = np.vander(currents, degree + 1, increasing=True) * weight[:, None]
    found, *_ = np.linalg.lstsq(design, weight * values)
    spare = currents.size - degree - 1
    scatter = np.sum((design @ found - weight * values) ** 2) / spare if spare else np.nan
    return found, scatter * np.linalg.pinv(design.T @ design)


def _rms_on(model: Model, coefficients: dict[str, tuple[float, ...]], tests: TestSet) -> Floats:
    theta = np.array([value for name in mr.damper(model.damper).names for value in coefficients[name]])
    return np.array([free_run(model.spec, theta, test)[1].rmse_n for test in tests.tests])


def _by_parameter(model: Model, values: Sequence[float]) -> dict[str, tuple[float, ...]]:
    """Numbers in the order of the model with laws, gathered by the parameter of the plain model."""
    gathered: dict[str, tuple[float, ...]] = {}
    for name, value in zip(model.spec.names, values, strict=True):
        parameter = name.partition(".")[0]
        gathered[parameter] = (*gathered.get(parameter, ()), float(value))
    return gathered


def _or_nan(value: float | None) -> float:
    return np.nan if value is None else value


@dataclass(frozen=True, slots=True, kw_only=True)
class SetOutcome:
    """Fits and laws by the label of the model; `true_laws` where the static hysteretic model is the truth."""

    tests: TestSet
    each: dict[str, PerCurrent]
    laws: dict[str, LawComparison]
    true_laws: Laws | None


def study_set(tests: TestSet, models: tuple[Model, ...], fitting: Fitting) -> SetOutcome:
    """Identify every model at each current, and the laws of those that have them."""
    each = {model.label: identify_each(model, tests, fitting) for model in models}
    laws = {
        model.label: compare_laws(each[model.label], tests, fitting) for model in models if model in WITH_LAWS
    }
    true = None if tests.coefficients is None else laws_of(STATIC, tests.coefficients, tests)
    return SetOutcome(tests=tests, each=each, laws=laws, true_laws=true)
