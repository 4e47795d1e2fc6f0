"""The study file of a study: its tables as TOML, and beside them what no file can hold.

Whatever stands in a table is written under the key that reads it. In the place of a building, a motion, a fit or a
function stands the name of a file beside the study file, of a format that the package reads.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.base.keys import given_in, keys_of, toml_text
from mrwork.buildings import Building
from mrwork.buildings.matrices import PassiveElement
from mrwork.dampers.spec import DamperSpec
from mrwork.dampers.tested_range import FittedDamper
from mrwork.errors import OutputError, SettingError
from mrwork.motions import GroundMotion
from mrwork.store.input_file import exists
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import check_output
from mrwork.store.user_python import function_text
from mrwork.study.schema import StudyTable

_OTHERWISE = "replace it by `replace=True`"
_IN_A_FILE = (
    "write it into a Python file, and give that file, as user={'file': 'my_law.py', 'function': 'my_law'}"
)

_Put = Callable[[str, bytes], str]
"""Takes the name of a file, or of a file in a folder, and its content; returns how the study file names it."""


def write_study_file(table: StudyTable, folder: Path, seed: int, path: Path, *, replace: bool) -> None:
    """Write the study file of a table, of which names of files are relative to `folder`, and what stands beside it."""
    home, beside = path.parent.resolve(), f"{path.stem}_files"
    # The names stay, so that the study file names the folder that they are relative to.
    folder = folder if _names_files(table) else home
    files: dict[str, bytes] = {}

    def put(name: str, content: bytes) -> str:
        files[f"{beside}/{name}"] = content
        return os.path.relpath(home / beside / name, folder)

    document = {"title": "", "folder": "", **given_in(table)}
    document["folder"] = "" if folder == home else os.path.relpath(folder, home)
    _put_values(document, put)
    note = f"# Of the seed {seed}, as `mrwork respond --seed {seed}` has it.\n" if seed else ""
    text = toml_text({name: value for name, value in document.items() if value != ""})
    check_output(path, replace=replace, otherwise=_OTHERWISE)
    if files and not replace and exists(home / beside):
        raise OutputError(f"{path.parent / beside} is there already; choose another name, or {_OTHERWISE}")
    for name, content in {**files, path.name: (note + text).encode()}.items():
        write_file(home / name, content)


def _names_files(table: Any) -> bool:
    """Whether a key of the table, or of a table in it, names a file."""
    for entry in keys_of(type(table)):
        value = getattr(table, entry.name)
        inner = [entry for entry in (value if isinstance(value, tuple) else (value,)) if is_dataclass(entry)]
        if (entry.says.file and _has_text(value)) or any(map(_names_files, inner)):
            return True
    return False


def _has_text(value: object) -> bool:
    if isinstance(value, Mapping | tuple | list):
        return any(map(_has_text, value.values() if isinstance(value, Mapping) else value))
    return isinstance(value, str)


def _put_values(document: dict[str, Any], put: _Put) -> None:
    """Put the values of a document that no file can hold into files, whose names take their places."""
    _put_building(document["building"], "building", put)
    for number, baseline in enumerate(document.get("baseline", ()), start=1):
        _put_building(baseline["building"], f"building_{number}", put)
    for number, damper in enumerate(document.get("damper", ()), start=1):
        if isinstance(model := damper.get("model"), DamperSpec):
            raise SettingError(
                f"damper {number} is the model {model.name} of its user with parameters, which no file holds; give a "
                "fit of it, or its run folder"
            )
        fit = damper.get("run")
        if isinstance(fit, FittedDamper):
            names = [put(f"damper_{number}/{name}", content) for name, content in fit.files().items()]
            damper["run"] = str(Path(names[0]).parent)
    for number, controller in enumerate(document.get("controller", ()), start=1):
        user = controller.get("user", {})
        if callable(user.get("file")):
            text = function_text(user["file"], what="the law", remedy=_IN_A_FILE)
            user["file"] = put(f"law_{number}.py", text.encode())
    for number, motion in enumerate(document["motion"], start=1):
        _put_motion(motion, f"motion_{number}.txt", put)


def _put_building(table: dict[str, Any], name: str, put: _Put) -> None:
    value = table.get("file")
    if not isinstance(value, Building):
        return
    arrays = ("mass", "damping", "stiffness", "influence", "floors", "storeys")
    for array in arrays:
        rows = np.atleast_2d(getattr(value, array)).tolist()
        text = "\n".join(",".join(map(repr, row)) for row in rows)
        table["file"] = str(Path(put(f"{name}/{array}.csv", f"{text}\n".encode())).parent)
    elements = [
        {entry.name: getattr(element, entry.name) for entry in keys_of(PassiveElement)}
        for element in value.elements
    ]
    stated = {
        "name": value.name,
        "source": value.source,
        "floor_names": list(value.floor_names),
        "storey_names": list(value.storey_names),
        "n_strokes": value.n_strokes,
        "heights": value.drift_heights.tolist(),
        "drift_limit": value.drift_limit,
        "loads": value.loads[: len(value.drifts)].tolist(),
        "element": [element | {"row": element["row"].tolist()} for element in elements],
    }
    table |= {key: entry for key, entry in stated.items() if entry and key not in table}


def _put_motion(table: dict[str, Any], name: str, put: _Put) -> None:
    value, samples = table.get("file"), table.pop("acceleration", None)
    if isinstance(value, GroundMotion):
        group, groups = table.get("group", []), list(value.groups)
        groups = [*(group if isinstance(group, list) else [group]), *groups]
        table |= {"name": table.get("name", value.name), "dt": value.dt}
        table |= {"group": groups} if groups else {}
        samples = value.acceleration.tolist()
    if samples is not None:
        table |= {"unit": table.get("unit", "m/s2"), "name": table.get("name", "motion")}
        table["file"] = put(name, "".join(f"{sample!r}\n" for sample in samples).encode())
