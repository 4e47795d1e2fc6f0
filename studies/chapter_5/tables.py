"""The study's tables, once for a terminal and once for the page."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

import mrwork as mr
from mrwork.report import Table, numbers
from studies.chapter_5.outcome import Laws, PerCurrent, SetOutcome
from studies.former.arrays import Floats

# After a value that has no standard error.
_UNSURE = "*"


def per_current_table(outcome: SetOutcome, each: PerCurrent) -> Table:
    """The form of tables 5.2 and 5.3: parameters with standard errors, a row per current."""
    spec = mr.damper(each.model.damper)
    shown = [spec.names.index(name) for name in each.model.free]
    rows = []
    unsure = False
    for current, fit in zip(each.currents, each.fits, strict=True):
        cells = []
        for place in shown:
            estimate = fit.estimates[place]
            value, error = numbers.value_and_error(estimate.value, estimate.standard_error)
            known = estimate.standard_error is not None
            unsure = unsure or not known
            cells.append(f"{value} ± {error}" if known else f"{numbers.shortest(estimate.value)}{_UNSURE}")
        rows.append((f"{current:g}", *cells, numbers.significant(fit.rmse_n, 3)))
    held = ", ".join(f"{name} = {value:g} {_unit(spec, name)}" for name, value in each.model.held.items())
    note = f"Held: {held}." if held else ""
    if unsure:
        note += f" {_UNSURE} no standard error: on a bound, or not determined by this test."
    units = {name: _unit(spec, name) for name in each.model.free}
    headings = (name if unit == "1" else f"{name} [{unit}]" for name, unit in units.items())
    label = each.model.label
    return Table(
        title=f"{label[0].upper()}{label[1:]} model at each current, {outcome.tests.name}",
        columns=("i [A]", *headings, "RMS [N]"),
        rows=tuple(rows),
        note=note.strip(),
    )


def law_table(outcome: SetOutcome, each: PerCurrent) -> Table:
    """Polynomials through the values at each current beside the laws identified jointly, and the truth where known."""
    laws = outcome.laws[each.model.label]
    columns: list[tuple[str, Laws]] = []
    true = outcome.true_laws
    if true is not None and each.model.damper == "static_hysteretic":
        columns.append(("truth (published)", true))
    columns += [
        ("through values", laws.through),
        ("through, weighted", laws.weighted),
        ("joint", laws.joint),
    ]
    rows = tuple(
        (name, *(_polynomial(law.coefficients[name], law.errors[name]) for _, law in columns))
        for name in each.model.free
    )
    worst = ("largest RMS [N]", *(numbers.significant(float(np.max(law.rms_n)), 3) for _, law in columns))
    return Table(
        title=f"Laws of the {each.model.label} model, {outcome.tests.name}",
        columns=("", *(heading for heading, _ in columns)),
        rows=(*rows, worst),
        note="i in A, parameters in SI; in brackets the standard error in units of the last digits.",
    )


def law_rms_table(outcome: SetOutcome) -> Table:
    """Cost of the laws: RMS error of the force with parameters taken from them."""
    header = ["i [A]"]
    columns: list[Floats] = []
    for label, laws in outcome.laws.items():
        header += [f"{label}: at each current", "through values", "through, weighted", "joint"]
        columns += [
            outcome.each[label].rms_n,
            laws.through.rms_n,
            laws.weighted.rms_n,
            laws.joint.rms_n,
        ]
    table = _rms_table(f"RMS error [N] with laws, {outcome.tests.name}", tuple(header), columns, outcome)
    relative = [f"{100.0 * outcome.tests.relative(rms_n):.2f} %" for rms_n in columns]
    return replace(
        table,
        rows=(*table.rows, ("all", *relative)),
        note="All: each error over the standard deviation of its test's force, root mean square. The joint laws have "
        "the least of it, the polynomials through values do not look at the force.",
    )


def rms_table(outcome: SetOutcome) -> Table:
    """Figure 5.9 as a table; the smallest of a row in bold."""
    labels = tuple(outcome.each)
    return _rms_table(
        f"RMS error [N], {outcome.tests.name}",
        ("i [A]", *labels),
        [outcome.each[label].rms_n for label in labels],
        outcome,
        bold=True,
    )


def _rms_table(
    title: str, header: tuple[str, ...], columns: list[Floats], outcome: SetOutcome, *, bold: bool = False
) -> Table:
    table = np.array(columns).T
    rows = [
        (f"{current:g}", *numbers.column([float(value) for value in values], 3))
        for current, values in zip(outcome.tests.currents, table, strict=True)
    ]
    least = frozenset((row, 1 + int(place)) for row, place in enumerate(np.argmin(table, axis=1)))
    return Table(title=title, columns=header, rows=tuple(rows), strong=least if bold else frozenset())


def _polynomial(coefficients: tuple[float, ...], errors: tuple[float, ...]) -> str:
    """1232(3) + 1929(5) i - 244(2) i^2."""
    text = ""
    for power, (value, error) in enumerate(zip(coefficients, errors, strict=True)):
        size = _with_error(abs(value), error)
        if not text:
            text = size if value >= 0.0 else f"{numbers.MINUS}{size}"
        else:
            text += f" {'+' if value >= 0.0 else numbers.MINUS} {size}"
        text += ("", " i", " i²", " i³")[power]
    return text


def _with_error(value: float, error: float) -> str:
    if not math.isfinite(error) or error <= 0.0:
        return numbers.shortest(value, 4)
    shown, sure = numbers.value_and_error(value, error)
    if "×" in shown:
        return numbers.shortest(value, 4)
    digits = sure.replace(".", "").lstrip("0")
    # An error of more than a few units belongs where its decimal point is.
    return f"{shown}({sure if '.' in sure and error >= 1.0 else digits})"


def _unit(spec: mr.DamperSpec, name: str) -> str:
    return spec.parameters[spec.names.index(name)].unit
