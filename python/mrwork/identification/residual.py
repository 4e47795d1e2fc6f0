"""Residuals of a model on one test: simulation, observation model, effects of each test, weight, loss.

Misfits, local minimisations, likelihoods and predictions all use them. Effects of each test are the delay, gain and
offset of its force channel. By a loss, outliers count less than their squares: with z = (r/scale)^2 the sum of
squares `sum r^2` becomes `scale^2 sum rho(z)`, as in `scipy.optimize.least_squares`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork import _rust
from mrwork.base.arguments import AnyArray, replace_unchecked, unchecked
from mrwork.base.hints import SMALLEST
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.parameters import MOST_SUBSTEPS
from mrwork.dampers.simulation import (
    Outcome,
    refuse_failure,
    simulate_forces,
    simulate_sensitivities,
    stiffness_shares,
)
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import RecordError, SettingError
from mrwork.identification.ties import Ties
from mrwork.records import DamperTest
from mrwork.records.contradictions import refuse_velocity
from mrwork.records.damper_test import loading_of
from mrwork.records.observation import (
    AS_IT_IS,
    EACH,
    EFFECTS,
    WEIGH,
    Effect,
    Observation,
    Observing,
)

_stiffness_shares = unchecked(stiffness_shares)
_simulate_forces, _simulate_sensitivities = unchecked(simulate_forces), unchecked(simulate_sensitivities)
_observe_unchecked = unchecked(Observation.observe)

_OFFSET = EFFECTS["offset"]
_UNESTIMATED = RemarkKind(
    "effects_not_estimated",
    "the fit estimated the {0} for each test{held}, and this prediction does not, so it is worse by what they change",
    "{options}, as in the fit, estimates them from the measured force of each test",
)


def estimated_in_words(effects: Sequence[Effect]) -> str:
    """What is estimated from the measured force of each test."""
    return " and ".join(f"{effect.name} of the force" for effect in effects)


def unestimated_effects(fitted: Observing, used: Observing) -> Iterator[Remark]:
    """Warn where the fit estimated effects of each test that a prediction, observed otherwise, does not."""
    missing = [effect for effect in fitted.of_each if effect not in used.of_each]
    if missing:
        held = ", and its model has no offset of its own" if _OFFSET in missing else ""
        options = " ".join(f"--observe {effect.name}={EACH}" for effect in missing)
        yield _UNESTIMATED.remark(estimated_in_words(missing), held=held, options=options)


def refuse_free(observing: Observing, who: str) -> None:
    """Refuse to leave an effect to a fit, where there is none."""
    if left := WEIGH if observing.weighs else next((effect.name for effect in observing.free), ""):
        raise SettingError(
            f"{who} fits no effect that tests have in common, and --observe leaves {left} to a fit; give its value"
        )


def without_effects(force: AnyArray, measured: AnyArray, each: Sequence[Effect]) -> Any:
    """Residuals [N] of `force`, shape (n_batch, n_time), with the effects of each test at their least-squares values.

    The residuals are linear in these effects (in the delay to first order), so their values have a closed form. The
    arrays are of NumPy or of JAX.
    """
    residuals = force - measured
    if each:
        coefficients, columns = _best(force, residuals, each)
        residuals = residuals - force.__array_namespace__().einsum("kb,kbt->bt", coefficients, columns)
    return residuals


def linearised_without_effects(
    force: Floats, slope: Floats, measured: Floats, each: Sequence[Effect]
) -> tuple[Floats, Floats]:
    """Residuals as in `without_effects`, and their derivatives, from the force's, shape (n_batch, n_params, n_time).

    Residuals are r = y - C c with c = C^+ y. The columns C, except the offset's, depend on the force, hence

        dr = P (dy - dC c) - (C^+)' dC' r,  P = 1 - C C^+

    (Golub, Pereyra, SIAM J. Numer. Anal. 10, 1973, 413-432).
    """
    residuals = force - measured
    if not each:
        return residuals, slope
    coefficients, columns = _best(force, residuals, each)
    residuals = residuals - np.einsum("kb,kbt->bt", coefficients, columns)
    # The column of the offset depends on nothing.
    change = np.stack(
        [np.zeros_like(slope) if effect is _OFFSET else _column(effect, slope) for effect in each]
    )
    moved = slope - np.einsum("kb,kbpt->bpt", coefficients, change)
    along = np.einsum("kbpt,bt->kbp", change, residuals)
    derivative = np.empty_like(slope)
    for row in range(len(force)):
        row_columns = columns[:, row]
        unit, length = scale_columns(row_columns)
        # Rows of the pseudo-inverse of the scaled columns.
        inverse = np.linalg.pinv(unit @ unit.T) @ unit
        projected = moved[row] - (moved[row] @ inverse.T) @ unit
        derivative[row] = projected - (along[:, row] / length[:, None]).T @ inverse
    return residuals, derivative


def estimated_of(force: Floats, measured: Floats, dt: float, each: Sequence[Effect]) -> Observation:
    """Least-squares effects of a test for one `force` [N], shape (n_time,)."""
    if not each:
        return AS_IT_IS
    coefficients, _ = _best(force[None], (force - measured)[None], each)
    best = dict(zip((effect.name for effect in each), coefficients[:, 0].tolist(), strict=True))
    return Observation(
        delay_seconds=best.get("delay", 0.0) * dt,
        gain=1.0 - best.get("gain", 0.0),
        offset=-best.get("offset", 0.0),
    )


def _best(force: Any, residuals: Any, each: Sequence[Effect]) -> tuple[Any, Any]:
    """Least-squares coefficients, shape (n_effects, n_batch), of the columns, (n_effects, n_batch, n_time)."""
    xp = force.__array_namespace__()
    columns = xp.stack([_column(effect, force) for effect in each])
    unit, length = scale_columns(columns)
    gram = xp.einsum("jbt,kbt->bjk", unit, unit)
    right = xp.einsum("jbt,bt->bj", unit, residuals)
    return (xp.linalg.pinv(gram) @ right[..., None])[..., 0].T / length, columns


def scale_columns(columns: Any) -> tuple[Any, Any]:
    """Columns of unit length, and their lengths, shape (n_effects, ...).

    Without it the normal equations are ill-conditioned: a force of 1e3 N is far larger than its change per sample.
    """
    xp = columns.__array_namespace__()
    # A column without a length, of a force that is nearly zero, has the coefficient zero.
    length = xp.linalg.norm(columns, axis=-1)
    length = xp.where(length < SMALLEST, np.inf, length)
    return columns / length[..., None], length


def _column(effect: Effect, force: Any) -> Any:
    """Derivative of the residuals with respect to an effect of each test, to first order."""
    xp = force.__array_namespace__()
    if effect is _OFFSET:
        return xp.ones_like(force)
    return xp.gradient(force, axis=-1) if effect.of_time else force


LossName = Literal["linear", "soft_l1", "huber", "cauchy", "arctan"]

LossFunction = Callable[[Floats], ArrayLike]
"""Maps z, of any shape, to rho(z) and its derivative, stacked along a first axis; further rows are not used."""


# Arrays of NumPy or JAX.
_LOSSES: dict[str, Callable[[Any, Any], tuple[Any, Any]]] = {
    "soft_l1": lambda z, xp: (2.0 * (xp.sqrt(1.0 + z) - 1.0), 1.0 / xp.sqrt(1.0 + z)),
    "huber": lambda z, xp: (
        xp.where(z <= 1.0, z, 2.0 * xp.sqrt(xp.maximum(z, 1.0)) - 1.0),
        1.0 / xp.sqrt(xp.maximum(z, 1.0)),
    ),
    "cauchy": lambda z, xp: (xp.log1p(z), 1.0 / (1.0 + z)),
    "arctan": lambda z, xp: (xp.arctan(z), 1.0 / (1.0 + z**2)),
}
# Below it rho(z)/z is that at zero, within rounding.
_SMALLEST = 1e-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Loss:
    """A loss rho, by its name or as a function of the user, and the residual [N] from which on it is not the square."""

    rho: LossName | LossFunction
    scale: float

    def transform(self, residuals: Any) -> tuple[Any, Any]:
        """Residuals whose sum of squares is `scale^2 sum rho(z)`, and their derivatives by the residuals given."""
        xp = residuals.__array_namespace__()
        z = (residuals / self.scale) ** 2
        value, slope = self._values(z) if callable(self.rho) else _LOSSES[self.rho](z, xp)
        root = xp.sqrt(xp.maximum(value, 0.0))
        far = z > _SMALLEST
        length = xp.sqrt(xp.where(far, z, 1.0))
        factor = xp.where(far, root / length, 1.0)
        derivative = xp.where(far, slope * length / xp.where(root > 0.0, root, 1.0), 1.0)
        return residuals * factor, derivative

    def _values(self, z: Floats) -> Floats:
        assert callable(self.rho)
        values = np.asarray(self.rho(z), dtype=np.float64)
        if values.ndim != z.ndim + 1 or len(values) < 2 or values.shape[1:] != z.shape:
            raise SettingError(
                f"the loss returned shape {values.shape} for z of shape {z.shape}; return rho(z) and its derivative "
                f"stacked, shape {(2, *z.shape)}"
            )
        if not np.isfinite(values[:2]).all():
            raise SettingError(
                "the loss returned a number that is not finite; return finite rho(z) and derivatives"
            )
        return values[:2]


def loss_of(loss: LossName | LossFunction, scale: float | None) -> Loss | None:
    """The loss of this name, or with this function; `None` for the square."""
    if loss == "linear":
        if scale is not None:
            raise SettingError(
                f"`loss_scale` is {scale:g}, and the linear loss has none; leave it out, or give a `loss`"
            )
        return None
    if scale is None:
        raise SettingError(
            "`loss` wants its `loss_scale` [N], the residual from which on it differs from the square, such as twice "
            "the noise of the force; give it"
        )
    return Loss(rho=loss, scale=scale)


# Step of the difference quotient by a free effect: in samples where it is a time, else in its unit.
_STEP_OF_TIME = 0.1
_STEP_OF_UNIT = 1.0


@array_dataclass()
class ObservedTest:
    """One test that a model is compared with; the splines of its `history` are computed once for all candidates.

    `share` is the factor of its squared NRMSE in the squared misfit of all tests, whose shares add up to 1. Residuals
    are the model's force minus the measured one [N], over the samples that are compared, with the effects of `each`
    test at their least-squares values for each candidate. They are multiplied by the `weights`, shape (n_counted,), and
    then transformed by the `loss`, if any. Candidates have their tied parameters by the `ties`, whatever they had for
    them. Those that want more sub-steps a second than `stiffest` [1/s] are no candidates. The last columns of
    candidates are the values of the `free` effects on the recorded force, and not the ones of the observation.
    `counted` are these samples, `measured` the force there [N], shape (n_counted,), `variance` its variance [N^2], and
    `acceleration` that of the motion [m/s^2], shape (n_time,), where a mass needs it: found once, because every
    simulation needs them.
    """

    spec: DamperSpec
    test: DamperTest
    history: _rust.LoadingHistory
    each: tuple[Effect, ...] = ()
    share: float = 1.0
    weights: Floats | None = None
    loss: Loss | None = None
    ties: Ties | None = None
    stiffest: float = np.inf
    free: tuple[Effect, ...] = ()
    counted: slice | NDArray[np.intp] = field(init=False)
    measured: Floats = field(init=False)
    variance: float = field(init=False)
    acceleration: Floats | None = None

    def __post_init__(self) -> None:
        counted = self.test.counted
        measured = self.test.force[counted]
        object.__setattr__(self, "counted", counted)
        object.__setattr__(self, "measured", measured)
        object.__setattr__(self, "variance", float(np.var(measured)))
        has_mass = self.test.observation.mass != 0.0 or any(effect.field == "mass" for effect in self.free)
        if has_mass and self.acceleration is None:
            object.__setattr__(self, "acceleration", self.test.acceleration)

    def stiffness(self, theta: Floats) -> Floats:
        """Sub-steps that each row of `theta` wants, as a share of the most that it may have, shape (n_batch,)."""
        most = min(self.stiffest * self.test.dt / MOST_SUBSTEPS, 1.0)
        return _stiffness_shares(self.spec, self.tie(theta), self.history) / most

    def steps(self, theta: Floats) -> int:
        """Time steps that a simulation of all rows of `theta` takes; a row that wants too many takes none."""
        shares = _stiffness_shares(self.spec, self.tie(theta), self.history)
        substeps = np.exp2(np.ceil(np.log2(np.maximum(MOST_SUBSTEPS * shares[shares <= 1.0], 1.0))))
        return int(substeps.sum()) * self.test.n_time

    @classmethod
    def of(cls, spec: DamperSpec, test: DamperTest, each: tuple[Effect, ...] = ()) -> ObservedTest:
        """Compute the splines of the test's motion."""
        refuse_velocity(test)
        if test.n_counted == 0:
            raise SettingError(
                f"{test.label}: none of its {test.n_time} samples is compared, `n_settle` is {test.n_settle}"
                f"{f' and the model force {beyond}' if (beyond := test.observation.in_words) else ''}; give less"
            )
        for channel, samples in (("force", test.force[test.counted]), ("displacement", test.displacement)):
            if np.ptp(samples) == 0.0:
                raise RecordError(
                    f"{test.label}: the {channel} is constant, so there is nothing to compare; check the channel"
                )
        return cls(spec=spec, test=test, history=loading_of(test, spec).history(), each=each)

    def of_test(self, test: DamperTest) -> ObservedTest:
        """Another test, compared as this one, with its share."""
        return replace(ObservedTest.of(self.spec, test, self.each), share=self.share)

    @property
    def held_command(self) -> float | None:
        """The constant command of laws; `None` where there are no laws, or it varies."""
        if not self.spec.follows_command or self.ties is not None:
            return None
        command = self.test.command_in(self.spec.command_unit)
        return float(command) if isinstance(command, int | float) else None

    @property
    def is_plain(self) -> bool:
        """Whether the residuals are the differences of force, without weights or a loss."""
        return self.weights is None and self.loss is None

    @property
    def deviation(self) -> float:
        """Standard deviation of the measured force that is compared [N]."""
        return float(np.sqrt(self.variance))

    @property
    def normalisation(self) -> float:
        """Factor on residuals [1/N] with which the sum of their squares over all tests is the squared misfit."""
        return float(np.sqrt(self.share / (self.variance * self.measured.size)))

    def forces(self, theta: Floats, *, threads: int = 0) -> tuple[Floats, NDArray[np.bool_]]:
        """Force of each row of `theta` as recorded [N], shape (n_batch, n_time), and which rows failed.

        For a row that failed, the observation model is applied to a force of zero.
        """
        run = _simulate_forces(self.spec, self.tie(theta), self.history, threads=threads)
        failed = run.outcome != Outcome.FINISHED
        run.force[failed] = 0.0
        return self._observe(run.force, theta), failed

    def residuals(self, theta: Floats, *, threads: int = 0) -> tuple[Floats, NDArray[np.bool_]]:
        """Residuals of each row of `theta` [N], shape (n_batch, n_counted), and which rows failed."""
        force, failed = self.forces(theta, threads=threads)
        residuals = without_effects(force[:, self.counted], self.measured, self.each)
        return residuals if self.is_plain else self._emphasise(residuals)[0], failed

    def linearise_residuals(
        self, theta: Floats, columns: Sequence[int], *, threads: int = 0
    ) -> tuple[Floats, Floats, NDArray[np.bool_]]:
        """Residuals with their exact derivatives, from one simulation of each row, and which rows failed.

        Derivatives with respect to columns of `theta`, shape (n_batch, n_columns, n_counted), zero where a row failed.
        """
        tied = () if self.ties is None else self.ties.indices
        n_own = theta.shape[1] - len(self.free)
        own = [column for column in columns if column < n_own]
        every = [*own, *(tie for tie in tied if tie not in own)]
        run = _simulate_sensitivities(
            self.spec, self.tie(theta), self.history, columns=every, threads=threads
        )
        failed = run.outcome != Outcome.FINISHED
        run.force[failed] = 0.0
        run.jacobian[failed] = 0.0
        counted, force, slope = self.counted, run.force, run.jacobian
        if self.ties is not None:
            chain = self.ties.conversion.jacobian(self._of_model(theta))[:, every][:, :, own]
            chain[failed] = 0.0
            slope = np.einsum("bet,bep->bpt", slope, chain)
        if self.test.observation != AS_IT_IS or self.free:
            force = self._observe(run.force, theta)
            slope = self._observe(slope, theta, is_change=True)
        for column in columns[len(own) :]:
            step = _STEP_OF_TIME * self.test.dt if self.free[column - n_own].of_time else _STEP_OF_UNIT
            further = theta.copy()
            further[:, column] += step
            moved = self._observe(run.force, further) - force
            slope = np.concatenate([slope, moved[:, None] / step], axis=1)
        residuals, derivative = linearised_without_effects(
            force[:, counted], slope[..., counted], self.measured, self.each
        )
        if not self.is_plain:
            residuals, factor = self._emphasise(residuals)
            derivative = derivative * factor[:, None]
        return residuals, derivative, failed

    def tie(self, theta: Floats) -> Floats:
        """Candidates as they are simulated, with their tied parameters."""
        own = self._of_model(theta)
        return own if self.ties is None else self.ties.feasible(own)

    def _of_model(self, theta: Floats) -> Floats:
        return theta[:, : theta.shape[1] - len(self.free)]

    def _observe(self, signal: Floats, theta: Floats, *, is_change: bool = False) -> Floats:
        """Forces of each candidate, or their changes, shape (n_batch, ..., n_time), by the observation model."""
        none = {"mass": 0.0, "offset": 0.0} if is_change else {}
        if not self.free:
            return self._observed(signal, replace(self.test.observation, **none))
        fields, first = [effect.field for effect in self.free], theta.shape[1] - len(self.free)
        rows = [
            self._observed(
                row, replace_unchecked(self.test.observation, **dict(zip(fields, values, strict=True)) | none)
            )
            for row, values in zip(signal, theta[:, first:].tolist(), strict=True)
        ]
        return np.stack(rows)

    def _observed(self, force: Floats, observation: Observation) -> Floats:
        return _observe_unchecked(observation, force, self.test.dt, self.acceleration)

    def _emphasise(self, residuals: Floats) -> tuple[Floats, Floats]:
        """Residuals with weights and loss, and their derivatives by those without, both (n_batch, n_counted)."""
        weights = np.ones(self.measured.size) if self.weights is None else self.weights
        weighted = residuals * weights
        if self.loss is None:
            return weighted, np.broadcast_to(weights, weighted.shape)
        transformed, factor = self.loss.transform(weighted)
        return transformed, factor * weights

    def predict_force(self, theta: Floats, *, substep_factor: int = 1) -> tuple[Floats, Observation, int]:
        """Force of one set of parameters as recorded [N], shape (n_time,), effects of the test, number of sub-steps."""
        run = simulate_forces(self.spec, theta[None], self.history, substep_factor=substep_factor)
        refuse_failure(f"{self.spec.name} on {self.test.name}", run.outcome[0])
        force = self._observed(run.force[0], self.test.observation)
        estimated = estimated_of(force[self.counted], self.measured, self.test.dt, self.each)
        return estimated.observe(force, self.test.dt), estimated, int(run.substeps[0])
