"""The study of gradients: each part in its smallest form, whose contenders agree before they are compared."""

from __future__ import annotations

import time
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import mrwork as mr
from mrwork.errors import MrworkError
from studies.gradients import hang
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


def test_samplers_have_draws_and_rates() -> None:
    pytest.importorskip("numpyro", reason=f"numpyro {ABSENT}")
    nuts, ensemble = rows_of_quick("samplers")
    assert nuts.gradients >= nuts.draws == 20
    assert nuts.per_second > nuts.per_second_with_compilation > 0.0
    assert ensemble.gradients == ensemble.compile_seconds == 0.0
    assert ensemble.z > 0.0 == nuts.z


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


def test_threads_beside_a_busy_process_change_no_bit_and_those_that_hang_are_found(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    (row,) = rows_of_quick("hang")
    assert (row.calls, row.changed) == (200, 0)
    calls: list[None] = []

    def sometimes() -> bytes:
        calls.append(None)
        time.sleep(0.0 if len(calls) < 10 else 2.0)
        return b""

    monkeypatch.setattr(hang, "_functions", lambda n_time, threads: [sometimes])
    with pytest.raises(MrworkError, match="threads made no call for"):
        rows_of_quick("hang", busy=0, patience=0.6)


def test_gradients_through_the_loop_are_those_of_differences() -> None:
    (row,) = rows_of_quick("loops")
    assert (row.settings, row.motions) == (10, 1)
    assert 0.0 < row.apart < 1e-6
