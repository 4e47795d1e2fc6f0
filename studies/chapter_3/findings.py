"""What the study finds: the parts that the page draws, and every figure as nested dictionaries."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mrwork as mr
from mrwork.dampers import design
from studies.chapter_3 import fluid_properties, models_on_one_test, published_damper, sized_front, slot_flow
from studies.chapter_3.sized_frame import SizedFrame, sized_frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """Sized dampers and fits, and every figure of the study."""

    frame: SizedFrame
    front: design.SizeFront | None
    fits: dict[str, dict[str, mr.Fit]]
    found: dict[str, Any]


def chapter_of(*, records: Path | None, quick: bool, threads: int, say: Callable[[str], None]) -> Chapter:
    """Work everything out; the quick form has one sized damper and three models.

    `records` is the folder of the ground motions of chapter 6, `None` where there is none.
    """
    say("fluids, flow, damper of 20 tons")
    properties = fluid_properties.properties()
    damper = {"predicted": published_damper.predicted(), "deviations": published_damper.deviations()}
    flow = {
        "largest_errors": slot_flow.largest_errors(),
        "closed_forms": slot_flow.closed_forms(),
        "order_in_the_gap": slot_flow.order_in_the_gap(),
    }
    frame = sized_frame(records=records, quick=quick, threads=threads, say=say)
    say("front of sizes")
    front = sized_front.front_of(quick=quick)
    fits = models_on_one_test.identified(quick=quick, threads=threads, say=say)
    sized: dict[str, Any] = {"sizes": frame.sizes, "loop": frame.loop}
    if front is not None:
        sized["front"] = sized_front.figures_of(front)
    found = {
        "fluids": {"properties": properties, "within": fluid_properties.within(properties)},
        "flow": flow,
        "twenty_tons": damper,
        "quick_sized" if quick else "sized": sized,
        "models": models_on_one_test.figures_of(fits),
    }
    return Chapter(frame=frame, front=front, fits=fits, found=found)
