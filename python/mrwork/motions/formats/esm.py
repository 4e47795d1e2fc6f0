"""Records of the European Engineering Strong Motion database (ESM) and of ITACA: DYNA 1.x ASCII.

About 64 lines ``KEY: value``, then one acceleration per line, in the unit stated by the header.
"""

from __future__ import annotations

import re

from mrwork.errors import RecordError
from mrwork.motions.formats.format import Format, Lines, Stated, read_numbers, recorded, shown
from mrwork.motions.ground_motion import GroundMotion
from mrwork.units import factor_to_si

_KEY = re.compile(r"([A-Z][A-Z0-9_/^]*):\s*(.*?)\s*")


def _recognises(lines: Lines) -> bool:
    return lines.at(0).startswith("EVENT_") and any(
        text.startswith("SAMPLING_INTERVAL_S:") for text in lines.texts[:100]
    )


def _read(lines: Lines, stated: Stated) -> GroundMotion:
    header: dict[str, tuple[int, str]] = {}
    first = 0
    while match := _KEY.fullmatch(lines.at(first)):
        header[match[1]] = (first, match[2])
        first += 1
    # Old files do not state the type; their unit decides.
    kind_line, kind = header.get("DATA_TYPE", (0, "ACCELERATION"))
    if kind.upper() != "ACCELERATION":
        raise RecordError(
            f"{lines.where(kind_line)}: the record holds {shown(kind).lower()}; give the file of its acceleration"
        )
    unit_line, unit = _entry(lines, header, "UNITS")
    factor = factor_to_si(unit, "acceleration", context=lines.where(unit_line))
    dt = _number(lines, header, "SAMPLING_INTERVAL_S")
    n_time = _number(lines, header, "NDATA")
    numbers = read_numbers(lines, first)
    if numbers.size != n_time:
        raise RecordError(
            f"{lines.path}: the header announces {n_time:g} samples, {numbers.size} follow; the file is cut off or "
            "damaged, fetch it again"
        )
    parts = [
        header.get(key, (0, ""))[1] for key in ("EVENT_NAME", "EVENT_DATE_YYYYMMDD", "STATION_CODE", "STREAM")
    ]
    title = ", ".join(part for part in parts if part)
    return recorded(lines.path, dt=dt, acceleration=factor * numbers, source=title)


def _entry(lines: Lines, header: dict[str, tuple[int, str]], key: str) -> tuple[int, str]:
    if key not in header:
        raise RecordError(f"{lines.path}: the header of this ESM record has no '{key}'; fetch the file again")
    return header[key]


def _number(lines: Lines, header: dict[str, tuple[int, str]], key: str) -> float:
    index, text = _entry(lines, header, key)
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise RecordError(
            f"{lines.where(index)}: {key} is '{shown(text)}' where a positive number was expected; the header "
            "of this ESM record is damaged"
        )
    return value


ESM = Format(name="an ESM record", recognises=_recognises, read=_read)
