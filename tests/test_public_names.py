"""What a user meets first: names, their types, and results that show themselves on one screen."""

from __future__ import annotations

import ast
import importlib
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import is_dataclass
from inspect import isclass
from pathlib import Path
from types import ModuleType

import measured_data
import pytest

import mrwork as mr
from mrwork.summary import Summarised, Summary

NAMESPACES = (
    "dampers",
    "records",
    "motions",
    "buildings",
    "control",
    "closed_loop",
    "search",
    "uncertainty",
    "report",
)


def public() -> Iterator[tuple[str, object]]:
    """Every public name of the package and its namespaces."""
    for name in mr.__all__:
        value = getattr(mr, name)
        yield name, value
        if isinstance(value, ModuleType) and hasattr(value, "__all__"):
            yield from ((f"{name}.{inner}", getattr(value, inner)) for inner in value.__all__)


def test_every_namespace_is_listed() -> None:
    assert set(NAMESPACES) <= set(dir(mr))
    for name in NAMESPACES:
        assert isinstance(getattr(mr, name), ModuleType)
        assert getattr(mr, name).__all__


def test_every_listed_name_can_be_had() -> None:
    assert len(dict(public())) > 150


def test_import_loads_nothing_heavy() -> None:
    heavy = ("numpy", "jax", "scipy", "matplotlib", "pandas", "xarray")
    check = f"import sys, mrwork; print([m for m in {heavy} if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", check], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


USER_SCRIPT = """
import mrwork as mr

test: mr.DamperTest = mr.synthetic_test("spencer1997")
fit: mr.Fit = mr.identify("normalised_bouc_wen", test, rng=0)
share: float = fit.fit_percent
frame: mr.Building = mr.buildings.building("uts")
noise = mr.uncertainty.noise_model("iid")
law = mr.control.control_law("clipped_optimal")
score: float = mr.closed_loop.STANDARD_GRAVITY
motion: mr.motions.GroundMotion = mr.motions.synthetic_motion
"""


def test_a_users_script_is_typed(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(USER_SCRIPT)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), str(script)],
        capture_output=True,
        text=True,
        env={"PATH": "/usr/bin:/bin", "MYPYPATH": str(Path(mr.__file__).parents[1])},
        cwd=tmp_path,
    )
    # The last line is wrong on purpose: names without types would let it pass.
    assert re.findall(r"script\.py:(\d+): error", done.stdout) == [str(USER_SCRIPT.count("\n"))], done.stdout


def sources() -> list[tuple[str, str]]:
    """Scripts of the studies, and the Python blocks of the README."""
    root = measured_data.ROOT
    scripts = [
        (str(path.relative_to(root)), path.read_text()) for path in sorted(root.glob("studies/**/*.py"))
    ]
    blocks = re.findall(r"```python\n(.*?)```", (root / "README.md").read_text(), flags=re.DOTALL)
    return [*scripts, *((f"README, block {number}", block) for number, block in enumerate(blocks))]


@pytest.mark.parametrize(("place", "source"), sources(), ids=lambda value: value if len(value) < 80 else "")
def test_studies_and_readme_import_no_deeper_than_a_namespace(place: str, source: str) -> None:
    imported = [
        name
        for node in ast.walk(ast.parse(source))
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else []
        )
    ]
    deep = [name for name in imported if (name.startswith("mrwork") and name.count(".") > 1) or "._" in name]
    assert not deep, f"{place} imports {deep}; give the names to a namespace"


def results() -> dict[str, object]:
    """One of each kind of value that can be had quickly."""
    test = mr.synthetic_test("rd1005_1a")
    fit = mr.identify("static_hysteretic", test, rng=0)
    return {
        "test": test,
        "fit": fit,
        "identifiability": mr.identifiability_of(fit, [test]),
        "motion": mr.synthetic_motion(duration=5.0),
        "building": mr.building("uts"),
        "law": mr.ControlLaw(name="passive", gains={"command": [1.0]}),
        "spec": mr.damper("modified_bouc_wen"),
        "prediction": mr.predict(fit, test),
    }


@pytest.fixture(scope="module")
def shown() -> dict[str, object]:
    """Values, once for the module."""
    return results()


@pytest.mark.parametrize(
    "kind", ["test", "fit", "identifiability", "motion", "building", "law", "spec", "prediction"]
)
def test_a_result_shows_itself_on_one_screen(shown: dict[str, object], kind: str) -> None:
    text = repr(shown[kind])
    assert len(text) < 2000
    assert text.count("\n") < 30
    assert all(len(line) <= 100 for line in text.splitlines())
    html = shown[kind]._repr_html_()  # type: ignore[attr-defined]
    assert html.startswith("<div")
    assert "<strong>" in html


def test_a_fit_shows_units_and_standard_errors(shown: dict[str, object]) -> None:
    fit = shown["fit"]
    text = repr(fit)
    for estimate in fit.estimates:  # type: ignore[attr-defined]
        assert f"{estimate.name} " in text
        assert estimate.unit in text


def test_long_tables_and_lines_are_cut() -> None:
    summary = Summary(title="t" * 300, columns=("a", "b"), rows=[(str(k), "1") for k in range(100)])
    assert len(summary.text().splitlines()) < 24
    assert "85 more rows" in summary.text()
    assert "85 more rows" in summary.html()
    assert max(map(len, summary.text().splitlines())) == 100


def test_what_a_notebook_shows_is_escaped() -> None:
    assert "<script>" not in Summary(title="<script>", facts=(("<b>", "<i>"),)).html()


def test_results_do_not_print_their_arrays() -> None:
    arrays = [
        name
        for name, value in public()
        if isclass(value) and is_dataclass(value) and name.rpartition(".")[2] in RESULTS
        if not issubclass(value, Summarised)
    ]
    assert not arrays


RESULTS = {
    "Building",
    "Calibration",
    "Choice",
    "ControlLaw",
    "DamperSpec",
    "DamperTest",
    "Device",
    "Draws",
    "Fit",
    "GroundMotion",
    "Hardware",
    "Plan",
    "Prediction",
    "Profiles",
    "ResponseSpectrum",
    "Responses",
    "SearchResult",
    "Study",
    "StudyResults",
}


def test_no_public_name_is_that_of_a_module() -> None:
    # An import of the module would put it in the place of the name.
    for name in (None, *NAMESPACES, "identification", "study", "twins"):
        namespace = mr if name is None else importlib.import_module(f"mrwork.{name}")
        folder = Path(str(namespace.__file__)).parent
        modules = {path.stem for path in folder.glob("*.py")} | {
            path.name for path in folder.iterdir() if path.is_dir()
        }
        taken = [
            each
            for each in namespace.__all__
            if each in modules and not isinstance(getattr(namespace, each), ModuleType)
        ]
        assert not taken, f"{namespace.__name__}: {taken}"
