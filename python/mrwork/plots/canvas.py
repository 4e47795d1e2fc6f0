"""Canvas of all figures: empty axes of fixed sizes, their titles, ticks, legends and points, and the drawn SVG or PNG.

Draw inside `style.drawn_in_style()`, a context or a decorator. Sizes are in inches, and margins are the same in every
panel, so that the axes of neighbours line up.
"""

from __future__ import annotations

import io
import re
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, Literal, cast

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullFormatter, NullLocator
from numpy.typing import ArrayLike

from mrwork.base.numbers import shortest
from mrwork.base.values import Floats
from mrwork.errors import escaped_lines
from mrwork.plots import style

LEFT, RIGHT, TOP, BOTTOM = 0.62, 0.20, 0.34, 0.5
# One of several figures side by side in a study.
SMALL = (3.7, 2.8)
# Four small panels are as wide as two columns of the page.
SMALL_WIDTH = style.PANEL_WIDTH / 2.0
# Their height, and that on the front of a page where two rows stand on a screen; their right, lower and upper margins.
SMALL_HEIGHT, LOW = 2.02, 1.22
_SMALL_MARGINS = (0.14, 0.42, 0.3)
_LEGEND_GAP = 0.07
# Mean width of a letter, and the widest margin for names.
_LETTER, _WIDEST_NAMES = 0.082, 2.6
_ROUND, _COARSE = [1, 2, 2.5, 5, 10], [1, 2, 5, 10]


def column_axes(
    *, left: float = LEFT, top: float = TOP, height: float = style.PANEL_HEIGHT
) -> tuple[Figure, Axes]:
    """Axes as wide as one of two columns of a page."""
    return _axes_within((style.PANEL_WIDTH, height), left, RIGHT, BOTTOM, top)


def small_axes(height: float = SMALL_HEIGHT, *, left: float = LEFT) -> tuple[Figure, Axes]:
    """Axes as wide as one of four columns of a page."""
    figure, axes = _axes_within((SMALL_WIDTH, height), left, *_SMALL_MARGINS)
    few_ticks(axes)
    return figure, axes


def _axes_within(
    size: tuple[float, float], left: float, right: float, bottom: float, top: float
) -> tuple[Figure, Axes]:
    (width, height), figure = size, Figure(figsize=size)
    shares = left / width, bottom / height, 1.0 - (left + right) / width, 1.0 - (bottom + top) / height
    return figure, figure.add_axes(shares)


def room_for(names: Sequence[str]) -> float:
    """Width of the margin for names at the ticks of an ordinate."""
    return min(_LETTER * max(map(len, names), default=0) + 0.25, _WIDEST_NAMES)


def few_ticks(axes: Axes) -> None:
    """Few, round ticks for axes of the smallest size."""
    axes.xaxis.set_major_locator(MaxNLocator(nbins=3, steps=_COARSE))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=4, steps=_ROUND))


def grid_of_axes(count: int, columns: int, size: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """`count` axes in rows of at most `columns`, each of this size with its labels; matplotlib sets the margins."""
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(columns * size[0], rows * size[1]), layout="constrained")
    return figure, [figure.add_subplot(rows, columns, number + 1) for number in range(count)]


def finish(axes: Axes, ordinate: str = "", abscissa: str = "", *, y_bins: int = 5) -> None:
    """The names of both axes, given or as they are, the ordinate's above the axes; few, round ticks."""
    name_above(axes, ordinate, abscissa)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=6, steps=_ROUND))
    axes.yaxis.set_major_locator(MaxNLocator(nbins=y_bins, steps=_ROUND, symmetric=y_bins == 3))


def finish_signed(axes: Axes, ordinate: str = "", abscissa: str = "") -> None:
    """The same for a quantity of either sign, with a line at zero."""
    finish(axes, ordinate, abscissa, y_bins=6)
    axes.axhline(0.0, color=style.FAINT_INK, linewidth=0.6, zorder=0.9)


def name_above(axes: Axes, ordinate: str = "", abscissa: str = "") -> None:
    """The names of both axes, given or as they are, the ordinate's above the axes and at their left."""
    axes.set_title(ordinate or axes.get_ylabel(), loc="left", pad=7)
    axes.set_ylabel("")
    axes.set_xlabel(abscissa or axes.get_xlabel(), labelpad=2)


def plain_ticks(axes: Axes, digits: int, axis: Literal["x", "y"]) -> None:
    """Tick labels with at most `digits` significant digits, without trailing zeros."""
    chosen = axes.xaxis if axis == "x" else axes.yaxis
    chosen.set_major_formatter(FuncFormatter(lambda value, _: shortest(value, digits)))


def logarithmic(axes: Axes, values: Floats) -> None:
    """A logarithmic ordinate for positive `values`, with ticks over any range."""
    axes.set_yscale("log")
    low, high = (float(values.min()), float(values.max())) if values.size else (0.1, 1.0)
    margin = (high / low) ** 0.08 if high > low else 1.2
    low, high = low / margin, high * margin
    axes.set_ylim(low, high)
    decades = np.log10(high / low)
    if decades < 0.7:
        # A short range may contain no tick at 1, 2 or 5; evenly spaced ticks are set there.
        ticks = MaxNLocator(nbins=4, steps=_COARSE).tick_values(low, high)
        axes.yaxis.set_major_locator(FixedLocator([tick for tick in ticks if low <= tick <= high]))
    else:
        subdivisions = (1.0, 2.0, 5.0) if decades < 2.5 else (1.0,)
        axes.yaxis.set_major_locator(LogLocator(subs=subdivisions, numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.4g}"))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_minor_formatter(NullFormatter())


def make_symmetric(axes: Axes) -> None:
    """Make the range of the ordinate symmetric about zero."""
    largest = max(map(abs, axes.get_ylim()))
    axes.set_ylim(-largest, largest)


def include_zero(axes: Axes, values: Floats) -> None:
    """A range of the ordinate that contains zero, so that slopes and steps are not exaggerated."""
    low, high = min(float(values.min()), 0.0), max(float(values.max()), 0.0)
    margin = 0.06 * (high - low or 1.0)
    axes.set_ylim(low - margin, high + margin)


def vertical_grid(axes: Axes) -> None:
    """Lines of the grid at the ticks of the abscissa only, as beside rows with names."""
    axes.grid(visible=False, axis="y")
    axes.grid(visible=True, axis="x")


def legend(axes: Axes, columns: int = 3, others: int = 0) -> None:
    """A legend above the axes, at their right; the last `others`, which look alike, have one entry."""
    handles, labels = axes.get_legend_handles_labels()
    if others:
        labels[-others:] = [f"{others} other{'s' if others > 1 else ''}"]
    figure = cast(Figure, axes.get_figure(root=True))
    height = axes.get_position().height * figure.get_figheight()
    corner = (1.0, 1.0 + _LEGEND_GAP / height)
    axes.legend(handles[: len(labels)], labels, loc="lower right", bbox_to_anchor=corner, ncols=columns)


def coinciding(lines: Mapping[str, Floats]) -> str:
    """A sentence on lines of a panel, by their labels, that lie on each other: to a two-hundredth of the range."""
    close = 0.005 * max((float(np.abs(line).max()) for line in lines.values()), default=0.0)
    groups: dict[str, list[str]] = {}
    for name, line in lines.items():
        first = next((group for group in groups if np.abs(lines[group] - line).max() <= close), name)
        groups.setdefault(first, []).append(name)
    texts = [f"{', '.join(some)} and {last} coincide" for *some, last in groups.values() if some]
    return f"{'; '.join(texts)}." if texts else ""


def draw_points(
    axes: Axes,
    abscissa: ArrayLike,
    ordinate: ArrayLike,
    *,
    size: float,
    colour: str = style.DATA,
    label: str | None = None,
    zorder: float = 2.0,
) -> None:
    """Points of this diameter [pt], without lines between them and without edges."""
    axes.plot(
        abscissa,
        ordinate,
        linestyle="none",
        marker="o",
        markersize=size,
        markerfacecolor=colour,
        markeredgewidth=0,
        label=label,
        zorder=zorder,
    )


def svg_bytes(figure: Figure) -> bytes:
    """An SVG file with outlines for letters, which looks the same everywhere."""
    return _saved(figure, "path", format="svg", metadata={"Date": None})


def png_bytes(figure: Figure) -> bytes:
    """A picture for a slide or a text processor, 200 dots per inch."""
    return _saved(figure, "path", format="png", dpi=200)


def inline_svg(figure: Figure, *, identifier: str, description: str) -> str:
    """An `<svg>` element that scales with its column; `description` is for screen readers.

    Its letters are text in the font that the page embeds.
    `identifier` keeps the element's names apart from the names in other figures of the page.
    """
    text = _saved(figure, "none", format="svg", metadata={"Date": None}, transparent=True).decode()
    view_box = re.search(r'viewBox="([^"]+)"', text)
    body = text[text.index(">", text.index("<svg")) + 1 : text.rindex("</svg>")]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, flags=re.DOTALL)
    # A hundredth of a point is far below what a screen or a printer shows, and halves the page.
    places = re.compile(r"\bd=\"[^\"]*\"|<use [^>]*>")
    body = places.sub(lambda element: _DIGITS_BEYOND.sub("", element.group()), body)
    body = re.sub(r'(\bid="|url\(#|href="#)', rf"\g<1>{identifier}-", body)
    title = f"{identifier}-title"
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" role="img" '
        f'viewBox="{view_box.group(1) if view_box else "0 0 360 270"}" aria-labelledby="{title}">'
        f'<title id="{title}">{escape(description)}</title>{style.in_variables(body)}</svg>'
    )


def _saved(figure: Figure, font_type: str, **options: Any) -> bytes:
    """A figure as a file; without a date, equal figures are equal files."""
    target = io.BytesIO()
    # Control characters of names are shown as escapes: no font has them, and no XML may.
    for text in figure.findobj(Text):
        text.set_text(escaped_lines(text.get_text()))
    with style.drawn_in_style(), matplotlib.rc_context({"svg.fonttype": font_type}):
        figure.savefig(target, **options)
    return target.getvalue()


# Looked behind, so that nothing is put back: there are ten thousands of numbers on a page.
_DIGITS_BEYOND = re.compile(r"(?<=\.\d\d)\d+")
