"""Section of a study's page on storeys: drift ratio, shear, overturning, ductility, and the limits that they keep."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.base.values import Floats
from mrwork.plots import style
from mrwork.plots.canvas import name_above, small_axes
from mrwork.plots.study_drawing import Stroke, add_height_line, name_heights
from mrwork.report.section import Group, Section, panel
from mrwork.study.comparison import judged_in_words
from mrwork.study.results import StudyResults
from mrwork.study.storeys import OVERTURNING, SHEAR, limits_in_words, storey_table


@style.drawn_in_style()
def profile_figure(
    lines: Mapping[str, tuple[Floats, Stroke]],
    names: Sequence[str],
    axes_names: tuple[str, str],
    shaded: Sequence[Floats] = (),
    limit: float = 0.0,
) -> Figure:
    """Values over the height, those that come last in front, over the range of the rows that are shaded.

    `axes_names` are those of the height and of the values; at a `limit` above 0 is a dashed line.
    """
    figure, axes = small_axes(labelled=True)
    for label, (values, stroke) in lines.items():
        add_height_line(axes, values, stroke, label)
    for values in shaded:
        heights = np.arange(1, len(names) + 1)
        low, high = values.min(axis=0), values.max(axis=0)
        axes.fill_betweenx(heights, low, high, color=style.BAND, linewidth=0.0, zorder=0.5)
    if limit:
        axes.axvline(limit, color=style.INK, linestyle=style.DASHED, linewidth=0.9)
    name_heights(axes, names, numbers=True)
    axes.set_xlim(left=0.0)
    wide = axes.get_xlim()[1] >= 1e4
    axes.xaxis.set_major_locator(MaxNLocator(nbins=2 if wide else 4, steps=[1, 2, 5, 10]))
    name_above(axes, *axes_names)
    return figure


def storey_section(
    results: StudyResults, first: Sequence[int], drawn: Sequence[int], of_row: Sequence[Stroke]
) -> Section | None:
    """Peaks of storeys of the `first` rows, and profiles of shear and overturning of the `drawn` ones."""
    table = storey_table(results, first)
    if table is None:
        return None
    panels = []
    for quantity in (SHEAR, OVERTURNING):
        values = {row: each for row in drawn if (each := quantity.of_runs(results, row)) is not None}
        if values:
            lines = {
                results.rows[row].label: (each.mean(axis=0), of_row[row]) for row, each in values.items()
            }
            panels.append(
                panel(
                    quantity.name.replace("_", "-"),
                    f"{quantity.title} of storeys",
                    profile_figure(lines, results.storey_names, ("Storey", quantity.heading)),
                    f"{quantity.title} of each storey, {len(lines)} arrangements, mean over {judged_in_words(results)}",
                )
            )
    return Section(
        anchor="storeys",
        title="Storeys",
        summary=f"peaks of each, mean over {judged_in_words(results)}.",
        groups=(
            Group(points=tuple(limits_in_words(results)), table=table),
            *((Group(panels=tuple(panels), layout="small"),) if panels else ()),
        ),
    )
