"""Ground motions of a study: read or synthetic, then cut, corrected, stretched and scaled in that order.

Controllers are tuned on training motions and judged on test motions; no record may be both.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.motions.ground_motion import (
    baseline_corrected,
    check_samples,
    is_copy,
    likeness,
    resampled,
    scaled,
    scaled_to_peak,
    time_scaled,
    trimmed,
)
from mrwork.motions.read import motion_files, read_motion
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi, SpectralDensity
from mrwork.motions.synthetic import suite, synthetic_motion
from mrwork.study.schema import MotionTable, SuiteTable
from mrwork.study.study import MotionOfStudy
from mrwork.units import STANDARD_GRAVITY

_SYNTHETIC_STEP, _SYNTHETIC_DURATION = 0.01, 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Bare:
    """A motion of a table before it is scaled, and the file that it was read from."""

    ground: GroundMotion
    table: MotionTable
    file: Path | None


def motions_of_study(
    tables: Sequence[MotionTable], folder: Path, seed: int, *, sample_time: float
) -> tuple[MotionOfStudy, ...]:
    """The motions of all tables, one for each factor or peak of each record; files are relative to `folder`."""
    bare = [each for table in tables for each in _bare_motions(table, folder, seed)]
    _refuse_both_uses(bare)
    motions: list[MotionOfStudy] = []
    for each in bare:
        _refuse_still(each, sample_time)
        with each.table.place.prefix_errors(SettingError):
            motions += [
                MotionOfStudy(ground=ground, use=each.table.use, synthetic=each.file is None)
                for ground in _scale(each.ground, each.table)
            ]
    return tuple(motions)


def _bare_motions(table: MotionTable, folder: Path, seed: int) -> Iterator[_Bare]:
    place = table.place
    if sum(each is not None for each in (table.file, table.synthetic, table.suite)) != 1:
        place.refuse(f"{place.table} needs either a file, a synthetic motion or a suite")
    if table.factor is not None and table.pga is not None:
        place.within("pga").refuse("a motion is scaled by factor or to a pga; keep one")
    if table.file is not None:
        bare = _read(table, table.file, folder)
    else:
        _refuse_keys(table, ("unit", "column", "channel"), "is for files, and this motion is synthetic")
        bare = _suite(table, table.suite, seed) if table.suite else _synthetic(table, seed)
    for ground, file in bare:
        with place.prefix_errors(SettingError):
            yield _Bare(ground=_process(ground, table), table=table, file=file)


def _refuse_keys(table: MotionTable, names: Sequence[str], reason: str) -> None:
    for name in names:
        if getattr(table, name) is not None:
            table.place.within(name).refuse(f"{name} {reason}; leave it out")


_Found = list[tuple[GroundMotion, Path | None]]


def _read(table: MotionTable, file: str, folder: Path) -> _Found:
    with table.place.within("file").prefix_errors(SettingError):
        files = motion_files(folder / file)
        bare: _Found = []
        for path in files:
            motion = read_motion(
                path, unit=table.unit, dt=table.dt, column=table.column, channel=table.channel
            )
            if table.name:
                name = table.name if len(files) == 1 else f"{table.name}, {motion.name}"
                motion = replace(motion, name=name)
            bare.append((motion, path.resolve()))
    return bare


def _suite(table: MotionTable, suite_table: SuiteTable, seed: int) -> _Found:
    _refuse_keys(table, ("duration", "soil"), "is for a single synthetic motion, and this is a suite")
    with suite_table.place.prefix_errors(SettingError):
        drawn = suite(
            suite_table.soils,
            suite_table.motions,
            rng=seed + table.seed,
            pulses=suite_table.pulses,
            dt=table.dt or _SYNTHETIC_STEP,
            name=table.name,
        )
    return [(motion, None) for motion in drawn]


def _synthetic(table: MotionTable, seed: int) -> _Found:
    with table.place.prefix_errors(SettingError):
        motion = synthetic_motion(
            _spectrum(table),
            rng=seed + table.seed,
            duration=table.duration or _SYNTHETIC_DURATION,
            dt=table.dt or _SYNTHETIC_STEP,
            name=table.name or (table.synthetic or "").replace("_", "-").title(),
        )
    return [(motion, None)]


def _refuse_both_uses(bare: Sequence[_Bare]) -> None:
    """Refuse a training motion that is a test motion, or a copy of one under another name."""
    training = [each for each in bare if each.table.use == "training"]
    for test in bare if training else ():
        if test.table.use == "training":
            continue
        for other in training:
            names = f"training motion {other.ground.name!r} and test motion {test.ground.name!r}"
            remedy = "controllers must be judged on motions that they were not tuned on; leave one out"
            channels = [(each.file, each.table.column, each.table.channel) for each in (test, other)]
            if test.file is not None and channels[0] == channels[1]:
                test.table.place.refuse(f"{names} are of one file, {test.file.name}; {remedy}")
            if is_copy(test.ground, other.ground):
                test.table.place.refuse(
                    f"{names} are one record: their accelerations agree after a shift and a factor, correlation "
                    f"{likeness(test.ground, other.ground):.3f}; {remedy}"
                )


def _refuse_still(bare: _Bare, sample_time: float) -> None:
    """Refuse a motion without a response: scores divide by that at i = 0."""
    name, duration = bare.ground.name, bare.ground.duration
    if duration < sample_time:
        bare.table.place.refuse(
            f"motion {name!r} lasts {duration:.3g} s, less than a sample of the law, {sample_time:g} s; give a longer "
            "one, or a shorter sample_time of the [hardware]"
        )
    if not bare.ground.acceleration.any():
        bare.table.place.refuse(
            f"motion {name!r} is zero throughout, so nothing moves and no score exists; leave it out"
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


def _process(motion: GroundMotion, table: MotionTable) -> GroundMotion:
    if table.group:
        motion = replace(motion, groups=(table.group, *motion.groups))
    if table.start > 0.0 or table.end is not None:
        motion = trimmed(motion, start=table.start, end=math.inf if table.end is None else table.end)
    if table.baseline is not None:
        motion = baseline_corrected(motion, order=table.baseline)
    if table.time_scale != 1.0:
        motion = time_scaled(motion, table.time_scale)
    if table.resample is not None:
        motion = resampled(motion, table.resample)
    if table.rest > 0.0:
        check_samples(motion.duration + table.rest, motion.dt)
        still = np.zeros(round(table.rest / motion.dt))
        motion = replace(
            motion,
            acceleration=np.concatenate([motion.acceleration, still]),
            changes=(*motion.changes, f"{table.rest:g} s at rest added"),
        )
    return motion


def _scale(motion: GroundMotion, table: MotionTable) -> Iterator[GroundMotion]:
    factors, peaks = _several(table.factor), _several(table.pga)
    if not factors and not peaks:
        yield motion
    for factor in factors:
        name = motion.name if len(factors) == 1 else f"{motion.name} x {factor:g}"
        yield replace(scaled(motion, factor), name=name)
    for peak in peaks:
        level = f"{peak / STANDARD_GRAVITY:.3g} g"
        name = motion.name if len(peaks) == 1 else f"{motion.name}, {level}"
        yield replace(scaled_to_peak(motion, peak), name=name, groups=(*motion.groups, level))


def _several(given: float | tuple[float, ...] | None) -> tuple[float, ...]:
    return () if given is None else given if isinstance(given, tuple) else (given,)
