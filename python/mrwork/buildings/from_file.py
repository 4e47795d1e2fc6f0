"""Read a building from a file or from a table of a study file: the table is `BuildingTable`.

An addition is what such a table puts into a building: a field of `BuildingTable` whose type is a class with the keys
and the function that puts it in, or several of which the keys choose one. Additions are applied in the order of the
fields, so that damping ratios refer to the bare building, and storey 1 of an isolated building is the isolators.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Final
from warnings import warn

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.documents import choose_way, read_table, refuse_missing
from mrwork.base.keys import key, keys_of, optional, positive
from mrwork.base.numbers import counted
from mrwork.base.places import Place, all_mistakes, read_each
from mrwork.base.values import Floats
from mrwork.buildings.frames import building as published_building
from mrwork.buildings.frames import (
    check_storeys,
    number_names,
    shear_building,
    with_base_isolation,
    with_base_isolation_of_period,
    with_brace,
    with_modal_damping,
    with_rayleigh_coefficients,
    with_rayleigh_damping,
    with_viscous_damper,
)
from mrwork.buildings.matrices import WITHOUT_MASSES, Building, PassiveElement, check_size, source_with
from mrwork.buildings.passive_devices import (
    with_friction_damper,
    with_lead_rubber_bearings,
    with_liquid_column,
    with_optimal_liquid_column,
    with_optimal_tuned_mass,
    with_tuned_mass,
    with_yielding_damper,
)
from mrwork.buildings.state_space import LinearSystem, building_of, mass_of_forces, order_of_states
from mrwork.buildings.yielding import with_p_delta, with_storeys_that_yield
from mrwork.errors import MrworkWarning, RecordError
from mrwork.files.matrices import read_matrices, read_matrix
from mrwork.store.input_file import TOML, is_folder, text_of
from mrwork.store.parse import toml_lines, toml_table
from mrwork.store.run_folder import real_place


@dataclass(frozen=True, slots=True, kw_only=True)
class Addition:
    """Table of something built into a building, by a function or by the one of several whose keys are given."""

    ways: ClassVar[tuple[Callable[..., Building], ...]]
    place: Place

    def way(self) -> Callable[[Building], Building]:
        """The function that puts this addition in; keys that are not given have its defaults."""
        takes = [inspect.signature(way).parameters for way in self.ways]
        names = [[name for name in each if name != "building"] for each in takes]
        number = choose_way(self, names, self.place) if len(self.ways) > 1 else 0
        given = {name: value for name in names[number] if (value := getattr(self, name)) is not None}
        needed = {name for name in names[number] if takes[number][name].default is inspect.Parameter.empty}
        with all_mistakes() as part:
            for entry in keys_of(type(self)):
                if entry.name in needed - given.keys():
                    with part():
                        refuse_missing(entry, self.place)
        return partial(self.ways[number], **given)


# Usual damping ratios of frames and of what is added, periods on isolators [s], yield displacements of devices [m] and
# shares of the mass of a building.
RATIOS: Final = (5e-4, 0.25)
_ADDED, _ISOLATORS, _YIELDS, _SHARES = (5e-3, 0.8), (0.7, 10.0), (2e-5, 0.15), (5e-4, 0.5)
_STOREY: Final = "storey: its number from 1, or its name"
_FLOOR: Final = "floor: its number from 1, or its name"
_SHARP: Final = "sharpness of the knee: 1 is round, 10 nearly bilinear"


@dataclass(frozen=True, slots=True, kw_only=True)
class RayleighTable(Addition):
    """Rayleigh damping, C = a0 M + a1 K, by a0 and a1 or by damping ratios in two modes."""

    ways = (with_rayleigh_coefficients, with_rayleigh_damping)
    a0: float | None = optional("coefficient of the mass", unit="1/s")
    a1: float | None = optional("coefficient of the stiffness", unit="s")
    ratios: tuple[float, float] | None = optional(
        "damping ratios in two modes, as [0.02, 0.02]", least=0.0, most=1.0, usual=RATIOS
    )
    modes: tuple[int, int] | None = optional("numbers of these modes, as [1, 3]; [1, 2] by default", least=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class ModalDampingTable(Addition):
    """Damping by the ratios of the modes."""

    ways = (with_modal_damping,)
    ratios: tuple[float, ...] = key(
        "damping ratios, as [0.01]: one for all modes or one for each", least=0.0, most=1.0, usual=RATIOS
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class YieldingStoreysTable(Addition):
    """Storeys of the frame that yield; one number for all, or one for each, lowest first.

    Periods, damping and the design of laws are those of the elastic frame.
    """

    ways = (with_storeys_that_yield,)
    yield_drift: float | tuple[float, ...] | None = positive(
        "drift at which a storey yields; or yield_drift_ratio, or yield_shear", unit="m"
    )
    yield_drift_ratio: float | tuple[float, ...] | None = positive(
        "the same over the height of the storey, as 0.5 %", below=1.0
    )
    yield_shear: float | tuple[float, ...] | None = positive("shear at which it yields", unit="N")
    post_yield_ratio: float | tuple[float, ...] | None = optional(
        "stiffness after yielding over that before, 0.03 by default", least=0.0, below=1.0
    )
    sharpness: float | tuple[float, ...] | None = optional(f"{_SHARP}; 10 by default", least=1.0, most=50.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class IsolationTable(Addition):
    """A base slab on isolators, given by stiffness and damping or by period and ratio."""

    ways = (with_base_isolation, with_base_isolation_of_period)
    mass: float = key("mass of the slab", unit="kg", above=0.0)
    stiffness: float | None = positive("stiffness of all isolators", unit="N/m")
    damping: float | None = optional("damping of all isolators", unit="N s/m", least=0.0)
    period: float | None = positive(
        "period of the rigid building on its isolators", unit="s", usual=_ISOLATORS
    )
    ratio: float | None = optional("damping ratio of that motion", least=0.0, usual=_ADDED)


@dataclass(frozen=True, slots=True, kw_only=True)
class LeadRubberTable(Addition):
    """A base slab on lead-rubber bearings: a spring of rubber, and leads that yield."""

    ways = (with_lead_rubber_bearings,)
    mass: float = key("mass of the slab", unit="kg", above=0.0)
    period: float | None = positive(
        "period of the rigid building on the rubber alone; or post_yield_stiffness",
        unit="s",
        usual=_ISOLATORS,
    )
    post_yield_stiffness: float | None = positive(
        "stiffness K_d of the rubber of all bearings; or period", unit="N/m"
    )
    ratio: float | None = optional("damping ratio of the rubber, 0 by default", least=0.0, usual=_ADDED)
    characteristic_strength: float | None = positive(
        "characteristic strength Q_d of all leads together", unit="N"
    )
    yield_force: float | None = positive("another name of characteristic_strength", unit="N")
    yield_displacement: float | None = positive(
        "displacement at which the leads yield, 0.01 m by default", unit="m", usual=_YIELDS
    )
    sharpness: float | None = optional(f"{_SHARP}; 2 by default", least=1.0, most=50.0)
    name: str | None = optional("name in tables")

    def way(self) -> Callable[[Building], Building]:
        """The function that puts the building on its bearings."""
        put = Addition.way(self)

        def put_on_bearings(building: Building) -> Building:
            if "isolation" in building.storey_names:
                self.place.refuse("isolation and lead_rubber both stand under the building; keep one")
            return put(building)

        return put_on_bearings


@dataclass(frozen=True, slots=True, kw_only=True)
class ViscousTable(Addition):
    """A linear viscous damper across a storey."""

    ways = (with_viscous_damper,)
    storey: int | str = key(_STOREY)
    damping: float = key("sum over all dampers of the storey", unit="N s/m", least=0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class YieldingTable(Addition):
    """A metallic yielding damper across a storey."""

    ways = (with_yielding_damper,)
    storey: int | str = key(_STOREY)
    yield_force: float = key("force at which it yields, along the drift", unit="N", above=0.0)
    yield_displacement: float = key(
        "displacement at which it yields, with its brace", unit="m", above=0.0, usual=_YIELDS
    )
    post_yield_ratio: float | None = optional(
        "stiffness after yielding over that before, 0.05 by default", least=0.0, below=1.0
    )
    sharpness: float | None = optional(f"{_SHARP}; 10 by default", least=1.0, most=50.0)
    name: str | None = optional("name in tables")


@dataclass(frozen=True, slots=True, kw_only=True)
class FrictionTable(Addition):
    """A friction damper in a brace across a storey."""

    ways = (with_friction_damper,)
    storey: int | str = key(_STOREY)
    slip_load: float = key("force at which it slips, along the drift", unit="N", above=0.0)
    stiffness: float = key("stiffness of the brace until it slips", unit="N/m", above=0.0)
    sharpness: float | None = optional(f"{_SHARP}; 20 by default", least=1.0, most=50.0)
    name: str | None = optional("name in tables")


@dataclass(frozen=True, slots=True, kw_only=True)
class BraceOfBuildingTable(Addition):
    """A brace in series with a damper of the storey."""

    ways = (with_brace,)
    storey: int | str = key(_STOREY)
    stiffness: float = key("stiffness of the brace", unit="N/m", above=0.0)
    mass: float = key(
        "mass that moves with the deformation of the brace, such as a thousandth of a floor",
        unit="kg",
        above=0.0,
    )
    damping: float | None = optional("damping of the brace, 0 by default", unit="N s/m", least=0.0)
    name: str | None = optional("name of the stroke of the damper in tables")


@dataclass(frozen=True, slots=True, kw_only=True)
class TunedMassTable(Addition):
    """A tuned mass on a floor: an optimum by mass_ratio, or given by mass, frequency and ratio."""

    ways = (with_optimal_tuned_mass, with_tuned_mass)
    floor: int | str = key(_FLOOR)
    mass_ratio: float | None = positive(
        "mass over that of the building, as 0.02, with a published tuning", usual=_SHARES
    )
    tuning: str | None = optional(
        "warburton for ground motion, the default, den_hartog or sadek; with mass_ratio"
    )
    mode: int | None = optional("mode it is tuned to, 1 by default; with mass_ratio", least=1)
    mass: float | None = positive("mass", unit="kg")
    frequency: float | None = positive("frequency of the mass on its spring, on the fixed floor", unit="Hz")
    ratio: float | None = optional("damping ratio of that motion", least=0.0, usual=_ADDED)
    name: str | None = optional("name in tables")


@dataclass(frozen=True, slots=True, kw_only=True)
class LiquidColumnTable(Addition):
    """A liquid column on a floor: an optimum by mass_ratio and rms_velocity, or by mass, frequency and head_loss."""

    ways = (with_optimal_liquid_column, with_liquid_column)
    floor: int | str = key(_FLOOR)
    width_ratio: float = key("horizontal share of the length of the column", above=0.0, below=1.0)
    mass_ratio: float | None = positive(
        "mass of the liquid over that of the building, as 0.02", usual=_SHARES
    )
    rms_velocity: float | None = positive(
        "velocity of the liquid at which its damping is the optimum; with mass_ratio", unit="m/s"
    )
    mode: int | None = optional("mode it is tuned to, 1 by default; with mass_ratio", least=1)
    mass: float | None = positive("mass of the liquid", unit="kg")
    frequency: float | None = positive("frequency of the liquid on the fixed floor", unit="Hz")
    head_loss: float | None = optional("coefficient of head loss of orifice and tube", least=0.0)
    name: str | None = optional("name in tables")


@dataclass(frozen=True, slots=True, kw_only=True)
class ElementTable:
    """A passive element whose spring and dashpot are in the matrices, see `mr.buildings.PassiveElement`."""

    name: str = key("name in tables")
    row: _Numbers = key("its displacement over the coordinates: a number for each")
    stiffness: float = key("spring, which is in the matrices", unit="N/m", default=0.0, least=0.0)
    damping: float = key("dashpot, which is in the matrices", unit="N s/m", default=0.0, least=0.0)
    head_loss: float = key("coefficient of head loss, in N s2/m2", default=0.0, least=0.0)
    yield_force: float = key("force at which it yields or slips", unit="N", default=0.0, least=0.0)
    yield_displacement: float = positive("displacement at which it does", unit="m", default=1.0)
    sharpness: float = key(_SHARP, default=10.0, least=1.0, most=50.0)
    in_stiffness: bool = key(
        "whether the stiffness matrix has the initial stiffness of its loop too, as of a storey that yields",
        default=False,
    )


_Numbers = tuple[float, ...]
_Rows = tuple[_Numbers, ...]
_Names = tuple[str, ...]
_OR_FILE: Final = (
    ", as rows or the name of a text file; with `published` or `file` it replaces that of the building"
)


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingTable:
    """A building: a published one, that of a file, a shear building by its masses, or matrices; then its additions.

    Additions are applied in the order of these keys.
    """

    published: str | None = optional("name of a published building, as uts")
    file: str | Building | None = optional(
        "file of the building: .toml, .mat (M, C, K by name), or a folder with M.csv, C.csv, K.csv", file=True
    )
    system: str | None = optional(
        "file .mat of a state space: A = [0 I; -M^-1 K, -M^-1 C] in any order of its states, and M, or B with `inputs`",
        file=True,
    )
    inputs: tuple[int | str, ...] | None = optional(
        'what each column of its B is: "ground", the ground acceleration, or the storey of a force of dampers, which '
        "says the masses where there is no M"
    )
    mass: _Rows | str | None = optional(f"mass matrix{_OR_FILE}", unit="kg", file=True)
    damping: _Rows | str | None = optional(f"damping matrix{_OR_FILE}", unit="N s/m", file=True)
    stiffness: _Rows | str | None = optional(f"stiffness matrix{_OR_FILE}", unit="N/m", file=True)
    masses: _Numbers | None = positive("masses of the floors of a shear building, lowest first", unit="kg")
    stiffnesses: _Numbers | None = positive("stiffnesses of its storeys", unit="N/m")
    storey_damping: _Numbers | None = optional("damping of its storeys", unit="N s/m", least=0.0)
    n_storeys: int | None = optional(
        "number of its storeys; a single mass, stiffness or damping then applies to all", least=1
    )
    influence: _Numbers | str | None = optional(
        "coordinates under a unit displacement of the ground; ones by default", file=True
    )
    floors: _Rows | str | None = optional(
        "rows from coordinates to floors; by default each is a floor", file=True
    )
    storeys: _Rows | str | None = optional("rows from coordinates to drifts of storeys", file=True)
    floor_names: _Names | None = optional("names of floors in tables")
    storey_names: _Names | None = optional("names of storeys in tables")
    name: str | None = optional("name of the building")
    source: str | None = optional("origin of its numbers")
    n_strokes: int | None = optional(
        "number of last rows of storeys that are strokes of what is built in, no drifts", least=0
    )
    height: float | None = positive("height of every storey, of which drift ratios are shares", unit="m")
    heights: _Numbers | None = optional(
        "heights of the storeys, lowest first, 0 for one that is none, as isolators", unit="m", least=0.0
    )
    drift_limit: float | None = positive(
        "drift ratio that is to be kept, as 1 %: a line on the page, and the limit of fragilities", below=1.0
    )
    p_delta: bool | None = optional(
        "whether weights act on the displaced storeys, each that of the masses above it; needs heights"
    )
    loads: _Numbers | None = optional(
        "weights on the storeys, lowest first, instead of those that p_delta takes from the masses",
        unit="N",
        least=0.0,
    )
    element: tuple[ElementTable, ...] | None = optional("passive elements beside the matrices")
    rayleigh: RayleighTable | None = optional("Rayleigh damping")
    modal_damping: ModalDampingTable | None = optional("damping ratios of the modes")
    storeys_that_yield: YieldingStoreysTable | None = optional("storeys of the frame that yield")
    isolation: IsolationTable | None = optional("base isolation")
    lead_rubber: LeadRubberTable | None = optional("lead-rubber bearings")
    viscous: tuple[ViscousTable, ...] | ViscousTable | None = optional("viscous dampers")
    yielding: tuple[YieldingTable, ...] | YieldingTable | None = optional("yielding dampers")
    friction: tuple[FrictionTable, ...] | FrictionTable | None = optional("friction dampers")
    brace: tuple[BraceOfBuildingTable, ...] | BraceOfBuildingTable | None = optional("braces")
    tuned_mass: tuple[TunedMassTable, ...] | TunedMassTable | None = optional("tuned masses")
    liquid_column: tuple[LiquidColumnTable, ...] | LiquidColumnTable | None = optional("liquid columns")
    place: Place

    def override_with(self, other: BuildingTable) -> BuildingTable:
        """The table with the keys that another one gives in place of its own."""
        given = {name: getattr(other, name) for name in _list_given_keys(other)}
        return replace(self, place=other.place, **given)

    def build(self, folder: Path = Path()) -> Building:
        """The building; names of files are relative to `folder`."""
        return _make_building(self, folder, ())

    def additions(self) -> Iterator[Addition]:
        """Additions to the building, in order."""
        for entry in keys_of(BuildingTable):
            value = getattr(self, entry.name)
            for each in value if isinstance(value, tuple) else (value,):
                if isinstance(each, Addition):
                    yield each


def _list_given_keys(table: BuildingTable) -> tuple[str, ...]:
    return tuple(
        entry.name for entry in keys_of(BuildingTable) if getattr(table, entry.name) != entry.default
    )


_MATRICES: Final = ("mass", "damping", "stiffness")
_ROWS: Final = ("floors", "storeys")
_SHEAR: Final = ("masses", "stiffnesses", "storey_damping", "n_storeys")
# Symbols used in papers.
_LETTERS: Final = {"M": "mass", "C": "damping", "K": "stiffness", "r": "influence"}
_TITLES: Final = {**_LETTERS, **{title: title for title in (*_MATRICES, "influence", *_ROWS)}}


@checked
def read_building(path: str | Path) -> Building:
    """Read a building from a .toml file, a .mat file, or a folder with one text file per matrix.

    Raises
    ------
    RecordError
        The file is missing, damaged, or has another extension.
    SettingError
        The content does not describe a building; the message names file and key.
    """
    return _read(Path(path), ())


def _read(path: Path, readers: tuple[Path, ...]) -> Building:
    """Read a building; `readers` are the files that refer to this one, to detect cycles."""
    if is_folder(path) or path.suffix.lower() == ".mat":
        place = Place(origin=str(path))
        return _from_matrices(
            read_matrices(path, _TITLES), BuildingTable(name=path.stem, source=str(path), place=place)
        )
    if path.suffix.lower() != ".toml":
        raise RecordError(
            f"{path}: a building comes as a .toml or .mat file, or as a folder with M.csv, C.csv and K.csv; "
            "save it as one of these"
        )
    text = text_of(path, TOML)
    try:
        document = toml_table(text)
    except ValueError as error:
        raise RecordError(f"{path}: is not TOML ({error}); correct it there") from error
    place = Place(origin=str(path), lines=toml_lines(text), title="the building")
    table = read_table(BuildingTable, document, place)
    table = replace(table, name=path.stem) if table.name is None else table
    built = _make_building(table, path.parent, (*readers, real_place(path)))
    return built if built.source else replace(built, source=str(path))


def _make_building(table: BuildingTable, folder: Path, readers: tuple[Path, ...]) -> Building:
    place, given = table.place, _list_given_keys(table)
    forms: list[str] = [name for name in ("published", "file", "system", "masses") if name in given]
    forms += ["mass"] if "mass" in given and not forms else []
    if len(forms) != 1:
        given_forms = " and ".join(forms) or "none of them"
        place.refuse(
            f"a building is given by published, file, system, mass and stiffness, or masses; here by {given_forms}"
        )
    form = forms[0]
    foreign: tuple[str, ...] = (*_MATRICES, "influence", *_ROWS) if form == "masses" else _SHEAR
    foreign += ("damping", "stiffness") if form == "system" else ("inputs",)
    with all_mistakes() as part:
        for name in foreign:
            if name in given:
                goes = "system" if name == "inputs" else "masses" if name in _SHEAR else "matrices"
                with part():
                    place.within(name).refuse(
                        f"{name} goes with {goes}, and this building is given by {form}"
                    )
        damped = [
            name for name in ("damping", "storey_damping", "rayleigh", "modal_damping") if name in given
        ]
        if len(damped) > 1:
            with part():
                place.within(damped[-1]).refuse(f"{' and '.join(damped[:2])} both give the damping; keep one")
        with part():
            ways = read_each(lambda each: (each.place, each.way()), table.additions())
    # What overflows is refused by `Building`.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        if form == "masses":
            built = _shear(table)
        elif form == "mass":
            built = _from_matrices(_arrays(table, folder), table)
        elif form == "system":
            built = _from_system(table, folder)
        else:
            name, where = getattr(table, form), place.within(form)
            if isinstance(name, str) and form == "file" and real_place(folder / name) in readers:
                where.refuse(f"{name} refers back to itself; name the file of another building")
            with where.prefix_errors():
                if isinstance(name, str):
                    known = published_building(name) if form == "published" else _read(folder / name, readers)
                else:
                    known = name
            built = _replace_matrices(known, table, folder)
        with place.prefix_errors():
            built = _with_statements(built, table)
        if table.element or any(not isinstance(each, _OF_DAMPING) for each in table.additions()):
            refuse_without_masses(built, place.within(form))
        for where, way in ways:
            with where.prefix_errors():
                built = way(built)
        if table.p_delta:
            if table.loads is not None:
                place.within("loads").refuse("p_delta and loads both give the weights; keep one")
            with place.within("p_delta").prefix_errors():
                built = with_p_delta(built)
    return built


_OF_DAMPING: Final = (RayleighTable, ModalDampingTable)


def refuse_without_masses(building: Building, place: Place) -> None:
    """Refuse a building that is to have dampers or additions, and whose masses are not known."""
    if building.status == WITHOUT_MASSES:
        place.refuse(
            "A alone does not say what a force does, and the building has dampers or additions; give M in the file, or "
            'inputs = ["ground", 1], which says what the columns of its B are'
        )


def _with_statements(building: Building, table: BuildingTable) -> Building:
    """The building with what a table states beside its matrices: strokes, elements, heights, drift limit, weights."""
    elements = tuple(
        PassiveElement(**{entry.name: getattr(each, entry.name) for entry in keys_of(ElementTable)})
        for each in table.element or ()
    )
    n_strokes = building.n_strokes if table.n_strokes is None else table.n_strokes
    count = max(len(building.storeys) - n_strokes, 0)
    if table.height is not None and table.heights is not None:
        table.place.within("height").refuse("height and heights both give the heights; keep one")
    given = (table.height,) * count if table.height is not None else table.heights
    if given is not None and len(given) != count:
        table.place.within("heights").refuse(
            f"heights has {counted(len(given), 'number')} for {counted(count, 'storey')}; give one for each, or one "
            "height for all"
        )
    strokes = np.zeros(len(building.storeys) - count)
    stated: dict[str, Any] = {
        "n_strokes": table.n_strokes,
        "elements": (*building.elements, *elements) if elements else None,
        "drift_limit": table.drift_limit,
        "heights": None if given is None else np.append(given, strokes),
        "loads": None if table.loads is None else np.append(table.loads, strokes),
    }
    stated = {name: value for name, value in stated.items() if value is not None}
    return replace(building, **stated) if stated else building


def _shear(table: BuildingTable) -> Building:
    (entry,) = (entry for entry in keys_of(BuildingTable) if entry.name == "stiffnesses")
    if not table.stiffnesses:
        refuse_missing(entry, table.place)
    masses, stiffnesses, damping = (_each(table, name) for name in _SHEAR[:3])
    with table.place.prefix_errors():
        return shear_building(
            name=table.name or "building",
            masses=masses,
            stiffnesses=stiffnesses,
            storey_damping=damping,
            floor_names=table.floor_names or (),
            storey_names=table.storey_names or (),
            source=table.source or "",
        )


def _each(table: BuildingTable, name: str) -> tuple[float, ...]:
    """Return one number per floor or storey; a single number is repeated `n_storeys` times."""
    values: tuple[float, ...] = getattr(table, name) or ()
    count = table.n_storeys
    if count is None or not values:
        return values
    with table.place.within("n_storeys").prefix_errors():
        check_storeys(count)
    if len(values) not in (1, count):
        table.place.within(name).refuse(
            f"{name} has {len(values)} numbers for {count} storeys; give one, or one for each"
        )
    return values * count if len(values) == 1 else values


def _replace_matrices(known: Building, table: BuildingTable, folder: Path) -> Building:
    """Return a building with the matrices, names and source replaced by those of a table."""
    arrays: dict[str, Any] = _arrays(table, folder)
    if arrays:
        status = known.status if known.status == WITHOUT_MASSES else "ours"
        arrays |= {"status": status, "source": source_with(known, f"{', '.join(arrays)} replaced")}
    words = {name: getattr(table, name) for name in ("floor_names", "storey_names", "name", "source")}
    with table.place.prefix_errors():
        return replace(known, **arrays, **{name: word for name, word in words.items() if word is not None})


def _arrays(table: BuildingTable, folder: Path) -> dict[str, Floats]:
    arrays: dict[str, Floats] = {}
    for name in (*_MATRICES, *_ROWS, "influence"):
        value = getattr(table, name)
        if isinstance(value, str):
            with table.place.within(name).prefix_errors():
                arrays[name] = read_matrix(folder / value)
        elif value is not None:
            arrays[name] = np.array(value, dtype=np.float64)
    return arrays


def _from_system(table: BuildingTable, folder: Path) -> Building:
    """The building of a state space, whose masses come with it, from the forces of its dampers, or are not known."""
    place, path = table.place.within("system"), folder / str(table.system)
    name, given = table.name or path.stem, _arrays(table, folder)
    with place.prefix_errors():
        found = read_matrices(path, ("A", "B", "M"))
        if "A" not in found:
            place.refuse(f"{path}: a state space needs A, and M or B; found {', '.join(found) or 'nothing'}")
        A = found["A"]
        B = found.get("B", np.empty((len(A), 0)))
        system = LinearSystem(A=A, B=B, C=np.empty((0, len(A))), D=np.empty((0, B.shape[1])))
        order, n = order_of_states(A, name), len(A) // 2
    floors = given.get("floors", np.eye(n))
    influence, mass = given.get("influence", np.ones(n)), given.get("mass", found.get("M"))
    inputs = table.inputs or ()
    if inputs and len(inputs) != B.shape[1]:
        table.place.within("inputs").refuse(
            f"inputs has {counted(len(inputs), 'name')}, and B has {counted(B.shape[1], 'column')}; name each"
        )
    if "ground" in inputs and "influence" not in given:
        influence = -B[order[n:], inputs.index("ground")]
    built = partial(
        building_of,
        system,
        name=name,
        influence=influence.ravel(),
        floors=floors,
        storeys=given.get("storeys", np.diff(floors, axis=0, prepend=0.0)),
        floor_names=table.floor_names or (),
        storey_names=table.storey_names or (),
        source=table.source or str(path),
    )
    with place.prefix_errors():
        building = built(mass=mass)
    forces = [number for number, each in enumerate(inputs) if each != "ground"]
    if mass is None and forces:
        with table.place.within("inputs").prefix_errors():
            rows = np.stack([building.storey_row(inputs[number]) for number in forces])
            return built(mass=mass_of_forces(system, forces, rows, name))
    if mass is None:
        warn(
            f"{path}: there is no M, so the masses of {name} and its shears are not known, and what tables say of them "
            "means nothing; displacements and accelerations are right",
            MrworkWarning,
            stacklevel=2,
        )
    return building


def _from_matrices(matrices: Mapping[str, Floats], table: BuildingTable) -> Building:
    """Return the building with the given matrices, named by word or symbol, and the names of a table."""
    named = {_TITLES[name]: matrix for name, matrix in matrices.items() if name in _TITLES}
    for title in ("mass", "stiffness"):
        if title not in named:
            given_names = ", ".join(matrices) or "nothing"
            table.place.refuse(
                f"a building needs mass (M), stiffness (K) and usually damping (C); found {given_names}"
            )
    n = len(named["mass"])
    with table.place.prefix_errors():
        check_size(n, "building")
        floors = named.get("floors", np.eye(n))
        storeys = named.get("storeys", np.diff(floors, axis=0, prepend=0.0))
        return Building(
            name=table.name or "building",
            mass=named["mass"],
            damping=named.get("damping", np.zeros((n, n))),
            stiffness=named["stiffness"],
            influence=named.get("influence", np.ones(n)).ravel(),
            floors=floors,
            storeys=storeys,
            floor_names=table.floor_names or number_names("floor", len(floors)),
            storey_names=table.storey_names or number_names("storey", len(storeys)),
            source=table.source or "",
        )
