"""Search of current laws: laws one degree up or down from the best, fitted to all tests and without each fold.

All these fits run at once: every row of a batch has its own selection of the tests. The tests are simulated once for
all rows, and the normal equations of each test are kept apart, so that those of a selection are sums over its tests.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

import numpy as np

from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.parameters import LawName, law_named, polynomial_laws
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.equivalent import identifiable_form, joint_box, with_other_laws
from mrwork.identification.fit import Fit
from mrwork.identification.minimise.level_search import (
    PER_CYCLE,
    command_is_constant,
    levels_of,
    spec_by_values,
)
from mrwork.identification.minimise.levenberg_marquardt import within_stiffness
from mrwork.identification.objective import shares_of
from mrwork.identification.progress import interruptible, on_every_test
from mrwork.identification.residual import ObservedTest
from mrwork.identification.settings import FitSettings, Start
from mrwork.records import DamperTest
from mrwork.records.repairs import NONE
from mrwork.records.window import middle_excerpt
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal
from mrwork.uncertainty.bands.prediction import Fold, folds_of
from mrwork.uncertainty.choice.law_table import TriedLaws
from mrwork.uncertainty.choice.ranking import is_as_good

# Convergence: relative decrease of the squared misfit in an iteration; largest number of iterations.
_TOLERANCE = 1e-5
_ITERATIONS = 30
# Factors on the present damping that are tried together; the first damping; above the last one a row has converged.
_DAMPING_FACTORS = (0.1, 1.0, 10.0)
_FIRST_DAMPING = 0.01
_MOST_DAMPING = 1e6
# Floor of the sensitivity of a parameter, relative to the largest one.
_LEAST_SENSITIVITY = 1e-7


@array_dataclass()
class NormalEquations:
    """Squared NRMSE (n_rows, n_tests), half its latent gradient (..., n_free), and J'J (..., n_free, n_free).

    Of a test that a row leaves out the squared NRMSE is infinite and the rest zero.
    """

    squared: Floats
    gradient: Floats
    matrix: Floats


@array_dataclass()
class FoldedFit:
    """Parameters of each row, shape (n_rows, n_params), and its squared NRMSE of each test, (n_rows, n_tests).

    That of a test that the row leaves out is infinite.
    """

    theta: Floats
    squared: Floats


@array_dataclass()
class FoldedTests:
    """Tests, and their shares in the mean squared NRMSE of each row, shape (n_rows, n_tests): 0 for a test left out."""

    observed: tuple[ObservedTest, ...]
    shares: Floats
    threads: int = 0

    @classmethod
    def of(
        cls,
        spec: DamperSpec,
        tests: Sequence[DamperTest],
        folds: Sequence[Sequence[int]],
        settings: FitSettings | None = None,
        *,
        threads: int = 0,
    ) -> FoldedTests:
        """Row 0 has all tests, row k all but those with the indices of fold k - 1."""
        settings = settings or FitSettings()
        observed = tuple(ObservedTest.of(spec, test, settings.nuisances) for test in tests)
        shares = shares_of(observed, settings)
        included = np.tile(shares, (1 + len(folds), 1))
        for row, members in enumerate(folds, start=1):
            included[row, list(members)] = 0.0
        return cls(
            observed=observed,
            shares=included / included.sum(axis=1, keepdims=True),
            threads=threads,
        )

    def squared_nrmse(self, spec: DamperSpec, theta: Floats, shares: Floats) -> Floats:
        """Squared NRMSE of each test, shape (n_batch, n_tests), as `shares`.

        It is infinite where a simulation failed, and where the share is 0: such a test is not simulated.
        """
        squared = np.full((len(theta), len(self.observed)), np.inf)

        def fill(index: int, threads: int) -> None:
            rows = np.flatnonzero(shares[:, index])
            if not rows.size:
                return
            each = replace(self.observed[index], spec=spec)
            residuals, failed = each.residuals(theta[rows], threads=threads)
            own = np.einsum("bt,bt->b", residuals, residuals) * each.weight(1) ** 2
            squared[rows, index] = np.where(failed, np.inf, own)

        on_every_test(len(self.observed), self.threads, fill)
        return squared

    def linearise(self, spec: DamperSpec, box: Box, latent: Floats, shares: Floats) -> NormalEquations:
        """Normal equations of each test at latent coordinates, shape (n_batch, n_free).

        A test whose share in a row, shape (n_batch, n_tests), is 0 is not simulated.
        """
        n_batch, n_free = latent.shape
        theta = np.asarray(box.theta_from_latent(latent))
        slope = np.exp(box.log_slope(latent))
        squared = np.full((n_batch, len(self.observed)), np.inf)
        gradient = np.zeros((n_batch, len(self.observed), n_free))
        matrix = np.zeros((n_batch, len(self.observed), n_free, n_free))

        def fill(index: int, threads: int) -> None:
            rows = np.flatnonzero(shares[:, index])
            if not rows.size:
                return
            each = replace(self.observed[index], spec=spec)
            residuals, jacobian, failed = each.linearise_residuals(theta[rows], box.free, threads=threads)
            residuals *= each.weight(1)
            jacobian *= each.weight(1) * slope[rows][..., None]
            own = np.einsum("bt,bt->b", residuals, residuals)
            squared[rows, index] = np.where(failed, np.inf, own)
            gradient[rows, index] = np.einsum("bpt,bt->bp", jacobian, residuals)
            matrix[rows, index] = jacobian @ jacobian.transpose(0, 2, 1)

        on_every_test(len(self.observed), self.threads, fill)
        return NormalEquations(squared=squared, gradient=gradient, matrix=matrix)

    def misfit(self, squared: Floats, shares: Floats) -> Floats:
        """Squared misfit of each row, shape (n_batch,); a test that is left out may have failed."""
        return np.asarray(np.sum(shares * np.where(shares > 0.0, squared, 0.0), axis=1))

    def fit(self, spec: DamperSpec, box: Box, starts: Floats) -> FoldedFit:
        """Minimise the misfit of each row from its start, shape (n_rows, n_params), by Levenberg-Marquardt.

        Damping is relative to the sensitivity of each parameter, the largest so far (Moré, Lecture Notes in
        Mathematics 630, 1978, 105-116). The result of a row depends on its own tests and start only.
        """
        latent = np.asarray(box.latent_from_theta(box.inside(starts)))
        n_rows, n_free = latent.shape
        squared = self.squared_nrmse(spec, np.asarray(box.theta_from_latent(latent)), self.shares)
        misfit = self.misfit(squared, self.shares)
        damping = np.full(n_rows, _FIRST_DAMPING)
        sensitivity = np.zeros((n_rows, n_free))
        normal, gradient = np.zeros((n_rows, n_free, n_free)), np.zeros((n_rows, n_free))
        moved = np.ones(n_rows, dtype=np.bool_)
        running = np.isfinite(misfit)
        diagonal = np.arange(n_free)
        tests = [replace(each, spec=spec) for each in self.observed]
        for _ in range(_ITERATIONS):
            rows = np.flatnonzero(running)
            if not rows.size:
                break
            # A row that has not moved since has the same normal equations.
            fresh = np.flatnonzero(running & moved)
            here = self.linearise(spec, box, latent[fresh], self.shares[fresh])
            normal[fresh] = np.einsum("rt,rtpq->rpq", self.shares[fresh], here.matrix)
            gradient[fresh] = np.einsum("rt,rtp->rp", self.shares[fresh], here.gradient)
            sensitivity[fresh] = np.maximum(sensitivity[fresh], np.sqrt(normal[fresh][:, diagonal, diagonal]))
            floor = _LEAST_SENSITIVITY * sensitivity[rows].max(axis=1, keepdims=True)
            weight = np.maximum(sensitivity[rows], np.maximum(floor, np.finfo(float).tiny)) ** 2
            # (row, factor, free, free)
            dampings = damping[rows, None] * np.array(_DAMPING_FACTORS)
            damped = normal[rows, None] + dampings[..., None, None] * (
                weight[:, None, :, None] * np.eye(n_free)
            )
            step = -np.linalg.solve(damped, gradient[rows, None, :, None])[..., 0]
            step = within_stiffness(tests, box, latent[rows], step, damped, gradient[rows])
            tried = latent[rows, None] + step
            shares = np.repeat(self.shares[rows], len(_DAMPING_FACTORS), axis=0)
            candidates = np.asarray(box.theta_from_latent(tried.reshape(-1, n_free)))
            errors = self.squared_nrmse(spec, candidates, shares)
            after = self.misfit(errors, shares).reshape(rows.size, -1)
            best = np.argmin(after, axis=1)
            each = np.arange(rows.size)
            better = after[each, best] < misfit[rows]
            decrease = 1.0 - after[each, best] / misfit[rows]
            moved[rows] = better
            accepted = rows[better]
            latent[accepted] = tried[each, best][better]
            squared[accepted] = errors.reshape(*after.shape, -1)[each, best][better]
            misfit[accepted] = after[each, best][better]
            factor = np.where(better, np.array(_DAMPING_FACTORS)[best] / 3.0, 100.0)
            damping[rows] = np.maximum(damping[rows] * factor, 1e-12)
            running[rows] = np.where(better, decrease > _TOLERANCE, damping[rows] < _MOST_DAMPING)
        return FoldedFit(theta=np.asarray(box.theta_from_latent(latent)), squared=squared)


T = TypeVar("T")
Laws = dict[str, LawName]

# Degree of the first laws.
_FIRST_DEGREE = 2
# Higher degrees are tried where the best of them promises at least this [points] of the fit to all tests.
_WORTH_TRYING = 0.02
# Simpler and richer laws are tried until so many in a row were not as good as the best.
_SIMPLER = 3
# Largest number of sets of laws that are fitted.
_MOST_TRIED = 40
# Damping of the steps of the linearised fits, relative to the sensitivity of each parameter.
_DAMPING = 1e-3
# Step in latent coordinates by which the subspace of a move is found.
_SMALL = 1e-4
# NRMSE of a prediction by the mean force: that of a test that cannot be predicted.
_NOT_PREDICTED = 1.0
# Forces are the same up to this NRMSE in each test; their misfits then agree at least to this share.
_SAME_FORCE = 1e-6
_SAME_MISFIT = 1e-3
# Number of motions from which on a motion is left out, and not a test.
_MOTIONS = 3


@array_dataclass()
class _Promise:
    """Fits to all tests that the linearised fit promises for each move [%], in the order of the moves."""

    fit_percent: Floats


@array_dataclass()
class _Predictions:
    """NRMSE of each whole test by the fit without its fold, shape (n_tests,); infinite where not simulated."""

    nrmse: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedLaws:
    """A set of laws with its fits to all tests and without each fold, and its row of the table."""

    spec: DamperSpec
    box: Box
    laws: Laws
    fit: FoldedFit
    tried: TriedLaws

    @property
    def score(self) -> float:
        """Mean over the folds of the NRMSE of tests left out."""
        return float(np.mean(self.tried.left_out))


@dataclass(slots=True, kw_only=True)
class LawSearch:
    """Search of the laws of the parameters `free`, of degree `most` at most, by predictions of the `whole` records."""

    plain: DamperSpec
    tests: tuple[DamperTest, ...]
    whole: tuple[ObservedTest, ...]
    commands: Floats
    folds: list[list[int]]
    folded: FoldedTests
    settings: FitSettings
    unit: CommandUnit
    given: Laws
    free: tuple[str, ...]
    most: int
    leave_out: Fold
    journal: Journal | None = None
    report: Callable[[str], None] = lambda task: None
    fitted: list[FittedLaws] = field(default_factory=list)

    @property
    def name(self) -> str:
        """Name of the model."""
        return self.plain.name

    @property
    def excerpt_settings(self) -> FitSettings:
        """Settings for the excerpts, which have the observation models of their whole records."""
        return replace(self.settings, observe=(NONE,))

    @property
    def first_laws(self) -> Laws:
        """Every positive parameter of `_FIRST_DEGREE`: such laws nearly pass through the fits at single commands."""
        law = polynomial_laws()[min(_FIRST_DEGREE, self.most)]
        return {
            each.name: law for each in self.plain.parameters if each.name in self.free and each.scale == "log"
        }

    def run(self, first: Fit) -> None:
        """Try laws from the first ones on, whose fit is `first`: simpler ones, then richer ones than the best."""
        starts = np.repeat(np.array(first.theta)[None], 1 + len(self.folds), axis=0)
        self._simplify(self._fit_laws(self.first_laws, starts))
        self._enrich()

    def distinct(self) -> list[FittedLaws]:
        """The candidates except those with the same force as a candidate with fewer parameters."""
        kept = list[FittedLaws]()
        for each in sorted(self.fitted, key=lambda each: each.tried.n_params):
            if not any(self._is_same_force(each, other) for other in kept):
                kept.append(each)
        return kept

    def _is_same_force(self, one: FittedLaws, other: FittedLaws) -> bool:
        if not np.allclose(one.fit.squared[0], other.fit.squared[0], rtol=_SAME_MISFIT):
            return False
        for observed in self.folded.observed:
            (first,), _ = replace(observed, spec=one.spec).residuals(one.fit.theta[:1])
            (second,), _ = replace(observed, spec=other.spec).residuals(other.fit.theta[:1])
            if np.linalg.norm(first - second) * observed.weight(1) > _SAME_FORCE:
                return False
        return True

    def make_start(self, tried: TriedLaws) -> tuple[FittedLaws, Start]:
        """The candidate of these laws, and the start that its fit to all tests is."""
        candidate = next(each for each in self.fitted if each.tried.laws == tried.laws)
        return candidate, dict(zip(candidate.spec.names, candidate.fit.theta[0].tolist(), strict=True))

    def _simplify(self, current: FittedLaws) -> None:
        """Lower degrees one by one while the laws stay as good as the best, the least loss of fit first."""
        worse = 0
        while worse < _SIMPLER and len(self.fitted) < _MOST_TRIED:
            best = min(self.fitted, key=lambda each: each.score)
            moves = self._moves(current, -1)
            if not moves:
                return
            candidate = self._move_to(current, moves[0][1])
            if is_as_good(candidate.tried.left_out, best.tried.left_out):
                current, worse = candidate, 0
            else:
                worse += 1

    def _enrich(self) -> None:
        """Raise degrees of the best laws one by one, the one that promises most first, while predictions improve."""
        worse = 0
        while worse < _SIMPLER and len(self.fitted) < _MOST_TRIED:
            best = min(self.fitted, key=lambda each: each.score)
            moves = self._moves(best, 1)
            if not moves or moves[0][0] < best.tried.fit_percent + _WORTH_TRYING:
                return
            worse = 0 if self._move_to(best, moves[0][1]).score < best.score else worse + 1

    def _moves(self, current: FittedLaws, change: int) -> list[tuple[float, Laws]]:
        """Laws not tried yet of which one differs by a degree, the best promise of the linearised fit [%] first."""
        done = [each.laws for each in self.fitted]
        moves = [
            (name, degree)
            for name in self.free
            if 0 <= (degree := _degree(current.laws, name) + change) <= self.most
            and _with_degree(current.laws, name, degree) not in done
        ]
        if not moves:
            return []
        promise = self._once(
            "promise", _Promise, lambda: self._evaluate_moves(current, moves), current.fit.theta[:1], moves
        )
        promised = [
            (float(fit_percent), _with_degree(current.laws, name, degree))
            for (name, degree), fit_percent in zip(moves, promise.fit_percent, strict=True)
        ]
        return sorted(promised, key=lambda move: -move[0])

    def _evaluate_moves(self, current: FittedLaws, moves: Sequence[tuple[str, int]]) -> _Promise:
        """All tests are linearised once, with every law as high as any move makes it; a move spans a subspace there."""
        higher = dict(current.laws)
        for name, degree in moves:
            higher = _with_degree(higher, name, max(degree, _degree(higher, name)))
        spec, box = self.model(higher)
        latent = np.asarray(box.latent_from_theta(self._transfer_starts(current, spec, box)[:1]))
        here = self.folded.linearise(spec, box, latent, self.folded.shares[:1])
        gradient = np.einsum("t,tp->p", self.folded.shares[0], here.gradient[0])
        matrix = np.einsum("t,tpq->pq", self.folded.shares[0], here.matrix[0])
        squared = float(self.folded.misfit(here.squared, self.folded.shares[:1])[0])
        promised = []
        for name, degree in moves:
            move_spec, move_box = self.model(_with_degree(current.laws, name, degree))
            start = np.asarray(
                move_box.latent_from_theta(self._transfer_starts(current, move_spec, move_box)[:1])
            )

            def lift_rows(
                rows: Floats, move_spec: DamperSpec = move_spec, move_box: Box = move_box
            ) -> Floats:
                theta = np.asarray(move_box.theta_from_latent(rows))
                inside = [with_other_laws(move_spec, row, spec, self.commands) for row in theta]
                return np.asarray(box.latent_from_theta(box.inside(np.clip(inside, box.lower, box.upper))))

            moved = lift_rows(np.concatenate([start, start + _SMALL * np.eye(start.shape[1])]))
            away, along = moved[0] - latent[0], (moved[1:] - moved[0]).T / _SMALL
            step = away + along @ _best_step(along.T @ matrix @ along, along.T @ (gradient + matrix @ away))
            after = squared + 2.0 * float(gradient @ step) + float(step @ matrix @ step)
            promised.append(100.0 * (1.0 - np.sqrt(max(after, 0.0))))
        return _Promise(fit_percent=np.array(promised))

    def _move_to(self, current: FittedLaws, laws: Laws) -> FittedLaws:
        spec, box = self.model(laws)
        return self._fit_laws(laws, self._transfer_starts(current, spec, box))

    def _fit_laws(self, laws: Laws, starts: Floats) -> FittedLaws:
        spec, box = self.model(laws)
        self.report(
            f"fitting {', '.join(f'{name} {law}' for name, law in laws.items()) or 'constant parameters'}"
        )
        fit = self._once(
            "laws", FoldedFit, lambda: interruptible(lambda: self._fit(spec, box, starts)), box, starts
        )
        predicted = self._once(
            "predictions",
            _Predictions,
            lambda: interruptible(lambda: self._predict_left_out(spec, fit.theta)),
            box,
            fit.theta,
        ).nrmse
        tried = TriedLaws.of(
            self.given | laws,
            n_params=len(box.free),
            fit_percent=100.0 * (1.0 - min(float(np.sqrt(np.mean(fit.squared[0]))), _NOT_PREDICTED)),
            left_out=[np.minimum(predicted[members], _NOT_PREDICTED) for members in self.folds],
            not_predicted=[
                self.tests[index].name
                for members in self.folds
                for index in members
                if not np.isfinite(predicted[index])
            ],
        )
        self.fitted.append(FittedLaws(spec=spec, box=box, laws=laws, fit=fit, tried=tried))
        return self.fitted[-1]

    def _fit(self, spec: DamperSpec, box: Box, starts: Floats) -> FoldedFit:
        """Fit every row; rows that no simulation could start from begin at the best of the others."""
        fit = self.folded.fit(spec, box, starts)
        misfit = self.folded.misfit(fit.squared, self.folded.shares)
        failed = ~np.isfinite(misfit)
        if not failed.any() or failed.all():
            return fit
        return self.folded.fit(spec, box, np.where(failed[:, None], fit.theta[np.argmin(misfit)], fit.theta))

    def _predict_left_out(self, spec: DamperSpec, theta: Floats) -> _Predictions:
        """Predict each whole test by the fit without its fold, a row of `theta`, shape (1 + n_folds, n_params)."""
        row_of = {index: row for row, members in enumerate(self.folds, start=1) for index in members}
        nrmse = np.empty(len(self.whole))

        def fill(index: int, threads: int) -> None:
            each = replace(self.whole[index], spec=spec)
            residuals, failed = each.residuals(theta[[row_of[index]]], threads=threads)
            nrmse[index] = np.inf if failed.any() else np.linalg.norm(residuals[0]) * each.weight(1)

        on_every_test(len(self.whole), self.folded.threads, fill)
        return _Predictions(nrmse=nrmse)

    def model(self, laws: Laws) -> tuple[DamperSpec, Box]:
        """The model with laws by values, as many as polynomials of these degrees have coefficients."""
        spec = spec_by_values(self.plain.with_current_laws(self.given | laws, unit=self.unit), self.commands)
        return spec, joint_box(identifiable_form(spec, self.settings.bounds), self.tests, self.commands)

    def _transfer_starts(self, current: FittedLaws, spec: DamperSpec, box: Box) -> Floats:
        """Parameters of each row of the present laws as a start of other laws, on the curves of the present ones."""
        rows = [with_other_laws(current.spec, theta, spec, self.commands) for theta in current.fit.theta]
        return np.asarray(box.inside(np.clip(rows, box.lower, box.upper)))

    def _once(self, step: str, kind: type[T], compute: Callable[[], T], *inputs: object) -> T:
        if self.journal is None:
            return compute()
        return self.journal.once(step, digest_of(*inputs), kind, compute)


def _best_step(matrix: Floats, gradient: Floats) -> Floats:
    """Damped least-squares step, shape (n_free,), for the normal matrix and half the gradient of the misfit."""
    scale = np.sqrt(np.maximum(np.diag(matrix), np.finfo(float).tiny))
    scaled = matrix / scale[:, None] / scale + _DAMPING * np.eye(len(scale))
    return np.asarray(-np.linalg.solve(scaled, gradient / scale) / scale)


def _degree(laws: Laws, name: str) -> int:
    degree = law_named(laws.get(name, polynomial_laws()[0])).degree
    assert degree is not None  # laws that are chosen are polynomials
    return degree


def _with_degree(laws: Laws, name: str, degree: int) -> Laws:
    """The laws with one of another degree; constant ones are not listed."""
    changed = laws | {name: polynomial_laws()[degree]}
    return {each: law for each, law in sorted(changed.items()) if law != polynomial_laws()[0]}


def prepare_search(
    plain: DamperSpec,
    tests: tuple[DamperTest, ...],
    given: Laws,
    unit: CommandUnit,
    leave_out: Fold | None,
    settings: FitSettings,
    threads: int,
) -> LawSearch:
    """Check the settings and prepare the folds."""
    if plain.current is not None:
        raise SettingError(f"{plain.name} has current laws already; give the plain model to choose laws for")
    if settings.starts or settings.power != 2.0 or settings.engine != "lanes":
        raise SettingError(
            "the choice of laws takes no starts, the power 2 and the engine `lanes`; leave these settings out"
        )
    unknown = [name for name in settings.bounds if name not in plain.names]
    if unknown:
        raise SettingError(
            f"bounds are given for {unknown[0]!r}; where laws are chosen, give them for parameters of {plain.name} "
            f"({', '.join(plain.names)}), which then remain constant"
        )
    if len(tests) < 2:
        raise SettingError(
            "laws are chosen by tests left out of their fits, and one test was given; give more"
        )
    spec = plain.with_current_laws(given, unit=unit)
    varying = [test.name for test in tests if not command_is_constant(test, spec)]
    if varying:
        raise SettingError(
            f"laws are chosen from tests at constant commands, and that of {varying[0]} varies; leave such tests out, "
            "or give the laws"
        )
    if leave_out is None:
        motions = _count(tests, "motion")
        leave_out = "motion" if motions >= _MOTIONS else "test"
    folds = folds_of(tests, leave_out)
    short = tuple(middle_excerpt(test, per_cycle=PER_CYCLE) for test in tests)
    levels = levels_of(spec, short)
    n_levels = min(
        len(levels_of(spec, tuple(test for index, test in enumerate(short) if index not in members)))
        for members in [[], *folds]
    )
    most = min(len(polynomial_laws()), n_levels) - 1
    if most < 1:
        raise SettingError(
            f"the tests run at {len(levels)} command(s), {n_levels} without those left out; laws are chosen from tests "
            "at two or more"
        )
    return LawSearch(
        plain=plain,
        tests=short,
        whole=tuple(ObservedTest.of(spec, test, settings.nuisances) for test in tests),
        commands=np.array(sorted(levels)),
        leave_out=leave_out,
        folds=folds,
        folded=FoldedTests.of(spec, short, folds, settings, threads=threads),
        settings=settings,
        unit=unit,
        given=given,
        free=tuple(name for name in plain.names if name not in {**given, **settings.bounds}),
        most=most,
    )


def _count(tests: tuple[DamperTest, ...], fold: Fold) -> int:
    try:
        return len(folds_of(tests, fold))
    except SettingError:
        return 1
