"""One process of `study.py posterior`: pinned to its cores, it lets every sampler run, in turns.

Run as `python -m studies.speed.posterior_worker CORES SETTINGS` (comma-separated cores, JSON of `PosteriorSettings`) by
`bench_posterior`. It sends `progress` (text), `setup`, `row` (their fields) or `failure` (text).
"""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from typing import Any

import emcee
import numpy as np

from mrwork.errors import MrworkError
from mrwork.uncertainty import Ensemble, convergence, select_kept_rows
from studies.speed.posterior_jax import JAX_VARIANTS, JaxTarget
from studies.speed.posterior_job import PosteriorJob, PosteriorSettings, Rows, SamplerRow, Setup
from studies.speed.processes import send, serve

# Number of turns in which each chain is advanced, so that the load of the machine affects all alike.
_TURNS = 10
# Densities that the contenders and we compute may differ by rounding, and by the rounding of another power function.
_AGREEMENT = 1e-6


@dataclass(slots=True, kw_only=True, eq=False)
class _Contender:
    """An ensemble on one implementation of the density; `advance` takes steps and returns the chain so far."""

    name: str
    settings: str
    compile_seconds: float
    advance: Callable[[int], Rows]
    clock: _Clock
    seconds: float = 0.0
    chain: Rows = field(default_factory=lambda: np.empty(0))


@dataclass(slots=True, kw_only=True, eq=False)
class _Clock:
    """A density that counts its evaluations and their time."""

    density: Callable[[Rows], Rows]
    seconds: float = 0.0
    evaluations: int = 0

    def __call__(self, position: Rows) -> Rows:
        began = time.perf_counter()
        found = self.density(position)
        self.seconds += time.perf_counter() - began
        self.evaluations += len(position)
        return found


def main() -> None:
    """Let everyone sample on the cores that the command line gives."""
    serve(PosteriorSettings, measure)


def measure(settings: PosteriorSettings, threads: int) -> None:
    """All samplers on one number of threads."""
    send("progress", "fitting the reference test")
    job = PosteriorJob.of(threads=threads, n_walkers=settings.walkers)
    missing = [name for name in ("numba", "numpyro") if importlib.util.find_spec(name) is None]
    setup = Setup(
        test=job.search.test.name,
        synthetic=job.search.test.synthetic,
        n_time=job.search.test.n_time,
        n_dim=job.target.space.n_dim,
        fit_percent=100.0 * (1.0 - float(job.search.objective(job.start[None])[0])),
        temper=job.target.temper,
        threads=threads,
        missing=tuple(missing),
    )
    send("setup", asdict(setup))
    everyone = [_ours(job), *_on_jax(job, settings)]
    if "numba" not in missing:
        everyone += _on_numba(job, settings, threads)
    for turn in range(_TURNS):
        steps = settings.steps * (turn + 1) // _TURNS - settings.steps * turn // _TURNS
        first = turn % len(everyone)
        for contender in everyone[first:] + everyone[:first]:
            send("progress", f"turn {turn + 1} of {_TURNS}: {contender.name}")
            began = time.perf_counter()
            contender.chain = contender.advance(steps)
            contender.seconds += time.perf_counter() - began
    for contender in everyone:
        send("row", asdict(_row(contender, job, settings, threads)))
    if "numpyro" not in missing and settings.nuts_draws:
        send("row", asdict(_nuts(job, settings, threads)))


def _ours(job: PosteriorJob) -> _Contender:
    return _contender("mrwork", "de", job.target, 0.0, "Rust core", job)


def _on_jax(job: PosteriorJob, settings: PosteriorSettings) -> list[_Contender]:
    """The fastest layout of the twin on half and whole ensembles, with the seconds that its own compiling took."""
    half = job.walkers[: len(job.walkers) // 2]
    expected = job.target(half)
    best: tuple[float, float, JaxTarget, str] | None = None
    for variant in JAX_VARIANTS if settings.choose_variant else JAX_VARIANTS[2:3]:
        send("progress", f"compiling the twin: {variant.describe()}")
        density = JaxTarget.of(job, variant)
        compiling, found = _timed(density, half)
        # Stretch moves ask for halves, ours for the whole, which is another shape.
        compiling += _timed(density, job.walkers)[0]
        _agree("jax", found, expected, job)
        each = min(_timed(density, half)[0] + _timed(density, job.walkers)[0] for _ in range(5))
        if best is None or each < best[0]:
            best = each, compiling, density, variant.describe()
    assert best is not None
    _, compiling, density, described = best
    return [_contender(f"emcee on jax, {kind}", kind, density, compiling, described, job) for kind in _WORDS]


def _on_numba(job: PosteriorJob, settings: PosteriorSettings, threads: int) -> list[_Contender]:
    from studies.speed.identify_worker import fastest_numba
    from studies.speed.numba_objective import NumbaObjective
    from studies.speed.posterior_numba import NumbaTarget

    send("progress", "choosing the fastest numba")
    objective, described, compiling = fastest_numba(job.search, threads, choose=settings.choose_variant)
    if not isinstance(objective, NumbaObjective):
        raise MrworkError("the numba objective was expected from its own choice; report this")
    density = NumbaTarget(target=job.target, objective=objective)
    half = job.walkers[: len(job.walkers) // 2]
    _agree("numba", density(half), job.target(half), job)
    return [
        _contender(f"emcee on numba, {kind}", kind, density, compiling, described, job) for kind in _WORDS
    ]


_WORDS = {
    "de": "our move, differences of the past",
    "stretch": "the stretch move, emcee's default",
}


def _contender(
    name: str,
    kind: str,
    density: Callable[[Rows], Rows],
    compiling: float,
    described: str,
    job: PosteriorJob,
) -> _Contender:
    """An ensemble with our move, as `mrwork.sample` runs it, or with emcee's default, as emcee runs it."""
    clock = _Clock(density=density)
    advance = _with_ours(job, clock) if kind == "de" else _with_stretch(job, clock)
    return _Contender(
        name=name,
        settings=f"{_WORDS[kind]}; {described}",
        compile_seconds=compiling,
        advance=advance,
        clock=clock,
    )


def _with_ours(job: PosteriorJob, clock: _Clock) -> Callable[[int], Rows]:
    ensemble = Ensemble.begin(clock, job.walkers, rng=1)

    def advance(steps: int) -> Rows:
        ensemble.advance(ensemble.n_steps + steps, lambda _: None)
        return ensemble.positions

    return advance


def _with_stretch(job: PosteriorJob, clock: _Clock) -> Callable[[int], Rows]:
    np.random.seed(1)  # noqa: NPY002 # emcee's stream begins where NumPy's stands
    sampler = emcee.EnsembleSampler(*job.walkers.shape, clock, vectorize=True)
    state: list[Any] = [job.walkers]

    def advance(steps: int) -> Rows:
        state[0] = sampler.run_mcmc(state[0], steps, skip_initial_state_check=True)
        return np.concatenate([job.walkers[None], sampler.get_chain()])

    return advance


def _row(contender: _Contender, job: PosteriorJob, settings: PosteriorSettings, threads: int) -> SamplerRow:
    rows = select_kept_rows(settings.steps)
    values, _ = job.target.space.values(contender.chain[rows])
    free = np.array(job.target.space.box.free)
    ess, rhat = _told(np.moveaxis(values[..., free], 0, 1))
    return SamplerRow(
        sampler=contender.name,
        threads=threads,
        seconds=contender.seconds,
        compile_seconds=contender.compile_seconds,
        ess_min=ess,
        ess_per_second=ess / contender.seconds,
        rhat=rhat,
        evaluations=contender.clock.evaluations,
        simulating_share=contender.clock.seconds / contender.seconds,
        settings=f"{settings.walkers} walkers, {settings.steps} steps; {contender.settings}",
    )


def _nuts(job: PosteriorJob, settings: PosteriorSettings, threads: int) -> SamplerRow:
    """NUTS twice, with two seeds: what the first run took longer than the second was compiling."""
    from mrwork.uncertainty import nuts_of

    sample = nuts_of(job.target, job.start, warmup=settings.nuts_warmup, draws=settings.nuts_draws, chains=1)
    took = []
    for seed in (1, 2):
        send("progress", f"NUTS: {settings.nuts_warmup} + {settings.nuts_draws} draws, seed {seed}")
        began = time.perf_counter()
        found = sample(seed)
        took.append(time.perf_counter() - began)
    seconds = took[1]
    compiling = max(took[0] - took[1], 0.0)
    ess, rhat = _told(found.values[..., np.array(job.target.space.box.free)])
    return SamplerRow(
        sampler="numpyro NUTS",
        threads=threads,
        seconds=seconds,
        compile_seconds=compiling,
        ess_min=ess,
        ess_per_second=ess / seconds,
        rhat=rhat,
        evaluations=found.evaluations,
        simulating_share=None,
        settings=f"{settings.nuts_warmup} + {settings.nuts_draws} draws, dense mass, forward derivatives of the twin; "
        f"{found.diverged} diverged; gradients of the draws alone are counted",
    )


def _told(chains: Rows) -> tuple[float, float]:
    """Least bulk ESS and largest R-hat of chains, (n_chains, n_draws, n_params)."""
    found = [convergence(np.ascontiguousarray(chains[..., index])) for index in range(chains.shape[-1])]
    return min(each.ess_bulk for each in found), max(each.rhat for each in found)


def _timed(density: Callable[[Rows], Rows], position: Rows) -> tuple[float, Rows]:
    began = time.perf_counter()
    found = density(position)
    return time.perf_counter() - began, found


def _agree(name: str, found: Rows, expected: Rows, job: PosteriorJob) -> None:
    """Compare those walkers that take the sub-steps of the start; the twin has no others."""
    values, _ = job.target.space.values(job.walkers[: len(found)])
    (run,) = job.search.objective.misfits(np.ascontiguousarray(values[:, : job.target.space.n_params]))
    (start,) = job.search.objective.misfits(job.start[None])
    same = run.substeps == start.substeps[0]
    difference = float(np.max(np.abs(found[same] / expected[same] - 1.0), initial=0.0))
    if not difference <= _AGREEMENT:
        raise MrworkError(
            f"{name} and the compiled kernel were expected to agree on every density to {_AGREEMENT:g}, they differ by "
            f"{difference:.2e} (relative); do not trust the speeds, find which one is wrong"
        )


if __name__ == "__main__":
    main()
