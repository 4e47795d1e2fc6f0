"""Control characters of names are shown as escapes in figures and pages, which stay valid XML and HTML."""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree

from matplotlib.figure import Figure

from mrwork.report import write_study_page
from mrwork.report.canvas import inline_svg, png_bytes, svg_bytes

NAME = "a\x1b[31m\x07\u202eb"


def figure() -> Figure:
    drawn = Figure(figsize=(3.0, 2.0))
    axes = drawn.add_subplot()
    axes.plot([0.0, 1.0], [0.0, 1.0], label=NAME)
    axes.set_title(NAME)
    axes.set_xlabel(NAME)
    axes.legend()
    return drawn


def test_a_figure_shows_them_and_is_valid() -> None:
    text = inline_svg(figure(), identifier="a", description="d")
    ElementTree.fromstring(text)
    assert r"\x1b[31m\x07\u202eb" in text
    ElementTree.fromstring(svg_bytes(figure()))
    assert png_bytes(figure()).startswith(b"\x89PNG")


def test_a_page_shows_them(tmp_path: Path) -> None:
    template = tmp_path / "page.j2"
    template.write_text("<p>{{ name }}</p>\n<p>{{ name | breakable }}</p>\n")
    write_study_page(template, tmp_path / "page.html", name=NAME)
    page = (tmp_path / "page.html").read_text()
    assert page.count(r"a\x1b[31m\x07\u202eb") == 2
    assert all(line.isprintable() for line in page.splitlines())
