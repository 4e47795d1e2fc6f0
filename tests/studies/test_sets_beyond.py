"""The study of sets of laws beyond the tests: a damper of the model is predicted, and a row says what was counted."""

from __future__ import annotations

import numpy as np

from studies.sets_beyond import study


def test_sets_widen_the_band() -> None:
    row = study.replicate("viscous_dahl", "of the model", 0, commands=(0.0, 1.0), threads=1)
    assert row["tests"] == 6
    assert row["within_any"] > row["band_alone"] - 0.01 > 0.5
    assert row["width"] > 0.999 * row["width_alone"] > 0.05
    assert row["within"] == (row["within_any"] if row["sets"] > 1 else 0.0)


def test_unseen_motions_are_beyond_the_tested_ones() -> None:
    def peaks(motions: tuple[tuple[float, float], ...]) -> tuple[list[float], list[float]]:
        return [stroke for stroke, _ in motions], [2 * np.pi * stroke * rate for stroke, rate in motions]

    (strokes, velocities), unseen = peaks(study.TESTED), peaks(study.UNSEEN)
    for stroke, velocity in zip(*unseen, strict=True):
        assert stroke > 1.3 * max(strokes) or velocity > 1.3 * max(velocities)


def test_rows_are_means_over_the_replicates() -> None:
    row = {"model": "a", "truth": "b", "seed": 0, "sets": 1, "tests": 9, "within": 0.0, "within_any": 0.9}
    row |= {"band_alone": 0.8, "width": 0.2, "width_alone": 0.1, "apart_percent": np.nan, "seconds": 1.0}
    other = row | {"sets": 3, "within": 1.0, "within_any": 1.0, "apart_percent": 4.0}
    (cells,) = study.table([row, other]).rows
    assert cells[:8] == ("a, b", "2", "2.0", "50.0", "50.0", "95.0", "80.0", "4.0")
