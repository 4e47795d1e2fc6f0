"""The study file of a study: its tables as TOML, and beside them what no file can hold.

Whatever stands in a table is written under the key that reads it. In the place of a building, a motion, a fit or a
function stands the name of a file beside the study file, of a format that the package reads.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.base.keys import as_document, given_in, keys_of, toml_text
from mrwork.base.summary import named
from mrwork.buildings import Building
from mrwork.control.laws.control_law import ControlLaw, ControlLawSpec
from mrwork.control.laws.own_formula import OwnFormula
from mrwork.dampers.spec import DamperSpec
from mrwork.dampers.tested_range import FittedDamper
from mrwork.errors import OutputError
from mrwork.motions import GroundMotion
from mrwork.store.codec import json_document
from mrwork.store.input_file import exists
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import check_output
from mrwork.store.user_python import function_text
from mrwork.study.schema import GROUNDS, StudyTable

_OTHERWISE = "replace it by `replace=True`"
_IN_A_FILE = (
    "write it into a Python file, and give that file, as user={'file': 'my_law.py', 'function': 'my_law'}"
)
_ARRAYS = ("mass", "damping", "stiffness", "influence", "floors", "storeys")

_Put = Callable[[str, Mapping[str, bytes]], str]
"""Takes the name of a folder and its files, or of one file without a name; returns how the study file names it."""


def write_study_file(table: StudyTable, folder: Path, seed: int, path: Path, *, replace: bool) -> None:
    """Write the study file of a table, of which names of files are relative to `folder`, and what stands beside it."""
    home, beside = path.parent.resolve(), f"{path.stem}_files"
    # The names stay, so that the study file names the folder that they are relative to.
    folder = folder if _names_files(table) else home
    files: dict[Path, bytes] = {}

    def put(name: str, content: Mapping[str, bytes]) -> str:
        files.update({home / beside / name / part: data for part, data in content.items()})
        return os.path.relpath(home / beside / name, folder)

    document = {"title": "", "folder": "", **given_in(table)}
    document["folder"] = "" if folder == home else os.path.relpath(folder, home)
    document = {name: _written(value, (name,), put) for name, value in document.items() if value != ""}
    note = f"# Of the seed {seed}, as `mrwork respond --seed {seed}` has it.\n" if seed else ""
    check_output(path, replace=replace, otherwise=_OTHERWISE)
    if files and not replace and exists(home / beside):
        raise OutputError(f"{path.parent / beside} is there already; choose another name, or {_OTHERWISE}")
    for file, content in {**files, home / path.name: (note + toml_text(document)).encode()}.items():
        write_file(file, content)


def _names_files(value: object, *, is_file: bool = False) -> bool:
    """Whether a key of a table, or of a table in it, names a file."""
    if isinstance(value, str):
        return is_file
    if is_dataclass(value):
        keys = keys_of(type(value))
        return any(_names_files(getattr(value, key.name), is_file=key.says.file) for key in keys)
    inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, tuple | list) else ()
    return any(_names_files(item, is_file=is_file) for item in inner)


def _written(value: Any, keys: tuple[str, ...], put: _Put) -> Any:
    """The value of a document behind these keys; what no file can hold is put into files, which it then names."""
    name = "_".join(keys)
    match value:
        case {"file": Building() as building, **given}:
            rows = {array: np.atleast_2d(getattr(building, array)).tolist() for array in _ARRAYS}
            return {
                "file": put(name, {f"{array}.csv": _text_of(matrix) for array, matrix in rows.items()}),
                **_statements(building),
                **given,
            }
        case {"file": GroundMotion() as motion, **given}:
            group = given.pop("group", [])
            groups = [*(group if isinstance(group, list) else [group]), *motion.groups]
            given |= {"group": groups} if groups else {}
            if motion.forces.size and not motion.peak:
                forced = {"name": motion.name, "dt": motion.dt, "forces": motion.forces.tolist(), **given}
                return _written(forced, keys, put)
            heading = "road_acceleration\n" if motion.is_road else ""
            file = put(f"{name}.txt", {"": _samples(motion.acceleration.tolist(), heading)})
            given |= {"forces": motion.forces.tolist()} if motion.forces.size else {}
            return {"file": file, "unit": "m/s2", "name": motion.name, "dt": motion.dt, **given}
        case {"acceleration": samples, **given} if keys[0] == "motion":
            file = put(f"{name}.txt", {"": _samples(samples)})
            return {"file": file, "unit": "m/s2", "name": "motion", **given}
        case {"forces": rows, **given} if keys[0] == "motion" and not {*GROUNDS} & {*given}:
            file = put(f"{name}.csv", {"": _text_of(zip(*rows, strict=True))})
            return {"force": file, "unit": "N", "name": "forces", **given}
        case {"file": ControlLaw(spec=ControlLawSpec(own=OwnFormula() as own)), **given}:
            text = function_text(own.function, what="the law", remedy=_IN_A_FILE)
            text += f"\n\nimport mrwork\n\n{given['law']} = mrwork.own_law({own.function.__name__}, {own.given})\n"
            return {"file": put(f"{name}.py", {"": text.encode()}), **given}
        case {"file": function, **given} if callable(function):
            text = function_text(function, what="the law", remedy=_IN_A_FILE)
            return {"file": put(f"{name}.py", {"": text.encode()}), **given}
        case {"run": FittedDamper() as fit, **given}:
            return {"run": put(name, fit.files()), **given}
        case {"model": DamperSpec() as model, **given}:
            # Formulas, which are data: reading them runs nothing.
            content = json_document(model.without_laws).encode()
            return {
                "model_file": put(f"{name}_{model.name}.json", {"": content}),
                **_written(given, keys, put),
            }
        case dict():
            return {key: _written(item, (*keys, key), put) for key, item in value.items()}
        case list():
            return [_written(item, (*keys, str(number)), put) for number, item in enumerate(value, start=1)]
    return value


def _samples(samples: Sequence[float], heading: str = "") -> bytes:
    return (heading + "".join(f"{sample!r}\n" for sample in samples)).encode()


def _text_of(rows: Iterable[Sequence[float]]) -> bytes:
    return "".join(f"{','.join(map(repr, row))}\n" for row in rows).encode()


def _statements(building: Building) -> dict[str, Any]:
    stated = {
        **named(building, "name", "source", "floor_names", "storey_names", "n_strokes", "isolators"),
        **named(building, "drift_limit"),
        "heights": building.heights[: len(building.chain)].tolist(),
        "loads": building.loads[: len(building.chain)].tolist(),
        "element": [as_document(element) | {"row": element.row.tolist()} for element in building.elements],
    }
    return {name: value for name, value in stated.items() if value}
