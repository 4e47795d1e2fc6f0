"""The section on the next test: which of some candidates would tell most."""

from __future__ import annotations

from mrwork.dampers.parameters import CommandUnit
from mrwork.report import numbers
from mrwork.report.fit.section import Group, Section, panel, table
from mrwork.report.plan_figure import plan_figure
from mrwork.uncertainty.planning.plan_draws import Check

_SHOWN = 8


def plan_section(check: Check, unit: CommandUnit | None) -> Section:
    """The best candidates, the map of all of them, and whether draws rank them alike."""
    plan = check.plan
    best = plan.gains[0]
    name = best.candidate.in_words(unit)
    shown = plan.gains[:_SHOWN]
    agreement = (
        "Draws could not check this: next to none fits the simulated tests. Take the order, not the numbers."
        if check.agreement is None
        else f"Draws rank the candidates with a rank correlation of {check.agreement:.2f} to this."
    )
    return Section(
        anchor="next-test",
        title="Next test",
        summary=f"Next test: {name} narrows the band of {plan.band} most of {len(plan.gains)} candidates.",
        groups=(
            Group(
                prose=(
                    f"Of {len(plan.gains)} candidates {name} is expected to take away "
                    f"{numbers.fixed(100 * best.gain, 1)} % of the variance of the band of {plan.band}. That holds "
                    "as far as the model does: a test where it errs tells about the model instead.",
                    agreement,
                ),
                table=table(
                    label="Candidates for the next test",
                    columns=("Test", "Variance taken away (%)", "By draws (%)", "Deviation after"),
                    rows=tuple(
                        (
                            each.candidate.in_words(unit),
                            numbers.fixed(100 * each.gain, 1),
                            numbers.fixed(None if each.drawn is None else 100 * each.drawn, 0),
                            numbers.significant(each.deviation, 3),
                        )
                        for each in shown
                    ),
                    note=f"The best {len(shown)} of {len(plan.gains)}."
                    if len(plan.gains) > len(shown)
                    else "",
                ),
            ),
            Group(
                title="All candidates",
                panels=(
                    panel(
                        "plan",
                        "",
                        plan_figure(plan, unit),
                        f"Share of the variance that each of {len(plan.gains)} tests takes away, best {name}",
                    ),
                ),
                layout="whole",
            ),
        ),
    )
