"""The page of the study with its figures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

import mrwork as mr
from mrwork.dampers import design
from mrwork.identification import free_run
from mrwork.report import SMALL, WIDE, Panel, cross_section_figure, finish, style
from studies.chapter_3.findings import Chapter
from studies.chapter_3.fluid_properties import FIELD
from studies.chapter_3.models_on_one_test import MODELS, SHOWN_TEST
from studies.chapter_3.sized_frame import SizedFrame
from studies.chapter_3.sized_front import front_figure
from studies.chapter_3.slot_flow import STRESSES, errors
from studies.chapter_3.tables import tables
from studies.former.arrays import Floats
from studies.former.page import TONES, drawn, panels, tested_points, write_chapter_page

_CURRENTS = (0.0, 0.25, 0.5, 1.0, 1.5)
_AXES = ("time", "displacement", "velocity")


@drawn(WIDE)
def fluid_figure(axes: Axes, *, flux: bool) -> None:
    """Yield stress, or flux density, of the named fluids over the field."""
    field = np.linspace(0.0, 300e3, 121)
    for fluid, tone in zip(design.FLUIDS, TONES, strict=False):
        drawn = fluid.flux_density(field) if flux else 1e-3 * fluid.yield_stress(field)
        axes.plot(1e-3 * field, drawn, color=tone, label=fluid.name)
    axes.axvline(1e-3 * FIELD, color=style.RULE, linewidth=0.8, zorder=0.9)
    axes.set_ylim(bottom=0.0)
    axes.legend(loc="lower right")
    finish(axes, "Flux density (T)" if flux else "Yield stress (kPa)", "Field (kA/m)")


@drawn(WIDE)
def error_figure(axes: Axes, *, sums: bool) -> None:
    """Errors of the approximations that are sums, or of plates, over the dimensionless yield stress."""
    chosen = {name: each for name, each in errors().items() if name.startswith("sum") == sums}
    for (name, each), tone in zip(chosen.items(), TONES, strict=False):
        axes.plot(STRESSES, 100.0 * each, color=tone, label=name)
    finish(axes, "Error of the pressure drop (%)", "Dimensionless yield stress T")
    axes.set_xscale("log")
    axes.axhline(0.0, color=style.FAINT_INK, linewidth=0.6, zorder=0.9)
    axes.legend(loc="upper left" if sums else "upper right")


@drawn(WIDE)
def force_velocity_figure(axes: Axes) -> None:
    """Forces of the damper of 20 tons over the velocity, at several currents."""
    damper = design.twenty_ton_damper()
    velocity = np.linspace(1e-5, 0.15, 61)
    for current in _CURRENTS:
        force = 1e-3 * damper.force(velocity, current)
        axes.plot(100.0 * velocity, force, color=style.MODEL)
        axes.annotate(
            f"{current:g} A",
            (100.0 * velocity[-1], force[-1]),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=style.SMALL_TEXT_SIZE,
        )
    axes.axvline(100.0 * damper.velocity, color=style.RULE, linewidth=0.8, zorder=0.9)
    axes.set_xlim(0.0, 16.8)
    axes.set_ylim(bottom=0.0)
    finish(axes, "Force (kN)", "Velocity (cm/s)")


@drawn(WIDE)
def score_figure(axes: Axes, found: SizedFrame) -> None:
    """Score over the constant current of each damper, with its clipped-optimal control as a dashed line."""
    for (name, each), tone in zip(found.loop.items(), (style.DATA, *TONES), strict=False):
        axes.plot(each["currents"], each["scores"], color=tone, label=name)
        axes.axhline(each["clipped"]["score"], color=tone, linestyle=style.DASHED, linewidth=0.9)
    axes.legend(loc="upper right")
    finish(axes, "Score over that of the pair at i = 0", "Constant current (A)")


@drawn(SMALL)
def fit_figure(axes: Axes, fit: mr.Fit, test: mr.DamperTest, over: str) -> None:
    """Force of one cycle over time, displacement or velocity: points of the test, line of the model."""
    force, _ = free_run(fit.spec, np.array(fit.theta), test)
    period = round(1.0 / (test.frequency * test.dt))
    cycle = slice(test.n_time - 2 * period - 1, test.n_time - period)
    time = test.dt * np.arange(test.n_time)
    abscissa: Floats = {
        "time": time - time[cycle.start],
        "displacement": 1e3 * test.displacement,
        "velocity": 1e3 * test.velocity,
    }[over]
    tested_points(axes, abscissa, test.force, cycle)
    axes.plot(abscissa[cycle], force[cycle], color=style.MODEL, linewidth=1.1)
    axes.margins(y=0.12)
    names = {"time": "Time (s)", "displacement": "Displacement (mm)", "velocity": "Velocity (mm/s)"}
    finish(axes, "Force (N)", names[over])


def write_page(chapter: Chapter, path: Path) -> None:
    """Write figures and tables, a section for each part."""
    test = mr.synthetic_test(SHOWN_TEST)
    (published,) = _sections("twenty-tons", {"Damper of 20 tons": design.twenty_ton_damper()})
    force, scores = panels(
        "forces",
        (
            ("Damper of 20 tons", force_velocity_figure(), "Force over velocity at several currents"),
            (
                "Constant currents, and clipped-optimal control (dashed)",
                score_figure(chapter.frame),
                "Score of each damper over its constant current",
            ),
        ),
    )
    write_chapter_page(
        Path(__file__).parent,
        path,
        skipped=chapter.found["skipped"],
        tables=tables(chapter.found),
        fluids=panels(
            "fluids",
            (
                (title, fluid_figure(flux=flux), f"{title} of the fluids over the field")
                for title, flux in (("Yield stress", False), ("Flux density", True))
            ),
        ),
        flow=panels(
            "flow",
            (
                (title, error_figure(sums=sums), f"{title}: error over the yield stress")
                for title, sums in (("Sum formulas", True), ("Parallel plates", False))
            ),
        ),
        force=force,
        front=panels(
            "front",
            (
                (title, front_figure(chapter.front, power=power), f"{title} over the volume")
                for title, power in (("Dynamic range", False), ("Power", True))
                if chapter.front is not None
            ),
        ),
        scores=scores,
        published=published,
        sized=_sections("sized", chapter.frame.designs),
        models=[
            {
                "name": MODELS[model],
                "fit": fit,
                "panels": panels(
                    model,
                    (
                        (
                            over,
                            fit_figure(fit, test, over),
                            f"Force over {over}, test and {MODELS[model]} model",
                        )
                        for over in _AXES
                    ),
                ),
            }
            for model, fit in chapter.fits[SHOWN_TEST].items()
        ],
    )


def _sections(anchor: str, designs: dict[str, design.DamperDesign]) -> list[Panel]:
    return panels(
        anchor,
        (
            (title, cross_section_figure(damper), f"Cross-section to scale: {title}")
            for title, damper in designs.items()
        ),
    )
