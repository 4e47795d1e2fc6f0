"""Section of a study's page on records at several levels: incremental dynamic analyses, and fragilities."""

from __future__ import annotations

from dataclasses import replace

from matplotlib.figure import Figure

from mrwork.base.numbers import counted
from mrwork.plots import style
from mrwork.plots.canvas import column_axes, grid_of_axes
from mrwork.plots.of_studies import fragility as fragility_curves
from mrwork.plots.of_studies import ida
from mrwork.report.section import Group, Section, panel
from mrwork.study.fragilities import Fragilities, fragility
from mrwork.study.results import StudyResults

# Records and levels from which on a page has the section, and arrangements that it draws.
_RECORDS, _LEVELS, _DRAWN = 2, 3, 6
_PANEL, _COLUMNS = (2.5, 2.3), 3


@style.drawn_in_style()
def fragility_figures(fragilities: Fragilities) -> dict[str, Figure]:
    """By name: intensity over the response, a panel an arrangement, and the probability over it, a curve for each."""
    shown = range(min(len(fragilities.rows), _DRAWN))
    lines, panels = grid_of_axes(len(shown), _COLUMNS, _PANEL)
    ida(fragilities, panels, rows=shown)
    curves, axes = column_axes(left=0.75, top=0.34 + 0.18 * ((len(shown) - 1) // _COLUMNS))
    fragility_curves(fragilities, axes, rows=shown)
    axes.set_ylabel("Probability")
    return {"ida": lines, "fragility": curves}


def fragilities_of_page(results: StudyResults) -> Fragilities | None:
    """Fragilities at the limit of the study; `None` without several records at several levels, or a limit."""
    at, limit = results.record_levels, results.limit or results.building.heights
    few = len(at.records) < _RECORDS or at.levels.size < _LEVELS or len(at.measures) > 1
    if few or not limit or not results.complete:
        return None
    return fragility(results)


def fragility_section(results: StudyResults, fragilities: Fragilities) -> Section:
    """Median intensities at the limit of the study, with both figures."""
    at, (table,) = results.record_levels, fragilities._summary().shown_tables
    figures = fragility_figures(fragilities)
    words = f"{counted(len(at.records), 'record')} at {at.levels.size} levels"
    curves = panel(
        "fragility",
        f"Probability that {fragilities.limit_in_words}",
        figures["fragility"],
        f"Probability over {at.measure} that {fragilities.limit_in_words}, {words}",
        "Points are shares of the records; the bars at one half are bands of the medians.",
    )
    lines = panel(
        "ida",
        "Incremental dynamic analysis",
        figures["ida"],
        f"{at.measure} over {fragilities.title} of {words}",
        "Thin: a record each. Thick: 16, 50 and 84 % of the records lie below. Dashed: the limit.",
    )
    return Section(
        title="Records at several levels",
        summary=f"the {at.measure} at which {fragilities.limit_in_words}, of {words}.",
        groups=(
            Group(
                points=fragilities.in_words(),
                table=replace(table, note=" ".join(f"{caution}." for caution in fragilities.cautions)),
            ),
            Group(panels=(curves,)),
            Group(panels=(lines,), layout="whole"),
        ),
    )
