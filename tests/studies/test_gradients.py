"""The study of gradients: each part in its smallest form, whose contenders agree before they are compared."""

from __future__ import annotations

from typing import Any

import pytest

from studies.gradients.fits import ENGINES
from studies.gradients.study import PARTS

ABSENT = "is not installed; pip install 'mrwork[bench,nuts]'"


def rows_of_quick(name: str, **settings: Any) -> list[Any]:
    part = PARTS[name]
    return [row for row in part.job(threads=1, **part.quick | settings) if not isinstance(row, str)]


def test_calls_of_all_contenders_agree_and_are_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("studies.former.timing.TURN_SECONDS", 1e-4)
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
