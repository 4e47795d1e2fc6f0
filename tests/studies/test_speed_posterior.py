"""The samplers of the benchmark have the same target, and its summary says what was measured."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest

from mrwork.errors import SettingError
from studies.speed.posterior import PosteriorBenchmark, SamplerRow, Setup, bars_of, bench_posterior
from studies.speed.posterior_job import PosteriorJob, density_of


@pytest.fixture(scope="module")
def job() -> PosteriorJob:
    return PosteriorJob.of(threads=1, n_walkers=20)


def test_the_job_has_nine_dimensions_and_walkers_inside(job: PosteriorJob) -> None:
    assert job.walkers.shape == (20, 9)
    assert np.isfinite(job.target(job.walkers)).all()


def test_the_density_on_jax_is_ours(job: PosteriorJob) -> None:
    from studies.speed.jax_peer import JaxVariant
    from studies.speed.posterior_jax import density_on_twin

    values, _ = job.target.space.values(job.walkers)
    theta = np.stack([job.start, *values[:, : job.target.space.n_params]])
    (run,) = job.target.objective.misfits(theta)
    same = run.substeps[1:] == run.substeps[0]
    assert sum(same) > 3
    walkers = job.walkers.copy()
    walkers[0, 0] = 1.5
    density = density_on_twin(job, JaxVariant(layout="arrays", unroll=2))(walkers)
    assert np.isneginf(density[0])
    same[0] = False
    np.testing.assert_allclose(density[same], job.target(walkers)[same], rtol=1e-8)


def test_the_density_on_numba_is_ours(job: PosteriorJob) -> None:
    pytest.importorskip("numba", reason="numba is not installed; pip install 'mrwork[bench]'")
    from studies.speed.numba_objective import START, NumbaObjective

    density = density_of(job.target, NumbaObjective(job.search.objective, START))
    walkers = job.walkers.copy()
    walkers[1, 2] = -0.5
    np.testing.assert_allclose(density(walkers), job.target(walkers), rtol=1e-9)


def row(sampler: str, ess_per_second: float) -> SamplerRow:
    return SamplerRow(
        sampler=sampler,
        threads=1,
        seconds=2.0,
        compile_seconds=1.0,
        ess_min=2.0 * ess_per_second,
        ess_per_second=ess_per_second,
        rhat=1.01,
        evaluations=128_000,
        simulating_share=None,
        settings="made up",
    )


def test_the_bar_is_against_the_best_peer() -> None:
    setup = Setup(
        test="made up",
        synthetic=True,
        n_time=2000,
        n_dim=9,
        fit_percent=97.0,
        temper=0.1,
        threads=1,
        missing=("numpyro",),
    )
    rows = (row("mrwork", 100.0), row("emcee on jax, de", 25.0), row("emcee on numba, de", 5.0))
    benchmark = PosteriorBenchmark(
        rows=rows, setups=(setup,), bars=bars_of(rows), seconds=9.0, interrupted=False
    )
    (bar,) = benchmark.bars
    assert bar.measured == 4.0
    assert not bar.met
    text = "\n".join(benchmark.text())
    assert "NOT MET" in text
    assert "SYNTHETIC" in text
    assert "not installed: numpyro" in text
    assert set(asdict(benchmark)["rows"][0]) >= {
        "sampler",
        "seconds",
        "compile_seconds",
        "ess_min",
        "ess_per_second",
    }


def test_impossible_numbers_are_refused() -> None:
    for settings in ({"steps": 5}, {"walkers": 19}, {"threads": (0,)}, {"nuts_draws": -1}):
        with pytest.raises(SettingError, match="give at least 20 `steps`"):
            bench_posterior(**settings)
