"""What a figure shows, as numbers: points of its curves, bars and fills in the units of its axes.

The figure itself is asked, so that no figure states its numbers a second time.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, cast

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.collections import Collection, QuadMesh
from matplotlib.container import BarContainer
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.text import Text
from matplotlib.ticker import FixedLocator

from mrwork.base.arguments import checked
from mrwork.base.table import csv_text
from mrwork.base.values import Floats

if TYPE_CHECKING:
    from mrwork.base.labelled import DataFrame

_COLUMNS = ("panel", "abscissa", "ordinate", "curve", "x", "y")
_Row = tuple[str | float | None, ...]


@checked
def drawn_data(figure: Figure | Axes | Iterable[Axes]) -> DataFrame:
    """What a figure draws as a table: a row for each point of its curves, bars and fills, in the units of its axes.

    A bar has its two ends, a fill its outline, and words in a panel, such as the numbers of a map, stand for a curve.
    Where a figure draws fewer points than a result has, the table has those drawn. Pages have the same table as CSV.

    Parameters
    ----------
    figure
        A figure, also one of your own, or axes: what the functions of `mr.plots` return.

    Returns
    -------
    pandas.DataFrame
        `panel` is the title or the number of the axes, `abscissa` and `ordinate` are the labels of both axes with
        units, `curve` is the label, the `gid` or the number of a curve. `x` and `y` are numbers, names where an axis
        has names, and missing for what runs across the whole panel.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.synthetic_motion(duration=5.0).plot.spectra(periods=[0.5, 1.0])
    >>> table = mr.plots.drawn_data(axes)
    >>> table["abscissa"][0], table["x"].tolist()
    ('Period (s)', [0.5, 1.0])
    """
    from pandas import DataFrame

    return DataFrame(_rows(figure), columns=_COLUMNS)


def drawn_csv(figure: Figure) -> str:
    """The same as the text of a CSV file, numbers to six digits."""
    return csv_text([_COLUMNS, *(tuple(map(_cell, row)) for row in _rows(figure))])


def _cell(value: str | float | None) -> str:
    return f"{value:.6g}" if isinstance(value, float) else value or ""


def _rows(figure: Figure | Axes | Iterable[Axes]) -> list[_Row]:
    several = figure.axes if isinstance(figure, Figure) else [figure] if isinstance(figure, Axes) else figure
    panels = np.ravel(np.array([*several], dtype=object))
    return [row for number, axes in enumerate(panels, start=1) for row in _rows_of(axes, str(number))]


def _rows_of(axes: Axes, panel: str) -> Iterator[_Row]:
    title = axes.get_title(loc="left")
    sharing = (axes, *axes.get_shared_x_axes().get_siblings(axes))
    abscissa = next((sibling.get_xlabel() for sibling in sharing if sibling.get_xlabel()), "")
    of_panel = (title or panel, abscissa, axes.get_ylabel() or title)
    names = [_names(axis) for axis in (axes.xaxis, axes.yaxis)]
    drawn = (container for container in axes.containers if isinstance(container, BarContainer))
    bars: dict[Artist, BarContainer] = {bar: container for container in drawn for bar in container.patches}
    fills = [collection for collection in axes.collections if not isinstance(collection, QuadMesh)]
    words = [text for text in axes.texts if text.get_transform() == axes.transData]
    for number, part in enumerate((*axes.lines, *axes.patches, *fills, *words), start=1):
        label = part.get_text() if isinstance(part, Text) else str((bars.get(part) or part).get_label())
        curve = label if label and not label.startswith("_") else part.get_gid() or f"curve {number}"
        points = _points(part, bars)
        known = part.get_transform().contains_branch_seperately(axes.transData)
        columns = [
            [named.get(value, value) if is_known else None for value in values]
            for values, named, is_known in zip(points.T.tolist(), names, known, strict=True)
        ]
        pairs = zip(*columns, strict=True)
        yield from ((*of_panel, curve, *pair) for pair in (pairs if all(known) else dict.fromkeys(pairs)))


def _points(part: Artist, bars: dict[Artist, BarContainer]) -> Floats:
    """Finite points of a curve, of the middle of a bar or of the outlines of fills, shape (n, 2)."""
    if isinstance(part, Line2D):
        points = np.asarray(part.get_xydata(), dtype=float)
    elif isinstance(part, Rectangle) and part in bars:
        points = np.array(part.get_bbox().get_points())
        across = 1 if bars[part].orientation == "horizontal" else 0
        points[:, across] = points[:, across].mean()
    elif isinstance(part, Patch):
        # A rectangle is a unit square that its own transform moves.
        points = part.get_patch_transform().transform(part.get_path().vertices)
    elif isinstance(part, Text):
        points = np.array([part.get_position()], dtype=float)
    else:
        part = cast(Collection, part)
        offsets = np.asarray(part.get_offsets(), dtype=float)
        outlines = [path.vertices for path in part.get_paths()]
        points = offsets if offsets.any() else np.concatenate(outlines or [np.empty((0, 2))])
    finite: Floats = points[np.isfinite(points).all(axis=1)]
    return finite


def _names(axis: Axis) -> dict[float, str]:
    """Names at the ticks of an axis that has chosen ones, where they are not the numbers."""
    locator, text = axis.get_major_locator(), axis.get_major_formatter()
    if not isinstance(locator, FixedLocator):
        return {}
    ticks = np.asarray(axis.get_majorticklocs(), dtype=np.float64).tolist()
    return {tick: name for tick in ticks if (name := text(tick)) not in ("", _cell(tick))}
