"""The page of the study: error traces with their spread, errors against current, costs, reconstructed loops."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator, StrMethodFormatter

from mrwork.identification import free_run
from mrwork.report import SMALL, WIDE, finish, style
from studies.chapter_4.decay import at_budget, evaluations_to
from studies.chapter_4.findings import QUANTILES, Comparison, Trial, TrialFinding
from studies.chapter_4.search_settings import COARSE, EFFICIENT, SEARCHES, STANDARD, SWARM, ComparisonSettings
from studies.chapter_4.tables import tables_of
from studies.former.arrays import Floats
from studies.former.damper_tests import FORCE_NOISE_N
from studies.former.page import (
    drawn,
    finish_loop,
    panels,
    sentence_case,
    swatch,
    tested_points,
    write_chapter_page,
)

_BUDGETS = 120

COLOURS = {STANDARD: style.INK, COARSE: style.DATA, EFFICIENT: style.MODEL, SWARM: style.RESIDUAL}
# At these the percentages of a logarithmic axis are written.
_TICKS = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100)


@drawn(SMALL)
def generation_figure(axes: Axes, trial: Trial) -> None:
    """Least error against generation: median over the runs and the band of nine in ten."""
    for search in SEARCHES:
        best = trial.runs[search].best
        _band(axes, np.arange(best.shape[1]), best, search)
    _finish_trace(axes, trial, "Generation")


@drawn(SMALL)
def simulation_figure(axes: Axes, trial: Trial) -> None:
    """The same against simulations spent."""
    for search in SEARCHES:
        runs = trial.runs[search]
        # Where every run still goes on.
        budgets = np.linspace(runs.evaluations[:, 0].max(), runs.evaluations[:, -1].min(), _BUDGETS)
        _band(axes, budgets / 1e3, at_budget(runs, budgets[:, None]).T, search)
    _finish_trace(axes, trial, "Simulations (thousands)")


@drawn(WIDE)
def error_figure(axes: Axes, trials: Sequence[Trial]) -> None:
    """Table 4.2 as a figure: mean error and standard deviation against current, of one model."""
    currents = np.array([trial.test.current for trial in trials])
    aside = 0.012 * float(np.ptp(currents) or 1.0)
    for place, search in enumerate(SEARCHES):
        final = 100.0 * np.array([trial.runs[search].final for trial in trials])
        axes.errorbar(
            currents + (place - 1.5) * aside,
            final.mean(axis=1),
            yerr=final.std(axis=1, ddof=1),
            color=COLOURS[search],
            marker="o",
            markersize=3.5,
            linewidth=1.2,
            elinewidth=1.0,
            capsize=2.5,
            label=search,
        )
    # Room for the legend above the lines.
    axes.set_ylim(0.0, 1.35 * axes.get_ylim()[1])
    axes.legend(loc="upper left", bbox_to_anchor=(0.03, 1.0), ncols=2)
    finish(axes, "Error after the last generation (% NRMSE)", "Current (A)")


@drawn(WIDE)
def reaching_figure(axes: Axes, trials: Sequence[Trial]) -> None:
    """Share of the runs at all currents that are at their 95 % error level, against simulations spent."""
    for search in SEARCHES:
        cost = np.concatenate([evaluations_to(trial.runs[search], trial.level) for trial in trials])
        reached = np.sort(cost[np.isfinite(cost)])
        end = max(float(trial.runs[search].evaluations[:, -1].max()) for trial in trials)
        share = 100.0 * np.arange(reached.size + 1) / cost.size
        axes.step(
            np.concatenate([[0.0], reached, [end]]) / 1e3,
            np.append(share, share[-1]),
            where="post",
            color=COLOURS[search],
            linewidth=1.3,
            label=search,
        )
    axes.set_ylim(0.0, 100.0)
    axes.set_xlim(left=0.0)
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.03))
    finish(axes, "Runs below the 95 % error level (%)", "Simulations (thousands)")


@drawn(SMALL)
def loop_figure(axes: Axes, trial: Trial, search: str, *, over_velocity: bool) -> None:
    """One cycle as it was tested, and as the best and the median run of a search reconstruct it."""
    runs, test = trial.runs[search], trial.test
    box, ranked = trial.model.box(test), runs.ranked
    axes.grid(True, axis="both")
    abscissa = 1e3 * (test.velocity if over_velocity else test.displacement)
    # One period at the end of the record, closed.
    period = round(1.0 / ((test.frequency or 1.0) * test.dt))
    cycle = slice(max(0, test.n_time - 1 - period), test.n_time)
    tested_points(axes, abscissa, test.force, cycle)
    for place, colour in ((ranked[len(ranked) // 2], style.RESIDUAL), (ranked[0], style.MODEL)):
        force, _ = free_run(trial.model.spec, np.asarray(box.theta_from_unit(runs.unit[place])), test)
        axes.plot(abscissa[cycle], force[cycle], color=colour, linewidth=1.1)
    finish_loop(axes, over_velocity=over_velocity)


def _band(axes: Axes, abscissa: Floats, misfit: Floats, search: str) -> None:
    low, middle, high = 100.0 * np.quantile(misfit, QUANTILES, axis=0)
    # A fourth band would hide the others.
    if search != COARSE:
        axes.fill_between(abscissa, low, high, color=COLOURS[search], alpha=0.15, linewidth=0)
    axes.plot(abscissa, middle, color=COLOURS[search], linewidth=1.3)


def _finish_trace(axes: Axes, trial: Trial, abscissa: str) -> None:
    axes.axhline(100.0 * trial.level, color=style.FAINT_INK, linewidth=1.2, linestyle=(0, (1.2, 1.8)))
    axes.set_yscale("log")
    low, high = axes.get_ylim()
    axes.yaxis.set_major_locator(FixedLocator([tick for tick in _TICKS if low <= tick <= high]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.set_ylim(low, high)
    axes.set_title("Least error (% NRMSE)", loc="left", pad=7)
    axes.set_xlabel(abscissa)
    axes.set_xlim(left=0.0)
    axes.xaxis.set_major_locator(MaxNLocator(nbins=5, steps=[1, 2, 2.5, 5, 10]))


_SYNTHETIC = (
    "Simulated: the static hysteretic model with the published current polynomials of the RD-1005-3, and "
    f"{FORCE_NOISE_N:g} N of white noise on the force. Neither model of the chapter is the truth."
)
_MEASURED = (
    "Measured at UTFSM on a small damper, not that of the thesis. Its authors averaged the force over a tenth of a "
    "period; the models are compared without averaging, which increases the error of both."
)


def write_page(
    comparisons: Sequence[Comparison],
    findings: Sequence[Sequence[TrialFinding]],
    path: Path,
    *,
    settings: ComparisonSettings,
    skipped: str,
    footer: str,
) -> None:
    """Write the page of all sets."""
    write_chapter_page(
        Path(__file__).parent,
        path,
        subject=f"{settings.replicates} runs of each search of each model on each test, {settings.population} "
        f"candidates, {settings.generations} generations",
        skipped=skipped,
        footer=footer,
        key=(
            *(swatch(COLOURS[search], "line", search) for search in SEARCHES),
            "line: median over the runs, band (but for the coarse one): nine in ten",
            swatch(style.FAINT_INK, "dotted", "95 % error level"),
        ),
        loop_key=(
            swatch(style.DATA, "point", "test"),
            swatch(style.MODEL, "line", f"best run of the {EFFICIENT}"),
            swatch(style.RESIDUAL, "line", "its median run"),
        ),
        sets=[
            _set_part(f"s{place}", comparison, found)
            for place, (comparison, found) in enumerate(zip(comparisons, findings, strict=True), start=1)
        ],
    )


def _set_part(anchor: str, comparison: Comparison, findings: Sequence[TrialFinding]) -> dict[str, Any]:
    tests = comparison.tests
    by_model: dict[str, list[Trial]] = {}
    for trial in comparison.trials:
        by_model.setdefault(trial.model.label, []).append(trial)
    return {
        "anchor": anchor,
        "title": sentence_case(tests.name),
        "synthetic": tests.synthetic,
        "about": _SYNTHETIC if tests.synthetic else _MEASURED,
        "summary": panels(
            f"{anchor}-summary",
            (
                (sentence_case(label), draw(trials), f"{what}, {label}")
                for what, draw in (
                    ("Error against current", error_figure),
                    ("Share of runs below the 95 % error level against simulations", reaching_figure),
                )
                for label, trials in by_model.items()
            ),
        ),
        "tables": tables_of(findings, tests.name),
        "models": [
            _model_part(f"{anchor}-m{place}", label, trials)
            for place, (label, trials) in enumerate(by_model.items())
        ],
    }


def _model_part(anchor: str, label: str, trials: Sequence[Trial]) -> dict[str, Any]:
    # The lowest, the middle and the highest current.
    shown = {
        f"{trials[place].test.current:g} A": trials[place] for place in (0, len(trials) // 2, len(trials) - 1)
    }
    return {
        "label": label,
        "traces": panels(
            f"{anchor}-trace",
            (
                (current, draw(trial), f"Least error against {kind}, {label}, {current}")
                for kind, draw in (("generation", generation_figure), ("simulations", simulation_figure))
                for current, trial in shown.items()
            ),
        ),
        "loops": panels(
            f"{anchor}-loop",
            (
                (
                    current,
                    loop_figure(trial, EFFICIENT, over_velocity=abscissa == "velocity"),
                    f"Force against {abscissa}, {label}, {current}",
                )
                for abscissa in ("displacement", "velocity")
                for current, trial in shown.items()
            ),
        ),
    }
