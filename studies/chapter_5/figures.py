"""The study's figures: parameters against current, loops, RMS error against current."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import mrwork as mr
from mrwork.identification import free_run
from mrwork.report import SMALL, WIDE, blank, finish, finish_loop, style, tested_points
from studies.chapter_5.current_laws import Model
from studies.chapter_5.damper_tests import FORCE_NOISE_N, Floats
from studies.chapter_5.outcome import SetOutcome

_FINE = 60
_LOOPS = 3
_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")

# One for each frequency, and one for each model.
FREQUENCY_COLOURS = (style.MODEL, style.RESIDUAL)
_MODEL_COLOURS = {
    "static_hysteretic": style.MODEL,
    "polynomial_fitting": style.RESIDUAL,
    "normalised_bouc_wen": style.INK,
}


def parameter_figure(outcomes: Sequence[SetOutcome], model: Model, name: str) -> Figure:
    """One parameter of a model against current, every frequency of one damper."""
    place = mr.damper(model.damper).names.index(name)
    unit = mr.damper(model.damper).parameters[place].unit
    with style.drawn_in_style():
        figure, axes = blank(SMALL)
        seen: list[Floats] = []
        for outcome, colour in zip(outcomes, FREQUENCY_COLOURS, strict=False):
            each, laws = outcome.each[model.label], outcome.laws[model.label]
            fine = np.linspace(each.currents[0], each.currents[-1], _FINE)
            true = outcome.true_laws
            if true is not None and model.damper == "static_hysteretic":
                axes.plot(fine, true.at(name, fine), color=style.RULE, linewidth=5.0, zorder=1)
                seen.append(true.at(name, fine))
            values, errors = each.values[:, place], each.errors[:, place]
            known = np.isfinite(errors)
            axes.errorbar(
                each.currents[known],
                values[known],
                yerr=errors[known],
                fmt="o",
                color=colour,
                markersize=4.0,
                elinewidth=1.0,
                capsize=2.0,
                zorder=3,
            )
            axes.plot(
                each.currents[~known],
                values[~known],
                "o",
                color=colour,
                markersize=4.0,
                markerfacecolor="white",
                zorder=3,
            )
            axes.plot(fine, laws.through.at(name, fine), color=colour, linewidth=1.0, zorder=2)
            axes.plot(
                fine, laws.joint.at(name, fine), color=colour, linewidth=1.3, linestyle=(0, (4, 2)), zorder=2
            )
            seen += [values[known & (errors < abs(values))], laws.joint.at(name, fine)]
        _limit(axes, np.concatenate(seen))
        finish(axes, f"{_letter(name)}{f' ({unit})' if unit != '1' else ''}", "Current (A)")
    return figure


def loop_figure(outcome: SetOutcome, model: Model, *, over_velocity: bool) -> Figure:
    """Force loops at three currents, points of the test and line of the model identified at that current."""
    each = outcome.each[model.label]
    places = np.unique(np.round(np.linspace(0, len(each.fits) - 1, _LOOPS)).astype(int))
    with style.drawn_in_style():
        figure, axes = blank(SMALL)
        axes.grid(True, axis="both")
        for place in places:
            test, fit = outcome.tests.tests[place], each.fits[place]
            abscissa = 1e3 * (test.velocity if over_velocity else test.displacement)
            force, _ = free_run(mr.damper(model.damper), np.array(fit.theta), test)
            cycle = _middle_cycle(test)
            tested_points(axes, abscissa, test.force, cycle)
            axes.plot(abscissa[cycle], force[cycle], color=style.MODEL, linewidth=1.1)
            top = int(np.argmax(force[cycle]))
            axes.annotate(
                f"{test.current:g} A",
                (abscissa[cycle][top], force[cycle][top]),
                xytext=(0, 4),
                textcoords="offset points",
                ha="right" if over_velocity else "center",
                fontsize=style.SMALL_TEXT_SIZE,
            )
        axes.margins(y=0.12)
        finish_loop(axes, over_velocity=over_velocity)
    return figure


def rms_figure(outcome: SetOutcome) -> Figure:
    """RMS error against current: figure 5.9 of the thesis."""
    with style.drawn_in_style():
        figure, axes = blank(WIDE)
        for label, each in outcome.each.items():
            axes.plot(
                each.currents,
                each.rms_n,
                marker="o",
                markersize=3.5,
                color=_MODEL_COLOURS[each.model.damper],
                linewidth=1.2,
                label=label,
            )
        if outcome.tests.synthetic:
            axes.axhline(
                FORCE_NOISE_N, color=style.DATA, linewidth=1.2, linestyle=(0, (1.2, 1.8)), label="noise"
            )
        largest = max(float(each.rms_n.max()) for each in outcome.each.values())
        # Room for the legend above the lines.
        axes.set_ylim(0.0, 1.5 * largest)
        axes.legend(loc="upper left", bbox_to_anchor=(0.03, 1.0), ncols=1)
        finish(axes, "RMS error (N)", "Current (A)")
    return figure


def _limit(axes: Axes, values: Floats) -> None:
    """Limit the ordinate to the values, since the error bar of a poorly determined one would compress the others."""
    low, high = float(values.min()), float(values.max())
    margin = 0.12 * ((high - low) or abs(high) or 1.0)
    # Around a constant, noise alone would fill the panel.
    widen = max(0.0, 0.1 * max(abs(low), abs(high)) - (high - low)) / 2.0
    axes.set_ylim(low - margin - widen, high + margin + widen)


def _letter(name: str) -> str:
    return {"alpha": "α", "beta": "β", "delta": "δ"}.get(name, name.translate(_SUBSCRIPTS))


def _middle_cycle(test: mr.DamperTest) -> slice:
    """One period in the middle of the record, closed."""
    period = round(1.0 / ((test.frequency or 1.0) * test.dt))
    start = max(test.n_settle, (test.n_time - period) // 2)
    return slice(start, min(start + period + 1, test.n_time))
