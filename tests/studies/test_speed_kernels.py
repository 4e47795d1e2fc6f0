"""The benchmark's peers compute what they claim to, and its summary says what was measured."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Literal

import numpy as np
import pytest
from numpy.typing import NDArray

from mrwork.errors import MrworkError, SettingError
from studies.speed.kernels import KernelRow, bench_kernels, summarise
from studies.speed.timing import TimedPeer, fastest_variant, speed_figures
from studies.speed.workload import (
    DT,
    MODEL,
    PowerForm,
    Workload,
    candidates,
    displacement_record,
    measured_force,
)

FORMS: tuple[PowerForm, ...] = ("power", "exp_log", "square")


def a_workload(form: PowerForm) -> Workload:
    # Middle values by averaging: any table will do, all contenders read the same one. Eleven candidates
    # fill no block; 300 samples suffice to bring w to yield (rho x near 3).
    displacement = displacement_record()[:300]
    velocity = np.gradient(displacement, DT)
    signals = np.stack([displacement, velocity], axis=-1)
    stages = np.stack([signals[:-1], 0.5 * (signals[:-1] + signals[1:]), signals[1:]], axis=1)
    theta = candidates(11, general_exponent=form != "square", rng=np.random.default_rng(3))
    return Workload(theta=theta, stages=stages, force=measured_force(displacement), dt=DT)


def reference(workload: Workload) -> NDArray[np.float64]:
    c, k, x0, k_w, rho, sigma, n = workload.theta.T
    dt = workload.dt

    def rate(v: float, w: NDArray[np.float64]) -> NDArray[np.float64]:
        opposing = sigma * abs(v) * np.sign(w) - (sigma - 1.0) * v
        slope: NDArray[np.float64] = rho * (v - np.abs(w) ** n * opposing)
        return slope

    w: NDArray[np.float64] = np.zeros_like(c)
    x, v = workload.stages[0, 0]
    misfit: NDArray[np.float64] = (c * v + k * (x - x0) - workload.force[0]) ** 2
    for ((_, v0), (_, v1), (x2, v2)), measured in zip(workload.stages, workload.force[1:], strict=True):
        k1 = rate(v0, w)
        k2 = rate(v1, w + dt / 2 * k1)
        k3 = rate(v1, w + dt / 2 * k2)
        k4 = rate(v2, w + dt * k3)
        w = w + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        misfit = misfit + (c * v2 + k * (x2 - x0) + k_w * w - measured) ** 2
    return misfit


# Three hundred sums of squares, each with a handful of roundings and a power good to some ulp.
AGREEMENT = 1e-12


# Each pair of values once: every variant is compiled anew. Blocks of 32 are those from which the benchmark starts.
PAIRS = (
    ("power", 1, False),
    ("power", 8, True),
    ("exp_log", 1, True),
    ("exp_log", 8, False),
    ("square", 32, False),
    ("square", 8, True),
)


@pytest.mark.parametrize(("form", "block", "fastmath"), PAIRS)
def test_numba_peer_agrees_with_numpy(form: PowerForm, block: int, fastmath: bool) -> None:
    pytest.importorskip("numba", reason="numba is not installed; pip install 'mrwork[bench]'")
    from studies.speed import numba_peer

    workload = a_workload(form)
    variant = replace(numba_peer.START, block=block, fastmath=fastmath)
    misfit = np.asarray(numba_peer.prepare(workload, form, variant)())
    np.testing.assert_allclose(misfit, reference(workload), rtol=AGREEMENT)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("layout", ["vmap", "arrays"])
@pytest.mark.parametrize(("unroll", "vector_bits"), [(1, 0), (4, 512)])
def test_jax_peer_agrees_with_numpy(
    form: PowerForm, layout: Literal["vmap", "arrays"], unroll: int, vector_bits: int
) -> None:
    pytest.importorskip("jax", reason="jax is not installed; pip install 'mrwork[bench]'")
    from studies.speed import jax_peer

    workload = a_workload(form)
    variant = replace(jax_peer.START, layout=layout, unroll=unroll, vector_bits=vector_bits)
    misfit = np.asarray(jax_peer.prepare(workload, form, variant)())
    np.testing.assert_allclose(misfit, reference(workload), rtol=AGREEMENT)


def test_a_misfit_that_differs_stops_the_benchmark() -> None:
    pytest.importorskip("numba", reason="numba is not installed; pip install 'mrwork[bench]'")
    from studies.speed import numba_peer

    workload = a_workload("square")
    wrong = reference(workload)
    wrong[4] *= 1.0 + 1e-8
    peer = TimedPeer(
        start=numba_peer.START, changes=(), prepare=partial(numba_peer.prepare, workload, "square")
    )
    with pytest.raises(MrworkError, match="agree on every misfit"):
        fastest_variant("numba", peer, wrong)


def test_candidates_yield_and_stay_resolved_by_one_step_per_sample() -> None:
    theta = candidates(1000, general_exponent=True, rng=np.random.default_rng(0))
    displacement = displacement_record()
    rho, sigma, n = theta[:, 4], theta[:, 5], theta[:, 6]
    speed = np.abs(np.gradient(displacement, DT)).max()
    # d w'/d w is at most rho n (2 sigma - 1) |v| while w and v share their sign.
    assert (rho * n * (2.0 * sigma - 1.0) * speed * DT).max() < 0.25
    # Half of the candidates see more travel than it takes to saturate w; the nonlinearity is exercised.
    assert np.mean(rho * np.abs(displacement).max() > 1.0) > 0.5


def a_row(threads: int, ours: float, speeds: dict[str, float]) -> KernelRow:
    return KernelRow(
        model=MODEL,
        batch=64,
        threads=threads,
        general_exponent=True,
        variants=dict.fromkeys(speeds, "as written"),
        **speed_figures({"ours": ours} | speeds, flops_per_step=100.0, fma_peak=1e11),
    )


def test_summary_gives_ratios_peak_fraction_and_thread_scaling() -> None:
    alone = a_row(1, 2e8, {"jax": 1e7, "numba": 2e7})
    both = a_row(2, 3.8e8, {"jax": 2e7, "numba": 4e7})
    benchmark = summarise([alone, both], rounds=7)
    assert benchmark.rows[0].ratio_jax == pytest.approx(20.0)
    assert benchmark.rows[0].ratio_numba == pytest.approx(10.0)
    assert benchmark.peak_fraction == pytest.approx(0.38)
    assert [item.scaling for item in benchmark.thread_scaling] == pytest.approx([1.9])


def test_a_missing_peer_is_null_and_the_table_names_the_extra() -> None:
    benchmark = summarise([a_row(1, 2e8, {"jax": 1e7})], rounds=7)
    assert benchmark.rows[0].numba is None
    assert benchmark.rows[0].ratio_numba is None
    assert "pip install 'mrwork[bench]'" in "\n".join(benchmark.text())


def test_more_threads_than_cores_are_refused() -> None:
    with pytest.raises(SettingError, match="give fewer threads"):
        bench_kernels(threads=(100_000,))
