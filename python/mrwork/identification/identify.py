"""Identify a damper model from tests: explore, refine the best, judge the result."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import Interrupted, SimulationError
from mrwork.identification.fit import Fit, FitStatus, SearchTrace
from mrwork.identification.global_search import explore
from mrwork.identification.nuisance import NuisanceName
from mrwork.identification.problem import Problem
from mrwork.identification.progress import Progress, Stopped, Watch
from mrwork.identification.provenance import fingerprint_of
from mrwork.identification.result import fit_at
from mrwork.identification.settings import Engine, FitSettings, Search, Start, search_named
from mrwork.records import DamperTest
from mrwork.store import Journal

if TYPE_CHECKING:
    from mrwork.identification.levenberg_marquardt import Descended
    from mrwork.identification.polish import Polished


T = TypeVar("T")

# How often a wait for compiled code looks for Ctrl-C [s].
_WATCH = 0.05


def identify(
    model: DamperSpec | str,
    tests: DamperTest | Sequence[DamperTest],
    *,
    search: Search | str | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    nuisances: Sequence[NuisanceName] = (),
    starts: Sequence[Start] = (),
    power: float = 2.0,
    engine: Engine = "lanes",
    rng: int = 0,
    threads: int = 0,
    on_progress: Callable[[Progress], bool | None] | None = None,
    journal: Journal | None = None,
) -> Fit:
    """Identify one damper model from one or several tests of the same damper.

    A plain model is descended from many starts in lanes. If asked it is searched by another algorithm instead, and
    its best finds are screened. A model with current laws starts from fits at each command. All end in lanes, with
    exact derivatives; the last descent can be had on the JAX twin for comparison.

    Parameters
    ----------
    model
        A model or its name.
    tests
        One test or several; each weighs the same, whatever its length and force, unless `power` says otherwise.
    search
        A search with its settings, or its name in the registry; default `Multistart()`, for a model with current laws
        `EfficientGA()`.
    bounds
        Parameter name to (lower, upper); equal bounds hold it fixed. Others have their admissible range.
    nuisances
        What may differ from test to test and is estimated along with the damper: "offset", "level" or "delay" of
        the force channel. With "offset" the model's own force offset is held at zero, for no test tells the two apart.
    starts
        Parameters to descend from beside what the search finds, by name; see `start_from` for those of an earlier fit.
        What a start does not name is taken from the best find, what lies outside the bounds is pulled inside.
    power
        What is made small is (mean NRMSE^power)^(1/power) over the tests: 2 is the root mean square, more helps the
        worst test at some cost to the others.
    engine
        Where the last descent runs: "lanes", or "twin", which takes some eighty times as long, to the same minimum.
    rng
        Seed of the search. The same seed gives the same bits on any number of threads.
    threads
        Threads of the simulation, 0 for all.
    on_progress
        Called after every generation, descent and refinement step that was computed, not recalled. Where it returns
        true the run ends, with what it has found and the status "stopped".
    journal
        Where every generation, descent and refinement is recorded; one that is resumed brings back what it has. To be
        closed by the caller; a run that is stopped or interrupted closes it.

    Returns
    -------
    Fit
        Parameters with standard errors, quality per test, search trace, provenance; no standard errors where it was
        stopped.

    Raises
    ------
    SettingError
        Where a bound or a power is impossible, a start cannot be used, `Multistart` is to search current laws, or the
        twin is asked to follow an observation model.
    UnknownNameError
        Where a start names what the model does not have, or there is no such search.
    SimulationError
        Where no candidate at all could be simulated.
    JournalError
        Where the journal is of another identification; the message names what differs.
    Interrupted
        On Ctrl-C, carrying the `Fit` at the best found so far.

    Examples
    --------
    >>> import mrwork as mr
    >>> fit = mr.identify("normalised_bouc_wen", mr.read_damper_test("rig/10mm1Hz0x5A.csv"))  # doctest: +SKIP
    >>> fit.fit_percent  # doctest: +SKIP
    92.08
    """
    settings = FitSettings(
        search=search_named(search) if isinstance(search, str) else search,
        bounds=dict(bounds or {}),
        starts=tuple(dict(start) for start in starts),
        power=power,
        engine=engine,
        nuisances=tuple(nuisances),
        rng=rng,
    )
    return identify_with(model, tests, settings, threads=threads, on_progress=on_progress, journal=journal)


def identify_with(
    model: DamperSpec | str,
    tests: DamperTest | Sequence[DamperTest],
    settings: FitSettings,
    *,
    threads: int = 0,
    on_progress: Callable[[Progress], bool | None] | None = None,
    journal: Journal | None = None,
) -> Fit:
    """`identify` with settings that are one value."""
    began = time.perf_counter() - (0.0 if journal is None else journal.seconds_before)
    problem = Problem.of(
        damper(model) if isinstance(model, str) else model,
        (tests,) if isinstance(tests, DamperTest) else tuple(tests),
        settings,
        threads=threads,
        journal=journal,
    )
    spec, objective = problem.spec, problem.objective
    if journal is not None:
        journal.agree("identification", fingerprint_of(problem))
        journal.carry(objective.tally)
    watch = Watch(began=began, tally=objective.tally, on_progress=on_progress, journal=journal)

    def on_search(generation: int, misfit: float, median: float, share: float) -> None:
        count = objective.tally.simulations
        watch.tell("search", count, "simulations", misfit, share, generation=generation, median=median)

    def ended(interrupt: KeyboardInterrupt, theta: NDArray[np.float64], trace: SearchTrace) -> Fit:
        """The best found so far: returned where the callback wanted no more, else carried by an interrupt."""
        if journal is not None:
            # A refinement that is left behind on its thread must not go on writing.
            journal.close()

        def so_far(trace: SearchTrace, status: FitStatus) -> Fit:
            return fit_at(
                problem, theta, errors=None, trace=trace, steps=0, status=status, seconds=watch.seconds
            )

        if _was_stopped(interrupt):
            reason = trace.stop_reason.replace("interrupted", "callback")
            return so_far(replace(trace, stop_reason=reason), "stopped")
        raise Interrupted(so_far(trace, "interrupted"), "identification") from interrupt

    try:
        explored = explore(problem, on_search=on_search)
    except Interrupted as interrupt:
        return ended(interrupt, interrupt.result.starts[0], interrupt.result.trace)
    except KeyboardInterrupt as interrupt:
        if not _was_stopped(interrupt):
            raise
        raise SimulationError(
            f"no candidate of {spec.name} could be simulated before the run was stopped; let it go on for longer"
        ) from interrupt
    explored = explored.with_starts(spec, problem.settings.starts)
    problem = replace(problem, form=explored.form)
    best = explored.starts[0]

    def on_start(descended: Descended, share: float) -> None:
        nonlocal best
        best = descended.theta
        watch.tell("screening", round(share * 100), "%", descended.misfit, share)

    def on_step(steps: int, misfit: float) -> None:
        watch.tell("refinement", steps, "steps", misfit, 0.0)

    def polish() -> Polished:
        # SciPy's optimisers are slow to load and needed from here on only.
        from mrwork.identification.polish import polish

        return polish(objective, explored, engine=problem.settings.engine, on_start=on_start, on_step=on_step)

    try:
        polished = _interruptible(polish)
    except KeyboardInterrupt as interrupt:
        return ended(interrupt, best, explored.trace)
    return fit_at(
        problem,
        polished.theta,
        errors=polished.standard_errors,
        trace=explored.trace,
        steps=polished.steps,
        status="converged" if polished.converged else "not_converged",
        seconds=watch.seconds,
    )


def identify_again(
    fit: Fit,
    tests: tuple[DamperTest, ...],
    *,
    threads: int = 0,
    on_progress: Callable[[Progress], bool | None] | None = None,
) -> Fit:
    """Identify from other tests with the model and the settings of an earlier fit, in lanes.

    Neither the earlier fit nor its starts are started from: these have seen tests that may have been left out.
    """
    settings = replace(fit.settings, starts=(), engine="lanes")
    return identify_with(fit.spec, tests, settings, threads=threads, on_progress=on_progress)


def _was_stopped(interrupt: BaseException | None) -> bool:
    """Whether it was the callback that ended the run, whatever this was turned into since."""
    while interrupt is not None and not isinstance(interrupt, Stopped):
        interrupt = interrupt.__cause__
    return interrupt is not None


def _interruptible(work: Callable[[], T]) -> T:
    """Run `work` where Ctrl-C can reach the caller while compiled code holds no interpreter.

    On an interrupt the work is left behind on its thread; it ends with the process.
    """
    outcome: list[T] = []
    failure: list[BaseException] = []

    def body() -> None:
        try:
            outcome.append(work())
        except BaseException as error:  # handed to the caller's thread, whatever it is
            failure.append(error)

    thread = threading.Thread(target=body, name="mrwork-refinement", daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(_WATCH)
    if failure:
        raise failure[0]
    return outcome[0]
