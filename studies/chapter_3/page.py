"""The page of the study."""

from __future__ import annotations

from pathlib import Path

from markupsafe import Markup
from matplotlib.figure import Figure

import mrwork as mr
from mrwork.dampers import design
from mrwork.report import Panel, cross_section_figure, panel, write_study_page
from studies.chapter_3.figures import (
    error_figure,
    fit_figures,
    fluid_figure,
    force_velocity_figure,
    score_figure,
)
from studies.chapter_3.findings import Chapter
from studies.chapter_3.models_on_one_test import MODELS, SHOWN_TEST
from studies.chapter_3.sized_front import front_figure
from studies.chapter_3.tables import tables


def write_page(chapter: Chapter, path: Path, *, skipped: str = "") -> None:
    """Write figures and tables, a section for each part."""
    made = tables(chapter.found)
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        skipped=skipped,
        tables={name: [Markup(table.html()) for table in each] for name, each in made.items()},
        fluids=[
            panel(f"fluids-{name}", title, fluid_figure(flux=flux), f"{title} of the fluids over the field")
            for name, title, flux in (("stress", "Yield stress", False), ("flux", "Flux density", True))
        ],
        flow=[
            panel(f"flow-{name}", title, error_figure(sums=sums), f"{title}: error over the yield stress")
            for name, title, sums in (("sums", "Sum formulas", True), ("plates", "Parallel plates", False))
        ],
        force=panel(
            "force-velocity",
            "Damper of 20 tons",
            force_velocity_figure(),
            "Force over velocity at several currents",
        ),
        front=[]
        if chapter.front is None
        else [
            panel(
                f"front-{name}", title, front_figure(chapter.front, power=power), f"{title} over the volume"
            )
            for name, title, power in (("range", "Dynamic range", False), ("power", "Power", True))
        ],
        scores=panel(
            "scores",
            "Constant currents, and clipped-optimal control (dashed)",
            score_figure(chapter.frame),
            "Score of each damper over its constant current",
        ),
        published=_section("twenty-tons", "Damper of 20 tons", design.twenty_ton_damper()),
        sized=[
            _section(f"sized-{place}", name, damper)
            for place, (name, damper) in enumerate(chapter.frame.designs.items())
        ],
        models=[
            {"name": MODELS[model], "fit": fit, "panels": _fit_panels(model, fit)}
            for model, fit in chapter.fits[SHOWN_TEST].items()
        ],
    )


def _section(anchor: str, title: str, damper: design.DamperDesign) -> Panel:
    figure: Figure = cross_section_figure(damper)
    return panel(anchor, title, figure, f"Cross-section to scale: {title}")


def _fit_panels(model: str, fit: mr.Fit) -> list[Panel]:
    test = mr.synthetic_test(SHOWN_TEST)
    return [
        panel(f"{model}-{over}", over, figure, f"Force over {over}, test and {MODELS[model]} model")
        for over, figure in fit_figures(fit, test)
    ]
