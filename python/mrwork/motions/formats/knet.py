"""K-NET and KiK-net records in ASCII: 17 header lines, then counts of the recorder.

Acceleration in gal is a count times the scale factor of line 14, such as ``3920(gal)/6182761``, plus an offset
of the recorder; the published peak refers to the mean (National Research Institute for Earth Science and
Disaster Resilience, "About K-NET ASCII format").
"""

from __future__ import annotations

import re

import numpy as np

from mrwork.errors import RecordError
from mrwork.motions.formats.format import Format, Lines, Stated, read_numbers, recorded, shown
from mrwork.motions.ground_motion import GroundMotion
from mrwork.units import FACTORS

_LONGEST_HEADER = 20
_LABEL = 18
_NUMBER = r"([0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?)"
_RATE = re.compile(rf"{_NUMBER}\s*Hz", re.IGNORECASE)
_DURATION = re.compile(_NUMBER)
_SCALE = re.compile(rf"{_NUMBER}\s*\(gal\)\s*/\s*{_NUMBER}", re.IGNORECASE)


def _recognises(lines: Lines) -> bool:
    return lines.at(0).startswith("Origin Time") and any(
        lines.at(index).startswith("Scale Factor") for index in range(_LONGEST_HEADER)
    )


def _read(lines: Lines, stated: Stated) -> GroundMotion:
    rate = float(_field(lines, "Sampling Freq", _RATE, "100Hz")[1])
    duration = float(_field(lines, "Duration Time", _DURATION, "108")[1])
    scale = _field(lines, "Scale Factor", _SCALE, "3920(gal)/6182761")
    if rate <= 0.0 or float(scale[2]) <= 0.0:
        raise RecordError(f"{lines.path}: sampling frequency or scale factor is zero; the header is damaged")
    counts = read_numbers(lines, _line(lines, "Memo") + 1)
    announced = duration * rate
    if not abs(counts.size - announced) < 0.5:
        raise RecordError(
            f"{lines.path}: the header announces {announced:g} samples ({duration:g} s at {rate:g} Hz), {counts.size} "
            "follow; the file is cut off or damaged, fetch it again"
        )
    acceleration = FACTORS["acceleration"]["gal"] * float(scale[1]) / float(scale[2]) * counts
    mean = float(np.mean(acceleration)) if acceleration.size else 0.0
    station, origin, direction = (
        lines.at(_line(lines, label))[_LABEL:].strip() for label in ("Station Code", "Origin Time", "Dir.")
    )
    return recorded(
        lines.path,
        # The extension states the direction of the record.
        name=lines.path.name.replace(".", "_"),
        dt=1.0 / rate,
        acceleration=acceleration - mean,
        source=f"K-NET or KiK-net, {origin}, station {station}, {direction}",
        changes=(f"mean of {mean:.4g} m/s2 taken out, the offset of the recorder",),
    )


def _line(lines: Lines, label: str) -> int:
    for index in range(_LONGEST_HEADER):
        if lines.at(index).startswith(label):
            return index
    raise RecordError(
        f"{lines.path}: the header of this K-NET record has no line '{label}'; fetch the file again"
    )


def _field(lines: Lines, label: str, pattern: re.Pattern[str], example: str) -> re.Match[str]:
    index = _line(lines, label)
    text = lines.at(index)[_LABEL:]
    match = pattern.search(text)
    if match is None:
        raise RecordError(
            f"{lines.where(index)}: expected '{label}' such as '{example}', found '{shown(text)}'; the header "
            "of this K-NET record is damaged"
        )
    return match


K_NET = Format(name="a K-NET record", recognises=_recognises, read=_read)
