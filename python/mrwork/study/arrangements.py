"""Arrangements that a study compares: without dampers, i = 0, baselines, control laws.

A law may stand in a Python file of its user, which is run as Python when the study is read.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mrwork.base.documents import given_values
from mrwork.base.keys import as_document, keys_of, look_up, refuse_missing, suggestion
from mrwork.base.places import Place, all_mistakes, keyed, read_each
from mrwork.base.units import number_in
from mrwork.buildings import Building
from mrwork.buildings.from_file import BuildingTable
from mrwork.buildings.groups import largest_command, products_of, refuse_rate, sends_forces, sends_shares
from mrwork.closed_loop.user_law import UserLaw
from mrwork.control.laws.control_law import ControlLaw, control_law, refuse_units
from mrwork.control.laws.law_problem import DesignProblem, LawSettings
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.errors import InvalidSettingError, SettingError
from mrwork.files.matrices import read_matrix
from mrwork.store.codec import digest_of
from mrwork.store.user_python import run_file, text_to_compare
from mrwork.study.dampers import condensed_for
from mrwork.study.row_kinds import Kind
from mrwork.study.schema import (
    CONSTANT_LAWS,
    PASSIVE_OFF,
    BaselineTable,
    ControllerTable,
    LawFileTable,
    StudyTable,
    TuneTable,
)
from mrwork.study.study import Arrangement, NamedLaw, Row, StudyLaw, constant_share


def own_law_of(table: LawFileTable, folder: Path) -> ControlLaw:
    """The law that `mr.own_law` has made in the file of a table.

    Raises
    ------
    SettingError
        If the file has none of that name.
    """
    if isinstance(table.file, ControlLaw):
        return table.file
    if not isinstance(table.file, str):
        raise InvalidSettingError(
            "law", "law is a name in a file, and file is a function; give the name of the file"
        )
    with keyed("file"):
        module, _ = run_file(folder / table.file, what="a law")
    laws = {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, ControlLaw) and value.spec.own is not None
    }
    with keyed("law"):
        sentence = f"{table.file} has no {table.law!r} that mr.own_law has made"
        return look_up(table.law, laws, sentence, otherwise="it has", kind=SettingError)


def _load_law(table: LawFileTable, folder: Path) -> UserLaw:
    name = table.function
    if isinstance(table.file, str):
        with keyed("file"):
            module, text = run_file(folder / table.file, what="a law")
        functions = {key: value for key, value in vars(module).items() if callable(value)}
        with keyed("function"):
            function = look_up(name, functions, f"{table.file} has no function {name!r}", otherwise="it has")
    elif isinstance(table.file, ControlLaw):
        raise InvalidSettingError(
            "function", "file is a law that mr.own_law has made; give law in place of function"
        )
    else:
        function, text = table.file, text_to_compare(table.file)
    with keyed("function"):
        return UserLaw(
            name=name,
            command=function,
            n_memory=table.memory,
            rms_time=table.rms_time,
            source=digest_of(text),
        )


def arrangements(
    table: StudyTable,
    bare: Building,
    problem: DesignProblem,
    folder: Path,
    found: Sequence[FoundLaw],
) -> tuple[Arrangement, ...]:
    """The building without dampers, with them at i = 0, the baselines, and every control law with its settings."""
    devices = problem.all_devices
    none = Row(label="uncontrolled", kind="uncontrolled", description="the building without dampers")
    without = Arrangement(row=none, bare=bare, building=bare, devices=(), law=constant_share((), 0.0))
    off = Row(label=PASSIVE_OFF, kind="passive_off", description="the dampers without a command")
    driven = [device for device in devices if device.is_commanded and not device.is_actuator]
    if not (driven or any(device.spec.follows_command and not device.is_actuator for device in devices)):
        off = Row(label="passive", kind="passive_off", description="the dampers, which follow no command")
    at_zero = replace(
        without, row=off, building=problem.building, devices=devices, law=constant_share(devices, 0.0)
    )

    def arranged(at: tuple[str, int]) -> Arrangement:
        kind, number = at
        with keyed(*at):
            if kind == "baseline":
                return _baseline(table.baseline[number], table, without, folder)
            return _arrange_controller(
                table.controller[number], number, found[number], problem, at_zero, folder
            )

    numbers = (("baseline", len(table.baseline)), ("controller", len(table.controller)))
    further = read_each(arranged, [(kind, number) for kind, count in numbers for number in range(count)])
    # The row at i = 0 exists already; only its label may differ.
    labels = [each.row.label for each in further if each.row.kind == "passive_off" and each.row.label]
    further = [each for each in further if each.row.kind != "passive_off"]
    # Actuators alone at rest are the building without dampers.
    at_rest = all(device.is_actuator for device in devices)
    first = [] if at_rest else [replace(at_zero, row=replace(off, label=[off.label, *labels][-1]))]
    listed = [arrangement.row for arrangement in (*first, *further)]
    # Best constant commands that a study has without listing them.
    for name in ("best_passive", "best_passive_by_group")[: len(products_of(driven))]:
        law = CONSTANT_LAWS[name]
        if table.references == "none" or law.kind in [row.kind for row in listed]:
            continue
        label = f"{law.title} (added)" if law.title in [row.label for row in listed] else law.title
        row = Row(label=label, kind=law.kind, description=f"{name}, added")
        first.append(replace(at_zero, row=row, law=None, added=True))
    return (without, *first, *further)


def _arrange_controller(
    controller: ControllerTable,
    number: int,
    found: FoundLaw,
    problem: DesignProblem,
    at_zero: Arrangement,
    folder: Path,
) -> Arrangement:
    """The building with its dampers under the law of a table; one at i = 0 has a label if the table has."""
    if not problem.devices:
        raise SettingError("a control law needs dampers, and the study has none; give a [[damper]]")
    of_own = ""
    if controller.user is not None and controller.user.law:
        of_own = (
            f" of {controller.user.file}" if isinstance(controller.user.file, str) else ", a law of the user"
        )
        controller = replace(controller, law=found.name, user=None)
    _refuse_command(controller, problem)
    limited, unit = _limit_command(controller, problem)
    slope = controller.slope_in(unit)
    refuse_rate(limited.devices, math.inf if unit == "N" else slope, "command_slope")
    name, user, named = controller.law, controller.user, None
    law: StudyLaw | None = None
    kind: Kind = "actuator" if unit == "N" else "controller"
    if user is not None:
        of_file = f" of {user.file}" if isinstance(user.file, str) else ""
        title, description = user.function, f"{user.function}{of_file}, in Python"
        with keyed("user"):
            law = _load_law(user, folder)
    elif controller.process is not None:
        law, (program, *arguments) = controller.process, controller.process.program or ("",)
        if os.sep in program:
            # A name without a folder is that of a program on the PATH.
            law = replace(law, program=(str(folder.absolute() / program), *arguments))
        title, description = law.name, f"{law.place}, outside Python"
    elif found.settings is None:
        constant, description = CONSTANT_LAWS[name], name
        title, kind = constant.title, constant.kind
        if kind == "best_passive_by_group" and len(products_of(problem.devices)) < 2:
            raise InvalidSettingError(
                "law",
                "best_passive_by_group is for groups of different dampers, and all are equal; give best_passive",
            )
        if constant.share is not None:
            law = constant_share(limited.devices, constant.share)
            law = replace(law, dead_zone=controller.dead_zone, command_slope=slope)
    else:
        title = control_law(name).title
        description = f"{title}{of_own}" if of_own else name
        kind = "passive" if SETTINGS[name].constant else kind
        named = NamedLaw(table=controller, number=number, given=found.settings, problem=limited)
    label = controller.label if kind == "passive_off" else controller.label or title
    row = Row(label=label, kind=kind, description=description)
    if named is not None and named.is_complete:
        law, named = named.design(limited, {}), None
    if named is not None and sends_forces(problem.devices):
        (lacking, *_) = named.missing
        sentence = f"{name} has no {lacking.name}, which follows from the response of dampers alone"
        raise InvalidSettingError("law", f"{sentence}; give it in settings, or a gain")
    return replace(at_zero, row=row, devices=limited.all_devices, law=law, named=named)


def _limit_command(controller: ControllerTable, problem: DesignProblem) -> tuple[DesignProblem, str]:
    """The problem with devices that get at most the command of a table, and the unit of the commands."""
    spec = None if controller.law in ("", *CONSTANT_LAWS) else control_law(controller.law)
    unit, shares = problem.devices[0].command_unit or "A", sends_shares(problem.devices)
    available = largest_command(problem.devices)
    if unit != "N" and spec is not None and spec.commands_force:
        # Actuators replace the dampers, and the law has their limit; a wrong one is refused by its key here.
        limit = controller.command_in("largest_command", "N")
        if not isinstance(controller.largest_command, str) and limit is not None and limit <= available:
            says = f"largest_command is {limit:g}, which is a command of the dampers, and {spec.name} sends forces"
            raise InvalidSettingError("largest_command", f'{says}; give it with its unit, as "50 kN"')
        return problem, "N"
    limit = controller.command_in("largest_command", "1" if shares else unit)
    if limit is None:
        return problem, unit
    if limit <= available:
        return problem.limited_to(limit), unit
    most = f"the {'actuators give' if unit == 'N' else 'driver of the dampers gives'} {available:g} at most"
    if shares:
        most = 'of dampers in A beside others in V it is a share of the largest command of each, as "80 %"'
    raise InvalidSettingError("largest_command", f"largest_command is {limit:g}, and {most}")


def _refuse_command(controller: ControllerTable, problem: DesignProblem) -> None:
    """Refuse a law that the dampers cannot have, as passive ones."""
    constant = CONSTANT_LAWS.get(controller.law)
    key, name = "law", controller.law
    if controller.process is not None:
        key, name = "process", controller.process.in_words
    elif controller.user is not None:
        key, name = "user", f"{controller.user.function} in Python"
    of_registry = control_law(name) if key == "law" and constant is None else None
    # An active law replaces the dampers by actuators.
    needs_command = of_registry is None or not of_registry.commands_force
    needs_command &= constant is None or constant.share != 0.0
    if needs_command and not any(device.is_commanded for device in problem.devices):
        raise InvalidSettingError(
            key,
            f"{name} commands the dampers, and they are passive or hold a command; leave this law out, or give a "
            "damper that follows a command",
        )
    if key == "law":
        with keyed(key):
            refuse_units(of_registry or control_law("passive"), problem.devices)


def baseline_building(changes: BuildingTable, table: StudyTable, folder: Path) -> Building:
    """The building of a study with the keys that a baseline replaces or adds."""
    return condensed_for(table.building.override_with(changes).build(folder), table)


def _baseline(baseline: BaselineTable, table: StudyTable, without: Arrangement, folder: Path) -> Arrangement:
    bare = without.bare
    with keyed("building"):
        changed = baseline_building(baseline.building, table, folder)
        names = {*changed.floor_names, *changed.storey_names}
        missing = [name for name in (*bare.floor_names, *bare.storey_names) if name not in names]
        if missing:
            raise SettingError(
                f"the baseline has no {missing[0]}; it may add floors and storeys to the building, not remove them"
            )
    row = Row(label=baseline.label, kind="baseline", description=changed.name)
    return replace(without, row=row, building=changed)


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundLaw:
    """The law of a table by its name, with the settings that the table gives in SI; `None` for a law without any."""

    name: str
    settings: Mapping[str, Any] | None


def found_law(table: ControllerTable, place: Place, folder: Path) -> FoundLaw:
    """The law of a table with its settings; a constant command and a function of rows have none.

    Names of files with matrices are relative to `folder`.
    """
    if table.user is not None and table.user.law:
        with place.within("user").prefix_errors(SettingError):
            name = own_law_of(table.user, folder).name
        where = place if table.settings is None else place.within("settings")
        return FoundLaw(
            name=name, settings=_values_of(SETTINGS[name], dict(table.settings or {}), where, folder)
        )
    if table.user is not None or table.process is not None or table.law in CONSTANT_LAWS:
        return FoundLaw(name=table.law, settings=None)
    return FoundLaw(name=table.law, settings=_settings_of_law(table, place, folder))


def _settings_of_law(table: ControllerTable, place: Place, folder: Path) -> Mapping[str, Any]:
    if table.law not in SETTINGS:
        near = suggestion(table.law, [*SETTINGS, *CONSTANT_LAWS])
        raise InvalidSettingError("law", f"no control law is called {table.law!r}{near}")
    kind, settings = SETTINGS[table.law], dict(table.settings or {})
    where = place if table.settings is None else place.within("settings")
    if table.gain is not None:
        if "gain" not in _names_of(kind):
            taking = ", ".join(name for name, other in SETTINGS.items() if "gain" in _names_of(other))
            sentence = f"{table.law} has no gain of a desired force; leave it out, or choose one of {taking}"
            raise InvalidSettingError("gain", sentence)
        settings["gain"] = table.gain if isinstance(table.gain, str) else [list(row) for row in table.gain]
    values = _values_of(kind, settings, where, folder)
    for entry in keys_of(kind):
        if entry.is_required and entry.says.span is None and entry.name not in values:
            # Nothing in the response of the dampers tells it.
            refuse_missing(entry, where)
    return values


def _names_of(kind: type[LawSettings]) -> set[str]:
    return {entry.name for entry in keys_of(kind)}


def resolve_settings(table: TuneTable, place: Place, folder: Path) -> TuneTable:
    """A table whose settings, if any, are in SI, with the matrices of the files that they name.

    Settings that a law does not have are left to the tuning, which refuses them.
    """
    if table.user is not None:
        with place.within("user").prefix_errors(SettingError):
            table = replace(table, laws=(own_law_of(table.user, folder).name,), user=None)
    if table.settings is None:
        return table
    settings, where = dict(table.settings), place.within("settings")
    with all_mistakes() as part:
        for kind in map(SETTINGS.__getitem__, table.laws):
            with part():
                subset = {name: value for name, value in table.settings.items() if name in _names_of(kind)}
                settings |= as_document(_values_of(kind, subset, where, folder))
    return replace(table, settings=settings)


def _values_of(
    kind: type[LawSettings], settings: Mapping[str, Any], place: Place, folder: Path
) -> dict[str, Any]:
    """Settings in SI, with the matrices of the files that they name; a single row or column is a diagonal."""
    resolved = dict(settings)
    for entry in keys_of(kind):
        value = resolved.get(entry.name)
        unit = entry.says.unit or "1"
        if entry.says.matrix and isinstance(value, str) and isinstance(number_in(value, unit), str):
            with place.within(entry.name).prefix_errors(SettingError):
                matrix = read_matrix(folder / value)
            diagonal = 1 in matrix.shape and entry.name != "gain"
            resolved[entry.name] = (matrix.ravel() if diagonal else matrix).tolist()
    wishes = resolved.get("designed")
    if isinstance(wishes, dict) and isinstance(wishes.get("record"), str):
        resolved["designed"] = {**wishes, "record": str(folder / wishes["record"])}
    return given_values(kind, resolved, place)
