"""Section of a study's page on storeys: drift ratio, shear, overturning, ductility, and the limits that they keep."""

from __future__ import annotations

from collections.abc import Sequence

from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from mrwork.plots import style
from mrwork.plots.canvas import name_above, small_axes
from mrwork.plots.of_studies import name_heights, storey_profiles
from mrwork.report.section import Group, Section, panel
from mrwork.study.comparison import judged_in_words
from mrwork.study.results import StudyResults
from mrwork.study.storeys import OVERTURNING, SHEAR, limits_in_words, storey_table


@style.drawn_in_style()
def profile_figure(
    results: StudyResults, quantity: str, rows: Sequence[int], behind: Sequence[int] = ()
) -> Figure:
    """A quantity over the height, mean over the judged motions, with numbers of storeys or floors at the ordinate."""
    figure, axes = small_axes()
    storey_profiles(results, axes, quantity=quantity, rows=rows, behind=behind, legend=False)
    of_floors = quantity == "peak_acceleration"
    names = results.floor_names if of_floors else results.storey_names
    name_heights(axes, names, numbers=True)
    name_above(axes, "Floor" if of_floors else "Storey")
    wide = axes.get_xlim()[1] >= 1e4
    axes.xaxis.set_major_locator(MaxNLocator(nbins=2 if wide else 4, steps=[1, 2, 5, 10]))
    return figure


def storey_section(results: StudyResults, first: Sequence[int], drawn: Sequence[int]) -> Section | None:
    """Peaks of storeys of the `first` rows, and profiles of shear and overturning of the `drawn` ones."""
    table = storey_table(results, first)
    if table is None:
        return None
    panels = []
    for quantity in (SHEAR, OVERTURNING):
        known = [row for row in drawn if quantity.of_runs(results, row) is not None]
        if known:
            panels.append(
                panel(
                    quantity.name.replace("_", "-"),
                    f"{quantity.title} of storeys",
                    profile_figure(results, quantity.name, known),
                    f"{quantity.title} of each storey, {len(known)} arrangements, mean over {judged_in_words(results)}",
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
