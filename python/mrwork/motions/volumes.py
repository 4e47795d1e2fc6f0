"""Text formats of volumes: CSMIP (CDMG, CGS), BHRC, RENADIC and USC; SMC of the USGS; GeoNet of New Zealand.

Each channel of a file has a header, then numbers at fixed widths, which may touch; a corrected one also has its
velocity and displacement, which are not read.
"""

from __future__ import annotations

import re

from mrwork.base.units import STANDARD_GRAVITY, factor_to_si
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
_WIDTH = re.compile(r"\(\d+f(\d+)\.\d+\)", re.IGNORECASE)
# The line 11 of 13 lines of text, which 7 of integers and 7 of other numbers follow; the line after it has the unit.
_POINTS = re.compile(
    r"no\. of points\s*=\s*(\d{1,9})\s+(?:record length|duration)\s*=\s*(\d*\.?\d+)", re.IGNORECASE
)
_AFTER_POINTS = 17
_UNIT = re.compile(r"\bunits\b.*\band\s+(g/10|[\w/^]+)", re.IGNORECASE)
_TITLE = re.compile(r"\b(?:chan\w*\s+\d+\s*:|comp\s+\w).*", re.IGNORECASE)
_UNCORRECTED = ("uncorrected", "* vol", "file")
_OTHERS = ("corrected accelerogram", "response and fourier")
# Lines of the longest header; widths of a time or an acceleration in a pair, and of a number with an exponent.
_HEADER, _IN_PAIR, _WITH_EXPONENT = 45, 7, 13


def _read_volume(lines: Lines, stated: Stated) -> GroundMotion:
    """Volume 1 or 2 of CSMIP, or volume 1 of BHRC, RENADIC or USC, of which all but BHRC have pairs with times."""
    heads = [text[:200] for text in lines.texts]
    places = [place for place, text in enumerate(heads) if _SERIES.match(text)]
    if not places and heads[0].casefold().startswith(_UNCORRECTED):
        places = [place for place, text in enumerate(heads) if _POINTS.search(text)]
    if not places:
        raise RecordError(
            f"{lines.path}: begins as a volume of accelerograms, '{quote_text(heads[0])}', without a series that "
            "is known; read are volumes 1 and 2 of CSMIP, and volumes 1 of BHRC, RENADIC and USC: give one of "
            "these, or save the series as two columns, time and acceleration"
        )
    titles = [_title_above(heads[max(0, place - _HEADER) : place]) for place in places]
    number = chosen_channel(lines.path, titles, stated)
    place = places[number]
    series, points, unit = (
        _SERIES.match(heads[place]),
        _POINTS.search(heads[place]),
        _UNIT.search(lines.at(place + 1)),
    )
    of_event = 2 if heads[0].casefold().startswith("corrected") else 1
    source = ", ".join(filter(None, (" ".join(lines.at(of_event).split()), titles[number])))
    name = lines.path.stem if stated.channel is None else f"{lines.path.stem}_{stated.channel}"

    def factor(text: str) -> float:
        if text.casefold() == "g/10":
            return 0.1 * STANDARD_GRAVITY
        return factor_to_si(text, "acceleration", context=lines.where(place))

    if points is None:
        assert series is not None  # one of the two was found in this line
        head, given = lines.at(place + 1).rstrip(), _WIDTH.search(heads[place])
        width = int(given[1]) if given else max(round(len(head) / 8), 1)
        numbers, _ = numbers_at_widths(lines, place + 1, int(series["count"]), width, "series")
        dt = float(series["step"]) if series["step"] else 1.0 / max(float(series["rate"]), 1e-9)
        return make_motion(
            lines.path, dt=dt, acceleration=factor(series["unit"]) * numbers, source=source, name=name
        )
    count, length, first = int(points[1]), float(points[2]), place + _AFTER_POINTS
    in_si, head = factor("" if unit is None else unit[1]), lines.at(first).rstrip()
    if "E" in head.upper():
        numbers, _ = numbers_at_widths(lines, first, count, _WITH_EXPONENT, "series")
        dt = length / max(count - 1, 1)
        return make_motion(lines.path, dt=dt, acceleration=in_si * numbers, source=source, name=name)
    # The first column may be wider than the others.
    pairs, _ = numbers_at_widths(lines, first, 2 * count, _IN_PAIR, "series", indent=len(head) % _IN_PAIR)
    return motion_of_columns(
        pairs[::2],
        in_si * pairs[1::2],
        name=name,
        source=f"{source} ({lines.path.name})",
        where=lambda row: lines.where(first + row // 5),
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
    integers, place = numbers_at_widths(lines, 11, 48, 10, "integer header")
    header, place = numbers_at_widths(lines, place, 50, 15, "real header")
    place += max(int(integers[15]), 0)
    numbers = numbers_at_widths(lines, place, max(int(integers[16]), 0), 10, "series")[0]
    source = " ".join(f"{lines.at(3)} {lines.at(5)}".split())
    # The first number of the header stands for what is not known.
    if header[1] != header[0] and header[1] > 0.0:
        return make_motion(lines.path, dt=1.0 / header[1], acceleration=0.01 * numbers, source=source)
    return motion_of_columns(
        numbers[: numbers.size // 2 * 2 : 2],
        0.01 * numbers[1::2],
        name=lines.path.stem,
        source=f"{source} ({lines.path.name})",
        where=lambda row: lines.where(place + row // 4),
    )


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
    header, place = numbers_at_widths(lines, heads[number] + 16, 100, 8, "header")
    corrected = lines.at(heads[number]).casefold().startswith("corrected")
    numbers, _ = numbers_at_widths(lines, place, int(header[33 if corrected else 30]), 8, "series")
    scale = re.search(r"units of\s*(\d*\.?\d+)\s*mm/s/s", lines.at(heads[number] + 11))
    return make_motion(
        lines.path,
        name=lines.path.stem if stated.channel is None else f"{lines.path.stem}_{stated.channel}",
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
