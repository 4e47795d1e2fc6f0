"""The section on identifiability: whether the tests determine each parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

from mrwork.identification.certainty import Direction, Identifiability, VerdictName
from mrwork.identification.fit import Fit
from mrwork.report import numbers
from mrwork.report.comparison import Comparison
from mrwork.report.fit.kind import SectionKind
from mrwork.report.section import Group, Section, Table, table
from mrwork.stored import StoredRun


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """Verdict per parameter, and the directions in parameter space that change no force."""
    found = run.fit.identifiability
    if found is None:
        return None
    judged = {each.name: run.fit.verdict_on(each.name) for each in found.verdicts}
    points = tuple(_sentence(each) for each in found.directions)
    return Section(
        anchor="identifiability",
        title="Identifiability",
        summary=_summary(judged),
        groups=(Group(prose=_prose(run.fit, found, judged), table=_table(judged), points=points),),
    )


def _summary(judged: Mapping[str, tuple[str, str]]) -> str:
    counts = {
        word: [name for name, (verdict, _) in judged.items() if verdict == word]
        for word in get_args(VerdictName)
    }
    certain, weak, none = (counts[word] for word in get_args(VerdictName))
    parts = [f"{len(certain)} of {len(judged)} parameters are identifiable"]
    if weak:
        parts.append(f"weakly: {', '.join(weak)}")
    if none:
        parts.append(f"not: {', '.join(none)}")
    return f"Identifiability: {'; '.join(parts)}."


def _prose(fit: Fit, found: Identifiability, judged: Mapping[str, tuple[str, str]]) -> tuple[str, ...]:
    effective = numbers.fixed(found.n_effective, 0)
    counted = (
        f"The {numbers.fixed(found.n_time, 0)} residuals count as {effective} effective samples, because they are "
        "correlated."
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
    if all(verdict == "identifiable" for verdict, _ in judged.values()):
        return (f"{counted} {basis}",)
    advice = (
        "Do not use the value of a parameter that is not identifiable. Fix it at a known value, choose a model without "
        "it, or add a test in which it has an effect."
    )
    return f"{counted} {basis}", advice


def _sentence(direction: Direction) -> str:
    """The sentence of a direction, capitalised unless it starts with the name of a parameter."""
    sentence = direction.sentence
    return f"{sentence if direction.starts_with_name else sentence[0].upper() + sentence[1:]}."


def _table(judged: Mapping[str, tuple[str, str]]) -> Table:
    return table(
        label="Identifiability of each parameter",
        columns=("Parameter", "Verdict", "Reason"),
        words=(1, 2),
        rows=tuple((name, *words) for name, words in judged.items()),
    )


IDENTIFIABILITY = SectionKind(make=_section)
