"""Equations of pages become MathML at build."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest

pytest.importorskip("sphinx")

from docutils import nodes

from mathml import _mathml


def shown(equation: str, *, is_block: bool = False) -> ElementTree.Element:
    return ElementTree.fromstring(_mathml(nodes.math(text=equation), is_block=is_block))


def test_an_index_stands_beside_a_letter_with_an_accent():
    (index,) = shown(r"\ddot{x}_g")
    assert [each.tag for each in index] == ["mover", "mi"]
    assert index.tag == "msub"


def test_limits_of_a_sum_stay_where_they_are():
    assert shown(r"\sum_{i=1}^n x_i", is_block=True)[0].tag == "munderover"


@pytest.mark.parametrize("equation", ["a &= b \\\\ c &= d", "\\begin{align}a &= b \\\\ c &= d\\end{align}"])
def test_lines_are_aligned(equation):
    (table,) = shown(equation, is_block=True).iter("mtable")
    assert len(table) == 2


def test_text_is_no_markup():
    assert [each.text for each in shown(r"a < b").iter("mo")] == ["<"]
