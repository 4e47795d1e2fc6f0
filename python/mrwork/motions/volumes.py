"""Text formats of volumes: CSMIP (CDMG, CGS), BHRC, RENADIC and USC; SMC of the USGS; GeoNet of New Zealand.

Each channel of a file has a header, then numbers at fixed widths, which may touch; a corrected one also has its
velocity and displacement, which are not read.
"""

from __future__ import annotations

import re

from mrwork.base.units import factor_to_si
from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.networks import (
    Format,
    Lines,
    Stated,
    chosen_channel,
    make_motion,
    numbers_at_widths,
    quote_text,
)
from mrwork.motions.uniform import motion_of_columns

# "3251 POINTS OF ACCEL DATA EQUALLY SPACED AT  .020 SEC.  (UNITS: CM/SEC/SEC)",
# "13200 Accelerogram points at 200 pts/sec in units of g .      Format: (8f9.6)".
_SERIES = re.compile(
    r"\s*(?P<count>\d{1,9})\s+(?:points of accel data equally spaced at\s*(?P<step>\d*\.?\d+)\s*sec"
    r"|accelerogram points at\s*(?P<rate>\d*\.?\d+)\s*pts/sec).*?\b(?:units:|in units of|in)\s*(?P<unit>[\w/^]+)",
    re.IGNORECASE,
)
_WIDTH = re.compile(r"\(\d+f([1-9]\d*)\.\d+\)", re.IGNORECASE)
# The line 11 of 13 lines of text, which 7 of integers and 7 of other numbers follow; the line after it has the unit.
_POINTS = re.compile(
    r"no\. of points\s*=\s*(\d{1,9})\s+(?:record length|duration)\s*=\s*(\d*\.?\d+)", re.IGNORECASE
)
_AFTER_POINTS = 17
_UNIT = re.compile(r"\bunits\b.*\band\s+(g(?=/10)|[\w/^]+)(/10)?", re.IGNORECASE)
_TITLE = re.compile(r"\b(?:chan\w*\s+\d+\s*:|comp\s+\w).*", re.IGNORECASE)
_UNCORRECTED = ("uncorrected", "* vol", "file")
_OTHERS = ("corrected accelerogram", "response and fourier")
# Lines of the longest header; widths of a time or an acceleration in a pair, and of a number with an exponent.
_HEADER, _IN_PAIR, _WITH_EXPONENT = 45, 7, 13


def _read_volume(lines: Lines, stated: Stated) -> GroundMotion:
    """Volume 1 or 2 of CSMIP, or volume 1 of BHRC, RENADIC or USC, of which all but BHRC have pairs with times."""
    heads = [text[:200] for text in lines.texts]
    found = [(place, series) for place, text in enumerate(heads) if (series := _SERIES.match(text))]
    read = _read_series if found else _read_points
    if not found and heads[0].casefold().startswith(_UNCORRECTED):
        found = [(place, points) for place, text in enumerate(heads) if (points := _POINTS.search(text))]
    if not found:
        raise RecordError(
            f"{lines.path}: begins as a volume of accelerograms, '{quote_text(heads[0])}', without a series that "
            "is known; read are volumes 1 and 2 of CSMIP, and volumes 1 of BHRC, RENADIC and USC: give one of "
            "these, or save the series as two columns, time and acceleration"
        )
    titles = [_title_above(heads[max(0, place - _HEADER) : place]) for place, _ in found]
    number = chosen_channel(lines.path, titles, stated)
    of_event = 2 if heads[0].casefold().startswith("corrected") else 1
    source = ", ".join(filter(None, (" ".join(lines.at(of_event).split()), titles[number])))
    return read(lines, *found[number], source)


def _read_series(lines: Lines, place: int, series: re.Match[str], source: str) -> GroundMotion:
    """Accelerations after a line that states their number, step and unit."""
    given = _WIDTH.search(lines.at(place))
    width = int(given[1]) if given else max(round(len(lines.at(place + 1).rstrip()) / 8), 1)
    numbers, _ = numbers_at_widths(lines, place + 1, int(series["count"]), width)
    dt = float(series["step"]) if series["step"] else 1.0 / max(float(series["rate"]), 1e-9)
    factor = factor_to_si(series["unit"], "acceleration", context=lines.where(place))
    return make_motion(lines.path, dt=dt, acceleration=factor * numbers, source=source)


def _read_points(lines: Lines, place: int, points: re.Match[str], source: str) -> GroundMotion:
    """Accelerations, or pairs of times and these, some lines after one that states their number and duration."""
    unit, tenth = found.groups() if (found := _UNIT.search(lines.at(place + 1))) else ("", None)
    factor = factor_to_si(unit, "acceleration", context=lines.where(place)) / (10.0 if tenth else 1.0)
    count, first = int(points[1]), place + _AFTER_POINTS
    head = lines.at(first).rstrip()
    if "E" in head.upper():
        numbers, _ = numbers_at_widths(lines, first, count, _WITH_EXPONENT)
        dt = float(points[2]) / max(count - 1, 1)
        return make_motion(lines.path, dt=dt, acceleration=factor * numbers, source=source)
    # The first column may be wider than the others.
    pairs, _ = numbers_at_widths(lines, first, 2 * count, _IN_PAIR, indent=len(head) % _IN_PAIR)
    return _motion_of_pairs(lines, first, 5, pairs.reshape(-1, 2) * [1.0, factor], source)


def _motion_of_pairs(lines: Lines, first: int, per_line: int, pairs: Floats, source: str) -> GroundMotion:
    """The motion of pairs of time [s] and acceleration [m/s^2], shape (n_time, 2), so many in each line."""
    return motion_of_columns(
        *pairs.T,
        name=lines.path.stem,
        source=f"{source} ({lines.path.name})",
        where=lambda row: lines.where(first + row // per_line),
    )


def _title_above(heads: list[str]) -> str:
    """The nearest name of a channel or component."""
    named = (found[0] for text in reversed(heads) if (found := _TITLE.search(text)) is not None)
    return " ".join(next(named, "").split())


VOLUME = Format(
    name="a volume of CSMIP, BHRC, RENADIC or USC",
    recognises=lambda lines: (
        lines.at(0).casefold().startswith((*_UNCORRECTED[:2], *_OTHERS))
        or "of uncorrected accelerogram" in lines.at(0).casefold()
    ),
    read=_read_volume,
    needs=frozenset({"channel"}),
)


def _read_smc(lines: Lines, _: Stated) -> GroundMotion:
    """11 lines of text, 48 integers, 50 numbers, comments, then cm/s^2, or pairs of time and these (USGS, SMC)."""
    if "ACCELEROGRAM" not in lines.at(0):
        raise RecordError(
            f"{lines.where(0)}: this SMC file is of the kind '{quote_text(lines.at(0))}'; give one of acceleration"
        )
    integers, place = numbers_at_widths(lines, 11, 48, 10)
    header, place = numbers_at_widths(lines, place, 50, 15)
    place += max(int(integers[15]), 0)
    numbers = numbers_at_widths(lines, place, max(int(integers[16]), 0), 10)[0]
    source = " ".join(f"{lines.at(3)} {lines.at(5)}".split())
    # The first number of the header stands for what is not known.
    if header[1] != header[0] and header[1] > 0.0:
        return make_motion(lines.path, dt=1.0 / header[1], acceleration=0.01 * numbers, source=source)
    pairs = numbers[: numbers.size // 2 * 2].reshape(-1, 2) * [1.0, 0.01]
    return _motion_of_pairs(lines, place, 4, pairs, source)


SMC = Format(
    name="an SMC record",
    recognises=lambda lines: (
        re.match(r"\d [A-Z]{2}", lines.at(0)) is not None
        and all(lines.at(place).startswith("*") for place in (8, 9, 10))
    ),
    read=_read_smc,
)

_GEONET = re.compile(r"(?:un)?corrected accelerogram\b.*\bGNS Science", re.IGNORECASE)


def _read_geonet(lines: Lines, stated: Stated) -> GroundMotion:
    """A file V1A or V2A: for each channel 16 lines of text, 100 numbers, then mm/s^2 (GNS accelerogram data, 2012)."""
    heads = [place for place, text in enumerate(lines.texts) if _GEONET.match(text[:200])]
    titles = [" ".join(lines.at(head + 12).split()) for head in heads]
    number = chosen_channel(lines.path, titles, stated)
    header, place = numbers_at_widths(lines, heads[number] + 16, 100, 8)
    corrected = lines.at(heads[number]).casefold().startswith("corrected")
    numbers, _ = numbers_at_widths(lines, place, int(header[33 if corrected else 30]), 8)
    scale = re.search(r"units of\s*(\d*\.?\d+)\s*mm/s/s", lines.at(heads[number] + 11))
    return make_motion(
        lines.path,
        dt=float(header[65]),
        acceleration=1e-3 * (1.0 if scale is None else float(scale[1])) * numbers,
        source=f"GeoNet, {' '.join(lines.at(heads[number] + 2).split())}, {titles[number]}",
    )


GEONET = Format(
    name="a GeoNet record",
    recognises=lambda lines: _GEONET.match(lines.at(0)) is not None,
    read=_read_geonet,
    needs=frozenset({"channel"}),
)
