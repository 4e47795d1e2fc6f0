"""Held-out tests: coverage of each by the bands calibrated on the others."""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter

import numpy as np
from matplotlib.figure import Figure

from mrwork.base.numbers import format_fixed, percent, shortest
from mrwork.base.table import Table, TableColumn, page_table
from mrwork.drawing import style
from mrwork.drawing.canvas import column_axes, draw_points, room_for
from mrwork.errors import escape_text
from mrwork.records import DamperTest
from mrwork.report.section import Absent, Group, panel
from mrwork.uncertainty.bands.calibration_files import StoredBands
from mrwork.uncertainty.bands.conformal import LEVELS, LeftOutCoverage

# The level that the text discusses, and the range of coverage that counts as nominal.
MAIN_LEVEL = 0.9
_NOMINAL = (0.8, 0.97)
_LOW = 0.5
# Fewer tests than this are weak evidence for the next.
_FEW_TESTS = 5
_COLOURS = {0.5: style.DATA, 0.9: style.MODEL, 0.95: style.RESIDUAL}
_ROW = 0.27


def coverage_groups(bands: StoredBands) -> tuple[Group, ...]:
    """Coverage, interval score and cycles of each test left out."""
    rows = _by_test(bands)
    if not rows:
        text = (
            "The coverage is not known, as a single test cannot be left out of its own calibration. Give "
            "`mrwork calibrate` more tests."
        )
        return (Group(prose=(text,)),)
    names = _names(bands, rows)
    figure = panel(
        "coverage",
        "Samples inside the bands",
        coverage_figure(rows, names),
        f"Share of the samples of each of {len(rows)} tests inside its bands at three levels",
        "Each mark should lie at the dotted line of its colour.",
    )
    return (Group(prose=(_verdict(rows),), table=_table(rows, names), panels=(figure,)),)


@style.drawn_in_style()
def coverage_figure(rows: list[dict[float, LeftOutCoverage]], names: list[str]) -> Figure:
    """One line per test, a mark per level."""
    figure, axes = column_axes(left=room_for(names), height=0.34 + 0.5 + _ROW * len(rows) + 0.2)
    for level in LEVELS:
        axes.axvline(100 * level, color=_COLOURS[level], linewidth=1.0, linestyle=style.DOTTED)
        covered = [100 * row[level].samples.coverage for row in rows]
        label = f"{100 * level:.0f} %"
        draw_points(axes, covered, range(len(rows)), size=5.5, colour=_COLOURS[level], label=label)
    axes.set_yticks(range(len(rows)), list(map(escape_text, names)))
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(0, 102)
    axes.set_xlabel("Samples inside (%)")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3)
    return figure


def _by_test(bands: StoredBands) -> list[dict[float, LeftOutCoverage]]:
    by_test: dict[str, dict[float, LeftOutCoverage]] = {}
    for row in bands.coverage:
        by_test.setdefault(row.test, {})[row.level] = row
    return [row for row in by_test.values() if set(LEVELS) <= set(row)]


def _names(bands: StoredBands, rows: list[dict[float, LeftOutCoverage]]) -> list[str]:
    """Names of the tests without their folders."""
    known = {each.test.label: each.test for each in bands.predictions}
    tests = [row[MAIN_LEVEL].test for row in rows]
    return [known[name].name if name in known else name for name in tests]


def conditions_in_words(test: DamperTest) -> str:
    """Name of a test with its command, amplitude and frequency, as far as these are known."""
    parts = [(test.amplitude, "mm", 1e3), (test.frequency, "Hz", 1.0)]
    known = [f"{shortest(value * factor)} {unit}" for value, unit, factor in parts if value is not None]
    if test.commands:
        known.insert(0, test.command_in_words)
    return f"{test.name} ({', '.join(known)})" if known else test.name


def coverage_summary(bands: StoredBands) -> str:
    """What the 90 % bands hold of tests left out, a sentence; of few tests the extremes, not a mean."""
    shares = [row[MAIN_LEVEL].samples.coverage for row in _by_test(bands)]
    if not shares:
        return "calibrated on one test, so their coverage is not known."
    span = f"{percent(min(shares), 0)} to {percent(max(shares), 0)} % of the samples of {len(shares)} tests left out"
    if len(shares) < _FEW_TESTS:
        return f"the 90 % bands contain {span}: too few tests to rely on."
    return f"the 90 % bands contain {span}, {percent(float(np.mean(shares)), 0)} % on average."


def _verdict(rows: list[dict[float, LeftOutCoverage]]) -> str:
    shares = [row[MAIN_LEVEL].samples.coverage for row in rows]
    mean, others = float(np.mean(shares)), "other" if len(shares) == 2 else f"other {len(shares) - 1}"
    text = (
        f"The band of each test is calibrated on the {others} only. On average {percent(mean)} % "
        f"of the samples lie inside the 90 % bands, from {percent(min(shares))} to "
        f"{percent(max(shares))} %. "
    )
    if _NOMINAL[0] <= mean <= _NOMINAL[1]:
        text += "The bands have about their nominal coverage on tests like these."
    elif mean < _NOMINAL[0]:
        text += "The bands are too narrow: the errors of these tests differ more than a few tests can show."
    else:
        text += "The bands are wider than necessary for tests like these."
    low = [share for share in shares if share < _NOMINAL[0]]
    if low and mean >= _NOMINAL[0]:
        text += f" For {len(low)} of {len(shares)} tests they are still too narrow."
    if len(shares) < _FEW_TESTS:
        text += f" With only {len(shares)} tests, this is weak evidence for the next test."
    cycles = [row[MAIN_LEVEL].cycles_inside for row in rows if np.isfinite(row[MAIN_LEVEL].cycles_inside)]
    if cycles and min(cycles) < _LOW:
        text += (
            f" By dissipated energy {percent(float(np.mean(cycles)), 0)} % of the cycles lie inside; the cycles of one "
            "test are alike, so nearly all or nearly none of them do."
        )
    return text


def _table(rows: list[dict[float, LeftOutCoverage]], names: list[str]) -> Table:
    cells = np.array([_cells(row) for row in rows])
    means = [
        float(np.mean(known)) if (known := column[np.isfinite(column)]).size else np.nan for column in cells.T
    ]
    headings = (
        ("test", ""),
        *((f"in {100 * level:.0f} % band", "%") for level in LEVELS),
        ("cycles in 90 %", "%"),
        ("width of 90 %", ""),
        ("interval score", ""),
    )
    return page_table(
        "Coverage of tests left out",
        [
            TableColumn(heading=heading, unit=unit, cell=itemgetter(place))
            for place, (heading, unit) in enumerate(headings)
        ],
        [(name, *_texts(values)) for name, values in zip(names, cells.tolist(), strict=True)],
        foot=("Mean", *_texts(means)),
        note="A cycle is inside where its dissipated energy lies in the 90 % band of the energy. Width and interval "
        "score are in standard deviations of the test's force. The score is the mean width plus twenty times the "
        "mean distance of samples outside; lower is better.",
    )


def _cells(row: dict[float, LeftOutCoverage]) -> list[float]:
    main = row[MAIN_LEVEL]
    shares = [row[level].samples.coverage for level in LEVELS]
    return [*shares, main.cycles_inside, main.samples.width, main.samples.interval_score]


def _texts(values: Sequence[float]) -> list[str]:
    *shares, width, score = values
    return [*map(percent, shares), format_fixed(width, 3), format_fixed(score, 3)]


ABSENT = Absent(
    title="Prediction bands",
    command="mrwork calibrate RUN TESTS",
    description="calibrates prediction bands from the errors of the fit on tests that it has not seen; without TESTS "
    "the run's own tests are left out in turn.",
)
"""What a run without bands lacks."""
