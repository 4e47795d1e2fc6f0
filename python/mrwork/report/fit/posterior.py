"""The section on the posterior: what the draws say of each parameter, and whether they are enough."""

from __future__ import annotations

import math

from mrwork.identification.fit import Fit
from mrwork.report import numbers
from mrwork.report.fit.posterior_figures import corner_figure, rank_figure, trace_figure
from mrwork.report.fit.section import Group, Section, Table, panel, table
from mrwork.report.tables import shown_unit
from mrwork.uncertainty.posterior.draws import LARGEST_RHAT, LEAST_ESS
from mrwork.uncertainty.posterior.draws_file import StoredDraws


def posterior_section(fit: Fit, draws: StoredDraws) -> Section:
    """Table, trace, ranks and corner of the draws of a run."""
    estimates = {each.name: each.value for each in fit.estimates}
    corner = panel(
        "corner",
        "",
        corner_figure(draws, estimates),
        f"Densities of {len(draws.varied)} parameters, alone and in pairs",
    )
    traces = tuple(
        panel(
            f"trace-{_anchor(each.name)}",
            "",
            trace_figure(each.name, draws.chains[each.name]),
            f"Draws of {each.name} in the order in which they were made",
        )
        for each in draws.varied
    )
    ranks = tuple(
        panel(
            f"rank-{_anchor(each.name)}",
            "",
            rank_figure(each.name, draws.chains[each.name], each.ess_bulk),
            f"Ranks of the draws of {each.name} in four groups of walkers",
        )
        for each in draws.varied
    )
    return Section(
        anchor="posterior",
        title="Posterior",
        summary=_summary(draws),
        groups=(
            Group(prose=_prose(draws), table=_table(draws)),
            Group(
                title="Parameters in pairs",
                prose=(
                    "Dark is where half of the draws lie, light where 90 % do; a cross marks the fit. A narrow "
                    "slanting pair is told from the data only together: quote neither of the two without the other.",
                ),
                panels=(corner,),
                layout="whole",
            ),
            Group(
                title="Trace",
                prose=(
                    "Median and 5 to 95 % of all walkers, step by step, over two walkers by themselves. It should look "
                    "the same from left to right; a drift says that sampling was stopped too early.",
                ),
                panels=traces,
                layout="small",
            ),
            Group(
                title="Ranks",
                prose=(
                    "All draws are ranked, and the ranks of four groups of walkers counted. Each line should stay in "
                    "the band, where 95 % of such counts lie if the groups tell the same.",
                ),
                panels=ranks,
                layout="small",
            ),
        ),
    )


def _summary(draws: StoredDraws) -> str:
    """How the sampling ended, without what it lacks."""
    ended = draws.verdict.partition(":")[0]
    return f"Posterior: {ended[0].lower()}{ended[1:]}, {numbers.fixed(draws.n_kept, 0)} draws."


def _prose(draws: StoredDraws) -> tuple[str, ...]:
    counted = (
        f"Residuals were taken as {draws.noise} noise and counted as {numbers.significant(100 * draws.temper, 2)} % of "
        "their number, for they are correlated. "
        if draws.temper < 1.0
        else f"Residuals were taken as {draws.noise} noise, every sample counted. "
    )
    return (
        f"{draws.verdict}",
        f"{counted}Intervals say what the data tell of the parameters if the model is right. They do not say how far "
        "the force of another test will be off: that is what calibrated bands are for.",
    )


def _table(draws: StoredDraws) -> Table:
    rows = []
    for each in draws.summaries:
        digits = 5
        rows.append(
            (
                each.name,
                numbers.significant(each.median, digits),
                numbers.significant(each.lower_5, digits),
                numbers.significant(each.upper_95, digits),
                shown_unit(each.unit),
                numbers.fixed(each.ess_bulk, 0),
                numbers.fixed(each.ess_tail, 0),
                numbers.fixed(each.rhat, 3) if math.isfinite(each.rhat) else numbers.fixed(None, 0),
                each.remark,
            )
        )
    return table(
        label="Posterior of each parameter",
        columns=("Parameter", "Median", "5 %", "95 %", "Unit", "ESS bulk", "ESS tail", "R-hat", "Remark"),
        words=(4, 8),
        rows=tuple(rows),
        note=f"{draws.n_steps} steps, one of {draws.thinning} kept after the burn-in; diagnostics are of the draws "
        f"kept. Wanted are an effective sample size (ESS) of {LEAST_ESS:g} and an R-hat below {LARGEST_RHAT:g}.",
    )


def _anchor(name: str) -> str:
    return name.replace(".", "-").replace("_", "-")
