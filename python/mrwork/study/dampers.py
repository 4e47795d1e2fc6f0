"""The dampers of a study: models and parameters, storeys and braces."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain, islice
from math import cos, inf
from pathlib import Path
from typing import TypeAlias, get_args
from warnings import warn

import numpy as np

from mrwork.base.keys import check_known
from mrwork.base.numbers import counted
from mrwork.base.places import keyed, read_each
from mrwork.base.summary import named
from mrwork.base.units import DriverUnit
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.device import Device, ideal_actuator
from mrwork.buildings.frames import brace_across
from mrwork.buildings.from_file import refuse_without_masses
from mrwork.buildings.state_space import static_condensation
from mrwork.dampers.command import command_level
from mrwork.dampers.dependence import MOST_DEGREE, Dependence, dependence_of
from mrwork.dampers.spec import DamperSpec, Preset, damper, damper_models
from mrwork.dampers.tested_range import FittedDamper
from mrwork.errors import InvalidSettingError, MrworkWarning, SettingError
from mrwork.store.codec import built
from mrwork.store.input_file import FileKind, text_of
from mrwork.study.schema import DamperTable, StudyTable

_MODEL = FileKind(
    name="a damper model",
    largest=16 << 20,
    remedy="give a file that to_toml of a study has written",
)

Identified = Callable[[Path], FittedDamper]
"""Reads the damper from the folder of an identified run."""


def chosen_damper(table: DamperTable, folder: Path, identified: Identified) -> tuple[Device, str]:
    """The dampers of a table, without a row in the building, and where their parameters are from.

    The path of a run is relative to `folder`.
    """
    if table.actuator:
        largest_force = inf if table.largest_force is None else table.largest_force
        return ideal_actuator(name="the actuator", row=(), largest_force=largest_force), "an ideal actuator"
    known: Preset | FittedDamper | None = None
    largest: float | None = None
    if table.preset is not None:
        known = _preset(table, table.preset)
        source, largest = f"{table.preset}, {known.status}: {known.source}", known.largest_command
    elif table.run is not None:
        known = fitted_of(table, folder, identified)
        largest = _largest_tested(known)
        source = f"run {table.run}" if isinstance(table.run, str) else "a fit"
        if table.like is not None:
            warn(
                f"like = {table.like!r} is passed over: {source} is simulated itself",
                MrworkWarning,
                stacklevel=2,
            )
    else:
        source = "parameters of the study"
    known_spec = known.spec if known is not None else _model_of(table, folder)
    plain, unit = known_spec.without_laws, known_spec.command_unit or table.unit or "A"
    laws, values, lag = _parameters(table, known_spec, () if known is None else known.theta)
    if missing := [name for name in plain.names if name not in values]:
        raise SettingError(f"[[damper]] has no {', '.join(missing)} of {plain.name}; add to its parameters")
    spec = plain.with_current_laws(laws, unit=unit)
    _refuse_unless_passive(table, spec, source)
    if table.unit is not None and table.unit != unit and spec.follows_command:
        sentence = f"the command of this damper ({source}) is in {unit}; leave unit out"
        raise InvalidSettingError("unit", sentence)
    given = table.command_in("largest_command", unit)
    largest = largest if given is None else given
    if largest is None and spec.follows_command:
        raise SettingError(
            f"[[damper]] has no largest_command; give the largest command of the driver [{unit}]"
        )
    rated = known if isinstance(known, Preset) else table
    return Device(
        name="the damper",
        spec=spec,
        theta=[*chain(*(values[name] for name in plain.names))],
        row=(),
        largest_command=largest or 0.0,
        lag=lag,
        command=table.command_in("command", unit),
        tested=known.tested if isinstance(known, FittedDamper) else None,
        rated_force=table.rated_force or rated.rated_force,
        rated_stroke=table.rated_stroke or rated.rated_stroke,
        rated_command=known.largest_command if isinstance(known, Preset) else None,
    ), source


def _largest_tested(fitted: FittedDamper) -> float | None:
    """The largest tested command of a fit, `None` if unknown; a command that no controller sends is refused."""
    unit = fitted.spec.command_unit
    if fitted.spec.follows_command and unit not in get_args(DriverUnit):
        raise InvalidSettingError(
            "run",
            f"the damper of this run follows a command in {unit}, and a controller sends a current or a "
            "voltage; identify it from tests with their current or voltage",
        )
    commands = fitted.tested and fitted.tested.command
    return command_level(commands[1], unit or "A") if commands else None


def _refuse_unless_passive(table: DamperTable, spec: DamperSpec, source: str) -> None:
    """Refuse an undeclared damper without current laws, and a damper declared as passive that has them."""
    if not spec.follows_command and not table.passive:
        raise SettingError(
            f"no parameter of this {spec.name} ({source}) depends on the command, so that i = 0, the largest command "
            "and every control law would give the same response; identify it from tests at several commands with "
            "mrwork identify --law, or give its laws, or add passive = true to take it as a passive damper"
        )
    if spec.follows_command and table.passive:
        raise InvalidSettingError(
            "passive",
            f"passive is true, and {', '.join(spec.following)} of this {spec.name} depend on the command; leave "
            "passive out, and give command = 0 or another one to hold, or a law such as best_passive",
        )
    if table.passive and table.largest_command is not None:
        raise InvalidSettingError(
            "largest_command", "a passive damper takes no command; leave largest_command out"
        )


def _model(name: str | DamperSpec | None, key: str = "model") -> DamperSpec:
    if isinstance(name, DamperSpec):
        return name.without_laws
    with keyed(key):
        return damper(name or "")


def _model_of(table: DamperTable, folder: Path) -> DamperSpec:
    """The model of a table; that of a file is formulas, and nothing in it is run."""
    if table.model_file is None:
        return _model(table.model)
    with keyed("model_file"):
        text = text_of(folder / table.model_file, _MODEL)
        try:
            spec: DamperSpec = built(DamperSpec, json.loads(text))
            fault = spec.disagreement()
        except (ValueError, TypeError, KeyError, AttributeError, StopIteration, RecursionError) as error:
            raise SettingError(f"{table.model_file} is no damper model: {error}; {_MODEL.remedy}") from None
        if fault or spec.own is None:
            raise SettingError(
                f"{table.model_file} is no damper of a user{fault and f': it {fault}'}; {_MODEL.remedy}"
            )
        spec.core_name  # noqa: B018 # refuses a damaged formula
    return spec


def _preset(table: DamperTable, name: str) -> Preset:
    models = damper_models() if table.model is None else (_model(table.model),)
    having = [spec for spec in models if name in spec.presets]
    with keyed("preset"):
        presets = sorted({preset for spec in models for preset in spec.presets})
        there = "there are" if table.model is None else f"{table.model} has"
        check_known(name, presets, f"no published set is called {name!r}", otherwise=there)
        if len(having) > 1:
            several = " and ".join(spec.name for spec in having)
            raise SettingError(f"{name!r} is a set of {several}; choose one with model")
        return having[0].preset(name)


def fitted_of(table: DamperTable, folder: Path, identified: Identified) -> FittedDamper:
    """The fit of a table or of its run folder, relative to `folder`."""
    assert table.run is not None
    with keyed("run"):
        return identified(folder / table.run) if isinstance(table.run, str) else table.run


# The rate of a lag, or its rates of a rising and of a falling current [1/s]; `None` without a lag.
_Rates: TypeAlias = float | tuple[float, float] | None


def _parameters(
    table: DamperTable, known: DamperSpec, theta: Sequence[float]
) -> tuple[dict[str, Dependence], dict[str, tuple[float, ...]], _Rates]:
    """Laws of the parameters, their coefficients, and the rates of the lag: as known, with changes that are given."""
    laws, values = known.laws_by_name, dict[str, tuple[float, ...]]()
    lag: _Rates = table.lag
    plain = known.without_laws
    if theta:
        # Coefficients in the order of the parameters, then the rates of the lag.
        numbers = iter(theta)
        values = {name: tuple(islice(numbers, law.n_coefficients)) for name, law in laws.items()}
        if lag is None:
            first, second = next(numbers, None), next(numbers, None)
            lag = first if first is None or second is None else (first, second)
    has = f"{plain.name} has no parameter"
    for name, value in (table.parameters or {}).items():
        with keyed("parameters", name):
            check_known(name, plain.names, f"{has} {name!r}", otherwise="it has")
            values[name] = value if isinstance(value, tuple) else (value,)
            count, most = len(values[name]), MOST_DEGREE + 1
            if not 1 <= count <= most:
                raise SettingError(f"{name} has {count} coefficients; give 1 to {most}")
            laws[name] = Dependence(count - 1)
    for name, law in (table.laws or {}).items():
        with keyed("laws", name):
            check_known(name, plain.names, f"{has} {name!r}", otherwise="it has")
            laws[name] = dependence_of(law)
            expected, count = laws[name].n_coefficients, len(values.get(name, ()))
            if name in values and count != expected:
                raise SettingError(
                    f"{name} with the law {law} takes {expected} coefficients, {count} are given"
                )
    return laws, values, lag


# Mass of a joint over the mean mass of a floor, negligible for the building.
_JOINT_SHARE = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherSet:
    """Another set of laws that predicts nearly as well: fitted dampers by run, and the dampers of the tables."""

    fitted: Mapping[Path, FittedDamper]
    dampers: tuple[Device, ...]


def other_sets(tables: Sequence[DamperTable], folder: Path, identified: Identified) -> tuple[OtherSet, ...]:
    """The sets that every run of the tables has, and that the tables do not refuse."""
    names = (table.run for table in tables if isinstance(table.run, str))
    fits = {folder / run: identified(folder / run) for run in names}
    sets = []
    for wanted in next((fit.others for fit in fits.values() if fit.others), ()):
        fitted = {
            path: wanted if wanted in fit.others else other
            for path, fit in fits.items()
            for other in fit.others
            if other.spec == wanted.spec
        }
        with suppress(SettingError, KeyError):
            dampers = tuple(chosen_damper(table, folder, fitted.__getitem__)[0] for table in tables)
            sets.append(OtherSet(fitted=fitted, dampers=dampers))
    return tuple(sets)


# Period over the step, below which a coordinate is far stiffer; those of periods below the step go along with it.
_FAR_STIFFER = 0.1


def condensed_for(building: Building, table: StudyTable) -> Building:
    """A building of a study without coordinates that are far stiffer than its step, if no damper names them."""
    if table.building.condense is False:
        return building
    rows = (_of_building(building, damper.row) for damper in table.damper if damper.row is not None)
    keep = np.array([row for row in rows if row.size == building.n_coordinates])
    step = table.hardware.sample_time / table.hardware.steps
    few = static_condensation(building, shortest_period=_FAR_STIFFER * step, keep=keep)
    return few if few is building else static_condensation(building, shortest_period=step, keep=keep)


def _of_building(building: Building, row: Sequence[float]) -> Floats:
    """A row over the coordinates of a building, of which the row may also have those that were condensed."""
    whole, kept = np.array(row), building.kept
    if whole.size != len(kept) + len(building.condensed):
        return whole
    if np.delete(whole, kept).any():
        sentence = (
            f"row moves a coordinate of {building.name} that has no mass and is condensed; give it a mass"
        )
        raise InvalidSettingError("row", sentence)
    return whole[kept]


def equip_building(
    bare: Building, tables: Sequence[DamperTable], chosen: Sequence[Device]
) -> tuple[Building, tuple[Device, ...]]:
    """The building with braces, and the chosen devices in their places."""
    rows = read_each(lambda number: _row_of(bare, tables[number], number), range(len(tables)))
    building, names = bare, list[str]()
    for number, table in enumerate(tables):
        storey = bare.storey_name(table.storey)
        name = table.name or f"{'actuator' if table.actuator else 'damper'} in {storey}"
        if (brace := table.brace) is not None:
            with keyed("damper", number, "brace"):
                building = brace_across(
                    building,
                    rows[number],
                    storey,
                    **named(brace, "stiffness", "damping"),
                    mass=brace.mass or _JOINT_SHARE * bare.reference_mass / len(bare.floor_names),
                    name=name,
                )
            # The coordinate that the brace adds does not move other dampers.
            rows = [np.append(row, 0.0) for row in rows]
            rows[number] = building.storeys[-1]
        before = 0 if table.name else sum(other.startswith(name) for other in names)
        names.append(f"{name}, number {before + 1}" if before else name)

    def sprung_of(number: int) -> Floats | None:
        with keyed("damper", number, "sprung"):
            return None if (floor := tables[number].sprung) is None else building.floor_row(floor)

    sprung = read_each(sprung_of, range(len(tables)))
    return building, tuple(
        replace(device, name=name, row=row, sprung=floor, **named(table, "count", "differential"))
        for device, name, row, floor, table in zip(chosen, names, rows, sprung, tables, strict=True)
    )


def _row_of(bare: Building, table: DamperTable, number: int) -> Floats:
    """Stretch of the dampers of a table of this number over the coordinates of the bare building."""
    with keyed("damper", number):
        if table.row is None:
            refuse_without_masses(bare)
        with keyed("storey"):
            row = bare.storey_row(table.storey)
        if table.row is None:
            return cos(table.angle or 0.0) * row
        row = _of_building(bare, table.row)
        if row.size != bare.n_coordinates or not row.any():
            raise InvalidSettingError(
                "row",
                f"row has {counted(len(table.row), 'number')} for {counted(bare.n_coordinates, 'coordinate')} of "
                f"{bare.name}; give one for each, not all 0",
            )
    return row
