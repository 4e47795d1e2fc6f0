"""What no test tells of laws between the tested commands: how far forms through the same values are apart."""

import numpy as np
import pytest

import mrwork as mr
from mrwork.dampers.between_commands import LAWS_OPEN, forms_through, open_between_commands
from mrwork.dampers.tested_range import OperatingRange


def ranges(*levels: float) -> OperatingRange:
    return OperatingRange(
        stroke=0.01,
        velocity=0.1,
        frequency=(1.0, 2.0),
        command=(levels[0], levels[-1]),
        command_unit="A",
        force=1000.0,
        power=10.0,
        levels=levels,
    )


def friction(law: str, *values: float) -> tuple[mr.DamperSpec, list[float]]:
    """A static damper of which the force at the tested velocity is its yield force, which follows the command."""
    spec = mr.damper("bingham").with_current_laws({"f_c": law}, unit="A")
    own = dict(zip(spec.names, spec.nominal, strict=True)) | {"c0": 1e-3, "f0": 0.0, "v_s": 1e-4}
    at = [name for name in spec.names if name.startswith("f_c")]
    return spec, [*(own | dict(zip(at, values, strict=True))).values()]


def test_the_spread_is_that_of_the_mean_and_of_the_logarithmic_mean() -> None:
    """At 0.5 A: 550 N by a line, 316 by logarithms, 658 by a curve that saturates at a rate of one over the gap."""
    spec, theta = friction("linear:0,1", 100.0, 1000.0)
    remark = open_between_commands(spec, theta, ranges(0.0, 1.0))
    assert remark is not None
    assert remark.code == LAWS_OPEN.code
    assert remark.words == ("f_c",)
    exponential = 100.0 + 900.0 * (1.0 - np.exp(-0.5)) / (1.0 - np.exp(-1.0))
    tanh = 100.0 + 900.0 * np.tanh(0.5) / np.tanh(1.0)
    logarithmic = np.sqrt(100.0 * 1000.0)
    expected = 100.0 * (max(exponential, tanh) - logarithmic) / 550.0
    assert remark.measured is not None
    assert remark.measured.value == pytest.approx(expected, rel=2e-3)
    assert "at 0.5 A" in remark.message


@pytest.mark.parametrize(("law", "values"), [("linear:0,1", (100.0, 1000.0)), ("constant", (100.0,))])
def test_tests_at_more_commands_than_coefficients_tell_the_form(law: str, values: tuple[float, ...]) -> None:
    spec, theta = friction(law, *values)
    assert open_between_commands(spec, theta, ranges(0.0, 0.5, 1.0)) is None


def test_forms_go_through_the_values_and_have_no_extremum() -> None:
    """Through values that saturate all forms but a parabola with its hidden maximum."""
    spec, theta = friction("tanh:0,2", 100.0, 1000.0, 3.0)
    levels = (0.0, 1.0, 2.0)
    law, values = spec.laws[0], np.array([100.0, 1000.0, 3.0])
    forms = forms_through(spec, theta, levels)["f_c"]
    texts = {str(form.law).split(":")[0] for form in forms}
    assert "quadratic" not in texts
    assert {"tanh", "monotone", "straight"} <= texts
    for form in forms:
        np.testing.assert_allclose(
            form.law.values(form.coefficients, np.array(levels)),
            law.values(values, np.array(levels)),
            rtol=1e-5,
        )
