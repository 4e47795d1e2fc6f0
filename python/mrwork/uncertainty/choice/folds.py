"""Candidates by what they predict of tests that are left out: fits to rows of weights over tests, in one batch.

A fit without a split starts from samples of its own and ends where its own tests lead: nothing of a fit to all tests
reaches what it predicts. What its tests leave open is not predicted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec, by_parameter
from mrwork.identification.commands import CommandedTests, determines
from mrwork.identification.equivalent import (
    bounds_of,
    fitted_coefficients,
    in_other_dependences,
    search_box,
    widened,
)
from mrwork.identification.minimise.levenberg_marquardt import LocalMinima, find_minima
from mrwork.identification.minimise.race import draw_samples
from mrwork.identification.objective import Objective, friction_limit, up_to
from mrwork.identification.problem import box_with_free
from mrwork.identification.settings import FitSettings, Race
from mrwork.identification.sliders import Sliders
from mrwork.records import DamperTest
from mrwork.records.observation import Effect
from mrwork.uncertainty.bands.prediction import rests_of
from mrwork.uncertainty.choice.splits import Splits

# Convergence of the fits: relative decrease of the squared misfit in an iteration; largest number of iterations.
_TOLERANCE = 1e-5
_ITERATIONS = 30
_REFINED_TOLERANCE = 1e-6
# Starts of a split, of which so many go on after a first descent of these iterations, to this tolerance.
_STARTS, _GO_ON = 8, 2
_FIRST_ITERATIONS, _FIRST_TOLERANCE = 8, 1e-3


@array_dataclass()
class FoldedFit:
    """Parameters of each row, (n_rows, n_params), its effects, (n_rows, n_effects), and squared NRMSE of the first.

    The first row is fitted to all tests, of which it has the squared NRMSE, (n_tests,), the others to those that remain
    without each split.
    """

    theta: Floats
    effects: Floats
    squared: Floats


@array_dataclass()
class Folds:
    """Tests that candidates are fitted to, `excerpts`, and the `whole` ones that they predict, of one plain model.

    Each row of `shares`, (n_rows, n_tests), weighs the excerpts, for all tests, then without each split. Laws follow a
    command of this `unit`; all tests run at the `commands`, and those without each split at the `remaining` ones. Each
    row has its own `effects` on the recorded force: as they fit its tests, or as sliders tell them from these where
    they are `told`.
    """

    whole: Objective
    excerpts: Objective
    shares: Floats
    commands: Floats
    remaining: tuple[Floats, ...]
    splits: Splits
    unit: CommandUnit
    effects: tuple[Effect, ...] = ()
    told: bool = False

    @classmethod
    def of(
        cls,
        spec: DamperSpec,
        excerpts: tuple[DamperTest, ...],
        splits: Splits,
        settings: FitSettings,
        threads: int,
    ) -> Folds:
        """The folds of a model with laws, or without any, on the tests of splits and their excerpts."""
        short = Objective.of(spec, excerpts, settings, threads=threads)
        shares = np.tile(short.shares, (1 + splits.n_splits, 1))
        for row, members in enumerate(splits.members, start=1):
            shares[row, members] = 0.0

        def commands_of(tests: Sequence[DamperTest]) -> Floats:
            return CommandedTests.of(spec, tests).commands if spec.command_unit else np.zeros(1)

        return cls(
            whole=Objective.of(spec, splits.tests, settings, threads=threads).with_laws(spec.without_laws),
            excerpts=short,
            shares=shares / shares.sum(axis=1, keepdims=True),
            commands=commands_of(excerpts),
            remaining=tuple(map(commands_of, rests_of(excerpts, splits.members))),
            splits=splits,
            unit=spec.command_unit or "A",
        )

    @property
    def varies(self) -> bool:
        """Whether a command varies within a test, which then shows the laws at all commands."""
        return any(test.has_varying_command for test in self.excerpts.tests)

    def with_effects(self, effects: tuple[Effect, ...], *, told: bool) -> Folds:
        """The folds of which each row has effects of its own."""
        whole, excerpts = (
            replace(each, compared=tuple(replace(test, free=effects) for test in each.compared))
            for each in (self.whole, self.excerpts)
        )
        return replace(self, whole=whole, excerpts=excerpts, effects=effects, told=told)

    def determines(self, spec: DamperSpec) -> NDArray[np.bool_]:
        """Whether the commands of the tests without each split determine every law and rate, (n_splits,)."""
        varying = np.array([test.has_varying_command for test in self.excerpts.tests])
        found = [
            determines(spec, commands, varies=bool((row[varying] > 0.0).any()))
            for commands, row in zip(self.remaining, self.shares[1:], strict=True)
        ]
        return np.array(found, dtype=np.bool_)

    def first_fit(
        self,
        spec: DamperSpec,
        box: Box,
        theta: Floats,
        effects: Floats,
        simple: tuple[DamperSpec, Box] | None = None,
    ) -> FoldedFit:
        """Fit every row from samples of its own; the first also from a fit to all tests, with its effects.

        Laws that are `simple` are fitted to samples first: where shapes follow the command, too, samples are sparse.
        """
        every = np.arange(len(self.shares))
        from_spec, from_box = simple or (spec, box)
        starts, own_effects = self.from_samples(from_spec, from_box, every)
        if simple:
            minima = self._descend(from_spec, from_box, np.hstack([starts, own_effects]), self.shares)
            starts, own_effects = np.split(minima.theta, [starts.shape[1]], axis=1)
            rows = [in_other_dependences(from_spec, row, spec, self.commands) for row in starts]
            starts = np.asarray(box.inside(np.array(rows)))
        own = self.fit(spec, box, starts, own_effects)
        given = self._descend(spec, box, np.hstack([theta, effects]), self.shares[:1])
        both = np.vstack([given.theta, np.hstack([own.theta[:1], own.effects[:1]])])
        misfit = self.excerpts.with_laws(spec)(both)
        best = both[[int(np.argmin(misfit))]]
        (squared,) = self.excerpts.with_laws(spec).squared_nrmse(best)
        n_own = theta.shape[1]
        return FoldedFit(
            theta=np.vstack([best[:, :n_own], own.theta[1:]]),
            effects=np.vstack([best[:, n_own:], own.effects[1:]]),
            squared=squared,
        )

    def fit(self, spec: DamperSpec, box: Box, starts: Floats, effects: Floats) -> FoldedFit:
        """Fit every row; those without a split that no simulation could start from begin from samples of their own."""
        every, wide = np.arange(len(self.shares)), np.hstack([starts, effects])
        minima = self._descend(spec, box, wide, self.shares)
        theta, failed = minima.theta, ~np.isfinite(minima.misfit[1:])
        if failed.any() and not failed.all():
            rows = every[1:][failed]
            again = np.hstack(self.from_samples(spec, box, rows))
            theta[rows] = self._descend(spec, box, again, self.shares[rows]).theta
        (squared,) = self.excerpts.with_laws(spec).squared_nrmse(theta[:1])
        n_own = starts.shape[1]
        return FoldedFit(theta=theta[:, :n_own], effects=theta[:, n_own:], squared=squared)

    def refined(self, spec: DamperSpec, box: Box, fit: FoldedFit) -> FoldedFit:
        """Every row of a fit to the excerpts fitted on to the whole tests."""
        starts = np.hstack([fit.theta, fit.effects])
        minima = self._descend(
            spec, box, starts, self.shares, _ITERATIONS, _REFINED_TOLERANCE, objective=self.whole
        )
        # What the excerpts resolve the whole tests may not.
        theta = np.where(np.isfinite(minima.misfit)[:, None], minima.theta, starts)
        (squared,) = self.whole.with_laws(spec).squared_nrmse(theta[:1])
        n_own = fit.theta.shape[1]
        return FoldedFit(theta=theta[:, :n_own], effects=theta[:, n_own:], squared=squared)

    def from_samples(
        self, spec: DamperSpec, box: Box, rows: NDArray[np.intp], *, go_on: int = _GO_ON
    ) -> tuple[Floats, Floats]:
        """Starts of rows without a split, parameters (n_rows, n_params) and effects, from samples for each.

        Samples of the ranges that suit the tests that remain have constant laws, and forces at the best fit to these.
        Local minimisations from the best of them, of which so many go on, below the limit of stiffness, decide.
        """
        wide, plain = box_with_free(box, self.effects), spec.without_laws
        within = Box.of(plain).with_bounds(bounds_of(box, plain.names))
        starts = np.empty((len(rows), _STARTS, len(wide.names)))
        shares = self.shares[rows]
        for place, row in enumerate(rows.tolist()):
            rest, effects = self._part(spec, shares[place]), self._effects_of(row)
            sampled = widened(search_box(plain, within, rest.tests), within)
            constant = partial(self._constant_laws, spec, wide, effects)
            drawn = draw_samples(
                rest, wide, sampled, Race(), rng=rest.settings.rng, number=0, laws_of=constant
            )
            if not len(drawn):
                drawn = constant(np.array([plain.nominal]))
            # The best ones, and some of the others, which follow.
            taken = np.linspace(0, len(drawn) - 1, _STARTS // 2).round().astype(int)
            starts[place] = drawn[np.concatenate([np.arange(_STARTS - taken.size) % len(drawn), taken])]
        for count, options in (
            (_STARTS, (_FIRST_ITERATIONS, _FIRST_TOLERANCE)),
            (go_on, (_ITERATIONS, _TOLERANCE)),
        ):
            flat = starts[:, :count].reshape(-1, len(wide.names))
            minima = self._descend(spec, box, flat, np.repeat(shares, count, axis=0), *options, is_low=True)
            order = np.argsort(minima.misfit.reshape(len(rows), count), axis=1, kind="stable")
            starts = np.take_along_axis(minima.theta.reshape(len(rows), count, -1), order[..., None], axis=1)
        n_own = len(box.names)
        return starts[:, 0, :n_own], starts[:, 0, n_own:]

    def _descend(
        self,
        spec: DamperSpec,
        box: Box,
        starts: Floats,
        shares: Floats,
        iterations: int = _ITERATIONS,
        tolerance: float = _TOLERANCE,
        *,
        objective: Objective | None = None,
        is_low: bool = False,
    ) -> LocalMinima:
        """Local minimisations from starts with effects, (n_starts, n_params + n_effects), each with its shares."""
        objective, wide = (objective or self.excerpts).with_laws(spec), box_with_free(box, self.effects)
        if is_low:
            objective = up_to(objective, min(friction_limit(objective.tests), objective.stiffest))
        held = np.zeros((len(shares), len(wide.free)), dtype=np.bool_)
        if self.told:
            held[:, len(box.free) :] = True
        return find_minima(
            objective,
            wide,
            starts,
            max_iterations=iterations,
            tolerance=tolerance,
            shares=shares,
            held=held,
        )

    def _part(self, spec: DamperSpec, shares: Floats) -> Objective:
        """The misfit of the tests that have these shares, (n_tests,), alone."""
        pairs = zip(self.excerpts.with_laws(spec).compared, shares.tolist(), strict=True)
        compared = tuple(replace(test, share=share) for test, share in pairs if share > 0.0)
        return replace(self.excerpts, spec=spec, compared=compared)

    def _effects_of(self, row: int) -> Floats:
        """Where the effects of a row begin, (n_effects,): as sliders tell them from its tests, or next to none."""
        if not self.told:
            # At zero, its bound, a lag has no slope.
            dt = self.excerpts.tests[0].dt
            return np.array([dt if effect.of_time else 0.0 for effect in self.effects])
        tests = [
            test for test, share in zip(self.excerpts.tests, self.shares[row], strict=True) if share > 0.0
        ]
        return Sliders.of(tests).fit(self.effects).values

    def _constant_laws(self, spec: DamperSpec, wide: Box, effects: Floats, plain: Floats) -> Floats:
        """Coefficients of laws that are constant at plain parameters, (n_batch, n_plain), with effects beside them."""
        laws = [
            fitted_coefficients(spec, self.commands, np.tile(row, (self.commands.size, 1))) for row in plain
        ]
        return np.asarray(wide.inside(np.hstack([laws, np.tile(effects, (len(plain), 1))])))

    def predict(self, sets: list[tuple[DamperSpec, FoldedFit]]) -> Floats:
        """NRMSE of the whole tests of each split by the fits of sets of laws without them, shape (n_sets, n_pairs).

        At its constant command each test is of the plain model, so that all sets are one batch. It may be infinite. It
        is NaN where the tests that remain leave a law of the set open.
        """
        pairs = [
            (row, index) for row, members in enumerate(self.splits.members, start=1) for index in members
        ]
        rows, indices = np.array(pairs).T
        included = np.arange(len(self.whole.tests)) == indices[:, None]
        if self.varies:
            parts = [
                self.whole.with_laws(spec).squared_nrmse(np.hstack([fit.theta, fit.effects])[rows], included)
                for spec, fit in sets
            ]
            squared = np.concatenate(parts)
        else:
            commands = np.array([np.mean(test.command_in(self.unit) or 0.0) for test in self.whole.tests])
            plain = [
                np.hstack([plain_curves(spec, fit.theta, commands)[rows, indices], fit.effects[rows]])
                for spec, fit in sets
            ]
            squared = self.whole.squared_nrmse(np.concatenate(plain), np.tile(included, (len(sets), 1)))
        nrmse = np.sqrt(squared.reshape(len(sets), len(pairs), -1)[:, included])
        is_open = np.array([~self.determines(spec) for spec, _ in sets])[:, rows - 1]
        return np.where(is_open, np.nan, nrmse)


def plain_curves(spec: DamperSpec, theta: Floats, commands: Floats) -> Floats:
    """Parameters of the plain model, (n_rows, n_commands, n_plain), at commands by the laws of each row of `theta`."""
    columns = []
    for (parameter, law), coefficients in zip(spec.law_pairs, by_parameter(spec, theta), strict=False):
        values = law.values(coefficients.T, commands[:, None]).T
        columns.append(np.clip(values, parameter.lower, parameter.upper))
    return np.stack(columns, axis=-1)
