"""The ground motions of a study: read, given or synthetic, then cut, corrected, stretched and scaled in that order.

Controllers are tuned on training motions and judged on test motions; no record may be both.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TypeVar

import numpy as np

from mrwork.base.places import keyed, read_each
from mrwork.base.remark import Remark
from mrwork.base.summary import named
from mrwork.base.units import STANDARD_GRAVITY, factor_to_si
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.files.roles import Stated
from mrwork.motions import GroundMotion
from mrwork.motions.examination import force_remarks, refuse_absurd, unfelt_ground
from mrwork.motions.forces import read_forces, shares_of, with_forces
from mrwork.motions.ground_motion import (
    baseline_corrected,
    check_samples,
    copies_among,
    correlation_of_motions,
    examined,
    force_motion,
    is_copy,
    refuse_floors,
    replace_samples,
    resampled,
    scaled,
    time_scaled,
    trimmed,
)
from mrwork.motions.read import motion_files, motion_of_file
from mrwork.motions.roads import iso_8608_road, road_of_file
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi, SoilSpectrum
from mrwork.motions.spectrum import Intensity, scaled_from, spectral_intensity
from mrwork.motions.synthetic import suite, synthetic_motion
from mrwork.motions.targets import TargetSpectrum, scaled_to_target
from mrwork.study.schema import MotionTable
from mrwork.study.study import MotionFacts, MotionOfStudy

_SYNTHETIC_STEP, _ROAD_STEP, _SYNTHETIC_DURATION = 0.01, 0.001, 30.0

T = TypeVar("T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Aims:
    """What motions are scaled to: periods of the building without dampers and of the target, if there is one [s].

    Forces are compared with the `weight` of the building [N], which may have nothing that `follows_ground`.
    """

    first_period: float
    weight: float
    target_period: float
    target: TargetSpectrum | None = None
    follows_ground: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class BareMotion:
    """A motion before it is scaled: its table and the number of that, its file, and what is doubtful of the record."""

    ground: GroundMotion
    table: MotionTable
    number: int
    file: Path | None
    remarks: tuple[Remark, ...]


def bare_motions(
    table: MotionTable, number: int, folder: Path, seed: int, floors: Sequence[str]
) -> list[BareMotion]:
    """The motions of a table, of this number, before they are scaled; names of files are relative to `folder`.

    Forces are on the `floors` of the building.
    """
    grounds = [*_grounds(table, folder, seed, floors)]
    # What is doubtful of the size of a record only where the motion keeps it, also with its largest factor.
    factor = max(map(abs, _several(table.factor)), default=0.0) or 1.0
    is_scaled = any(value is not None for value in (table.pga, table.sa, table.scale_to))
    bare = list[BareMotion]()
    for ground, file in grounds:
        refuse_floors(ground, floors)
        largest = replace(ground, acceleration=factor * ground.acceleration)
        remarks = () if table.is_synthetic else examined(largest, scaled=is_scaled)
        done = _process(ground, table)
        bare.append(BareMotion(ground=done, table=table, number=number, file=file, remarks=remarks))
    return bare


def motions_of_study(read: Sequence[BareMotion], aims: Aims) -> tuple[MotionOfStudy, ...]:
    """The motions of a study, one for each factor or intensity of each record."""
    _refuse_both_uses(read)
    copies = copies_among([entry.ground for entry in read])
    names = {copy: read[first].ground.name for copy, first in copies.items()}
    of_each = read_each(
        lambda number: _scaled_motions(read[number], aims, names.get(number, "")), range(len(read))
    )
    motions = tuple(motion for of_one in of_each for motion in of_one)
    if not motions:
        raise SettingError("the study has no motion; give a [[motion]]")
    if all(motion.facts.use == "training" for motion in motions):
        raise InvalidSettingError(
            "motion",
            "every motion is for training, and none is left to judge the controllers on; give a [[motion]] "
            'use = "test"',
        )
    refuse_same([motion.ground.name for motion in motions], "motion", "motions", "name")
    return motions


def refuse_same(names: Sequence[str], table: str, what: str, key: str) -> None:
    """Refuse a name that stands twice; the message calls the things `what`, and asks for another `key`."""
    twice = next((name for name, count in Counter(names).items() if count > 1), None)
    if twice is not None:
        raise InvalidSettingError(table, f"two {what} are called {twice!r}; give one of them another {key}")


def _scaled_motions(bare: BareMotion, aims: Aims, copy_of: str) -> list[MotionOfStudy]:
    with keyed("motion", bare.number):
        if not (bare.ground.acceleration.any() or bare.ground.forces.any()):
            # Scores divide by the response at i = 0.
            raise SettingError(
                f"motion {bare.ground.name!r} is zero throughout, and has no response; leave it out"
            )
        scaled = list(_scale(bare.ground, bare.table, aims))
        for ground, *_ in scaled:
            if not ground.is_road:
                refuse_absurd(ground.acceleration, source=f"motion {ground.name!r}")
    return [
        MotionOfStudy(
            ground=ground,
            facts=MotionFacts(
                **named(
                    ground, "name", "peak", "peak_force", "duration", "source", "changes", "groups", "is_road"
                ),
                use=bare.table.use,
                synthetic=bare.table.is_synthetic,
                record=bare.ground.name,
                intensity=intensity,
                level=intensity.in_words if factor is None else f"factor {factor:g}",
                copy_of=copy_of,
            ),
            factor=factor,
            remarks=(
                *bare.remarks,
                *force_remarks(ground.name, ground.forces, ground.dt, aims.weight, aims.first_period),
                *unfelt_ground(ground.name, ground.peak, follows=aims.follows_ground),
            ),
        )
        for ground, intensity, factor in scaled
    ]


def _grounds(
    table: MotionTable, folder: Path, seed: int, floors: Sequence[str]
) -> Iterator[tuple[GroundMotion, Path | None]]:
    """The motions of a table with their forces, each with its file."""
    forced = path = None
    if table.force is not None:
        path = folder / table.force
        with keyed("floor" if table.shape is None else "shape"):
            shares = shares_of(floors, table.floor, table.shape)
        with keyed("force"):
            # Beside a ground, unit and step are of the ground.
            stated = named(table, "unit", "dt")
            forced = read_forces(path, floors, shares=shares, **stated, alone=table.ground is None)
    elif table.forces is not None and table.ground is None:
        with keyed("forces"):
            size = factor_to_si(table.unit or "N", "force", context="unit")
            forces, step = size * np.array(table.forces), table.dt or _SYNTHETIC_STEP
            forced = force_motion(forces, step, name=table.name or "forces")
    if table.ground is None and forced is not None:
        yield replace(forced, name=table.name or forced.name), path and path.resolve()
        return
    for ground, file in _unforced(table, folder, seed):
        with keyed("forces" if forced is None else "force"):
            if forced is not None:
                yield with_forces(ground, forced), file
            elif table.forces is not None:
                yield replace(ground, forces=np.array(table.forces)), file
            else:
                yield ground, file


def _unforced(table: MotionTable, folder: Path, seed: int) -> Iterator[tuple[GroundMotion, Path | None]]:
    """The motions of the ground, each with its file."""
    file, seed, step = table.file, seed + table.seed, table.dt or _SYNTHETIC_STEP
    of_seed = f", seed {table.seed}" if table.seed else ""
    if isinstance(file, str):
        stated = Stated(**named(table, "unit", "dt", "column", "channel"))
        with keyed("file"):
            paths = motion_files(folder / file)
            for path in paths:
                motion = motion_of_file(path, stated)
                name = table.name if len(paths) == 1 else f"{table.name}, {motion.name}"
                yield replace(motion, name=name) if table.name else motion, path.resolve()
    elif table.road is not None:
        with keyed("road"):
            path = folder / table.road
            road = road_of_file(path, **named(table, "speed", "unit", "column", "dt"))
            yield replace(road, name=table.name or road.name), path.resolve()
    elif isinstance(file, GroundMotion):
        yield replace(file, name=table.name or file.name), None
    elif table.suite is not None:
        with keyed("suite"):
            for motion in suite(**table.suite.of(suite), rng=seed, dt=step, name=table.name):
                yield motion, None
    elif table.road_class is not None and table.speed is not None:
        duration = table.duration or _SYNTHETIC_DURATION
        road = iso_8608_road(
            table.road_class, speed=table.speed, rng=seed, duration=duration, dt=table.dt or _ROAD_STEP
        )
        yield replace(road, name=table.name or road.name + of_seed), None
    elif table.synthetic is not None:
        duration = table.duration or _SYNTHETIC_DURATION
        name = table.name or table.synthetic.replace("_", "-").title() + of_seed
        yield synthetic_motion(_spectrum(table), rng=seed, duration=duration, dt=step, name=name), None
    else:
        size = factor_to_si(table.unit or "m/s2", "acceleration", context="unit")
        samples = size * np.array(table.acceleration)
        yield GroundMotion(name=table.name or "motion", dt=step, acceleration=samples), None


def _refuse_both_uses(bare: Sequence[BareMotion]) -> None:
    """Refuse a training motion that is a test motion, or a copy of one under another name."""
    of_test, of_training = (
        [motion for motion in bare if motion.table.use == use] for use in ("test", "training")
    )
    for judged, trained in product(of_test, of_training):
        names = f"training motion {trained.ground.name!r} and test motion {judged.ground.name!r}"
        remedy = "controllers must be judged on motions that they were not tuned on; leave one out"
        channels = [(motion.file, motion.table.column, motion.table.channel) for motion in (judged, trained)]
        with keyed("motion", judged.number):
            if judged.file is not None and channels[0] == channels[1]:
                raise SettingError(f"{names} are of one file, {judged.file.name}; {remedy}")
            if is_copy(judged.ground, trained.ground):
                samples = "accelerations" if judged.ground.peak else "forces"
                raise SettingError(
                    f"{names} are one record: their {samples} agree after a shift and a factor, correlation "
                    f"{correlation_of_motions(judged.ground, trained.ground):.3f}; {remedy}"
                )


def _spectrum(table: MotionTable) -> SoilSpectrum:
    soil = table.soil
    if soil is None:
        return KanaiTajimi() if table.synthetic == "kanai_tajimi" else CloughPenzien()
    ground = KanaiTajimi(**soil.of(KanaiTajimi))
    if table.synthetic == "kanai_tajimi":
        soil.refuse_others((KanaiTajimi,), "belongs to clough_penzien", "leave it out")
        return ground
    return CloughPenzien(soil=ground, **soil.of(CloughPenzien))


def _process(motion: GroundMotion, table: MotionTable) -> GroundMotion:
    if table.group:
        motion = replace(motion, groups=(*_several(table.group), *motion.groups))
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
        added = round(table.rest / motion.dt)
        longer, forces = np.pad(motion.acceleration, (0, added)), np.pad(motion.forces, ((0, 0), (0, added)))
        change = f"{table.rest:g} s at rest added"
        motion = replace_samples(motion, longer, motion.dt, change, forces=forces)
    return motion


def _scale(
    motion: GroundMotion, table: MotionTable, aims: Aims
) -> Iterator[tuple[GroundMotion, Intensity, float | None]]:
    """The motion at each of its factors or intensities, with what it then has of its measure, and with the factor."""
    period, damping = None, 0.05 if table.sa_damping is None else table.sa_damping
    if table.sa is not None:
        period = table.sa_period or aims.first_period
    elif table.scale_to is not None:
        if aims.target is None:
            raise SettingError("scale_to wants a target, and the study has none; give a [target]")
        damping = aims.target.damping
        period = None if table.scale_to == "pga" else aims.target_period
        motion = scaled_to_target(motion, aims.target, by=table.scale_to, period=period)
    intensity = Intensity(measure="pga", value=motion.peak)
    if motion.forces.size and not motion.peak:
        intensity = Intensity(measure="force", value=motion.peak_force)
    if period is not None:
        intensity = spectral_intensity(motion, period, damping)
    factors, values = _several(table.factor), _several(table.pga) or _several(table.sa)
    is_one = len(factors or values) == 1
    if not factors and not values:
        yield motion, intensity, None
    for factor in factors:
        ground = scaled(motion, factor)
        ground = ground if is_one else replace(ground, name=f"{motion.name} x {factor:g}")
        yield ground, replace(intensity, value=abs(factor) * intensity.value), factor
    for value in values:
        level = f"{'' if table.sa is None else 'Sa '}{value / STANDARD_GRAVITY:.3g} g"
        name = motion.name if is_one else f"{motion.name}, {level}"
        ground = replace(scaled_from(motion, intensity, value), name=name, groups=(*motion.groups, level))
        yield ground, replace(intensity, value=value), None


def _several(value: T | tuple[T, ...] | None) -> tuple[T, ...]:
    return () if value is None else value if isinstance(value, tuple) else (value,)
