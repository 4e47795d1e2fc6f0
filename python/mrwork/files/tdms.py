"""Channels of National Instruments' .tdms files, by npTDMS."""

from __future__ import annotations

import hashlib
import io
import logging
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final
from warnings import warn

import numpy as np

from mrwork.errors import MrworkWarning, RecordError, reason_of
from mrwork.files.column_names import unit_in_name
from mrwork.files.named_columns import ColumnTable, VectorTable, unused_parts
from mrwork.store.input_file import RECORD, bytes_of

_UNIT_PROPERTIES: Final = ("unit_string", "NI_UnitDescription", "Unit", "unit")
_TIME: Final = "Time"


def open_tdms(path: Path) -> ColumnTable:
    """Open a .tdms file; the columns are its numeric channels, with the units that they state.

    Channels of several groups are called GROUP/CHANNEL where names are in several. Where no channel is a time, one is
    made from the increment that all channels share.
    """
    try:
        from nptdms import TdmsFile
    except ImportError as error:
        raise RecordError(
            f"{path}: reading TDMS needs npTDMS; run: pip install 'mrwork[tdms]', or export the channels as text"
        ) from error
    data = bytes_of(path, RECORD)
    try:
        with _reports() as reports, TdmsFile.open(io.BytesIO(data)) as file:
            channels = [channel for group in file.groups() for channel in group.channels()]
            # No sample takes less than a byte, whatever a damaged header claims.
            if sum(len(channel) for channel in channels) > len(data):
                raise ValueError("it claims more samples than it has bytes")
            occurs = Counter(channel.name for channel in channels)
            names = [
                each.name if occurs[each.name] == 1 else f"{each.group_name}/{each.name}" for each in channels
            ]
            read = {name: np.asarray(each[:]) for name, each in zip(names, channels, strict=True)}
            units = {name: _unit(each) for name, each in zip(names, channels, strict=True)}
            steps = {_waveform(each) for each in channels if len(each)}
    except Exception as error:  # the library raises whatever a damaged file leads it to
        raise RecordError(f"{path}: not a readable .tdms file ({reason_of(error)}); save it again") from error
    if reports:
        warn(
            f"{path}: npTDMS reports: {reports[0]}; check that no samples are missing, or save it again",
            MrworkWarning,
            stacklevel=3,
        )
    for name, vector in read.items():
        if vector.dtype.kind == "M" and vector.size:
            # Time stamps as seconds since the first.
            read[name], units[name] = (vector - vector[0]) / np.timedelta64(1, "s"), "s"
    vectors = {name: vector for name, vector in read.items() if vector.dtype.kind in "iuf" and vector.size}
    if not vectors:
        raise RecordError(f"{path}: has no channel of numbers; expected one for each quantity")
    if not any(unit_in_name("time", name) is not None for name in vectors) and len(steps) == 1:
        (waveform,) = steps
        if waveform is not None:
            start, step, count = waveform
            vectors = {_TIME: start + step * np.arange(count), **vectors}
            units[_TIME] = "s"
    return VectorTable(
        source=str(path),
        sha256=hashlib.sha256(data).hexdigest(),
        vectors=vectors,
        units={name: unit for name, unit in units.items() if unit},
        unused=unused_parts("channel", [f"'{name}'" for name in read if name not in vectors], "no numbers"),
    )


@contextmanager
def _reports() -> Iterator[list[str]]:
    """What npTDMS logs meanwhile."""
    kept = _Kept(logging.WARNING)
    # Each of its modules has a logger of its own, which prints on stderr.
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] == "nptdms"]
    before = [(logger, logger.handlers, logger.propagate) for logger in map(logging.getLogger, names)]
    for logger, _, _ in before:
        logger.handlers, logger.propagate = [kept], False
    try:
        yield kept.messages
    finally:
        for logger, handlers, propagate in before:
            logger.handlers, logger.propagate = handlers, propagate


class _Kept(logging.Handler):
    """Keeps messages."""

    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.messages: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the text of a message."""
        self.messages.append(record.getMessage())


def _unit(channel: Any) -> str:
    known = (str(channel.properties.get(name, "")).strip() for name in _UNIT_PROPERTIES)
    return next(filter(None, known), "")


def _waveform(channel: Any) -> tuple[float, float, int] | None:
    """Start and step [s] and number of samples of a channel that is sampled evenly."""
    step = channel.properties.get("wf_increment")
    if not isinstance(step, int | float) or not step > 0.0:
        return None
    return float(channel.properties.get("wf_start_offset", 0.0)), float(step), len(channel)
