"""A test that is recorded more coarsely than those on which the laws of a joint fit are searched."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import pytest
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.identification import level_search
from mrwork.records import DamperTest, cut

COMMANDS = (0.0, 1.0)
MOTIONS = ((0.010, 1.0), (0.002, 2.0), (0.005, 4.0))


def loop_test(motion: tuple[float, float], command: float, seed: int) -> DamperTest:
    """Of dahl with sharp loops, whose k_w is linear in the command."""
    theta = (200.0 + 400.0 * command, 5e4, 20.0)
    test = sinusoidal_test("dahl", theta, motion, noise=0.02, rng=seed, cycles=8)
    return replace(test, current=command, name=f"{motion} at {command} A")


def test_a_coarse_test_that_the_search_leaves_out_is_simulated_by_the_fit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Every third of a second, these loops are too stiff; the fastest test of each command is alone in the search."""
    alone = partial(level_search.points_from_levels, per_command=1)
    monkeypatch.setattr(level_search, "points_from_levels", alone)
    fine = [loop_test(motion, command, 1) for command in COMMANDS for motion in MOTIONS]
    coarse = [cut(loop_test((0.0101, 1.0), command, 2), every=20) for command in COMMANDS]
    spec = mr.damper("dahl").with_current_laws({"k_w": "linear"}, unit="A")
    fit = mr.identify(spec, [*fine, *coarse], rng=1)
    assert fit.status == "converged"
    assert fit.fit_percent > 80.0
