"""Figures of a page are those that matplotlib itself would write, with one tick for each axis."""

from __future__ import annotations

import io
import re
from collections.abc import Callable
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator
from report_samples import comparison

from mrwork.report import canvas, figures, style
from mrwork.report.svg import inline_svg

_SVG = "{http://www.w3.org/2000/svg}"
# Pages round to a hundredth of a point.
_ROUNDING = 0.0051


def logarithmic() -> Figure:
    figure, axes = canvas.column_axes()
    axes.plot([1.0, 2.0, 3.0], [1e-3, np.nan, 1e2], "o-", alpha=0.5, label="a < b")
    canvas.finish(axes, "Misfit", "Step")
    canvas.logarithmic(axes, np.array([1e-3, 1e2]))
    canvas.legend(axes)
    return figure


def tiny() -> Figure:
    """With a factor above the ordinate."""
    figure, axes = canvas.blank(canvas.SMALL)
    axes.plot([0.0, 1.0], [1e-12, 3e-12], linestyle=style.DASHED)
    axes.set_ylabel("Name")
    return figure


def named_ticks() -> Figure:
    figure, axes = canvas.column_axes()
    axes.fill_between([0.0, 1.0, 2.0], [0.0, 1.0, 4.0], color=style.BAND)
    axes.xaxis.set_major_locator(FixedLocator([0.0, 1.0, 2.0]))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda place, _: ("one", "two\nlines", "(g)")[int(place)]))
    axes.set_yticks([0, 2, 4], ["none", "some", "all"])
    axes.set_xlabel("Law")
    axes.annotate("here", (1.0, 1.0), (0.2, 3.0), arrowprops={"arrowstyle": "->"})
    axes.text(1.5, 1.0, "turned", rotation=30.0)
    return figure


def without_ticks() -> Figure:
    figure, axes = canvas.column_axes()
    axes.set_xlabel("Nothing")
    axes.xaxis.set_major_locator(NullLocator())
    axes.yaxis.set_major_locator(FixedLocator([2.0]))
    return figure


def image() -> Figure:
    figure, axes = canvas.column_axes()
    axes.imshow(np.arange(6.0).reshape(2, 3), origin="lower", aspect="auto")
    return figure


DRAWINGS = (
    lambda: figures.force_history(comparison()),
    lambda: figures.hysteresis_loops(comparison()),
    logarithmic,
    tiny,
    named_ticks,
    without_ticks,
    image,
)


def of_matplotlib(figure: Figure) -> str:
    target = io.StringIO()
    with style.drawn_in_style():
        figure.savefig(target, format="svg", metadata={"Date": None})
    return target.getvalue()


def numbers(text: str) -> list[float]:
    return [float(number) for number in re.findall(r"-?\d+\.?\d*(?:e-?\d+)?", text)]


def drawn(svg: str) -> tuple[list[str], list[str], list[list[float]]]:
    """Texts, the commands of paths that are drawn where they stand, and the numbers of both."""
    root = ElementTree.fromstring(svg)
    hidden = {each for definitions in root.iter(f"{_SVG}defs") for each in definitions.iter()}
    texts = list(root.iter(f"{_SVG}text"))
    paths = [each.get("d", "") for each in root.iter(f"{_SVG}path") if each not in hidden and each.get("d")]
    anchored = [[float(text.get("x", "")), float(text.get("y", ""))] for text in texts if _is_anchored(text)]
    return (
        [text.text or "" for text in texts],
        [re.sub("[^MLQCz]", "", path) for path in paths],
        [numbers(path) for path in paths] + anchored,
    )


def _is_anchored(text: ElementTree.Element) -> bool:
    return "text-anchor" in text.get("style", "") or text.get("text-anchor") is not None


@pytest.mark.parametrize("draw", DRAWINGS)
def test_a_page_shows_what_matplotlib_draws(draw: Callable[[], Figure]) -> None:
    with style.drawn_in_style():
        figure = draw()
    texts, commands, places = drawn(inline_svg(figure, identifier="a", description=""))
    expected = drawn(of_matplotlib(figure))
    assert (texts, commands) == expected[:2]
    for place, wanted in zip(places, expected[2], strict=True):
        np.testing.assert_allclose(place, wanted, rtol=0.0, atol=_ROUNDING)


@pytest.mark.parametrize("draw", DRAWINGS)
def test_drawing_for_a_page_leaves_the_figure_as_it_was(draw: Callable[[], Figure]) -> None:
    with style.drawn_in_style():
        figure = draw()
    canvas_before, children = figure.canvas, [axes.get_children() for axes in figure.axes]
    first = inline_svg(figure, identifier="a", description="")
    assert figure.canvas is canvas_before
    assert [axes.get_children() for axes in figure.axes] == children
    assert all(axis.get_visible() for axes in figure.axes for axis in (axes.xaxis, axes.yaxis))
    if figure.get_layout_engine() is None:
        assert inline_svg(figure, identifier="a", description="") == first


def test_a_page_makes_one_tick_for_each_axis() -> None:
    figure = figures.force_history(comparison())
    inline_svg(figure, identifier="a", description="")
    made: list[Axis] = [axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    assert [len(axis.majorTicks) for axis in made] == [1] * len(made)


def test_the_style_in_itself_ends_with_the_outer_one() -> None:
    size = matplotlib.rcParams["font.size"]
    with style.drawn_in_style():
        with style.drawn_in_style():
            assert matplotlib.rcParams["font.size"] == style.TEXT_SIZE
        assert matplotlib.rcParams["font.size"] == style.TEXT_SIZE
    assert matplotlib.rcParams["font.size"] == size
