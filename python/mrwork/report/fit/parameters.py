"""The parameters of a fit as a table, and the assumption of their standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mrwork.identification.fit import Estimate, Fit, Intervals
from mrwork.report import numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class Aligned:
    """A number cut at its decimal point; `width` [characters] holds the longest tail of its column."""

    head: str
    tail: str
    width: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRow:
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
    values = _aligned([value for value, _ in pairs])
    errors = _aligned([error for _, error in pairs])
    if fit.intervals is not None:
        values = _aligned([numbers.significant(estimate.value, 5) for estimate in estimates])
        errors = [_plain(_interval(fit.intervals, estimate)) for estimate in estimates]
    relatives = _aligned([relative_error(estimate.value, estimate.standard_error) for estimate in estimates])
    lowers = _aligned([numbers.shortest(estimate.lower) for estimate in estimates])
    uppers = _aligned([numbers.shortest(estimate.upper) for estimate in estimates])
    return [
        ParameterRow(
            name=estimate.name,
            value=value,
            error=error,
            relative=relative,
            unit=shown_unit(estimate.unit),
            lower=lower,
            upper=upper,
            remark=_remark(fit, estimate),
        )
        for estimate, value, error, relative, lower, upper in zip(
            estimates, values, errors, relatives, lowers, uppers, strict=True
        )
    ]


def _remark(fit: Fit, estimate: Estimate) -> str:
    """What keeps the parameter from varying; of one that the derivatives leave open, the verdict on it."""
    return fit.verdict_on(estimate.name)[0] if estimate.remark == "not identifiable" else estimate.remark


def _interval(intervals: Intervals, estimate: Estimate) -> str:
    found = intervals.of(estimate.name)
    return (
        numbers.fixed(None, 0) if found is None else found.in_words(lambda end: numbers.significant(end, 4))
    )


def _plain(text: str) -> Aligned:
    return Aligned(head=text, tail="", width=0)


def caution(fit: Fit) -> str:
    """What the uncertainties assume."""
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
        f"Standard errors count the {numbers.fixed(fit.n_time, 0)} residuals as {numbers.fixed(fit.n_effective, 0)} "
        f"independent ones, because residuals are correlated from one sample to the next. {linear}"
    )


def relative_error(value: float, error: float | None) -> str:
    """A standard error as a percentage of its estimate; a dash where there is none."""
    if error is None or value == 0:
        return numbers.fixed(None, 0)
    return numbers.significant(100 * error / abs(value), 2)


def shown_unit(unit: str) -> str:
    """A unit with no-break spaces and raised powers; empty for a dimensionless quantity."""
    if unit in {"", "-", "1"}:
        return ""
    return unit.replace(" ", "\N{NO-BREAK SPACE}").replace("^2", "²").replace("^3", "³")


def _aligned(texts: Sequence[str]) -> list[Aligned]:
    parts = [numbers.at_point(text) for text in texts]
    width = max((len(tail) for _, tail in parts), default=0)
    return [Aligned(head=head, tail=tail, width=width) for head, tail in parts]
