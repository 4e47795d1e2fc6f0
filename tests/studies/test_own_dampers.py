"""The study of dampers of users: a row says that the estimates are those of the model."""

from __future__ import annotations

from mrwork import synthetic_test
from studies.own_dampers import study


def test_a_model_written_again_has_its_estimates() -> None:
    model = "hyperbolic_tangent_guo"
    row = study.fit_row("one record", model, [synthetic_test("spencer1997")], {})
    assert row["apart"] < 1e-6
    assert row["ratio"] > 0.0
    assert study.batch_row(model)["forces apart"] < 1e-12
    assert "one record" in study.table("Fits", [row], {}).rows[0][0]
