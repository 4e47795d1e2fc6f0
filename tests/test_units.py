"""Units and their factors to SI."""

from __future__ import annotations

import pytest

from mrwork.errors import UnitError
from mrwork.units import FACTORS, STANDARD_GRAVITY, factor_of, factor_to_si, quantity_of


def test_every_unit_has_one_meaning() -> None:
    for quantity, units in FACTORS.items():
        assert next(iter(units.values())) == 1.0
        for symbol, factor in units.items():
            in_any_case = symbol if symbol.startswith("M") else symbol.upper()
            assert factor_to_si(in_any_case, quantity, context="") == factor
            assert quantity_of(symbol) == quantity
    assert factor_to_si("\N{MICRO SIGN}m", "displacement", context="") == 1e-6


def test_factors_follow_from_their_definitions() -> None:
    # Inch, pound and standard gravity are exact by definition (NIST SP 811, appendix B.8).
    pound_force = factor_to_si("lbf", "force", context="")
    assert pound_force == pytest.approx(0.45359237 * STANDARD_GRAVITY, rel=1e-16)
    assert factor_to_si("kip", "force", context="") == 1000.0 * pound_force
    assert (
        factor_to_si("in/s", "velocity", context="")
        == factor_to_si("in", "displacement", context="")
        == 0.0254
    )


def test_mega_is_not_milli() -> None:
    assert factor_of("MN", "force") == 1e6
    assert factor_of("mN", "force") is factor_of("mn", "force") is None


@pytest.mark.parametrize(
    "spelling",
    [
        "cm/s2",
        "cm/s^2",
        "cm/sec2",
        "cm/sec/sec",
        "cm/s/s",
        "CM/S**2",
        "cmps2",
        "cm_s2",
        "cm_s-2",
        "cm_per_s2",
    ],
)
def test_spellings_of_accelerations_agree(spelling: str) -> None:
    assert factor_of(spelling, "acceleration") == 1e-2


@pytest.mark.parametrize("spelling", ["mm/s", "mmps", "mm_s", "mm_per_s", "MM/S"])
def test_spellings_of_velocities_agree(spelling: str) -> None:
    assert factor_of(spelling, "velocity") == 1e-3
    assert factor_of(spelling, "acceleration") is None


def test_a_refusal_says_what_the_unit_measures_and_which_are_known() -> None:
    with pytest.raises(
        UnitError, match=r"^rig.csv: 'mm' is a unit of displacement, no unit of force; give one of N, "
    ):
        factor_to_si("mm", "force", context="rig.csv")
    with pytest.raises(UnitError, match=r"^rig.csv: 's2' is no unit of acceleration; give one of m/s2, "):
        factor_to_si("s2", "acceleration", context="rig.csv")
