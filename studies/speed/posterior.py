"""`study.py posterior`: effective draws per second of one posterior, beside emcee on jax and numba, and NUTS."""

from __future__ import annotations

import importlib.util
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import numpy as np

from mrwork.errors import SettingError
from mrwork.uncertainty import Ensemble, convergence, select_kept_rows
from studies.former.arrays import Floats
from studies.former.table import table_of
from studies.speed.posterior_job import Density, PosteriorJob, density_of
from studies.speed.timing import require_agreement, rotated, timed
from studies.speed.workers import (
    Bar,
    InterruptibleBenchmark,
    Say,
    cores_for,
    ratio_bar,
    record_kind,
    rows_until_interrupted,
    silent,
)

_AIM = 5.0
_OURS = "mrwork"
# With fewer there is no effective size, and fewer walkers than twice the dimensions do not fill the space.
_FEWEST_STEPS, _FEWEST_DRAWS, _FEWEST_WALKERS = 20, 10, 18
# Number of turns in which each chain is advanced, so that the load of the machine affects all alike.
_TURNS = 10
# Densities that the contenders and we compute may differ by rounding, and by the rounding of another power function.
_AGREEMENT = 1e-6
_MOVES = {
    "de": "our move, differences of the past",
    "stretch": "the stretch move, emcee's default",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Values measured before the turns began; `missing` libraries are left out."""

    test: str
    synthetic: bool
    n_time: int
    n_dim: int
    fit_percent: float
    temper: float
    threads: int
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplerRow:
    """One sampler: `seconds` without `compile_seconds`; the least bulk ESS of all parameters, after the burn-in.

    `simulating_share` is the part of the seconds spent in densities; those of NUTS have no such part.
    """

    sampler: str
    threads: int
    seconds: float
    compile_seconds: float
    ess_min: float
    ess_per_second: float
    rhat: float
    evaluations: int
    simulating_share: float | None
    settings: str


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorBenchmark(InterruptibleBenchmark):
    """All that one run found; `interrupted` before all were done."""

    rows: tuple[SamplerRow, ...]
    setups: tuple[Setup, ...]

    def text(self) -> Iterator[str]:
        """Effective draws per second of each sampler, and the aims."""
        if not self.setups:
            yield "interrupted before anything was measured"
            return
        setup = self.setups[0]
        kind = record_kind(synthetic=setup.synthetic)
        yield (
            f"posterior of non_symmetric_bouc_wen and its noise, {setup.n_dim} dimensions, on {setup.test} ({kind}), "
            f"{setup.n_time} samples, fit {setup.fit_percent:.2f} %, log-likelihood times {setup.temper:.3f}"
        )
        yield ""
        yield from table_of(
            "",
            "sampler",
            ((row.sampler, asdict(row)) for row in self.rows),
            {
                "threads": "{threads}",
                "seconds": "{seconds:.1f}",
                "compile": "{compile_seconds:.1f}",
                "ESS": "{ess_min:.0f}",
                "ESS/s": "{ess_per_second:.2f}",
                "R-hat": "{rhat:.3f}",
                "densities": "{evaluations}",
                "in them": lambda row: (
                    "-" if row["simulating_share"] is None else f"{row['simulating_share']:.0%}"
                ),
            },
        ).lines()
        yield ""
        yield "ESS is the least bulk one of all parameters, walkers as chains, without the first quarter. Seconds are"
        yield "without loading and compiling."
        yield ""
        yield from map(str, self.bars)
        yield ""
        for row in self.rows:
            yield f"{row.sampler}: {row.settings}"
        missing = sorted({name for setup in self.setups for name in setup.missing})
        if missing:
            yield f"not installed: {', '.join(missing)}; to compare, run: pip install 'mrwork[bench,nuts]'"
        if self.interrupted:
            yield "interrupted: the rows are those measured until then"


def bench_posterior(
    *,
    steps: int = 2000,
    walkers: int = 64,
    threads: Sequence[int] = (1,),
    nuts_draws: int = 100,
    quick: bool = False,
    say: Say = silent,
) -> PosteriorBenchmark:
    """Let all sample the same posterior from the same walkers, in turns.

    Each number of threads gets a process of its own, pinned to that many cores. Loading, compiling and choosing the
    fastest variant come first and are not in the seconds. Ctrl-C ends the run; the rows until then are returned.
    """
    few_draws = nuts_draws != 0 and nuts_draws < _FEWEST_DRAWS
    if min(*threads, 1) < 1 or steps < _FEWEST_STEPS or few_draws or walkers < _FEWEST_WALKERS or walkers % 2:
        raise SettingError(
            f"give at least {_FEWEST_STEPS} `steps`, an even number of `walkers` from {_FEWEST_WALKERS}, "
            f"`threads` of 1 or more, and 0 or at least {_FEWEST_DRAWS} `nuts_draws`"
        )
    cores = cores_for(threads)
    settings = {"steps": steps, "walkers": walkers, "nuts_draws": nuts_draws, "choose_variant": not quick}
    began = time.perf_counter()
    by_threads, interrupted = rows_until_interrupted(measure, dict.fromkeys(threads, settings), cores, say)
    received = [row for rows in by_threads.values() for row in rows]
    rows = tuple(row for row in received if isinstance(row, SamplerRow))
    return PosteriorBenchmark(
        rows=rows,
        setups=tuple(row for row in received if isinstance(row, Setup)),
        bars=bars_of(rows),
        seconds=time.perf_counter() - began,
        interrupted=interrupted,
    )


def bars_of(rows: Sequence[SamplerRow]) -> tuple[Bar, ...]:
    """Effective draws per second, times those of the best peer, on each number of threads."""

    def best(threads: int, *, ours: bool) -> float | None:
        speeds = (
            row.ess_per_second for row in rows if row.threads == threads and (row.sampler == _OURS) is ours
        )
        return max(speeds, default=None)

    return tuple(
        ratio_bar(
            "effective draws per second, times those of the best peer",
            threads,
            _AIM,
            best(threads, ours=True),
            best(threads, ours=False),
        )
        for threads in dict.fromkeys(row.threads for row in rows)
    )


class _Contender:
    """An ensemble on one implementation of the density, whose evaluations and their time are counted.

    Its move is ours, as `mrwork.sample` runs it, or emcee's default, as emcee runs it.
    """

    def __init__(
        self, name: str, move: str, density: Density, compiling: float, described: str, job: PosteriorJob
    ) -> None:
        self.name, self.compile_seconds = name, compiling
        self.settings = f"{_MOVES[move]}; {described}"
        self.evaluations, self.simulating, self.seconds = 0, 0.0, 0.0
        self.chain = job.walkers[None]
        self._density = density
        self._advance = _with_ours(job, self._counted) if move == "de" else _with_stretch(job, self._counted)

    def _counted(self, position: Floats) -> Floats:
        result, seconds = timed(partial(self._density, position))
        self.simulating += seconds
        self.evaluations += len(position)
        return result

    def advance(self, steps: int) -> None:
        """Take steps, which make the chain longer."""
        self.chain, seconds = timed(partial(self._advance, steps))
        self.seconds += seconds


def measure(
    *, threads: int, steps: int, walkers: int, nuts_draws: int, choose_variant: bool
) -> Iterator[Setup | SamplerRow | str]:
    """All samplers on one number of threads."""
    yield "fitting the reference test"
    job = PosteriorJob.of(threads=threads, n_walkers=walkers)
    missing = [name for name in ("numba", "numpyro") if importlib.util.find_spec(name) is None]
    yield Setup(
        test=job.search.test.name,
        synthetic=job.search.test.synthetic,
        n_time=job.search.test.n_time,
        n_dim=job.target.space.n_dim,
        fit_percent=100.0 * (1.0 - float(job.search.objective(job.start[None])[0])),
        temper=job.target.temper,
        threads=threads,
        missing=tuple(missing),
    )
    everyone = [_Contender(_OURS, "de", job.target, 0.0, "Rust core", job)]
    for name, find_fastest in (("jax", _fastest_jax), ("numba", _fastest_numba)):
        if name not in missing:
            yield f"choosing the fastest {name}"
            density, compiling, described = find_fastest(job, threads, choose=choose_variant)
            everyone += [
                _Contender(f"emcee on {name}, {move}", move, density, compiling, described, job)
                for move in _MOVES
            ]
    for turn in range(_TURNS):
        share = steps * (turn + 1) // _TURNS - steps * turn // _TURNS
        for contender in rotated(everyone, turn):
            yield f"turn {turn + 1} of {_TURNS}: {contender.name}"
            contender.advance(share)
    for contender in everyone:
        yield _row(contender, job, steps, threads)
    if "numpyro" not in missing and nuts_draws:
        yield f"NUTS: {nuts_draws} + {nuts_draws} draws, twice"
        yield _nuts(job, nuts_draws, threads)


def _fastest_jax(job: PosteriorJob, threads: int, *, choose: bool) -> tuple[Density, float, str]:
    """The fastest layout of the twin on half and whole ensembles, with the seconds that its own compiling took."""
    from studies.speed.posterior_jax import VARIANTS, density_on_twin

    half = job.walkers[: len(job.walkers) // 2]
    expected = job.target(half)

    # Stretch moves ask for halves, ours for the whole, which is another shape.
    def both(density: Density) -> tuple[Floats, Floats]:
        return density(half), density(job.walkers)

    choices: list[tuple[float, float, Density, str]] = []
    for variant in VARIANTS if choose else VARIANTS[1:2]:
        density = density_on_twin(job, variant)
        (values, _), compiling = timed(partial(both, density))
        _agree("jax", values, expected, job)
        seconds = min(timed(partial(both, density))[1] for _ in range(5))
        choices.append((seconds, compiling, density, variant.describe()))
    _, compiling, density, described = min(choices, key=lambda choice: choice[0])
    return density, compiling, f"jit, {described}"


def _fastest_numba(job: PosteriorJob, threads: int, *, choose: bool) -> tuple[Density, float, str]:
    from studies.speed.numba_objective import fastest_numba

    objective, described, compiling = fastest_numba(job.search, threads, choose=choose)
    density = density_of(job.target, objective)
    half = job.walkers[: len(job.walkers) // 2]
    _agree("numba", density(half), job.target(half), job)
    return density, compiling, described


def _with_ours(job: PosteriorJob, density: Density) -> Callable[[int], Floats]:
    ensemble = Ensemble.begin(density, job.walkers, rng=1)

    def advance(steps: int) -> Floats:
        ensemble.advance(ensemble.n_steps + steps, lambda _: None)
        return ensemble.positions

    return advance


def _with_stretch(job: PosteriorJob, density: Density) -> Callable[[int], Floats]:
    import emcee

    np.random.seed(1)  # noqa: NPY002 # emcee's stream begins where NumPy's stands
    sampler = emcee.EnsembleSampler(*job.walkers.shape, density, vectorize=True)
    state: list[Any] = [job.walkers]

    def advance(steps: int) -> Floats:
        state[0] = sampler.run_mcmc(state[0], steps, skip_initial_state_check=True)
        return np.concatenate([job.walkers[None], sampler.get_chain()])

    return advance


def _row(contender: _Contender, job: PosteriorJob, steps: int, threads: int) -> SamplerRow:
    space = job.target.space
    values, _ = space.values(contender.chain[select_kept_rows(steps)])
    ess, rhat = _mixing(np.moveaxis(values[..., np.array(space.box.free)], 0, 1))
    return SamplerRow(
        sampler=contender.name,
        threads=threads,
        seconds=contender.seconds,
        compile_seconds=contender.compile_seconds,
        ess_min=ess,
        ess_per_second=ess / contender.seconds,
        rhat=rhat,
        evaluations=contender.evaluations,
        simulating_share=contender.simulating / contender.seconds,
        settings=f"{len(job.walkers)} walkers, {steps} steps; {contender.settings}",
    )


def _nuts(job: PosteriorJob, draws: int, threads: int) -> SamplerRow:
    """NUTS twice, with two seeds: what the first run took longer than the second was compiling."""
    from mrwork.uncertainty import nuts_of

    sample = nuts_of(job.target, job.start, warmup=draws, draws=draws, chains=1)
    _, first = timed(lambda: sample(1))
    result, seconds = timed(lambda: sample(2))
    ess, rhat = _mixing(result.values[..., np.array(job.target.space.box.free)])
    return SamplerRow(
        sampler="numpyro NUTS",
        threads=threads,
        seconds=seconds,
        compile_seconds=max(first - seconds, 0.0),
        ess_min=ess,
        ess_per_second=ess / seconds,
        rhat=rhat,
        evaluations=result.evaluations,
        simulating_share=None,
        settings=f"{draws} + {draws} draws, dense mass, derivatives of our kernel; "
        f"{result.diverged} diverged; gradients of the draws alone are counted",
    )


def _mixing(chains: Floats) -> tuple[float, float]:
    """Least bulk ESS and largest R-hat of chains, (n_chains, n_draws, n_params)."""
    judged = [convergence(np.ascontiguousarray(chains[..., index])) for index in range(chains.shape[-1])]
    return min(verdict.ess_bulk for verdict in judged), max(verdict.rhat for verdict in judged)


def _agree(name: str, values: Floats, expected: Floats, job: PosteriorJob) -> None:
    """Compare those walkers that take the sub-steps of the start; the twin has no others."""
    theta, _ = job.target.space.values(job.walkers[: len(values)])
    (run,) = job.search.objective.misfits(np.ascontiguousarray(theta[:, : job.target.space.n_params]))
    (start,) = job.search.objective.misfits(job.start[None])
    same = run.substeps == start.substeps[0]
    difference = float(np.max(np.abs(values[same] / expected[same] - 1.0), initial=0.0))
    require_agreement(f"{name} and the compiled kernel", "density", difference, _AGREEMENT)
