"""Constraints beside objectives: feasible points first, a binding constraint is followed."""

from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from refusals import refusal

from mrwork.base.values import Floats
from mrwork.search.registry import FrontResult, run_front
from mrwork.store.journal import Journal


def front(
    columns: object, *, n_constraints: int, budget: int = 2400, journal: Journal | None = None
) -> FrontResult:
    pytest.importorskip("pymoo")
    return run_front(
        columns,  # type: ignore[arg-type] # a function of a test
        n_params=2,
        n_objectives=2,
        n_constraints=n_constraints,
        population=40,
        budget=budget,
        rng=1,
        starts=np.empty((0, 2)),
        journal=journal,
    )


def constrained(units: Floats) -> Floats:
    """Distances to two corners of the square, outside of a disc about the middle of the straight front."""
    x, y = units.T
    outside = 0.2**2 - (x - 0.5) ** 2 - (y - 0.5) ** 2
    return np.stack([x**2 + y**2, (x - 1.0) ** 2 + (y - 1.0) ** 2, outside], axis=1)


def test_a_front_keeps_its_constraints_and_follows_them_where_they_bind() -> None:
    found = front(constrained, n_constraints=1)
    assert np.all(found.constraints <= 0.0)
    np.testing.assert_array_equal(found.constraints[:, 0], constrained(found.units)[:, 2])
    # Without the disc the front is the diagonal; about its middle it now runs round the disc.
    x, y = found.units.T
    middle = np.abs(x + y - 1.0) < 0.2
    assert middle.any()
    assert np.all(found.constraints[middle, 0] > -0.02)
    assert front(lambda units: constrained(units)[:, :2], n_constraints=0).constraints.shape[1] == 0


def test_constraints_that_none_meets_leave_the_least_violation() -> None:
    def impossible(units: Floats) -> Floats:
        return np.column_stack([constrained(units)[:, :2], 1.0 + units[:, 0]])

    found = front(impossible, n_constraints=1)
    assert len(found.units) == 1
    assert found.constraints[0, 0] < 1.01


def test_a_constrained_front_is_recalled_from_its_journal(tmp_path: Path) -> None:
    with closing(Journal(tmp_path / "journal.jsonl")) as journal:
        first = front(constrained, n_constraints=1, budget=400, journal=journal)
    with closing(Journal(tmp_path / "journal.jsonl", resume=True)) as journal:
        again = front(lambda _: pytest.fail("simulated again"), n_constraints=1, budget=400, journal=journal)
    np.testing.assert_array_equal(again.units, first.units)
    np.testing.assert_array_equal(again.constraints, first.constraints)


def test_columns_of_another_number_are_refused() -> None:
    refusal(lambda: front(constrained, n_constraints=0), match=r"\(40, 3\); give \(40, 2\)")
