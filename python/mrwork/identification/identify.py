"""Identify a damper model from tests: explore with a search, refine on the twin, judge the result."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError, SimulationError
from mrwork.identification.equivalent import Form, identifiable_form
from mrwork.identification.estimate import estimates_of
from mrwork.identification.explore import search_box
from mrwork.identification.fit import ErrorNorms, Fit, FitQuality, FitStatus, SearchTrace
from mrwork.identification.objective import Objective
from mrwork.identification.provenance import provenance_of
from mrwork.identification.quality import fit_quality
from mrwork.records import DamperTest
from mrwork.search import EfficientGA, GAState, SearchInterrupted, SearchResult, run_search
from mrwork.search.loop import GenerationEvent
from mrwork.simulate import Outcome, simulate_forces
from mrwork.spec import DamperSpec, damper

if TYPE_CHECKING:
    from mrwork.identification.refine import Refined
    from mrwork.identification.screen import Screened

_STARTS = 16
# How often a wait looks for Ctrl-C [s].
_WATCH = 0.05

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """Where an identification stands; `share` is the part of the stage's allowance that is used up."""

    stage: Literal["search", "screening", "refinement"]
    count: int
    unit: Literal["simulations", "%", "steps"]
    fit_percent: float
    share: float
    seconds: float


class IdentificationInterrupted(KeyboardInterrupt):
    """Ctrl-C during an identification; `fit` is the best found so far."""

    def __init__(self, fit: Fit) -> None:
        super().__init__("identification interrupted")
        self.fit = fit


def identify(
    model: DamperSpec | str,
    tests: DamperTest | Sequence[DamperTest],
    *,
    search: EfficientGA | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    rng: int = 0,
    threads: int = 0,
    on_progress: Callable[[Progress], None] | None = None,
) -> Fit:
    """Identify one damper model from one or several tests of the same damper.

    Parameters
    ----------
    model
        A model or its name.
    tests
        One test or several; each weighs the same, whatever its length and force.
    search
        Settings of the genetic search; default `EfficientGA()`.
    bounds
        Parameter name to (lower, upper); equal bounds hold it fixed. Others have their admissible range.
    rng
        Seed of the search. The same seed gives the same bits on any number of threads.
    threads
        Threads of the simulation, 0 for all.
    on_progress
        Called after every generation and every refinement step.

    Returns
    -------
    Fit
        Parameters with standard errors, quality per test, search trace, provenance.

    Raises
    ------
    SettingError
        Where a bound is impossible.
    SimulationError
        Where no candidate at all could be simulated.
    IdentificationInterrupted
        On Ctrl-C, carrying the best found so far.

    Examples
    --------
    >>> import mrwork as mr
    >>> fit = mr.identify("normalised_bouc_wen", mr.read_damper_test("rig/10mm1Hz0x5A.csv"))  # doctest: +SKIP
    >>> fit.fit_percent  # doctest: +SKIP
    92.08
    """
    began = time.perf_counter()
    spec = damper(model) if isinstance(model, str) else model
    tests = (tests,) if isinstance(tests, DamperTest) else tuple(tests)
    search = search or EfficientGA()
    bounds = dict(bounds or {})
    form = identifiable_form(spec, bounds)
    objective = Objective.of(form.spec, tests, threads=threads)
    if not form.box.free:
        raise SettingError(f"every parameter of {spec.name} is fixed; leave at least one free")
    run = _Run(spec=spec, form=form, objective=objective, search=search, bounds=bounds, rng=rng, began=began)
    box = search_box(form.spec, form.box, tests)

    def on_generation(event: GenerationEvent[GAState]) -> None:
        if on_progress is not None:
            share = event.generation / search.max_generations
            on_progress(run.progress("search", event.evaluations, "simulations", event.best_misfit, share))

    try:
        found = run_search(
            search,
            lambda unit: objective(np.asarray(box.theta_from_unit(unit))),
            rng=rng,
            n_params=len(box.free),
            on_generation=on_generation,
        )
    except SearchInterrupted as interrupt:
        result = interrupt.result
        if not np.isfinite(result.best_misfit):
            raise
        theta = np.asarray(box.theta_from_unit(result.best_unit))
        raise IdentificationInterrupted(run.fit(theta, None, result, 0, "interrupted")) from interrupt
    if len(found.elite) == 0:
        raise SimulationError(
            f"none of {found.evaluations} candidates of {spec.name} could be simulated on these tests; "
            "check the units of the record, or narrow the bounds"
        )
    starts = np.asarray(box.theta_from_unit(found.elite[:_STARTS]))
    best = starts[0]

    def on_start(screened: Screened, share: float) -> None:
        nonlocal best
        best = screened.theta
        if on_progress is not None:
            on_progress(run.progress("screening", round(share * 100), "%", screened.misfit, share))

    def on_step(steps: int, misfit: float) -> None:
        if on_progress is not None:
            on_progress(run.progress("refinement", steps, "steps", misfit, 0.0))

    def polish() -> tuple[Refined, NDArray[np.float64]]:
        # SciPy's optimisers and JAX are slow to load and needed from here on only.
        from mrwork.identification.refine import refine
        from mrwork.identification.screen import best_few
        from mrwork.identification.standard_error import standard_errors

        finalists = best_few(objective, form.box, box, starts, mirrored=form.mirrored, on_start=on_start)
        refined = min(
            (refine(objective, form.box, each.theta, on_step=on_step) for each in finalists),
            key=lambda refined: refined.misfit,
        )
        return refined, standard_errors(objective, form, refined.theta, refined.misfit)

    try:
        refined, errors = _interruptible(polish)
    except KeyboardInterrupt as interrupt:
        raise IdentificationInterrupted(run.fit(best, None, found, 0, "interrupted")) from interrupt
    status: FitStatus = "converged" if refined.converged else "not_converged"
    return run.fit(refined.theta, errors, found, refined.steps, status)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Run:
    """What stays the same from the first candidate to the result."""

    spec: DamperSpec
    form: Form
    objective: Objective
    search: EfficientGA
    bounds: dict[str, tuple[float, float]]
    rng: int
    began: float

    def progress(
        self,
        stage: Literal["search", "screening", "refinement"],
        count: int,
        unit: Literal["simulations", "%", "steps"],
        misfit: float,
        share: float,
    ) -> Progress:
        return Progress(
            stage=stage,
            count=count,
            unit=unit,
            fit_percent=100.0 * (1.0 - misfit),
            share=share,
            seconds=time.perf_counter() - self.began,
        )

    def fit(
        self,
        theta: NDArray[np.float64],
        errors: NDArray[np.float64] | None,
        found: SearchResult[GAState],
        steps: int,
        status: FitStatus,
    ) -> Fit:
        values = np.asarray(self.form.back(theta))
        tests = self.objective.tests
        quality = tuple(judge(self.spec, values, test)[1] for test in tests)
        nrmse = _rms([each.nrmse for each in quality])
        return Fit(
            model=self.spec.name,
            estimates=estimates_of(self.spec, self.form, theta, errors, self.bounds),
            status=status,
            stop_reason=found.stop_reason,
            nrmse=nrmse,
            fit_percent=100.0 * (1.0 - nrmse),
            rmse_n=_rms([each.rmse_n for each in quality]),
            error_norms=ErrorNorms(
                time=_rms([each.error_norms.time for each in quality]),
                displacement=_rms([each.error_norms.displacement for each in quality]),
                velocity=_rms([each.error_norms.velocity for each in quality]),
            ),
            quality=quality,
            trace=SearchTrace(
                evaluations=tuple(found.trace.evaluations.tolist()),
                best=tuple(found.trace.best.tolist()),
                median=tuple(found.trace.median.tolist()),
                stop_reason=found.stop_reason,
            ),
            evaluations=self.objective.tally.simulations,
            refinement_steps=steps,
            seconds=time.perf_counter() - self.began,
            n_time=sum(each.n_time for each in quality),
            provenance=provenance_of(tests, search=self.search, bounds=self.bounds, rng=self.rng),
        )


def judge(
    spec: DamperSpec, theta: NDArray[np.float64], test: DamperTest, *, substep_factor: int = 1
) -> tuple[NDArray[np.float64], FitQuality]:
    """Free-run a model on a test: its force [N], shape (n_time,), and how it compares.

    Raises
    ------
    SimulationError
        Where the simulation diverges or cannot be resolved.
    """
    history = Objective.of(spec, (test,)).histories[0]
    result = simulate_forces(spec, theta[None], history, substep_factor=substep_factor)
    outcome = Outcome(result.outcome[0])
    if outcome is not Outcome.FINISHED:
        raise SimulationError(f"{spec.name} on {test.name} ended as {outcome.name.lower()}: {outcome.remedy}")
    force = result.force[0]
    return force, fit_quality(test, force, substeps=int(result.substeps[0]))


def _rms(values: Sequence[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


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
