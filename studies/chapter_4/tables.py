"""The study's tables, in the form of tables 4.2 to 4.4 of the thesis and beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mrwork.report import Table, numbers
from studies.chapter_4.decay import ATTAINABLE, LITERAL, STALL
from studies.chapter_4.findings import SearchFinding, TrialFinding, adjusted
from studies.chapter_4.search_settings import BASELINES, EFFICIENT, SEARCHES, STANDARD, SWARM

_RANGE = "\N{EN DASH}"
_NONE = numbers.format_fixed(None, 0)


def tables_of(findings: Sequence[TrialFinding], where: str) -> tuple[Table, ...]:
    """Every table of one set of tests."""
    return (
        error_table(findings, where),
        level_table(findings, where),
        evaluation_table(findings, where),
        reaching_table(findings, where),
        *(advantage_table(findings, where, baseline) for baseline in BASELINES),
        termination_table(findings, where),
        rule_table(findings, where),
    )


def error_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Form of table 4.2: average error and standard deviation."""
    rows, least = [], []
    for row, finding in enumerate(findings):
        means = [finding.searches[search].mean_error for search in SEARCHES]
        cells = [
            f"{numbers.format_fixed(100.0 * each.mean_error, 2)} ± {numbers.format_fixed(100.0 * each.deviation, 2)}"
            for each in (finding.searches[search] for search in SEARCHES)
        ]
        least.append((row, 1 + int(np.argmin(means))))
        rows.append((_place(finding), *cells, numbers.format_fixed(100.0 * finding.least, 2)))
    return Table(
        title=f"Form of table 4.2: average error and standard deviation [% NRMSE], {where}",
        columns=("model and current", *SEARCHES, "least of all"),
        rows=tuple(rows),
        strong=frozenset(least),
        note="After the last generation, over all replicates; the lowest mean in bold. Least of all: that of any run.",
    )


def level_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Form of table 4.3: share of runs below the 95 % error level."""
    rows = [
        (
            _place(finding),
            numbers.format_fixed(100.0 * finding.level, 2),
            *(_percent(finding.searches[search].below) for search in SEARCHES),
        )
        for finding in findings
    ]
    mean = [np.mean([finding.searches[search].below for finding in findings]) for search in SEARCHES]
    return Table(
        title=f"Form of table 4.3: runs below the 95 % error level [%], {where}",
        columns=("model and current", "95 % level [% NRMSE]", *SEARCHES),
        rows=(*rows, ("all", "", *(_percent(float(share)) for share in mean))),
        note="The level is our definition: 95 % of the way from the mean best error of the initial populations to the "
        "least error of any run.",
    )


def evaluation_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Cost of all generations."""
    return _cost_table(
        f"Simulations in all generations, {where}",
        findings,
        lambda each: each.evaluations,
        "Means over replicates. Saved: by the efficient against the standard GA. Only chromosomes that changed are "
        "simulated, in the standard GA too; the swarm has no other saving than that a simulation stops once it is "
        f"worse than the particle's own best: {_steps_spared(findings)} % of its time steps.",
    )


def reaching_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Cost of reaching the level."""
    return _cost_table(
        f"Simulations for each run that reaches the 95 % error level, {where}",
        findings,
        lambda each: each.reaching,
        "Simulations of all runs, each until it is there or ends, over the number that get there: what repeating runs "
        "until one succeeds costs; ∞ where none does.",
    )


def _cost_table(
    title: str, findings: Sequence[TrialFinding], cost: Callable[[SearchFinding], float], note: str
) -> Table:
    rows = []
    for finding in findings:
        costs = {search: cost(finding.searches[search]) for search in SEARCHES}
        pair = [costs[STANDARD], costs[EFFICIENT]]
        saved = 1.0 - costs[EFFICIENT] / costs[STANDARD] if np.isfinite(pair).all() else np.nan
        rows.append(
            (_place(finding), *(numbers.format_fixed(value, 0) for value in costs.values()), _percent(saved))
        )
    return Table(
        title=title,
        columns=("model and current", *SEARCHES, "saved by efficient GA [%]"),
        rows=tuple(rows),
        note=note,
    )


def _steps_spared(findings: Sequence[TrialFinding]) -> str:
    shares = [100.0 * finding.searches[SWARM].spared for finding in findings]
    return _between(shares)


def advantage_table(findings: Sequence[TrialFinding], where: str, baseline: str) -> Table:
    """Whether the difference between the genetic algorithms is more than chance."""
    generations = adjusted([finding.same_generations[baseline] for finding in findings])
    simulations = adjusted([finding.same_simulations[baseline] for finding in findings])
    rows = [
        (
            _place(finding),
            _percent(finding.same_generations[baseline].share),
            _p_value(float(by_generations)),
            _percent(finding.same_simulations[baseline].share),
            _p_value(float(by_simulations)),
        )
        for finding, by_generations, by_simulations in zip(findings, generations, simulations, strict=True)
    ]
    return Table(
        title=f"Pairs in which the {EFFICIENT} is lower than the {baseline} [%], {where}",
        columns=(
            "model and current",
            "same generations",
            "p, generations",
            "same simulations",
            "p, simulations",
        ),
        rows=tuple(rows),
        note="A pair has the same initial population. Same simulations: the standard GA stops where it has spent "
        "what the efficient one did. p: Wilcoxon's signed-rank test, two-sided, Holm's correction down each column.",
    )


def termination_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Form of table 4.4: expected and likely terminating generation, and where the test stopped."""
    rows = []
    for finding in findings:
        for search in SEARCHES:
            each = finding.searches[search]
            rule = each.rules[LITERAL]
            rows.append(
                (
                    f"{_place(finding)}, {search}",
                    numbers.format_fixed(each.expected_generation, 0),
                    numbers.format_fixed(each.likelihood, 2),
                    _span(each.own_generation),
                    _percent(rule.share),
                    _span(rule.generation),
                    _percent(rule.excess),
                )
            )
    return Table(
        title=f"Form of table 4.4: terminating generation of the hypothesis test, {where}",
        columns=(
            "model, current and search",
            "expected generation",
            "its likelihood",
            "of each run",
            "runs that it ends [%]",
            "at generation",
            "error above the final [%]",
        ),
        rows=tuple(rows),
        note="Expected: where an exponential fitted to the decay of the mean error meets the test; it may lie beyond "
        "the last generation, generation 0 is the initial population. Likelihood: of just that generation (our "
        f"definition). Of each run: the same from its own decay. Median and 5{_RANGE}95 % of the runs.",
    )


def rule_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Effect of each rule, over all currents."""
    rows = []
    for model in dict.fromkeys(finding.model for finding in findings):
        for search in SEARCHES:
            for rule in (LITERAL, ATTAINABLE, STALL):
                cells = [finding.searches[search] for finding in findings if finding.model == model]
                ends = [each.rules[rule] for each in cells]
                spent = sum(end.evaluations for end in ends) / sum(each.evaluations for each in cells)
                rows.append(
                    (
                        f"{model}, {search}, {rule}",
                        _percent(float(np.mean([end.share for end in ends]))),
                        _between([end.generation[1] for end in ends]),
                        _percent(spent),
                        _between([100.0 * end.excess for end in ends]),
                    )
                )
    return Table(
        title=f"What a rule would have done, {where}",
        columns=(
            "model, search and rule",
            "runs that it ends [%]",
            "median generation, by current",
            "simulations spent [%]",
            "median error above the final [%], by current",
        ),
        rows=tuple(rows),
        note="Each rule alone, from the first generation on. Stall: a gain of less than 0.1 % in 80 generations.",
    )


def _place(finding: TrialFinding) -> str:
    return f"{finding.model}, {finding.current:g} A"


def _percent(share: float) -> str:
    return numbers.format_fixed(100.0 * share, 0)


def _span(quantiles: tuple[float, ...]) -> str:
    low, middle, high = (numbers.format_fixed(value, 0) for value in quantiles)
    return _NONE if middle == _NONE else f"{middle} ({low}{_RANGE}{high})"


def _between(values: Sequence[float]) -> str:
    known = [value for value in values if np.isfinite(value)]
    if not known:
        return _NONE
    low, high = numbers.format_fixed(min(known), 0), numbers.format_fixed(max(known), 0)
    return low if low == high else f"{low} to {high}"


def _p_value(value: float) -> str:
    return "< 0.001" if value < 1e-3 else numbers.format_fixed(value, 3)
