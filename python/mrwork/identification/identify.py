"""Identify a damper model from tests: global search, least-squares fit, quality of the result."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from warnings import warn

import numpy as np

from mrwork.base.arguments import Threads, takes_fields
from mrwork.base.blas import on_one_blas_thread
from mrwork.base.progress import OnProgress
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec, damper, plain_parameters
from mrwork.errors import Interrupted, MrworkError, MrworkWarning, SimulationError
from mrwork.identification.commands import CommandedTests
from mrwork.identification.covariance import Covariance, Slopes
from mrwork.identification.doubts import doubts_on_fit
from mrwork.identification.effects import EFFECTS_FITTED, fit_effects
from mrwork.identification.excerpts import middle_excerpts
from mrwork.identification.fit import Fit, FitStatus, SearchTrace, SingleCommand
from mrwork.identification.fit_progress import Identifying
from mrwork.identification.minimise.driver_lag import polish_with_wanted_lag
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.minimise.plain_search import points_from_optimiser, points_from_race
from mrwork.identification.minimise.polish import FinalFit, StartingPoints, at_least_linear
from mrwork.identification.objective import up_to
from mrwork.identification.problem import Problem, problem_fingerprint
from mrwork.identification.result import BuildingCost, cost_remark, fit_at
from mrwork.identification.settings import FitSettings, Race, Start
from mrwork.identification.verdicts import fitted_parameters
from mrwork.records import DamperTest
from mrwork.records.damper_test import as_tests
from mrwork.store.journal import Journal
from mrwork.store.long_call import interruptible

# Most iterations of a fit to the tests at one command, from the fit to all tests.
_ITERATIONS_ALONE = 30


@dataclass(frozen=True, slots=True, kw_only=True)
class _Call(FitSettings):
    """A call of `identify`.

    Parameters
    ----------
    model
        A model or its name. A driver's lag that tests of varying commands do not show, with a rate that the bounds do
        not fix, is left out of the fit, and a remark says so.
    tests
        One test or several. All have the same weight, independent of length and force.
    on_progress
        Called after every generation of the search, every minimisation of the screening and every step of the final
        fit, except where they are recalled from the journal. Where it returns true the run ends with the best
        parameters so far and the status "stopped".
    journal
        Records every generation and every local minimisation; a resumed journal supplies those that it has recorded.
        The caller closes it; a run that is stopped or interrupted closes it itself.
    """

    model: DamperSpec | str = field(kw_only=False)
    tests: DamperTest | Sequence[DamperTest] = field(kw_only=False)
    threads: Threads = 0
    on_progress: OnProgress | None = None
    journal: Journal | None = None

    @property
    def settings(self) -> FitSettings:
        return FitSettings(**{entry.name: getattr(self, entry.name) for entry in fields(FitSettings)})


@takes_fields(_Call)
def identify(call: _Call) -> Fit:
    """Identify one damper model from one or several tests of the same damper.

    A race of unlike routes, or another `search`, finds the starting points: local minimisations from samples against a
    population, with current laws minimisations from fits at each command against a population of laws. The final
    least-squares fit uses exact derivatives; it can be made by optimistix for comparison. "Converged" says that two
    routes agree on the minimum.

    Returns
    -------
    Fit
        Parameters with standard errors and verdicts, quality per test, search trace, provenance; no errors and no
        verdicts where the run was stopped.

    Raises
    ------
    SettingError
        Where a bound or a tie is impossible, a start cannot be used, or the search was read from a file and is
        not registered.
    UnknownNameError
        Where a start or a tie names a parameter that the model does not have, or there is no such search.
    SimulationError
        Where no candidate could be simulated.
    JournalError
        Where the journal belongs to another identification; the message names what differs.
    Interrupted
        On Ctrl-C, carrying the `Fit` at the best found so far, `None` where no candidate was simulated yet.

    Warns
    -----
    MrworkWarning
        Before the search, where the tests are at several commands and the model has no law; see `Fit.remarks`.

    Examples
    --------
    >>> import mrwork as mr
    >>> fit = mr.identify("normalised_bouc_wen", mr.read_damper_test("rig/10mm1Hz0x5A.csv"))  # doctest: +SKIP
    >>> fit.fit_percent  # doctest: +SKIP
    92.08
    """
    return identify_with(
        call.model,
        call.tests,
        call.settings,
        threads=call.threads,
        on_progress=call.on_progress,
        journal=call.journal,
    )


@on_one_blas_thread
def identify_with(
    model: DamperSpec | str,
    tests: DamperTest | Sequence[DamperTest],
    settings: FitSettings,
    *,
    threads: int = 0,
    on_progress: OnProgress | None = None,
    journal: Journal | None = None,
    warns: bool = True,
    examines: bool = True,
    searched: tuple[Box, SearchTrace] | None = None,
    doubt: str = "",
    near: Start | None = None,
) -> Fit:
    """`identify` with its settings as one value.

    Without `warns` its remarks are with the fit only. Without `examines` nothing is looked for that speaks against a
    fit which has converged. Where the search was made before, `searched` are the box of the final fit and the trace
    that led to the first start of the settings, from which it begins, and `doubt` says why a lower minimum is possible.
    The search of laws begins `near` the fit to which other laws have led, and looks whether another route meets it.
    """
    spec = damper(model) if isinstance(model, str) else model
    problem = Problem.of(spec, as_tests(tests), settings, threads=threads, journal=journal)
    for remark in problem.foreseen() if warns else ():
        # Of the line that calls `identify`.
        warn(remark.message, MrworkWarning, stacklevel=6)
    if searched is not None:
        problem = replace(problem, form=replace(problem.form, box=searched[0]))
    tally = problem.objective.tally
    call = Identifying(journal=journal, on_progress=on_progress, tally=tally)
    if journal is not None:
        journal.agree("identification", problem_fingerprint(problem))
        journal.carry(tally)

    def find_points() -> StartingPoints:
        if searched is None:
            return starting_points(problem, call, near).with_given(spec, settings.starts)
        start = problem.inside([settings.starts[0][name] for name in spec.names])
        return StartingPoints(
            objective=problem.objective, form=problem.form, theta=start[None], trace=searched[1], doubt=doubt
        )

    return _Identification(problem=problem, call=call, examines=examines).fit(find_points)


def moved_to(fit: Fit, tests: Sequence[DamperTest], theta: Floats, *, found_by: str, threads: int = 0) -> Fit:
    """The fit to its tests anew from a point of less misfit, (n_params,), that what is named has found.

    Effects that it has found are found again; those that sliders have told stay, as does what was said of either.
    """
    start = dict(zip(fit.spec.names, theta.tolist(), strict=True))
    moved = identify_with(
        fit.spec,
        tests,
        replace(fit.settings.with_effects(dict.fromkeys(fit.varied_effects)), starts=(start,)),
        threads=threads,
        warns=False,
        searched=(Problem.of_fit(fit, tuple(tests)).form.box, fit.trace),
        doubt=f"{found_by} found it, and no route of the search",
    )
    told = tuple(effect for effect in fit.effects if effect not in fit.varied)
    said = tuple(remark for remark in fit.remarks if remark.code == EFFECTS_FITTED.code)
    return replace(
        moved,
        effects=(*told, *moved.effects),
        remarks=(*moved.remarks, *said),
        provenance=fit.provenance,
    )


@dataclass(slots=True, kw_only=True)
class _Identification:
    """An identification that runs: its problem, and the call with the best point so far.

    With `examines` doubts about the fit are looked for.
    """

    problem: Problem
    call: Identifying
    examines: bool

    def fit(self, find_points: Callable[[], StartingPoints]) -> Fit:
        """The fit from the starting points that are found; where it is stopped, that at the best point so far.

        Ctrl-C is an interrupt with that fit.
        """
        try:
            return self._finish(find_points())
        except KeyboardInterrupt as interrupt:
            if self.call.journal is not None:
                # The abandoned thread of a local minimisation must not write to it any more.
                self.call.journal.close()
            stopped = isinstance(interrupt, Interrupted) and interrupt.stopped
            fit = None
            if self.call.so_far is not None and (so_far := self.call.so_far()) is not None:
                theta, trace = so_far
                reason = trace.stop_reason
                fit = fit_at(
                    self.problem,
                    theta,
                    covariance=None,
                    trace=replace(
                        trace, stop_reason=reason.replace("interrupted", "callback") if stopped else reason
                    ),
                    steps=0,
                    status="stopped" if stopped else "interrupted",
                    seconds=self.call.seconds,
                )
            if not stopped:
                raise Interrupted(fit, "identification") from interrupt
            if fit is None:
                raise SimulationError(
                    f"no candidate of {self.problem.spec.name} could be simulated before the run was stopped; let it "
                    "run longer"
                ) from interrupt
            return fit

    def _finish(self, points: StartingPoints) -> Fit:
        """Fit from the starting points to convergence."""
        objective = up_to(self.problem.objective, points.objective.stiffest)
        problem = self.problem = replace(self.problem, form=points.form, objective=objective)
        call = self.call

        def keep(theta: Floats) -> None:
            call.so_far = lambda: (theta, points.trace)

        def polish() -> FinalFit:
            # Without the driver's lag where the tests do not want it.
            on_step = partial(call.on_steps, "refinement")
            wanted = polish_with_wanted_lag(problem, points, on_step=on_step)
            return fit_effects(at_least_linear(wanted, on_step=on_step))

        keep(points.theta[0])
        ended = interruptible(polish)
        problem = self.problem = ended.problem
        keep(ended.theta)
        reason = "" if ended.converged else f"the final fit ended at its most steps, {ended.steps}"
        status: FitStatus = "not_converged" if reason else "converged"
        if points.doubt and not reason:
            status, reason = "lower_minimum_possible", points.doubt
        fit = fit_at(
            problem,
            ended.theta,
            covariance=ended.covariance,
            trace=points.trace,
            steps=ended.steps,
            status=status,
            seconds=call.seconds,
        )
        fit = replace(fit, effects=ended.effects)
        if not self.examines:
            return replace(fit, status_reason=reason, seconds=call.seconds)
        doubts = interruptible(
            lambda: tuple(doubts_on_fit(ended, fit.nrmse, is_suspected=bool(points.doubt)))
        )
        cost = BuildingCost.of(fit.spec, fit.theta, problem.objective.tests)
        if cost.is_high:
            reason = reason or cost.in_words
            doubts = (*doubts, cost_remark(fit, cost))
        return replace(
            fit,
            remarks=(*fit.remarks, *ended.remarks, *doubts),
            status_reason=reason,
            single_commands=interruptible(lambda: _single_commands(problem, fit)),
            seconds=call.seconds,
        )


def _single_commands(problem: Problem, fit: Fit) -> tuple[SingleCommand, ...]:
    """Fits to the tests at each command of the parameters that follow it; none where the commands vary.

    They end on excerpts; their standard errors are for the whole tests.
    """
    spec, objective = fit.spec, problem.objective
    if spec.command_unit is None:
        return ()
    tested = CommandedTests.of(spec, objective.tests)
    if not tested.has_levels:
        return ()
    plain, fits = spec.without_laws, []
    for command, tests in tested.at.items():
        values = plain_parameters(spec, np.array(fit.theta), command)
        pairs = zip(plain.names, values.tolist(), strict=True)
        held = {name: (value, value) for name, value in pairs if name not in spec.following}
        settings = replace(problem.settings, bounds=held, starts=(), search=None, ties={})
        # A command at which the plain model cannot be fitted is left out.
        with suppress(MrworkError):
            alone = Problem.of(plain, tests, settings, threads=objective.threads)
            excerpts = middle_excerpts(alone.objective.tests)
            theta = find_minima(
                alone.objective.on(alone.form.spec, excerpts),
                alone.form.box,
                alone.inside(values)[None],
                max_iterations=_ITERATIONS_ALONE,
            ).theta[0]
            covariance = Covariance.of(Slopes.at(alone.objective, alone.form, theta))
            estimates, _ = fitted_parameters(alone, theta, covariance)
            following = tuple(estimate for estimate in estimates if estimate.name in spec.following)
            fits.append(SingleCommand(command=command, estimates=following))
    return tuple(fits)


def starting_points(problem: Problem, call: Identifying, near: Start | None = None) -> StartingPoints:
    """Run the global search of a problem; with current laws that is one of the plain model at each constant command.

    It begins `near` a fit of the laws, if there is one.
    """
    search, spec = problem.search, problem.form.spec
    if spec.command_unit is None:
        if isinstance(search, Race):
            return points_from_race(problem, search, call=call)
        return points_from_optimiser(problem, search, call=call)
    # What the search of laws imports is slow to load.
    if CommandedTests.of(spec, problem.objective.tests).has_levels:
        from mrwork.identification.minimise.level_search import points_from_levels

        return points_from_levels(problem, search, call=call, near=near)
    from mrwork.identification.minimise.varying_search import points_from_scaled_forces

    return points_from_scaled_forces(problem, search, call=call)
