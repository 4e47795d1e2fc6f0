"""The study's page: one HTML file that needs nothing from anywhere else."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from mrwork.report import Panel, panel, response_sheet_figure, style, swatch, write_study_page
from studies.chapter_6.direct_laws import CONSTANT, LYAPUNOV, SHOWN
from studies.chapter_6.response_sheets import sheets_at
from studies.chapter_6.score_figures import sample_time_figure, score_figure
from studies.chapter_6.tables import remarks, tables, title_of
from studies.chapter_6.thesis_tables import thesis_tables
from studies.common.frame import FRAME, LEVELS, Bench, bench, level_name, record_title

_FORM_OF = {law: "6.3 to 6.6" if law == LYAPUNOV else "6.7 to 6.10" for law in SHOWN}


def write_page(found: dict[str, Any], path: Path, *, levels: Sequence[str], records: Path) -> None:
    """Write every table and the figures; sheets and tables of every floor at these levels."""
    over = bench(records)
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        about="After M. T. Nguyen, Modelling and Control of Smart Structures Embedded with Magnetorheological "
        "Dampers, University of Technology, Sydney, 2009, chapter 6. Its text was not at hand: storey stiffness and "
        "damping of the frame and the score are ours.",
        scores=panel(
            "scores",
            "Scores, settings tuned at each level",
            score_figure(found["five_storeys"]),
            "Score of every law at both levels, beside the best constant current",
        ),
        times=[
            panel(
                f"times-{place}",
                f"Sample time, {level_name(level)}",
                sample_time_figure(found["conditions"], level),
                f"Score of six laws over the sample time at {level_name(level)}",
            )
            for place, level in enumerate(LEVELS)
        ],
        tables=[Markup(table.html()) for table in tables(found)],
        sheets=[
            {"level": name, "panels": _sheets(over, level, found["five_storeys"][CONSTANT][name]["current"])}
            for level, name in enumerate(map(level_name, LEVELS))
            if name in levels
        ],
        key={"controlled": swatch(style.MODEL, "line"), "without": swatch(style.INK, "dotted")},
        thesis={
            name: [Markup(table.html()) for table in each]
            for name, each in thesis_tables(found, levels).items()
        },
        draws=found["identified"]["draws"],
        offset={name: found["identified"]["parameters"][name]["truth"] for name in ("f0.0", "f0.1")},
        remarks=list(remarks(found)),
    )


def _sheets(over: Bench, level: int, constant: float) -> list[Panel]:
    """A sheet for each record and each law, side by side."""
    return [
        panel(
            f"sheet-{level}-{sheet.label}-{sheet.record}",
            f"{record_title(sheet.record)}: {title_of(sheet.label)}",
            response_sheet_figure(sheet.controlled, sheet.reference, FRAME),
            f"Ground, current, force, Lyapunov function and motion of floor 1 under {record_title(sheet.record)} at "
            f"{level_name(LEVELS[level])}: {title_of(sheet.label)}, and without control",
            note=f"In the form of figures {_FORM_OF[sheet.label]}.",
        )
        for sheet in sheets_at(over, level, constant)
        if sheet.label in SHOWN
    ]
