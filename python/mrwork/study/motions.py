"""Ground motions of a study: read or synthetic, then cut, corrected, stretched and scaled in that order."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from mrwork.motions import GroundMotion
from mrwork.motions.processing import (
    baseline_corrected,
    resampled,
    scaled,
    scaled_to_peak,
    time_scaled,
    trimmed,
)
from mrwork.motions.read import read_motion
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi, SpectralDensity
from mrwork.motions.synthetic import synthetic_motion
from mrwork.study.declared import located
from mrwork.study.schema import MotionTable
from mrwork.units import STANDARD_GRAVITY

_SYNTHETIC_STEP = 0.01


def motions_of(table: MotionTable, folder: Path, seed: int) -> tuple[GroundMotion, ...]:
    """One motion for each factor or peak of a table; paths of files are relative to `folder`.

    Raises
    ------
    SettingError
        If the table contradicts itself or its file cannot be read; the message has the line.
    """
    place = table.place
    if (table.file is None) == (table.synthetic is None):
        place.refuse(f"{place.table} needs either a file or a synthetic motion")
    if table.factor is not None and table.pga is not None:
        place.within("pga").refuse("a motion is scaled by factor or to a pga; keep one")
    bare = _synthetic(table, seed) if table.file is None else _read(table, table.file, folder)
    with located(place):
        whole = _processed(bare, table)
        return tuple(_scaled(whole, table))


def _read(table: MotionTable, file: str, folder: Path) -> GroundMotion:
    with located(table.place.within("file")):
        return read_motion(
            folder / file, unit=table.unit, dt=table.dt, column=table.column, channel=table.channel
        )


def _synthetic(table: MotionTable, seed: int) -> GroundMotion:
    for name in ("unit", "column", "channel"):
        if getattr(table, name) is not None:
            table.place.within(name).refuse(
                f"{name} is for files, and this motion is synthetic; leave it out"
            )
    with located(table.place):
        return synthetic_motion(
            _spectrum(table),
            rng=seed + table.seed,
            duration=table.duration,
            dt=table.dt or _SYNTHETIC_STEP,
            name=table.name or (table.synthetic or "").replace("_", "-").title(),
        )


def _spectrum(table: MotionTable) -> SpectralDensity:
    soil = table.soil
    if soil is None:
        return KanaiTajimi() if table.synthetic == "kanai_tajimi" else CloughPenzien()
    firm, filtered = KanaiTajimi(), CloughPenzien()
    ground = KanaiTajimi(
        frequency=soil.frequency or firm.frequency,
        damping=soil.damping or firm.damping,
        intensity=soil.intensity or firm.intensity,
    )
    if table.synthetic == "kanai_tajimi":
        for name in ("high_pass_frequency", "high_pass_damping"):
            if getattr(soil, name) is not None:
                soil.place.within(name).refuse(f"{name} belongs to clough_penzien; leave it out")
        return ground
    return CloughPenzien(
        soil=ground,
        frequency=soil.high_pass_frequency or filtered.frequency,
        damping=soil.high_pass_damping or filtered.damping,
    )


def _processed(motion: GroundMotion, table: MotionTable) -> GroundMotion:
    if table.name:
        motion = replace(motion, name=table.name)
    if table.start > 0.0 or table.end is not None:
        motion = trimmed(motion, start=table.start, end=math.inf if table.end is None else table.end)
    if table.baseline is not None:
        motion = baseline_corrected(motion, order=table.baseline)
    if table.time_scale != 1.0:
        motion = time_scaled(motion, table.time_scale)
    if table.resample is not None:
        motion = resampled(motion, table.resample)
    if table.rest > 0.0:
        still = np.zeros(round(table.rest / motion.dt))
        motion = replace(
            motion,
            acceleration=np.concatenate([motion.acceleration, still]),
            changes=(*motion.changes, f"{table.rest:g} s at rest added"),
        )
    return motion


def _scaled(motion: GroundMotion, table: MotionTable) -> Iterator[GroundMotion]:
    factors, peaks = _several(table.factor), _several(table.pga)
    if not factors and not peaks:
        yield motion
    for factor in factors:
        name = motion.name if len(factors) == 1 else f"{motion.name} x {factor:g}"
        yield replace(scaled(motion, factor), name=name)
    for peak in peaks:
        name = motion.name if len(peaks) == 1 else f"{motion.name}, {peak / STANDARD_GRAVITY:.3g} g"
        yield replace(scaled_to_peak(motion, peak), name=name)


def _several(given: float | tuple[float, ...] | None) -> tuple[float, ...]:
    return () if given is None else given if isinstance(given, tuple) else (given,)
