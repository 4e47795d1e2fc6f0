"""Forces on the floors of a building, from a table: a column for each floor, or one of which the floors have shares."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mrwork.base.keys import suggestion
from mrwork.base.numbers import counted
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.errors import RecordError, SettingError
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import ColumnTable, words_and_unit
from mrwork.files.open_table import open_table
from mrwork.files.roles import Role, Stated, described, series_of
from mrwork.motions.ground_motion import GroundMotion, force_motion, replace_samples
from mrwork.motions.series import on_one_step

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
    path: Path,
    floors: Sequence[str],
    *,
    shares: Floats | None,
    unit: str | None = None,
    dt: float | None = None,
    alone: bool = True,
) -> GroundMotion:
    """Read the forces on these floors from a table.

    A column is of the floor that it names, columns without names are of all floors in order, and floors without a
    column have no force. With the `shares` of `shares_of` one column is the force that they multiply. `unit` is that of
    columns that do not state theirs, `dt` the step [s] of a table without times; where the forces are not `alone`,
    these are of the motion of the ground, and the table has to state its own.
    """
    table = open_table(path, lambda _: True)
    source = str(path)
    series = series_of(
        table,
        _force_on(floors, takes_options=alone),
        Stated(unit=unit, dt=dt) if alone else Stated(),
        source=source,
        choose=lambda names: _forces_among(names, table, floors, shares),
    )
    free = series.names
    numbered = table.names == numbered_names(len(table.names)) or free in table.arrays.values()
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
    samples, step, change = series.samples, series.dt, ""
    if series.along is not None:
        step, samples, change = on_one_step(series)
    assert step is not None
    motion = force_motion(shares @ samples, step, name=path.stem, source=described(path.name, table, series))
    return replace_samples(motion, motion.acceleration, step, change) if change else motion


def _force_on(floors: Sequence[str], *, takes_options: bool) -> Role:
    """A column of forces; a floor may be called by a word that is a unit."""
    return Role(
        noun="force",
        quantity="force",
        is_called=lambda name: _plain(_words_of(name, floors)[0]) in {*map(_plain, floors)},
        unit_in=lambda name: _words_of(name, floors)[1],
        example="kN",
        many=True,
        takes_options=takes_options,
    )


def _forces_among(
    names: Sequence[str], table: ColumnTable, floors: Sequence[str], shares: Floats | None
) -> Sequence[str]:
    """The candidates, or the columns of the only matrix that has one for each floor."""
    of_floors = [columns for columns in table.arrays.values() if len(columns) == len(floors)]
    return of_floors[0] if shares is None and len(of_floors) == 1 else names


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
