"""The study's page: one HTML file that needs nothing from anywhere else."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from markupsafe import Markup

from chapter_6_tables import remarks, tables
from frame_runs import LEVELS, level_name
from mrwork.report import panel, write_study_page
from score_figures import sample_time_figure, score_figure


def write_page(found: dict[str, Any], path: Path) -> None:
    """Write every table and the figures."""
    write_study_page(
        Path(__file__).parent / "chapter_6.html.j2",
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
        remarks=list(remarks(found)),
    )
