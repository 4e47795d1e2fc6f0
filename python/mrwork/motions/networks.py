"""Text formats of strong-motion networks and archives.

PEER AT2, COSMOS, ESM and ITACA, K-NET and KiK-net; CSMIP (CDMG, CGS), BHRC, RENADIC and USC; SMC of the USGS; GeoNet.

`Format` is what a reader declares; `Lines` are the lines of a file, with line numbers in messages.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np

from mrwork.base.numbers import counted
from mrwork.base.units import FACTORS, factor_to_si
from mrwork.base.values import Floats
from mrwork.errors import RecordError, SettingError
from mrwork.files.layout import reads_as_float
from mrwork.files.roles import TIME, Series, Stated, check_rows
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.series import ACCELERATION, motion_of_series

_HEADER_SHOWN = 60
# Characters of a line of a header: what searches it takes longer than in proportion.
_LONGEST_LINE = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """Lines of the file at `path`, without line ends."""

    path: Path
    texts: Sequence[str]

    def at(self, index: int) -> str:
        """Line of a header by index from 0, as much as one has; an empty text after the last."""
        return self.texts[index][:_LONGEST_LINE] if 0 <= index < len(self.texts) else ""

    def where(self, index: int) -> str:
        """Start of a message about a line: file and line number, counted from 1."""
        return f"{self.path}: line {index + 1}"


def read_numbers(lines: Lines, first: int, announced: float | None = None) -> Floats:
    """Read all numbers of the lines from `first` on, shape (n,), as many as are announced."""
    numbers = [
        _number(lines, index, word)
        for index, text in enumerate(lines.texts[first:], start=first)
        for word in text.split()
    ]
    return _all_numbers(lines, first, numbers, len(numbers) if announced is None else announced)


def numbers_at_widths(
    lines: Lines, first: int, count: int, width: int, *, per_line: int = 1000, indent: int = 0
) -> tuple[Floats, int]:
    """So many numbers of the lines from `first` on, and the index of the line after them.

    They are in columns of a width, of which blank ones are left out and the first is wider by the indent.
    """
    numbers: list[float] = []
    line = first
    while len(numbers) < count and line < len(lines.texts):
        text = lines.texts[line][indent : indent + per_line * width]
        words = (text[start : start + width] for start in range(0, len(text), width))
        numbers += [_number(lines, line, word) for word in words if word.strip()]
        line += 1
    return _all_numbers(lines, first, numbers, count), line


def _number(lines: Lines, index: int, word: str) -> float:
    value = float(word) if reads_as_float(word) else math.nan
    if not math.isfinite(value):
        raise RecordError(
            f"{lines.where(index)} holds '{quote_text(word)}' where a number was expected; the file is cut off or "
            "damaged, or in another format"
        )
    return value


def _all_numbers(lines: Lines, first: int, numbers: list[float], announced: float) -> Floats:
    if not abs(len(numbers) - announced) < 0.5:
        raise RecordError(
            f"{lines.where(first)}: {announced:.9g} numbers are announced from here on, {len(numbers)} follow; the "
            "file is cut off or damaged, fetch it again"
        )
    return np.array(numbers, dtype=np.float64)


def quote_text(text: str) -> str:
    """Text as a message quotes it, shortened if it is long."""
    clean = " ".join(text.split())
    return clean if len(clean) <= _HEADER_SHOWN else clean[:_HEADER_SHOWN] + "..."


@dataclass(frozen=True, slots=True, kw_only=True)
class Format:
    """A text format: how its content is recognised, how it is read, and which fields of `Stated` it takes."""

    name: str
    recognises: Callable[[Lines], bool]
    read: Callable[[Lines, Stated], GroundMotion]
    needs: frozenset[str] = frozenset()


def refuse_needless(stated: Stated, needs: frozenset[str], *, source: str, kind: str) -> None:
    """Refuse an option that the format does not take, rather than ignore it."""
    for field in fields(stated):
        if getattr(stated, field.name) is not None and field.name not in needs:
            raise SettingError(f"{source}: {kind} takes no `{field.name}`; leave it out")


def make_motion(path: Path, *, dt: float, acceleration: Floats, source: str) -> GroundMotion:
    """Build the motion of a file with its name, which is also added to `source`."""
    if acceleration.size < 2 or not 0.0 < dt < np.inf:
        raise RecordError(
            f"{path}: {acceleration.size} samples every {dt:g} s are no record; give two or more at a positive step"
        )
    return GroundMotion(name=path.stem, dt=dt, acceleration=acceleration, source=f"{source} ({path.name})")


def chosen_channel(path: Path, titles: Sequence[str], stated: Stated) -> int:
    """Index of the channel that is asked for, of several with these titles."""
    number = int(len(titles) == 1) if stated.channel is None else stated.channel
    if not 1 <= number <= len(titles):
        listed = ", ".join(f"{index} {title}" for index, title in enumerate(titles, start=1))
        raise RecordError(
            f"{path}: holds {counted(len(titles), 'channel')} ({listed}); choose one with `channel`"
        )
    return number - 1


# A positive number.
_NUMBER = r"(?<![-.\d])((?=[\d.]*[1-9])(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?)"
_CONTENT = re.compile(r"(ACCELERATION|VELOCITY|DISPLACEMENT)\b.*?\bIN UNITS OF\s+([^\s.,;]+)", re.IGNORECASE)
_NAMED = re.compile(rf"NPTS\s*=\s*(\d{{1,9}})[\s,]+DT\s*=\s*{_NUMBER}", re.IGNORECASE)
_BARE = re.compile(rf"\s*(\d{{1,9}})[\s,]+{_NUMBER}[\s,]+NPTS\b[\s,]+DT\b", re.IGNORECASE)


def _read_at2(lines: Lines, _: Stated) -> GroundMotion:
    """A PEER record: a header of four lines (peer.berkeley.edu/smcat/data.html), then accelerations."""
    content = _CONTENT.search(lines.at(2))
    size = _NAMED.search(lines.at(3)) or _BARE.match(lines.at(3))
    if content is None or size is None:
        raise RecordError(
            f"{lines.path}: expected 'ACCELERATION TIME SERIES IN UNITS OF G' in line 3 and 'NPTS= ..., DT= ... SEC' "
            f"in line 4 of a PEER AT2 record, found '{quote_text(lines.at(2))}' and '{quote_text(lines.at(3))}'; save "
            "it as two columns, time and acceleration"
        )
    if content[1].upper() != "ACCELERATION":
        raise RecordError(
            f"{lines.where(2)}: the record holds {content[1].lower()}; give its acceleration, the .AT2 file"
        )
    factor = factor_to_si(content[2], "acceleration", context=lines.where(2))
    numbers = read_numbers(lines, 4, int(size[1]))
    title = " ".join(lines.at(1).split())
    return make_motion(lines.path, dt=float(size[2]), acceleration=factor * numbers, source=title)


PEER_AT2 = Format(
    name="a PEER AT2 record",
    recognises=lambda lines: _CONTENT.search(lines.at(2)) is not None and "NPTS" in lines.at(3).upper(),
    read=_read_at2,
)
# Positions in the real header: step of a processed series [ms], and of the recorder [s].
_PROCESSED_STEP, _RECORDER_STEP = slice(61, 62), slice(33, 34)
_FIRST = re.compile(r"\(Format v\s*0*1\.[0-9]+ with\s+([0-9]{1,9}) text lines\)", re.IGNORECASE)
_BLOCK = re.compile(
    r"\s*([0-9]{1,9})\s.*Format\s*=\s*\((?:[0-9]+P,?)?([0-9]{1,9})[IFE](0*[1-9][0-9]{0,8})(?:\.[0-9]+)?",
    re.IGNORECASE,
)
_COMMENTS = re.compile(r"\s*([0-9]{1,9})\s+Comment", re.IGNORECASE)
_UNIT = re.compile(r"units\s*=\s*([^\s,()]+)", re.IGNORECASE)


def _read_cosmos(lines: Lines, stated: Stated) -> GroundMotion:
    """A channel of a record of version 1.x: text, integer and real header, comments, then a series.

    A line before each header and series states how many numbers follow and in which Fortran format ("COSMOS Strong
    Motion Data Format", version 1.20, 2001).
    """
    firsts = [(line, _FIRST.search(lines.at(line))) for line in range(len(lines.texts))]
    heads = [(line, first) for line, first in firsts if first is not None]
    titles = [quote_text(lines.at(line)[: first.start()]) for line, first in heads]
    number = chosen_channel(lines.path, titles, stated)
    (head, first), title = heads[number], titles[number]
    if "acceleration" not in title.lower():
        raise RecordError(f"{lines.where(head)}: the series is '{title}'; give one of acceleration")
    _, line = _block_cosmos(lines, head + int(first[1]))
    real, line = _block_cosmos(lines, line)
    if comments := _COMMENTS.match(lines.at(line)):
        line += 1 + int(comments[1])
    numbers, _ = _block_cosmos(lines, line)
    match = _UNIT.search(lines.at(line))
    factor = factor_to_si(match[1] if match else "", "acceleration", context=lines.where(line))
    steps = np.append(1e-3 * real[_PROCESSED_STEP], real[_RECORDER_STEP])
    return make_motion(
        lines.path,
        dt=float(next(iter(steps[steps > 0.0]), 0.0)),
        acceleration=factor * numbers,
        source=f"{' '.join(lines.at(head + 4).split())}, {title}",
    )


def _block_cosmos(lines: Lines, line: int) -> tuple[Floats, int]:
    """Numbers announced by the line at `place`, at fixed widths, and the index of the line after them."""
    announced = _BLOCK.match(lines.at(line))
    if announced is None:
        raise RecordError(
            f"{lines.where(line)}: expected how many numbers follow and in which format, found "
            f"'{quote_text(lines.at(line))}'; the file is cut off or damaged"
        )
    count, per_line, width = map(int, announced.groups())
    return numbers_at_widths(lines, line + 1, count, width, per_line=per_line)


COSMOS = Format(
    name="a COSMOS record",
    recognises=lambda lines: _FIRST.search(lines.at(0)) is not None,
    read=_read_cosmos,
    needs=frozenset({"channel"}),
)
_LONGEST_HEADER = 100


def _line_of(lines: Lines, label: str) -> int:
    """Index of the line of a header that begins with a label, -1 if there is none."""
    return next((index for index in range(_LONGEST_HEADER) if lines.at(index).startswith(label)), -1)


def _text_of(lines: Lines, label: str) -> str:
    """Text that a header states after a label, empty if it states nothing."""
    return lines.at(_line_of(lines, label))[len(label) :].strip()


def _entry_of(lines: Lines, label: str, pattern: str, example: str) -> re.Match[str]:
    match = re.search(pattern, _text_of(lines, label), re.IGNORECASE)
    if match is None:
        raise RecordError(
            f"{lines.path}: expected a line '{label} {example}' in the header, found "
            f"'{quote_text(lines.at(_line_of(lines, label)))}'; the file is damaged, fetch it again"
        )
    return match


_KEY = re.compile(r"[A-Z][A-Z0-9_/^]*:.*")


def _read_esm(lines: Lines, _: Stated) -> GroundMotion:
    """A record in DYNA 1.x ASCII: about 64 lines `KEY: value`, then one acceleration per line."""
    # Old files do not state the type; their unit decides.
    kind = _text_of(lines, "DATA_TYPE:")
    if kind.upper() not in ("", "ACCELERATION"):
        raise RecordError(
            f"{lines.where(_line_of(lines, 'DATA_TYPE:'))}: the record holds {quote_text(kind).lower()}; give the "
            "file of its acceleration"
        )
    unit = _entry_of(lines, "UNITS:", r"(.+)", "cm/s^2")[1]
    factor = factor_to_si(unit, "acceleration", context=lines.where(_line_of(lines, "UNITS:")))
    dt, n_time = (
        float(_entry_of(lines, label, _NUMBER, example)[1])
        for label, example in (("SAMPLING_INTERVAL_S:", "0.005"), ("NDATA:", "6000"))
    )
    first = next(index for index in range(len(lines.texts) + 1) if not _KEY.fullmatch(lines.at(index)))
    parts = ("EVENT_NAME:", "EVENT_DATE_YYYYMMDD:", "STATION_CODE:", "STREAM:")
    return make_motion(
        lines.path,
        dt=dt,
        acceleration=factor * read_numbers(lines, first, n_time),
        source=", ".join(filter(None, (_text_of(lines, part) for part in parts))),
    )


ESM = Format(
    name="an ESM record",
    recognises=lambda lines: (
        lines.at(0).startswith("EVENT_") and _line_of(lines, "SAMPLING_INTERVAL_S:") >= 0
    ),
    read=_read_esm,
)


def _read_knet(lines: Lines, _: Stated) -> GroundMotion:
    """A record of 17 header lines, then counts of the recorder, times a scale factor such as `3920(gal)/6182761`.

    The published peak refers to the mean (National Research Institute for Earth Science and Disaster Resilience, "About
    K-NET ASCII format").
    """
    rate = float(_entry_of(lines, "Sampling Freq", rf"{_NUMBER}\s*Hz", "100Hz")[1])
    duration = float(_entry_of(lines, "Duration Time", _NUMBER, "108")[1])
    scale = _entry_of(lines, "Scale Factor", rf"{_NUMBER}\s*\(gal\)\s*/\s*{_NUMBER}", "3920(gal)/6182761")
    counts = read_numbers(lines, _line_of(lines, "Memo") + 1, duration * rate)
    acceleration = FACTORS["acceleration"]["gal"] * float(scale[1]) / float(scale[2]) * counts
    mean = float(np.mean(acceleration)) if acceleration.size else 0.0
    station, origin, direction = (_text_of(lines, label) for label in ("Station Code", "Origin Time", "Dir."))
    source = f"K-NET or KiK-net, {origin}, station {station}, {direction}"
    motion = make_motion(lines.path, dt=1.0 / rate, acceleration=acceleration - mean, source=source)
    change = f"mean of {mean:.4g} m/s2 taken out, the offset of the recorder"
    # The extension states the direction of the record.
    return replace(motion, name=lines.path.name.replace(".", "_"), changes=(change,))


K_NET = Format(
    name="a K-NET record",
    recognises=lambda lines: lines.at(0).startswith("Origin Time") and _line_of(lines, "Scale Factor") >= 0,
    read=_read_knet,
)
# Each channel of a volume has a header, then numbers at widths, which may touch; velocities are not read.
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
_UNITS = re.compile(r"\bunits\b.*\band\s+(g(?=/10)|[\w/^]+)(/10)?", re.IGNORECASE)
_TITLE = re.compile(r"\b(?:chan\w*\s+\d+\s*:|comp\s+\w).*", re.IGNORECASE)
_UNCORRECTED = ("uncorrected", "* vol", "file")
_OTHERS = ("corrected accelerogram", "response and fourier")
# Lines of the longest header; widths of a time or an acceleration in a pair, and of a number with an exponent.
_HEADER, _IN_PAIR, _WITH_EXPONENT = 45, 7, 13


def _read_volume(lines: Lines, stated: Stated) -> GroundMotion:
    """Volume 1 or 2 of CSMIP, or volume 1 of BHRC, RENADIC or USC, of which all but BHRC have pairs with times."""
    heads = [text[:200] for text in lines.texts]
    matches = [(line, series) for line, text in enumerate(heads) if (series := _SERIES.match(text))]
    read = _read_series if matches else _read_points
    if not matches and heads[0].casefold().startswith(_UNCORRECTED):
        matches = [(line, points) for line, text in enumerate(heads) if (points := _POINTS.search(text))]
    if not matches:
        raise RecordError(
            f"{lines.path}: begins as a volume of accelerograms, '{quote_text(heads[0])}', without a series that "
            "is known; read are volumes 1 and 2 of CSMIP, and volumes 1 of BHRC, RENADIC and USC: give one of "
            "these, or save the series as two columns, time and acceleration"
        )
    titles = [_title_above(heads[max(0, line - _HEADER) : line]) for line, _ in matches]
    number = chosen_channel(lines.path, titles, stated)
    of_event = 2 if heads[0].casefold().startswith("corrected") else 1
    source = ", ".join(filter(None, (" ".join(lines.at(of_event).split()), titles[number])))
    return read(lines, *matches[number], source)


def _read_series(lines: Lines, line: int, series: re.Match[str], source: str) -> GroundMotion:
    """Accelerations after a line that states their number, step and unit."""
    match = _WIDTH.search(lines.at(line))
    width = int(match[1]) if match else max(round(len(lines.at(line + 1).rstrip()) / 8), 1)
    numbers, _ = numbers_at_widths(lines, line + 1, int(series["count"]), width)
    dt = float(series["step"]) if series["step"] else 1.0 / max(float(series["rate"]), 1e-9)
    factor = factor_to_si(series["unit"], "acceleration", context=lines.where(line))
    return make_motion(lines.path, dt=dt, acceleration=factor * numbers, source=source)


def _read_points(lines: Lines, line: int, points: re.Match[str], source: str) -> GroundMotion:
    """Accelerations, or pairs of time and acceleration, some lines after one that states their number and duration."""
    unit, tenth = match.groups() if (match := _UNITS.search(lines.at(line + 1))) else ("", None)
    factor = factor_to_si(unit, "acceleration", context=lines.where(line)) / (10.0 if tenth else 1.0)
    count, first = int(points[1]), line + _AFTER_POINTS
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
    time, acceleration = pairs.T
    series = Series(
        along=time, samples=acceleration[None, :], where=lambda row: lines.where(first + row // per_line)
    )
    check_rows(series, TIME, ACCELERATION)
    return motion_of_series(series, name=lines.path.stem, source=f"{source} ({lines.path.name})")


def _title_above(heads: list[str]) -> str:
    """The nearest name of a channel or component."""
    named = (match[0] for text in reversed(heads) if (match := _TITLE.search(text)) is not None)
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
    """11 lines of text, 48 integers, 50 numbers, comments, then cm/s^2, or pairs with time (USGS, SMC)."""
    if "ACCELEROGRAM" not in lines.at(0):
        raise RecordError(
            f"{lines.where(0)}: this SMC file is of the kind '{quote_text(lines.at(0))}'; give one of acceleration"
        )
    integers, line = numbers_at_widths(lines, 11, 48, 10)
    header, line = numbers_at_widths(lines, line, 50, 15)
    line += max(int(integers[15]), 0)
    numbers = numbers_at_widths(lines, line, max(int(integers[16]), 0), 10)[0]
    source = " ".join(f"{lines.at(3)} {lines.at(5)}".split())
    # The first number of the header stands for what is not known.
    if header[1] != header[0] and header[1] > 0.0:
        return make_motion(lines.path, dt=1.0 / header[1], acceleration=0.01 * numbers, source=source)
    pairs = numbers[: numbers.size // 2 * 2].reshape(-1, 2) * [1.0, 0.01]
    return _motion_of_pairs(lines, line, 4, pairs, source)


SMC = Format(
    name="an SMC record",
    recognises=lambda lines: (
        re.match(r"\d [A-Z]{2}", lines.at(0)) is not None
        and all(lines.at(line).startswith("*") for line in (8, 9, 10))
    ),
    read=_read_smc,
)

_GEONET = re.compile(r"(?:un)?corrected accelerogram\b.*\bGNS Science", re.IGNORECASE)


def _read_geonet(lines: Lines, stated: Stated) -> GroundMotion:
    """A file V1A or V2A: for each channel 16 lines of text, 100 numbers, then mm/s^2 (GNS accelerogram data, 2012)."""
    heads = [line for line, text in enumerate(lines.texts) if _GEONET.match(text[:200])]
    titles = [" ".join(lines.at(head + 12).split()) for head in heads]
    number = chosen_channel(lines.path, titles, stated)
    header, line = numbers_at_widths(lines, heads[number] + 16, 100, 8)
    corrected = lines.at(heads[number]).casefold().startswith("corrected")
    numbers, _ = numbers_at_widths(lines, line, int(header[33 if corrected else 30]), 8)
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
