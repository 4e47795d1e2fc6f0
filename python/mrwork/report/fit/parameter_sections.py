"""Sections on parameters: the model with their table and what the data determine; and their profile likelihood."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import get_args

from markupsafe import Markup

from mrwork.base import numbers
from mrwork.base.table import Table
from mrwork.identification.fit import Fit, FittedParameter, step_in_words
from mrwork.identification.interval import FINE, Word
from mrwork.plots.style import shown_unit
from mrwork.report.html import equation_html, symbol
from mrwork.report.section import Group, Section
from mrwork.runs.load import StoredRun


def parameters_section(run: StoredRun) -> Section:
    """The model, its parameters with their uncertainty, and what the data determine."""
    fit, spec = run.fit, run.fit.spec
    words = {estimate.verdict.word for estimate in fit.estimates}
    notes = [remark.message for remark in fit.remarks if remark.severity == "note"]
    advice = " ".join(_ADVICE[word] for word in get_args(Word) if word in _ADVICE and word in words)
    model = Markup('<div class="equation">{}</div>').format(Markup(equation_html(spec.equations)))
    groups = [Group(markup=model + Markup('<p class="note">{}</p>').format(spec.source))]
    if spec.own is not None:
        step = (
            "" if fit.half_step_percent is None else f" {step_in_words(fit.half_step_percent).capitalize()}."
        )
        source = Markup(
            '<div class="scroll" tabindex="0" role="region" aria-label="Equations in Python"><pre>{}</pre></div>'
        ).format(spec.own.source.strip())
        digest = f"Equations in Python, digest `{spec.own.digest}`.{step}"
        groups.append(Group(prose=(digest,), markup=source))
    # Only "the residuals do not depend on it" does not start with a parameter's name.
    sentences = [
        f"{direction.sentence}."
        if direction.seen or len(direction.changes) > 1
        else _as_sentence(direction.sentence)
        for direction in fit.informative
    ]
    groups.append(
        Group(
            table=_parameter_table(fit),
            prose=tuple(filter(None, (*map(_as_sentence, notes), advice))),
            points=tuple(sentences),
        )
    )
    return Section(title="Parameters", summary=_summary(fit), groups=tuple(groups))


def _as_sentence(clause: str) -> str:
    return f"{clause[:1].upper()}{clause[1:]}." if clause else ""


def _parameter_table(fit: Fit) -> Table:
    estimates = fit.fitted
    if fit.an_interval is None:
        pairs = [numbers.value_and_error(estimate.value, estimate.standard_error) for estimate in estimates]
    else:
        pairs = [_value_and_interval(estimate) for estimate in estimates]
    values, errors = ([pair[index] for pair in pairs] for index in (0, 1))
    verdicts = [estimate.verdict.word for estimate in estimates]
    reasons = [_reason(estimate) for estimate in estimates]
    shares = ((estimate.standard_error, estimate.value) for estimate in estimates)
    relative = [
        numbers.NOTHING if error is None or value == 0 else numbers.significant(100 * error / abs(value), 2)
        for error, value in shares
    ]
    # The symbol of the equations, and the name in files.
    name = Markup('<span class="symbol">{}</span> <code>{}</code>')
    columns: dict[str, Sequence[str]] = {
        "Parameter": [name.format(Markup(symbol(estimate.name)), estimate.name) for estimate in estimates],
        "Value": _align_texts(values),
        fit.uncertainty_heading.capitalize(): errors if fit.an_interval else _align_texts(errors),
        "Relative (%)": [] if fit.an_interval else _align_texts(relative),
        "Unit": [shown_unit(estimate.unit) for estimate in estimates],
        "Lower bound": _align_texts([numbers.shortest(estimate.lower) for estimate in estimates]),
        "Upper bound": _align_texts([numbers.shortest(estimate.upper) for estimate in estimates]),
        "Verdict": verdicts if any(verdicts) else [],
        "Reason": reasons if any(reasons) else [],
    }
    shown = {heading: cells for heading, cells in columns.items() if cells}
    index = [*shown].index("Verdict") if "Verdict" in shown else 0
    return Table(
        label="Parameters",
        columns=tuple(shown),
        rows=tuple(zip(*shown.values(), strict=True)),
        strong=frozenset((row, 1) for row in range(len(estimates))),
        alarming=frozenset(
            (row, index) for row, verdict in enumerate(verdicts) if index and verdict not in FINE
        ),
        note=caution(fit),
    )


def _reason(estimate: FittedParameter) -> str:
    """The reason of the verdict, behind the bound that the estimate is at."""
    reason = estimate.verdict.reason
    if not estimate.at_bound or reason.startswith(estimate.state):
        return reason
    return "; ".join(filter(None, (estimate.state, reason)))


def _value_and_interval(estimate: FittedParameter) -> tuple[str, str]:
    """An estimate and its interval to the second digit of a quarter of its width, about one standard error."""
    interval = estimate.interval
    if interval is None:
        return numbers.significant(estimate.value, 5), numbers.NOTHING
    ends = [abs(end - estimate.value) for end in (interval.lower, interval.upper) if end is not None]
    error = sum(ends) / (2.0 * len(ends)) if ends else 0.0

    def shown(value: float) -> str:
        return numbers.value_and_error(value, error)[0] if error else numbers.significant(value, 5)

    return shown(estimate.value), interval.in_words(shown)


def caution(fit: Fit) -> str:
    """Assumptions of the uncertainties, from which the verdicts follow."""
    counted = ""
    if fit.n_effective is not None:
        counted = (
            f" The {numbers.format_fixed(fit.n_time, 0)} residuals count as "
            f"{numbers.format_fixed(fit.n_effective, 0)} effective samples, as their autocorrelation asks."
        )
    if (interval := fit.an_interval) is not None:
        return (
            f"The {interval.heading}s take the place of standard errors, and the verdicts follow from them. They "
            "hold if the model is right; an end that is not given is one at which the data do not bound the parameter."
            f"{counted}"
        )
    if all(estimate.standard_error is None for estimate in fit.estimates):
        return "No standard errors: they could not be computed for this fit."
    return (
        f"{counted} Standard errors, and the verdicts that follow from them, take the force to be linear in the "
        "parameters over that range, and the model to be right; profiles and posterior draws do without the first."
    ).lstrip()


def _align_texts(texts: Sequence[str]) -> list[Markup]:
    """Numbers cut at their decimal points, with as much room behind these as the longest tail takes."""
    parts = [(*re.split(r"(?=\.| ×)", text, maxsplit=1), "")[:2] for text in texts]
    width = max((len(tail) for _, tail in parts), default=0)
    form = Markup('{}<span class="tail" style="width:{}ch">{}</span>' if width else "{}")
    return [form.format(head, width, tail) for head, tail in parts]


_ADVICE: dict[Word, str] = {
    "model-dependent": "A model-dependent parameter describes these tests within this model: quote it with the model, "
    "and choose one that leaves less before another test is predicted by it.",
    "weakly identifiable": "Quote a weakly identifiable parameter with its interval only.",
    "sign unknown": "Of a parameter of unknown sign not even the direction of its force is known: fix it at zero if it "
    "may be left out.",
    "negligible": "A negligible parameter hardly changes the force: fix it at zero.",
    "not identifiable": "Do not use the value of a parameter that is not identifiable. Fix it at a known value, choose "
    "a model without it, or add a test in which it has an effect.",
}
"""What to do with a parameter, by its verdict."""


def _summary(fit: Fit) -> str:
    judged = [estimate for estimate in fit.estimates if estimate.verdict.word not in ("", "fixed", "tied")]
    if not judged:
        return f"{len(fit.estimates)} parameters."
    names = {
        word: [estimate.name for estimate in judged if estimate.verdict.word == word]
        for word in get_args(Word)
        if word
    }
    certain = names.pop("identifiable")
    parts = [f"{len(certain)} of {len(judged)} parameters are identifiable"]
    if fit.times_noise is not None:
        parts[0] += f" in a model whose residual is {fit.times_noise:.2g} times the noise of the force"
    parts += [f"{word}: {', '.join(those)}" for word, those in names.items() if those]
    return f"{'; '.join(parts)}."
