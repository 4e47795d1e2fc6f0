"""The section on identifiability: what the tests say of each parameter, and profiles where they were made."""

from __future__ import annotations

from collections.abc import Mapping, Set

from matplotlib.ticker import FuncFormatter, MaxNLocator

from mrwork.identification.fit import Direction, Fit, Identifiability, VerdictName
from mrwork.report import numbers, style
from mrwork.report.fit.canvas import small_axes
from mrwork.report.fit.section import Group, Panel, Section, Table, panel, table
from mrwork.report.profile_figure import draw_profile
from mrwork.report.tables import shown_unit
from mrwork.uncertainty.identifiability.profile import Profile, Profiles

_WORDS = {"identifiable": "identifiable", "weakly": "weakly", "not": "not identifiable"}


def identifiability_section(fit: Fit, found: Identifiability, profiles: Profiles | None) -> Section:
    """Verdict per parameter, directions that are not seen, and the profiles of the likelihood if there are any."""
    names = {each.name for each in fit.estimates}
    points = tuple(_sentence(each, names) for each in found.directions)
    groups = [Group(prose=_prose(found), table=_table(fit, found), points=points)]
    if profiles is not None:
        groups.append(
            Group(
                title="Profile likelihood",
                prose=_profile_prose(profiles),
                table=_interval_table(profiles),
                panels=tuple(_panel(profile, profiles.threshold) for profile in profiles.profiles),
                layout="small",
            )
        )
    return Section(
        anchor="identifiability",
        title="Identifiability",
        summary=_summary(_verdicts(found, profiles)),
        groups=tuple(groups),
    )


def _verdicts(found: Identifiability, profiles: Profiles | None) -> dict[str, VerdictName]:
    """A verdict per parameter: that of its profile where there is one, which assumes less."""
    told: dict[str, VerdictName] = {each.name: each.verdict for each in found.verdicts}
    return told | {each.name: each.verdict for each in (profiles.profiles if profiles is not None else ())}


def _summary(verdicts: Mapping[str, VerdictName]) -> str:
    counts = {word: [name for name, verdict in verdicts.items() if verdict == word] for word in _WORDS}
    said = [f"{len(counts['identifiable'])} of {len(verdicts)} parameters are settled by the data"]
    if counts["weakly"]:
        said.append(f"weakly: {', '.join(counts['weakly'])}")
    if counts["not"]:
        said.append(f"not at all: {', '.join(counts['not'])}")
    return f"Identifiability: {'; '.join(said)}."


def _prose(found: Identifiability) -> tuple[str, ...]:
    worth = numbers.fixed(found.n_effective, 0)
    text = (
        f"The {numbers.fixed(found.n_time, 0)} residuals are correlated and are worth about {worth} independent ones. "
        "Standard errors here count only these, so they are wider than those among the parameters above. They rest on "
        "the model being straight over that width; profiles and draws of the posterior do not."
    )
    if found.n_effective > 0.9 * found.n_time:
        text = (
            "The residuals are hardly correlated, so every sample counts. Standard errors rest on the model being "
            "straight over their width; profiles and draws of the posterior do not."
        )
    unsettled = [each.name for each in found.verdicts if each.verdict != "identifiable"]
    if not unsettled:
        return (text,)
    advice = (
        "What is not settled can be read from no other number on this page. Hold such a parameter at a known value, "
        "choose a model without it, or test where it matters."
    )
    return text, advice


def _sentence(direction: Direction, names: Set[str]) -> str:
    """With a capital, but for a name that has none."""
    sentence = direction.sentence
    first = sentence.replace(",", " ").partition(" ")[0]
    return f"{sentence if first in names else sentence[0].upper() + sentence[1:]}."


def _table(fit: Fit, found: Identifiability) -> Table:
    estimates = {each.name: each for each in fit.estimates}
    rows = []
    for verdict in found.verdicts:
        estimate = estimates[verdict.name]
        value, error = numbers.value_and_error(estimate.value, verdict.standard_error)
        relative = (
            numbers.significant(100 * verdict.standard_error / abs(estimate.value), 2)
            if verdict.standard_error is not None and estimate.value != 0.0
            else numbers.fixed(None, 0)
        )
        rows.append(
            (
                verdict.name,
                value,
                error,
                relative,
                shown_unit(estimate.unit),
                _WORDS[verdict.verdict],
                verdict.reason,
            )
        )
    return table(
        label="Identifiability of each parameter",
        columns=("Parameter", "Value", "Standard error", "Relative (%)", "Unit", "Verdict", "Reason"),
        words=(4, 5, 6),
        rows=tuple(rows),
    )


def _profile_prose(profiles: Profiles) -> tuple[str, ...]:
    text = (
        "Each figure holds one parameter at values about the estimate and fits all others anew. The line is how much "
        f"less likely the data become; below the dashed threshold lie the values of the {100 * profiles.level:g} % "
        "interval (shaded). Where the line does not reach it, the data do not bound the parameter on that side."
    )
    remark = f"{profiles.remark[0].upper()}{profiles.remark[1:]}." if profiles.remark else ""
    cut = "Profiling was interrupted: ends may be missing." if profiles.status == "interrupted" else ""
    return tuple(filter(None, (text, remark, cut)))


def _interval_table(profiles: Profiles) -> Table:
    return table(
        label="Intervals by profile likelihood",
        columns=("Parameter", "Estimate", "From", "To", "Unit", "Verdict", "Reason"),
        words=(4, 5, 6),
        rows=tuple(
            (
                each.name,
                numbers.significant(each.estimate, 5),
                _end(each.lower),
                _end(each.upper),
                shown_unit(each.unit),
                _WORDS[each.verdict],
                each.reason,
            )
            for each in profiles.profiles
        ),
    )


def _end(value: float | None) -> str:
    return "open" if value is None else numbers.significant(value, 4)


def _panel(profile: Profile, threshold: float) -> Panel:
    with style.drawn_in_style():
        figure, axes = small_axes()
        draw_profile(axes, profile, threshold)
        if axes.get_xscale() == "linear":
            axes.xaxis.set_major_locator(MaxNLocator(nbins=2, steps=[1, 2, 4, 5, 10]))
            axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: numbers.shortest(value, 5)))
    interval = f"interval {_end(profile.lower)} to {_end(profile.upper)}"
    return panel(
        f"profile-{profile.name.replace('.', '-')}",
        "",
        figure,
        f"Likelihood ratio over {profile.name}, {interval}",
    )
