"""Forces on the floors of a building, from a table: a column for each floor, or one of which the floors have shares."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mrwork.base.keys import suggestion
from mrwork.base.numbers import counted
from mrwork.base.summary import list_names
from mrwork.base.units import factor_to_si
from mrwork.base.values import Floats
from mrwork.errors import RecordError, SettingError, UnitError
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import ColumnTable, unit_in_name, words_and_unit
from mrwork.files.open_table import open_table
from mrwork.motions.ground_motion import GroundMotion, force_motion, replace_samples
from mrwork.motions.networks import on_one_step
from mrwork.motions.read import runs_as_time, seconds_of

# Part of a step by which two steps may miss being multiples, as by the rounding of times.
_OFF_STEP = 1e-6


def shares_of(floors: Sequence[str], floor: str | int | None, shape: Sequence[float] | None) -> Floats | None:
    """Share of each floor in one history of forces, shape (n_floors, 1); `None` where every floor has its own.

    `floor` is a name, or a number from 1, of the floor that has all of it.
    """
    if shape is not None:
        if len(shape) != len(floors):
            raise SettingError(
                f"`shape` has {counted(len(shape), 'number')}, and the building {counted(len(floors), 'floor')}, "
                f"{list_names(floors)}; give the share of each"
            )
        return np.asarray(shape, dtype=np.float64)[:, None]
    return None if floor is None else np.eye(len(floors))[:, [_index(floor, floors, "`floor`")]]


def _index(floor: str | int, floors: Sequence[str], what: str, cure: str = "") -> int:
    named = {_plain(name): place for place, name in enumerate(floors)}
    place = floor - 1 if isinstance(floor, int) else named.get(_plain(floor), -1)
    if not 0 <= place < len(floors):
        raise SettingError(
            f"{what} {floor!r} is no floor of the building{suggestion(str(floor), floors)}{cure}"
        )
    return place


def _plain(name: str) -> str:
    return " ".join(name.replace("_", " ").casefold().split())


# Overflowing values become infinite, and are refused.
@np.errstate(over="ignore", invalid="ignore")
def read_forces(
    path: Path, floors: Sequence[str], *, shares: Floats | None, unit: str | None, dt: float | None
) -> GroundMotion:
    """Read the forces on these floors from a table.

    A column is of the floor that it names, columns without names are of all floors in order, and floors without a
    column have no force. With the `shares` of `shares_of` one column is the force that they multiply. `unit` is that of
    columns that do not state theirs, `dt` the step [s] of a table without times.
    """
    table = open_table(path, lambda _: True)
    names, source = table.names, str(path)
    numbered = names == numbered_names(len(names))
    time = next((name for name in names if unit_in_name("time", name) is not None), None)
    if time is None and len(names) > 1 and dt is None:
        first = table.numbers(names[0])
        time = names[0] if first is not None and runs_as_time(first) else None
    free = [name for name in names if name != time]
    if not free or (time is None and dt is None):
        lacking = (
            "no column is time; give its step, as dt = 0.01"
            if free
            else "it has times alone; give forces, too"
        )
        raise RecordError(f"{source}: {lacking}")
    if time is not None and dt is not None:
        raise SettingError(
            f"{source}: `dt` is {dt:g} s where column '{time}' holds the times; leave `dt` out"
        )
    if shares is not None and len(free) > 1:
        raise RecordError(
            f"{source}: `floor` and `shape` are of one column of forces, and there are {list_names(free)}; leave them "
            "out and name each column by its floor, or keep one column"
        )
    if shares is not None and not numbered:
        own = _plain(_words_of(free[0], floors)[0])
        named = [place for place, name in enumerate(floors) if _plain(name) == own]
        if named and np.flatnonzero(shares).tolist() != named:
            raise SettingError(
                f"{source}: column '{free[0]}' is of floor {floors[named[0]]!r}, and `floor` or `shape` say otherwise; "
                "leave them out, or call the column force"
            )
    if shares is None:
        shares = np.zeros((len(floors), len(free)))
        shares[_places(free, floors, source, numbered=numbered), range(len(free))] = 1.0
    columns = table.read(free if time is None else [time, *free])
    factors = _factors(table, free, unit, floors, source)
    samples = np.array([factor * columns[name] for factor, name in zip(factors, free, strict=True)])
    wrong = np.argwhere(~np.isfinite(samples.T))
    if wrong.size:
        row, column = wrong[0].tolist()
        where = f"{source}: {table.locate(row)}"
        raise RecordError(f"{where}: the force in column '{free[column]}' is no finite number; correct it")
    change = ""
    if time is not None:
        times = seconds_of(table, time, source)
        falls = np.flatnonzero(~(np.diff(times) > 0.0))
        if times.size < 2:
            raise RecordError(f"{source}: has {counted(times.size, 'row')} of forces; give two or more")
        if falls.size:
            raise RecordError(
                f"{source}: {table.locate(int(falls[0]) + 1)}: times do not rise; sort the rows"
            )
        steps = [on_one_step(times, each, lambda row: f"{source}: {table.locate(row)}") for each in samples]
        dt, change, samples = steps[0][0], steps[0][2], np.array([each for _, each, _ in steps])
    assert dt is not None
    motion = force_motion(shares @ samples, dt, name=path.stem, source=path.name)
    return replace_samples(motion, motion.acceleration, dt, change) if change else motion


def _places(names: Sequence[str], floors: Sequence[str], source: str, *, numbered: bool) -> list[int]:
    """Floors of the columns."""
    if numbered:
        if len(names) != len(floors):
            raise RecordError(
                f"{source}: has {counted(len(names), 'column')} of forces without names, and the building "
                f"{counted(len(floors), 'floor')}, {list_names(floors)}; name each column by its floor, or give "
                f'floor = "{floors[-1]}" or a shape for one column'
            )
        return [*range(len(floors))]
    own = [_words_of(name, floors)[0] for name in names]
    if len(own) == 1 and _plain(own[0]) not in {*map(_plain, floors)}:
        raise RecordError(
            f"{source}: column '{names[0]}' names no floor; give floor = \"{floors[-1]}\", or shape = [...] with a "
            f"share for each of {list_names(floors)}"
        )
    places = [_index(name, floors, f"{source}: column", ", or delete that column") for name in own]
    twice = next((name for name, place in zip(names, places, strict=True) if places.count(place) > 1), None)
    if twice is not None:
        raise RecordError(f"{source}: floor {floors[places[names.index(twice)]]!r} has two columns; keep one")
    return places


def _words_of(name: str, floors: Sequence[str]) -> tuple[str, str]:
    """The words of the name of a column, and its unit; a floor may be called by a word that is a unit."""
    return (name, "") if _plain(name) in {*map(_plain, floors)} else words_and_unit(name)


def _factors(
    table: ColumnTable, names: Sequence[str], unit: str | None, floors: Sequence[str], source: str
) -> list[float]:
    """Factors of columns to newtons, by the units of their names, of the file or else the given one."""
    stated = [_words_of(name, floors)[1] or table.units.get(name, "") for name in names]
    factors = [
        factor_to_si(own or unit or "N", "force", context=f"{source}: column '{name}'")
        for name, own in zip(names, stated, strict=True)
    ]
    if unit is None and "" in stated:
        name = names[stated.index("")]
        raise UnitError(
            f"{source}: column '{name}' does not state the unit of its forces; write it in the head, as '{name} (kN)', "
            'or give unit = "kN", which beside a motion of the ground would be of that'
        )
    if unit is not None and "" not in stated and {*stated} != {unit}:
        raise SettingError(
            f"{source}: `unit` is {unit!r} where every column states its own; leave `unit` out"
        )
    return factors


def with_forces(ground: GroundMotion, forced: GroundMotion) -> GroundMotion:
    """A motion of the ground with the forces of another, on the finer of their steps; the shorter ends in zeros.

    Both stay what they are, linear between their samples: the coarser step is a multiple of the finer one.
    """
    if ground.forces.size:
        raise SettingError(f"ground motion {ground.name} has forces on floors; leave the others out")
    times = max(ground.dt, forced.dt) / (step := min(ground.dt, forced.dt))
    if abs(times - round(times)) > _OFF_STEP * times:
        raise SettingError(
            f"{forced.source}: forces every {forced.dt:g} s beside ground motion {ground.name} every {ground.dt:g} s; "
            "give one step, or one that is a multiple of the other"
        )
    n_time = 1 + max(round(motion.duration / step) for motion in (ground, forced))

    def brought(motion: GroundMotion, samples: Floats) -> Floats:
        at = np.arange(n_time) / round(motion.dt / step)
        return np.interp(at, np.arange(motion.n_time), samples, right=0.0)

    forces = np.array([brought(forced, force) for force in forced.forces])
    change = f"forces of {forced.source} beside it"
    return replace_samples(ground, brought(ground, ground.acceleration), step, change, forces=forces)
