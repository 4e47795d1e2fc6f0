"""Make the study of the tables of a file or of a call; a refusal has the place of its key.

The tables are values that check themselves, and what they name is looked up here: building, dampers, motions, laws. All
that is wrong in them is told together; then how they go together, and at last what laws cannot be designed.
"""

from __future__ import annotations

import math
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.base.documents import given_values, read_table
from mrwork.base.keys import Arguments, check_known, given_in, keys_of
from mrwork.base.numbers import in_newtons, of_unit, significant
from mrwork.base.places import KeyPath, Place, all_mistakes, keyed
from mrwork.base.remark import Remark
from mrwork.base.summary import list_names
from mrwork.base.units import STANDARD_GRAVITY
from mrwork.buildings import Building
from mrwork.buildings.device import Device
from mrwork.buildings.from_file import BuildingTable
from mrwork.buildings.groups import commanded, refuse_rate
from mrwork.buildings.yielding import elastic_frame
from mrwork.closed_loop.evaluation import Scales, criterion, on_request
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.process_law import ProcessLaw
from mrwork.closed_loop.responses import command_unit_of
from mrwork.control.laws.law_problem import DesignProblem, ReferencePeaks
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.motions.ground_motion import peak_push
from mrwork.motions.targets import SuiteCheck, TargetSpectrum, check_suite
from mrwork.store.input_file import TOML, bytes_of, text_in
from mrwork.store.parse import toml_lines
from mrwork.study.arrangements import FoundLaw, arrangements, found_law, resolve_settings
from mrwork.study.dampers import Identified, chosen_damper, condensed_for, equip_building, other_sets
from mrwork.study.fragilities import limit_of
from mrwork.study.motions import Aims, BareMotion, bare_motions, motions_of_study, refuse_same
from mrwork.study.realisations import realisations_of
from mrwork.study.runs import asking
from mrwork.study.schema import (
    PASSIVE_OFF,
    ControllerTable,
    DamperTable,
    LawFileTable,
    MotionTable,
    StudyTable,
    TuneTable,
    target_spectrum,
)
from mrwork.study.study import Arrangement, MotionOfStudy, Row, Study, StudyFile, StudyOrigin


def parse(text: str, origin: str) -> tuple[dict[str, Any], dict[KeyPath, int]]:
    """A TOML document, and the line of every key, table and array element in it."""
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as reason:
        text = str(reason)
        raise SettingError(f"{origin} is not TOML: {text[:1].lower()}{text[1:]}") from None
    return document, toml_lines(text)


def read_bare_building(path: str | Path) -> Building:
    """The building of a study file without its dampers; of the other tables only the names are read."""
    path = Path(path)
    _, document, place = document_in(path)
    if not isinstance(document.get("building"), dict):
        place.refuse("the study has no [building]; give one")
    others = {entry.name_in_file for entry in keys_of(StudyTable)} - {"building"}
    rest = {name: value for name, value in document.items() if name not in others}
    table: BuildingTable = given_values(StudyTable, rest, place)["building"]
    with place.within("building").prefix_errors(SettingError):
        return table.build(path.parent / str(document.get("folder", "")))


def document_in(path: Path) -> tuple[StudyFile, dict[str, Any], Place]:
    """A study file, its tables, and the place of these."""
    content = bytes_of(path, TOML)
    # Refused here, by the name that was given.
    text_in(content, path, TOML)
    file = StudyFile(path=path.resolve(), content=content)
    document, lines = parse(file.text, str(path))
    return file, document, Place(origin=str(path), lines=lines)


@dataclass(slots=True, kw_only=True)
class _Found:
    """What the tables of a study name, found table by table; names of files are relative to `folder`."""

    folder: Path
    identified: Identified
    seed: int
    on_python: Callable[[str], None]
    bare: Building | None = None
    target: TargetSpectrum | None = None
    dampers: list[tuple[Device, str]] = field(default_factory=list)
    records: list[BareMotion] = field(default_factory=list)
    laws: list[FoundLaw] = field(default_factory=list)
    tunes: list[TuneTable] = field(default_factory=list)

    def look_up(self, place: Place, table: Any) -> None:
        """Look up what a table at this place names, if it names anything."""
        match table, place.path:
            case BuildingTable(), ("building",):
                self.bare = table.build(self.folder)
            case DamperTable(), _:
                self.dampers.append(chosen_damper(table, self.folder, self.identified))
            case MotionTable(), (_, int(number)):
                floors = () if self.bare is None else self.bare.floor_names
                # Of a building that is not read, the mistakes of other motions are told beside its own.
                if floors or not table.is_forced:
                    self.records += bare_motions(table, number, self.folder, self.seed, floors)
            case LawFileTable(file=str(file)), _:
                path, where = self.folder / file, place.within("file")
                wanted = f"law {table.law}" if table.law else f"function {table.function}"
                self.on_python(f"{where}: running {path} as Python, for its {wanted}")
            case ProcessLaw(), _:
                verb = "running" if table.program else "asking"
                self.on_python(f"{place}: {verb} {table.place} for commands")
            case ControllerTable(), _:
                self.laws.append(found_law(table, place, self.folder))
            case Arguments(), ("target",):
                self.target = target_spectrum(table)
            case TuneTable(), _:
                self.tunes.append(resolve_settings(table, place, self.folder))


def study_of_tables(
    document: Mapping[str, Any],
    place: Place,
    folder: Path,
    identified: Identified,
    seed: int = 0,
    on_python: Callable[[str], None] = lambda sentence: None,
    file: StudyFile | None = None,
) -> Study:
    """The study of tables, which may hold values that no file can; names of files are relative to `folder`."""
    inputs = _Found(
        folder=folder / str(document.get("folder", "")),
        identified=cache(identified),
        seed=seed,
        on_python=on_python,
    )
    table = read_table(StudyTable, document, replace(place, on_table=inputs.look_up))
    with place.prefix_errors(SettingError):
        origin = StudyOrigin(
            folder=inputs.folder.resolve(), identified=inputs.identified, file=file, place=place
        )
        made = _study_of(table, inputs, origin)
        unusual = (*place.remarks, *_unusual_limits(table, made.limit, place))
    return replace(made, unusual=tuple(dict.fromkeys(unusual)))


def counted_study(study: Study, counts: Sequence[int]) -> Study:
    """The study with so many dampers in each [[damper]] that follows a command, under its motions, without histories.

    A [[damper]] of 0 is left out.
    """
    driven, rest = study.table.damper[: len(counts)], study.table.damper[len(counts) :]
    dampers = [replace(damper, count=count) for damper, count in zip(driven, counts, strict=True) if count]
    return replace(
        with_dampers(study, [*dampers, *rest]),
        motions=study.motions,
        detailed=study.detailed,
        histories=(),
        realisations=None,
        is_whole=False,
    )


def with_dampers(study: Study, dampers: Sequence[DamperTable]) -> Study:
    """The study with the dampers of these tables, without a comparison of placements."""
    stated = given_in(replace(study.table, damper=tuple(dampers), places=None, folder=""))
    origin, place = study.origin, replace(study.origin.place, remarks=[])
    return study_of_tables(
        stated, place, origin.folder, origin.identified, study.hardware.seed, file=origin.file
    )


def _study_of(table: StudyTable, inputs: _Found, origin: StudyOrigin) -> Study:
    """The study of a table and of what it names: how that goes together, then its laws."""
    assert inputs.bare is not None
    bare, hardware = condensed_for(inputs.bare, table), replace(table.hardware, seed=inputs.seed)
    first = float(bare.periods[0])
    period = None if table.target is None else table.target.given.get("period")
    aims = Aims(
        first_period=first,
        weight=STANDARD_GRAVITY * bare.reference_mass,
        follows_ground=bare.follows_ground,
        target=inputs.target,
        target_period=period or first,
    )
    with all_mistakes() as part:
        with part():
            building, devices = equip_building(bare, table.damper, [device for device, _ in inputs.dampers])
            refuse_same([device.name for device in devices], "damper", "dampers", "name")
            # Dampers that a law commands come first, whatever their order in the file.
            order = sorted(range(len(devices)), key=lambda number: not devices[number].is_commanded)
            devices = tuple(devices[number] for number in order)
            table = replace(table, damper=tuple(table.damper[number] for number in order))
            sources = [inputs.dampers[number][1] for number in order]
            kinds = {device.is_actuator: device for device in devices if device.is_commanded}
            if len(kinds) > 1:
                raise SettingError(
                    f"a law commands either {kinds[True].name} or {kinds[False].name}; give the damper a command to "
                    "hold, as command = 0, or a study of its own"
                )
        with part():
            motions = motions_of_study(inputs.records, aims)
    with all_mistakes() as part:
        with part():
            checked_suite = _check_suite(aims, motions)
        with part():
            detailed = _choose_detailed(table, motions, bare)
        with part():
            designed_on, levels = _design_motions(table, motions)
        with part(), keyed("report", "limit"):
            limit: Mapping[str, float] = {"peak_drift_ratio": bare.drift_limit} if bare.drift_limit else {}
            if table.report.limit is not None:
                limit = limit_of(table.report.limit, command_unit_of(devices), Scales.of(bare))
        for number, tune in enumerate(table.tune):
            with part(), keyed("tune", number, "constraints"):
                for name, value in (tune.constraints or {}).items():
                    limit_of({name: value}, command_unit_of(devices), Scales.of(bare))
        with part(), keyed("hardware"):
            refuse_rate(devices, hardware.command_rate, "command_rate")
    chosen_on = tuple(motion.ground for motion in designed_on)

    @cache
    def reference_peaks(elastic: bool) -> ReferencePeaks:
        # Simulated only where a law refers to these peaks and its table leaves them out.
        from mrwork.study import trials
        from mrwork.study.loop_case import LoopCase

        row, of = Row(label=PASSIVE_OFF, kind="passive_off"), elastic_frame(building) if elastic else building
        at_zero = Arrangement(row=row, bare=bare, building=of, devices=devices, law=None)
        scored = table.report.score
        case = LoopCase(
            arrangement=at_zero,
            motions=chosen_on,
            hardware=hardware,
            asked=on_request(scored),
            scored=scored,
        )
        return trials.reference_peaks(case)

    driven = commanded(devices)

    def expected(name: str) -> Any:
        return next(filter(None, (getattr(damper, name) for damper in table.damper)), None)

    problem = DesignProblem(
        building=building,
        devices=driven,
        beside=devices[len(driven) :],
        sample_time=hardware.sample_time,
        delay=hardware.delay,
        motions=chosen_on,
        judged=designed_on[0].facts.use == "test",
        reference_peaks=reference_peaks if devices else None,
        amplitude=expected("amplitude"),
        velocity=expected("velocity"),
    )
    compared = arrangements(table, bare, problem, inputs.folder, inputs.laws)
    labels = [arrangement.row.label for arrangement in compared]
    refuse_same(labels, "controller", "arrangements", "label")
    with keyed("report", "controllers"):
        for label in table.report.controllers:
            check_known(label, labels, f"no arrangement is called {label!r}")
    histories = {"detailed": (detailed,), "all": tuple(range(len(motions))), "none": ()}
    study = Study(
        table=table,
        origin=origin,
        building=bare,
        arrangements=compared,
        motions=motions,
        chosen_on=chosen_on,
        design_levels=levels if any(each.row.what.is_designed for each in compared) else (),
        limit=limit,
        hardware=hardware,
        described=_facts(bare, devices, sources, hardware),
        detailed=detailed,
        histories=histories[table.report.histories],
        problem=problem,
        tunes=tuple(inputs.tunes),
        realisations=realisations_of(table, devices, inputs.folder, inputs.identified),
        other_sets=other_sets(table.damper, inputs.folder, inputs.identified),
        suite=checked_suite,
    )
    if all(arrangement.named is None for arrangement in compared):
        study.check_readings()
    named_in: tuple[tuple[KeyPath, Iterable[str]], ...] = (
        (("report", "criteria"), table.report.criteria),
        (("report", "score"), table.report.score),
        (("report", "limit"), limit),
        *(
            (("tune", number, key), getattr(tune, key) or ())
            for number, tune in enumerate(inputs.tunes)
            for key in ("criteria", "objectives", "constraints")
        ),
    )
    for keys, names in named_in:
        with keyed(*keys):
            study = asking(study, names)
    return study


def _check_suite(aims: Aims, motions: Sequence[MotionOfStudy]) -> SuiteCheck | None:
    """The suite of test motions against the target, where the study has one and each record stands once."""
    judged = [motion for motion in motions if motion.facts.use == "test"]
    forced = next((motion.ground.name for motion in motions if motion.ground.forces.size), None)
    if aims.target is not None and forced:
        raise InvalidSettingError(
            "target",
            f"a target is of ground accelerations, and motion {forced!r} has forces on floors; give them a study of "
            "their own, or leave the target out",
        )
    if aims.target is None or len({motion.facts.record for motion in judged}) < len(judged):
        return None
    with keyed("target"):
        if road := next((motion.ground.name for motion in judged if motion.ground.is_road), ""):
            raise SettingError(
                f"the target is a spectrum of earthquakes, and {road} is a road; leave [target] out"
            )
        return check_suite([motion.ground for motion in judged], aims.target, period=aims.target_period)


def _design_motions(
    table: StudyTable, motions: Sequence[MotionOfStudy]
) -> tuple[tuple[MotionOfStudy, ...], tuple[str, ...]]:
    """The motions on which laws are designed, and their levels where there is a `design_level` or records have several.

    They are the training motions, or all where there are none; with a `design_level` the motions of it.
    """
    chosen = tuple(motion for motion in motions if motion.facts.use == "training") or tuple(motions)
    levels = tuple(motion.facts.level for motion in sorted(chosen, key=lambda motion: motion.level))
    levels = tuple(dict.fromkeys(levels))
    several = max(Counter(motion.facts.record for motion in chosen).values()) > 1
    wanted = table.design_level
    if wanted is None:
        return chosen, levels if several else ()
    of_level = tuple(motion for motion in chosen if math.isclose(motion.level, wanted, rel_tol=1e-6))
    if not of_level:
        what = f"{chosen[0].facts.use} motion" if chosen[0].facts.use == "training" else "motion"
        is_force = all(
            motion.facts.intensity.measure == "force" and motion.factor is None for motion in chosen
        )
        cure = (
            "forces without a factor have no level; leave it out"
            if is_force
            else f"give one of {list_names(levels)}"
        )
        raise InvalidSettingError(
            "design_level", f"no {what} is scaled to {wanted:.4g} m/s2, or by this factor; {cure}"
        )
    return of_level, (of_level[0].facts.level,)


def _unusual_limits(table: StudyTable, limit: Mapping[str, float], place: Place) -> Iterator[Remark]:
    limits: list[tuple[KeyPath, str, float | str]] = [
        (("tune", number, "constraints", name), name, value)
        for number, tune in enumerate(table.tune)
        for name, value in (tune.constraints or {}).items()
    ]
    if table.report.limit is not None:
        limits += [(("report", "limit"), name, value) for name, value in limit.items()]
    for path, name, value in limits:
        if isinstance(value, float):
            yield from criterion(name).unusual_limit(value, f"{place.within(*path)}: ")


def _choose_detailed(table: StudyTable, motions: Sequence[MotionOfStudy], bare: Building) -> int:
    """Index of the motion of the time histories; one that [report] names must be in the study.

    By default the test motion of the largest peak, at the `design_level` where the study names one.
    """
    names, wanted, level = [motion.ground.name for motion in motions], table.report.motion, table.design_level
    if wanted is not None:
        with keyed("report", "motion"):
            check_known(wanted, names, f"no motion is called {wanted!r}")
            return names.index(wanted)
    is_test = np.array([motion.facts.use == "test" for motion in motions])
    if level is not None:
        of_level = is_test & [math.isclose(motion.level, level, rel_tol=1e-6) for motion in motions]
        is_test = of_level if of_level.any() else is_test
    return int(np.argmax([peak_push(motion.ground, bare.reference_mass) for motion in motions] * is_test))


def _facts(
    bare: Building, devices: Sequence[Device], sources: Sequence[str], hardware: Hardware
) -> tuple[tuple[str, str], ...]:
    modes = zip(bare.frequencies[:5], 100.0 * bare.damping_ratios[:5], strict=True)
    frequencies = ", ".join(f"{frequency:.3g} Hz ({significant(ratio, 3)} %)" for frequency, ratio in modes)
    source = f"; {bare.source} ({bare.status})" if bare.source else ""
    facts = [("Structure", f"{bare.name}, frequencies (damping) {frequencies}{source}")]
    for device in devices:
        count = f"{device.count} x " if device.count > 1 else ""
        pair = ", a differential pair" if device.differential else ""
        fixed = "" if device.spec.follows_command else ", passive: all its parameters are constant"
        if device.is_actuator:
            most = device.largest_command
            fixed = f", up to {in_newtons(most)}" if math.isfinite(most) else ", of any force"
        if device.command is not None:
            fixed = f", held at {of_unit(device.command, device.spec.command_unit or '')}"
        facts.append((device.name[:1].upper() + device.name[1:], f"{count}{device.spec.title}{pair}{fixed}"))
    dampers = [pair for pair in zip(devices, sources, strict=True) if not pair[0].is_actuator]
    facts += [("Parameters", text) for text in dict.fromkeys(source for _, source in dampers)]
    tested = [device.tested.in_words if device.tested else "not known" for device, _ in dampers]
    facts += [("Tested ranges", text) for text in dict.fromkeys(tested)]
    loop = (
        f"a command every {1e3 * hardware.sample_time:g} ms, delay {1e3 * hardware.delay:g} ms, steps of "
        f"{1e3 * hardware.step:g} ms, feedback of the {hardware.feedback}"
    )
    return (*facts, ("Loop", loop))
