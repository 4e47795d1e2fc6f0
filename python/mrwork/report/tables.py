"""The rows of the report's tables and the sentences that belong to them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mrwork.identification.fit import Estimate, Fit, FitQuality
from mrwork.records.damper_test import DamperTest
from mrwork.report import numbers
from mrwork.report.comparison import Comparison

_THIN = "\N{NARROW NO-BREAK SPACE}"
_MIDDLE_DOT = " · "


@dataclass(frozen=True, slots=True, kw_only=True)
class Aligned:
    """A number cut at its decimal point; `width` [characters] holds the longest tail of its column."""

    head: str
    tail: str
    width: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRow:
    """One estimate as text."""

    name: str
    value: Aligned
    error: Aligned
    relative: Aligned
    unit: str
    lower: Aligned
    upper: Aligned
    remark: str


@dataclass(frozen=True, slots=True, kw_only=True)
class AgreementRow:
    """How the model agrees with one test or with all, as text with the decimals of its column."""

    fit_percent: str
    nrmse: str
    rmse_n: str
    time: str
    displacement: str
    velocity: str
    autocorrelation: str
    n_time: str
    substeps: str


def parameter_rows(estimates: Sequence[Estimate]) -> list[ParameterRow]:
    """A row per estimate, in the order of the model's spec."""
    pairs = [numbers.value_and_error(estimate.value, estimate.standard_error) for estimate in estimates]
    values = _aligned([value for value, _ in pairs])
    errors = _aligned([error for _, error in pairs])
    relatives = _aligned([_relative_error(estimate) for estimate in estimates])
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
            remark=estimate.remark,
        )
        for estimate, value, error, relative, lower, upper in zip(
            estimates, values, errors, relatives, lowers, uppers, strict=True
        )
    ]


def agreement_rows(fit: Fit, comparisons: Sequence[Comparison]) -> list[AgreementRow]:
    """A row per test and, last, one for all tests together; equal decimals down each column."""
    tested = [comparison.quality for comparison in comparisons]
    every: list[FitQuality | Fit] = [*tested, fit]
    columns = zip(
        [numbers.fixed(entry.fit_percent, 2) for entry in every],
        numbers.column([entry.nrmse for entry in every], 3),
        numbers.column([entry.rmse_n for entry in every], 3),
        numbers.column([entry.error_norms.time for entry in every], 3),
        numbers.column([entry.error_norms.displacement for entry in every], 3),
        numbers.column([entry.error_norms.velocity for entry in every], 3),
        [*(numbers.fixed(quality.residual_autocorrelation, 4) for quality in tested), ""],
        [numbers.fixed(entry.n_time, 0) for entry in every],
        [*(numbers.fixed(quality.substeps, 0) for quality in tested), ""],
        strict=True,
    )
    return [
        AgreementRow(
            fit_percent=fit_percent,
            nrmse=nrmse,
            rmse_n=rmse_n,
            time=time,
            displacement=displacement,
            velocity=velocity,
            autocorrelation=autocorrelation,
            n_time=n_time,
            substeps=substeps,
        )
        for (
            fit_percent,
            nrmse,
            rmse_n,
            time,
            displacement,
            velocity,
            autocorrelation,
            n_time,
            substeps,
        ) in columns
    ]


def conditions(test: DamperTest, quality: FitQuality) -> str:
    """The command, the motion and the sampling of a test, and what was done to the model's force, in one line."""
    observed = ", ".join(filter(None, (quality.observation.in_words, quality.nuisance.in_words)))
    parts = [
        _quantity(test.current, "A"),
        _quantity(test.voltage, "V"),
        _quantity(None if test.amplitude is None else 1e3 * test.amplitude, "mm"),
        _quantity(test.frequency, "Hz"),
        f"{numbers.fixed(test.n_time, 0)} samples every {numbers.shortest(1e3 * test.dt)}{_THIN}ms",
        f"velocity {test.velocity_source}",
        f"first {numbers.shortest(test.n_settle * test.dt, 2)}{_THIN}s not compared" if test.n_settle else "",
        f"model force {observed}" if observed else "",
    ]
    return _MIDDLE_DOT.join(part for part in parts if part)


def checked(comparisons: Sequence[Comparison]) -> str:
    """How much the checks of the records found, in words."""
    found = [finding.severity for comparison in comparisons for finding in comparison.test.findings]
    parts = [
        f"{count} {word}{'s' if count > 1 else ''}"
        for word, count in (("warning", found.count("warning")), ("note", found.count("note")))
        if count
    ]
    if "repaired" in found:
        parts.append(f"{found.count('repaired')} repaired")
    records = "the record" if len(comparisons) == 1 else f"{len(comparisons)} records"
    return f"the checks of {records} found {', '.join(parts) or 'nothing to report'}."


def caution(fit: Fit) -> str:
    """What the standard errors assume, and what the residuals of this fit say about it."""
    if all(estimate.standard_error is None for estimate in fit.estimates):
        return "No standard errors: they could not be computed for this fit."
    assumption = "Standard errors assume residuals that are independent from one sample to the next."
    seen = [
        quality.residual_autocorrelation
        for quality in fit.quality
        if math.isfinite(quality.residual_autocorrelation)
    ]
    if not seen:
        return f"{assumption} The autocorrelation of these residuals is not known."
    lowest, highest = numbers.fixed(min(seen), 4), numbers.fixed(max(seen), 4)
    span = lowest if lowest == highest else f"between {lowest} and {highest}"
    if max(seen) < 0.1:
        return f"{assumption} The lag-1 autocorrelation of these residuals is {span}, close to that."
    return (
        f"{assumption} The lag-1 autocorrelation of these residuals is {span}, "
        "so the standard errors are optimistic: read them as lower limits."
    )


def _aligned(texts: Sequence[str]) -> list[Aligned]:
    parts = [numbers.at_point(text) for text in texts]
    width = max((len(tail) for _, tail in parts), default=0)
    return [Aligned(head=head, tail=tail, width=width) for head, tail in parts]


def _relative_error(estimate: Estimate) -> str:
    if estimate.standard_error is None or estimate.value == 0:
        return numbers.fixed(None, 0)
    return numbers.significant(100 * estimate.standard_error / abs(estimate.value), 2)


def _quantity(value: float | None, unit: str) -> str:
    return "" if value is None else f"{numbers.shortest(value)}{_THIN}{unit}"


def shown_unit(unit: str) -> str:
    """A unit that does not break, nothing for none."""
    return "" if unit in {"", "-", "1"} else unit.replace(" ", "\N{NO-BREAK SPACE}")
