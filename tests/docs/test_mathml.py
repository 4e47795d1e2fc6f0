"""Equations of pages become MathML at build."""

from xml.etree import ElementTree

import pytest

pytest.importorskip("sphinx")

from docutils import nodes

from mathml import _mathml


def shown(equation: str, *, is_block: bool = False) -> ElementTree.Element:
    return ElementTree.fromstring(_mathml(nodes.math(text=equation), is_block=is_block))


def test_equations_become_mathml():
    (index,) = shown(r"\ddot{x}_g")
    assert (index.tag, [each.tag for each in index]) == ("msub", ["mover", "mi"])
    assert shown(r"\sum_{i=1}^n x_i", is_block=True)[0].tag == "munderover"
    (table,) = shown("a &= b \\\\ c &= d", is_block=True).iter("mtable")
    assert len(table) == 2
    assert [each.text for each in shown(r"a < b").iter("mo")] == ["<"]
