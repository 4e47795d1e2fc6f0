"""The errors of a fit by the amplitude of the half cycles, and at reversals, on its page."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import report_samples

from mrwork.report.figures import Comparison
from mrwork.report.fit.amplitudes import amplitude_section
from mrwork.report.section import Section


def with_error(amplitude: float, error: np.ndarray | float) -> Comparison:
    """A test of this amplitude [m] whose model is off by this force [N]."""
    found = report_samples.comparison(f"{1e3 * amplitude:g} mm", amplitude=amplitude)
    return replace(found, model_force=found.test.force - error)


def rows(section: Section) -> dict[str, dict[str, str]]:
    """Cells of the table by column, by the first cell of their row."""
    (group,) = section.groups
    assert group.table is not None
    return {row[0]: dict(zip(group.table.columns, row, strict=True)) for row in group.table.rows}


def test_each_class_of_amplitudes_has_its_own_error() -> None:
    section = amplitude_section([with_error(0.038, 10.0), with_error(0.002, 40.0), with_error(0.0021, 40.0)])
    found = rows(section)
    assert list(found) == ["2 to 2.1 mm", "38 mm", "all"]
    assert found["38 mm"]["RMSE (N)"] == "10.0"
    assert found["2 to 2.1 mm"]["RMSE (N)"] == "40.0"
    # Seven and a half cycles from the first reversal on, of each test.
    assert [each["Half cycles"] for each in found.values()] == ["30", "15", "45"]
    assert float(found["all"]["RMSE (N)"]) == pytest.approx(np.sqrt((10.0**2 + 2 * 40.0**2) / 3), abs=0.06)
    assert "in those of 2 to 2.1 mm" in section.summary


def test_an_error_that_small_strokes_have_alone_is_said() -> None:
    (group,) = amplitude_section([with_error(0.038, 10.0), with_error(0.002, 40.0)]).groups
    (sentence,) = group.prose
    assert "In half cycles of 2 mm the error over the force is 4 times that in those of 38 mm." in sentence
    (group,) = amplitude_section([with_error(0.038, 10.0), with_error(0.002, 15.0)]).groups
    assert group.prose == ()


def test_an_error_at_reversals_is_told_from_one_elsewhere() -> None:
    test = report_samples.comparison().test
    at_reversal = np.abs(test.velocity) < np.sin(0.1 * np.pi) * np.max(test.velocity)
    found = rows(amplitude_section([with_error(0.01, np.where(at_reversal, 30.0, 10.0))]))
    (row,) = found.values()
    # A window has 12.5 samples: one at its edge may count on the other side.
    assert float(row["RMSE at reversals (N)"]) == pytest.approx(30.0, rel=0.04)
    assert float(row["RMSE elsewhere (N)"]) == pytest.approx(10.0, rel=0.05)
    assert float(row["At reversals / elsewhere"]) == pytest.approx(3.0, rel=0.1)


def test_samples_that_are_not_compared_do_not_count() -> None:
    found = with_error(0.01, 10.0)
    error = np.full(found.test.n_time, 10.0)
    error[500:700] = 1e6
    test = replace(found.test, uncompared=((500, 700),))
    (row,) = rows(amplitude_section([replace(found, test=test, model_force=test.force - error)])).values()
    assert row["RMSE (N)"] == "10.0"


def test_a_motion_without_half_cycles_has_one_class() -> None:
    found = with_error(0.01, 10.0)
    ramp = np.linspace(0.0, 0.02, found.test.n_time)
    section = amplitude_section([replace(found, test=replace(found.test, displacement=ramp))])
    assert section.summary == "Errors by amplitude: all half cycles are of 10 mm."
