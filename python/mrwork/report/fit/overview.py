"""All tests of a fit at a glance: which are drawn in full, a small loop of each, and findings that recur."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mrwork.identification.result import FitSpread
from mrwork.records.findings import gathered_findings
from mrwork.report import numbers
from mrwork.report.comparison import Comparison
from mrwork.report.figures import common_force_unit, small_velocity_loops
from mrwork.report.section import Group, Panel, Section, panel

ANCHOR = "tests"
# Up to so many tests are all drawn in full.
_ALL_IN_FULL = 4


def drawn_in_full(comparisons: Sequence[Comparison], *, every_test: bool = False) -> dict[int, str]:
    """Indices of the tests with figures of their own, and what each stands for: the best, median and worst of many."""
    if every_test or len(comparisons) <= _ALL_IN_FULL:
        return dict.fromkeys(range(len(comparisons)), "")
    order = np.argsort(
        [-comparison.quality.fit_percent for comparison in comparisons], kind="stable"
    ).tolist()
    return {order[0]: "Best fit", order[len(order) // 2]: "Median fit", order[-1]: "Worst fit"}


def has_small_loops(comparisons: Sequence[Comparison]) -> bool:
    """Whether every test is drawn small: where not all are drawn in full by default."""
    return len(comparisons) > _ALL_IN_FULL


def overview(comparisons: Sequence[Comparison], *, on_test: Callable[[str], None]) -> Section | None:
    """Median and worst fit, a small loop of each of many tests, and recurring findings; `None` for a single test."""
    if len(comparisons) < 2:
        return None
    spread = FitSpread.of(
        [each.test.name for each in comparisons], [each.quality.fit_percent for each in comparisons]
    )
    prose = [f"{spread.in_words}."]
    panels: tuple[Panel, ...] = ()
    if has_small_loops(comparisons):
        prose.append(
            "Force against velocity of every test over a few cycles: grey as recorded, blue the model. The best, the "
            "median and the worst fit follow in full; `mrwork report RUN --all-tests` draws every test in full."
        )
        panels = _small_panels(comparisons, on_test)
    shared = gathered_findings([each.test for each in comparisons]).shared
    groups = [Group(prose=tuple(prose), panels=panels, layout="small")]
    if shared:
        groups.append(
            Group(title="Findings in several tests", points=tuple(each.in_words for each in shared))
        )
    return Section(anchor=ANCHOR, title="All tests", summary="", groups=tuple(groups))


def _small_panels(comparisons: Sequence[Comparison], on_test: Callable[[str], None]) -> tuple[Panel, ...]:
    unit = common_force_unit(comparisons)
    panels = []
    loops = small_velocity_loops(comparisons, unit)
    for number, (comparison, figure) in enumerate(zip(comparisons, loops, strict=True), start=1):
        name, percent = comparison.test.name, numbers.fixed(comparison.quality.fit_percent, 1)
        on_test(name)
        panels.append(
            panel(
                f"o{number}",
                name + (" (synthetic)" if comparison.test.synthetic else ""),
                figure,
                f"Force against velocity of test {name}, {comparison.data_label} and model, fit {percent} %",
                f"fit {percent} %",
            )
        )
    return tuple(panels)
