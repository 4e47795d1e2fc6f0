"""The page of the study."""

from __future__ import annotations

from pathlib import Path

from markupsafe import Markup

from mrwork.report import Panel, panel, write_study_page
from studies.chapter_7 import figures as drawn
from studies.chapter_7.controlled_tests import BEST, CLIPPED, LYAPUNOV, OFF, Tests
from studies.chapter_7.earthquakes import PEAK
from studies.chapter_7.findings import Chapter
from studies.chapter_7.frame_tests import ADDED_MASS, LENGTH
from studies.chapter_7.tables import mean_of, tables
from studies.chapter_7.virtual_rig import DRIVER_RATE, HARDWARE, LARGEST_CURRENT, SENSORS


def write_page(chapter: Chapter, path: Path) -> None:
    """Write figures and tables, a section for each part."""
    made = tables(chapter.found)
    run = chapter.found[chapter.kind]
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        tables={name: [Markup(table.html()) for table in each] for name, each in made.items()},
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
            panel(
                "gain", "Low-pass of the table", drawn.gain_figure(), "Gain of the table over the frequency"
            ),
            panel(
                "commands", "Commands", drawn.command_figure(chapter), "Displacement of the table over time"
            ),
        ],
        frame=[
            panel("decay", "Free vibration", drawn.decay_figure(chapter.frame), "Decay of the bare frame"),
            panel(
                "spectrum", "Fourier spectrum", drawn.spectrum_figure(chapter.frame), "Spectra of both decays"
            ),
        ],
        sines=[
            panel(
                "sines",
                "Sine tests: measured points, identified line",
                drawn.sine_figure(chapter.campaign.sines, chapter.campaign.predicted_sines),
                "Response amplitude over frequency at two currents",
            ),
        ],
        damper=[
            panel(
                "loops",
                "Loops of the tests",
                drawn.loop_figure(chapter.campaign.damper),
                "Force over velocity",
            ),
            panel(
                "friction",
                "Friction",
                drawn.friction_figure(chapter.campaign.damper),
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
            drawn.score_figure(chapter),
            "Score over the constant current",
        ),
        errors=panel(
            "errors",
            "Errors of the predicted tests",
            drawn.error_figure(chapter),
            "Errors by quantity and case",
        ),
        parts=panel(
            "parts", "Whose error it is", drawn.part_figure(chapter), "Rms errors with one part true"
        ),
    )


def _history(tests: Tests, law: str, record: str) -> Panel:
    return panel(
        f"{law}-{record}".replace(" ", "-").lower(),
        f"{record}, {law}",
        drawn.history_figure(tests[OFF][record], tests[law][record]),
        f"Displacement, acceleration, current and force over time: {record}, {law}",
    )
