"""The section on identifiability: whether the tests determine each parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mrwork.identification.fit import VERDICT_IN_WORDS, Direction, Fit, Identifiability, VerdictName
from mrwork.report import numbers
from mrwork.report.comparison import Comparison
from mrwork.report.fit.kind import SectionKind
from mrwork.report.fit.parameters import relative_error, shown_unit
from mrwork.report.section import Group, Section, Table, table
from mrwork.stored import StoredRun


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """Verdict per parameter, and the directions in parameter space that change no force."""
    found = run.fit.identifiability
    if found is None:
        return None
    verdicts: dict[str, VerdictName] = {each.name: each.verdict for each in found.verdicts}
    # A profile does not assume linearity as a standard error does, so its verdict takes precedence.
    profiles = run.profiles
    verdicts |= {each.name: each.verdict for each in (profiles.profiles if profiles is not None else ())}
    points = tuple(_sentence(each) for each in found.directions)
    return Section(
        anchor="identifiability",
        title="Identifiability",
        summary=_summary(verdicts),
        groups=(Group(prose=_prose(found), table=_table(run.fit, found), points=points),),
    )


def _summary(verdicts: Mapping[str, VerdictName]) -> str:
    counts = {
        word: [name for name, verdict in verdicts.items() if verdict == word] for word in VERDICT_IN_WORDS
    }
    parts = [f"{len(counts['identifiable'])} of {len(verdicts)} parameters are identifiable"]
    if counts["weakly"]:
        parts.append(f"weakly: {', '.join(counts['weakly'])}")
    if counts["not"]:
        parts.append(f"not: {', '.join(counts['not'])}")
    return f"Identifiability: {'; '.join(parts)}."


def _prose(found: Identifiability) -> tuple[str, ...]:
    effective = numbers.fixed(found.n_effective, 0)
    text = (
        f"To allow for autocorrelation, the {numbers.fixed(found.n_time, 0)} residuals count as {effective} effective "
        "samples. The standard errors here use this number, so they are larger than those in the table of parameters. "
        "They assume that the force is linear in the parameters over that range; profiles and posterior draws do not."
    )
    if found.n_effective > 0.9 * found.n_time:
        text = (
            "The residuals are almost uncorrelated, so every sample counts. The standard errors assume that the force "
            "is linear in the parameters over that range; profiles and posterior draws do not."
        )
    unsettled = [each.name for each in found.verdicts if each.verdict != "identifiable"]
    if not unsettled:
        return (text,)
    advice = (
        "Do not use the value of a parameter that is not identifiable. Fix it at a known value, choose a model without "
        "it, or add a test in which it has an effect."
    )
    return text, advice


def _sentence(direction: Direction) -> str:
    """The sentence of a direction, capitalised unless it starts with the name of a parameter."""
    sentence = direction.sentence
    return f"{sentence if direction.starts_with_name else sentence[0].upper() + sentence[1:]}."


def _table(fit: Fit, found: Identifiability) -> Table:
    estimates = {each.name: each for each in fit.estimates}
    rows = []
    for verdict in found.verdicts:
        estimate = estimates[verdict.name]
        value, error = numbers.value_and_error(estimate.value, verdict.standard_error)
        rows.append(
            (
                verdict.name,
                value,
                error,
                relative_error(estimate.value, verdict.standard_error),
                shown_unit(estimate.unit),
                VERDICT_IN_WORDS[verdict.verdict],
                verdict.reason,
            )
        )
    return table(
        label="Identifiability of each parameter",
        columns=("Parameter", "Value", "Standard error", "Relative (%)", "Unit", "Verdict", "Reason"),
        words=(4, 5, 6),
        rows=tuple(rows),
    )


IDENTIFIABILITY = SectionKind(make=_section)
