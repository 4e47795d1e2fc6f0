"""Figure files of a run, which `mrwork report RUN --figures` writes."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import partial

from matplotlib.figure import Figure

from mrwork.report import figures
from mrwork.report.comparison import Comparison
from mrwork.report.fit.plan import plan_figure
from mrwork.report.fit.profiles import profiles_figure
from mrwork.report.fit.ranking import ranking_figure
from mrwork.report.fit.search import search_figure
from mrwork.report.progress import OnDrawn, PageProgress, unobserved
from mrwork.report.svg import png_bytes, svg_bytes
from mrwork.store.output_file import write_files
from mrwork.store.run_folder import FIGURES
from mrwork.stored import StoredRun


def write_figures(
    run: StoredRun, comparisons: Sequence[Comparison], *, on_progress: OnDrawn = unobserved
) -> tuple[str, ...]:
    """Write every figure of a run as an SVG and a PNG file into its folder; return their names without suffix.

    Raises
    ------
    OutputError
        Where a file cannot be written; earlier figures stay.
    """
    drawn = run_figures(run, comparisons)
    for number, (name, draw) in enumerate(drawn.items()):
        on_progress(PageProgress(done=number, total=len(drawn), task=f"figure {name}"))
        figure = draw()
        write_files(
            run.place,
            {f"{FIGURES}/{name}.svg": svg_bytes(figure), f"{FIGURES}/{name}.png": png_bytes(figure)},
        )
    return tuple(drawn)


def run_figures(run: StoredRun, comparisons: Sequence[Comparison]) -> dict[str, Callable[[], Figure]]:
    """Functions that draw the figures of a run, by name of file; of several tests the name starts with the test's."""
    unit = figures.common_force_unit(comparisons)
    drawn: dict[str, Callable[[], Figure]] = {"convergence": partial(search_figure, run.fit)}
    for number, comparison in enumerate(comparisons, start=1):
        test = comparison.test
        prefix = "" if len(comparisons) == 1 else f"{number:02d}_{_file_stem(test.name)}_"
        drawn[f"{prefix}force_history"] = partial(figures.force_history, comparison, unit)
        drawn[f"{prefix}hysteresis_loops"] = partial(figures.hysteresis_loops, comparison, unit)
        if test.original is not None:
            drawn[f"{prefix}repair"] = partial(figures.repair_panel, test, test.original, unit)
    if run.profiles is not None:
        drawn["profiles"] = partial(profiles_figure, run.profiles)
    if run.ranking is not None:
        drawn["ranking"] = partial(ranking_figure, run.ranking)
    if run.plan is not None:
        current = run.fit.spec.current
        drawn["plan"] = partial(plan_figure, run.plan.plan, None if current is None else current.unit)
    return drawn


def _file_stem(name: str) -> str:
    return re.sub(r"[^A-Za-z0-9.-]+", "_", name).strip("._") or "test"
