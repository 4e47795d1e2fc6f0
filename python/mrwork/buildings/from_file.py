"""Read a building from a file or from a table of a study file: the table is `BuildingTable`.

An addition is what such a table puts into a building: a key of `BuildingTable` with the functions that put it in, whose
arguments are the keys of its own table. Additions are applied in the order of the keys, so that damping ratios refer to
the bare building, and storey 1 of an isolated building is the isolators.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Final
from warnings import warn

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.documents import read_table
from mrwork.base.keys import Arguments, keys_of, optional, positive
from mrwork.base.numbers import counted
from mrwork.base.places import Place, all_mistakes, keyed, read_each
from mrwork.base.summary import named
from mrwork.base.units import unit_of
from mrwork.base.values import Floats, one_for_each
from mrwork.buildings.building_checks import MOST_COORDINATES
from mrwork.buildings.frames import building as published_building
from mrwork.buildings.frames import (
    shear_building,
    with_base_isolation,
    with_base_isolation_of_period,
    with_brace,
    with_modal_damping,
    with_rayleigh_coefficients,
    with_rayleigh_damping,
    with_viscous_damper,
)
from mrwork.buildings.passive_devices import (
    with_friction_damper,
    with_lead_rubber_bearings,
    with_liquid_column,
    with_optimal_liquid_column,
    with_optimal_tuned_mass,
    with_tuned_mass,
    with_yielding_damper,
)
from mrwork.buildings.passive_element import PassiveElement
from mrwork.buildings.plane_building import Building, source_with
from mrwork.buildings.state_space import building_of, mass_of_forces, order_of_states, static_condensation
from mrwork.buildings.story_table import building_of_stories
from mrwork.buildings.yielding import with_p_delta, with_storeys_that_yield
from mrwork.errors import InvalidSettingError, MrworkWarning, RecordError
from mrwork.files.matlab import Variables, describe_left_out, matrices_among
from mrwork.files.matrices import read_contents, read_matrix
from mrwork.files.open_table import WORKBOOKS
from mrwork.store.input_file import TOML, is_folder, text_of
from mrwork.store.parse import toml_lines
from mrwork.store.run_folder import real_path

_Numbers = tuple[float, ...]
_Rows = tuple[_Numbers, ...]
_Names = tuple[str, ...]
_Addition = Arguments | None
_Additions = tuple[Arguments, ...] | Arguments | None
_OR_FILE: Final = (
    ", as rows or the name of a file, of a .mat file also with the variable as `frame.mat:M`; with `published` or "
    "`file` it replaces the matrix of the building"
)


# Tables of storeys.
_OF_TABLES: Final = (".csv", ".tsv", ".txt", *WORKBOOKS)


@dataclass(frozen=True, slots=True, kw_only=True)
class BuildingTable:
    """A building: a published one, one of a file, a shear building by its masses, or matrices; then its additions.

    Additions are applied in the order of these keys.
    """

    published: str | None = optional("name of a published building, as uts")
    file: str | Building | None = optional(
        "file of the building: .toml, .mat (M, C, K by name), a folder with M.csv, C.csv, K.csv, or tables of "
        "storeys, .csv or .xlsx, with mass or weight, stiffness, and height or elevation of each; a sheet or, as in "
        "stories.csv+mass.csv, a file for each quantity",
        file=True,
    )
    system: str | None = optional(
        "file .mat of a state space: A = [0 I; -M^-1 K, -M^-1 C] in any order of its states, and M, or B with `inputs`",
        file=True,
    )
    inputs: tuple[int | str, ...] | None = optional(
        'what each column of its B is: "ground", the ground acceleration, or the storey of a force of dampers, which '
        "says the masses where there is no M"
    )
    units: str | None = optional(
        "units of the numbers in these matrices, of mass, force and perhaps length: `t, kN`, `t, N, mm`; SI by default"
    )
    mass: _Rows | str | None = optional(f"mass matrix{_OR_FILE}", unit="kg", file=True)
    damping: _Rows | str | None = optional(f"damping matrix{_OR_FILE}", unit="N s/m", file=True)
    stiffness: _Rows | str | None = optional(f"stiffness matrix{_OR_FILE}", unit="N/m", file=True)
    masses: _Numbers | None = positive("masses of the floors of a shear building, lowest first", unit="kg")
    stiffnesses: _Numbers | None = positive("stiffnesses of its storeys", unit="N/m")
    storey_damping: _Numbers | None = optional("damping of its storeys", unit="N s/m", least=0.0)
    n_storeys: int | None = optional(
        "number of its storeys; a single mass, stiffness or damping then applies to all",
        least=1,
        most=MOST_COORDINATES,
    )
    influence: _Numbers | str | None = optional(
        "coordinates under a unit displacement of the ground; ones by default", file=True
    )
    condense: bool | None = optional(
        "whether coordinates that no floor, storey, element, row of a damper or influence names are condensed "
        "statically; by default those without mass, and in a study, if periods are below a tenth of its step, those of "
        "periods below the step"
    )
    floors: _Rows | str | None = optional(
        "rows from coordinates to floors; by default each is a floor, from the ground up as the stiffness has them",
        file=True,
    )
    storeys: _Rows | str | None = optional("rows from coordinates to drifts of storeys", file=True)
    floor_names: _Names | None = optional("names of floors in tables, in the order of the matrices")
    storey_names: _Names | None = optional("names of storeys in tables")
    name: str | None = optional("name of the building")
    source: str | None = optional("origin of its numbers")
    n_strokes: int | None = optional(
        "number of last rows of storeys that are strokes of what is built in, no drifts", least=0
    )
    isolators: _Names | None = optional(
        "names of storeys that are isolators, as those of height 0 are, whose displacements are strokes and no drifts"
    )
    height: float | None = positive("height of every storey, of which drift ratios are shares", unit="m")
    heights: _Numbers | None = optional(
        "heights of the storeys, lowest first, 0 where there is no storey, as of isolators",
        unit="m",
        least=0.0,
    )
    drift_limit: float | None = positive(
        "drift ratio that is to be kept, as 1 %: a line on the page, and the limit of fragilities", below=1.0
    )
    p_delta: bool | None = optional(
        "whether weights act on the displaced storeys, each the weight of the masses above it; needs heights"
    )
    loads: _Numbers | None = optional(
        "weights on the storeys, lowest first, instead of those that p_delta takes from the masses",
        unit="N",
        least=0.0,
    )
    element: tuple[Arguments, ...] | None = optional(
        "passive elements beside the matrices", functions=(PassiveElement,)
    )
    rayleigh: _Addition = optional(
        "Rayleigh damping", functions=(with_rayleigh_coefficients, with_rayleigh_damping)
    )
    modal_damping: _Addition = optional("damping ratios of the modes", functions=(with_modal_damping,))
    storeys_that_yield: _Addition = optional(
        "storeys of the frame that yield", functions=(with_storeys_that_yield,)
    )
    isolation: _Addition = optional(
        "base isolation", functions=(with_base_isolation, with_base_isolation_of_period)
    )
    lead_rubber: _Addition = optional("lead-rubber bearings", functions=(with_lead_rubber_bearings,))
    viscous: _Additions = optional("viscous dampers", functions=(with_viscous_damper,))
    yielding: _Additions = optional("yielding dampers", functions=(with_yielding_damper,))
    friction: _Additions = optional("friction dampers", functions=(with_friction_damper,))
    brace: _Additions = optional("braces", functions=(with_brace,))
    tuned_mass: _Additions = optional("tuned masses", functions=(with_optimal_tuned_mass, with_tuned_mass))
    liquid_column: _Additions = optional(
        "liquid columns", functions=(with_optimal_liquid_column, with_liquid_column)
    )

    def override_with(self, other: BuildingTable) -> BuildingTable:
        """Replace keys of the table by the keys that another table gives."""
        values = {name: getattr(other, name) for name in _list_given_keys(other)}
        return replace(self, **values)

    def build(self, folder: Path = Path()) -> Building:
        """The building; names of files are relative to `folder`."""
        return _make_building(self, folder, ())

    def additions(self) -> Iterator[Arguments]:
        """Additions to the building, in order."""
        for entry in keys_of(BuildingTable):
            value, functions = getattr(self, entry.name), entry.says.functions
            if functions and PassiveElement not in functions and value is not None:
                yield from value if isinstance(value, tuple) else (value,)


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
    built = _read(Path(path), (), BuildingTable(), {})
    with Place(origin=str(path)).prefix_errors():
        return static_condensation(built).check()


def _read(
    path: Path, readers: tuple[Path, ...], over: BuildingTable, arrays: Mapping[str, Floats]
) -> Building:
    """Read a building; `readers` are the files that refer to this one, to detect cycles.

    The table `over` it states the units of matrices, before which its `arrays` go; matrices are not judged here.
    """
    if real_path(path) in readers:
        raise InvalidSettingError((), f"{path} refers back to itself; name the file of another building")
    if is_folder(path) or path.suffix.lower() == ".mat":
        with Place(origin=str(path)).prefix_errors():
            given, source = _choose_matrices(read_contents(path, _TITLES), path, arrays)
            table = BuildingTable(name=path.stem, source=source)
            return _from_matrices({**_in_si(given, over), **arrays}, table)
    if path.suffix.lower() in _OF_TABLES:
        return building_of_stories(path)
    if path.suffix.lower() != ".toml":
        raise RecordError(
            f"{path}: a building comes as a .toml or .mat file, as a folder with M.csv, C.csv and K.csv, or as a table "
            "of storeys with their masses and stiffnesses, .csv or .xlsx; save it as one of these"
        )
    text = text_of(path, TOML)
    try:
        document = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise RecordError(f"{path}: is not TOML ({error}); correct it there") from error
    place = Place(origin=str(path), lines=toml_lines(text), title="the building")
    table = read_table(BuildingTable, document, place)
    table = replace(table, name=path.stem) if table.name is None else table
    with place.prefix_errors():
        built = _make_building(table, path.parent, (*readers, real_path(path)))
    return built if built.source else replace(built, source=str(path))


def _make_building(table: BuildingTable, folder: Path, readers: tuple[Path, ...]) -> Building:
    keys = _list_given_keys(table)
    forms: list[str] = [name for name in ("published", "file", "system", "masses") if name in keys]
    forms += ["mass"] if "mass" in keys and not forms else []
    if len(forms) != 1:
        ways = "published, file, system, mass and stiffness, or masses"
        here = " and ".join(forms) or "none of them"
        raise InvalidSettingError((), f"a building is given by {ways}; here by {here}")
    form = forms[0]
    foreign: tuple[str, ...] = (*_MATRICES, "influence", *_ROWS) if form == "masses" else _SHEAR
    foreign += ("damping", "stiffness") if form == "system" else ("inputs",)
    foreign += () if form in ("file", "mass") else ("units",)
    with all_mistakes() as part:
        for name in foreign:
            if name in keys:
                goes = {"inputs": "system", **dict.fromkeys(_SHEAR, "masses")}.get(name, "matrices")
                with part():
                    raise InvalidSettingError(
                        name, f"{name} goes with {goes}, and this building is given by {form}"
                    )
        damped = [name for name in ("damping", "storey_damping", "rayleigh", "modal_damping") if name in keys]
        if len(damped) > 1:
            with part():
                sentence = f"{' and '.join(damped[:2])} both give the damping; keep one"
                raise InvalidSettingError(damped[-1], sentence)
        with part():
            additions = read_each(Arguments.call, table.additions())
    # What overflows is refused by `Building`.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        arrays = _arrays(table, folder)
        if form == "masses":
            built = _shear(table)
        elif form == "mass":
            built = _from_matrices(arrays, table)
        elif form == "system":
            built = _from_system(table, folder)
        else:
            in_si = isinstance(table.file, Building) or Path(table.file or "").suffix.lower() == ".toml"
            if table.units and in_si and not arrays:
                raise InvalidSettingError(
                    "units", "units are of matrices; state them where the matrices stand"
                )
            with keyed(form):
                if table.published is not None:
                    built = published_building(table.published)
                elif isinstance(table.file, Building):
                    built = table.file
                else:
                    built = _read(folder / str(table.file), readers, table, arrays)
            if arrays:
                changes: dict[str, Any] = {
                    **arrays,
                    "source": source_with(built, f"{', '.join(arrays)} replaced"),
                    "ordering": () if "floors" in arrays else built.ordering,
                }
                built = replace(built, **changes, status="ours" if built.knows_masses else built.status)
        built = _with_statements(built, table)
        if table.condense is not False:
            built = static_condensation(built, shortest_period=np.inf if table.condense else 0.0)
        if table.condense and not built.condensed:
            raise InvalidSettingError(
                "condense",
                "condense is true, and floors, storeys, influence or dashpots name every coordinate; give floors, "
                "storeys and influence of those that are displacements of floors, 0 of the others",
            )
        built.check()
        of_damping = (table.rayleigh, table.modal_damping)
        if table.element or any(addition not in of_damping for addition in table.additions()):
            with keyed(form):
                refuse_without_masses(built)
        for add in additions:
            built = add(built)
        if table.p_delta:
            if table.loads is not None:
                raise InvalidSettingError("loads", "p_delta and loads both give the weights; keep one")
            with keyed("p_delta"):
                built = with_p_delta(built)
    return built.check()


def refuse_without_masses(building: Building) -> None:
    """Refuse dampers and additions for a building without known masses."""
    if not building.knows_masses:
        raise InvalidSettingError(
            (),
            "A alone does not say what a force does, and the building has dampers or additions; give M in the file, or "
            'inputs = ["ground", 1], which says what the columns of its B are',
        )


def _with_statements(building: Building, table: BuildingTable) -> Building:
    """The building with what a table states beside its matrices: names, strokes, elements, heights, weights."""
    elements = tuple(element.call()() for element in table.element or ())
    n_strokes = building.n_strokes if table.n_strokes is None else table.n_strokes
    count = max(len(building.storeys) - n_strokes, 0)
    if table.height is not None and table.heights is not None:
        raise InvalidSettingError("height", "height and heights both give the heights; keep one")
    heights = (table.height,) * count if table.height is not None else table.heights
    if heights is not None and len(heights) != count:
        raise InvalidSettingError(
            "heights",
            f"heights has {counted(len(heights), 'number')} for {counted(count, 'storey')}; give one for each, or "
            "`height` in its place, one for all",
        )
    strokes = np.zeros(len(building.storeys) - count)
    stated: dict[str, Any] = {
        **named(table, "name", "source", "floor_names", "storey_names", "n_strokes", "isolators"),
        **named(table, "drift_limit"),
        "elements": (*building.elements, *elements),
        "heights": None if heights is None else np.append(heights, strokes),
        "loads": None if table.loads is None else np.append(table.loads, strokes),
    }
    given = {name: value for name, value in stated.items() if value is not None}
    return replace(building, **building.from_coordinates(given))


def _shear(table: BuildingTable) -> Building:
    if not table.stiffnesses:
        raise InvalidSettingError(
            (), "the building has no stiffnesses; give the stiffnesses of its storeys [N/m]"
        )
    given: dict[str, Any] = {name: getattr(table, name) or () for name in _SHEAR[:3]}
    if table.n_storeys is not None:
        # A single number holds for every floor or storey.
        for name in filter(given.__getitem__, given):
            given[name] = one_for_each(name, np.squeeze(given[name]), table.n_storeys, "storey").tolist()
    return shear_building(name=table.name or "building", **given)


def _in_si(arrays: Mapping[str, Floats], table: BuildingTable) -> dict[str, Floats]:
    """Arrays in SI, of which mass, damping and stiffness are in the units of a table: mass, force, perhaps length."""
    if table.units is None:
        return dict(arrays)
    given = [unit_of(text.strip()) for text in table.units.split(",")]
    mass, force, length = (
        [unit.factor for unit in given if unit and (known := unit_of(si)) and unit.powers == known.powers]
        for si in ("kg", "N", "m")
    )
    if not len(mass) == len(force) == 1 or len(given) != 2 + len(length[:1]):
        raise InvalidSettingError(
            "units",
            f"units is '{table.units}' where a unit of mass, one of force and perhaps one of length were expected, as "
            "in 't, kN' or 't, N, mm'",
        )
    stiffness = force[0] / (length or [1.0])[0]
    factors = {"mass": mass[0], "damping": stiffness, "stiffness": stiffness}
    return {name: factors[name] * array if name in factors else array for name, array in arrays.items()}


def _arrays(table: BuildingTable, folder: Path) -> dict[str, Floats]:
    arrays: dict[str, Floats] = {}
    for name in (*_MATRICES, *_ROWS, "influence"):
        value = getattr(table, name)
        if isinstance(value, str):
            with keyed(name):
                read = read_matrix(folder / value)
                arrays[name] = read.ravel() if name == "influence" else read
        elif value is not None:
            arrays[name] = np.array(value, dtype=np.float64)
    return _in_si(arrays, table)


def _from_system(table: BuildingTable, folder: Path) -> Building:
    """The building of a state space; masses are stated, follow from forces of dampers, or stay unknown."""
    path = folder / str(table.system)
    name, arrays = table.name or path.stem, _arrays(table, folder)
    with keyed("system"):
        contents = read_contents(path, ("A", "B", "M", "mass"))
        matrices = matrices_among(contents)
        if "A" not in matrices:
            found = describe_left_out(contents) or "nothing"
            raise InvalidSettingError((), f"{path}: a state space needs A, and M or B; found {found}")
        rest = {name: content for name, content in contents.items() if name not in ("A", "B")}
        given, source = _choose_matrices(
            rest, path, {*_TITLES.values(), *arrays} - ({"mass"} - arrays.keys())
        )
        A = matrices["A"]
        B = matrices.get("B", np.empty((len(A), 0)))
        for letter, matrix, width in (("A", A, len(A)), ("B", B, B.shape[-1])):
            if matrix.shape != (len(A), width):
                raise InvalidSettingError(
                    (), f"{path}: {letter} has shape {matrix.shape}; give {(len(A), width)}"
                )
        order, n = order_of_states(A, name), len(A) // 2
    mass, inputs = arrays.get("mass", given.get("mass")), table.inputs or ()
    if inputs and len(inputs) != B.shape[1]:
        raise InvalidSettingError(
            "inputs",
            f"inputs has {counted(len(inputs), 'name')}, and B has {counted(B.shape[1], 'column')}; name each",
        )
    if "ground" in inputs and "influence" not in arrays:
        arrays["influence"] = -B[order[n:], inputs.index("ground")]
    shape: dict[str, Any] = {title: arrays[title] for title in ("influence", *_ROWS) if title in arrays}
    built = partial(building_of, A, name=name, source=table.source or source, **shape)
    with keyed("system"):
        building = built(mass=mass)
    forces = [number for number, input_name in enumerate(inputs) if input_name != "ground"]
    if mass is None and forces:
        with keyed("inputs"):
            rows = np.stack([building.storey_row(inputs[number]) for number in forces])
            return built(mass=mass_of_forces(A, B[:, forces], rows, name))
    if mass is None:
        warn(
            f"{path}: there is no M, so the masses of {name} and its shears are not known, and what tables say of them "
            "means nothing; displacements and accelerations are right",
            MrworkWarning,
            stacklevel=2,
        )
    return building


def _choose_matrices(
    contents: Variables, path: Path, instead: Collection[str]
) -> tuple[dict[str, Floats], str]:
    """The matrices of a building in a file by title but `instead`, and its name with the rest of its contents.

    A vector is no matrix of the building where a matrix has its other name. Of two that are not equal none is taken.
    """
    matrices, chosen = matrices_among(contents), dict[str, str]()
    is_large = any(min(matrix.shape) > 1 for matrix in matrices.values())
    for title in dict.fromkeys(_TITLES.values()):
        names = [name for name in matrices if _TITLES.get(name) == title and title not in instead]
        if title in _MATRICES:
            names = [name for name in names if min(matrices[name].shape) > 1] or names
        elif is_large:
            # A radius r, a number of storeys.
            names = [name for name in names if matrices[name].size > 1]
        if any(not np.array_equal(matrices[name], matrices[names[0]]) for name in names[1:]):
            listed = " or ".join(f"'{name}'" for name in names)
            of_file = f"{path.name}:{names[0]}" if path.suffix else f"{path.name}/{names[0]}.csv"
            raise InvalidSettingError(
                (),
                f"{title} may be {listed}, which differ; name one by a key of the building, as in "
                f'{title} = "{of_file}"',
            )
        chosen |= dict.fromkeys([title], names[0]) if names else {}
    rest = describe_left_out({name: of for name, of in contents.items() if name not in chosen.values()})
    source = f"{path}; not used: {rest}" if rest else str(path)
    return {title: matrices[name] for title, name in chosen.items()}, source


def _from_matrices(matrices: Mapping[str, Floats], table: BuildingTable) -> Building:
    """The building of matrices by title."""
    given: dict[str, Any] = dict(matrices)
    for title in ("mass", "stiffness"):
        if title not in given:
            found = f"found {', '.join(matrices) or 'nothing'} in {table.source or 'the table'}"
            sentence = f"a building needs mass (M), stiffness (K) and usually damping (C); {found}"
            raise InvalidSettingError((), sentence)
    if "influence" in given:
        given["influence"] = given["influence"].ravel()
    return Building(name=table.name or "building", source=table.source or "", **given)
