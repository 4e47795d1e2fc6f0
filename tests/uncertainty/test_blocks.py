"""Blocks of whole cycles: without gaps, longer than the autocorrelation time of the residuals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sinusoidal_tests import PER_CYCLE, sinusoidal_test

from mrwork.dampers import damper
from mrwork.identification.result import autocorrelation_time
from mrwork.records import DamperTest
from mrwork.uncertainty.choice.leave_one_out import blocks_of, longest_autocorrelation_times


@pytest.fixture(scope="module")
def ten_cycles() -> DamperTest:
    return sinusoidal_test("bingham", damper("bingham").nominal, (0.01, 1.0), noise=0.01, cycles=10)


@pytest.mark.parametrize("least", [1.0, PER_CYCLE + 5.0, 3.5 * PER_CYCLE, 100.0 * PER_CYCLE])
def test_blocks_are_without_gaps_and_long_enough(ten_cycles: DamperTest, least: float) -> None:
    blocks = blocks_of(ten_cycles, least)
    n_counted = ten_cycles.n_time - ten_cycles.n_settle
    assert [block.start for block in blocks] == [0, *(block.stop for block in blocks[:-1])]
    assert blocks[-1].stop == n_counted
    lengths = [block.stop - block.start for block in blocks]
    assert min(lengths) >= min(least, n_counted)
    # Whole cycles within a sample, but for the ends, which take the parts that are left.
    inner = np.array(lengths[1:-1]) / PER_CYCLE
    assert np.all(np.abs(inner - np.round(inner)) < 0.03)


def test_a_block_per_cycle_where_nothing_is_remembered(ten_cycles: DamperTest) -> None:
    assert len(blocks_of(ten_cycles, 1.0)) in (8, 9, 10)
    assert len(blocks_of(ten_cycles, 1e9)) == 1


def test_a_motion_without_cycles_is_one_block(ten_cycles: DamperTest) -> None:
    pull = replace(ten_cycles, displacement=np.linspace(0.0, 0.01, ten_cycles.n_time))
    assert len(blocks_of(pull, 1.0)) == 1


def test_blocks_outlast_the_memory_of_every_model(ten_cycles: DamperTest) -> None:
    rng = np.random.default_rng(1)
    n_counted = ten_cycles.n_time - ten_cycles.n_settle
    white = rng.standard_normal(n_counted)
    slow = np.convolve(rng.standard_normal(n_counted + 199), np.ones(200), mode="valid")
    least = longest_autocorrelation_times([(white,), (slow,)])
    assert least == (autocorrelation_time(slow),)
    assert least[0] > PER_CYCLE
    assert all(block.stop - block.start >= least[0] for block in blocks_of(ten_cycles, least[0]))
