"""The dampers of a study: models and parameters, storeys and braces."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import islice
from math import cos, degrees, inf
from pathlib import Path
from typing import get_args

import numpy as np

from mrwork.base.keys import suggestion
from mrwork.base.numbers import counted
from mrwork.base.places import Place, read_each
from mrwork.base.units import CommandUnit, DriverUnit, number_in
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings import Building
from mrwork.buildings.frames import brace_across
from mrwork.buildings.from_file import refuse_without_masses
from mrwork.buildings.groups import refuse_other_drivers
from mrwork.buildings.matrices import Device
from mrwork.dampers.command import command_level
from mrwork.dampers.laws import MOST_DEGREE, CommandLaw, law_of, polynomial
from mrwork.dampers.spec import DamperSpec, damper, damper_models
from mrwork.dampers.tested_range import FittedDamper, OperatingRange
from mrwork.errors import RecordError, SettingError
from mrwork.study.schema import DamperTable

Identified = Callable[[Path], FittedDamper]
"""Reads the damper from the folder of an identified run."""


@array_dataclass()
class ChosenDamper:
    """A model with current laws and its parameters; the command lies between 0 and `largest_command`.

    `largest_command` is 1 for a passive damper, which follows no command. `tested` are the ranges of the tests of an
    identified run.
    """

    spec: DamperSpec
    theta: Floats
    largest_command: float
    source: str
    tested: OperatingRange | None = None


def chosen_damper(table: DamperTable, folder: Path, identified: Identified) -> ChosenDamper:
    """The damper of a table; the path of a run is relative to `folder`."""
    place = table.place
    _refuse_ambiguous(table)
    tested = None
    if table.preset is not None:
        draft, largest, source = _draft_of_preset(table, table.preset)
    elif table.run is not None:
        draft, tested, remark = _draft_of_run(table, folder, identified)
        largest = (
            None if tested is None or tested.command is None else command_level(tested.command[1], draft.unit)
        )
        source = f"run {table.run}" if isinstance(table.run, str) else "a fit"
        source = f"{source}, taken as {table.like}: {remark}" if table.like is not None else source
    else:
        unit = table.unit or "A"
        draft = _Draft(plain=_model(place, table.model), laws={}, values={}, unit=unit, lag=None)
        largest, source = None, "parameters of the study"
    draft = _change_draft(draft, table)
    missing = [name for name in draft.plain.names if name not in draft.values]
    if missing:
        place.refuse(
            f"{place.table} has no {', '.join(missing)} of {draft.plain.name}; add to its parameters"
        )
    spec = draft.plain.with_current_laws(draft.laws, unit=draft.unit, lagged=draft.lag is not None)
    _refuse_unless_passive(table, spec, source)
    if table.unit is not None and table.unit != draft.unit and spec.follows_command:
        place.within("unit").refuse(
            f"the command of this damper ({source}) is in {draft.unit}; leave unit out"
        )
    largest = _largest_given(table, draft.unit) or largest
    if not largest and spec.follows_command:
        place.refuse(
            f"{place.table} has no largest_command; give the largest command of the driver [{draft.unit}]"
        )
    numbers = [number for name in draft.plain.names for number in draft.values[name]]
    theta = np.array([*numbers, *([] if draft.lag is None else [draft.lag])])
    return ChosenDamper(spec=spec, theta=theta, largest_command=largest or 1.0, source=source, tested=tested)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Draft:
    """A damper under construction: laws of its parameters and their coefficients by name."""

    plain: DamperSpec
    laws: Mapping[str, CommandLaw]
    values: Mapping[str, tuple[float, ...]]
    unit: CommandUnit
    lag: float | None


def _largest_given(table: DamperTable, unit: CommandUnit) -> float | None:
    """The largest command of the table in the unit of the damper; `None` if it has none."""
    given, place = table.largest_command, table.place.within("largest_command")
    if isinstance(given, str):
        number = number_in(given, unit)
        if isinstance(number, str):
            place.refuse(f"largest_command {number}")
        given = number
    if given is not None and not 0.0 < given < inf:
        place.refuse(f"largest_command is {given:g}; give a positive number [{unit}]")
    return given


def _refuse_unless_passive(table: DamperTable, spec: DamperSpec, source: str) -> None:
    """Refuse an undeclared damper without current laws, and a damper declared as passive that has them."""
    place = table.place
    if not spec.follows_command and not table.passive:
        place.refuse(
            f"no parameter of this {spec.name} ({source}) depends on the command, so that i = 0, the largest command "
            "and every control law would give the same response; identify it from tests at several commands with "
            "mrwork identify --law, or give its laws, or add passive = true to take it as a passive damper"
        )
    if not table.passive:
        return
    if spec.follows_command:
        place.within("passive").refuse(
            f"passive is true, and {', '.join(spec.following)} of this {spec.name} depend on the command; leave "
            "passive out, the damper at a constant command is the law passive_off, passive_on or best_passive"
        )
    for name in ("largest_command", "lag"):
        if getattr(table, name) is not None:
            place.within(name).refuse(f"a passive damper takes no command; leave {name} out")


def _refuse_ambiguous(table: DamperTable) -> None:
    given = [name for name in ("preset", "run") if getattr(table, name) is not None]
    if len(given) == 2:
        table.place.refuse(f"{table.place.table} has a preset and a run; give one of them")
    if not given and table.model is None:
        table.place.refuse(
            f"{table.place.table} names no damper; give a preset, a run, or a model with parameters"
        )
    if table.run is None and table.like is not None:
        table.place.within("like").refuse("like is fitted to the force of a run; leave it out, or give a run")
    if table.run is not None and table.model is not None:
        table.place.within("model").refuse("the model is that of the run; leave model out")


def _model(place: Place, name: str | DamperSpec | None, key: str = "model") -> DamperSpec:
    if name is None:
        place.refuse(f"{place.table} has no model")
    if isinstance(name, DamperSpec):
        return name.without_laws
    known = [spec.name for spec in damper_models()]
    if name not in known:
        near = suggestion(name, known)
        place.within(key).refuse(f"no damper model is called {name!r}{near}")
    return damper(name)


def _draft_of_preset(table: DamperTable, name: str) -> tuple[_Draft, float | None, str]:
    place = table.place
    models = damper_models() if table.model is None else (_model(place, table.model),)
    having = [spec for spec in models if name in spec.presets]
    if not having:
        known = sorted({preset for spec in models for preset in spec.presets})
        near = suggestion(name, known, otherwise="there are" if table.model is None else f"{table.model} has")
        place.within("preset").refuse(f"no published set is called {name!r}{near}")
    if len(having) > 1:
        several = " and ".join(spec.name for spec in having)
        place.within("preset").refuse(f"{name!r} is a set of {several}; choose one with model")
    preset = having[0].preset(name)
    draft = _draft(preset.spec, preset.theta)
    return draft, preset.largest_command, f"{name}, {preset.status}: {preset.source}"


def _draft_of_run(
    table: DamperTable, folder: Path, identified: Identified
) -> tuple[_Draft, OperatingRange | None, str]:
    try:
        fitted = fitted_of(table, folder, identified)
    except RecordError as error:
        table.place.within("run").refuse(str(error))
    unit = fitted.spec.command_unit
    if fitted.spec.follows_command and unit not in get_args(DriverUnit):
        table.place.within("run").refuse(
            f"the damper of this run follows a command in {unit}, and a controller sends a current or a "
            "voltage; identify it from tests with their current or voltage"
        )
    return _draft(fitted.spec, fitted.theta), fitted.tested, fitted.remark


def fitted_of(table: DamperTable, folder: Path, identified: Identified) -> FittedDamper:
    """The fit of a table or of its run folder, relative to `folder`, or the model that takes its place."""
    assert table.run is not None
    fitted = identified(folder / table.run) if isinstance(table.run, str) else table.run
    if table.like is None or fitted.like is None:
        return fitted
    return fitted.like(_model(table.place, table.like, "like").name)


def _draft(spec: DamperSpec, theta: tuple[float, ...]) -> _Draft:
    # Coefficients in the order of the parameters, then the rate of the lag.
    numbers = iter(theta)
    return _Draft(
        plain=spec.without_laws,
        laws=spec.laws_by_name,
        values={name: tuple(islice(numbers, law.n_coefficients)) for name, law in spec.laws_by_name.items()},
        unit=spec.command_unit or "A",
        lag=next(numbers, None),
    )


def _change_draft(draft: _Draft, table: DamperTable) -> _Draft:
    """The draft with the laws, parameters and lag that the table gives."""
    laws, values = dict(draft.laws), dict(draft.values)
    place = table.place.within("parameters")
    for name, given in (table.parameters or {}).items():
        _refuse_unknown(draft.plain, name, place)
        coefficients = given if isinstance(given, tuple) else (given,)
        values[name] = coefficients
        if not 1 <= len(coefficients) <= MOST_DEGREE + 1:
            place.within(name).refuse(
                f"{name} has {len(coefficients)} coefficients; give 1 to {MOST_DEGREE + 1}"
            )
        laws[name] = polynomial(len(coefficients) - 1)
    place = table.place.within("laws")
    for name, law in (table.laws or {}).items():
        _refuse_unknown(draft.plain, name, place)
        laws[name] = law_of(law)
        expected = laws[name].n_coefficients
        if name in values and len(values[name]) != expected:
            place.within(name).refuse(
                f"{name} with the law {law} takes {expected} coefficients, {len(values[name])} are given"
            )
    lag = draft.lag if table.lag is None else table.lag
    return _Draft(plain=draft.plain, laws=laws, values=values, unit=draft.unit, lag=lag)


def _refuse_unknown(plain: DamperSpec, name: str, place: Place) -> None:
    if name not in plain.names:
        near = suggestion(name, plain.names, otherwise="it has")
        place.within(name).refuse(f"{plain.name} has no parameter {name!r}{near}")


# Angle of a damper that no drift stretches.
_UPRIGHT = 1.57
# Mass of a joint over the mean mass of a floor, negligible for the building.
_JOINT_SHARE = 1e-3


def choose_dampers(tables: Sequence[DamperTable], folder: Path, identified: Identified) -> list[ChosenDamper]:
    """The dampers of the tables, each read by itself."""
    return read_each(lambda table: chosen_damper(table, folder, identified), tables)


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherSet:
    """Another set of laws that predicts nearly as well: fitted dampers by run, and the dampers of the tables."""

    fitted: Mapping[Path, FittedDamper]
    dampers: tuple[ChosenDamper, ...]


def other_sets(tables: Sequence[DamperTable], folder: Path, identified: Identified) -> tuple[OtherSet, ...]:
    """The sets that every run of the tables has, and that the tables do not refuse."""
    own = (each.run for each in tables if isinstance(each.run, str) and each.like is None)
    runs = {folder / run: identified(folder / run) for run in own}
    sets = []
    for wanted in next((run.others for run in runs.values() if run.others), ()):
        fitted = {
            path: wanted if wanted in run.others else other
            for path, run in runs.items()
            for other in run.others
            if other.spec == wanted.spec
        }
        with suppress(SettingError, KeyError):
            dampers = tuple(chosen_damper(each, folder, fitted.__getitem__) for each in tables)
            groups = [
                Device(
                    name="", spec=each.spec, theta=each.theta, row=[1.0], largest_command=each.largest_command
                )
                for each in dampers
            ]
            refuse_other_drivers(groups)
            sets.append(OtherSet(fitted=fitted, dampers=dampers))
    return tuple(sets)


def equip_building(
    bare: Building, tables: Sequence[DamperTable], chosen: Sequence[ChosenDamper]
) -> tuple[Building, tuple[Device, ...]]:
    """The building with braces, and its devices."""
    for table in tables:
        if table.row is None:
            refuse_without_masses(bare, table.place)
    building, rows = bare, read_each(partial(_row_of, bare), tables)
    for number, table in enumerate(tables):
        if table.brace is not None:
            mass = table.brace.mass or _JOINT_SHARE * bare.total_mass / len(bare.floor_names)
            with table.place.within("brace").prefix_errors(SettingError):
                row = np.append(rows[number], np.zeros(building.n_coordinates - len(rows[number])))
                where = bare.storey_name(table.storey)
                building = brace_across(
                    building,
                    row,
                    where,
                    stiffness=table.brace.stiffness,
                    damping=table.brace.damping,
                    mass=mass,
                    name=table.name or f"damper in {where}",
                )
            rows[number] = building.storeys[-1]
    devices: list[Device] = []
    for table, one, row in zip(tables, chosen, rows, strict=True):
        # Braces of later dampers add coordinates, which do not move this one.
        whole = np.append(row, np.zeros(building.n_coordinates - len(row)))
        name = table.name or f"damper in {bare.storey_name(table.storey)}"
        before = 0 if table.name else sum(device.name.startswith(name) for device in devices)
        if table.name in [device.name for device in devices]:
            table.place.within("name").refuse(
                f"two dampers are called {table.name!r}; give each its own name"
            )
        with table.place.prefix_errors(SettingError):
            devices.append(
                Device(
                    name=f"{name}, number {before + 1}" if before else name,
                    spec=one.spec,
                    theta=one.theta,
                    row=whole,
                    count=table.count,
                    differential=table.differential,
                    largest_command=one.largest_command,
                    tested=one.tested,
                    rated_force=table.rated_force,
                    rated_stroke=table.rated_stroke,
                )
            )
            refuse_other_drivers(devices)
    return building, tuple(devices)


def _row_of(bare: Building, table: DamperTable) -> Floats:
    """Stretch of the dampers of a table over the coordinates of the bare building."""
    with table.place.within("storey").prefix_errors(SettingError):
        row = bare.storey_row(table.storey)
    if table.row is None:
        angle = table.angle or 0.0
        if angle >= _UPRIGHT:
            table.place.within("angle").refuse(
                f'angle is {angle:g} rad, {degrees(angle):.4g} deg; give one below 90 deg, as "38 deg"'
            )
        return cos(angle) * row
    place = table.place.within("row")
    if table.angle is not None:
        place.refuse("angle and row both say how the damper stands; keep one")
    if len(table.row) != bare.n_coordinates or not any(table.row):
        place.refuse(
            f"row has {counted(len(table.row), 'number')} for {counted(bare.n_coordinates, 'coordinate')} of "
            f"{bare.name}; give one for each, not all 0"
        )
    return np.array(table.row)
