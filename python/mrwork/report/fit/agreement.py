"""The tests of a fit on its page: all at a glance, and each with its agreement, figures and findings."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import get_args

import numpy as np
from matplotlib.figure import Figure

from mrwork.base import numbers
from mrwork.identification.fit import Fit, FitQuality
from mrwork.identification.result import FitSpread
from mrwork.records.damper_test import DamperTest, Finding
from mrwork.records.findings import gathered_findings
from mrwork.report import figures
from mrwork.report.figures import Comparison, Motion, common_force_unit, small_velocity_loops, zoom_window
from mrwork.report.section import Group, Panel, Section, panel
from mrwork.report.style import DisplayUnit

_THIN = "\N{NARROW NO-BREAK SPACE}"
_MIDDLE_DOT = " · "


AgreementRow = tuple[str, ...]
"""How the model agrees with one test or with all: fit, NRMSE, RMSE and the others of the table of the page, as text."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TestBlock:
    """Contents of the page on one test.

    `anchor` is its place on the page, `role` what it stands for among many tests; without `panels` it has no part of
    its own.
    """

    anchor: str
    name: str
    role: str
    synthetic: bool
    conditions: str
    agreement: AgreementRow
    findings: tuple[Finding, ...]
    panels: tuple[Panel, ...]


def blocks_of_tests(
    comparisons: Sequence[Comparison],
    agreement: Sequence[AgreementRow],
    *,
    drawn: Mapping[int, str],
    on_test: Callable[[str], None],
) -> list[TestBlock]:
    """Contents of the page on each test, in order, all forces in one unit.

    Those in `drawn`, indices with their roles, have figures; `on_test` hears of each before it is drawn.
    """
    unit = figures.common_force_unit(comparisons)
    blocks = []
    for number, (comparison, row) in enumerate(zip(comparisons, agreement, strict=True)):
        panels: tuple[Panel, ...] = ()
        if number in drawn:
            on_test(comparison.test.name)
            panels = _test_panels(f"t{number + 1}", comparison, row, unit)
        blocks.append(_test_block(number + 1, comparison, row, panels, drawn.get(number, "")))
    return blocks


def agreement_rows(fit: Fit, comparisons: Sequence[Comparison]) -> list[AgreementRow]:
    """A row per test and, last, one for all tests together; equal decimals down each column."""
    tested = [comparison.quality for comparison in comparisons]
    every: list[FitQuality | Fit] = [*tested, fit]
    norms = [entry.error_norms for entry in every]
    columns = [
        [numbers.format_fixed(entry.fit_percent, 2) for entry in every],
        numbers.column([entry.nrmse for entry in every], 3),
        numbers.column([entry.rmse_n for entry in every], 3),
        numbers.column([norm.time for norm in norms], 3),
        numbers.column([norm.displacement for norm in norms], 3),
        numbers.column([norm.velocity for norm in norms], 3),
        [*(numbers.format_fixed(each.residual_autocorrelation, 4) for each in tested), ""],
        [numbers.format_fixed(entry.n_time, 0) for entry in every],
        [*(numbers.format_fixed(each.substeps, 0) for each in tested), ""],
    ]
    return list(zip(*columns, strict=True))


def count_findings(comparisons: Sequence[Comparison]) -> str:
    """The number of findings of the checks, in words."""
    severities = [finding.severity for comparison in comparisons for finding in comparison.test.findings]
    parts = [
        f"{count} {word}{'s' if count > 1 else ''}"
        for word, count in (
            ("warning", severities.count("warning")),
            ("note", severities.count("note")),
            ("repair", severities.count("repaired")),
        )
        if count
    ]
    records = "the record" if len(comparisons) == 1 else f"{len(comparisons)} records"
    return f"the checks of {records} found {', '.join(parts) or 'nothing to report'}."


def _test_block(
    number: int, comparison: Comparison, agreement: AgreementRow, panels: tuple[Panel, ...], role: str
) -> TestBlock:
    test = comparison.test
    return TestBlock(
        anchor=f"test-{number}" if panels else ANCHOR,
        name=test.name,
        role=role,
        synthetic=test.synthetic,
        conditions=_conditions(test, comparison.quality),
        agreement=agreement,
        findings=tuple(sorted(test.findings, key=lambda finding: finding.severity != "warning")),
        panels=panels,
    )


def _conditions(test: DamperTest, quality: FitQuality) -> str:
    """Command, motion and sampling of a test, and the observation model of its force, in one line."""
    observed = ", ".join(filter(None, (quality.observation.in_words, quality.nuisance.in_words)))
    window = test.window
    ends = [
        f"{end} {numbers.shortest(n_left * test.dt, 2)}{_THIN}s"
        for end, n_left in (("first", window.start), ("last", test.n_time - window.stop))
        if n_left
    ]
    n_bridged = len(range(test.n_time)[window]) - test.n_counted
    parts = [
        test.command_in_words,
        _quantity(None if test.amplitude is None else 1e3 * test.amplitude, "mm"),
        _quantity(test.frequency, "Hz"),
        f"{numbers.format_fixed(test.n_time, 0)} samples every {numbers.shortest(1e3 * test.dt)}{_THIN}ms",
        f"velocity {test.velocity_source}",
        f"{' and '.join(ends)} not compared" if ends else "",
        f"{n_bridged} interpolated samples not compared" if n_bridged else "",
        f"model force {observed}" if observed else "",
    ]
    return _MIDDLE_DOT.join(part for part in parts if part)


def _test_panels(
    identifier: str, comparison: Comparison, agreement: AgreementRow, unit: DisplayUnit
) -> tuple[Panel, ...]:
    test, data = comparison.test, comparison.data_label
    agrees = f"for test {test.name}: {data} and model, fit {agreement[0]} %, RMSE {agreement[2]} N"
    window = zoom_window(test.displacement)
    in_window = _thinning(window.stop - window.start, figures.POINTS_IN_WINDOW)
    in_loop = _thinning(test.n_time, figures.POINTS_IN_LOOP)

    def of(suffix: str, title: str, figure: Figure, what: str, note: str) -> Panel:
        return panel(f"{identifier}-{suffix}", title, figure, f"{what} {agrees}", note)

    of_motion = (
        (f"Force against {over}", over, partial(figures.draw_loop, over)) for over in get_args(Motion)
    )
    panels: tuple[Panel, ...] = (
        of(
            "record",
            "Whole record",
            figures.one_column(comparison, unit, figures.draw_record),
            "Force against time over the whole record, with the residual below,",
            f"Residual: {data} minus model. The shaded part is enlarged in the next figure.",
        ),
        of(
            "cycles",
            _window_title(comparison),
            figures.one_column(comparison, unit, figures.draw_cycles),
            "Force against time over a few cycles, with the residual below,",
            in_window,
        ),
        *(
            of(over, title, figures.one_column(comparison, unit, draw), title, in_loop)
            for title, over, draw in of_motion
        ),
    )
    if test.has_varying_command:
        panels += (
            panel(
                f"{identifier}-command",
                "Command",
                figures.one_column(comparison, unit, figures.draw_command),
                f"Command against time of test {test.name}, {test.command_in_words}",
                "The loops belong to the whole record, so they are wide where the command changes.",
            ),
        )
    return (
        panels if test.original is None else (*panels, _repair_panel(identifier, test, test.original, unit))
    )


def _repair_panel(identifier: str, test: DamperTest, original: DamperTest, unit: DisplayUnit) -> Panel:
    return panel(
        f"{identifier}-repair",
        "Before and after repair",
        figures.repair_panel(test, original, unit),
        f"Force against displacement of test {test.name}, as recorded and repaired",
        "The findings below list the repairs; the model is compared with the repaired record.",
    )


def _window_title(comparison: Comparison) -> str:
    window = zoom_window(comparison.test.displacement)
    if window.first_cycle is None:
        return "Middle of the record"
    if window.n_cycles == 1:
        return f"Cycle {window.first_cycle}"
    return f"Cycles {window.first_cycle} to {window.first_cycle + window.n_cycles - 1}"


def _thinning(n_time: int, drawn: int) -> str:
    if n_time <= drawn:
        return ""
    return f"About {drawn} of {numbers.format_fixed(n_time, 0)} samples are drawn, and the model force at every sample."


def _quantity(value: float | None, unit: str) -> str:
    return "" if value is None else f"{numbers.shortest(value)}{_THIN}{unit}"


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
    return Section(anchor=ANCHOR, title="All tests", groups=tuple(groups))


def _small_panels(comparisons: Sequence[Comparison], on_test: Callable[[str], None]) -> tuple[Panel, ...]:
    unit = common_force_unit(comparisons)
    panels = []
    loops = small_velocity_loops(comparisons, unit)
    for number, (comparison, figure) in enumerate(zip(comparisons, loops, strict=True), start=1):
        name, percent = comparison.test.name, numbers.format_fixed(comparison.quality.fit_percent, 1)
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
