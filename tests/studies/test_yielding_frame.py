"""The study of a frame that yields: its limits, and both programs on a short motion."""

from __future__ import annotations

from argparse import Namespace

import numpy as np
import pytest

import mrwork as mr
from studies.yielding_frame import comparison, frame, study, timing


def test_the_limit_has_none_of_the_powers_of_the_step() -> None:
    steps = (0.4, 0.2, 0.1)
    first = [np.array([3.0, -1.0]) + np.array([2.0, 5.0]) * h + 7.0 * h**2 for h in steps]
    np.testing.assert_allclose(comparison.extrapolated(first), [3.0, -1.0], rtol=1e-12)
    second = [np.array([3.0, -1.0]) + 7.0 * h**2 for h in steps[:2]]
    np.testing.assert_allclose(comparison.extrapolated(second, order=2), [3.0, -1.0], rtol=1e-12)


def test_the_study_of_laws_has_the_frame_that_is_compared() -> None:
    built = mr.study_of(building=timing.BUILDING, motions=[{"synthetic": "kanai_tajimi"}])
    case = frame.Case(motion=frame.motions()[0], p_delta=True)
    np.testing.assert_allclose(built.building.site_stiffness, frame.building(case).site_stiffness)
    np.testing.assert_allclose(built.building.damping, frame.building(case).damping)


def test_it_says_what_is_lacking(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(study, "openseespy", lambda: None)
    assert study.find(Namespace(quick=True, timing=False), print) == 2
    assert "install the extra `opensees`" in capsys.readouterr().err


def test_both_programs_have_the_same_limit() -> None:
    ops = pytest.importorskip("openseespy.opensees", exc_type=(ImportError, RuntimeError))
    whole = frame.at_level(frame.motions()[0], 0.8)
    peak = whole.dt * int(np.abs(whole.acceleration).argmax())
    motion = mr.motions.trimmed(whole, start=peak - 1.0, end=peak + 1.0)
    case = frame.Case(motion=motion, p_delta=True, damper=True)
    found = comparison.compared(ops, case)
    assert found["ductility"] > 2.0
    # Backward Euler of the loops, of the first order; Newmark's steps are of the second.
    np.testing.assert_allclose(found["orders"], 1.0, atol=0.2)
    assert max(found[name] for name in ("drift", "shear", "acceleration", "peaks")) < 1e-4
    row = study.worst([found, found])
    assert row["errors"] == found["errors"]
    (cells,) = next(iter(study.tables({"compared": {"short": row}, "bilinear": {}}))).rows
    assert cells[0] == "short"
