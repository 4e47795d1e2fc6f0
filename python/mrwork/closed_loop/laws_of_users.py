"""Laws of users in the loop: what the core has in their place, and their tape, or why there is none."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.base.recording import NotRecordedError
from mrwork.base.remark import ONCE, Remark, RemarkKind
from mrwork.base.values import Floats
from mrwork.buildings.device import Device
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.process_law import ProcessLaw
from mrwork.closed_loop.recorded_law import LoopShape, RecordedLaw
from mrwork.closed_loop.rows_law import RowsLaw
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw
from mrwork.errors import SettingError

IN_PYTHON = RemarkKind(
    "law_in_python",
    "{0} is called in Python at every control sample, on one thread and ten to twenty times as slow as a law that is "
    "recorded: {1}",
    verbs=ONCE,
)


def law_in_loop(
    law: ControlLaw | UserLaw | ProcessLaw, driven: Sequence[Device], n_states: int
) -> tuple[RowsLaw | ProcessLaw | None, ControlLaw]:
    """A law of the user, if it is one, and the law that the core has in its place."""
    if isinstance(law, ProcessLaw):
        return law, law.placeholder(driven)
    if isinstance(law, UserLaw):
        return RowsLaw(formula=law.formula, settings=np.zeros((law.n_candidates, 0))), law.placeholder(driven)
    if law.spec.own is None:
        return None, law
    settings = law.gain_rows(len(driven), n_states)
    placeholder = ControlLaw(
        name="passive",
        gains={"command": np.zeros((len(settings), len(driven)))},
        dead_zone=law.dead_zone,
        command_slope=law.command_slope,
    )
    return RowsLaw(formula=law.spec.own, settings=settings), placeholder


def loop_shape(building: Building, driven: Sequence[Device], hardware: Hardware) -> LoopShape:
    """What a law of the user is recorded for."""
    n, n_devices = building.n_coordinates, len(driven)
    return LoopShape(
        lengths={
            "displacement": n,
            "velocity": n,
            "deformation": n_devices,
            "rate": n_devices,
            "force": n_devices,
            "acceleration": len(building.floors),
            "ground_acceleration": None,
            "ground_velocity": None,
            "drift": len(hardware.measured_storeys),
        },
        largest=tuple(float(device.largest_command) for device in driven),
        sample_time=hardware.sample_time,
    )


def recorded_for(
    user: RowsLaw | ProcessLaw | None, shape: LoopShape
) -> tuple[RecordedLaw | None, Floats, str]:
    """A law of the user on a tape with settings, shape (n_candidates, n_settings), or the reason why there is none.

    Raises
    ------
    SettingError
        If it cannot be recorded and must be.
    """
    none = np.zeros((0, 0))
    if not isinstance(user, RowsLaw) or user.formula.record is False:
        return None, none, ""
    try:
        recorded, settings = user.recorded(shape)
    except NotRecordedError as reason:
        if user.formula.record:
            raise SettingError(f"{user.formula.name} cannot be recorded: {reason}") from None
        return None, none, str(reason)
    return recorded, settings, ""


def remark_on_python(
    law: ControlLaw | UserLaw | ProcessLaw, building: Building, driven: Sequence[Device], hardware: Hardware
) -> Remark | None:
    """Why a law is called in Python at every sample; `None` where it is not, or must be."""
    user, _ = law_in_loop(law, driven, 2 * building.n_coordinates)
    if not isinstance(user, RowsLaw) or user.formula.record is not None:
        return None
    _, _, reason = recorded_for(user, loop_shape(building, driven, hardware))
    return IN_PYTHON.remark(user.formula.name, reason) if reason else None
