"""The study of bands: what it measures on one synthetic replicate, and its arithmetic."""

import numpy as np
import pytest

from mrwork.dampers import damper
from studies.how_sure import synthetic_calibration
from studies.how_sure.scores import BandScore, next_test_half_width, score_table


def test_random_sizes_widen_a_band_beyond_the_mean_size() -> None:
    rng = np.random.default_rng(1)
    alike = next_test_half_width(np.full(10, 0.1) * np.exp(0.001 * rng.standard_normal(10)), 0.9)
    assert alike == pytest.approx(1.645 * 0.1, rel=0.01)
    assert next_test_half_width(0.1 * np.exp(np.tile([0.5, -0.5], 5)), 0.9) > 1.2 * alike


def test_rows_are_means_over_the_tests_left_out() -> None:
    outcomes = [
        BandScore(way="a", test=str(index), coverage=coverage, width=1.0, interval_score=2.0 * coverage)
        for index, coverage in enumerate((0.8, 1.0))
    ]
    assert score_table("title", outcomes).rows == (("a", "2", "90.0 %", "80.0", "1.000", "1.800"),)


def test_a_replicate_ranks_every_free_number_and_bands_another_motion() -> None:
    found = synthetic_calibration.replicate("viscous_dahl", "iid", np.random.default_rng(3), threads=1)
    assert len(found.ranks) == 4
    assert all(0 <= rank <= 63 for rank in found.ranks)
    assert 0.75 < found.coverage < 1.0


@pytest.mark.parametrize("model", synthetic_calibration.MODELS)
def test_the_prior_lies_where_the_model_is_admitted(model: str) -> None:
    spec = damper(model)
    box = synthetic_calibration.prior_box(spec)
    assert {spec.names[index] for index in box.free} == set(synthetic_calibration.MODELS[model])
    for each, lower, upper in zip(spec.parameters, box.lower, box.upper, strict=True):
        assert each.lower <= lower <= upper <= each.upper
