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

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final, NoReturn

import numpy as np

from mrwork.arguments import checked
from mrwork.buildings.additions import (
    with_base_isolation,
    with_base_isolation_of_period,
    with_brace,
    with_modal_damping,
    with_rayleigh_coefficients,
    with_rayleigh_damping,
    with_viscous_damper,
)
from mrwork.buildings.matrices import Building, check_size
from mrwork.buildings.passive_devices import (
    with_friction_damper,
    with_lead_rubber_bearings,
    with_liquid_column,
    with_optimal_liquid_column,
    with_optimal_tuned_mass,
    with_tuned_mass,
    with_yielding_damper,
)
from mrwork.buildings.shear import building as published_building
from mrwork.buildings.shear import check_storeys, number_names, shear_building
from mrwork.errors import RecordError
from mrwork.files.matlab import read_matlab_matrices
from mrwork.keys import Place, shown
from mrwork.store.input_file import MATRIX, TOML, is_folder, text_of, toml_table
from mrwork.store.run_folder import real_place
from mrwork.values import Floats

_SEPARATOR: Final = re.compile(r"\s*[,;\t]\s*|\s+")
_SUFFIXES: Final = (".csv", ".tsv", ".txt")


def read_matrix(path: Path) -> Floats:
    """Read a matrix from a text file with one row per line, shape (n_rows, n_columns).

    Numbers are separated by commas, semicolons, tabs or spaces; text after a # is a comment.
    """
    if path.suffix.lower() not in _SUFFIXES:
        raise RecordError(
            f"{path}: a matrix is read from a {', '.join(_SUFFIXES)} file; save it as one of these"
        )
    text = text_of(path, MATRIX)
    rows: list[list[float]] = []
    for number, line in enumerate(text.splitlines(), start=1):
        content = line.partition("#")[0].strip()
        if not content:
            continue
        fields = _SEPARATOR.split(content)
        # Some exports end each line with a separator.
        row = [
            _number(field, f"{path}: line {number}") for field in (fields[:-1] if not fields[-1] else fields)
        ]
        if rows and len(row) != len(rows[0]):
            raise RecordError(
                f"{path}: line {number} has {len(row)} numbers where the first row has {len(rows[0])}; complete it"
            )
        rows.append(row)
    if not rows:
        raise RecordError(f"{path}: the file holds no numbers; a matrix was expected, a row in each line")
    return np.array(rows)


def read_matrices(path: Path, names: Collection[str]) -> dict[str, Floats]:
    """Read matrices by name from a .mat file, or from a folder with one text file per matrix in `names`."""
    if is_folder(path):
        files = sorted(file for file in path.iterdir() if file.suffix.lower() in _SUFFIXES)
        return {file.stem: read_matrix(file) for file in files if file.stem in names}
    return read_matlab_matrices(path)


def _number(field: str, where: str) -> float:
    try:
        return float(field)
    except ValueError:
        shown = field if len(field) <= 40 else field[:40] + "..."
        raise RecordError(
            f"{where} holds '{shown}' where a number was expected; a matrix has no header"
        ) from None


@dataclass(frozen=True, slots=True)
class Entries:
    """A parsed table and its place in a document.

    Every method raises a SettingError if a value is missing or of another type.
    """

    table: Mapping[str, object]
    place: Place

    def __contains__(self, key: str) -> bool:
        return key in self.table

    def refuse(self, sentence: str, *keys: str) -> NoReturn:
        """Raise an error that begins with the place of a key."""
        self.place.within(*keys).refuse(sentence)

    def allow(self, known: Sequence[str]) -> None:
        """Check that all keys are among those known."""
        for key in self.table:
            if key not in known:
                near = get_close_matches(key, known, n=1)
                hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
                self.refuse(f"there is no key {key!r}; {hint}", key)

    def number(self, key: str, default: float | None = None) -> float:
        """Return a number."""
        value = self._get(key, "a number", default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(f"{key} is {shown(value)}; give a number", key)
        return float(value)

    def whole(self, key: str, default: int | None = None) -> int:
        """Return a whole number."""
        value = self._get(key, "a whole number", default)
        if isinstance(value, bool) or not isinstance(value, int):
            self.refuse(f"{key} is {shown(value)}; give a whole number", key)
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text."""
        value = self._get(key, "a text", default)
        if not isinstance(value, str):
            self.refuse(f"{key} is {shown(value)}; give a text in quotes", key)
        return value

    def floor(self, key: str) -> int | str:
        """Return the number or name of a floor or storey."""
        value = self._get(key, "its number from 1 or its name")
        if isinstance(value, bool) or not isinstance(value, int | str):
            self.refuse(f"{key} is {shown(value)}; give its number from 1 or its name", key)
        return value

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return an array of numbers."""
        value = self._get(key, "numbers, as [1.0, 2.0]")
        if not isinstance(value, list) or not all(_is_number(each) for each in value):
            self.refuse(f"{key} is {shown(value)}; give numbers, as [1.0, 2.0]", key)
        return tuple(float(each) for each in value)

    def texts(self, key: str) -> tuple[str, ...]:
        """Return an array of texts."""
        value = self._get(key, 'texts, as ["a", "b"]')
        if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
            self.refuse(f'{key} is {shown(value)}; give texts, as ["a", "b"]', key)
        return tuple(value)

    def rows(self, key: str) -> Floats:
        """Return a matrix, given row by row."""
        value = self._get(key, "rows of numbers")
        example = "give rows of numbers, as [[2.0, -1.0], [-1.0, 1.0]]"
        if not isinstance(value, list) or not value or not all(isinstance(row, list) for row in value):
            self.refuse(f"{key} is {shown(value)}; {example}, or the name of a file", key)
        for number, row in enumerate(value, start=1):
            if len(row) != len(value[0]) or not all(_is_number(each) for each in row):
                self.refuse(f"row {number} of {key} is not {len(value[0])} numbers; {example}", key)
        return np.array(value, dtype=np.float64)

    def inner(self, key: str) -> Entries:
        """Return a nested table."""
        value = self._get(key, "a table")
        if not isinstance(value, dict):
            self.refuse(f"{key} is {shown(value)}; give a table, as [{key}]", key)
        return Entries(value, self.place.within(key))

    def inner_all(self, key: str) -> tuple[Entries, ...]:
        """Return the tables of an array, none if the key is absent; a single table counts as an array of one."""
        value = self.table.get(key, [])
        tables = [value] if isinstance(value, dict) else value
        if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
            self.refuse(f"{key} is {shown(value)}; give one or more tables, as [[{key}]]", key)
        if isinstance(value, dict):
            return (Entries(value, self.place.within(key)),)
        return tuple(Entries(each, self.place.within(key, number)) for number, each in enumerate(tables))

    def _get(self, key: str, expected: str, default: object = None) -> object:
        value = self.table.get(key, default)
        if value is None:
            self.refuse(f"{key} is missing; give {expected}")
        return value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _rayleigh(building: Building, entries: Entries) -> Building:
    entries.allow(("ratios", "modes", "a0", "a1"))
    if "ratios" not in entries:
        a0, a1 = entries.number("a0"), entries.number("a1")
        with entries.place.prefixed():
            return with_rayleigh_coefficients(building, a0=a0, a1=a1)
    if "a0" in entries or "a1" in entries:
        entries.refuse("Rayleigh damping is given by ratios in two modes or by a0 and a1; keep one", "ratios")
    ratios = entries.numbers("ratios")
    modes = entries.numbers("modes") if "modes" in entries else (1.0, 2.0)
    if len(ratios) != 2 or len(modes) != 2 or not all(mode.is_integer() for mode in modes):
        entries.refuse(
            "Rayleigh damping takes two ratios and two modes, as ratios = [0.02, 0.02], modes = [1, 3]",
            "ratios",
        )
    with entries.place.prefixed():
        return with_rayleigh_damping(
            building, ratios=(ratios[0], ratios[1]), modes=(int(modes[0]), int(modes[1]))
        )


def _modal(building: Building, entries: Entries) -> Building:
    entries.allow(("ratios",))
    ratios = entries.numbers("ratios")
    with entries.place.prefixed():
        return with_modal_damping(building, ratios=ratios)


def _isolation(building: Building, entries: Entries) -> Building:
    entries.allow(("mass", "period", "ratio", "stiffness", "damping"))
    mass = entries.number("mass")
    if "period" in entries:
        if "stiffness" in entries or "damping" in entries:
            entries.refuse(
                "isolators are given by period and ratio or by stiffness and damping; keep one", "period"
            )
        period, ratio = entries.number("period"), entries.number("ratio")
        with entries.place.prefixed():
            return with_base_isolation_of_period(building, mass=mass, period=period, ratio=ratio)
    stiffness, damping = entries.number("stiffness"), entries.number("damping")
    with entries.place.prefixed():
        return with_base_isolation(building, mass=mass, stiffness=stiffness, damping=damping)


def _viscous(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "damping"))
    storey, damping = entries.floor("storey"), entries.number("damping")
    with entries.place.prefixed():
        return with_viscous_damper(building, storey=storey, damping=damping)


def _brace(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "stiffness", "mass", "damping", "name"))
    storey, name = entries.floor("storey"), entries.text("name", "")
    stiffness, mass, damping = (
        entries.number("stiffness"),
        entries.number("mass"),
        entries.number("damping", 0.0),
    )
    with entries.place.prefixed():
        return with_brace(building, storey=storey, stiffness=stiffness, mass=mass, damping=damping, name=name)


def _tuned_mass(building: Building, entries: Entries) -> Building:
    entries.allow(("floor", "mass_ratio", "tuning", "mode", "mass", "frequency", "ratio", "name"))
    floor, name = entries.floor("floor"), entries.text("name", "tuned mass")
    if "mass_ratio" in entries:
        for key in ("mass", "frequency", "ratio"):
            if key in entries:
                entries.refuse(
                    "a tuned mass is given by mass_ratio or by mass, frequency and ratio; keep one", key
                )
        mass_ratio, tuning = entries.number("mass_ratio"), entries.text("tuning", "warburton")
        mode = entries.whole("mode", 1)
        with entries.place.prefixed():
            return with_optimal_tuned_mass(
                building, floor=floor, mass_ratio=mass_ratio, tuning=tuning, mode=mode, name=name
            )
    mass, frequency, ratio = entries.number("mass"), entries.number("frequency"), entries.number("ratio")
    with entries.place.prefixed():
        return with_tuned_mass(building, floor=floor, mass=mass, frequency=frequency, ratio=ratio, name=name)


def _yielding(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "yield_force", "yield_displacement", "post_yield_ratio", "sharpness", "name"))
    storey, name = entries.floor("storey"), entries.text("name", "")
    numbers = {
        "yield_force": entries.number("yield_force"),
        "yield_displacement": entries.number("yield_displacement"),
        **_given(entries, "post_yield_ratio", "sharpness"),
    }
    with entries.place.prefixed():
        return with_yielding_damper(building, storey=storey, name=name, **numbers)


def _friction(building: Building, entries: Entries) -> Building:
    entries.allow(("storey", "slip_load", "stiffness", "sharpness", "name"))
    storey, name = entries.floor("storey"), entries.text("name", "")
    slip_load, stiffness = entries.number("slip_load"), entries.number("stiffness")
    numbers = _given(entries, "sharpness")
    with entries.place.prefixed():
        return with_friction_damper(
            building, storey=storey, name=name, slip_load=slip_load, stiffness=stiffness, **numbers
        )


def _lead_rubber(building: Building, entries: Entries) -> Building:
    if "isolation" in building.storey_names:
        entries.refuse("isolation and lead_rubber both stand under the building; keep one")
    entries.allow(("mass", "period", "ratio", "yield_force", "yield_displacement", "sharpness", "name"))
    name = entries.text("name", "lead-rubber bearings")
    mass, period = entries.number("mass"), entries.number("period")
    yield_force = entries.number("yield_force")
    numbers = _given(entries, "yield_displacement", "ratio", "sharpness")
    with entries.place.prefixed():
        return with_lead_rubber_bearings(
            building, mass=mass, period=period, yield_force=yield_force, name=name, **numbers
        )


def _liquid_column(building: Building, entries: Entries) -> Building:
    entries.allow(
        (
            "floor",
            "mass_ratio",
            "width_ratio",
            "rms_velocity",
            "mode",
            "mass",
            "frequency",
            "head_loss",
            "name",
        )
    )
    floor, name = entries.floor("floor"), entries.text("name", "liquid column")
    width_ratio = entries.number("width_ratio")
    if "mass_ratio" in entries:
        for key in ("mass", "frequency", "head_loss"):
            if key in entries:
                entries.refuse(
                    "a liquid column is given by mass_ratio and rms_velocity or by mass, frequency and head_loss; "
                    "keep one",
                    key,
                )
        mass_ratio, rms_velocity = entries.number("mass_ratio"), entries.number("rms_velocity")
        mode = entries.whole("mode", 1)
        with entries.place.prefixed():
            return with_optimal_liquid_column(
                building,
                floor=floor,
                mass_ratio=mass_ratio,
                width_ratio=width_ratio,
                rms_velocity=rms_velocity,
                mode=mode,
                name=name,
            )
    for key in ("rms_velocity", "mode"):
        if key in entries:
            entries.refuse(f"{key} goes with mass_ratio; leave it out, or give mass_ratio", key)
    mass, frequency = entries.number("mass"), entries.number("frequency")
    head_loss = entries.number("head_loss")
    with entries.place.prefixed():
        return with_liquid_column(
            building,
            floor=floor,
            mass=mass,
            frequency=frequency,
            width_ratio=width_ratio,
            head_loss=head_loss,
            name=name,
        )


def _given(entries: Entries, *keys: str) -> dict[str, float]:
    """The numbers of a table that it has; the others are left to the defaults of the function."""
    return {key: entries.number(key) for key in keys if key in entries}


_ONE: Final[Mapping[str, Callable[[Building, Entries], Building]]] = {
    "rayleigh": _rayleigh,
    "modal_damping": _modal,
    "isolation": _isolation,
    "lead_rubber": _lead_rubber,
}
_SEVERAL: Final[Mapping[str, Callable[[Building, Entries], Building]]] = {
    "viscous": _viscous,
    "yielding": _yielding,
    "friction": _friction,
    "brace": _brace,
    "tuned_mass": _tuned_mass,
    "liquid_column": _liquid_column,
}
ADDITIONS: Final = (*_ONE, *_SEVERAL)
"""Keys of additions, in the order in which they are applied."""


def with_additions(building: Building, entries: Entries) -> Building:
    """Return the building with the additions of a table, applied in the order of `ADDITIONS`.

    Damping ratios therefore refer to the bare building, and storey 1 of an isolated building is the isolators.
    """
    if "rayleigh" in entries and "modal_damping" in entries:
        entries.refuse("rayleigh and modal_damping both give the damping; keep one", "modal_damping")
    for key, add in _ONE.items():
        if key in entries:
            building = add(building, entries.inner(key))
    for key, add in _SEVERAL.items():
        for inner in entries.inner_all(key):
            building = add(building, inner)
    return building


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
    """The building of a parsed table, at a place of a document; see the module for the keys."""
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
            floor_names=floor_names or number_names("floor", len(floors)),
            storey_names=storey_names or number_names("storey", len(storeys)),
            source=words.get("source", ""),
        )
