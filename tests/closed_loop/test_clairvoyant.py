"""Prescribed commands run as those of a law; the non-causal optimum is searched for along true gradients."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from loop_samples import devices, five_storeys, rd1005, sweep
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop import (
    ClairvoyantSettings,
    Hardware,
    PrescribedCommands,
    clairvoyant,
    simulate_prescribed,
)
from mrwork.closed_loop.clairvoyant_search import Clairvoyant, ClairvoyantProblem, ClairvoyantProgress
from mrwork.errors import Interrupted

INTERVAL = 0.02
FEW = ClairvoyantSettings(interval=INTERVAL, explore=2, finish=2, random_starts=1)


def loop() -> list[mr.Device]:
    return devices(rd1005(), second=False)


def problem(**hardware: float) -> ClairvoyantProblem:
    return ClairvoyantProblem(
        building=five_storeys(),
        devices=tuple(loop()),
        motion=sweep(1.0),
        hardware=Hardware(**hardware),
        interval=INTERVAL,
    )


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


@pytest.mark.parametrize(
    ("interval", "command", "rate", "words"),
    [
        (0.0015, [[1.0]], np.inf, "whole number of control samples"),
        (0.01, [[1.9]], np.inf, "1.88 at most"),
        (0.01, [[1.0, 1.0]], np.inf, "for 2 devices"),
        (0.01, [[1.0]], 9.0, "leave `command_rate` out"),
    ],
)
def test_commands_that_cannot_be_sent_are_told(
    interval: float, command: list[list[float]], rate: float, words: str
) -> None:
    own, hardware = PrescribedCommands(interval=interval, command=command), Hardware(command_rate=rate)
    refusal(simulate_prescribed, five_storeys(), loop(), own, sweep(1.0), hardware, match=words)


@pytest.mark.parametrize("delay", [0.0, 5e-3])
def test_the_twin_has_the_criteria_of_the_loop(delay: float) -> None:
    """Its step is chosen for half the largest command; other commands agree as well."""
    asked = problem(delay=delay)
    np.testing.assert_allclose(
        asked.twin.ratios(commands()), asked.ratios_of(asked.simulate(commands())), rtol=3e-3
    )


def test_the_gradient_is_that_of_the_smooth_score() -> None:
    twin = problem().twin
    _, gradient = twin.score_and_gradient(commands(), 16.0)
    for place in (0, 17, 40):
        # A central difference of this width is exact to the square of the width.
        width = np.zeros((50, 1))
        width[place] = 1e-5
        above, below = (twin.score_and_gradient(commands() + side * width, 16.0)[0] for side in (1.0, -1.0))
        np.testing.assert_allclose((above - below) / 2e-5, gradient[place, 0], rtol=1e-5)


def test_the_smooth_score_tends_to_the_score_from_above() -> None:
    twin = problem().twin
    exact = float(twin.ratios(commands()).mean())
    smooth = [twin.score_and_gradient(commands(), power)[0] for power in (8.0, 32.0, 128.0)]
    assert smooth[0] > smooth[1] > smooth[2] > exact
    assert smooth[2] < 1.05 * exact


@cache
def found() -> Clairvoyant:
    start = PrescribedCommands(interval=INTERVAL, command=commands())
    return clairvoyant(five_storeys(), loop(), sweep(1.0), settings=FEW, starts={"given": start})


def test_the_result_is_that_of_the_loop_and_no_worse_than_any_start() -> None:
    best = found()
    run = simulate_prescribed(five_storeys(), loop(), best.commands, sweep(1.0))
    assert float(run.peak_drift.max()) == best.criteria["peak_drift"]
    assert best.score == pytest.approx(np.mean(list(best.ratios.values())), rel=1e-12)
    assert all(best.score <= each.score <= each.start_score for each in best.starts)
    assert "given" in [each.name for each in best.starts]
    assert best.commands.command.max() <= 1.88


def test_an_interrupt_keeps_the_searches_that_are_done() -> None:
    def interrupt(progress: ClairvoyantProgress) -> None:
        if progress.start.startswith("random"):
            raise KeyboardInterrupt

    with pytest.raises(Interrupted) as stopped:
        clairvoyant(five_storeys(), loop(), sweep(1.0), settings=FEW, on_progress=interrupt)
    kept = stopped.value.result
    # What is done is what an uninterrupted search does.
    assert [each.score for each in kept.starts] == [each.score for each in found().starts][: len(kept.starts)]
    assert kept.starts


def test_devices_without_a_choice_are_refused() -> None:
    spec = mr.damper("dahl")
    row = five_storeys().storeys[0]
    dahl = mr.Device(name="dahl", spec=spec, theta=spec.nominal, row=row, largest_command=1.0)
    refusal(clairvoyant, five_storeys(), [dahl], sweep(1.0), match="no command to be chosen")
