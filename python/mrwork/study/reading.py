"""Read a study file, or the document of a call, into a study that is ready to run; errors have the place of the key.

Its ground motions are read or synthetic, then cut, corrected, stretched and scaled in that order. Controllers are tuned
on training motions and judged on test motions; no record may be both.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.base.documents import read_table
from mrwork.base.keys import Arguments, suggestion
from mrwork.base.places import KeyPath, Place, all_mistakes, read_each
from mrwork.base.summary import list_names
from mrwork.base.units import STANDARD_GRAVITY, factor_to_si
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.from_file import BuildingTable
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.evaluation import Scales, criterion
from mrwork.closed_loop.hardware import Hardware, refuse_unread
from mrwork.closed_loop.own_runs import beyond_twin
from mrwork.control.laws.control_law import control_laws
from mrwork.control.laws.law_problem import ReferencePeaks
from mrwork.dampers.tested_range import FittedDamper
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.motions.examination import refuse_absurd
from mrwork.motions.ground_motion import (
    baseline_corrected,
    check_samples,
    copies_among,
    examined,
    is_copy,
    likeness,
    resampled,
    scaled,
    time_scaled,
    trimmed,
)
from mrwork.motions.networks import Stated
from mrwork.motions.read import motion_files, motion_of_file
from mrwork.motions.spectral_density import CloughPenzien, KanaiTajimi, SpectralDensity
from mrwork.motions.spectrum import Intensity, scaled_from, spectral_intensity
from mrwork.motions.synthetic import suite, synthetic_motion
from mrwork.motions.targets import SuiteCheck, TargetSpectrum, check_suite, scaled_to_target
from mrwork.store.input_file import TOML, bytes_of, text_in
from mrwork.store.parse import toml_lines, toml_table
from mrwork.study.arrangements import (
    arrangements,
    problem_of,
    refuse_loose_settings,
    resolve_settings,
    running_in_words,
    settings_of_law,
)
from mrwork.study.course import StudyProgress
from mrwork.study.dampers import (
    ChosenDamper,
    Identified,
    choose_dampers,
    chosen_damper,
    equip_building,
    fitted_of,
    other_sets,
)
from mrwork.study.fragilities import limit_of
from mrwork.study.placements import Placed, placed_document
from mrwork.study.schema import (
    PASSIVE_OFF,
    DamperTable,
    MotionTable,
    ReportTable,
    StudyTable,
    target_spectrum,
)
from mrwork.study.study import (
    Kind,
    MotionOfStudy,
    Realisations,
    Row,
    Study,
    StudyFile,
    make_arrangement,
    realisations_of,
)

# What a row is that is designed for the motions, or chosen on them.
_DESIGNED: tuple[Kind, ...] = ("best_passive", "controller", "actuator")
_SYNTHETIC_STEP, _SYNTHETIC_DURATION = 0.01, 30.0
# A mode without stiffness has an infinite period up to rounding [s].
_LONGEST_PERIOD = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class Aims:
    """What motions are scaled to, read when one asks for it: target, its period [s], first period of the building."""

    target: Callable[[], TargetSpectrum]
    target_period: Callable[[], float]
    first_period: Callable[[], float]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Bare:
    """A motion of a table before it is scaled, the file that it was read from, and what is doubtful of the record."""

    ground: GroundMotion
    table: MotionTable
    file: Path | None
    warnings: tuple[str, ...]


def bare_motions(tables: Sequence[MotionTable], folder: Path, seed: int) -> list[_Bare]:
    """The motions of all tables before they are scaled; names of files are relative to `folder`."""
    of_tables = read_each(lambda table: _bare_motions(table, folder, seed), tables)
    return [each for of_table in of_tables for each in of_table]


def motions_of_study(
    read: Sequence[_Bare], *, sample_time: float, aims: Aims, place: Place
) -> tuple[MotionOfStudy, ...]:
    """The motions of a study, one for each factor or intensity of each record."""
    _refuse_both_uses(read)
    copies = copies_among([each.ground for each in read])
    names = {copy: read[first].ground.name for copy, first in copies.items()}
    scaled = read_each(
        lambda number: _scaled_motions(read[number], sample_time, aims, names.get(number, "")),
        range(len(read)),
    )
    motions = tuple(motion for of_one in scaled for motion in of_one)
    if not motions:
        place.refuse("the study has no motion; give a [[motion]]")
    if all(motion.use == "training" for motion in motions):
        place.within("motion").refuse(
            'every motion is for training, and none is left to judge the controllers on; give a [[motion]] use = "test"'
        )
    _refuse_same([motion.name for motion in motions], place.within("motion"), "motions", "name")
    return motions


def _scaled_motions(bare: _Bare, sample_time: float, aims: Aims, copy_of: str) -> list[MotionOfStudy]:
    _refuse_still(bare, sample_time)
    with bare.table.place.prefix_errors(SettingError):
        scaled = list(_scale(bare.ground, bare.table, aims))
        for ground, *_ in scaled:
            refuse_absurd(ground.acceleration, source=f"motion {ground.name!r}")
        return [
            MotionOfStudy(
                ground=ground,
                use=bare.table.use,
                synthetic=_is_synthetic(bare.table),
                record=bare.ground.name,
                intensity=intensity,
                factor=factor,
                copy_of=copy_of,
                warnings=bare.warnings,
            )
            for ground, intensity, factor in scaled
        ]


def _is_synthetic(table: MotionTable) -> bool:
    return table.synthetic is not None or table.suite is not None


def _bare_motions(table: MotionTable, folder: Path, seed: int) -> list[_Bare]:
    place = table.place
    ways = (table.file, table.acceleration, table.synthetic, table.suite)
    if sum(each is not None for each in ways) != 1:
        place.refuse(f"{place.table} needs either a file, samples, a synthetic motion or a suite")
    given = [name for name in ("factor", "pga", "sa", "scale_to") if getattr(table, name) is not None]
    if len(given) > 1 and given != ["factor", "scale_to"]:
        place.within(given[1]).refuse(
            "a motion is scaled by factor, pga, sa or scale_to, of which only scale_to takes a factor, too; keep one "
            f"of {list_names(given)}"
        )
    if table.sa is None:
        _refuse_keys(table, ("sa_period", "sa_damping"), "is of sa, which this motion does not have")
    if not _is_synthetic(table):
        _refuse_keys(table, ("duration", "soil", "seed"), "is of synthetic motions, and this one is given")
    if isinstance(table.file, str):
        grounds = _read_record(table, table.file, folder)
    elif not _is_synthetic(table):
        grounds = [(motion_of_samples(table), None)]
    else:
        _refuse_keys(table, ("unit", "column", "channel"), "is for files, and this motion is synthetic")
        grounds = _suite(table, table.suite, seed) if table.suite else _synthetic(table, seed)
    with place.prefix_errors(SettingError):
        return [
            _Bare(ground=_process(ground, table), table=table, file=file, warnings=_warnings(ground, table))
            for ground, file in grounds
        ]


def _warnings(ground: GroundMotion, table: MotionTable) -> tuple[str, ...]:
    """What is doubtful of a record; of its size only where the motion keeps it, also with its largest factor."""
    if _is_synthetic(table):
        return ()
    factor = max(map(abs, _several(table.factor)), default=0.0) or 1.0
    is_scaled = any(each is not None for each in (table.pga, table.sa, table.scale_to))
    return examined(replace(ground, acceleration=factor * ground.acceleration), scaled=is_scaled)


def _refuse_keys(table: MotionTable, names: Sequence[str], reason: str) -> None:
    for name in names:
        # A seed of 0 is as if none were given.
        if getattr(table, name) not in (None, 0):
            table.place.within(name).refuse(f"{name} {reason}; leave it out")


_Grounds = list[tuple[GroundMotion, Path | None]]


def _read_record(table: MotionTable, file: str, folder: Path) -> _Grounds:
    with table.place.within("file").prefix_errors(SettingError):
        files = motion_files(folder / file)
        grounds: _Grounds = []
        for path in files:
            motion = motion_of_file(
                path, Stated(unit=table.unit, dt=table.dt, column=table.column, channel=table.channel)
            )
            if table.name:
                name = table.name if len(files) == 1 else f"{table.name}, {motion.name}"
                motion = replace(motion, name=name)
            grounds.append((motion, path.resolve()))
    return grounds


def motion_of_samples(table: MotionTable) -> GroundMotion:
    """The motion that a table gives as a value or by its samples, with its own name."""
    place, given = table.place, table.file
    if isinstance(given, GroundMotion):
        _refuse_keys(
            table, ("unit", "dt", "column", "channel"), "is for files, and this motion is a GroundMotion"
        )
        with place.within("file").prefix_errors(SettingError):
            refuse_absurd(given.acceleration, source=given.name)
        return replace(given, name=table.name or given.name)
    _refuse_keys(table, ("column", "channel"), "is for files, and this motion is given by its samples")
    if table.dt is None:
        place.refuse(f"{place.table} has no dt of its samples; give it [s]")
    with place.prefix_errors(SettingError):
        acceleration = factor_to_si(table.unit or "m/s2", "acceleration", context="unit") * np.array(
            table.acceleration
        )
        refuse_absurd(acceleration, source="acceleration")
        return GroundMotion(name=table.name or "motion", dt=table.dt, acceleration=acceleration)


def _suite(table: MotionTable, given: Arguments, seed: int) -> _Grounds:
    _refuse_keys(table, ("duration", "soil"), "is for a single synthetic motion, and this is a suite")
    with given.place.prefix_errors(SettingError):
        drawn = suite(
            **given.of(suite), rng=seed + table.seed, dt=table.dt or _SYNTHETIC_STEP, name=table.name
        )
    return [(motion, None) for motion in drawn]


def _synthetic(table: MotionTable, seed: int) -> _Grounds:
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
    tests, training = ([each for each in bare if each.table.use == use] for use in ("test", "training"))
    for test, other in product(tests, training):
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
    ground = KanaiTajimi(**soil.of(KanaiTajimi))
    if table.synthetic == "kanai_tajimi":
        soil.refuse_others((KanaiTajimi,), "belongs to clough_penzien", "leave it out")
        return ground
    return CloughPenzien(soil=ground, **soil.of(CloughPenzien))


def _process(motion: GroundMotion, table: MotionTable) -> GroundMotion:
    if table.group:
        groups = (table.group,) if isinstance(table.group, str) else table.group
        motion = replace(motion, groups=(*groups, *motion.groups))
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


def _scale(
    motion: GroundMotion, table: MotionTable, aims: Aims
) -> Iterator[tuple[GroundMotion, Intensity, float | None]]:
    """The motion at each of its factors or intensities, with what it then has of its measure, and with the factor."""
    period, damping = None, 0.05 if table.sa_damping is None else table.sa_damping
    if table.sa is not None:
        period = table.sa_period or aims.first_period()
    elif table.scale_to is not None:
        target = aims.target()
        period, damping = None if table.scale_to == "pga" else aims.target_period(), target.damping
        motion = scaled_to_target(motion, target, by=table.scale_to, period=period)
    found = Intensity(measure="pga", value=motion.peak)
    if period is not None:
        found = spectral_intensity(motion, period, damping)
    factors, values = _several(table.factor), _several(table.pga) or _several(table.sa)
    if not factors and not values:
        yield motion, found, None
    for factor in factors:
        name = motion.name if len(factors) == 1 else f"{motion.name} x {factor:g}"
        yield (
            replace(scaled(motion, factor), name=name),
            replace(found, value=abs(factor) * found.value),
            factor,
        )
    for value in values:
        level = f"{'' if table.sa is None else 'Sa '}{value / STANDARD_GRAVITY:.3g} g"
        name = motion.name if len(values) == 1 else f"{motion.name}, {level}"
        ground = replace(scaled_from(motion, found, value), name=name, groups=(*motion.groups, level))
        yield ground, replace(found, value=value), None


def _several(given: float | tuple[float, ...] | None) -> tuple[float, ...]:
    return () if given is None else given if isinstance(given, tuple) else (given,)


def parse(text: str, origin: str) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """A TOML document, and the line of every key, table and array element in it."""
    try:
        document = toml_table(text)
    except ValueError as reason:
        text = str(reason)
        raise SettingError(f"{origin} is not TOML: {text[:1].lower()}{text[1:]}") from None
    return document, toml_lines(text)


def read_study(
    path: str | Path,
    identified: Identified,
    *,
    seed: int = 0,
    on_python: Callable[[str], None] = lambda sentence: None,
    on_progress: Callable[[StudyProgress], None] | None = None,
) -> Study:
    """Read a study; `identified` reads a damper from a run folder, see `mr.read_study`."""
    path = Path(path)
    file, document, place = _document_in(path)
    return study_of_document(document, place, path.parent, identified, seed, on_python, on_progress, file)


def read_bare_building(path: str | Path) -> Building:
    """The building of a study file without its dampers, whatever else the file has."""
    path = Path(path)
    _, document, place = _document_in(path)
    if not isinstance(document.get("building"), dict):
        place.refuse("the study has no [building]; give one")
    table = read_table(BuildingTable, document["building"], place.within("building"))
    with place.within("building").prefix_errors(SettingError):
        return table.build(path.parent / str(document.get("folder", "")))


def _document_in(path: Path) -> tuple[StudyFile, dict[str, Any], Place]:
    content = bytes_of(path, TOML)
    # Refused here, by the name that was given.
    text_in(content, path, TOML)
    file = StudyFile(path=path.resolve(), content=content)
    document, lines = parse(file.text, str(path))
    return file, document, Place(origin=str(path), lines=lines)


def study_of_document(
    document: dict[str, Any],
    place: Place,
    folder: Path,
    identified: Identified,
    seed: int,
    on_python: Callable[[str], None],
    on_progress: Callable[[StudyProgress], None] | None,
    file: StudyFile | None = None,
) -> Study:
    """The study of a document, which may hold values that no file can; names of files are relative to `folder`."""
    identified = cache(identified)

    def placed(placement: Placed) -> Study:
        anew = placed_document(document, placement)
        return study_of_document(anew, place, folder, identified, seed, on_python, on_progress, file)

    with all_mistakes() as part:
        with part():
            refuse_loose_settings(document, place)
        with part():
            table = read_table(StudyTable, document, place)
    study = _study_of(table, file, place, folder, identified, seed, on_python, on_progress)
    return replace(study, placed=placed)


def _study_of(
    table: StudyTable,
    file: StudyFile | None,
    place: Place,
    folder: Path,
    identified: Identified,
    seed: int,
    on_python: Callable[[str], None],
    on_progress: Callable[[StudyProgress], None] | None,
) -> Study:
    """The study of a table in steps: what its tables name, how that goes together, its laws.

    Mistakes of a step are told together.
    """
    folder = folder / table.folder
    for each in table.controller:
        if each.user is not None and isinstance(each.user.file, str):
            on_python(running_in_words(each.user, folder))
    with all_mistakes() as part:
        with part(), place.within("building").prefix_errors(SettingError):
            bare = table.building.build(folder)
        with part(), place.within("hardware").prefix_errors(SettingError):
            hardware = replace(table.hardware, seed=seed)
        with part():
            chosen = choose_dampers(table.damper, folder, identified)
        with part():
            records = bare_motions(table.motion, folder, seed)
        with part():
            settings = read_each(lambda each: settings_of_law(each, folder), table.controller)
        with part():
            tunes = read_each(lambda each: resolve_settings(each, folder), table.tune)

    @cache
    def first_period() -> float:
        period = float(bare.periods[0])
        if not period < _LONGEST_PERIOD:
            raise SettingError(
                "the first mode of [building] has no stiffness, hence no period; give sa_period of the motion, or "
                "period of [target] [s]"
            )
        return period

    @cache
    def target() -> TargetSpectrum:
        if table.target is None:
            raise SettingError("scale_to wants a target, and the study has none; give a [target]")
        return target_spectrum(table.target)

    def target_period() -> float:
        return (table.target and table.target.given.get("period")) or first_period()

    with all_mistakes() as part:
        with part():
            building, devices = equip_building(bare, table.damper, chosen)
        with part():
            aims = Aims(target=target, target_period=target_period, first_period=first_period)
            motions = motions_of_study(records, sample_time=hardware.sample_time, aims=aims, place=place)
        with part():
            limit = _limit(table.report, chosen, bare, place)
    with all_mistakes() as part:
        with part():
            checked_suite = _check_suite(table, motions, target, target_period)
        with part():
            detailed = _choose_detailed(table, motions, place)
        with part():
            designed_on, levels = _design_motions(table, motions, place)
    if lacking := beyond_twin(building, devices, hardware):
        table.damper[0].place.refuse(lacking)
    chosen_on = tuple(motion.ground for motion in designed_on)

    @cache
    def reference_peaks() -> ReferencePeaks:
        # Simulated only where a law refers to these peaks and its table leaves them out.
        from mrwork.study.constant import reference_peaks_of

        row = Row(label=PASSIVE_OFF, kind="passive_off")
        return reference_peaks_of(make_arrangement(bare, row, building, devices, None), chosen_on, hardware)

    problem = problem_of(
        table, building, devices, hardware, designed_on, reference_peaks if devices else None
    )
    compared = arrangements(table, bare, problem, folder, hardware, settings, on_progress)
    tuned = {law for each in table.tune for law in each.laws}
    of_tuned = [spec for spec in control_laws() if spec.name in tuned]
    with place.within("hardware").prefix_errors(SettingError):
        refuse_unread(
            hardware,
            accelerations=any(each.reads_acceleration for each in compared)
            or any(spec.reads_acceleration for spec in of_tuned),
            forecasts=any(each.forecasts_ground for each in compared)
            or any(spec.needs_model for spec in of_tuned),
        )
    labels = [each.row.label for each in compared]
    _refuse_same(labels, place.within("controller"), "arrangements", "label")
    _refuse_unknown_labels(table.report, labels, place)
    study = Study(
        title=table.title or bare.name,
        file=file,
        table=table,
        folder=folder.resolve(),
        building=bare,
        arrangements=compared,
        motions=motions,
        chosen_on=chosen_on,
        design_levels=levels if any(each.row.kind in _DESIGNED for each in compared) else (),
        limit=limit,
        hardware=hardware,
        devices=devices,
        device_storeys=tuple(bare.storey_names.index(bare.storey_name(each.storey)) for each in table.damper),
        command_unit=_command_unit(chosen),
        facts=_facts(bare, devices, chosen, hardware),
        detailed=detailed,
        histories={"detailed": (detailed,), "all": tuple(range(len(motions))), "none": ()}[
            table.report.histories
        ],
        report=table.report,
        problem=problem,
        tunes=tuple(tunes),
        realisations=_realisations(table, place, devices, folder, identified),
        other_sets=other_sets(table.damper, folder, identified),
        suite=checked_suite,
        questions=tuple(dict.fromkeys(place.questions)),
    )
    notes = tuple((heading, " ".join(sentences)) for heading, sentences in study.design_notes)
    return replace(study, facts=(*study.facts, *notes))


def _check_suite(
    table: StudyTable,
    motions: Sequence[MotionOfStudy],
    target: Callable[[], TargetSpectrum],
    period: Callable[[], float],
) -> SuiteCheck | None:
    """The suite of test motions against the target, where the study has one and each record stands once."""
    judged = [motion for motion in motions if motion.use == "test"]
    if table.target is None or len({motion.record for motion in judged}) < len(judged):
        return None
    with table.target.place.prefix_errors(SettingError):
        return check_suite([motion.ground for motion in judged], target(), period=period())


def _realisations(
    table: StudyTable, place: Place, devices: Sequence[Device], folder: Path, identified: Identified
) -> Realisations | None:
    given = table.uncertainty
    if given is None:
        return None
    where = place.within("uncertainty")
    drawn: list[Floats | None] = []
    for each in table.damper:
        rows = None
        if given.damper and each.run is not None:
            fit = fitted_of(each, folder, identified)
            rows = fit.draws()
            if rows is None:
                run, remedy = "a fit", "give the folder of its run with the draws that mrwork sample adds"
                if isinstance(each.run, str):
                    run, remedy = each.run, f"run mrwork sample {each.run} first"
                each.place.within("run").refuse(
                    f"{run} has no posterior draws, and [uncertainty] asks for them; {remedy}, or set damper = false "
                    "there"
                )
            # One draw for each realisation, equally spread over the chains.
            places = np.linspace(0, len(rows) - 1, given.realisations).round().astype(np.int64)
            rows = np.stack([_with_parameters(each, fit, row, folder) for row in rows[places]])
        drawn.append(rows)
    if not any((given.stiffness, given.damping, given.delay, *(rows is not None for rows in drawn))):
        where.refuse(
            "nothing in [uncertainty] is uncertain; give it a stiffness, a damping or a delay, or a [[damper]] with a "
            "run that has posterior draws"
        )
    with where.prefix_errors(SettingError):
        return realisations_of(given, devices, drawn)


def _with_parameters(table: DamperTable, fit: FittedDamper, theta: Floats, folder: Path) -> Floats:
    drawn = replace(fit, theta=tuple(theta.tolist()))
    return chosen_damper(table, folder, lambda run: drawn).theta


def _refuse_same(names: Sequence[str], place: Place, what: str, key: str) -> None:
    seen: set[str] = set()
    for name in names:
        if name in seen:
            place.refuse(f"two {what} are called {name!r}; give one of them another {key}")
        seen.add(name)


def _refuse_unknown_labels(table: ReportTable, labels: Sequence[str], place: Place) -> None:
    where = place.within("report")
    for label in table.controllers:
        if label not in labels:
            near = suggestion(label, labels)
            where.within("controllers").refuse(f"no arrangement is called {label!r}{near}")


def _design_motions(
    table: StudyTable, motions: Sequence[MotionOfStudy], place: Place
) -> tuple[tuple[MotionOfStudy, ...], tuple[str, ...]]:
    """The motions on which laws are designed, and their levels where there is a `design_level` or records have several.

    They are the training motions, or all where there are none; with a `design_level` those of it.
    """
    chosen = tuple(each for each in motions if each.use == "training") or tuple(motions)
    levels = tuple(each.level_in_words for each in sorted(chosen, key=lambda each: each.level))
    levels, several = tuple(dict.fromkeys(levels)), max(Counter(each.record for each in chosen).values()) > 1
    wanted = table.design_level
    if wanted is None:
        return chosen, levels if several else ()
    of_level = tuple(each for each in chosen if math.isclose(each.level, wanted, rel_tol=1e-6))
    if not of_level:
        what = f"{chosen[0].use} motion" if chosen[0].use == "training" else "motion"
        place.within("design_level").refuse(
            f"no {what} is scaled to {wanted:.4g} m/s2, or by this factor; give one of {list_names(levels)}"
        )
    return of_level, (of_level[0].level_in_words,)


def _limit(
    table: ReportTable, chosen: Sequence[ChosenDamper], bare: Building, place: Place
) -> Mapping[str, float]:
    """The criterion with its limit of which the study has the fragility, if it states one."""
    scales = Scales.of(bare)
    if table.limit is None:
        return {"peak_drift_ratio": bare.drift_limit} if bare.drift_limit else {}
    with place.within("report", "limit").prefix_errors(SettingError):
        limit = limit_of(table.limit, _command_unit(chosen), scales)
    asked = (criterion(name).question(value) for name, value in limit.items())
    place.questions.extend(f"{place.within('report', 'limit')}: {each}." for each in asked if each)
    return limit


def _command_unit(chosen: Sequence[ChosenDamper]) -> str:
    return (chosen[0].spec.command_unit if chosen else None) or "A"


def _choose_detailed(table: StudyTable, motions: Sequence[MotionOfStudy], place: Place) -> int:
    """Index of the motion of the time histories; one that [report] names must be in the study.

    By default the test motion of the largest peak, of those of the `design_level` where the study names one.
    """
    names, named, level = [motion.name for motion in motions], table.report.motion, table.design_level
    if named is not None and named not in names:
        place.within("report", "motion").refuse(f"no motion is called {named!r}{suggestion(named, names)}")
    test = np.array([motion.use == "test" for motion in motions])
    if level is not None:
        of_level = test & [math.isclose(motion.level, level, rel_tol=1e-6) for motion in motions]
        test = of_level if of_level.any() else test
    largest = int(np.argmax([motion.ground.peak for motion in motions] * test))
    return largest if named is None else names.index(named)


def _facts(
    bare: Building, devices: Sequence[Device], chosen: Sequence[ChosenDamper], hardware: Hardware
) -> tuple[tuple[str, str], ...]:
    frequencies = ", ".join(f"{frequency:.3g}" for frequency in bare.frequencies[:5])
    source = f"; {bare.source} ({bare.status})" if bare.source else ""
    facts = [("Building", f"{bare.name}, {frequencies} Hz{source}")]
    for device, damper in zip(devices, chosen, strict=True):
        count = f"{device.count} x " if device.count > 1 else ""
        pair = ", a differential pair" if device.differential else ""
        fixed = "" if damper.spec.follows_command else ", passive: all its parameters are constant"
        facts.append((device.name[:1].upper() + device.name[1:], f"{count}{device.spec.title}{pair}{fixed}"))
    facts += [("Parameters", text) for text in dict.fromkeys(damper.source for damper in chosen)]
    tested = [damper.tested.in_words if damper.tested else "not known" for damper in chosen]
    facts += [("Tested ranges", text) for text in dict.fromkeys(tested)]
    facts.append(
        (
            "Loop",
            f"a command every {1e3 * hardware.sample_time:g} ms, delay {1e3 * hardware.delay:g} ms, steps of "
            f"{1e3 * hardware.step:g} ms, feedback of the {hardware.feedback}",
        )
    )
    return tuple(facts)
