"""Scripts of studies: what they import is public, and the numbers of their quick forms are the expected ones."""

from __future__ import annotations

import ast
import json
import runpy
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest

from common import DATA

STUDIES = Path(__file__).parents[2] / "studies"
SCRIPTS = sorted(path for path in STUDIES.glob("*.py") if path.stem not in ("__init__", "common"))
# Seconds each.
LONG: set[str] = {"speed_kernels", "speed_loop", "speed_posterior"}
# What a script must be told.
ARGUMENTS = {"speed": ["regulators"]}


def private_names(tree: ast.Module) -> list[str]:
    """Names of the package that a script uses and that are not public."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "mrwork":
            public = import_module(node.module or "").__all__
            found += [f"{node.module}.{each.name}" for each in node.names if each.name not in public]
        elif isinstance(node, ast.Attribute):
            names = ast.unparse(node).split(".")
            module: object = import_module("mrwork")
            for name in names[1:] if names[0] == "mr" else ():
                if not isinstance(module, ModuleType):
                    break
                if name not in module.__all__:
                    found.append(".".join(names))
                module = getattr(module, name, None)
    return found


@pytest.mark.parametrize("path", SCRIPTS, ids=lambda path: path.stem)
def test_a_script_is_short_and_uses_public_names(path: Path) -> None:
    text = path.read_text()
    tree = ast.parse(text)
    assert ast.get_docstring(tree)
    assert len(text.splitlines()) <= 320
    assert not [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
    assert private_names(tree) == []


@pytest.mark.parametrize(
    "path",
    [pytest.param(path, marks=[pytest.mark.long] * (path.stem in LONG), id=path.stem) for path in SCRIPTS],
)
def test_the_quick_form_finds_what_is_expected(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = [path.name, *ARGUMENTS.get(path.stem, []), "--quick", "--json", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(path), run_name="__main__")
    if ended.value.code == 2 and not DATA.is_dir():
        pytest.skip(f"no measured data at {DATA}")
    found = json.loads(capsys.readouterr().out)
    assert found.pop("departures") == []
    assert ended.value.code == 0
    assert any(table for table in found.values())
