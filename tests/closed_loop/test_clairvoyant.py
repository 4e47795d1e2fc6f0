"""Prescribed commands run as those of a law; the non-causal optimum is no worse than its starts."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from loop_samples import devices, five_storeys, rd1005, sweep

import mrwork as mr
from mrwork.closed_loop import (
    ClairvoyantSettings,
    Hardware,
    PrescribedCommands,
    clairvoyant,
    simulate_prescribed,
)
from mrwork.closed_loop.clairvoyant_search import Clairvoyant

INTERVAL = 0.02
FEW = ClairvoyantSettings(interval=INTERVAL, explore=2, finish=2, random_starts=1)


def loop() -> list[mr.Device]:
    return devices(rd1005(), second=False)


def commands(n: int = 50) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    return np.random.default_rng(3).uniform(0.0, 1.88, (n, 1))


def test_commands_of_a_law_give_its_run() -> None:
    """To the bit, at the sample time of the law; the sensors of the law do not matter to its commands."""
    problem_of_design = mr.control.DesignProblem(building=five_storeys(), devices=loop(), sample_time=1e-3)
    law = mr.control.design_law("clipped_optimal", problem_of_design, {"control_weight": 1e-12})
    hardware = Hardware(delay=2e-3)
    run = mr.simulate_loop(five_storeys(), loop(), law, [sweep(1.0)], hardware, histories=True)
    own = PrescribedCommands(interval=1e-3, command=run.histories[0].command)
    played = simulate_prescribed(five_storeys(), loop(), own, sweep(1.0), hardware)
    for quantity in ("peak_drift", "rms_acceleration", "device_energy", "mean_current"):
        np.testing.assert_array_equal(getattr(played, quantity), getattr(run, quantity))


@cache
def found() -> Clairvoyant:
    start = PrescribedCommands(interval=INTERVAL, command=commands())
    return clairvoyant(five_storeys(), loop(), sweep(1.0), settings=FEW, starts={"given": start})


@pytest.mark.long
def test_the_result_is_that_of_the_loop_and_no_worse_than_any_start() -> None:
    best = found()
    run = simulate_prescribed(five_storeys(), loop(), best.commands, sweep(1.0))
    assert float(run.peak_drift.max()) == best.criteria["peak_drift"]
    assert best.score == pytest.approx(np.mean(list(best.ratios.values())), rel=1e-12)
    assert all(best.score <= each.score <= each.start_score for each in best.starts)
    assert "given" in [each.name for each in best.starts]
    assert best.commands.command.max() <= 1.88
