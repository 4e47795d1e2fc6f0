"""PEER strong-motion records (.AT2): four header lines, then accelerations in g, several per line.

The header ends with NPTS and DT, before or after their numbers, in any case (peer.berkeley.edu/smcat/data.html).
"""

from __future__ import annotations

import re

from mrwork.errors import RecordError
from mrwork.motions.formats.format import Format, Lines, Stated, read_numbers, recorded, shown
from mrwork.motions.ground_motion import GroundMotion
from mrwork.units import factor_to_si

_HEADER = 4
_CONTENT = re.compile(r"(ACCELERATION|VELOCITY|DISPLACEMENT)\b.*?\bIN UNITS OF\s+([^\s.,;]+)", re.IGNORECASE)
_NUMBER = r"((?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:E[+-]?[0-9]+)?)"
_NAMED = re.compile(rf"NPTS\s*=\s*([0-9]{{1,9}})[\s,]+DT\s*=\s*{_NUMBER}", re.IGNORECASE)
_BARE = re.compile(rf"\s*([0-9]{{1,9}})[\s,]+{_NUMBER}[\s,]+NPTS\b[\s,]+DT\b", re.IGNORECASE)


def _recognises(lines: Lines) -> bool:
    return _CONTENT.search(lines.at(2)) is not None and "NPTS" in lines.at(3).upper()


def _read(lines: Lines, stated: Stated) -> GroundMotion:
    content = _CONTENT.search(lines.at(2))
    size = _NAMED.search(lines.at(3)) or _BARE.match(lines.at(3))
    if content is None or size is None:
        raise RecordError(
            f"{lines.where(3)}: expected 'NPTS= ..., DT= ... SEC', found '{shown(lines.at(3))}'; "
            "the header of this PEER record is damaged"
        )
    if content[1].upper() != "ACCELERATION":
        raise RecordError(
            f"{lines.where(2)}: the record holds {content[1].lower()}; give its acceleration, the .AT2 file"
        )
    factor = factor_to_si(content[2], "acceleration", context=lines.where(2))
    n_time, dt = int(size[1]), float(size[2])
    numbers = read_numbers(lines, _HEADER)
    if numbers.size != n_time:
        raise RecordError(
            f"{lines.path}: line 4 announces {n_time} samples, {numbers.size} follow; the file is cut off or "
            "damaged, fetch it again"
        )
    title = " ".join(lines.at(1).split())
    return recorded(lines.path, dt=dt, acceleration=factor * numbers, source=title)


PEER_AT2 = Format(name="a PEER AT2 record", recognises=_recognises, read=_read)


def refuse_false_at2(lines: Lines) -> None:
    """Refuse a file that has the extension .AT2 but not the header of the format; the message states the difference."""
    if len(lines.texts) < _HEADER:
        came = f"the file has {len(lines.texts)} lines"
    elif _CONTENT.search(lines.at(2)) is None:
        came = f"line 3 reads '{shown(lines.at(2))}'"
    else:
        came = f"line 4 reads '{shown(lines.at(3))}'"
    raise RecordError(
        f"{lines.path}: has the extension of a PEER AT2 record but not its header ('ACCELERATION TIME SERIES IN UNITS "
        f"OF G' in line 3, 'NPTS= ..., DT= ... SEC' in line 4); {came}; save it as two columns, time and acceleration"
    )
