"""Constraints beside a misfit: feasible points first, and the search ends on the boundary where it binds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from sentences import Refused

from mrwork.base.values import Floats
from mrwork.search import OPTIMISERS, misfit_under_constraints, run_search

columns_of_points = arrays(np.float64, (6, 3), elements=st.floats(-1e3, 1e3))


@given(columns_of_points)
def test_points_are_ranked_by_debs_rules(columns: Floats) -> None:
    columns[:, 0] = np.abs(columns[:, 0])
    ranked = misfit_under_constraints(columns)
    missed = np.maximum(columns[:, 1:], 0.0).sum(axis=1)
    for one in range(6):
        for other in range(6):
            if missed[one] == missed[other] == 0.0:
                assert (ranked[one] < ranked[other]) == (columns[one, 0] < columns[other, 0])
            elif missed[one] == 0.0 or missed[other] > missed[one] * (1.0 + 1e-12) + 1e-12:
                assert ranked[one] < ranked[other]


def test_a_failed_point_is_infinite_whatever_its_constraints() -> None:
    ranked = misfit_under_constraints(
        [[np.inf, -1.0], [np.nan, -1.0], [1.0, np.nan], [1.0, np.inf], [1.0, -np.inf]]
    )
    np.testing.assert_array_equal(ranked, [np.inf, np.inf, np.inf, np.inf, 1.0])


@pytest.mark.parametrize("name", list(OPTIMISERS))
def test_every_search_ends_at_a_constraint_that_binds(name: str) -> None:
    def objective(unit: Floats) -> Floats:
        return misfit_under_constraints(np.column_stack([np.sum(unit**2, axis=1), 0.5 - unit[:, 0]]))

    found = run_search(OPTIMISERS[name], objective, rng=1, n_params=2)
    assert found.best_unit[0] >= 0.5
    assert found.best_misfit < 0.5**2 + 0.01


def test_columns_that_are_none_are_refused(refused: Refused) -> None:
    refused(misfit_under_constraints, [1.0, 2.0])
    refused(misfit_under_constraints, [[1.0], [2.0]])
    refused(misfit_under_constraints, [[1e13, -1.0]])
