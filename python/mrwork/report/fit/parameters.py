"""Sections of a fit's page that are tables: parameters, identifiability, tested ranges."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, get_args

from mrwork.base import numbers
from mrwork.base.table import Table, TableColumn, page_table
from mrwork.identification.fit import Direction, Estimate, Fit, Identifiability, Intervals, VerdictName
from mrwork.report.figures import Comparison
from mrwork.report.section import Group, Section, SectionKind
from mrwork.runs.load import StoredRun


@dataclass(frozen=True, slots=True, kw_only=True)
class Aligned:
    """A number cut at its decimal point; `width` [characters] holds the longest tail of its column."""

    head: str
    tail: str
    width: int


class ParameterRow(NamedTuple):
    """One estimate as text; `error` is its uncertainty, a standard error or an interval."""

    name: str
    value: Aligned
    error: Aligned
    relative: Aligned
    unit: str
    lower: Aligned
    upper: Aligned
    remark: str


def parameter_rows(fit: Fit) -> list[ParameterRow]:
    """A row per estimate, in the order of the model's spec."""
    estimates = fit.estimates
    pairs = [numbers.value_and_error(estimate.value, estimate.standard_error) for estimate in estimates]
    values = _align_texts([value for value, _ in pairs])
    errors = _align_texts([error for _, error in pairs])
    if fit.intervals is not None:
        values = _align_texts([numbers.significant(estimate.value, 5) for estimate in estimates])
        errors = [_plain(_interval(fit.intervals, estimate)) for estimate in estimates]
    relatives = _align_texts(
        [relative_error(estimate.value, estimate.standard_error) for estimate in estimates]
    )
    lowers = _align_texts([numbers.shortest(estimate.lower) for estimate in estimates])
    uppers = _align_texts([numbers.shortest(estimate.upper) for estimate in estimates])
    units = [shown_unit(estimate.unit) for estimate in estimates]
    remarks = [_remark(fit, estimate) for estimate in estimates]
    names = [estimate.name for estimate in estimates]
    columns = (names, values, errors, relatives, units, lowers, uppers, remarks)
    return [ParameterRow(*cells) for cells in zip(*columns, strict=True)]


def _remark(fit: Fit, estimate: Estimate) -> str:
    """Reason why the parameter does not vary; its verdict where the derivatives do not determine it."""
    return fit.verdict_on(estimate.name)[0] if estimate.remark == "not identifiable" else estimate.remark


def _interval(intervals: Intervals, estimate: Estimate) -> str:
    interval = intervals.of(estimate.name)
    return (
        numbers.format_fixed(None, 0)
        if interval is None
        else interval.in_words(lambda end: numbers.significant(end, 4))
    )


def _plain(text: str) -> Aligned:
    return Aligned(head=text, tail="", width=0)


def caution(fit: Fit) -> str:
    """Assumptions of the uncertainties."""
    if fit.intervals is not None:
        return (
            f"The {fit.intervals.heading}s take the place of standard errors. They hold if the model is right; an end "
            "that is not given is one at which the data do not bound the parameter."
        )
    if all(estimate.standard_error is None for estimate in fit.estimates):
        return "No standard errors: they could not be computed for this fit."
    linear = (
        "They take the force to be linear in the parameters over that range, and the model to be right; profiles and "
        "posterior draws do without the first."
    )
    if fit.n_effective is None:
        return (
            "These standard errors are of an earlier version, which took residuals to be independent from one sample "
            f"to the next: read them as lower limits. {linear}"
        )
    return (
        f"Standard errors count the {numbers.format_fixed(fit.n_time, 0)} residuals as "
        f"{numbers.format_fixed(fit.n_effective, 0)} effective samples, as their autocorrelation asks. {linear}"
    )


def relative_error(value: float, error: float | None) -> str:
    """A standard error as a percentage of its estimate; a dash where there is none."""
    if error is None or value == 0:
        return numbers.format_fixed(None, 0)
    return numbers.significant(100 * error / abs(value), 2)


def shown_unit(unit: str) -> str:
    """A unit with no-break spaces and raised powers; empty for a dimensionless quantity."""
    if unit in {"", "-", "1"}:
        return ""
    return unit.replace(" ", "\N{NO-BREAK SPACE}").replace("^2", "²").replace("^3", "³")


def with_unit(name: str, unit: str) -> str:
    """A name for an axis, with its unit in parentheses if it has one."""
    shown = shown_unit(unit)
    return f"{name} ({shown})" if shown else name


def _align_texts(texts: Sequence[str]) -> list[Aligned]:
    parts = [numbers.at_point(text) for text in texts]
    width = max((len(tail) for _, tail in parts), default=0)
    return [Aligned(head=head, tail=tail, width=width) for head, tail in parts]


_ADVICE: dict[VerdictName, str] = {
    "weakly identifiable": "Quote a weakly identifiable parameter with its interval only.",
    "sign unknown": "Of a parameter of unknown sign not even the direction of its force is known: fix it at zero if it "
    "may be left out.",
    "negligible": "A negligible parameter hardly changes the force: fix it at zero.",
    "not identifiable": "Do not use the value of a parameter that is not identifiable. Fix it at a known value, choose "
    "a model without it, or add a test in which it has an effect.",
}
"""What to do with a parameter, by its verdict."""


def _identifiability_section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """Verdict per parameter, and the directions in parameter space that change no force."""
    identifiability = run.fit.identifiability
    if identifiability is None:
        return None
    judged = {each.name: run.fit.verdict_on(each.name) for each in identifiability.verdicts}
    points = tuple(_sentence(each) for each in identifiability.informative)
    return Section(
        anchor="identifiability",
        title="Identifiability",
        summary=_summary(judged),
        groups=(Group(prose=_prose(run.fit, identifiability, judged), table=_table(judged), points=points),),
    )


def _summary(judged: Mapping[str, tuple[str, str]]) -> str:
    names = {
        word: [name for name, (verdict, _) in judged.items() if verdict == word]
        for word in get_args(VerdictName)
    }
    certain = names.pop("identifiable")
    parts = [f"{len(certain)} of {len(judged)} parameters are identifiable"]
    parts += [f"{word}: {', '.join(those)}" for word, those in names.items() if those]
    return f"Identifiability: {'; '.join(parts)}."


def _prose(
    fit: Fit, identifiability: Identifiability, judged: Mapping[str, tuple[str, str]]
) -> tuple[str, ...]:
    effective = numbers.format_fixed(identifiability.n_effective, 0)
    counted = (
        f"The {numbers.format_fixed(identifiability.n_time, 0)} residuals count as {effective} effective samples, "
        "as their autocorrelation asks."
    )
    if fit.intervals is None:
        basis = (
            "The verdicts follow from the standard errors, which take the force to be linear in the parameters over "
            "that range; profiles and posterior draws do not."
        )
    else:
        basis = (
            f"The verdicts follow from the {fit.intervals.heading}s, the directions below from the derivatives at the "
            "fit."
        )
    words = {verdict for verdict, _ in judged.values()}
    advice = [_ADVICE[word] for word in get_args(VerdictName) if word in _ADVICE and word in words]
    return tuple(filter(None, (f"{counted} {basis}", " ".join(advice))))


def _sentence(direction: Direction) -> str:
    """The sentence of a direction, capitalised unless it starts with the name of a parameter."""
    sentence = direction.sentence
    return f"{sentence if direction.starts_with_name else sentence[0].upper() + sentence[1:]}."


def _table(judged: Mapping[str, tuple[str, str]]) -> Table:
    return page_table(
        "Identifiability of each parameter",
        (
            TableColumn(heading="parameter", cell=lambda name: name),
            TableColumn(heading="verdict", cell=lambda name: judged[name][0], words=True),
            TableColumn(heading="reason", cell=lambda name: judged[name][1], words=True),
        ),
        judged,
    )


IDENTIFIABILITY = SectionKind(make=_identifiability_section)


def _range_section(run: StoredRun, _: Sequence[Comparison]) -> Section:
    """The table of ranges."""
    tested = run.fit.tested
    return Section(
        anchor="tested",
        title="Tested range",
        summary=f"Tested range: {tested.in_words}.",
        groups=(
            Group(
                table=Table(
                    label="Ranges of the tests",
                    columns=("Quantity", "Tested"),
                    rows=tuple((name[:1].upper() + name[1:], span) for name, span in tested.rows()),
                    words=(1,),
                    note="The stroke is half the peak-to-peak displacement; velocity and force are peaks; the mean "
                    "power is the largest dissipated by a test; the frequency is that of the cycles. `mrwork predict` "
                    "and `mrwork respond` say where the damper is used outside these ranges.",
                )
            ),
        ),
    )


TESTED_RANGE = SectionKind(make=_range_section)
"""The ranges in which the damper was tested."""
