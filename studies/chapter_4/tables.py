"""The study's tables, in the form of tables 4.2 to 4.4 of the thesis and beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from mrwork.report import Table, numbers
from studies.chapter_4.decay import ATTAINABLE, LITERAL, STALL
from studies.chapter_4.findings import SearchFinding, TrialFinding, adjusted
from studies.chapter_4.search_settings import BASELINES, EFFICIENT, SEARCHES, STANDARD, SWARM
from studies.former.table import Cell, table_of

_RANGE = "\N{EN DASH}"
_FIRST = "model and current"
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

    def cell(search: str) -> Cell:
        return lambda finding: " ± ".join(
            _number(100.0 * value, 2)
            for value in (finding.searches[search].mean_error, finding.searches[search].deviation)
        )

    table = table_of(
        f"Form of table 4.2: average error and standard deviation [% NRMSE], {where}",
        _FIRST,
        _by_place(findings),
        {
            **{search: cell(search) for search in SEARCHES},
            "least of all": lambda finding: _number(100.0 * finding.least, 2),
        },
        note="After the last generation, over all replicates; the lowest mean in bold. Least of all: that of any run.",
    )
    means = [[finding.searches[search].mean_error for search in SEARCHES] for finding in findings]
    return replace(table, strong=frozenset((row, 1 + int(np.argmin(mean))) for row, mean in enumerate(means)))


def level_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Form of table 4.3: share of runs below the 95 % error level."""

    def below(search: str) -> Cell:
        return lambda trials: _percent(float(np.mean([trial.searches[search].below for trial in trials])))

    return table_of(
        f"Form of table 4.3: runs below the 95 % error level [%], {where}",
        _FIRST,
        [*((place, [finding]) for place, finding in _by_place(findings)), ("all", findings)],
        {
            "95 % level [% NRMSE]": lambda trials: (
                "" if trials is findings else _number(100.0 * trials[0].level, 2)
            ),
            **{search: below(search) for search in SEARCHES},
        },
        note="The level is our definition: 95 % of the way from the mean best error of the initial populations to the "
        "least error of any run.",
    )


def evaluation_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Cost of all generations."""
    spared = _between([100.0 * finding.searches[SWARM].spared for finding in findings])
    return _cost_table(
        f"Simulations in all generations, {where}",
        findings,
        lambda cell: cell.evaluations,
        "Means over replicates. Saved: by the efficient against the standard GA. Only chromosomes that changed are "
        "simulated, in the standard GA too; the swarm has no other saving than that a simulation stops once it is "
        f"worse than the particle's own best: {spared} % of its time steps.",
    )


def reaching_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Cost of reaching the level."""
    return _cost_table(
        f"Simulations for each run that reaches the 95 % error level, {where}",
        findings,
        lambda cell: cell.reaching,
        "Simulations of all runs, each until it is there or ends, over the number that get there: what repeating runs "
        "until one succeeds costs; ∞ where none does.",
    )


def _cost_table(
    title: str, findings: Sequence[TrialFinding], cost: Callable[[SearchFinding], float], note: str
) -> Table:
    def saved(finding: TrialFinding) -> str:
        standard, efficient = (cost(finding.searches[search]) for search in (STANDARD, EFFICIENT))
        return _percent(1.0 - efficient / standard if np.isfinite([standard, efficient]).all() else np.nan)

    columns: dict[str, Cell] = {
        search: lambda finding, search=search: _number(cost(finding.searches[search])) for search in SEARCHES
    }
    columns["saved by efficient GA [%]"] = saved
    return table_of(title, _FIRST, _by_place(findings), columns, note=note)


def advantage_table(findings: Sequence[TrialFinding], where: str, baseline: str) -> Table:
    """Whether the difference between the genetic algorithms is more than chance."""
    columns: dict[str, Cell] = {}
    for kind, pairs in (
        ("generations", [finding.same_generations[baseline] for finding in findings]),
        ("simulations", [finding.same_simulations[baseline] for finding in findings]),
    ):
        p_values = adjusted(pairs)
        columns[f"same {kind}"] = lambda row, pairs=pairs: _percent(pairs[row].share)
        columns[f"p, {kind}"] = lambda row, p_values=p_values: _p_value(float(p_values[row]))
    return table_of(
        f"Pairs in which the {EFFICIENT} is lower than the {baseline} [%], {where}",
        _FIRST,
        ((place, row) for row, (place, _) in enumerate(_by_place(findings))),
        columns,
        note="A pair has the same initial population. Same simulations: the standard GA stops where it has spent "
        "what the efficient one did. p: Wilcoxon's signed-rank test, two-sided, Holm's correction down each column.",
    )


def termination_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Form of table 4.4: expected and likely terminating generation, and where the test stopped."""
    return table_of(
        f"Form of table 4.4: terminating generation of the hypothesis test, {where}",
        "model, current and search",
        (
            (f"{place}, {search}", finding.searches[search])
            for place, finding in _by_place(findings)
            for search in SEARCHES
        ),
        {
            "expected generation": lambda cell: _number(cell.expected_generation),
            "its likelihood": lambda cell: _number(cell.likelihood, 2),
            "of each run": lambda cell: _span(cell.own_generation),
            "runs that it ends [%]": lambda cell: _percent(cell.rules[LITERAL].share),
            "at generation": lambda cell: _span(cell.rules[LITERAL].generation),
            "error above the final [%]": lambda cell: _percent(cell.rules[LITERAL].excess),
        },
        note="Expected: where an exponential fitted to the decay of the mean error meets the test; it may lie beyond "
        "the last generation, generation 0 is the initial population. Likelihood: of just that generation (our "
        f"definition). Of each run: the same from its own decay. Median and 5{_RANGE}95 % of the runs.",
    )


def rule_table(findings: Sequence[TrialFinding], where: str) -> Table:
    """Effect of each rule, over all currents."""
    rows = []
    for model in dict.fromkeys(finding.model for finding in findings):
        for search in SEARCHES:
            cells = [finding.searches[search] for finding in findings if finding.model == model]
            whole = sum(cell.evaluations for cell in cells)
            for rule in (LITERAL, ATTAINABLE, STALL):
                ends = [cell.rules[rule] for cell in cells]
                rows.append((f"{model}, {search}, {rule}", (ends, whole)))
    return table_of(
        f"What a rule would have done, {where}",
        "model, search and rule",
        rows,
        {
            "runs that it ends [%]": lambda row: _percent(float(np.mean([end.share for end in row[0]]))),
            "median generation, by current": lambda row: _between([end.generation[1] for end in row[0]]),
            "simulations spent [%]": lambda row: _percent(sum(end.evaluations for end in row[0]) / row[1]),
            "median error above the final [%], by current": lambda row: _between(
                [100.0 * end.excess for end in row[0]]
            ),
        },
        note="Each rule alone, from the first generation on. Stall: a gain of less than 0.1 % in 80 generations.",
    )


def _by_place(findings: Sequence[TrialFinding]) -> list[tuple[str, TrialFinding]]:
    return [(f"{finding.model}, {finding.current:g} A", finding) for finding in findings]


def _number(value: float, digits: int = 0) -> str:
    return numbers.format_fixed(value, digits)


def _percent(share: float) -> str:
    return _number(100.0 * share)


def _span(quantiles: tuple[float, ...]) -> str:
    low, middle, high = map(_number, quantiles)
    return _NONE if middle == _NONE else f"{middle} ({low}{_RANGE}{high})"


def _between(values: Sequence[float]) -> str:
    known = [value for value in values if np.isfinite(value)]
    if not known:
        return _NONE
    low, high = _number(min(known)), _number(max(known))
    return low if low == high else f"{low} to {high}"


def _p_value(value: float) -> str:
    return "< 0.001" if value < 1e-3 else _number(value, 3)
