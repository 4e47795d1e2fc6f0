"""The section on the next test: candidates ranked by the variance reduction that they would bring."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure

from mrwork.base import numbers
from mrwork.base.table import page_table
from mrwork.base.units import CommandUnit
from mrwork.report import style
from mrwork.report.canvas import grid_of_axes, name_ordinate
from mrwork.report.figures import Comparison
from mrwork.report.section import Absent, Group, Section, SectionKind, panel
from mrwork.runs.load import StoredRun
from mrwork.uncertainty.planning import Gain, Plan, gain_columns

# Rows of the table.
_SHOWN = 8
_COLUMNS = 3
_WIDTH, _HEIGHT = 3.6, 3.0
# From white to the blue of the models: the darker, the larger the reduction.
_MAP = LinearSegmentedColormap.from_list("gain", ["#ffffff", style.MODEL])
# Where a cell is darker, its number is white.
_DARK = 0.55


def _section(run: StoredRun, _: Sequence[Comparison]) -> Section | None:
    """The best candidates, the map of all of them, and whether draws rank them alike."""
    check = run.plan
    if check is None:
        return None
    current = run.fit.spec.current
    unit = None if current is None else current.unit
    plan = check.plan
    best = plan.gains[0]
    name = best.candidate.in_words(unit)
    shown = plan.gains[:_SHOWN]
    agreement = (
        "The check with draws failed: almost none of them fits the simulated tests. Use the order of the candidates, "
        "not the numbers."
        if check.agreement is None
        else f"A check with draws ranks the candidates with a rank correlation of {check.agreement:.2f} to this order."
    )
    return Section(
        anchor="next-test",
        title="Next test",
        summary=f"Next test: {name} narrows the band of {plan.band} most of {len(plan.gains)} candidates.",
        groups=(
            Group(
                prose=(
                    f"Of {len(plan.gains)} candidates, {name} is expected to reduce the variance of the band of "
                    f"{plan.band} by {numbers.format_fixed(100 * best.gain, 1)} %. This assumes that the model is "
                    "valid there; a test in which it is not shows the error of the model instead.",
                    agreement,
                ),
                table=page_table(
                    "Candidates for the next test",
                    gain_columns(unit),
                    shown,
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
                        f"Variance reduction by each of {len(plan.gains)} tests, best {name}",
                    ),
                ),
                layout="whole",
            ),
        ),
    )


@style.drawn_in_style()
def plan_figure(plan: Plan, unit: CommandUnit | None) -> Figure:
    """Variance reduction [%] at each amplitude and frequency; the best is framed, other places are blank."""
    commands = sorted({each.candidate.command for each in plan.gains}, key=lambda value: value or 0.0)
    most = max(each.gain for each in plan.gains)
    width = max(_WIDTH, style.PANEL_WIDTH / len(commands))
    figure, maps = grid_of_axes(len(commands), _COLUMNS, (width, _HEIGHT))
    for axes, command in zip(maps, commands, strict=True):
        gains = [each for each in plan.gains if each.candidate.command == command]
        _draw(axes, gains, plan.gains[0], most)
        title = "Variance reduction (%)"
        name_ordinate(axes, title if command is None else f"{title}, {command:g} {unit}")
    return figure


def _draw(axes: Axes, gains: list[Gain], best: Gain, most: float) -> None:
    amplitudes = sorted({each.candidate.amplitude for each in gains})
    frequencies = sorted({each.candidate.frequency for each in gains})
    table = np.full((len(amplitudes), len(frequencies)), np.nan)
    for each in gains:
        row, column = amplitudes.index(each.candidate.amplitude), frequencies.index(each.candidate.frequency)
        table[row, column] = each.gain
        axes.text(
            column,
            row,
            f"{100.0 * each.gain:.0f}",
            ha="center",
            va="center",
            fontsize=style.SMALL_TEXT_SIZE,
            fontweight="bold" if each is best else "normal",
            color="white" if each.gain > _DARK * most else style.INK,
        )
        if each is best:
            axes.plot(
                column + 0.5 * np.array([-1, 1, 1, -1, -1]),
                row + 0.5 * np.array([-1, -1, 1, 1, -1]),
                color=style.RESIDUAL,
                linewidth=2.0,
                clip_on=False,
            )
    axes.imshow(table, origin="lower", aspect="auto", cmap=_MAP, vmin=0.0, vmax=max(most, 1e-12))
    axes.grid(visible=False)
    axes.set_xticks(range(len(frequencies)), [f"{value:.3g}" for value in frequencies])
    axes.set_yticks(range(len(amplitudes)), [f"{1e3 * value:.3g}" for value in amplitudes])
    axes.set_xlabel("Frequency (Hz)")
    axes.set_ylabel("Amplitude (mm)")


PLAN = SectionKind(
    make=_section,
    absent=Absent(
        title="Next test",
        command="mrwork plan RUN",
        description="ranks candidates for the next test by how much each would narrow a band.",
    ),
)
