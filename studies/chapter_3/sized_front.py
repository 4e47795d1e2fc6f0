"""Size against dynamic range against power: the front of dampers that meet the wishes of the frame."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

from mrwork.dampers import design
from mrwork.report import WIDE, Table, finish, style
from studies.chapter_3.sized_frame import SUPPLY, wishes
from studies.former.page import drawn
from studies.former.table import table_of

FORCE = 8e3
"""Desired force of the dampers on the front [N]."""
# Volumes over that of the smallest damper, within which the best are told.
_WITHIN = (1.1, 1.5, 2.5, 5.0)


def front_of(*, quick: bool) -> design.SizeFront | None:
    """The front; `None` without pymoo, whose search finds it."""
    if find_spec("pymoo") is None:
        return None
    return design.size_front(
        wishes(FORCE),
        fluid=design.fluid("MRF-132DG"),
        steel=design.steel("AISI 1010"),
        population=16 if quick else 60,
        budget=600 if quick else 6000,
    )


def figures_of(front: design.SizeFront) -> dict[str, Any]:
    """The ends of the front, and what has the largest range and the least power within a volume."""
    smallest = front.designs[0]
    found = {"smallest": _numbers(smallest)}
    for share in _WITHIN:
        # A volume that was reached again by another way counts.
        limit = share * smallest.envelope_volume * (1.0 + 1e-9)
        within = [each for each in front.designs if each.envelope_volume <= limit]
        found[f"range within {share:g}"] = _numbers(max(within, key=lambda each: each.dynamic_range))
        found[f"power within {share:g}"] = _numbers(min(within, key=lambda each: each.power))
    return {"designs": len(front.designs), "candidates": front.evaluations, "chosen": found}


def _numbers(damper: design.DamperDesign) -> dict[str, float]:
    return {
        "volume_l": 1e3 * damper.envelope_volume,
        "dynamic_range": damper.dynamic_range,
        "power_w": damper.power,
        "force_kn": 1e-3 * damper.largest_force,
        "bore_mm": 1e3 * damper.bore,
        "length_mm": 1e3 * damper.chamber_length,
        "gap_mm": 1e3 * damper.gap,
        "coils": float(damper.stages),
        "response_ms": 1e3 * damper.response_time(SUPPLY),
    }


@drawn(WIDE)
def front_figure(axes: Axes, front: design.SizeFront, *, power: bool) -> None:
    """Dynamic range, or power, over the volume; the tone of a point is the other of the two."""
    volumes = [1e3 * damper.envelope_volume for damper in front.designs]
    ranges = ("Dynamic range", [damper.dynamic_range for damper in front.designs])
    watts = ("Power (W)", [damper.power for damper in front.designs])
    (title, ordinate), (other, tones) = (watts, ranges) if power else (ranges, watts)
    points = axes.scatter(volumes, ordinate, c=tones, s=14.0, cmap=style.TONES, linewidths=0)
    bar = axes.figure.colorbar(points, ax=axes, pad=0.02)
    bar.outline.set_visible(False)
    bar.set_label(other)
    finish(axes, title, "Volume (l)")
    axes.set_ylim(bottom=0.0)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(LogLocator(base=2.0))
    axes.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axes.xaxis.set_minor_locator(NullLocator())


def table(found: dict[str, Any]) -> Table:
    """A row for each chosen damper."""
    return table_of(
        f"Size against dynamic range against power, {1e-3 * FORCE:g} kN",
        "damper",
        ((_in_words(name), numbers) for name, numbers in found["chosen"].items()),
        {
            "volume [l]": "{volume_l:.3f}",
            "range": "{dynamic_range:.1f}",
            "power [W]": "{power_w:.2f}",
            "force [kN]": "{force_kn:.1f}",
            "bore [mm]": "{bore_mm:.1f}",
            "length [mm]": "{length_mm:.0f}",
            "gap [mm]": "{gap_mm:.2f}",
            "coils": "{coils:.0f}",
            "response [ms]": "{response_ms:.1f}",
        },
        note=f"{found['designs']} dampers after {found['candidates']} candidates; no other one is better in all three. "
        "Within a multiple of the smallest volume, the one with the largest range and the one with the least power.",
    )


def _in_words(name: str) -> str:
    quantity, within, share = name.partition(" within ")
    if not within:
        return name
    return f"{'largest range' if quantity == 'range' else 'least power'}, {share} times the volume"
