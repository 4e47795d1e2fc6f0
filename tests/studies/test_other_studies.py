"""The quick forms of the smaller studies, and their arithmetic where the answer is known."""

from __future__ import annotations

from argparse import Namespace

import numpy as np
import pytest

import mrwork as mr
from studies.how_sure import synthetic_calibration
from studies.how_sure.scores import next_test_half_width
from studies.own_dampers import study as own_dampers
from studies.sets_beyond import study as sets_beyond
from studies.yielding_frame import comparison, frame, study


@pytest.mark.long
def test_a_replicate_ranks_every_free_number_and_bands_another_motion() -> None:
    found = synthetic_calibration.replicate("viscous_dahl", "iid", np.random.default_rng(3), threads=1)
    assert len(found.ranks) == 4
    assert all(0 <= rank <= 63 for rank in found.ranks)
    assert 0.75 < found.coverage < 1.0
    # Random sizes widen a band beyond the mean size.
    alike = 0.1 * np.exp(0.001 * np.random.default_rng(1).standard_normal(10))
    assert next_test_half_width(alike, 0.9) == pytest.approx(1.645 * 0.1, rel=0.01)
    assert next_test_half_width(0.1 * np.exp(np.tile([0.5, -0.5], 5)), 0.9) > 1.2 * 0.1645


@pytest.mark.long
def test_a_model_written_again_has_its_estimates() -> None:
    model = "hyperbolic_tangent_guo"
    row = own_dampers.fit_row("one record", model, [mr.synthetic_test("spencer1997")], {})
    assert row["apart"] < 1e-6
    assert own_dampers.batch_row(model)["forces apart"] < 1e-12


@pytest.mark.long
def test_sets_of_laws_widen_the_band() -> None:
    row = sets_beyond.replicate("viscous_dahl", "of the model", 0, commands=(0.0, 1.0), threads=1)
    assert row["tests"] == 6
    assert row["within_any"] > row["band_alone"] - 0.01 > 0.5
    assert row["width"] > 0.999 * row["width_alone"] > 0.05
    assert row["within"] == (row["within_any"] if row["sets"] > 1 else 0.0)


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
