"""The page of the study with its figures."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from mrwork.report import WIDE, finish, style
from studies.chapter_7.controlled_tests import BEST, CLIPPED, LYAPUNOV, OFF, Tests
from studies.chapter_7.earthquakes import LEAD, PEAK
from studies.chapter_7.findings import Chapter
from studies.chapter_7.frame_tests import ADDED_MASS, LENGTH, IdentifiedFrame, spectrum
from studies.chapter_7.predictions import JUDGED
from studies.chapter_7.rig_damper import IdentifiedDamper
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
from studies.former.page import TONES, drawn, panels, write_chapter_page

_PART_TONES = (
    *(style.INK, style.MODEL, style.BAND_EDGE, style.RESIDUAL),
    *(style.PARAMETER_BAND, style.DATA, style.RULE),
)
# What is shown of a test [s], and every how many samples: 250 Hz are enough for a frame of 3 Hz.
_SHOWN, _EVERY = (0.0, 20.0), 4


@drawn(WIDE)
def gain_figure(axes: Axes) -> None:
    """Gain of the table over the frequency."""
    frequency = np.geomspace(0.5, 100.0, 201)
    axes.semilogx(frequency, np.abs(TABLE.gain(frequency)), color=style.MODEL)
    axes.axvline(TABLE.bandwidth, color=style.RULE, linewidth=0.8, zorder=0.9)
    axes.set_ylim(0.0, 1.1)
    finish(axes, "Gain of the table", "Frequency (Hz)")
    axes.set_xticks([1.0, 3.0, 10.0, 30.0, 100.0], ["1", "3", "10", "30", "100"])
    axes.minorticks_off()


@drawn(WIDE)
def command_figure(axes: Axes, chapter: Chapter) -> None:
    """Displacement of the table in every test, over time, with the stroke."""
    for motion, tone in zip(chapter.motions, TONES, strict=False):
        every = max(1, round(0.02 / motion.dt))
        axes.plot(
            motion.time[::every] - LEAD, 1e3 * motion.displacement[::every], color=tone, label=motion.name
        )
    for side in (-1e3, 1e3):
        axes.axhline(side * TABLE.stroke, color=style.FAINT_INK, linestyle=style.DASHED, linewidth=0.8)
    axes.set_ylim(-1.25e3 * TABLE.stroke, 1.6e3 * TABLE.stroke)
    axes.legend(loc="upper right", ncols=2)
    finish(axes, "Displacement of the table (mm); dashed: stroke", "Time (s)")


@drawn(WIDE)
def decay_figure(axes: Axes, found: IdentifiedFrame) -> None:
    """The decay of the bare frame, with the envelope of the decrement."""
    record, estimate = found.bare.record, found.bare.decrement
    time = record.time - record.time[0]
    axes.plot(time[::10], 1e3 * record.displacement[::10], color=style.DATA, linewidth=0.8)
    first = 1e3 * np.abs(record.displacement[: round(1.0 / estimate.frequency / record.step)]).max()
    for side in (-1.0, 1.0):
        axes.plot(time, side * first * np.exp(-estimate.decay * time), color=style.MODEL, linewidth=1.1)
    finish(axes, "Displacement (mm); lines: envelope of the decrement", "Time (s)")


@drawn(WIDE)
def spectrum_figure(axes: Axes, found: IdentifiedFrame) -> None:
    """Fourier spectra of both decays."""
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


@drawn(WIDE)
def sine_figure(axes: Axes, measured: list[SineTest], predicted: list[SineTest]) -> None:
    """Response amplitudes over the frequency: measured points, lines of the identified rig."""
    for current, tone in zip(SWEEP_CURRENTS, TONES, strict=False):
        for tests, marks in (
            (predicted, {"label": f"{current:g} A"}),
            (measured, {"marker": "o", "linestyle": "", "markersize": 5.0, "markeredgewidth": 0.0}),
        ):
            alike = [test for test in tests if test.wanted.current == current]
            axes.plot(
                [test.wanted.frequency for test in alike],
                [1e3 * test.displacement for test in alike],
                color=tone,
                **marks,
            )
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="upper right")
    finish(axes, "Amplitude of the displacement (mm)", "Frequency of the table (Hz)")


@drawn(WIDE)
def loop_figure(axes: Axes, found: IdentifiedDamper) -> None:
    """Force over velocity of the tests at 3 Hz, as the load cell has it."""
    shown = [test for test in found.tests if test.frequency == 3.0]
    tones = dict(zip(sorted({test.command_in_words for test in shown}), TONES, strict=False))
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


@drawn(WIDE)
def friction_figure(axes: Axes, found: IdentifiedDamper) -> None:
    """Height of the hysteresis over the current, identified and true."""
    currents = np.linspace(0.0, LARGEST_CURRENT, 51)
    names = found.fit.spec.names
    for theta, tone, line, label in (
        (rd_1005_3().draws[0], style.DATA, "solid", "true"),
        (np.array(found.fit.theta), style.MODEL, style.DASHED, "identified"),
    ):
        alpha = [theta[names.index(f"alpha.{power}")] for power in range(3)]
        height = np.polynomial.polynomial.polyval(currents, alpha)
        axes.plot(currents, height, color=tone, linestyle=line, label=label)
    axes.legend(loc="upper left", bbox_to_anchor=(0.03, 1.0))
    finish(axes, "Height of the hysteresis, alpha (N)", "Current (A)")


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
        off, on = (factor * getattr(signals, name)[::_EVERY] for signals in (without, controlled))
        axes.plot(time, off, color=style.RESIDUAL, linestyle=style.DOTTED, linewidth=1.0)
        axes.plot(time, on, color=style.MODEL, linewidth=1.2)
        finish(axes, title)
    rows[2].plot(time, controlled.current[::_EVERY], color=style.INK, linewidth=0.8)
    rows[2].set_ylim(-0.1 * LARGEST_CURRENT, 1.15 * LARGEST_CURRENT)
    finish(rows[2], "Current (A)")
    rows[2].set_yticks([0.0, LARGEST_CURRENT])
    rows[3].plot(time, controlled.force[::_EVERY], color=style.INK, linewidth=0.8)
    finish(rows[3], "Force (N)", "Time (s)")
    rows[3].set_xlim(time[0], time[-1])
    return figure


@drawn(WIDE)
def score_figure(axes: Axes, chapter: Chapter) -> None:
    """Score of constant currents on the rig, beyond the driver of the tests, with both laws as dashed lines."""
    axes.plot(chapter.sweep["currents"], chapter.sweep["scores"], "o-", color=style.INK, markersize=4.0)
    scores = chapter.found[chapter.kind]["tests"]["score"]
    for law, tone, line in ((CLIPPED, style.MODEL, style.DASHED), (LYAPUNOV, style.RESIDUAL, style.DOTTED)):
        axes.axhline(scores[law], color=tone, linestyle=line, linewidth=1.2, label=law)
    axes.axvline(LARGEST_CURRENT, color=style.RULE, linewidth=0.8, zorder=0.9)
    axes.set_ylim(0.0, 1.05)
    axes.legend(loc="upper right")
    finish(axes, "Score over i = 0", "Constant current (A)")


@drawn((9.6, 4.2))
def error_figure(axes: Axes, chapter: Chapter) -> None:
    """Errors of the full prediction: a point for each case and record, by quantity."""
    each = chapter.found[chapter.kind]["predictions"]["each"]
    for place, (case, tone) in enumerate(zip(each, TONES, strict=False)):
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
    _name_quantities(axes, columns=6)


@drawn((9.6, 4.2))
def part_figure(axes: Axes, chapter: Chapter) -> None:
    """Rms errors with one part true, by quantity."""
    by_variant = chapter.found[chapter.kind]["predictions"]["by_variant"]
    width = 0.8 / len(by_variant)
    for place, (name, errors) in enumerate(by_variant.items()):
        axes.bar(
            np.arange(len(JUDGED)) + width * (place - 0.5 * (len(by_variant) - 1)),
            [errors[quantity]["rms"] for quantity in JUDGED],
            width=0.9 * width,
            color=_PART_TONES[place],
            label=name,
        )
    finish(axes, "Rms error (%)")
    _name_quantities(axes, columns=4)


def _name_quantities(axes: Axes, *, columns: int) -> None:
    """Judged quantities along the abscissa, and a legend of so many columns above the axes."""
    axes.set_xticks(range(len(JUDGED)), [name.replace(" ", "\n") for name in JUDGED])
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.1), ncols=columns)


def write_page(chapter: Chapter, path: Path) -> None:
    """Write figures and tables, a section for each part."""
    campaign = chapter.campaign
    gain, commands, decay, spectra, sines, loops, friction, sweep, errors, parts = panels(
        "figure",
        (
            ("Low-pass of the table", gain_figure(), "Gain of the table over the frequency"),
            ("Commands", command_figure(chapter), "Displacement of the table over time"),
            ("Free vibration", decay_figure(chapter.frame), "Decay of the bare frame"),
            ("Fourier spectrum", spectrum_figure(chapter.frame), "Spectra of both decays"),
            (
                "Sine tests: measured points, identified line",
                sine_figure(campaign.sines, campaign.predicted_sines),
                "Response amplitude over frequency at two currents",
            ),
            ("Loops of the tests", loop_figure(campaign.damper), "Force over velocity"),
            ("Friction", friction_figure(campaign.damper), "Friction over the current"),
            (
                "Constant currents, also beyond the driver of the tests",
                score_figure(chapter),
                "Score over the constant current",
            ),
            ("Errors of the predicted tests", error_figure(chapter), "Errors by quantity and case"),
            ("Whose error it is", part_figure(chapter), "Rms errors with one part true"),
        ),
    )
    write_chapter_page(
        Path(__file__).parent,
        path,
        tables=tables(chapter.found),
        measured=chapter.kind == "measured",
        sensors=SENSORS,
        hardware=HARDWARE,
        driver_rate=DRIVER_RATE,
        added_mass=ADDED_MASS,
        decay_length=LENGTH,
        peak=PEAK,
        largest_current=LARGEST_CURRENT,
        laws={"best": BEST, "clipped": CLIPPED, "lyapunov": LYAPUNOV},
        run=chapter.found[chapter.kind],
        mean_of=mean_of,
        table=[gain, commands],
        frame=[decay, spectra],
        damper=[sines, loops, friction],
        histories=[
            (record, panels(f"history-{place}", _histories(campaign.tests, record)))
            for place, record in enumerate(campaign.tests[OFF])
        ],
        sweep=sweep,
        errors=errors,
        parts=parts,
    )


def _histories(tests: Tests, record: str) -> Iterator[tuple[str, Figure, str]]:
    for law in (CLIPPED, LYAPUNOV):
        figure = history_figure(tests[OFF][record], tests[law][record])
        title = f"{record}, {law}"
        yield title, figure, f"Displacement, acceleration, current and force over time: {title}"
