"""The page of the study with its figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from mrwork.report import WIDE, Panel, blank, finish, panel, style, write_study_page
from studies.chapter_7.controlled_tests import BEST, CLIPPED, LYAPUNOV, OFF, Tests
from studies.chapter_7.earthquakes import LEAD, PEAK
from studies.chapter_7.findings import Chapter
from studies.chapter_7.frame_tests import ADDED_MASS, LENGTH, IdentifiedFrame, spectrum
from studies.chapter_7.predictions import JUDGED
from studies.chapter_7.rig_damper import IdentifiedDamper, at_currents
from studies.chapter_7.sine_tests import SWEEP_CURRENTS, SineTest
from studies.chapter_7.tables import mean_of, tables
from studies.chapter_7.virtual_rig import (
    DRIVER_RATE,
    HARDWARE,
    LARGEST_CURRENT,
    SENSORS,
    TABLE,
    Signals,
    rd_1005_3,
)

_TONES = (style.MODEL, style.RESIDUAL, style.PARAMETER_BAND, style.INK, style.DATA, style.BAND_EDGE)
# What is shown of a test [s], and every how many samples: 250 Hz are enough for a frame of 3 Hz.
_SHOWN, _EVERY = (0.0, 20.0), 4


@style.drawn_in_style()
def gain_figure() -> Figure:
    """Gain of the table over the frequency."""
    figure, axes = blank(WIDE)
    frequency = np.geomspace(0.5, 100.0, 201)
    axes.semilogx(frequency, np.abs(TABLE.gain(frequency)), color=style.MODEL)
    axes.axvline(TABLE.bandwidth, color=style.RULE, linewidth=0.8, zorder=0.9)
    axes.set_ylim(0.0, 1.1)
    finish(axes, "Gain of the table", "Frequency (Hz)")
    axes.set_xticks([1.0, 3.0, 10.0, 30.0, 100.0], ["1", "3", "10", "30", "100"])
    axes.minorticks_off()
    return figure


@style.drawn_in_style()
def command_figure(chapter: Chapter) -> Figure:
    """Displacement of the table in every test, over time, with the stroke."""
    figure, axes = blank(WIDE)
    for motion, tone in zip(chapter.motions, _TONES, strict=False):
        every = max(1, round(0.02 / motion.dt))
        axes.plot(
            motion.time[::every] - LEAD, 1e3 * motion.displacement[::every], color=tone, label=motion.name
        )
    for side in (-1e3, 1e3):
        axes.axhline(side * TABLE.stroke, color=style.FAINT_INK, linestyle=style.DASHED, linewidth=0.8)
    axes.set_ylim(-1.25e3 * TABLE.stroke, 1.6e3 * TABLE.stroke)
    axes.legend(loc="upper right", ncols=2)
    finish(axes, "Displacement of the table (mm); dashed: stroke", "Time (s)")
    return figure


@style.drawn_in_style()
def decay_figure(found: IdentifiedFrame) -> Figure:
    """The decay of the bare frame, with the envelope of the decrement."""
    figure, axes = blank(WIDE)
    record, estimate = found.bare.record, found.bare.decrement
    time = record.time - record.time[0]
    axes.plot(time[::10], 1e3 * record.displacement[::10], color=style.DATA, linewidth=0.8)
    first = 1e3 * np.abs(record.displacement[: round(1.0 / estimate.frequency / record.step)]).max()
    for side in (-1.0, 1.0):
        axes.plot(time, side * first * np.exp(-estimate.decay * time), color=style.MODEL, linewidth=1.1)
    finish(axes, "Displacement (mm); lines: envelope of the decrement", "Time (s)")
    return figure


@style.drawn_in_style()
def spectrum_figure(found: IdentifiedFrame) -> Figure:
    """Fourier spectra of both decays."""
    figure, axes = blank(WIDE)
    for each, tone, name in (
        (found.bare, style.MODEL, "bare"),
        (found.loaded, style.RESIDUAL, "with plates"),
    ):
        frequency, amplitude = spectrum(each.record)
        shown = (frequency > 2.0) & (frequency < 4.0)
        axes.semilogy(frequency[shown], 1e3 * amplitude[shown], color=tone, label=name)
    axes.legend(loc="upper right")
    axes.minorticks_off()
    axes.set_title("Fourier amplitude of the displacement (mm s)", loc="left", pad=7)
    axes.set_xlabel("Frequency (Hz)")
    return figure


@style.drawn_in_style()
def sine_figure(measured: list[SineTest], predicted: list[SineTest]) -> Figure:
    """Response amplitudes over the frequency: measured points, lines of the identified rig."""
    figure, axes = blank(WIDE)
    for current, tone in zip(SWEEP_CURRENTS, _TONES, strict=False):
        points = [each for each in measured if each.wanted.current == current]
        line = [each for each in predicted if each.wanted.current == current]
        axes.plot(
            [each.wanted.frequency for each in line],
            [1e3 * each.displacement for each in line],
            color=tone,
            label=f"{current:g} A",
        )
        axes.plot(
            [each.wanted.frequency for each in points],
            [1e3 * each.displacement for each in points],
            "o",
            color=tone,
            markersize=5.0,
            markeredgewidth=0.0,
        )
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="upper right")
    finish(axes, "Amplitude of the displacement (mm)", "Frequency of the table (Hz)")
    return figure


@style.drawn_in_style()
def loop_figure(found: IdentifiedDamper) -> Figure:
    """Force over velocity of the tests at 3 Hz, as the load cell has it."""
    figure, axes = blank(WIDE)
    shown = [test for test in found.tests if test.frequency == 3.0]
    tones = dict(zip(sorted({test.command_in_words for test in shown}), _TONES, strict=False))
    for test in shown:
        cycle = slice(0, round(1.0 / (3.0 * test.dt)) + 1)
        axes.plot(
            1e3 * test.velocity[cycle],
            test.force[cycle],
            color=tones[test.command_in_words],
            linewidth=1.0,
            label=test.command_in_words if test.amplitude > 1e-3 else None,
        )
    axes.legend(loc="upper left", bbox_to_anchor=(0.03, 1.0))
    finish(axes, "Force (N), 3 Hz", "Velocity (mm/s)")
    return figure


@style.drawn_in_style()
def friction_figure(found: IdentifiedDamper) -> Figure:
    """Height of the hysteresis over the current, identified and true."""
    figure, axes = blank(WIDE)
    currents = np.linspace(0.0, LARGEST_CURRENT, 51)
    for theta, tone, line, name in (
        (rd_1005_3().draws[0], style.DATA, "solid", "true"),
        (np.array(found.fit.theta), style.MODEL, style.DASHED, "identified"),
    ):
        axes.plot(currents, at_currents(theta, currents)["alpha"], color=tone, linestyle=line, label=name)
    axes.legend(loc="upper left", bbox_to_anchor=(0.03, 1.0))
    finish(axes, "Height of the hysteresis, alpha (N)", "Current (A)")
    return figure


@style.drawn_in_style()
def history_figure(without: Signals, controlled: Signals) -> Figure:
    """Displacement, acceleration, current and force over time: with control solid, at i = 0 dotted."""
    figure = Figure(figsize=(9.6, 7.0), layout="constrained")
    rows = figure.subplots(4, 1, sharex=True, height_ratios=(3.0, 3.0, 1.4, 2.0))
    first, last = (round((LEAD + second) / controlled.step) for second in _SHOWN)
    last = min(last, controlled.time.size)
    without, controlled = without.part(first, last), controlled.part(first, last)
    time = controlled.time[::_EVERY] - LEAD
    for axes, name, factor, title in (
        (rows[0], "displacement", 1e3, "Displacement (mm)"),
        (rows[1], "acceleration", 1.0, "Acceleration (m/s²)"),
    ):
        axes.plot(
            time,
            factor * getattr(without, name)[::_EVERY],
            color=style.RESIDUAL,
            linestyle=style.DOTTED,
            linewidth=1.0,
        )
        axes.plot(time, factor * getattr(controlled, name)[::_EVERY], color=style.MODEL, linewidth=1.2)
        finish(axes, title)
    rows[2].plot(time, controlled.current[::_EVERY], color=style.INK, linewidth=0.8)
    rows[2].set_ylim(-0.1 * LARGEST_CURRENT, 1.15 * LARGEST_CURRENT)
    finish(rows[2], "Current (A)")
    rows[2].set_yticks([0.0, LARGEST_CURRENT])
    rows[3].plot(time, controlled.force[::_EVERY], color=style.INK, linewidth=0.8)
    finish(rows[3], "Force (N)", "Time (s)")
    rows[3].set_xlim(time[0], time[-1])
    return figure


@style.drawn_in_style()
def score_figure(chapter: Chapter) -> Figure:
    """Score of constant currents on the rig, beyond the driver of the tests, with both laws as dashed lines."""
    figure, axes = blank(WIDE)
    axes.plot(chapter.sweep["currents"], chapter.sweep["scores"], "o-", color=style.INK, markersize=4.0)
    scores = chapter.found[chapter.kind]["tests"]["score"]
    for law, tone, line in ((CLIPPED, style.MODEL, style.DASHED), (LYAPUNOV, style.RESIDUAL, style.DOTTED)):
        axes.axhline(scores[law], color=tone, linestyle=line, linewidth=1.2, label=law)
    axes.axvline(LARGEST_CURRENT, color=style.RULE, linewidth=0.8, zorder=0.9)
    axes.set_ylim(0.0, 1.05)
    axes.legend(loc="upper right")
    finish(axes, "Score over i = 0", "Constant current (A)")
    return figure


@style.drawn_in_style()
def error_figure(chapter: Chapter) -> Figure:
    """Errors of the full prediction: a point for each case and record, by quantity."""
    figure, axes = blank((9.6, 4.2))
    each = chapter.found[chapter.kind]["predictions"]["each"]
    for place, (case, tone) in enumerate(zip(each, _TONES, strict=False)):
        for number, quantity in enumerate(JUDGED):
            values = [run[quantity] for run in each[case].values() if quantity in run]
            axes.plot(
                np.full(len(values), number + 0.12 * (place - 2.5)),
                values,
                "o",
                color=tone,
                markersize=4.5,
                markeredgewidth=0.0,
                label=case if number == 0 else None,
            )
    axes.axhline(0.0, color=style.FAINT_INK, linewidth=0.6, zorder=0.9)
    finish(axes, "Predicted over measured, less one (%)")
    axes.set_xticks(range(len(JUDGED)), [name.replace(" ", "\n") for name in JUDGED])
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.1), ncols=6)
    return figure


@style.drawn_in_style()
def part_figure(chapter: Chapter) -> Figure:
    """Rms errors with one part true, by quantity."""
    figure, axes = blank((9.6, 4.2))
    by_variant = chapter.found[chapter.kind]["predictions"]["by_variant"]
    width = 0.8 / len(by_variant)
    tones = (
        style.INK,
        style.MODEL,
        style.BAND_EDGE,
        style.RESIDUAL,
        style.PARAMETER_BAND,
        style.DATA,
        style.RULE,
    )
    for place, ((name, each), tone) in enumerate(zip(by_variant.items(), tones, strict=True)):
        axes.bar(
            np.arange(len(JUDGED)) + width * (place - 0.5 * (len(by_variant) - 1)),
            [each[quantity]["rms"] for quantity in JUDGED],
            width=0.9 * width,
            color=tone,
            label=name,
        )
    finish(axes, "Rms error (%)")
    axes.set_xticks(range(len(JUDGED)), [name.replace(" ", "\n") for name in JUDGED])
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.1), ncols=4)
    return figure


def write_page(chapter: Chapter, path: Path) -> None:
    """Write figures and tables, a section for each part."""
    made = tables(chapter.found)
    run = chapter.found[chapter.kind]
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        tables=made,
        measured=chapter.kind == "measured",
        sensors=SENSORS,
        hardware=HARDWARE,
        driver_rate=DRIVER_RATE,
        added_mass=ADDED_MASS,
        decay_length=LENGTH,
        peak=PEAK,
        largest_current=LARGEST_CURRENT,
        scores={
            "best": run["tests"]["score"][BEST],
            "clipped": run["tests"]["score"][CLIPPED],
            "lyapunov": run["tests"]["score"][LYAPUNOV],
        },
        wins=run["tests"]["better_than_best_constant"],
        currents={
            name: [mean_of(run["tests"]["each"][law], quantity) for law in (CLIPPED, LYAPUNOV)]
            for name, quantity in (("mean", "mean current"), ("rest", "current at rest"))
        },
        fit=run["fit_percent"],
        other_fit=run["other"]["fit_percent"],
        comparisons=run["tests"]["comparisons"],
        table=[
            panel("gain", "Low-pass of the table", gain_figure(), "Gain of the table over the frequency"),
            panel("commands", "Commands", command_figure(chapter), "Displacement of the table over time"),
        ],
        frame=[
            panel("decay", "Free vibration", decay_figure(chapter.frame), "Decay of the bare frame"),
            panel("spectrum", "Fourier spectrum", spectrum_figure(chapter.frame), "Spectra of both decays"),
        ],
        sines=[
            panel(
                "sines",
                "Sine tests: measured points, identified line",
                sine_figure(chapter.campaign.sines, chapter.campaign.predicted_sines),
                "Response amplitude over frequency at two currents",
            ),
        ],
        damper=[
            panel(
                "loops",
                "Loops of the tests",
                loop_figure(chapter.campaign.damper),
                "Force over velocity",
            ),
            panel(
                "friction",
                "Friction",
                friction_figure(chapter.campaign.damper),
                "Friction over the current",
            ),
        ],
        histories=[
            (record, [_history(chapter.campaign.tests, law, record) for law in (CLIPPED, LYAPUNOV)])
            for record in chapter.campaign.tests[OFF]
        ],
        sweep=panel(
            "sweep",
            "Constant currents, also beyond the driver of the tests",
            score_figure(chapter),
            "Score over the constant current",
        ),
        errors=panel(
            "errors",
            "Errors of the predicted tests",
            error_figure(chapter),
            "Errors by quantity and case",
        ),
        parts=panel("parts", "Whose error it is", part_figure(chapter), "Rms errors with one part true"),
    )


def _history(tests: Tests, law: str, record: str) -> Panel:
    return panel(
        f"{law}-{record}".replace(" ", "-").lower(),
        f"{record}, {law}",
        history_figure(tests[OFF][record], tests[law][record]),
        f"Displacement, acceleration, current and force over time: {record}, {law}",
    )
