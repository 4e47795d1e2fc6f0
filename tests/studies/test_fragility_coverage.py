"""The study of fragilities: its suites are censored as they say, and its counts are of what the bands hold."""

from __future__ import annotations

import numpy as np
import pytest

from studies.fragility import study


@pytest.mark.parametrize("censored", study.CENSORED)
def test_a_share_of_the_records_lies_above_the_highest_level(censored: float) -> None:
    suites = [study.suite(censored, 20, 15, seed)["bare"].crossings for seed in range(12)]
    above = np.mean([crossing.below == np.inf for each in suites for crossing in each])
    assert above == pytest.approx(censored, abs=0.1)


def test_shares_are_of_the_suites_and_errors_of_those_that_are_known() -> None:
    found = study.suite(0.0, 20, 15, 1)
    row = study.counted(found)
    assert row["median"] == float(found["bare"].band[0] <= study.MEDIANS[0] <= found["bare"].band[1])
    assert row["dispersion_error"] == pytest.approx(found["bare"].dispersion - study.DISPERSION)
    unknown = row | {"ratio": 0.0, "ratio_error": np.nan}
    means = study.shares([row | {"ratio": 1.0, "ratio_error": 0.1}, unknown])
    assert (means["ratio"], means["ratio_error"], means["n"]) == (50.0, pytest.approx(10.0), 2)
