"""How far a candidate is from the measured tests: one number per candidate, simulated in lanes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.errors import RecordError
from mrwork.identification.nuisance import NuisanceName, without_nuisance
from mrwork.journal import Journal, digest_of
from mrwork.records import AS_IT_IS, DamperTest
from mrwork.simulate import Misfits, Outcome, loading_of, simulate_forces, simulate_misfits
from mrwork.spec import DamperSpec

# Rows whose residuals are held in memory at once where a misfit needs the whole history.
_ROWS = 64
# Limits are this much above what a threshold allows: sums are rounded in another order than the misfit is.
_MARGIN = 1.0 + 1e-9

T = TypeVar("T")


@dataclass(slots=True)
class Tally:
    """How many candidates have been simulated, in how many time steps, and how many steps were spared.

    Spared are those after a candidate reached its threshold; in a test that was not begun at all, they are counted
    with the sub-steps of the last one that was. `told` is what each test has added to squared misfits per step so far.
    """

    simulations: int = 0
    steps: int = 0
    spared: int = 0
    told: dict[int, float] = field(default_factory=dict)

    def as_record(self) -> Mapping[str, object]:
        """The counts, for a journal."""
        return {
            "simulations": self.simulations,
            "steps": self.steps,
            "spared": self.spared,
            "told": self.told,
        }

    def restore(self, record: Mapping[str, Any]) -> None:
        """Count as a journal says."""
        self.simulations, self.steps = record["simulations"], record["steps"]
        self.spared = record["spared"]
        self.told = {int(index): float(each) for index, each in record["told"].items()}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Objective:
    """Free-run misfit of a model against one or several tests.

    Each test weighs the same: its residuals are divided by the deviation of its force, so the misfit is
    the root mean square over tests of the NRMSE. A simulated force is observed as the test's rig did, and relieved of
    the nuisance parameters, before the two are compared. Where there is a `journal`, costly steps are recorded there.
    """

    spec: DamperSpec
    tests: tuple[DamperTest, ...]
    histories: tuple[_rust.LoadingHistory, ...]
    nuisances: tuple[NuisanceName, ...] = ()
    threads: int = 0
    tally: Tally = field(default_factory=Tally)
    journal: Journal | None = None

    @classmethod
    def of(
        cls,
        spec: DamperSpec,
        tests: tuple[DamperTest, ...],
        *,
        nuisances: tuple[NuisanceName, ...] = (),
        threads: int = 0,
        tally: Tally | None = None,
        journal: Journal | None = None,
    ) -> Objective:
        """Spline the motions of the tests once, for all candidates."""
        if not tests:
            raise RecordError("no test was given to identify from; name at least one file")
        histories = tuple(loading_of(test, spec).history() for test in tests)
        return cls(
            spec=spec,
            tests=tests,
            histories=histories,
            nuisances=nuisances,
            threads=threads,
            tally=tally or Tally(),
            journal=journal,
        )

    def once(self, step: str, kind: type[T], compute: Callable[[], T], *inputs: object) -> T:
        """What `compute` makes of these inputs, a dataclass `kind`; recalled where the journal has it."""
        if self.journal is None:
            return compute()
        names = [test.name for test in self.tests]
        return self.journal.once(step, digest_of(self.spec.name, names, *inputs), kind, compute)

    @property
    def is_direct(self) -> bool:
        """Whether the simulated force itself is compared: nothing was observed differently, nothing is a nuisance."""
        return not self.nuisances and all(test.observation == AS_IT_IS for test in self.tests)

    @property
    def n_time(self) -> int:
        """Samples that count, of all tests together."""
        return sum(test.n_time - test.n_settle for test in self.tests)

    def __call__(
        self, theta: NDArray[np.float64], thresholds: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Misfit of each row of `theta`, shape (n_batch,); infinite where a simulation failed.

        With `thresholds`, shape (n_batch,), a row is simulated only until its misfit reaches its own, and is infinite
        then; rows below theirs come out as without, to the last bit.
        """
        if not self.is_direct:
            return np.concatenate(
                [self._indirect(rows) for rows in np.array_split(theta, -(-len(theta) // _ROWS) or 1)]
            )
        if thresholds is not None:
            return self._limited(theta, thresholds)
        total = np.zeros(len(theta))
        for test, misfits in zip(self.tests, self.misfits(theta), strict=True):
            total += misfits.squared_error * weight_of(test, len(self.tests)) ** 2
        return np.sqrt(total)

    def _limited(self, theta: NDArray[np.float64], thresholds: NDArray[np.float64]) -> NDArray[np.float64]:
        """Misfits, test by test, the one first that has told most per step; the sum is in the order of the tests."""
        n_tests = len(self.tests)
        self.tally.simulations += len(theta)
        parts = np.zeros((n_tests, len(theta)))
        remaining = np.arange(len(theta))
        substeps = np.ones(len(theta), dtype=np.int64)
        for index in sorted(range(n_tests), key=lambda index: -self.tally.told.get(index, np.inf)):
            test = self.tests[index]
            weight = weight_of(test, n_tests) ** 2
            allowed = thresholds[remaining] ** 2 - parts[:, remaining].sum(axis=0)
            run = self._simulated(index, theta[remaining], np.maximum(allowed, 0.0) * (_MARGIN / weight))
            substeps[remaining] = run.substeps
            # Of all rows: those that were dropped before have no steps here.
            self.tally.spared += int(test.n_time * substeps.sum() - run.steps.sum())
            reached = np.where(run.outcome == Outcome.ABANDONED, allowed, run.squared_error * weight)
            parts[index, remaining] = reached
            finite = np.isfinite(run.squared_error)
            self.tally.told[index] = float(
                np.sum(reached, where=np.isfinite(reached)) / max(run.steps.sum(), 1)
            )
            remaining = remaining[finite]
        misfit = np.full(len(theta), np.inf)
        total = np.zeros(remaining.size)
        for part in parts[:, remaining]:
            total += part
        misfit[remaining] = np.sqrt(total)
        return misfit

    def _indirect(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        squared = np.zeros(len(theta))
        for part in self._parts(theta, failure=np.inf):
            squared += np.einsum("bt,bt->b", part, part)
        return np.sqrt(squared)

    def misfits(self, theta: NDArray[np.float64]) -> tuple[Misfits, ...]:
        """Misfits of each row of `theta`, test by test."""
        self.tally.simulations += len(theta)
        return tuple(self._simulated(index, theta) for index in range(len(self.tests)))

    def _simulated(
        self, index: int, theta: NDArray[np.float64], limits: NDArray[np.float64] | None = None
    ) -> Misfits:
        test, history = self.tests[index], self.histories[index]
        run = simulate_misfits(
            self.spec,
            theta,
            history,
            test.force,
            first=test.n_settle,
            limits=limits,
            threads=self.threads,
        )
        self.tally.steps += int(run.steps.sum())
        return run

    def residuals(self, theta: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residuals of each row of `theta`, shape (n_batch, n_residuals), whose squares add up to the squared misfit.

        A simulation that failed has residuals of one, far beyond any that fits.
        """
        return np.concatenate(list(self._parts(theta, failure=1.0)), axis=1)

    def _parts(self, theta: NDArray[np.float64], *, failure: float) -> Iterator[NDArray[np.float64]]:
        """Weighted residuals test by test, shape (n_batch, n_counted); rows that failed have this value."""
        self.tally.simulations += len(theta)
        for test, history in zip(self.tests, self.histories, strict=True):
            run = simulate_forces(self.spec, theta, history, threads=self.threads)
            failed = run.outcome != Outcome.FINISHED
            run.force[failed] = 0.0
            observed = test.observation.observe(run.force, test.dt)[:, test.counted]
            residuals = without_nuisance(observed, test.force[test.counted], self.nuisances)
            residuals *= weight_of(test, len(self.tests))
            residuals[failed] = failure
            yield residuals


def weight_of(test: DamperTest, n_tests: int) -> float:
    """What residuals [N] are multiplied by, so that the sum of their squares over all tests is the squared misfit."""
    force = test.force[test.counted]
    return float(1.0 / np.sqrt(np.var(force) * force.size * n_tests))
