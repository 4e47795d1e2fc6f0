"""The page of the study: parameters against current, loops, RMS error against current."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

import mrwork as mr
from mrwork.identification import free_run
from mrwork.report import SMALL, WIDE, draw_points, finish, style
from studies.chapter_5.damper_tests import FORCE_NOISE_N
from studies.chapter_5.loop_branches import Abscissa, branches
from studies.chapter_5.outcome import MODELS, STATIC, WITH_LAWS, Model, SetOutcome
from studies.chapter_5.tables import law_rms_table, law_table, per_current_table, rms_table
from studies.chapter_5.thickness_and_mean import STATIC_MODELS, forces, loops_table
from studies.former.arrays import Floats
from studies.former.page import (
    drawn,
    finish_loop,
    panels,
    sentence_case,
    swatch,
    tested_points,
    write_chapter_page,
)
from studies.former.table import with_symbols

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


@drawn(SMALL)
def parameter_figure(axes: Axes, outcomes: Sequence[SetOutcome], model: Model, name: str) -> None:
    """One parameter of a model against current, every frequency of one damper."""
    place = mr.damper(model.damper).names.index(name)
    unit = mr.damper(model.damper).parameters[place].unit
    seen: list[Floats] = []
    for outcome, colour in zip(outcomes, FREQUENCY_COLOURS, strict=False):
        fits, laws = outcome.each[model.label], outcome.laws[model.label]
        fine = np.linspace(fits.currents[0], fits.currents[-1], _FINE)
        true = outcome.true_laws
        if true is not None and model.damper == "static_hysteretic":
            axes.plot(fine, true.at(name, fine), color=style.RULE, linewidth=5.0, zorder=1)
            seen.append(true.at(name, fine))
        values, errors = fits.values[:, place], fits.errors[:, place]
        known = np.isfinite(errors)
        axes.errorbar(
            fits.currents[known],
            values[known],
            yerr=errors[known],
            fmt="o",
            color=colour,
            markersize=4.0,
            elinewidth=1.0,
            capsize=2.0,
            zorder=3,
        )
        hollow = {"markersize": 4.0, "markerfacecolor": "white", "zorder": 3}
        axes.plot(fits.currents[~known], values[~known], "o", color=colour, **hollow)
        axes.plot(fine, laws.through.at(name, fine), color=colour, linewidth=1.0, zorder=2)
        joint = laws.joint.at(name, fine)
        axes.plot(fine, joint, color=colour, linewidth=1.3, linestyle=(0, (4, 2)), zorder=2)
        seen += [values[known & (errors < abs(values))], joint]
    _limit(axes, np.concatenate(seen))
    finish(axes, f"{_letter(name)}{f' ({unit})' if unit != '1' else ''}", "Current (A)")


@drawn(SMALL)
def loop_figure(axes: Axes, outcome: SetOutcome, model: Model, *, over_velocity: bool) -> None:
    """Force loops at three currents, points of the test and line of the model identified at that current."""
    fits = outcome.each[model.label].fits
    axes.grid(True, axis="both")
    for place in np.unique(np.round(np.linspace(0, len(fits) - 1, _LOOPS)).astype(int)):
        test, fit = outcome.tests.tests[place], fits[place]
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


@drawn(WIDE)
def rms_figure(axes: Axes, outcome: SetOutcome) -> None:
    """RMS error against current: figure 5.9 of the thesis."""
    for label, fits in outcome.each.items():
        tone = _MODEL_COLOURS[fits.model.damper]
        axes.plot(
            fits.currents, fits.rms_n, marker="o", markersize=3.5, color=tone, linewidth=1.2, label=label
        )
    if outcome.tests.synthetic:
        dots = (0, (1.2, 1.8))
        axes.axhline(FORCE_NOISE_N, color=style.DATA, linewidth=1.2, linestyle=dots, label="noise")
    # Room for the legend above the lines.
    axes.set_ylim(0.0, 1.5 * max(float(fits.rms_n.max()) for fits in outcome.each.values()))
    axes.legend(loc="upper left", bbox_to_anchor=(0.03, 1.0), ncols=1)
    finish(axes, "RMS error (N)", "Current (A)")


@style.drawn_in_style()
def branches_figure(tests: Sequence[mr.DamperTest], forces: Sequence[Floats], over: Abscissa) -> Figure:
    """Thickness of the loops of tests of a damper, and the mean of their branches.

    Points are means over the cycles of a test, in a band of one standard deviation of a cycle; lines are the `forces`
    of a model on the motions of the tests.
    """
    figure = Figure(figsize=(style.PANEL_WIDTH, 6.2), layout="constrained")
    rows = figure.subplots(2, 1, sharex=True)
    loops = [branches(test, over=over) for test in tests]
    unit = style.force_unit(max(float(np.abs(loop.mean).max()) for loop in loops))
    for axes, quantity, title in zip(
        rows, ("thickness", "mean"), ("Thickness", "Mean of the branches"), strict=True
    ):
        for number, (test, loop, force) in enumerate(zip(tests, loops, forces, strict=True)):
            tone = to_hex(style.TONES(number / max(len(tests) - 1, 1)))
            cycles = unit.factor * getattr(loop, quantity)
            mean, deviation, at = cycles.mean(axis=0), cycles.std(axis=0, ddof=1), 1e3 * loop.abscissa
            axes.fill_between(at, mean - deviation, mean + deviation, color=tone, alpha=0.25, linewidth=0)
            draw_points(axes, at[::2], mean[::2], size=3.0, colour=tone)
            model = branches(test, over=over, force=force)
            modelled = unit.factor * getattr(model, quantity).mean(axis=0)
            name = f"{test.current:g} A"
            axes.plot(1e3 * model.abscissa, modelled, color=tone, linewidth=1.2, label=name)
        finish(axes, f"{title} ({unit.symbol})")
        axes.axhline(0.0, color=style.FAINT_INK, linewidth=0.6, zorder=0.9)
    rows[1].set_xlabel("Velocity (mm/s)" if over == "velocity" else "Displacement (mm)")
    figure.legend(*rows[0].get_legend_handles_labels(), loc="outside upper left", ncols=4)
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


_ABOUT = {
    "synthetic static": "Simulated: the static hysteretic model with the published current polynomials of the "
    f"RD-1005-3, and {FORCE_NOISE_N:g} N of white noise on the force. The static model is the truth here, so it cannot "
    "but look perfect: this shows what the method recovers, not which model is better.",
    "synthetic two-stage": "Simulated: a sharp Bouc-Wen and a broad Dahl element in parallel, our own numbers, and "
    f"{FORCE_NOISE_N:g} N of white noise on the force. None of the models compared is the truth.",
    "measured UTFSM": "Measured at UTFSM on a small damper of another make than the RD-1005-3. Its authors averaged "
    "the force over a tenth of a period; the models' force is averaged alike before the two are compared. Residuals "
    "repeat from sample to sample, so the standard errors are lower limits.",
    "measured UTFSM, averaging ignored": "The same tests with the averaging of the force ignored: "
    "the result of an identification without knowledge of it.",
    "measured UTFSM, not averaged": "The one of the two motions that is there as it was recorded, before its authors "
    "averaged it.",
}


def write_page(outcomes: Sequence[SetOutcome], path: Path, *, skipped: str, footer: str) -> None:
    """Write the page of all sets, those of one damper together."""
    dampers = dict.fromkeys(outcome.tests.damper for outcome in outcomes)
    parts = [
        _damper_part(f"d{place}", [outcome for outcome in outcomes if outcome.tests.damper == damper])
        for place, damper in enumerate(dampers, start=1)
    ]
    write_chapter_page(
        Path(__file__).parent,
        path,
        skipped=skipped,
        footer=footer,
        dampers=parts,
    )


def _damper_part(anchor: str, outcomes: list[SetOutcome]) -> dict[str, Any]:
    first = outcomes[0]
    name, kind = first.tests.damper, "synthetic" if first.tests.synthetic else "measured"
    return {
        "anchor": anchor,
        "title": sentence_case(name),
        "synthetic": first.tests.synthetic,
        "about": _ABOUT[name],
        "rms": panels(
            f"{anchor}-rms",
            (
                (outcome.tests.motion, rms_figure(outcome), "RMS error against current")
                for outcome in outcomes
            ),
        ),
        "rms_tables": with_symbols(map(rms_table, outcomes)),
        "loop_motion": first.tests.motion,
        "loop_note": f"Points: {kind}. Line: the model identified at that current, one cycle.",
        "loops": panels(
            f"{anchor}-loop",
            (
                (
                    sentence_case(model.label),
                    loop_figure(first, model, over_velocity=abscissa == "velocity"),
                    f"Force against {abscissa} at three currents, {model.label}",
                )
                for abscissa in ("displacement", "velocity")
                for model in MODELS
                if model.label in first.each
            ),
        ),
        "branches": panels(f"{anchor}-branches", _branch_figures(outcomes)),
        "branch_tables": with_symbols(map(loops_table, outcomes)),
        "models": [
            _model_part(f"{anchor}-m{place}", outcomes, model)
            for place, model in enumerate(WITH_LAWS)
            if model.label in first.laws
        ],
        "law_rms": with_symbols(map(law_rms_table, outcomes)),
    }


def _branch_figures(outcomes: list[SetOutcome]) -> Iterator[tuple[str, Figure, str]]:
    """Thickness and mean, both motions over the velocity and the first over the displacement, a static model each."""
    for over, shown in (("velocity", outcomes), ("displacement", outcomes[:1])):
        for outcome in shown:
            for label in (name for name in STATIC_MODELS if name in outcome.each):
                motion = outcome.tests.motion
                figure = branches_figure(outcome.tests.tests, forces(outcome, outcome.each[label]), over=over)
                about = f"Thickness and mean of the loops against {over}, {motion}, {label}"
                yield f"{motion}, {label}, over {over}", figure, about


def _model_part(anchor: str, outcomes: list[SetOutcome], model: Model) -> dict[str, Any]:
    return {
        "label": model.label,
        "key": _key(outcomes, model),
        "panels": panels(
            anchor,
            (
                (name, parameter_figure(outcomes, model, name), f"{name} against current")
                for name in model.free
            ),
        ),
        "tables": with_symbols(
            table(outcome, outcome.each[model.label])
            for outcome in outcomes
            for table in (per_current_table, law_table)
        ),
    }


def _key(outcomes: list[SetOutcome], model: Model) -> list[Markup | str]:
    """Meaning of the marks in a parameter's panel."""
    coloured = Markup('<span style="color:{}">{}</span>')
    lines: list[Markup | str] = [
        swatch(colour, "point", coloured.format(colour, outcome.tests.motion))
        for outcome, colour in zip(outcomes, FREQUENCY_COLOURS, strict=False)
    ]
    lines += [
        "points: at each current, bars of one standard error; hollow: no standard error",
        swatch(style.INK, "line", "polynomial through them"),
        swatch(style.INK, "dashed", "law identified jointly"),
    ]
    if model == STATIC and outcomes[0].true_laws is not None:
        lines.append(swatch(style.RULE, "wide", "truth, published"))
    return lines
