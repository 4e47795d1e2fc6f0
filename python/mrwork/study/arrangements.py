"""Arrangements that a study compares: without dampers, i = 0, baselines, control laws.

A law may stand in a Python file of its user, which is run as Python when the study is read.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

from mrwork.base.documents import given_values, heading_lines, key_lines, read_table
from mrwork.base.keys import as_document, keys_of, suggestion, toml_value
from mrwork.base.places import Place, all_mistakes, read_each
from mrwork.base.units import number_in
from mrwork.buildings import Building
from mrwork.buildings.groups import largest_command
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.evaluation import criteria
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.own_runs import beyond_twin
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw, control_law, control_laws
from mrwork.control.laws.law_problem import DesignProblem, LawSettings, ReferencePeaks
from mrwork.control.laws.law_settings import SETTINGS, design_law
from mrwork.control.laws.weights import WeightWishes
from mrwork.errors import SettingError
from mrwork.files.matrices import read_matrix
from mrwork.store.codec import digest_of
from mrwork.store.function_text import text_to_compare
from mrwork.store.user_python import place_of, run_file
from mrwork.study.course import StudyProgress
from mrwork.study.named_laws import Trials, missing_settings
from mrwork.study.schema import (
    OPTIMAL_PASSIVE,
    PASSIVE_OFF,
    PASSIVE_ON,
    BaselineTable,
    ControllerTable,
    DamperTable,
    LawFileTable,
    StudyTable,
    TuneTable,
)
from mrwork.study.study import (
    Arrangement,
    Kind,
    MotionOfStudy,
    Row,
    StudyLaw,
    TakenSettings,
    constant_command,
    make_arrangement,
)

# Numbers of a matrix among the settings: those of a weight of a building with 1000 coordinates.
_MOST_NUMBERS = 4_000_000


def running_in_words(table: LawFileTable, folder: Path) -> str:
    """Notice of a file that is about to run as Python, with the line of the study that names it."""
    file = folder / str(table.file)
    return f"{table.place.within('file')}: running {file} as Python, for its function {table.function}"


def _load_law(table: LawFileTable, folder: Path) -> UserLaw:
    name = table.function
    if isinstance(table.file, str):
        with table.place.within("file").prefix_errors(SettingError):
            module, text = run_file(folder / table.file, what="a law")
        functions = [each for each, value in vars(module).items() if inspect.isfunction(value)]
        function = getattr(module, name, None)
        if not callable(function):
            near = suggestion(name, functions, otherwise="it has")
            table.place.within("function").refuse(f"{table.file} has no function {name!r}{near}")
    else:
        function, text = table.file, text_to_compare(table.file)
    try:
        inspect.signature(function).bind(None, None)
    except TypeError:
        table.place.within("function").refuse(
            f"{name} ({place_of(function) or table.file}) does not take two arguments; write it as "
            f"def {name}(sample, memory)"
        )
    except ValueError:
        # A function of a compiled module may tell no arguments.
        pass
    with table.place.within("function").prefix_errors(SettingError):
        return UserLaw(
            name=name,
            command=function,
            n_memory=table.memory,
            rms_time=table.rms_time,
            source=digest_of(text),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstantLaw:
    """A constant command, which has no settings: a share of the largest, or the best one where `share` is `None`."""

    title: str
    description: str
    share: float | None


CONSTANT_LAWS: Mapping[str, ConstantLaw] = {
    "passive_off": ConstantLaw(title=PASSIVE_OFF, description="no command", share=0.0),
    "passive_on": ConstantLaw(title=PASSIVE_ON, description="the largest command", share=1.0),
    "best_passive": ConstantLaw(
        title=OPTIMAL_PASSIVE,
        description="the constant command of the lowest score over all motions",
        share=None,
    ),
}
"""Constant commands that a study accepts as laws, besides the laws of the registry, by name."""


def laws_text() -> str:
    """Every control law with its equation, source and settings, for `mrwork respond --laws`."""
    blocks = []
    for spec in control_laws():
        lines = [f"{spec.name}: {spec.title}", *(f"  {line}" for line in spec.equation.splitlines())]
        for prose in (spec.description, spec.source):
            lines += heading_lines("", prose)[1:]
        if spec.switches:
            lines.append("  It switches, so its score has no gradient.")
        settings = [f"  {line}" for line in key_lines(SETTINGS[spec.name])]
        blocks.append("\n".join([*lines, *(["  settings", *settings] if settings else [])]))
    heading = "designed: table among the settings of a law with weights"
    lines = [f"  {line}" for line in key_lines(WeightWishes)]
    blocks.append("\n".join([*heading_lines(heading, WeightWishes.__doc__ or ""), *lines]))
    blocks += [f"{name}: {law.description}; no settings" for name, law in CONSTANT_LAWS.items()]
    return "\n\n".join(blocks)


# Words with which a law would be given to some of the dampers.
_OF_A_GROUP = {
    "controller": ("damper", "dampers", "storey", "storeys", "group"),
    "damper": ("law", "controller"),
}


def refuse_loose_settings(document: Mapping[str, Any], place: Place) -> None:
    """Refuse laws for some of the dampers, and settings of a law that stand beside its name; take them out."""
    own = {entry.name for entry in keys_of(ControllerTable)}
    with all_mistakes() as part:
        for kind, words in _OF_A_GROUP.items():
            given = document.get(kind)
            for number, table in enumerate(given if isinstance(given, list) else []):
                if not isinstance(table, dict):
                    continue
                for name in [word for word in words if table.pop(word, None) is not None]:
                    with part():
                        place.within(kind, number, name).refuse(
                            f"{name} in a [[{kind}]] would give one group of dampers a law of its own, and a law "
                            "commands all of them; leave it out, several [[controller]] are compared with each other"
                        )
                law = SETTINGS.get(str(table.get("law"))) if kind == "controller" else None
                for name in [entry.name for entry in keys_of(law)] if law else []:
                    if name in table and name not in own:
                        value = table.pop(name)
                        with part():
                            place.within(kind, number, name).refuse(
                                f"{name} is a setting of the law; it stands in [controller.settings], or below the law "
                                f"as settings = {{ {name} = {toml_value(value)} }}"
                            )


def arrangements(
    table: StudyTable,
    bare: Building,
    problem: DesignProblem,
    folder: Path,
    hardware: Hardware,
    settings: Sequence[_GivenSettings | None],
    on_progress: Callable[[StudyProgress], None] | None,
) -> tuple[Arrangement, ...]:
    """The building without dampers, with them at i = 0, the baselines, and every control law with its settings."""
    building, devices = problem.building, tuple(problem.devices)
    none = Row(label="uncontrolled", kind="uncontrolled", description="the building without dampers")
    arrangements_of_study = [make_arrangement(bare, none, bare, (), constant_command((), 0.0))]
    if devices:
        off = Row(label=PASSIVE_OFF, kind="passive_off", description="the dampers without a command")
        if not any(device.spec.follows_command for device in devices):
            off = Row(label="passive", kind="passive_off", description="the dampers, which follow no command")
        arrangements_of_study.append(
            make_arrangement(bare, off, building, devices, constant_command(devices, 0.0))
        )
    lacking: list[str] = []
    for controller, given in zip(table.controller, settings, strict=True):
        if given is not None and missing_settings(controller.law, given.values):
            lacking.append(controller.law)
    trials = Trials(bare=bare, problem=problem, hardware=hardware, lacking=lacking, on_progress=on_progress)
    with all_mistakes() as part:
        with part():
            baselines = read_each(lambda each: _baseline(each, table, bare, folder), table.baseline)
        with part():
            controlled = read_each(
                lambda each: _arrange_controller(*each, problem, bare, folder, trials),
                zip(table.controller, settings, strict=True),
            )
    for arrangement in (*baselines, *controlled):
        if arrangement.row.kind != "passive_off":
            arrangements_of_study.append(arrangement)
        elif arrangement.row.label:
            # This arrangement exists already; only its label may differ.
            former = arrangements_of_study[1]
            arrangements_of_study[1] = replace(former, row=replace(former.row, label=arrangement.row.label))
    known = [each.row for each in arrangements_of_study]
    controllable = any(device.spec.follows_command for device in devices)
    if table.references != "none" and controllable and all(each.kind != "best_passive" for each in known):
        taken = any(each.label == OPTIMAL_PASSIVE for each in known)
        label = f"{OPTIMAL_PASSIVE} (added)" if taken else OPTIMAL_PASSIVE
        row = Row(label=label, kind="best_passive", description="best_passive, added")
        made = make_arrangement(bare, row, building, devices, None)
        arrangements_of_study.insert(2, replace(made, added=True))
    return tuple(arrangements_of_study)


def _arrange_controller(
    controller: ControllerTable,
    given: _GivenSettings | None,
    problem: DesignProblem,
    bare: Building,
    folder: Path,
    trials: Trials,
) -> Arrangement:
    """The building with its dampers under the law of a table; one at i = 0 has a label if the table has."""
    devices = tuple(problem.devices)
    if not devices:
        controller.place.refuse("a control law needs dampers, and the study has none; give a [[damper]]")
    if not any(device.spec.follows_command for device in devices):
        _refuse_command(controller)
    limited = _limit_command(controller, problem)
    _refuse_beyond_twin(controller, problem, trials.hardware, None if given is None else given.values)
    title, law, taken = _choose_law(controller, limited, folder, given, trials)
    law = _shape_command(controller, law)
    constant = CONSTANT_LAWS.get(controller.law)
    if constant is not None and constant.share == 0.0:
        at_zero = Row(label=controller.label, kind="passive_off")
        return make_arrangement(bare, at_zero, problem.building, devices, law)
    user = controller.user
    description = controller.law
    if user is not None:
        of_file = f" of {user.file}" if isinstance(user.file, str) else ""
        description = f"{user.function}{of_file}, in Python"
    row = Row(label=controller.label or title, kind=_kind(law), description=description)
    made = make_arrangement(bare, row, problem.building, tuple(limited.devices), law)
    return replace(made, taken=taken)


def problem_of(
    table: StudyTable,
    building: Building,
    devices: tuple[Device, ...],
    hardware: Hardware,
    motions: Sequence[MotionOfStudy],
    reference_peaks: Callable[[], ReferencePeaks] | None = None,
) -> DesignProblem:
    """The building with its dampers, for which the laws of a study are designed, and the ground of these motions."""
    return DesignProblem(
        building=building,
        devices=devices,
        sample_time=hardware.sample_time,
        delay=hardware.delay,
        motions=tuple(motion.ground for motion in motions),
        judged=motions[0].use == "test",
        reference_peaks=reference_peaks,
        amplitude=_range(table.damper, "amplitude"),
        velocity=_range(table.damper, "velocity"),
    )


def _limit_command(controller: ControllerTable, problem: DesignProblem) -> DesignProblem:
    """The design problem of a law, with the command limited as its table says."""
    largest = controller.largest_command
    if largest is None:
        return problem
    available = largest_command(problem.devices)
    if largest > available:
        controller.place.within("largest_command").refuse(
            f"largest_command is {largest:g}, and the driver of the dampers gives {available:g} at most"
        )
    return problem.limited_to(largest)


def _refuse_beyond_twin(
    controller: ControllerTable, problem: DesignProblem, hardware: Hardware, given: Mapping[str, Any] | None
) -> None:
    """Refuse a law that dampers of the user cannot have, before anything is simulated for it."""
    if controller.user is None and (given is None or control_law(controller.law).commands_force):
        return
    law = controller.law if controller.user is None else f"{controller.user.function} in Python"
    if lacking := beyond_twin(problem.building, problem.devices, hardware, law):
        controller.place.within("law" if controller.user is None else "user").refuse(lacking)


def _shape_command(controller: ControllerTable, law: StudyLaw | None) -> StudyLaw | None:
    """The law of a table with its dead zone and slope."""
    given = ["dead_zone"] if controller.dead_zone > 0.0 else []
    given += ["command_slope"] if math.isfinite(controller.command_slope) else []
    if not given:
        return law
    if not isinstance(law, ControlLaw):
        controller.place.within(given[0]).refuse(
            f"{given[0]} is for a law of the registry; a law in Python shapes its own command, and the best constant "
            "command has none to shape"
        )
    return _with_shaping(controller, law)


def _with_shaping(controller: ControllerTable, law: ControlLaw) -> ControlLaw:
    return replace(law, dead_zone=controller.dead_zone, command_slope=controller.command_slope)


def _refuse_command(controller: ControllerTable) -> None:
    """Refuse a law that commands dampers which follow no command; an active law replaces them by actuators."""
    constant = CONSTANT_LAWS.get(controller.law)
    commanding = {spec.name for spec in control_laws() if not spec.commands_force}
    user = controller.user is not None
    if user or controller.law in commanding or (constant is not None and constant.share != 0.0):
        name = "a law in Python" if user else controller.law
        controller.place.within("user" if user else "law").refuse(
            f"{name} commands the dampers, and they are passive: none of their parameters depends on the command; "
            "leave this law out, or give a damper with laws"
        )


def _kind(law: StudyLaw | None) -> Kind:
    if law is None:
        return "best_passive"
    if isinstance(law, UserLaw):
        return "controller"
    if law.spec.commands_force:
        return "actuator"
    return "passive" if SETTINGS[law.name].constant else "controller"


def _range(tables: Sequence[DamperTable], name: str) -> tuple[float, float] | None:
    """The range of the first damper that gives it."""
    for table in tables:
        given: tuple[float, ...] | None = getattr(table, name)
        if given is not None:
            if len(given) != 2 or given[0] > given[1]:
                table.place.within(name).refuse(
                    f"{name} takes the smallest and the largest value, as [0.001, 0.01]"
                )
            return given[0], given[1]
    return None


def _baseline(baseline: BaselineTable, table: StudyTable, bare: Building, folder: Path) -> Arrangement:
    where = baseline.place.within("building")
    with where.prefix_errors(SettingError):
        changed = table.building.override_with(baseline.building).build(folder)
    known = {*changed.floor_names, *changed.storey_names}
    missing = [name for name in (*bare.floor_names, *bare.storey_names) if name not in known]
    if missing:
        where.refuse(
            f"the baseline has no {missing[0]}; it may add floors and storeys to the building, not remove them"
        )
    row = Row(label=baseline.label, kind="baseline", description=changed.name)
    return make_arrangement(bare, row, changed, (), constant_command((), 0.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class _GivenSettings:
    """The settings that a table gives a law, as they stand there, and in SI."""

    stated: dict[str, Any]
    values: dict[str, Any]
    where: Place


def settings_of_law(table: ControllerTable, folder: Path) -> _GivenSettings | None:
    """The settings that a table gives its law, checked; a constant command and a law in Python have none.

    Names of files with matrices are relative to `folder`.
    """
    place = table.place
    if table.user is not None:
        for name in ("law", "settings", "gain"):
            if getattr(table, name):
                place.within(name).refuse(f"a law in Python has no {name}; leave it out, or user")
        return None
    if not table.law:
        place.refuse(f"{place.table} has no law; give the name of a law, or user for one in Python")
    if table.law in CONSTANT_LAWS:
        for name in table.settings or {}:
            place.within("settings", name).refuse(f"{table.law} has no settings; leave {name} out")
        if table.gain is not None:
            place.within("gain").refuse(f"{table.law} has no gain; leave it out")
        return None
    if table.law not in SETTINGS:
        near = suggestion(table.law, [*SETTINGS, *CONSTANT_LAWS])
        place.within("law").refuse(f"no control law is called {table.law!r}{near}")
    kind = SETTINGS[table.law]
    given, where = dict(table.settings or {}), place.within("settings")
    if table.gain is not None:
        _check_takes_gain(table, kind)
        given["gain"] = table.gain if isinstance(table.gain, str) else [list(row) for row in table.gain]
        where = place if table.settings is None else where
    given = _with_matrices(kind, given, where, folder)
    return _GivenSettings(stated=given, values=given_values(kind, given, where), where=where)


def _choose_law(
    table: ControllerTable, problem: DesignProblem, folder: Path, given: _GivenSettings | None, trials: Trials
) -> tuple[str, StudyLaw | None, TakenSettings | None]:
    """Title and law of a table, and settings that it leaves out; names of files with laws are relative to `folder`.

    The law is `None` for the best constant command, which is found when the study runs.
    """
    if table.user is not None:
        return table.user.function, _load_law(table.user, folder), None
    if given is None:
        constant = CONSTANT_LAWS[table.law]
        if constant.share is None:
            return constant.title, None, None
        command = constant.share * largest_command(problem.devices)
        return constant.title, constant_command(problem.devices, command), None
    kind, spec = SETTINGS[table.law], control_law(table.law)
    with given.where.prefix_errors(SettingError):
        problem, beside = trials.expect_motion(problem) if spec.needs_curve else (problem, "")
        taken = trials.take(table.law, given.values, problem, partial(_with_shaping, table), beside=beside)
        settings: LawSettings = read_table(
            kind, given.stated | (as_document(taken.settings) if taken else {}), given.where
        )
        return spec.title, design_law(table.law, problem, settings), taken


def _check_takes_gain(table: ControllerTable, kind: type[LawSettings]) -> None:
    """Refuse a finished gain of a law that has none, or one that stands among the settings, too."""
    where = table.place.within("gain")
    if "gain" not in [entry.name for entry in keys_of(kind)]:
        taking = [
            name for name, each in SETTINGS.items() if "gain" in [entry.name for entry in keys_of(each)]
        ]
        where.refuse(
            f"{table.law} has no gain of a desired force; leave it out, or choose one of {', '.join(taking)}"
        )
    if "gain" in (table.settings or {}):
        where.refuse("the gain stands here and among the settings; keep one")


def refuse_within(table: TuneTable, sentence: str, *keys: str) -> NoReturn:
    """Raise a SettingError with the place in the study file, where the table has one."""
    if table.place is None:
        raise SettingError(sentence)
    table.place.within(*keys).refuse(sentence)


def check_law(table: TuneTable, law: str) -> None:
    """Refuse a name that is no control law."""
    if law not in SETTINGS:
        refuse_within(table, f"no control law is called {law!r}{suggestion(law, [*SETTINGS])}", "laws")


def check_criterion(table: TuneTable, key: str, name: str) -> None:
    """Refuse a name that is no criterion."""
    known = [entry.name for entry in criteria()]
    if name not in known:
        refuse_within(table, f"no criterion is called {name!r}{suggestion(name, known)}", key)


def resolve_settings(table: TuneTable, folder: Path) -> TuneTable:
    """A table whose settings, if any, are in SI, with the matrices of the files that they name.

    Names of laws and criteria must exist; settings that a law does not have are left to the tuning, which refuses them.
    """
    if table.place is None:
        return table
    for each in criteria():
        limit = (table.constraints or {}).get(each.name)
        if isinstance(limit, float) and (question := each.question(limit)):
            table.place.questions.append(f"{table.place.within('constraints', each.name)}: {question}.")
    place, settings = table.place.within("settings"), dict(table.settings or {})
    with all_mistakes() as part:
        for law in table.laws:
            with part():
                check_law(table, law)
                names = {entry.name for entry in keys_of(SETTINGS[law])}
                own = {name: value for name, value in (table.settings or {}).items() if name in names}
                own = _with_matrices(SETTINGS[law], own, place, folder)
                settings |= as_document(given_values(SETTINGS[law], own, place))
        for key in ("criteria", "objectives", "constraints"):
            for name in getattr(table, key) or ():
                with part():
                    check_criterion(table, key, name)
    return table if table.settings is None else replace(table, settings=settings)


def _with_matrices(
    kind: type[LawSettings], settings: Mapping[str, Any], place: Place, folder: Path
) -> dict[str, Any]:
    """The settings with the matrices of the files that they name; a single row or column is a diagonal."""
    resolved = dict(settings)
    for entry in keys_of(kind):
        name = resolved.get(entry.name)
        unit = entry.says.unit or "1"
        if entry.says.matrix and isinstance(name, str) and isinstance(number_in(name, unit), str):
            with place.within(entry.name).prefix_errors(SettingError):
                matrix = read_matrix(folder / name)
                if matrix.size > _MOST_NUMBERS:
                    raise SettingError(
                        f"{name} has a matrix of {matrix.shape[0]} x {matrix.shape[1]} numbers, and a setting of a law "
                        f"has {_MOST_NUMBERS:,} at most; name another file"
                    )
            diagonal = 1 in matrix.shape and entry.name != "gain"
            resolved[entry.name] = (matrix.ravel() if diagonal else matrix).tolist()
    wishes = resolved.get("designed")
    if isinstance(wishes, dict) and isinstance(wishes.get("record"), str):
        resolved["designed"] = {**wishes, "record": str(folder / wishes["record"])}
    return resolved
