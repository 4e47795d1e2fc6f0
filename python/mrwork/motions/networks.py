"""Text formats of strong-motion networks and archives: PEER AT2, COSMOS, ESM and ITACA, K-NET and KiK-net.

`Format` is what a reader declares; `Lines` are the lines of a file, with line numbers in messages.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import NoReturn

import numpy as np

from mrwork.base.units import FACTORS, factor_to_si
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import RecordError, SettingError
from mrwork.files.delimited import decode_text
from mrwork.files.layout import reads_as_float
from mrwork.motions.examination import refuse_absurd
from mrwork.motions.ground_motion import GroundMotion

_HEADER_SHOWN = 60
# Characters of a line of a header: what searches it takes longer than in proportion.
_LONGEST = 1000


@dataclass(frozen=True, slots=True, kw_only=True)
class Lines:
    """Lines of the file at `path`, without line ends."""

    path: Path
    texts: tuple[str, ...]

    def at(self, index: int) -> str:
        """Line of a header by index from 0, as much as one has; an empty text after the last."""
        return self.texts[index][:_LONGEST] if 0 <= index < len(self.texts) else ""

    def where(self, index: int) -> str:
        """Start of a message about a line: file and line number, counted from 1."""
        return f"{self.path}: line {index + 1}"


def lines_of(data: bytes, path: Path) -> Lines:
    """Lines of the bytes of a text file with any line ends; headers of old files may be Latin-1."""
    # Some archives hold files with line ends CR CR LF; a run of CR is looked at once, from its start.
    return Lines(path=path, texts=tuple(re.split(r"(?<!\r)\r*\n|\r", decode_text(data))))


def read_numbers(lines: Lines, first: int) -> Floats:
    """Read all numbers of the lines from `first` on, shape (n,)."""
    texts = lines.texts[first:]
    try:
        numbers = np.array(" ".join(texts).split(), dtype=np.float64)
    except ValueError:
        numbers = None
    if numbers is not None and np.isfinite(numbers).all():
        return numbers
    index, word = next(
        (index, word)
        for index, text in enumerate(texts, start=first)
        for word in text.split()
        if not reads_as_float(word) or not np.isfinite(float(word))
    )
    raise RecordError(
        f"{lines.where(index)} holds '{quote_text(word)}' where a number was expected; the file is damaged or in "
        "another format"
    )


def quote_text(text: str) -> str:
    """Text as a message quotes it, shortened if it is long."""
    clean = " ".join(text.split())
    return clean if len(clean) <= _HEADER_SHOWN else clean[:_HEADER_SHOWN] + "..."


@dataclass(frozen=True, slots=True, kw_only=True)
class Stated:
    """Options for what a file does not state: a unit, a step [s], a column or variable, a channel counted from 1."""

    unit: str | None = None
    dt: float | None = None
    column: str | None = None
    channel: int | None = None


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


def make_motion(
    path: Path,
    *,
    dt: float,
    acceleration: Floats,
    source: str,
    name: str | None = None,
    changes: tuple[str, ...] = (),
) -> GroundMotion:
    """Build the motion of a file, by default with the name of the file, which is also added to `source`."""
    if acceleration.size < 2:
        raise RecordError(
            f"{path}: the record has too few samples ({acceleration.size}); it needs two or more"
        )
    if not (0.0 < dt < np.inf):
        raise RecordError(f"{path}: the step between samples is {dt:g} s; a record needs a positive one")
    refuse_absurd(acceleration, source=str(path))
    return GroundMotion(
        name=path.stem if name is None else name,
        dt=dt,
        acceleration=acceleration,
        source=f"{source} ({path.name})",
        changes=changes,
    )


def chosen_channel(path: Path, titles: Sequence[str], stated: Stated) -> int:
    """Index of the channel that is asked for, of several with these titles."""
    if stated.channel is None and len(titles) > 1:
        listed = ", ".join(f"{number} {title}" for number, title in enumerate(titles, start=1))
        raise RecordError(f"{path}: holds {len(titles)} channels ({listed}); choose one with `channel`")
    number = 1 if stated.channel is None else stated.channel
    if not 1 <= number <= len(titles):
        raise RecordError(f"{path}: has no channel {number}; it holds {len(titles)}, counted from 1")
    return number - 1


def numbers_at_widths(
    lines: Lines, first: int, count: int, width: int, what: str, *, indent: int = 0
) -> tuple[Floats, int]:
    """So many numbers of the lines from `first` on, in columns of a width, and the index of the line after them."""
    numbers: list[float] = []
    place = first
    while len(numbers) < count and place < len(lines.texts):
        numbers += _numbers_at(lines, range(place, place + 1), width, what, indent=indent)
        place += 1
    if len(numbers) != count:
        _refuse_cut(lines, f"the header announces {count} numbers of the {what}", np.array(numbers))
    return np.array(numbers), place


def _numbers_at(
    lines: Lines, rows: range, width: int, what: str, *, per_line: int = 1000, indent: int = 0
) -> list[float]:
    """Numbers in columns of a width, whose blank ones are left out; the first is wider by the indent."""
    numbers: list[float] = []
    for index in range(rows.start, min(rows.stop, len(lines.texts))):
        text = lines.texts[index][indent:]
        for start in range(0, min(len(text), per_line * width), max(width, 1)):
            word = text[start : start + width]
            try:
                value = float(word)
            except ValueError:
                value = float("nan")
            if np.isfinite(value):
                numbers.append(value)
            elif word.strip():
                raise RecordError(
                    f"{lines.where(index)} holds '{quote_text(word)}' where a number of the {what} was expected; the "
                    "file is cut off or damaged"
                )
    return numbers


def _refuse_cut(lines: Lines, announced: str, numbers: Floats) -> NoReturn:
    raise RecordError(
        f"{lines.path}: {announced}, {numbers.size} follow; the file is cut off or damaged, fetch it again"
    )


_HEADER = 4
_CONTENT = re.compile(r"(ACCELERATION|VELOCITY|DISPLACEMENT)\b.*?\bIN UNITS OF\s+([^\s.,;]+)", re.IGNORECASE)
_NUMBER_AT2 = r"((?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:E[+-]?[0-9]+)?)"
_NAMED = re.compile(rf"NPTS\s*=\s*([0-9]{{1,9}})[\s,]+DT\s*=\s*{_NUMBER_AT2}", re.IGNORECASE)
_BARE = re.compile(rf"\s*([0-9]{{1,9}})[\s,]+{_NUMBER_AT2}[\s,]+NPTS\b[\s,]+DT\b", re.IGNORECASE)


def _read_at2(lines: Lines, stated: Stated) -> GroundMotion:
    """A PEER record: a header of four lines (peer.berkeley.edu/smcat/data.html), then accelerations."""
    content = _CONTENT.search(lines.at(2))
    size = _NAMED.search(lines.at(3)) or _BARE.match(lines.at(3))
    if content is None or size is None:
        raise RecordError(
            f"{lines.where(3)}: expected 'NPTS= ..., DT= ... SEC', found '{quote_text(lines.at(3))}'; "
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
        _refuse_cut(lines, f"line 4 announces {n_time} samples", numbers)
    title = " ".join(lines.at(1).split())
    return make_motion(lines.path, dt=dt, acceleration=factor * numbers, source=title)


PEER_AT2 = Format(
    name="a PEER AT2 record",
    recognises=lambda lines: _CONTENT.search(lines.at(2)) is not None and "NPTS" in lines.at(3).upper(),
    read=_read_at2,
)


def refuse_false_at2(lines: Lines) -> None:
    """Refuse a file that has the extension .AT2 but not the header of the format; the message states the difference."""
    if len(lines.texts) < _HEADER:
        came = f"the file has {len(lines.texts)} lines"
    elif _CONTENT.search(lines.at(2)) is None:
        came = f"line 3 reads '{quote_text(lines.at(2))}'"
    else:
        came = f"line 4 reads '{quote_text(lines.at(3))}'"
    raise RecordError(
        f"{lines.path}: has the extension of a PEER AT2 record but not its header ('ACCELERATION TIME SERIES IN UNITS "
        f"OF G' in line 3, 'NPTS= ..., DT= ... SEC' in line 4); {came}; save it as two columns, time and acceleration"
    )


# Positions in the real header, from 1: step of a processed series [ms], and of the recorder [s].
_PROCESSED_STEP = 62
_RECORDER_STEP = 34
_FIRST = re.compile(r"\(Format v\s*0*1\.[0-9]+ with\s+([0-9]{1,9}) text lines\)", re.IGNORECASE)
_BLOCK = re.compile(
    r"\s*([0-9]{1,9})\s.*Format\s*=\s*\((?:[0-9]+P,?)?([0-9]{1,9})[IFE]([0-9]{1,9})(?:\.[0-9]+)?",
    re.IGNORECASE,
)
_COMMENTS = re.compile(r"\s*([0-9]{1,9})\s+Comment", re.IGNORECASE)
_UNIT = re.compile(r"units\s*=\s*([^\s,()]+)", re.IGNORECASE)


@array_dataclass()
class _Series:
    """A channel: its title, first line, unit, step [s], and numbers in the unit of the file."""

    title: str
    head: int
    unit: str
    dt: float
    numbers: Floats


def _read_cosmos(lines: Lines, stated: Stated) -> GroundMotion:
    """A channel of a record of version 1.x: text, integer and real header, comments, then a series.

    A line before each header and series states how many numbers follow and in which Fortran format ("COSMOS Strong
    Motion Data Format", version 1.20, 2001).
    """
    channels: list[_Series] = []
    place = 0
    while place < len(lines.texts):
        title = _FIRST.search(lines.at(place))
        if title is None:
            place += 1
        else:
            series, place = _series_cosmos(lines, place, title)
            channels.append(series)
    number = chosen_channel(lines.path, [quote_text(series.title) for series in channels], stated)
    chosen = channels[number]
    if "acceleration" not in chosen.title.lower():
        raise RecordError(
            f"{lines.where(chosen.head)}: the series is '{quote_text(chosen.title)}'; give one of acceleration"
        )
    if chosen.unit.lower().startswith("c") and not chosen.unit.lower().startswith("cm"):
        raise RecordError(
            f"{lines.where(chosen.head)}: the series is in counts of the recorder; give the uncorrected or "
            "corrected acceleration of the same record, which are in physical units"
        )
    factor = factor_to_si(chosen.unit, "acceleration", context=lines.where(chosen.head))
    return make_motion(
        lines.path,
        name=lines.path.stem if stated.channel is None else f"{lines.path.stem}_{stated.channel}",
        dt=chosen.dt,
        acceleration=factor * chosen.numbers,
        source=f"{' '.join(lines.at(chosen.head + 4).split())}, {quote_text(chosen.title)}",
    )


def _series_cosmos(lines: Lines, head: int, title: re.Match[str]) -> tuple[_Series, int]:
    """Series of the channel whose text header begins at `head` with its title, and the index of the line after it."""
    place = head + int(title[1])
    _, place = _block_cosmos(lines, place, "integer header")
    real, place = _block_cosmos(lines, place, "real header")
    comments = _COMMENTS.match(lines.at(place))
    if comments is not None:
        place += 1 + int(comments[1])
    unit = _UNIT.search(lines.at(place))
    numbers, end = _block_cosmos(lines, place, "series")
    if unit is None:
        raise RecordError(f"{lines.where(place)}: expected 'units=', found '{quote_text(lines.at(place))}'")
    series = _Series(
        title=lines.at(head)[: title.start()].strip(),
        head=head,
        unit=unit[1],
        dt=_step_cosmos(lines, real),
        numbers=numbers,
    )
    return series, end


def _block_cosmos(lines: Lines, place: int, what: str) -> tuple[Floats, int]:
    """Numbers announced by the line at `place`, at fixed widths, and the index of the line after them."""
    announced = _BLOCK.match(lines.at(place))
    if announced is None:
        raise RecordError(
            f"{lines.where(place)}: expected the line before the {what}, which states how many numbers follow and in "
            f"which format, found '{quote_text(lines.at(place))}'; the file is cut off or damaged"
        )
    n_numbers, per_line, width = (int(announced[group]) for group in (1, 2, 3))
    rows = range(place + 1, place + 1 + -(-n_numbers // max(per_line, 1)))
    numbers = _numbers_at(lines, rows, width, what, per_line=per_line)
    if len(numbers) != n_numbers:
        raise RecordError(
            f"{lines.where(place)} announces {n_numbers} numbers of the {what}, {len(numbers)} follow; the file is "
            "cut off or damaged, fetch it again"
        )
    return np.array(numbers), rows.stop


def _step_cosmos(lines: Lines, real: Floats) -> float:
    if real.size >= _PROCESSED_STEP:
        for step in (1e-3 * real[_PROCESSED_STEP - 1], real[_RECORDER_STEP - 1]):
            if step > 0.0:
                return float(step)
    raise RecordError(
        f"{lines.path}: the real header states no step between samples (values {_PROCESSED_STEP} and "
        f"{_RECORDER_STEP}, -999 where unknown); save the series as two columns, time and acceleration"
    )


COSMOS = Format(
    name="a COSMOS record",
    recognises=lambda lines: _FIRST.search(lines.at(0)) is not None,
    read=_read_cosmos,
    needs=frozenset({"channel"}),
)


_KEY = re.compile(r"([A-Z][A-Z0-9_/^]*):\s*(.*?)\s*")


def _recognises_esm(lines: Lines) -> bool:
    return lines.at(0).startswith("EVENT_") and any(
        text.startswith("SAMPLING_INTERVAL_S:") for text in lines.texts[:100]
    )


def _read_esm(lines: Lines, stated: Stated) -> GroundMotion:
    """A record in DYNA 1.x ASCII: about 64 lines `KEY: value`, then one acceleration per line."""
    header: dict[str, tuple[int, str]] = {}
    first = 0
    while match := _KEY.fullmatch(lines.at(first)):
        header[match[1]] = (first, match[2])
        first += 1
    # Old files do not state the type; their unit decides.
    kind_line, kind = header.get("DATA_TYPE", (0, "ACCELERATION"))
    if kind.upper() != "ACCELERATION":
        raise RecordError(
            f"{lines.where(kind_line)}: the record holds {quote_text(kind).lower()}; give the file of its acceleration"
        )
    unit_line, unit = _entry_esm(lines, header, "UNITS")
    factor = factor_to_si(unit, "acceleration", context=lines.where(unit_line))
    dt = _number_esm(lines, header, "SAMPLING_INTERVAL_S")
    n_time = _number_esm(lines, header, "NDATA")
    numbers = read_numbers(lines, first)
    if numbers.size != n_time:
        _refuse_cut(lines, f"the header announces {n_time:g} samples", numbers)
    parts = [
        header.get(key, (0, ""))[1] for key in ("EVENT_NAME", "EVENT_DATE_YYYYMMDD", "STATION_CODE", "STREAM")
    ]
    title = ", ".join(part for part in parts if part)
    return make_motion(lines.path, dt=dt, acceleration=factor * numbers, source=title)


def _entry_esm(lines: Lines, header: dict[str, tuple[int, str]], key: str) -> tuple[int, str]:
    if key not in header:
        raise RecordError(f"{lines.path}: the header of this ESM record has no '{key}'; fetch the file again")
    return header[key]


def _number_esm(lines: Lines, header: dict[str, tuple[int, str]], key: str) -> float:
    index, text = _entry_esm(lines, header, key)
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 0.0 < value < float("inf"):
        raise RecordError(
            f"{lines.where(index)}: {key} is '{quote_text(text)}' where a positive number was expected; the header "
            "of this ESM record is damaged"
        )
    return value


ESM = Format(name="an ESM record", recognises=_recognises_esm, read=_read_esm)


_LONGEST_HEADER = 20
_LABEL = 18
_NUMBER_KNET = r"([0-9]+(?:\.[0-9]*)?(?:[eE][+-]?[0-9]+)?)"
_RATE = re.compile(rf"{_NUMBER_KNET}\s*Hz", re.IGNORECASE)
_DURATION = re.compile(_NUMBER_KNET)
_SCALE = re.compile(rf"{_NUMBER_KNET}\s*\(gal\)\s*/\s*{_NUMBER_KNET}", re.IGNORECASE)


def _recognises_knet(lines: Lines) -> bool:
    return lines.at(0).startswith("Origin Time") and any(
        lines.at(index).startswith("Scale Factor") for index in range(_LONGEST_HEADER)
    )


def _read_knet(lines: Lines, stated: Stated) -> GroundMotion:
    """A record of 17 header lines, then counts of the recorder, times a scale factor such as `3920(gal)/6182761`.

    The published peak refers to the mean (National Research Institute for Earth Science and Disaster Resilience, "About
    K-NET ASCII format").
    """
    rate = float(_field_knet(lines, "Sampling Freq", _RATE, "100Hz")[1])
    duration = float(_field_knet(lines, "Duration Time", _DURATION, "108")[1])
    scale = _field_knet(lines, "Scale Factor", _SCALE, "3920(gal)/6182761")
    if rate <= 0.0 or float(scale[2]) <= 0.0:
        raise RecordError(f"{lines.path}: sampling frequency or scale factor is zero; the header is damaged")
    counts = read_numbers(lines, _line_knet(lines, "Memo") + 1)
    announced = duration * rate
    if not abs(counts.size - announced) < 0.5:
        header = f"the header announces {announced:g} samples ({duration:g} s at {rate:g} Hz)"
        _refuse_cut(lines, header, counts)
    acceleration = FACTORS["acceleration"]["gal"] * float(scale[1]) / float(scale[2]) * counts
    mean = float(np.mean(acceleration)) if acceleration.size else 0.0
    station, origin, direction = (
        lines.at(_line_knet(lines, label))[_LABEL:].strip()
        for label in ("Station Code", "Origin Time", "Dir.")
    )
    return make_motion(
        lines.path,
        # The extension states the direction of the record.
        name=lines.path.name.replace(".", "_"),
        dt=1.0 / rate,
        acceleration=acceleration - mean,
        source=f"K-NET or KiK-net, {origin}, station {station}, {direction}",
        changes=(f"mean of {mean:.4g} m/s2 taken out, the offset of the recorder",),
    )


def _line_knet(lines: Lines, label: str) -> int:
    for index in range(_LONGEST_HEADER):
        if lines.at(index).startswith(label):
            return index
    raise RecordError(
        f"{lines.path}: the header of this K-NET record has no line '{label}'; fetch the file again"
    )


def _field_knet(lines: Lines, label: str, pattern: re.Pattern[str], example: str) -> re.Match[str]:
    index = _line_knet(lines, label)
    text = lines.at(index)[_LABEL:]
    match = pattern.search(text)
    if match is None:
        raise RecordError(
            f"{lines.where(index)}: expected '{label}' such as '{example}', found '{quote_text(text)}'; the header "
            "of this K-NET record is damaged"
        )
    return match


K_NET = Format(name="a K-NET record", recognises=_recognises_knet, read=_read_knet)
