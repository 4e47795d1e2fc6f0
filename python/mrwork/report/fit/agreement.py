"""The tests of a fit on its page: all at a glance, each with its figures and remarks, and errors by amplitude."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
from markupsafe import Markup
from matplotlib.figure import Figure
from numpy.typing import NDArray

from mrwork.base import numbers
from mrwork.base.table import Column, Table
from mrwork.base.values import Floats
from mrwork.dampers.tested_range import half_cycle_ends
from mrwork.identification.fit import Fit, FitQuality
from mrwork.plots.of_tests import Motion, data_label
from mrwork.plots.samples import zoom_window
from mrwork.records.damper_test import DamperTest
from mrwork.records.remarks import gathered_remarks
from mrwork.report.fit import figures
from mrwork.report.fit.residuals import residual_panels
from mrwork.report.section import Group, Panel, Section, panel
from mrwork.uncertainty.bands.prediction import Prediction
from mrwork.uncertainty.bands.predictions import spread_of

# Up to so many tests are all drawn in full.
_ALL_IN_FULL = 4


def tests_section(
    fit: Fit, predictions: Sequence[Prediction], *, every_test: bool, before: Callable[[str], None]
) -> Section:
    """The errors of every test, a small loop of each of many, and figures of some in full.

    Of many tests these are the best, the median and the worst, or with `every_test` all; figures of the residual are of
    the worst alone. `before` hears of each test before it is drawn.
    """
    unit, spread = figures.common_unit(predictions), spread_of(predictions)
    are_many = len(predictions) > _ALL_IN_FULL
    drawn = dict.fromkeys(range(len(predictions)), "")
    if are_many and not every_test:
        order = np.argsort([-prediction.fit_percent for prediction in predictions], kind="stable").tolist()
        drawn = {order[0]: "Best fit", order[len(order) // 2]: "Median fit", order[-1]: "Worst fit"}
    worst = min(drawn, key=lambda number: predictions[number].fit_percent)
    small, blocks = [], dict[int, Group]()
    for number, prediction in enumerate(predictions):
        before(f"test {prediction.test.name}")
        if are_many:
            loop = figures.small_loop(prediction, unit, over="velocity")
            small.append(loop_panel(f"o{number + 1}", prediction, loop))
        if number in drawn:
            more = residual_panels(prediction, unit) if number == worst else ()
            blocks[number] = _test_group(number, drawn[number], prediction, fit.quality[number], unit, more)
    overview = Group(
        prose=(
            "Force against velocity of every test over a few cycles: grey as recorded, blue the model. The best, the "
            "median and the worst fit follow in full; `mrwork report RUN --all-tests` draws every test so.",
        ),
        panels=tuple(small),
        layout="small",
    )
    shared = gathered_remarks([prediction.test for prediction in predictions]).shared
    recurring = Group(title="Remarks in several tests", points=tuple(remark.in_words for remark in shared))
    one = f"fit {numbers.format_fixed(fit.fit_percent, 2)} %, RMSE {numbers.significant(fit.rmse_n, 3)} N"
    text, records = (
        (one, "the record") if len(predictions) == 1 else (spread.in_words, f"{len(predictions)} records")
    )
    counts = Counter[str](remark.severity for prediction in predictions for remark in prediction.test.remarks)
    kinds = {"warning": "warning", "note": "note", "repaired": "repair"}
    parts = [numbers.counted(counts[kind], noun) for kind, noun in kinds.items() if counts[kind]]
    return Section(
        title="Agreement with the fitted tests",
        summary=f"{text}; the checks of {records} found {', '.join(parts) or 'nothing to report'}.",
        groups=(
            Group(table=_agreement_table(fit, predictions)),
            *([overview] if are_many else []),
            *([recurring] if len(predictions) > 1 and shared else []),
            *(blocks[number] for number in drawn),
        ),
    )


def _test_group(
    number: int, role: str, prediction: Prediction, quality: FitQuality, unit: str, more: Sequence[Panel]
) -> Group:
    test = prediction.test
    remarks = sorted(test.remarks, key=lambda remark: remark.severity != "warning")
    return Group(
        title=f"{role}: {test.name}" if role else test.name,
        synthetic=test.synthetic,
        prose=(_conditions(test, quality),),
        panels=(*_test_panels(f"t{number + 1}", prediction, unit), *more),
        points=tuple(remark.in_words for remark in remarks),
    )


def _agreement_table(fit: Fit, predictions: Sequence[Prediction]) -> Table:
    """A row per test and, of several, one for all together; equal decimals down each column."""
    every: list[FitQuality | Fit] = [*fit.quality, fit]
    norms = [entry.error_norms for entry in every]

    def column(values: Sequence[float]) -> list[str]:
        decimals = numbers.decimals_of(values, 3)
        return [numbers.format_fixed(value, decimals) for value in values]

    all_tests = "-" if fit.has_constant else numbers.format_fixed(fit.fit_percent, 2)
    columns = {
        "Test": [*(figures.name_of(prediction.test) for prediction in predictions), "All tests"],
        "Fit (%)": [*(quality.fit_in_words for quality in fit.quality), all_tests],
        "RMSE (N)": column([entry.rmse_n for entry in every]),
        _norm("t"): column([norm.time for norm in norms]),
        _norm("x"): column([norm.displacement for norm in norms]),
        _norm("v"): column([norm.velocity for norm in norms]),
        "Samples": [numbers.format_fixed(entry.n_time, 0) for entry in every],
        "Sub-steps": [*(numbers.format_fixed(quality.substeps, 0) for quality in fit.quality), ""],
    }
    *rows, together = zip(*columns.values(), strict=True)
    return Table(
        label="Agreement with each test",
        columns=tuple(columns),
        rows=tuple(rows),
        foot=together if len(rows) > 1 else (),
        note="The model is simulated freely: its input is the motion, never the force. E with t, x and v are the "
        "normed errors over time, displacement and velocity (Spencer et al. 1997); the first is the NRMSE, the RMSE "
        "over the standard deviation of the force, and the fit is 100 % less it. Sub-steps are integration steps per "
        "sample.",
    )


def _norm(letter: str) -> Markup:
    return Markup("<i>E<sub>{}</sub></i>").format(letter)


def excitation(test: DamperTest) -> list[str]:
    """Command, amplitude and frequency of a test, as far as these are known."""
    sizes = ((test.amplitude, 1e3, "mm"), (test.frequency, 1.0, "Hz"))
    values = [
        f"{numbers.shortest(value * factor)} {unit}" for value, factor, unit in sizes if value is not None
    ]
    return [test.command_in_words, *values] if test.commands else values


def _conditions(test: DamperTest, quality: FitQuality) -> str:
    """Command, motion and sampling of a test, and the observation model of its force, in one line."""
    window = test.window
    ends = [
        f"{end} {numbers.shortest(n_left * test.dt, 2)} s"
        for end, n_left in (("first", window.start), ("last", test.n_time - window.stop))
        if n_left
    ]
    n_bridged = len(range(test.n_time)[window]) - test.n_counted
    parts = [
        *excitation(test),
        f"{numbers.format_fixed(test.n_time, 0)} samples every {numbers.shortest(1e3 * test.dt)} ms",
        f"velocity {test.velocity_source}",
        f"{' and '.join(ends)} not compared" if ends else "",
        f"{n_bridged} interpolated samples not compared" if n_bridged else "",
        f"model force {quality.recorded_in_words}" if quality.recorded_in_words else "",
    ]
    return " · ".join(filter(None, parts))


def _test_panels(identifier: str, prediction: Prediction, unit: str) -> tuple[Panel, ...]:
    test, data = prediction.test, data_label(prediction.test)
    record = figures.shaded(figures.history_figure(prediction, unit), test)
    note = f"Residual: {data} minus model. The shaded part is enlarged in the next figure."
    enlarged = figures.history_figure(figures.few_cycles(prediction), unit)
    drawn = [
        ("record", "Whole record", record, note),
        ("cycles", zoom_window(test.displacement).in_words, enlarged, ""),
        *(
            (over, f"Force against {over}", figures.loop_figure(prediction, unit, over), "")
            for over in get_args(Motion)
        ),
    ]
    if test.has_varying_command:
        wide = "The loops belong to the whole record, so they are wide where the command changes."
        drawn.append(("command", "Command", figures.shaded(figures.command_figure(prediction), test), wide))
    if test.original is not None:
        changed = "The remarks below list the repairs; the model is compared with the repaired record."
        repair = figures.repair_figure(test, test.original, unit)
        drawn.append(("repair", "Before and after repair", repair, changed))
    what = f"of test {test.name}: {data} and model, fit {numbers.format_fixed(prediction.fit_percent, 2)} %"
    return tuple(
        panel(f"{identifier}-{suffix}", title, figure, f"{title} {what}", note)
        for suffix, title, figure, note in drawn
    )


def loop_panel(identifier: str, drawn: Prediction, figure: Figure, title: str = "") -> Panel:
    """A small loop of a test with its name and its fit."""
    name, fitted = figures.name_of(drawn.test), f"fit {numbers.format_fixed(drawn.fit_percent, 1)} %"
    what = f"Force against velocity of test {drawn.test.name}, {data_label(drawn.test)} and model, {fitted}"
    return panel(identifier, title or name, figure, what, f"{name}, {fitted}" if title else fitted)


# Upper ends of the classes in each decade of millimetres; the amplitudes that rigs are set to lie between them.
_ENDS = (1.7, 3.4, 7.0)
# An error relative to the force is larger by this factor before the text says so.
_LARGER = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _HalfCycles:
    """Half cycles of similar amplitude: their amplitudes in words, their number, and errors of their samples."""

    in_words: str
    count: int
    n_time: float
    rmse_n: float
    relative: float

    @classmethod
    def of(cls, half_cycles: Floats) -> _HalfCycles:
        """Half cycles with their amplitude [m], and the sums of `_half_cycles` over their samples, shape (4, n)."""
        ends = dict.fromkeys(numbers.shortest(1e3 * end, 2) for end in np.quantile(half_cycles[0], (0, 1)))
        count, errors, forces = half_cycles[1:].sum(axis=1).tolist()
        return cls(
            in_words=f"{' to '.join(ends)} mm",
            count=half_cycles.shape[1],
            n_time=count,
            rmse_n=math.sqrt(errors / count),
            relative=math.sqrt(errors / forces) if forces > 0.0 else math.nan,
        )


def amplitude_section(predictions: Sequence[Prediction]) -> Section | None:
    """A table of the errors by classes of amplitude, and what it shows; `None` where no half cycle is compared."""
    every = np.concatenate([_half_cycles(prediction) for prediction in predictions], axis=1)
    number = _classes(every[0])
    parts = [every[:, number == index] for index in np.unique(number)]
    rows = [_HalfCycles.of(part) for part in parts if part[1].any()]
    if not rows:
        return None
    largest, worst = rows[-1], max(rows, key=lambda row: row.relative)
    prose = (
        f"In half cycles of {worst.in_words} the error over the force is "
        f"{numbers.shortest(worst.relative / largest.relative, 2)} times that in those of {largest.in_words}. "
        "Earthquakes demand mostly small half cycles; a model with backlash may predict them better."
    )
    summary = f"all half cycles are of {worst.in_words}."
    if len(rows) > 1:
        shares = [f"{numbers.percent(row.relative)} % in those of {row.in_words}" for row in rows]
        summary = f"RMSE over the RMS force of the half cycles, {', '.join(shares)}."
        rows.append(replace(_HalfCycles.of(every), in_words="all"))
    decimals = numbers.decimals_of([row.rmse_n for row in rows], 3)
    table = Table.of(
        (
            Column("in_words", "amplitude"),
            Column("count", "half cycles", shown=lambda count: numbers.format_fixed(count, 0)),
            Column("n_time", "samples", shown=lambda count: numbers.format_fixed(count, 0)),
            Column("rmse_n", "RMSE", "N", shown=lambda rmse: numbers.format_fixed(rmse, decimals)),
            Column("relative", "RMSE / RMS force", "%", shown=numbers.percent),
        ),
        rows,
        label="Errors by amplitude of the half cycles",
        note="The amplitude is half the displacement from one reversal to the next; the motion before the first "
        "reversal and after the last has none.",
    )
    advice = (prose,) if worst.relative > _LARGER * largest.relative else ()
    return Section(title="Errors by amplitude", summary=summary, groups=(Group(prose=advice, table=table),))


def _half_cycles(prediction: Prediction) -> Floats:
    """Amplitude [m] of each half cycle of a test, and sums over its samples that count, shape (4, n_half_cycles).

    The sums are their number, their squared errors, and their squared forces about the mean [N^2].
    """
    test = prediction.test
    ends = half_cycle_ends(test.displacement)
    counts = np.zeros(test.n_time)
    counts[test.counted] = 1.0
    squares = [
        np.ones(test.n_time),
        (test.force - prediction.model_force) ** 2,
        (test.force - test.force.mean()) ** 2,
    ]
    before = np.cumsum(np.pad(counts * squares, ((0, 0), (1, 0))), axis=1)
    return np.vstack([0.5 * np.abs(np.diff(test.displacement[ends])), np.diff(before[:, ends], axis=1)])


def _classes(amplitude: Floats) -> NDArray[np.intp]:
    decade = np.floor(np.log10(np.maximum(1e3 * amplitude, np.finfo(float).tiny)))
    within = np.searchsorted(_ENDS, 1e3 * amplitude / 10.0**decade)
    # The last class of a decade is the first of the next.
    return np.asarray(decade * len(_ENDS) + within, dtype=np.intp)
