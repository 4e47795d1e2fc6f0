"""Misfit of candidates with respect to the measured tests, simulated in lanes, and residuals with exact derivatives."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import AnyNumbers, Shape, Threads, checked, unchecked
from mrwork.base.hints import SMALLEST
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.simulation import Misfits, simulate_misfits
from mrwork.dampers.spec import DamperSpec, by_parameter
from mrwork.errors import RecordError, SettingError
from mrwork.identification.fit_progress import Tally, on_every_test
from mrwork.identification.residual import ObservedTest
from mrwork.identification.settings import EQUAL_SHARES, FitSettings
from mrwork.identification.ties import Ties
from mrwork.records import DamperTest, Observation
from mrwork.records.observation import AS_IT_IS
from mrwork.store.codec import digest_of
from mrwork.store.journal import Journal

# Sub-steps below which a search begins: of a second [1/s], 4 a sample of 1 ms in a building,
# and of a radian of the motion, 4000 a cycle.
_MOST_A_SECOND = 4000.0
_MOST_A_RADIAN = 640.0
# Number of rows whose residuals are in memory at once where a misfit needs the whole history.
_ROWS = 64

_simulate_misfits = unchecked(simulate_misfits)

T = TypeVar("T")
_Rows = Annotated[AnyNumbers, Shape(("n_batch", "n_params"))]


def friction_limit(tests: Sequence[DamperTest]) -> float:
    """Sub-steps a second [1/s] below which a search begins.

    A loop that wants more yields, or unloads, in some thousandths of the stroke: friction, as far as tests show it.
    """
    radians = max(float(np.ptp(test.velocity)) / float(np.ptp(test.displacement)) for test in tests)
    return min(_MOST_A_SECOND, _MOST_A_RADIAN * radians)


def _observe_tests(
    spec: DamperSpec, tests: Sequence[DamperTest], settings: FitSettings
) -> tuple[ObservedTest, ...]:
    """Tests with observation model and share of the squared misfit.

    With the shares, errors whose standard deviation grows as the force's to the power `force_exponent` have the same
    variance: 1 gives equal shares, 0 minimises the sum of squares in newtons.
    """
    if not tests:
        raise RecordError("no test was given to identify from; name at least one file")
    compared = [ObservedTest.of(spec, test, settings.observing.of_each) for test in tests]
    shares = np.ones(len(compared))
    if settings.force_exponent != EQUAL_SHARES:
        deviations = np.array([test.deviation for test in compared])
        shares = (deviations / np.max(deviations)) ** (2.0 * (EQUAL_SHARES - settings.force_exponent))
    shares /= shares.sum()
    ties = ties_of(spec, settings)
    return tuple(
        replace(test, share=share, ties=ties) for test, share in zip(compared, shares.tolist(), strict=True)
    )


def observe_tests_by(objective: Objective, observations: Sequence[Observation]) -> Objective:
    """The same misfit with these observation models of the tests."""
    compared = [
        replace(test, test=replace(test.test, observation=observation))
        for test, observation in zip(objective.compared, observations, strict=True)
    ]
    return replace(objective, compared=tuple(compared))


def ties_of(spec: DamperSpec, settings: FitSettings) -> Ties | None:
    """The ties of the settings for a model; `None` where there are none."""
    if not settings.ties:
        return None
    return Ties.of(spec, settings.ties, Box.of(spec).with_bounds(settings.bounds))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Objective(Summarised):
    """Free-run misfit of a model against one or several tests.

    The misfit is the root mean square over tests of the NRMSE: all have the same share, independent of length and
    force. A `force_exponent` below 1 gives larger shares to tests of large force. The observation model
    of the test and the effects of each test are applied to the simulated force before the comparison. Of the `settings`
    it has the exponent and these effects. Costly steps are recorded in the `journal`, if any.
    """

    _made_by: ClassVar[str] = "mr.identification.Objective.of(spec, tests)"

    spec: DamperSpec
    compared: tuple[ObservedTest, ...]
    settings: FitSettings = field(default_factory=FitSettings)
    threads: Threads = 0
    tally: Tally = field(default_factory=Tally)
    journal: Journal | None = None

    @classmethod
    @checked
    def of(
        cls,
        spec: DamperSpec,
        tests: tuple[DamperTest, ...],
        settings: FitSettings | None = None,
        *,
        threads: Threads = 0,
        journal: Journal | None = None,
    ) -> Objective:
        """Objective on these tests; the splines of their motions are computed here, once for all candidates."""
        settings = settings or FitSettings()
        return cls(
            spec=spec,
            compared=_observe_tests(spec, tests, settings),
            settings=settings,
            threads=threads,
            journal=journal,
        )

    @checked
    def on(self, spec: DamperSpec, tests: tuple[DamperTest, ...]) -> Objective:
        """The same misfit for another model on other tests, with the same tally and journal."""
        objective = replace(self, spec=spec, compared=_observe_tests(spec, tests, self.settings))
        return up_to(objective, self.stiffest)

    @checked
    def with_laws(self, spec: DamperSpec) -> Objective:
        """The same misfit, on the same motions, for the same model with other laws, or without any."""
        return replace(self, spec=spec, compared=tuple(replace(test, spec=spec) for test in self.compared))

    @property
    def tests(self) -> tuple[DamperTest, ...]:
        """The measured tests, in the order of `compared`, `shares` and the columns of `squared_nrmse`."""
        return tuple(test.test for test in self.compared)

    @property
    def stiffest(self) -> float:
        """Most sub-steps a second of a candidate [1/s]; infinite where the steps of the tests alone limit them."""
        return self.compared[0].stiffest

    @property
    def is_direct(self) -> bool:
        """Whether the simulated force is compared directly, from a sample on.

        There are no observation models, free effects, effects of each test, weights, losses or uncompared spans.
        """
        return not self.settings.observing.of_each and all(
            test.is_plain and not test.free and test.test.observation == AS_IT_IS and not test.test.uncompared
            for test in self.compared
        )

    @property
    def n_time(self) -> int:
        """Number of samples that are compared, of all tests together."""
        return sum(test.measured.size for test in self.compared)

    @checked
    def __call__(
        self, theta: _Rows, shares: Annotated[AnyNumbers, Shape(("n_batch", "n_tests"))] | None = None
    ) -> Floats:
        """Misfit of each row of `theta`, shape (n_batch,); infinite where a simulation failed.

        `shares` are those of the tests for each row, shape (n_batch, n_tests); 0 leaves a test out. By default they
        are the shares of the objective.
        """
        n_tests = len(self.compared)
        if shares is None:
            shares = np.repeat(self.shares[None], len(theta), axis=0)
        elif shares.shape[1] != n_tests:
            raise SettingError(
                f"`shares` have {shares.shape[1]} columns; give one for each of {n_tests} tests"
            )
        has_share = included = shares > 0.0
        if self.stiffest < np.inf:
            below = [test.stiffness(theta) <= 1.0 for test in self.compared]
            included = has_share & np.all(below, axis=0)[:, None]
        squared = self._squared(theta, included)
        total = np.zeros(len(theta))
        # One test after the other: NumPy sums a single column in another order than several.
        for index in range(n_tests):
            total += shares[:, index] * np.where(has_share[:, index], squared[:, index], 0.0)
        return np.asarray(np.sqrt(total))

    @property
    def shares(self) -> Floats:
        """Shares of the tests in the squared misfit, shape (n_tests,): factors of their squared NRMSE, of sum 1."""
        return np.array([test.share for test in self.compared])

    @checked
    def squared_nrmse(self, theta: _Rows, included: NDArray[np.bool_] | None = None) -> Floats:
        """Squared NRMSE of each test, shape (n_batch, n_tests), whatever its share.

        Infinite where a simulation failed, and where the row of `included`, of that shape, leaves the test out.
        """
        if included is None:
            included = np.ones((len(theta), len(self.compared)), dtype=np.bool_)
        return self._squared(theta, included)

    def _squared(self, theta: Floats, included: NDArray[np.bool_]) -> Floats:
        self.tally.simulations += int(np.count_nonzero(included.any(axis=1)))
        squared = np.full(included.shape, np.inf)

        def fill(index: int, threads: int) -> int:
            """Simulate a test; the time steps that it took."""
            test, rows = self.compared[index], np.flatnonzero(included[:, index])
            if not rows.size:
                return 0
            if self.is_direct:
                run = self._simulate_test(index, theta[rows], threads=threads)
                squared[rows, index] = run.squared_error / (test.variance * test.measured.size)
                return int(run.steps.sum())
            for some in np.array_split(rows, range(_ROWS, rows.size, _ROWS)):
                residuals, failed = test.residuals(theta[some], threads=threads)
                sums = np.einsum("bt,bt->b", residuals, residuals) / (test.variance * test.measured.size)
                squared[some, index] = np.where(failed, np.inf, sums)
            return test.steps(theta[rows])

        self.tally.steps += sum(self._on_every_test(fill))
        return squared

    @checked
    def misfits(self, theta: _Rows) -> tuple[Misfits, ...]:
        """Misfits of each row of `theta`, test by test."""
        self.tally.simulations += len(theta)
        runs = self._on_every_test(lambda index, threads: self._simulate_test(index, theta, threads=threads))
        self.tally.steps += sum(int(run.steps.sum()) for run in runs)
        return tuple(runs)

    def _on_every_test(self, work: Callable[[int, int], T]) -> list[T]:
        """Results of `work(index, threads)` in the order of the tests, several of which run at once."""
        return on_every_test(len(self.tests), self.threads, work)

    def _simulate_test(self, index: int, theta: Floats, *, threads: int) -> Misfits:
        test = self.compared[index]
        return _simulate_misfits(
            self.spec,
            test.tie(theta),
            test.history,
            test.test.force,
            first=test.test.n_settle,
            threads=threads,
        )

    @checked
    def residuals(self, theta: _Rows) -> Floats:
        """Residuals of each row of `theta`, shape (n_batch, n_residuals); the sum of squares is the squared misfit.

        Residuals of a simulation that failed are 1, far above the residuals of any fit.
        """
        self.tally.simulations += len(theta)

        def part(index: int, threads: int) -> Floats:
            test = self.compared[index]
            residuals, failed = test.residuals(theta, threads=threads)
            residuals *= test.normalisation
            residuals[failed] = 1.0
            return residuals

        return np.concatenate(self._on_every_test(part), axis=1)


def once(objective: Objective, step: str, kind: type[T], compute: Callable[[], T], *inputs: object) -> T:
    """Result of `compute` for these inputs, a dataclass `kind`; recalled where the journal has recorded it."""
    if objective.journal is None:
        return compute()
    names = [test.name for test in objective.tests]
    return objective.journal.once(step, digest_of(objective.spec.name, names, *inputs), kind, compute)


def up_to(objective: Objective, stiffest: float) -> Objective:
    """The same misfit, infinite for candidates that want more sub-steps a second than `stiffest` [1/s]."""
    if stiffest == objective.stiffest:
        return objective
    return replace(objective, compared=tuple(replace(test, stiffest=stiffest) for test in objective.compared))


# Largest Jacobian of which sums are taken at once, in numbers: 64 MiB.
_BLOCK_SIZE = 1 << 23
# Least eigenvalue of the normal equations, per largest, that counts.
_INSENSITIVE = 1e-12


def linearise_residuals(objective: Objective, theta: Floats, columns: Sequence[int]) -> tuple[Floats, Floats]:
    """Residuals and their exact derivatives with respect to columns of `theta`, from one simulation of each row.

    Shapes (n_batch, n_residuals) and (n_batch, n_columns, n_residuals), per unit of the column; derivatives are zero
    where a simulation failed. They include the observation model and the effects of each test.
    """
    objective.tally.simulations += len(theta)

    def part(index: int, threads: int) -> tuple[Floats, Floats]:
        test = objective.compared[index]
        residuals, jacobian, failed = test.linearise_residuals(theta, columns, threads=threads)
        residuals *= test.normalisation
        residuals[failed] = 1.0
        return residuals, np.multiply(jacobian, test.normalisation, out=jacobian)

    residuals, jacobians = zip(*on_every_test(len(objective.tests), objective.threads, part), strict=True)
    return np.concatenate(residuals, axis=-1), np.concatenate(jacobians, axis=-1)


@array_dataclass()
class _AtCommands:
    """Candidates, rows of `theta` (n_rows, n_params), as parameters of the plain model at constant commands of tests.

    The plain model has fewer parameters than its laws have coefficients: `values`, (n_commands, n_rows, n_plain), and
    their `slopes` by the free coefficients, (n_commands, n_rows, n_columns, n_free), of the `columns` that have any.
    """

    plain: DamperSpec
    commands: Floats
    values: Floats
    columns: tuple[int, ...]
    slopes: Floats

    @classmethod
    def of(cls, objective: Objective, box: Box, theta: Floats) -> _AtCommands:
        """The candidates at the constant commands of the tests of an objective."""
        spec = objective.spec
        commands = np.unique(
            [test.held_command for test in objective.compared if test.held_command is not None]
        )
        *coefficients, rest = by_parameter(spec, theta)
        rest = rest[:, spec.n_rates :]
        n_plain, n_rest = len(spec.plain), rest.shape[1]
        values = np.empty((len(commands), len(theta), n_plain + n_rest))
        slopes = np.zeros((*values.shape, theta.shape[1]))
        first = 0
        for number, ((parameter, law), own) in enumerate(zip(spec.law_pairs, coefficients, strict=True)):
            # Between far values a curve may go anywhere.
            with np.errstate(over="ignore", invalid="ignore"):
                value, slope = law.values(own.T, commands[:, None]), law.slopes(own.T, commands)
            if not law.is_constant:
                # A parameter that is limited to its range has derivatives of zero.
                inside = (value >= parameter.lower) & (value <= parameter.upper)
                value, slope = np.clip(value, parameter.lower, parameter.upper), np.where(inside, slope, 0.0)
            values[..., number] = value
            slopes[..., number, first : first + len(slope)] = np.moveaxis(slope, 0, -1)
            first += len(slope)
        values[..., n_plain:] = rest
        slopes[..., n_plain:, slopes.shape[-1] - n_rest :] = np.eye(n_rest)
        parameter_of = np.repeat(np.arange(n_plain), [law.n_coefficients for law in spec.laws])
        of_column = [*parameter_of, *[-1] * spec.n_rates, *range(n_plain, n_plain + n_rest)]
        columns = tuple(sorted({int(of_column[column]) for column in box.free} - {-1}))
        return cls(
            plain=spec.without_laws,
            commands=commands,
            values=values,
            columns=columns,
            slopes=slopes[:, :, columns][..., box.free],
        )

    def of_test(self, test: ObservedTest) -> tuple[ObservedTest, Floats, Sequence[int], Floats]:
        """A test at a constant command as one of the plain model, with its candidates, columns and their slopes."""
        command = test.held_command
        assert command is not None
        level = int(np.searchsorted(self.commands, command))
        return replace(test, spec=self.plain), self.values[level], self.columns, self.slopes[level]


@array_dataclass()
class NormalEquations:
    """Squared NRMSE of tests, (n_rows, n_tests), half its gradient by the free parameters, (..., n_free), and J'J.

    Where a row leaves a test out, or a simulation fails, the squared NRMSE is infinite and the rest zero.
    """

    squared: Floats
    gradient: Floats
    matrix: Floats

    @classmethod
    def at(
        cls,
        objective: Objective,
        box: Box,
        theta: Floats,
        included: NDArray[np.bool_],
        varied: NDArray[np.bool_] | None = None,
    ) -> NormalEquations:
        """Simulate rows of `theta`, (n_rows, n_params), with derivatives, on the tests that each `included` row has.

        Where not all free parameters are `varied`, (n_free,), the equations of the others are zero.
        """
        objective.tally.simulations += len(theta)
        n_free = len(box.free)
        is_held = [test.held_command is not None for test in objective.compared]
        at_commands = _AtCommands.of(objective, box, theta) if any(is_held) else None
        squared = np.full(included.shape, np.inf)
        gradient = np.zeros((*included.shape, n_free))
        matrix = np.zeros((*included.shape, n_free, n_free))

        def fill(index: int, threads: int) -> int:
            rows = np.flatnonzero(included[:, index])
            test, candidates = objective.compared[index], theta
            columns: Sequence[int] = box.free
            slopes: Floats | None = None
            if at_commands is not None and is_held[index]:
                test, candidates, columns, slopes = at_commands.of_test(test)
            if varied is not None:
                slopes = np.tile(np.eye(n_free), (len(theta), 1, 1)) if slopes is None else slopes
                slopes = np.where(varied, slopes, 0.0)
                has_slope = slopes.any(axis=(0, 2))
                columns, slopes = np.array(columns)[has_slope].tolist(), slopes[:, has_slope]
            at_once = max(1, _BLOCK_SIZE // (test.measured.size * max(len(columns), 1)))
            scale = 1.0 / test.deviation / np.sqrt(test.measured.size)
            for some in (rows[first : first + at_once] for first in range(0, rows.size, at_once)):
                residuals, jacobian, failed = test.linearise_residuals(
                    candidates[some], columns, threads=threads
                )
                # The derivatives of a force that is nearly unstable overflow; no step can be computed from them.
                with np.errstate(over="ignore", invalid="ignore"):
                    residuals *= scale
                    jacobian *= scale
                    squares = np.einsum("bt,bt->b", residuals, residuals)
                    pull = np.einsum("bpt,bt->bp", jacobian, residuals)
                    square = jacobian @ jacobian.transpose(0, 2, 1)
                    if slopes is not None:
                        own = slopes[some]
                        pull = np.einsum("bp,bpq->bq", pull, own)
                        square = own.transpose(0, 2, 1) @ square @ own
                    gradient[some, index], matrix[some, index] = pull, square
                squared[some, index] = np.where(failed, np.inf, squares)
            return test.steps(candidates[rows])

        objective.tally.steps += sum(on_every_test(len(objective.compared), objective.threads, fill))
        return cls(squared=squared, gradient=gradient, matrix=matrix)

    @classmethod
    def of_parts(cls, residuals: Floats, by_free: Floats, parts: NDArray[np.intp]) -> NormalEquations:
        """Equations of one row, with the part that has the number of each residual, (n_residuals,), for a test.

        Derivatives `by_free` have the shape (n_free, n_residuals).
        """
        rows = []
        for part in parts == np.arange(parts.max() + 1)[:, None]:
            of_part, slope = residuals[part], by_free[:, part]
            rows.append((of_part @ of_part, slope @ of_part, slope @ slope.T))
        squared, gradient, matrix = (np.array(entries)[None] for entries in zip(*rows, strict=True))
        return cls(squared=squared, gradient=gradient, matrix=matrix)

    def __getitem__(self, rows: NDArray[Any]) -> NormalEquations:
        """The equations of some rows."""
        return NormalEquations(
            squared=self.squared[rows], gradient=self.gradient[rows], matrix=self.matrix[rows]
        )

    def by(self, slope: Floats) -> NormalEquations:
        """The equations by other coordinates: derivatives of the free parameters by them, (n_rows, n_free, n_free)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return NormalEquations(
                squared=self.squared,
                gradient=np.einsum("rtp,rpq->rtq", self.gradient, slope),
                matrix=slope.transpose(0, 2, 1)[:, None] @ self.matrix @ slope[:, None],
            )

    def joint(self, shares: Floats, held: NDArray[np.bool_] | None = None) -> tuple[Floats, Floats]:
        """Gradient and J'J of the squared misfit of each row with these shares of the tests, (n_rows, n_tests).

        Where a row has `held` parameters, of (n_rows, n_free), both have zeros.
        """
        gradient = np.einsum("rt,rtp->rp", shares, self.gradient)
        matrix = np.einsum("rt,rtpq->rpq", shares, self.matrix)
        return (gradient, matrix) if held is None else _without(held, gradient, matrix)

    def steps(
        self, shares: Floats, held: NDArray[np.bool_], taken: Floats | None = None, ridge: float = 0.0
    ) -> Floats:
        """Gauss-Newton steps of each row, (n_rows, n_free), with these shares of the tests and `held` parameters.

        Steps that held ones have `taken`, zero elsewhere, are in the result, and the others are the best beside them.
        A `ridge` is added to the diagonal of J'J, of parameters in units of their sensitivity.
        """
        gradient, matrix = self.joint(shares)
        if taken is not None:
            gradient = gradient + np.einsum("rpq,rq->rp", matrix, taken)
        gradient, matrix = _without(held, gradient, matrix)
        # Rounding may leave the sensitivity of a force that is nearly unstable below zero.
        size = np.sqrt(np.maximum(np.diagonal(matrix, axis1=1, axis2=2), 0.0))
        size[size < SMALLEST] = np.inf
        scaled = matrix / size[:, :, None] / size[:, None] + ridge * np.eye(size.shape[-1])
        inverse = np.linalg.pinv(scaled, rcond=_INSENSITIVE, hermitian=True)
        steps = -np.einsum("rpq,rq->rp", inverse, gradient / size) / size
        return np.asarray(steps if taken is None else steps + taken)

    def after(self, steps: Floats) -> Floats:
        """Squared NRMSE of the tests after steps, (n_rows, n_tests, n_free), where residuals are linear."""
        return np.asarray(
            self.squared
            + 2.0 * np.einsum("rtp,rtp->rt", self.gradient, steps)
            + np.einsum("rtp,rtpq,rtq->rt", steps, self.matrix, steps)
        )


def _without(held: NDArray[np.bool_], gradient: Floats, matrix: Floats) -> tuple[Floats, Floats]:
    """Gradient and J'J of rows, with zeros where a parameter is `held`."""
    return np.where(held, 0.0, gradient), np.where(held[:, :, None] | held[:, None], 0.0, matrix)
