"""The clean test under odd headings and in odd units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest
from record_files import DT, clean_columns

from mrwork.records import DamperTest

COLUMNS = clean_columns()
TIME, MM, NEWTON = COLUMNS["t_s"], 1e3 * COLUMNS["displacement_m"], COLUMNS["force_n"]
KN = 1e-3 * NEWTON


def write_table(
    path: Path, columns: Mapping[str, Sequence[object]], *units: str, delimiter: str = "\t"
) -> Path:
    """Columns below their headings, and below a row of units where these are given."""
    lines = [delimiter.join(columns), *([delimiter.join(units)] if units else [])]
    lines += [delimiter.join(str(cell) for cell in row) for row in zip(*columns.values(), strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return path


def assert_is_the_test(test: DamperTest) -> None:
    """The clean test, whatever its units were."""
    assert test.dt == pytest.approx(DT, rel=1e-6)
    np.testing.assert_allclose(test.displacement, COLUMNS["displacement_m"], rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(test.force, COLUMNS["force_n"], rtol=1e-8, atol=1e-8)
