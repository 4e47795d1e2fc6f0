"""What the study finds: the parts that the page draws, and every figure as nested dictionaries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mrwork as mr
from mrwork.dampers import design
from studies.chapter_3 import fluid_properties, models_on_one_test, published_damper, sized_front, slot_flow
from studies.chapter_3.sized_frame import SizedFrame, sized_frame
from studies.former.command import Work
from studies.former.records import absent, ground_motions


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """Sized dampers and fits, and every figure of the study."""

    frame: SizedFrame
    front: design.SizeFront | None
    fits: dict[str, dict[str, mr.Fit]]
    found: dict[str, Any]


def chapter_of(work: Work) -> Chapter:
    """Work everything out; the quick form has one sized damper and three models."""
    work.say("fluids, flow, damper of 20 tons")
    properties = fluid_properties.properties()
    found: dict[str, Any] = {
        "fluids": {"properties": properties, "within": fluid_properties.within(properties)},
        "flow": {
            "largest_errors": slot_flow.largest_errors(),
            "closed_forms": slot_flow.closed_forms(),
            "order_in_the_gap": slot_flow.order_in_the_gap(),
        },
        "twenty_tons": {
            "predicted": published_damper.predicted(),
            "deviations": published_damper.deviations(),
        },
    }
    frame = sized_frame(work)
    work.say("front of sizes")
    front = sized_front.front_of(quick=work.quick)
    fits = models_on_one_test.identified(work)
    sized = found["quick_sized" if work.quick else "sized"] = {"sizes": frame.sizes, "loop": frame.loop}
    if front is not None:
        sized["front"] = sized_front.figures_of(front)
    found["models"] = models_on_one_test.figures_of(fits)
    found["skipped"] = absent("Skipped: the records are", ground_motions())
    return Chapter(frame=frame, front=front, fits=fits, found=found)
