"""Units and their factors to SI."""

import math

import hypothesis.strategies as st
import pytest
from examples import examples
from hypothesis import assume, given
from refusals import refusal

from mrwork.base.units import FACTORS, factor_of, factor_to_si, number_in, quantity_of
from mrwork.closed_loop.evaluation import STANDARD_GRAVITY


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


def test_mega_is_not_milli_and_a_prefix_makes_usual_units() -> None:
    assert factor_of("MN", "force") == 1e6
    assert factor_of("mN", "force") is factor_of("mn", "force") is None
    assert (quantity_of("Mg"), quantity_of("mg"), quantity_of("lb")) == ("mass", "acceleration", "force")
    assert "short (2000 lb), long (2240 lb) or metric" in str(number_in("120 ton", "kg"))
    for symbol in ("mkg", "kmin", "Mdeg", "kin", "ckg/m", "N/m/s", "/s"):
        assert "whose unit is not known" in str(number_in(f"1 {symbol}", "kg"))


def test_a_refusal_says_what_the_unit_measures_and_which_are_known() -> None:
    refusal(factor_to_si, "mm", "force", context="rig.csv", match="of displacement.*kN")
    refusal(factor_to_si, "s2", "acceleration", context="rig.csv", match="cm/s2")


EVERY_UNIT = [(quantity, unit) for quantity, units in FACTORS.items() for unit in units]
SI = {quantity: next(iter(units)) for quantity, units in FACTORS.items()}


@examples(200)
@given(
    unit=st.sampled_from(EVERY_UNIT),
    number=st.floats(allow_nan=False, allow_infinity=False),
    blanks=st.sampled_from(["", " ", "  ", " \t"]),
)
def test_a_number_with_its_unit_is_the_number_times_the_factor(
    unit: tuple[str, str], number: float, blanks: str
) -> None:
    quantity, symbol = unit
    assume(blanks or symbol[0] != "1")
    found = number_in(f"{number!r}{blanks}{symbol}", SI[quantity])
    assert isinstance(found, float)
    assert found == number * FACTORS[quantity][symbol]
    if math.isfinite(found) and abs(found) > 1e-300:
        # The way back is a division: two roundings.
        assert found / FACTORS[quantity][symbol] == pytest.approx(number, rel=3e-16)


@examples(200)
@given(unit=st.sampled_from(EVERY_UNIT), other=st.sampled_from(EVERY_UNIT))
def test_a_unit_of_another_quantity_is_refused(unit: tuple[str, str], other: tuple[str, str]) -> None:
    found = number_in(f"1 {other[1]}", SI[unit[0]])
    # A weight is that of a mass.
    is_weight = unit[0] == "mass" and other[1] in ("lbf", "kip", "kgf", "tf")
    assert isinstance(found, float) == (is_weight or other[1] in FACTORS[unit[0]])


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        ("12 MN/m", "N/m", 12e6),
        ("5 kN s/mm", "N s/m", 5e6),
        ("80 uN", "N", 80e-6),
        ("0.25 GN", "N", 0.25e9),
        ("3 N ms/mm", "N s/m", 3.0),
        ("2 kN s2/m2", "N s2/m2", 2e3),
        ("20 t", "kg", 20e3),
        ("2 min", "s", 120.0),
        ("7 mrad/s", "rad/s", 7e-3),
        ("100 cm2/s3", "m2/s3", 1e-2),
        ("1 1/kN2", "1/N2", 1e-6),
        ("30 mA", "A or V", 0.03),
        ("2 V/ms", "A/s or V/s", 2e3),
        ("1 %", "1", 0.01),
        ("1.5%", "1", 0.015),
        ("90 deg", "rad", math.pi / 2.0),
    ],
)
def test_prefixes_and_products_of_units_follow_the_rule(text: str, unit: str, expected: float) -> None:
    assert number_in(text, unit) == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "unit", "expected"),
    [
        # 135 kip weigh what 135 000 lb of mass do.
        ("135 kip", "kg", 135e3 * 0.45359237),
        ("135000 lbf", "kg", 135e3 * 0.45359237),
        ("45 Mg", "kg", 45e3),
        ("2 lb s2/in", "kg", 2.0 * 0.45359237 * STANDARD_GRAVITY / 0.0254),
        # The pound of a force is that of force.
        ("300 lb", "N", 300.0 * 0.45359237 * STANDARD_GRAVITY),
        ("12 kip/in", "N/m", 12e3 * 0.45359237 * STANDARD_GRAVITY / 0.0254),
        ("36 ksi", "Pa", 36e3 * 0.45359237 * STANDARD_GRAVITY / 0.0254**2),
        ("12 inches", "m", 0.3048),
    ],
)
def test_units_are_read_by_the_quantity_that_is_asked(text: str, unit: str, expected: float) -> None:
    assert number_in(text, unit) == pytest.approx(expected, rel=1e-14)


def test_a_frequency_in_hz_is_no_circular_frequency() -> None:
    for text, unit in (("1 Hz", "rad/s"), ("1 rad/s", "Hz"), ("1 Hz", "1/s"), ("1 1/s", "Hz")):
        assert "is expected" in str(number_in(text, unit))


LENGTHS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}


@examples(200)
@given(
    length=st.sampled_from(list(LENGTHS)),
    slash=st.sampled_from(["/", "p", "_per_", "_"]),
    second=st.sampled_from(["s", "sec"]),
    power=st.sampled_from(["2", "^2", "**2", "_2", "\N{SUPERSCRIPT TWO}"]),
    upper=st.booleans(),
)
def test_compound_spellings_of_an_acceleration_agree(
    length: str, slash: str, second: str, power: str, upper: bool
) -> None:
    spelling = f"{length}{slash}{second}{power}"
    assert factor_of(spelling.upper() if upper else spelling, "acceleration") == LENGTHS[length]
