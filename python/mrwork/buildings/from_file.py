"""Read a building from a file or from a parsed table.

A table gives a building in one of four forms, and may then change it:

=====================  ==================================================================================
key                    meaning
=====================  ==================================================================================
published              name of a published building, as "uts"
file                   .toml, .mat (M, C, K by name), or a folder with M.csv, C.csv, K.csv
mass, stiffness,       matrices [kg], [N/m], [N s/m], as rows of numbers or the name of a text file; with
damping                `published` or `file` they replace the matrices of that building
masses, stiffnesses,   floors [kg] and storeys [N/m], [N s/m] of a shear building, lowest first
storey_damping
n_storeys              of that building; a single mass, stiffness or damping then applies to all storeys
influence, floors,     as in `Building`; by default each coordinate is the displacement of a floor
storeys
floor_names,           names in reports
storey_names
name, source           name of the building, and origin of its numbers
[rayleigh]             ratios = [0.02, 0.02], modes = [1, 3]; or a0 [1/s], a1 [s]
[modal_damping]        ratios = [0.01], one for all or one for each mode
[isolation]            mass [kg] of the slab; period [s], ratio, or stiffness [N/m], damping [N s/m]
[lead_rubber]          mass [kg] of the slab; period [s], ratio of the rubber; yield_force [N],
                       yield_displacement [m], sharpness, name
[[viscous]]            storey, damping [N s/m]
[[yielding]]           storey, yield_force [N], yield_displacement [m], post_yield_ratio, sharpness, name
[[friction]]           storey, slip_load [N], stiffness [N/m] of the brace, sharpness, name
[[brace]]              storey, stiffness [N/m], mass [kg], damping [N s/m], name
[[tuned_mass]]         floor, mass_ratio, tuning, mode; or mass [kg], frequency [Hz], ratio; name
[[liquid_column]]      floor, width_ratio; mass_ratio, rms_velocity [m/s], mode; or mass [kg], frequency [Hz],
                       head_loss; name
=====================  ==================================================================================
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.buildings.matrices import Building, check_size
from mrwork.buildings.matrix_files import read_matrices, read_matrix
from mrwork.buildings.published import building as published_building
from mrwork.buildings.shear import check_storeys, numbered, shear_building
from mrwork.buildings.table import ADDITIONS, Entries, with_additions
from mrwork.errors import RecordError
from mrwork.keys import Place
from mrwork.store.input_file import TOML, is_folder, text_of
from mrwork.store.parse import toml_table
from mrwork.store.run_folder import real_place

Floats = NDArray[np.float64]

_MATRICES: Final = ("mass", "damping", "stiffness")
_ROWS: Final = ("floors", "storeys")
# Symbols used in papers.
_LETTERS: Final = {"M": "mass", "C": "damping", "K": "stiffness", "r": "influence"}
_SHEAR: Final = ("masses", "stiffnesses", "storey_damping", "n_storeys")
_TITLES: Final = {**_LETTERS, **{title: title for title in (*_MATRICES, "influence", *_ROWS)}}
_NAMES: Final = ("floor_names", "storey_names")
_WORDS: Final = ("name", "source")
KEYS: Final = ("published", "file", *_MATRICES, *_SHEAR, "influence", *_ROWS, *_NAMES, *_WORDS, *ADDITIONS)


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
        return _from_matrices(
            read_matrices(path, _TITLES), Place(origin=str(path)), {"name": path.stem, "source": str(path)}
        )
    if path.suffix.lower() != ".toml":
        raise RecordError(
            f"{path}: a building comes as a .toml or .mat file, or as a folder with M.csv, C.csv and K.csv; "
            "save it as one of these"
        )
    text = text_of(path, TOML)
    try:
        table = toml_table(text)
    except ValueError as error:
        raise RecordError(f"{path}: is not TOML ({error}); correct it there") from error
    entries = Entries({"name": path.stem, **table}, Place(origin=str(path)))
    built = _built(entries, path.parent, (*readers, real_place(path)))
    return built if built.source else replace(built, source=str(path))


def building_from_table(table: Mapping[str, object], where: Place, *, folder: Path = Path()) -> Building:
    """Return the building described by a parsed table; see the module for the keys.

    Parameters
    ----------
    table
        Table as a TOML parser returns it.
    where
        Its place in a document; messages begin with it.
    folder
        Folder to which file names are relative.
    """
    return _built(Entries(table, where), folder, ())


def _built(entries: Entries, folder: Path, readers: tuple[Path, ...]) -> Building:
    entries.allow(KEYS)
    forms = [key for key in ("published", "file", "masses") if key in entries]
    forms += ["mass"] if "mass" in entries and not forms else []
    if len(forms) != 1:
        given = " and ".join(forms) or "none of them"
        entries.refuse(
            f"a building is given by published, file, mass and stiffness, or masses; here by {given}"
        )
    form = forms[0]
    for key in _SHEAR:
        if key in entries and form != "masses":
            entries.refuse(f"{key} goes with masses, and this building is given by {form}", key)
    # What overflows is refused by `Building`.
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        if form == "masses":
            bare = _shear(entries)
        elif form == "mass":
            bare = _stated(entries, folder)
        else:
            bare = _changed(_named(entries, form, folder, readers), entries, folder)
        return with_additions(bare, entries)


def _named(entries: Entries, form: str, folder: Path, readers: tuple[Path, ...]) -> Building:
    name = entries.text(form)
    if form == "file" and real_place(folder / name) in readers:
        entries.refuse(f"{name} refers back to itself; name the file of another building", form)
    with entries.place.within(form).prefixed():
        return published_building(name) if form == "published" else _read(folder / name, readers)


def _shear(entries: Entries) -> Building:
    for key in (*_MATRICES, "influence", *_ROWS):
        if key in entries:
            entries.refuse(f"{key} goes with matrices, and this building is given by masses", key)
    masses, stiffnesses = _each(entries, "masses"), _each(entries, "stiffnesses")
    storey_damping = _each(entries, "storey_damping") if "storey_damping" in entries else ()
    floor_names, storey_names = (entries.texts(key) if key in entries else () for key in _NAMES)
    name, source = (entries.text(key, "") for key in _WORDS)
    with entries.place.prefixed():
        return shear_building(
            name=name or "building",
            masses=masses,
            stiffnesses=stiffnesses,
            storey_damping=storey_damping,
            floor_names=floor_names,
            storey_names=storey_names,
            source=source,
        )


def _each(entries: Entries, key: str) -> tuple[float, ...]:
    """Return one number per floor or storey; a single number is repeated `n_storeys` times."""
    values = entries.numbers(key)
    if "n_storeys" not in entries:
        return values
    count = entries.whole("n_storeys")
    if count < 1:
        entries.refuse(f"n_storeys is {count}; give 1 or more", "n_storeys")
    with entries.place.within("n_storeys").prefixed():
        check_storeys(count)
    if len(values) not in (1, count):
        entries.refuse(f"{key} has {len(values)} numbers for {count} storeys; give one, or one for each", key)
    return values * count if len(values) == 1 else values


def _stated(entries: Entries, folder: Path) -> Building:
    matrices = _arrays(entries, folder)
    names = {key: entries.texts(key) for key in _NAMES if key in entries}
    return _from_matrices(matrices, entries.place, {key: entries.text(key, "") for key in _WORDS}, **names)


def _changed(known: Building, entries: Entries, folder: Path) -> Building:
    """Return a building with the matrices, names and source replaced by those of a table."""
    arrays = _arrays(entries, folder)
    changes: dict[str, Any] = {key: entries.texts(key) for key in _NAMES if key in entries}
    if arrays:
        replaced = f"{known.source}; {', '.join(arrays)} replaced".removeprefix("; ")
        changes |= {**arrays, "status": "ours", "source": replaced}
    changes |= {key: entries.text(key) for key in _WORDS if key in entries}
    with entries.place.prefixed():
        return replace(known, **changes)


def _arrays(entries: Entries, folder: Path) -> dict[str, Floats]:
    """Read the matrices of a table, each given as rows or as the name of a file."""
    arrays: dict[str, Floats] = {}
    for key in (*_MATRICES, *_ROWS, "influence"):
        if key not in entries:
            continue
        value = entries.table[key]
        if isinstance(value, str):
            with entries.place.within(key).prefixed():
                arrays[key] = read_matrix(folder / value)
        else:
            arrays[key] = np.array(entries.numbers(key)) if key == "influence" else entries.rows(key)
    return arrays


def _from_matrices(
    matrices: Mapping[str, Floats],
    place: Place,
    words: Mapping[str, str],
    floor_names: tuple[str, ...] = (),
    storey_names: tuple[str, ...] = (),
) -> Building:
    """Return the building with the given matrices, named by word or symbol."""
    named = {_TITLES[name]: matrix for name, matrix in matrices.items() if name in _TITLES}
    entries = Entries(named, place)
    for title in ("mass", "stiffness"):
        if title not in named:
            found = ", ".join(matrices) or "nothing"
            entries.refuse(f"a building needs mass (M), stiffness (K) and usually damping (C); found {found}")
    n = len(named["mass"])
    with entries.place.prefixed():
        check_size(n, "building")
    floors = named.get("floors", np.eye(n))
    storeys = named.get("storeys", np.diff(floors, axis=0, prepend=0.0))
    with entries.place.prefixed():
        return Building(
            name=words.get("name") or "building",
            mass=named["mass"],
            damping=named.get("damping", np.zeros((n, n))),
            stiffness=named["stiffness"],
            influence=named.get("influence", np.ones(n)).ravel(),
            floors=floors,
            storeys=storeys,
            floor_names=floor_names or numbered("floor", len(floors)),
            storey_names=storey_names or numbered("storey", len(storeys)),
            source=words.get("source", ""),
        )
