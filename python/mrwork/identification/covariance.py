"""Standard errors at a minimum: residuals with their derivatives, covariance, effective number of samples.

One rule of effective samples is used everywhere: standard errors, tempering of a posterior, profiles, verdicts, plans,
blocks of a cross-validation and the residual tests of a report. It is n / tau with the integrated autocorrelation time
tau, summed over the initial monotone sequence of Geyer (1992). In theory the sums of adjacent correlations decrease
with the lag; an increase is chance, and counts as the least sum before it. Geyer's initial positive sequence counts
such sums in full, and estimated a third too few samples for nearly white residuals.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import ON_BOUND, bound_at
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import ParameterState
from mrwork.identification.objective import NormalEquations, Objective, linearise_residuals
from mrwork.records import DamperTest

# A combination of parameters (each scaled to unit sensitivity) that changes the residuals less than this, relative to
# the most sensitive one, is not identifiable. Rounding leaves about 1e-11. The same number bounds the squared
# component of a parameter that takes part in such a combination.
INSENSITIVE = 1e-7


@array_dataclass()
class Slopes:
    """Residuals of an objective at `theta`, (n_residuals,), and derivatives by what varies, (n_free, n_residuals).

    Covariance, identifiability and the noise of the motion follow from them.
    """

    objective: Objective
    form: Form
    theta: Floats
    residuals: Floats
    by_free: Floats

    @classmethod
    def at(cls, objective: Objective, form: Form, theta: Floats) -> Slopes:
        """Simulate the tests once with derivatives; they give the residuals where no parameter is free."""
        (residuals,), (by_free,) = linearise_residuals(objective, theta[None], form.box.free)
        return cls(objective=objective, form=form, theta=theta, residuals=residuals, by_free=by_free)

    @property
    def interior(self) -> list[int]:
        """Parameters of the form that are free and not on a bound."""
        return [
            index
            for index in self.form.box.free
            if state_of(self.form, index, float(self.theta[index])) == ""
        ]

    @property
    def n_effective(self) -> float:
        """Effective number of samples of all tests."""
        return effective_samples(residuals_by_test(self.residuals, self.objective.tests))

    @property
    def dof(self) -> float:
        """Effective samples less the share that the free parameters take."""
        return self.n_effective * max(1.0 - len(self.by_free) / self.residuals.size, 0.0)

    def normal(self) -> NormalEquations:
        """Normal equations of one row in the free parameters; the shares of the tests are in them."""
        counts = [test.n_counted for test in self.objective.tests]
        return NormalEquations.of_parts(
            self.residuals, self.by_free, np.repeat(np.arange(len(counts)), counts)
        )

    def by_interior(self) -> Floats:
        """Derivatives by the parameters that are not on a bound, shape (n_interior, n_residuals)."""
        return self.by_free[np.isin(self.form.box.free, self.interior)]

    def by_model(self) -> Floats:
        """Derivatives by the requested model's parameters, (n_residuals, n_params); zero where the form is fixed."""
        mapped = self.form.from_model.jacobian(np.asarray(self.form.to_model(self.theta)))
        return np.asarray(self.by_free.T @ mapped[list(self.form.box.free)])


@array_dataclass()
class Covariance:
    """Covariance of the parameters of the requested model for `n_effective` samples, and the slopes it follows from.

    `matrix`, (n_params, n_params), has zeros for parameters that do not vary and NaN for those that the residuals do
    not determine. The covariance for independent residuals is multiplied by `n_residuals/n_effective`. A parameter on
    its bound counts as known.
    """

    slopes: Slopes
    matrix: Floats
    n_effective: float

    @classmethod
    def of(cls, slopes: Slopes) -> Covariance:
        """The covariance at a minimum, by its `slopes`; zero for parameters that are held or on a bound."""
        residuals, interior, n_params = slopes.residuals, slopes.interior, len(slopes.theta)
        n_effective = slopes.n_effective
        cov = np.zeros((n_params, n_params))
        if interior:
            independent = covariance(slopes.by_interior().T, float(np.linalg.norm(residuals)))
            cov[np.ix_(interior, interior)] = independent * (residuals.size / n_effective)
        return cls(
            slopes=slopes,
            matrix=covariance_through(slopes.form.to_model.jacobian(slopes.theta), cov),
            n_effective=n_effective,
        )

    @property
    def standard_errors(self) -> Floats:
        """Standard errors, shape (n_params,): 0 for what does not vary, NaN for what is undetermined."""
        return np.asarray(np.sqrt(np.diag(self.matrix)))


def covariance(jacobian: Floats, misfit: float) -> Floats:
    """Covariance for independent residuals, shape (n_params, n_params); NaN where columns are not identifiable.

    `cov = s^2 (J'J)^-1` with `s^2 = misfit^2 / (n_residuals - n_params)`, for the Jacobian of residuals whose sum
    of squares is the squared misfit. Parameters that take part in a combination to which the residuals are insensitive
    have NaN in their rows and columns.
    """
    n_residuals, n_params = jacobian.shape
    result = np.full((n_params, n_params), np.nan)
    norm = np.linalg.norm(jacobian, axis=0)
    sensitive = np.flatnonzero(norm > 0.0)
    if sensitive.size == 0 or n_residuals <= n_params or not np.all(np.isfinite(jacobian)):
        return result
    _, singular, right = np.linalg.svd(jacobian[:, sensitive] / norm[sensitive], full_matrices=False)
    determined = singular > INSENSITIVE * singular[0]
    variance = misfit**2 / (n_residuals - n_params)
    root = right[determined].T / singular[determined] / norm[sensitive, None]
    block = variance * root @ root.T
    undetermined = np.sum(right[~determined] ** 2, axis=0) > INSENSITIVE
    block[undetermined, :] = np.nan
    block[:, undetermined] = np.nan
    result[np.ix_(sensitive, sensitive)] = block
    return result


def covariance_through(map_jacobian: Floats, cov: Floats) -> Floats:
    """Covariance of mapped parameters, (n_mapped, n_mapped), by the delta method; NaN goes no further than it must."""
    used = [np.flatnonzero(row) for row in map_jacobian]
    return np.array(
        [
            [
                row[here] @ cov[np.ix_(here, there)] @ other[there]
                for other, there in zip(map_jacobian, used, strict=True)
            ]
            for row, here in zip(map_jacobian, used, strict=True)
        ]
    )


def autocorrelation_time(residual: ArrayLike) -> float:
    """Integrated autocorrelation time of a series, shape (n_time,), in samples; 1 for independent samples.

    `tau = 1 + 2 sum_k rho_k` over the initial monotone sequence: pairs `rho_2m + rho_2m+1`, each no larger than those
    before it, until the first that is not positive (Geyer, Statistical Science 7, 1992, 473-483). The correlation is
    about zero, not about the mean, because the mean residual is model error. Alternating samples count as
    independent, not as more.

    The sum for a residual that repeats with the excitation ends at its first change of sign, so that repeated cycles
    count as independent: the time is a lower limit there.
    """
    series = np.asarray(residual, dtype=np.float64)
    n_time = series.size
    # Zero-padded, so that the correlation is not circular.
    spectrum = np.fft.rfft(series, 2 * n_time)
    covariance = np.fft.irfft(np.abs(spectrum) ** 2, 2 * n_time)[:n_time]
    if covariance[0] == 0.0:
        return 1.0
    rho = covariance / covariance[0]
    pairs = rho[: n_time - n_time % 2].reshape(-1, 2).sum(axis=1)
    negative = np.flatnonzero(pairs <= 0.0)
    positive = pairs[: negative[0]] if negative.size else pairs
    return max(2.0 * float(np.minimum.accumulate(positive).sum()) - 1.0, 1.0)


def effective_samples(residuals: Iterable[ArrayLike]) -> float:
    """Effective number of samples of all tests, from the residuals of each, shape (n_counted,)."""
    return float(sum(np.size(residual) / autocorrelation_time(residual) for residual in residuals))


def residuals_by_test(residuals: Floats, tests: Sequence[DamperTest]) -> tuple[Floats, ...]:
    """Residuals of an objective, shape (..., n_residuals), divided by tests, shape (..., n_counted) each."""
    ends = np.cumsum([test.n_counted for test in tests])
    return tuple(np.split(residuals, ends[:-1], axis=-1))


def states_of(form: Form, theta: Floats) -> tuple[ParameterState, ...]:
    """State of each parameter of the requested model that does not vary; empty for the others.

    Such a parameter depends only on parameters of the form, `theta`, (n_params,), that are fixed or on a bound.
    """
    texts = [state_of(form, index, float(value)) for index, value in enumerate(theta)]
    states: list[ParameterState] = []
    for row in form.to_model.jacobian(theta):
        used = {texts[index] for index in np.flatnonzero(row)}
        on_bound = sorted(used - {"", "fixed"})
        states.append("" if "" in used else on_bound[0] if on_bound else "fixed")
    return tuple(states)


def state_of(form: Form, index: int, value: float) -> ParameterState:
    """State of a parameter of the form, or of an effect after them, that is fixed or on a bound; empty for others.

    The range of an effect is of all rigs, and a mass of 0.1 kg on a light one no bound: an effect is on the bound that
    it has reached.
    """
    if index not in form.box.free:
        return "fixed"
    states: dict[str, ParameterState] = {"": "", "lower": "at lower bound", "upper": "at upper bound"}
    return states[bound_at(form.box, index, value, ON_BOUND if index < len(form.spec.names) else 0.0)]
