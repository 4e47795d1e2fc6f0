"""Every model is timed against a twin that computes the same, on a batch that one step per sample resolves."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from mrwork.dampers import DamperSpec, damper, damper_models
from mrwork.errors import MrworkError, SettingError, UnknownNameError
from studies.speed.command_line import main
from studies.speed.jax_peer import JaxVariant
from studies.speed.models import ModelBenchmark, ModelRow, bench_models, measured
from studies.speed.timing import AGREEMENT, speed_figures
from studies.speed.twin_peer import prepare, twins_of
from studies.speed.workload import SUBSTEPS, ModelWorkload, model_workload

# Eleven candidates fill no block; sixty samples are enough for every term of a rate to count.
BATCH, SAMPLES = 11, 60

LAYOUTS = [
    JaxVariant(layout="simulate"),
    JaxVariant(layout="vmap", unroll=2, vector_bits=512),
    JaxVariant(layout="arrays", unroll=4),
]


@pytest.mark.parametrize("spec", damper_models(), ids=lambda spec: spec.name)
def test_one_step_per_sample_resolves_every_candidate(spec: DamperSpec) -> None:
    workload = model_workload(spec, BATCH, SAMPLES)
    misfit, outcome, substeps = workload.misfits(threads=1)
    assert np.isfinite(misfit).all()
    assert not outcome.any()
    assert (substeps == SUBSTEPS).all()
    # Candidates that are all alike would let a peer compute one of them.
    assert len(np.unique(misfit)) == BATCH


@pytest.mark.parametrize("variant", LAYOUTS, ids=lambda variant: variant.layout)
@pytest.mark.parametrize("name", ["static_hysteretic", "normalised_bouc_wen"])
def test_every_layout_of_the_twin_agrees_with_our_kernel(name: str, variant: JaxVariant) -> None:
    workload = model_workload(damper(name), BATCH, SAMPLES)
    expected, _, _ = workload.misfits(threads=1)
    np.testing.assert_allclose(np.asarray(prepare(workload, variant)()), expected, rtol=AGREEMENT)


def with_the_start_for_the_middle(workload: ModelWorkload) -> ModelWorkload:
    stages = workload.stages.copy()
    stages[:, 1] = stages[:, 0]
    return replace(workload, stages=stages)


def with_another_last_candidate(workload: ModelWorkload) -> ModelWorkload:
    theta = workload.theta.copy()
    theta[-1] *= 1.0 + 1e-6
    return replace(workload, theta=theta)


def with_another_last_sample(workload: ModelWorkload) -> ModelWorkload:
    force = workload.force.copy()
    force[-1] += 1e-3
    return replace(workload, force=force)


@pytest.mark.parametrize("form", ["jax", "jax_scan"])
@pytest.mark.parametrize(
    ("name", "spoil"),
    [
        ("normalised_bouc_wen", with_the_start_for_the_middle),
        ("normalised_bouc_wen", with_another_last_candidate),
        ("static_hysteretic", with_another_last_candidate),
        ("static_hysteretic", with_another_last_sample),
    ],
)
def test_a_twin_that_computes_something_else_is_not_timed(
    form: str, name: str, spoil: Callable[[ModelWorkload], ModelWorkload]
) -> None:
    workload = model_workload(damper(name), BATCH, SAMPLES)
    peers = {form: twins_of(spoil(workload))[form]}
    with pytest.raises(MrworkError, match=f"{name} as {form} .* agree on every misfit"):
        list(measured(workload, peers, threads=1, rounds=1))


def test_the_command_line_measures_one_model(capsys: pytest.CaptureFixture[str]) -> None:
    tiny = ["--model", "bingham", "--batch", "8", "--samples", "60", "--rounds", "1", "--quiet", "--json"]
    with pytest.raises(SystemExit) as ended:
        main(["models", *tiny])
    assert ended.value.code == 0
    (row,) = json.loads(capsys.readouterr().out)["rows"]
    assert (row["model"], row["batch"], row["threads"], row["substeps"]) == ("bingham", 8, 1, SUBSTEPS)
    assert row["ratio_jax"] == pytest.approx(row["ours"] / row["jax"])
    assert row["variants"].keys() == {"jax", "jax_scan"}
    assert 0.0 < row["peak_fraction"] < 1.0


def a_row(model: str, n_states: int) -> ModelRow:
    return ModelRow(
        model=model,
        n_states=n_states,
        batch=1024,
        threads=1,
        substeps=1,
        dt=1e-3,
        variants={"jax": "vmap(simulate)", "jax_scan": "vmap(scan), unroll 2"},
        **speed_figures({"ours": 3e8, "jax": 1e8, "jax_scan": 2e8}, flops_per_step=100.0, fma_peak=1e11),
    )


def text_of(row: ModelRow) -> str:
    return "\n".join(ModelBenchmark(rows=(row,), instruction_set="avx2", n_time=2000, rounds=7).text())


def test_a_row_gives_the_ratio_and_the_share_of_the_peak() -> None:
    row = a_row("dahl", 1)
    assert row.ratio_jax == pytest.approx(3.0)
    assert row.ratio_jax_scan == pytest.approx(1.5)
    assert row.peak_fraction == pytest.approx(0.3)


def test_the_table_explains_a_model_without_a_state() -> None:
    assert "without a state" in text_of(a_row("bingham", 0))
    assert "without a state" not in text_of(a_row("dahl", 1))


def test_an_unknown_model_and_too_many_threads_are_refused() -> None:
    with pytest.raises(UnknownNameError, match="no damper model is called"):
        bench_models(models=("bingam",))
    with pytest.raises(SettingError, match="give fewer threads"):
        bench_models(threads=(100_000,))
