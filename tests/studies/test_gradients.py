"""The study of gradients: each part in its smallest form, whose contenders agree before they are compared."""

from __future__ import annotations

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrwork as mr
from studies.gradients.fits import ENGINES
from studies.gradients.own_loop import force_by_diffrax
from studies.gradients.posed import near_nominal, record
from studies.gradients.study import PARTS

ABSENT = "is not installed; pip install 'mrwork[bench,nuts]'"


def rows_of_quick(name: str, **settings: Any) -> list[Any]:
    part = PARTS[name]
    return [row for row in part.job(threads=1, **part.quick | settings) if not isinstance(row, str)]


def test_calls_of_all_contenders_agree_and_are_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.speed.timing.TURN_SECONDS", 1e-4)
    rows = rows_of_quick("calls")
    assert len({(row.what, row.order) for row in rows}) == 4
    assert all(0.0 < row.apart < 1e-9 for row in rows)
    assert all(table.rows for table in PARTS["calls"].tables(rows))


@pytest.mark.parametrize("library", ["optimistix", "optax"])
def test_engines_have_the_gradient_of_the_core(library: str) -> None:
    pytest.importorskip(library, reason=f"{library} {ABSENT}")
    chosen = [name for name in PARTS["fits"].quick["engines"] if ENGINES[name][0] in {library, "scipy"}]
    rows = {row.engine: row for row in rows_of_quick("fits", engines=chosen)}
    assert rows.keys() == set(chosen)
    assert all(row.gradient_apart < 1e-12 and row.evaluations > 0 for row in rows.values())
    assert rows["SciPy trf on mr.objective"].arrived == 1.0


def test_the_loop_of_a_user_has_the_force_and_the_derivatives_of_the_core() -> None:
    pytest.importorskip("diffrax", reason=f"diffrax {ABSENT}")
    test, theta = record("normalised_bouc_wen", 60), jnp.asarray(near_nominal("normalised_bouc_wen", 1))
    core = mr.jax.force("normalised_bouc_wen", test, substeps=8)
    own = force_by_diffrax(test, "heun", 8)
    along = (theta,), (0.01 * theta,)
    for found, expected in zip(jax.jvp(own, *along), jax.jvp(core, *along), strict=True):
        # Heun's method is of second order, the core's of fourth.
        assert 0.0 < np.abs(found - expected).max() < 1e-2 * np.abs(expected).max()


def test_gradients_through_the_loop_are_those_of_differences() -> None:
    (row,) = rows_of_quick("loops")
    assert (row.settings, row.motions) == (10, 1)
    assert 0.0 < row.apart < 1e-6
