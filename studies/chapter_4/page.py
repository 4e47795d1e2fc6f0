"""The page of the study: error traces with their spread, errors against current, costs, reconstructed loops."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullLocator, StrMethodFormatter

from mrwork.identification import free_run
from mrwork.report import SMALL, WIDE, Panel, blank, finish, panel, style, write_study_page
from studies.chapter_4.decay import at_budget, evaluations_to
from studies.chapter_4.findings import QUANTILES, Comparison, Trial, TrialFinding
from studies.chapter_4.search_cells import Floats
from studies.chapter_4.search_settings import (
    COARSE,
    EFFICIENT,
    SEARCHES,
    STANDARD,
    SWARM,
    ComparisonSettings,
    Model,
)
from studies.chapter_4.tables import tables_of
from studies.chapter_5.damper_tests import FORCE_NOISE_N
from studies.common.page import finish_loop, swatch, tested_points

_BUDGETS = 120

COLOURS = {STANDARD: style.INK, COARSE: style.DATA, EFFICIENT: style.MODEL, SWARM: style.RESIDUAL}
# At these the percentages of a logarithmic axis are written.
_TICKS = (1, 2, 3, 5, 7, 10, 15, 20, 30, 50, 70, 100)


def generation_figure(trial: Trial) -> Figure:
    """Least error against generation: median over the runs and the band of nine in ten."""
    with style.drawn_in_style():
        figure, axes = blank(SMALL)
        for search in SEARCHES:
            best = trial.runs[search].best
            _band(axes, np.arange(best.shape[1]), best, search)
        _finish_trace(axes, trial, "Generation")
    return figure


def simulation_figure(trial: Trial) -> Figure:
    """The same against simulations spent."""
    with style.drawn_in_style():
        figure, axes = blank(SMALL)
        for search in SEARCHES:
            runs = trial.runs[search]
            # Where every run still goes on.
            budgets = np.linspace(runs.evaluations[:, 0].max(), runs.evaluations[:, -1].min(), _BUDGETS)
            _band(axes, budgets / 1e3, at_budget(runs, budgets[:, None]).T, search)
        _finish_trace(axes, trial, "Simulations (thousands)")
    return figure


def error_figure(comparison: Comparison, model: Model) -> Figure:
    """Table 4.2 as a figure: mean error and standard deviation against current."""
    trials = comparison.of(model)
    currents = comparison.tests.currents
    aside = 0.012 * float(np.ptp(currents) or 1.0)
    with style.drawn_in_style():
        figure, axes = blank(WIDE)
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
    return figure


def reaching_figure(comparison: Comparison, model: Model) -> Figure:
    """Share of the runs at all currents that are at their 95 % error level, against simulations spent."""
    with style.drawn_in_style():
        figure, axes = blank(WIDE)
        for search in SEARCHES:
            cost = np.concatenate(
                [evaluations_to(trial.runs[search], trial.level) for trial in comparison.of(model)]
            )
            reached = np.sort(cost[np.isfinite(cost)])
            end = max(float(trial.runs[search].evaluations[:, -1].max()) for trial in comparison.of(model))
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
    return figure


def loop_figure(trial: Trial, search: str, *, over_velocity: bool) -> Figure:
    """One cycle as it was tested, and as the best and the median run of a search reconstruct it."""
    runs, test = trial.runs[search], trial.test
    box = trial.model.box(test)
    ranked = runs.ranked
    with style.drawn_in_style():
        figure, axes = blank(SMALL)
        axes.grid(True, axis="both")
        abscissa = 1e3 * (test.velocity if over_velocity else test.displacement)
        cycle = _last_cycle(test.n_time, test.frequency, test.dt)
        tested_points(axes, abscissa, test.force, cycle)
        for place, colour in ((ranked[len(ranked) // 2], style.RESIDUAL), (ranked[0], style.MODEL)):
            force, _ = free_run(trial.model.spec, np.asarray(box.theta_from_unit(runs.unit[place])), test)
            axes.plot(abscissa[cycle], force[cycle], color=colour, linewidth=1.1)
        finish_loop(axes, over_velocity=over_velocity)
    return figure


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


def _last_cycle(n_time: int, frequency: float | None, dt: float) -> slice:
    """One period at the end of the record, closed."""
    period = round(1.0 / ((frequency or 1.0) * dt))
    return slice(max(0, n_time - 1 - period), n_time)


_SYNTHETIC = (
    "Simulated: the static hysteretic model with the published current polynomials of the RD-1005-3, and "
    f"{FORCE_NOISE_N:g} N of white noise on the force. Neither model of the chapter is the truth."
)
_MEASURED = (
    "Measured at UTFSM on a small damper, not that of the thesis. Its authors averaged the force over a tenth of a "
    "period; the models are compared without averaging, which increases the error of both."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _ModelPart:
    label: str
    traces: tuple[Panel, ...]
    loops: tuple[Panel, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _SetPart:
    anchor: str
    title: str
    synthetic: bool
    about: str
    summary: tuple[Panel, ...]
    tables: list[Markup]
    models: tuple[_ModelPart, ...]


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
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        subject=f"{settings.replicates} runs of each search of each model on each test, {settings.population} "
        f"candidates, {settings.generations} generations",
        about="After M. T. Nguyen, Modelling and Control of Smart Structures Embedded with Magnetorheological "
        "Dampers, University of Technology, Sydney, 2009, chapter 4: the form of its tables 4.2 to 4.4. Its "
        "values were not at hand and are not reproduced here.",
        skipped=skipped,
        footer=footer,
        key=(
            *_key([(COLOURS[search], "line", search) for search in SEARCHES]),
            Markup("line: median over the runs, band (but for the coarse one): nine in ten"),
            *_key([(style.FAINT_INK, "dotted", "95 % error level")]),
        ),
        loop_key=_key(
            [
                (style.DATA, "point", "test"),
                (style.MODEL, "line", f"best run of the {EFFICIENT}"),
                (style.RESIDUAL, "line", "its median run"),
            ]
        ),
        sets=[
            _set_part(f"s{place}", comparison, found)
            for place, (comparison, found) in enumerate(zip(comparisons, findings, strict=True), start=1)
        ],
    )


def _set_part(anchor: str, comparison: Comparison, findings: Sequence[TrialFinding]) -> _SetPart:
    tests = comparison.tests
    models = tuple(dict.fromkeys(trial.model.label for trial in comparison.trials))
    by_label = {trial.model.label: trial.model for trial in comparison.trials}
    return _SetPart(
        anchor=anchor,
        title=tests.name[0].upper() + tests.name[1:],
        synthetic=tests.synthetic,
        about=_SYNTHETIC if tests.synthetic else _MEASURED,
        summary=tuple(
            panel(
                f"{anchor}-{kind}{place}",
                _title(label),
                draw(comparison, by_label[label]),
                f"{what}, {label}",
            )
            for kind, what, draw in (
                ("error", "Error against current", error_figure),
                ("reach", "Share of runs below the 95 % error level against simulations", reaching_figure),
            )
            for place, label in enumerate(models)
        ),
        tables=tables_of(findings, tests.name),
        models=tuple(
            _model_part(f"{anchor}-m{place}", comparison, by_label[label])
            for place, label in enumerate(models)
        ),
    )


def _model_part(anchor: str, comparison: Comparison, model: Model) -> _ModelPart:
    trials = comparison.of(model)
    # The lowest, the middle and the highest current.
    shown = [trials[place] for place in dict.fromkeys((0, len(trials) // 2, len(trials) - 1))]
    return _ModelPart(
        label=model.label,
        traces=tuple(
            panel(
                f"{anchor}-{kind}{place}",
                _current(trial),
                draw(trial),
                f"Least error against {kind}, {model.label}, {_current(trial)}",
            )
            for kind, draw in (("generation", generation_figure), ("simulations", simulation_figure))
            for place, trial in enumerate(shown)
        ),
        loops=tuple(
            panel(
                f"{anchor}-loop{place}{'v' if over_velocity else 'x'}",
                _current(trial),
                loop_figure(trial, EFFICIENT, over_velocity=over_velocity),
                f"Force against {'velocity' if over_velocity else 'displacement'}, {model.label}, {_current(trial)}",
            )
            for over_velocity in (False, True)
            for place, trial in enumerate(shown)
        ),
    )


def _current(trial: Trial) -> str:
    return f"{trial.test.current:g} A"


def _title(label: str) -> str:
    return label[0].upper() + label[1:]


def _key(entries: Sequence[tuple[str, str, str]]) -> tuple[Markup, ...]:
    """Colour, kind of mark and meaning of each."""
    return tuple(Markup("{}{}").format(swatch(colour, kind), text) for colour, kind, text in entries)
