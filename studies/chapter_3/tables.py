"""Every table of the study."""

from __future__ import annotations

from typing import Any

from mrwork.closed_loop import SCORE
from mrwork.report import Table
from studies.chapter_3 import fluid_properties, models_on_one_test, published_damper, sized_front, slot_flow
from studies.former.frame import RECORDS
from studies.former.table import Cell, alike, table_of

# Keys of the frame in the findings: the quick form sizes one damper, under one motion.
FRAME_KEYS = ("sized", "quick_sized")


def tables(found: dict[str, Any]) -> dict[str, tuple[Table, ...]]:
    """Tables by the section that they belong to."""
    frame = next(found[key] for key in FRAME_KEYS if key in found)
    return {
        "fluids": fluid_properties.tables(found["fluids"]),
        "flow": slot_flow.tables(found["flow"]),
        "published": published_damper.tables(found["twenty_tons"]),
        "sized": (_size_table(frame["sizes"]),),
        "front": (sized_front.table(frame["front"]),) if "front" in frame else (),
        "loop": (*(_loop_table(frame["loop"], way) for way in _WAYS), *_record_tables(frame["loop"])),
        "models": (models_on_one_test.table(found["models"]),),
    }


_DEMAND: dict[str, Cell] = {"force [kN]": "{force_kn:.2f}", "stroke [mm]": "{stroke_mm:.1f}"}
_WAYS = {"constant": "Best constant current", "clipped": "Clipped-optimal control"}


def _size_table(sizes: dict[str, Any]) -> Table:
    return table_of(
        "Dampers sized for the frame",
        "damper",
        sizes,
        {
            "force [kN]": "{force_kn:.1f}",
            "range": "{dynamic_range:.1f}",
            "diameter [mm]": "{outer_diameter_mm:.0f}",
            "length [mm]": "{length_mm:.0f}",
            "volume [l]": "{volume_l:.3f}",
            "fluid [kg]": "{fluid_kg:.2f}",
            "current [A]": "{largest_current_a:.2f}",
            "power [W]": "{power_w:.1f}",
            "response [ms]": "{response_ms:.1f}",
            "model, nrmse [%]": lambda size: f"{100.0 * size['model_nrmse']:.1f}",
        },
        note="MRF-132DG, AISI 1010. Force and range at 0.1 m/s; response is the time to 63 % of the current with 24 V; "
        "the last column is the rms difference of the Bingham model with current laws to the forces of the design.",
    )


def _loop_table(loop: dict[str, Any], way: str) -> Table:
    return table_of(
        f"{_WAYS[way]}, five-storey frame at 0.3 g",
        "damper",
        {name: ways[way] for name, ways in loop.items()},
        {
            "current [A]": "{current_a:.2f}",
            "score, choosing": "{score:.3f}",
            "score, judging": "{judged:.3f}",
            **alike(".3f", {name.replace("_", " "): name for name in SCORE}),
            **_DEMAND,
        },
        note="Ratios to the pair of RD-1005-3 at i = 0. Current, and weight of the control, are chosen on two "
        "synthetic motions; the columns from the second score on are of two others.",
    )


def _record_tables(loop: dict[str, Any]) -> tuple[Table, ...]:
    """The same under the records; no table where these are absent."""
    rows = [
        (name, {"current": text, **ways[way]["records"]})
        for way, text in (("constant", "constant"), ("clipped", "clipped-optimal"))
        for name, ways in loop.items()
        if "records" in ways[way]
    ]
    if not rows:
        return ()
    table = table_of(
        "Measured records at 0.3 g",
        "damper",
        rows,
        {
            "current": "{current}",
            **alike(".3f", {"score": "judged", **{record: record for record, _ in RECORDS}}),
            **_DEMAND,
        },
        note="Laws and currents that the synthetic motions chose, on the four records of chapter 6, which chose "
        "nothing. Ratios to the pair of RD-1005-3 at i = 0: the score, and its mean over the criteria by record.",
    )
    return (table,)
