"""Numbers, symbols, equations and control characters as text."""

import math
import re
from xml.etree import ElementTree

import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.figure import Figure

from mrwork.base import numbers
from mrwork.base.remark import Measured
from mrwork.plots.canvas import inline_svg
from mrwork.plots.style import symbol_text
from mrwork.report.html import equation_html, page_html, symbol
from mrwork.report.section import Lead


@pytest.mark.contract
@pytest.mark.parametrize(
    ("value", "error", "shown"),
    [
        (1843.7263, 6.2, ("1843.7", "6.2")),
        (-2310.8, 114.0, ("−2310", "110")),
        (88_123.4, 1234.0, ("88\N{NARROW NO-BREAK SPACE}100", "1200")),
        (-1.2346e-4, 2.1e-5, ("−0.000123", "0.000021")),
        (3.4567e-9, 1.2e-11, ("3.457 × 10⁻⁹", "0.012 × 10⁻⁹")),
        (2.5e9, 3e6, ("2.5000 × 10⁹", "0.0030 × 10⁹")),
        (19_992.0, 1.2e18, ("20\N{NARROW NO-BREAK SPACE}000", "1.2 × 10¹⁸")),
        (5130.4, 25_000.0, ("5000", "25\N{NARROW NO-BREAK SPACE}000")),
        (0.0, 0.12, ("0.00", "0.12")),
        (9.996, 0.0996, ("10.00", "0.10")),
        (512.0, 1e-11, ("512", "–")),
        (512.0, 1e-4, ("512.00000", "0.00010")),
        (0.5, None, ("0.5", "–")),
        (0.0, None, ("0", "–")),
        (math.nan, 1.0, ("–", "–")),
    ],
)
def test_an_estimate_has_the_digits_its_error_allows(
    value: float, error: float | None, shown: tuple[str, str]
) -> None:
    assert numbers.value_and_error(value, error) == shown


@pytest.mark.contract
def test_an_estimate_of_a_terminal_has_plain_characters() -> None:
    assert Measured(-6431.0, "N", 16_000.0).in_words() == "-6000 +- 16000"
    assert Measured(3.4567e-9, "s", 1.2e-11).in_words() == "3.457e-09 +- 0.012e-09"


@pytest.mark.parametrize(
    ("name", "shown"),
    [("rho@0A", "ρ at 0\xa0A"), ("k_w@0.5V", "k_w at 0.5\xa0V"), ("alpha.1", "α.1"), ("c0", "c0"), ("", "")],
)
def test_a_figure_has_the_letter_of_the_equation(name: str, shown: str) -> None:
    assert symbol_text(name) == shown


def read_back(text: str) -> float:
    plain = text.replace("−", "-").replace("\N{NARROW NO-BREAK SPACE}", "")
    mantissa, _, power = plain.partition(" × 10")
    return float(mantissa) * 10.0 ** int(
        (power or "0").translate(str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-"))
    )


@pytest.mark.contract
@given(
    mantissa=st.floats(-9.99, 9.99).filter(lambda number: abs(number) >= 1),
    power=st.integers(-12, 12),
    share=st.floats(1e-6, 0.5),
)
def test_rounding_an_estimate_costs_less_than_a_tenth_of_its_error(
    mantissa: float, power: int, share: float
) -> None:
    value = mantissa * 10.0**power
    error = share * abs(value)
    shown_value, shown_error = numbers.value_and_error(value, error)
    assert abs(read_back(shown_value) - value) <= 0.0501 * error
    assert read_back(shown_error) == pytest.approx(error, rel=0.0501)


@pytest.mark.contract
@given(
    mantissa=st.floats(-9.99, 9.99).filter(lambda number: abs(number) >= 1),
    power=st.integers(-12, 12),
    ratio=st.integers(-20, 20),
)
def test_no_error_rounds_a_value_away(mantissa: float, power: int, ratio: int) -> None:
    value = mantissa * 10.0**power
    shown, _ = numbers.value_and_error(value, abs(value) * 10.0**ratio)
    assert read_back(shown) == pytest.approx(value, rel=0.501)


@pytest.mark.contract
@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=6))
def test_a_column_has_equal_decimals(values: list[float]) -> None:
    decimals = numbers.decimals_of(values, 3)
    texts = [numbers.format_fixed(value, decimals) for value in values]
    assert len({len(text.partition(".")[2]) for text in texts}) == 1
    assert not any(re.fullmatch("−[0.]+", text) for text in texts)


@pytest.mark.parametrize(
    ("name", "shown"),
    [
        ("rho", "<i>ρ</i>"),
        ("k_w", "<i>k</i><sub>w</sub>"),
        ("c0a", "<i>c</i><sub>0a</sub>"),
        ("A1.2", "<i>A</i><sub>1,2</sub>"),
        ("a<b", "a&lt;b"),
    ],
)
def test_a_name_is_set_as_a_symbol(name: str, shown: str) -> None:
    assert symbol(name) == shown


def test_an_equation_is_set_as_mathematics() -> None:
    assert equation_html("w' = rho |w|^(n-1) - tanh(x0)") == (
        "<i>w</i>′ = <i>ρ</i> |<i>w</i>|<sup><i>n</i>−1</sup> − tanh(<i>x</i><sub>0</sub>)"
    )
    assert equation_html("k_w = k_w.0 + k_w.1 u [A]") == (
        "<i>k</i><sub>w</sub> = <i>k</i><sub>w,0</sub> + <i>k</i><sub>w,1</sub> <i>u</i> [A]"
    )
    assert equation_html("|f| < f_y & v<sub>0</sub>") == (
        "|<i>f</i>| &lt; <i>f</i><sub>y</sub> &amp; <i>v</i><sub>0</sub>"
    )


def test_what_has_no_shape_is_escaped_in_figures_and_pages() -> None:
    name = "a\x1b[31m\x07\u202eb"
    drawn = Figure(figsize=(3.0, 2.0))
    drawn.add_subplot().set_title(name)
    text = inline_svg(drawn, identifier="a", description="d")
    ElementTree.fromstring(text)
    assert r"\x1b[31m\x07\u202eb" in text
    page = page_html(Lead(eyebrow="", title=name, subject=name, verdict=""))
    assert page.count(r"a\x1b[31m\x07\u202eb") >= 2
    assert all(line.isprintable() for line in page.splitlines())
