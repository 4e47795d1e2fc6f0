"""Scripts of studies: what they import is public, and the numbers of their quick forms are the expected ones."""

import ast
import json
import runpy
import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from matplotlib.figure import Figure

from common import DATA, departures

STUDIES = Path(__file__).parents[2] / "studies"
SCRIPTS = sorted(path for path in STUDIES.glob("*.py") if path.stem not in ("common", "timing"))
# Seconds each.
LONG = {
    *("boucwen_benchmark", "chapter_2", "chapter_3_design", "chapter_4", "chapter_5", "chapter_6_floors"),
    *("chapter_7", "first_answer", "fragility", "gradients", "how_sure", "leaderboard", "ride"),
    *("one_model_for_a_rig", "robust_control", "rollout", "rollout_yields", "sets_beyond", "weights_tuning"),
    *("speed_formulas", "speed_identify", "speed_kernels", "speed_loop", "speed_posterior", "yielding_frame"),
}
# Whose figures are written, here and by `.ci/bare`; those of the others are laid out only.
DRAWN = "chapter_5"
# What a script must be told.
ARGUMENTS = {"speed": ["regulators"]}


def private_names(tree: ast.Module) -> list[str]:
    """Names of the package that a script uses and that are not public."""
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "mrwork":
            public = import_module(node.module or "").__all__
            found += [f"{node.module}.{each.name}" for each in node.names if each.name not in public]
        # What a call returns has methods, which are no names of a module.
        elif isinstance(node, ast.Attribute) and (text := ast.unparse(node)).replace(".", "").isidentifier():
            names = text.split(".")
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
    if path.stem != DRAWN:
        monkeypatch.setattr(Figure, "savefig", lambda *_, **__: None)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(path), run_name="__main__")
    told = capsys.readouterr()
    if ended.value.code == 2 and ("is not installed" in told.err or not DATA.is_dir()):
        pytest.skip(told.err.splitlines()[-1])
    found = json.loads(told.out)
    assert found.pop("departures") == []
    assert ended.value.code == 0
    assert any(table for table in found.values())


def test_a_number_outside_its_limits_is_named(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text(
        "form,row,tolerance,a,b,c\nfull,one,10 %,1.0,2..3,finished\nboth,two,0.1,1.0,..3,\nquick,three,,1,,\n"
    )
    right = {"one": {"a": 1.05, "b": 2.5, "c": "finished"}, "two": {"a": 0.95, "b": -5.0, "c": "anything"}}
    assert departures(tmp_path, "table", right, "full") == []
    wrong = {"one": {"a": 1.2, "b": float("nan"), "c": "diverged"}, "two": {"a": float("nan"), "b": 4.0}}
    named = sorted(each.rpartition(":")[0] for each in departures(tmp_path, "table", wrong, "full"))
    assert named == ["table, one, a", "table, one, b", "table, one, c", "table, two, a", "table, two, b"]
    assert len(departures(tmp_path, "table", {}, "quick")) == 3
