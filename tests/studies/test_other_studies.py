"""The quick forms of the smaller studies, and their arithmetic where the answer is known."""

from __future__ import annotations

from argparse import Namespace

import numpy as np
import pytest

import mrwork as mr
from studies.own_dampers import study as own_dampers
from studies.yielding_frame import comparison, frame, study


@pytest.mark.long
def test_a_model_written_again_has_its_estimates() -> None:
    model = "hyperbolic_tangent_guo"
    row = own_dampers.fit_row("one record", model, [mr.synthetic_test("spencer1997")], {})
    assert row["apart"] < 1e-6
    assert own_dampers.batch_row(model)["forces apart"] < 1e-12


def test_both_programs_have_the_same_limit_of_a_frame_that_yields(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(study, "openseespy", lambda: None)
        assert study.find(Namespace(quick=True, timing=False), print) == 2
    ops = pytest.importorskip("openseespy.opensees", exc_type=(ImportError, RuntimeError))
    whole = frame.at_level(frame.motions()[0], 0.8)
    peak = whole.dt * int(np.abs(whole.acceleration).argmax())
    motion = mr.motions.trimmed(whole, start=peak - 1.0, end=peak + 1.0)
    found = comparison.compared(ops, frame.Case(motion=motion, p_delta=True, damper=True))
    assert found["ductility"] > 2.0
    # Backward Euler of the loops, of the first order; Newmark's steps are of the second.
    np.testing.assert_allclose(found["orders"], 1.0, atol=0.2)
    assert max(found[name] for name in ("drift", "shear", "acceleration", "peaks")) < 1e-4
