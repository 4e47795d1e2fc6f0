"""Heavy packages are imported in their modules only, JAX by no verb; no number depends on what was imported before."""

import ast
import json
import sys
from collections.abc import Container
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest
from command_line import ran
from study_texts import study_text

import mrwork

# The modules that may import a package, also within a function; all others reach it through them. Optional packages
# that are imported by name (`importlib`) are not listed.
HOMES = {
    ("jax", "equinox", "optimistix"): (
        "twins",
        "identification.minimise.by_optimistix",
        "identification.traced_objective",
        "identification.traced_twin",
        "jax.traced_loop",
        "tuning.traced_score",
        "uncertainty.traced_likelihood",
    ),
    ("emcee",): ("uncertainty.posterior",),
    ("xarray", "pandas"): ("base.labelled", "plots.drawn", "uncertainty.posterior"),
    ("h5py",): ("store.members", "store.netcdf"),
    ("nptdms",): ("files.open_table",),
    ("python_calamine",): ("store.members",),
    ("matplotlib",): ("plots", "report"),
    ("fontTools", "jinja2"): ("report",),
    ("ipywidgets",): ("plots.explore",),
    ("cvxpy", "clarabel"): ("control.weights",),
    ("shtab",): ("cli.completions",),
}

TESTS = """
import pickle, sys
import numpy as np
import mrwork as mr
from mrwork.records.window import cut
test, other = (cut(mr.synthetic_test(name), every=8) for name in ("spencer1997", "spencer1997_fast"))
"""
# A Spencer form, so that parameters are converted and their Jacobians taken.
IDENTIFY = f"""{TESTS}
held = {{"k0": (2500.0, 2500.0), "x0": (0.038, 0.038), "n": (2.0, 2.0)}}
fit = mr.identify("bouc_wen", test, bounds=held)
"""
JAX = ("jax", "equinox", "optimistix", "numpyro")
# Steps of one process, one after the other, and the packages that each must not load.
STEPS = {
    "an identification of a plain model": ("mr.identify('bingham', test)", ("scipy", *JAX)),
    "identify": (IDENTIFY.removeprefix(TESTS), JAX),
    "profile": ("mr.profile(fit, [test], parameters=['k_w'])", JAX),
    "plan": (
        "from mrwork.uncertainty.candidate_tests import Candidate\n"
        "mr.plan(fit, [test], [Candidate(amplitude=0.01, frequency=each) for each in (1.0, 2.0)])",
        JAX,
    ),
    "sample": ("mr.sample(fit, test, most_steps=20)", JAX),
    "predict and calibrate": ("mr.calibrate([mr.predict(fit, other)], held_out='')", JAX),
    "choose": ("mr.choose_model([test, other], models=['bingham', 'viscous_dahl'])", JAX),
    "everything of a study but the design of weights": (
        "mr.control.design_weights, mr.control.RegulatorSettings(control_weight=1.0)\n"
        "mr.read_study(sys.argv[2])",
        ("cvxpy", "clarabel", *JAX),
    ),
}
REPORTING = f"""{TESTS}
import json
loaded = {{}}
for name, (code, unwanted) in json.loads(sys.argv[1]).items():
    exec(code)
    # From 1.3 on, arviz-base puts stubs into `sys.modules`; SciPy loads one when it asks whether an array is of JAX.
    arviz = getattr(sys.modules.get("arviz_base"), "__version__", "0")
    stubs = ("jax", "numpyro") if tuple(map(int, arviz.split(".")[:2])) >= (1, 3) else ()
    # A stub that was not used has a type of its own.
    found = [each for each in unwanted if type(sys.modules.get(each)) is type(sys)]
    loaded[name] = [each for each in found if each not in stubs]
print(json.dumps(loaded))
"""


@cache
def imports_of(file: Path) -> set[str]:
    """First names of all packages that a module imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.Import):
            names.update(alias.name.partition(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names.add(node.module.partition(".")[0])
    return names


@pytest.mark.parametrize(("packages", "homes"), HOMES.items(), ids=lambda value: value[0])
def test_heavy_packages_are_imported_in_their_modules_only(
    packages: tuple[str, ...], homes: tuple[str, ...]
) -> None:
    root = Path(mrwork.__file__).parent
    importers = {
        ".".join(file.relative_to(root).with_suffix("").parts)
        for file in root.rglob("*.py")
        if imports_of(file) & set(packages)
    }
    assert importers
    assert not [name for name in importers if not any(f"{name}.".startswith(f"{home}.") for home in homes)]


def in_fresh_process(code: str, *arguments: object) -> str:
    """What `code` prints; it has to end well."""
    run = ran(sys.executable, "-c", code, *arguments)
    assert run.returncode == 0, run.stderr
    return run.stdout


@pytest.fixture(scope="module")
def loaded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, list[str]]:
    """Packages that each of the steps, or one before it, has loaded and must not load."""
    study = tmp_path_factory.mktemp("imports") / "study.toml"
    study.write_text(study_text("drifts = 1.0\ncontrol_weight = 1e-13"))
    told: dict[str, list[str]] = json.loads(in_fresh_process(REPORTING, json.dumps(STEPS), study))
    return told


@pytest.mark.parametrize("step", STEPS)
def test_no_heavy_package_is_loaded_where_it_is_not_needed(step: str, loaded: dict[str, list[str]]) -> None:
    assert not loaded[step]


@pytest.mark.long
def test_standard_errors_do_not_depend_on_what_was_imported_before() -> None:
    asked = "print(fit.estimates, fit.directions)"
    plain = in_fresh_process(IDENTIFY + asked)
    assert "nan" not in plain
    assert in_fresh_process("import jax" + IDENTIFY + asked) == plain
    assert (
        in_fresh_process("import jax; jax.config.update('jax_enable_x64', True)" + IDENTIFY + asked) == plain
    )


ROOT = Path(mrwork.__file__).parent


@cache
def modules() -> dict[str, ast.Module]:
    """Every module of the package by its name."""
    return {
        ".".join(("mrwork", *file.relative_to(ROOT).with_suffix("").parts)): ast.parse(file.read_text())
        for file in ROOT.rglob("*.py")
    }


def imported(tree: ast.Module, known: Container[str]) -> set[str]:
    """Modules that a module imports, at its top, within a function, or for its annotations."""
    names = {
        name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
        for name in (f"{node.module}.{alias.name}", node.module)
    }
    return {name for name in names if name in known}


@pytest.mark.long
def test_modules_import_each_other_in_no_circle() -> None:
    trees = modules()
    order = TopologicalSorter({name: imported(tree, trees) for name, tree in trees.items()})
    assert len(list(order.static_order())) == len(trees)


def test_only_verbs_and_figures_are_loaded_by_name() -> None:
    """The door names the verbs, which stand beside it, and the package the figures of results."""
    by_name = {
        (name.removeprefix("mrwork."), constant.value)
        for name, tree in modules().items()
        for call in ast.walk(tree)
        if isinstance(call, ast.Call) and "import_module" in ast.unparse(call.func)
        for constant in ast.walk(call)
        if isinstance(constant, ast.Constant) and str(constant.value).startswith("mrwork")
    }
    assert by_name == {("cli.door", "mrwork.cli."), ("__init__", "mrwork.plots.accessor")}
