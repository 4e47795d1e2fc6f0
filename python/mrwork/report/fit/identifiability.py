"""The section on identifiability: whether the tests determine each parameter."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import get_args

from mrwork.identification.fit import Direction, Fit, Identifiability, VerdictName
from mrwork.report import numbers
from mrwork.report.comparison import Comparison
from mrwork.report.fit.kind import SectionKind
from mrwork.report.section import Group, Section, Table, table
from mrwork.stored import StoredRun

_ADVICE: dict[VerdictName, str] = {
    "weakly identifiable": "Quote a weakly identifiable parameter with its interval only.",
    "sign unknown": "Of a parameter of unknown sign not even the direction of its force is known: fix it at zero if it "
    "may be left out.",
    "negligible": "A negligible parameter hardly changes the force: fix it at zero.",
    "not identifiable": "Do not use the value of a parameter that is not identifiable. Fix it at a known value, choose "
    "a model without it, or add a test in which it has an effect.",
}
"""What to do with a parameter, by its verdict."""


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """Verdict per parameter, and the directions in parameter space that change no force."""
    found = run.fit.identifiability
    if found is None:
        return None
    judged = {each.name: run.fit.verdict_on(each.name) for each in found.verdicts}
    points = tuple(_sentence(each) for each in found.informative)
    return Section(
        anchor="identifiability",
        title="Identifiability",
        summary=_summary(judged),
        groups=(Group(prose=_prose(run.fit, found, judged), table=_table(judged), points=points),),
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
    words = {verdict for verdict, _ in judged.values()}
    advice = [_ADVICE[word] for word in get_args(VerdictName) if word in _ADVICE and word in words]
    return tuple(filter(None, (f"{counted} {basis}", " ".join(advice))))


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
