"""`study.py posterior`: effective draws per second of one posterior, beside emcee on jax and numba, and NUTS."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

from mrwork.errors import SettingError
from studies.speed.bars import Bar
from studies.speed.posterior_job import PosteriorSettings, SamplerRow, Setup
from studies.speed.processes import cores_for, run_worker

_AIM = 5.0
_OURS = "mrwork"
# With fewer there is no effective size, and fewer walkers than twice the dimensions do not fill the space.
_FEWEST_STEPS, _FEWEST_DRAWS, _FEWEST_WALKERS = 20, 10, 18


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorBenchmark:
    """All that one run found; `interrupted` before all were done."""

    rows: tuple[SamplerRow, ...]
    setups: tuple[Setup, ...]
    seconds: float
    interrupted: bool

    @property
    def bars(self) -> tuple[Bar, ...]:
        """Effective draws per second, times those of the best peer, on each number of threads."""
        bars = []
        for threads in dict.fromkeys(row.threads for row in self.rows):
            rows = [row for row in self.rows if row.threads == threads]
            ours = [row.ess_per_second for row in rows if row.sampler == _OURS]
            peers = [row.ess_per_second for row in rows if row.sampler != _OURS]
            bars.append(
                Bar(
                    claim="effective draws per second, times those of the best peer",
                    threads=threads,
                    aim=_AIM,
                    measured=ours[0] / max(peers) if ours and peers else None,
                )
            )
        return tuple(bars)

    def as_dict(self) -> dict[str, Any]:
        """Plain nested dictionaries and lists, ready for JSON."""
        return asdict(self) | {"bars": [asdict(bar) | {"met": bar.met} for bar in self.bars]}


def bench_posterior(
    *,
    steps: int = 2000,
    walkers: int = 64,
    threads: tuple[int, ...] = (1,),
    nuts_draws: int = 100,
    quick: bool = False,
    on_progress: Callable[[str], None] | None = None,
) -> PosteriorBenchmark:
    """Let all sample the same posterior from the same walkers, in turns.

    Each number of threads gets a process of its own, pinned to that many cores. Loading, compiling and choosing the
    fastest variant come first and are not in the seconds. Ctrl-C ends the run; the rows until then are returned.

    Parameters
    ----------
    steps : of each ensemble.
    walkers : of each ensemble, an even number.
    threads : numbers of threads, none above the cores of this machine.
    nuts_draws : draws of NUTS, after as many of warm-up; 0 leaves it out.
    quick : the first variant of each peer that comes.
    on_progress : called with one line of text: what runs.
    """
    few_draws = nuts_draws != 0 and nuts_draws < _FEWEST_DRAWS
    if min(*threads, 1) < 1 or steps < _FEWEST_STEPS or few_draws or walkers < _FEWEST_WALKERS or walkers % 2:
        raise SettingError(
            f"give at least {_FEWEST_STEPS} `steps`, an even number of `walkers` from {_FEWEST_WALKERS}, "
            f"`threads` of 1 or more, and 0 or at least {_FEWEST_DRAWS} `nuts_draws`"
        )
    cores = cores_for(threads)
    settings = PosteriorSettings(
        steps=steps,
        walkers=walkers,
        nuts_warmup=nuts_draws,
        nuts_draws=nuts_draws,
        choose_variant=not quick,
    )
    rows: list[SamplerRow] = []
    setups: list[Setup] = []
    began = time.perf_counter()
    interrupted = False
    try:
        for count in threads:
            arguments = [json.dumps(asdict(settings))]
            for kind, content in run_worker("studies.speed.posterior_worker", cores[:count], arguments):
                if kind == "setup":
                    setups.append(Setup(**content))
                elif kind == "row":
                    rows.append(SamplerRow(**content))
                elif on_progress is not None:
                    on_progress(f"{count} thread(s), {content}")
    except KeyboardInterrupt:
        interrupted = True
    return PosteriorBenchmark(
        rows=tuple(rows),
        setups=tuple(setups),
        seconds=time.perf_counter() - began,
        interrupted=interrupted,
    )


def format_posterior(benchmark: PosteriorBenchmark) -> str:
    """Return the benchmark as aligned text."""
    return "\n".join(_lines(benchmark))


def _lines(benchmark: PosteriorBenchmark) -> Iterator[str]:
    if not benchmark.setups:
        yield "interrupted before anything was measured"
        return
    setup = benchmark.setups[0]
    kind = "SYNTHETIC, the measured record is not here" if setup.synthetic else "measured"
    yield (
        f"posterior of non_symmetric_bouc_wen and its noise, {setup.n_dim} dimensions, on {setup.test} ({kind}), "
        f"{setup.n_time} samples, fit {setup.fit_percent:.2f} %, log-likelihood times {setup.temper:.3f}"
    )
    yield ""
    yield (
        f"{'sampler':<24} {'threads':>7} {'seconds':>8} {'compile':>8} {'ESS':>7} {'ESS/s':>8} {'R-hat':>6} "
        f"{'densities':>9} {'in them':>7}"
    )
    for row in benchmark.rows:
        share = "-" if row.simulating_share is None else f"{row.simulating_share:.0%}"
        yield (
            f"{row.sampler:<24} {row.threads:>7} {row.seconds:>8.1f} {row.compile_seconds:>8.1f} {row.ess_min:>7.0f} "
            f"{row.ess_per_second:>8.2f} {row.rhat:>6.3f} {row.evaluations:>9} {share:>7}"
        )
    yield ""
    yield "ESS is the least bulk one of all parameters, walkers as chains, without the first quarter. Seconds are"
    yield "without loading and compiling."
    yield ""
    for bar in benchmark.bars:
        measured = "no peer" if bar.measured is None else f"{bar.measured:.3g}"
        met = "met" if bar.met else "NOT MET"
        yield f"{met:<8} {bar.claim}, {bar.threads} thread(s): {measured}, aim {bar.aim:g}"
    yield ""
    for row in benchmark.rows:
        yield f"{row.sampler}: {row.settings}"
    missing = sorted({name for each in benchmark.setups for name in each.missing})
    if missing:
        yield f"not installed: {', '.join(missing)}; to compare, run: pip install 'mrwork[bench,nuts]'"
    if benchmark.interrupted:
        yield "interrupted: the rows are those measured until then"
