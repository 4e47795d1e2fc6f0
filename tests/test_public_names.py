"""What a user meets first: names, their types, and results that show themselves on one screen."""

import ast
import importlib
import re
import sys
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from inspect import isclass
from operator import attrgetter
from pathlib import Path
from types import ModuleType

import measured_data
import numpy as np
import pytest
from command_line import ran

import mrwork as mr
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table

NAMESPACES = (
    "dampers",
    "records",
    "motions",
    "buildings",
    "control",
    "closed_loop",
    "search",
    "identification",
    "jax",
    "uncertainty",
    "study",
    "tuning",
    "report",
    "plots",
    "twins",
)
# Namespaces within a namespace.
INNER_NAMESPACES = ("dampers.design",)
# A module of one public purpose.
OWN_PATHS = ("errors",)

# Dataclasses that are no results: their few numbers fit on a line, so they keep the `repr` that can be evaluated.
SMALL_VALUES = {
    "Box",
    "Candidate",
    "CloughPenzien",
    "CurrentLaws",
    "Envelope",
    "Fault",
    "Remark",
    "GammaEnvelope",
    "Judgement",
    "KanaiTajimi",
    "Likeness",
    "Limits",
    "Lognormal",
    "MotionOfStudy",
    "Normal",
    "Observation",
    "OpenSeesBoucWen",
    "Progress",
    "ReferencePeaks",
    "RmsLimits",
    "SemiActiveCondition",
    "ShakeTable",
    "Uniform",
    "Workers",
}
# Settings (also all classes called so), tables of what exists, and values that are functions.
SETTINGS = {
    *("ControlLawSpec", "DifferentialEvolution", "EfficientGA", "EliteRule", "Race"),
    *("ParticleSwarm", "StandardGA", "StopRules", "TuneTable"),
}


def public(namespace: ModuleType = mr, place: str = "") -> Iterator[tuple[str, object]]:
    """Every public name of the package and its namespaces."""
    for name in namespace.__all__:
        value = getattr(namespace, name)
        yield f"{place}{name}", value
        if isinstance(value, ModuleType) and hasattr(value, "__all__"):
            yield from public(value, f"{place}{name}.")


def in_stubs() -> dict[str, object]:
    """Every name that a stub lists."""
    found = {}
    for place in ("", *(f"{name}." for name in (*NAMESPACES, *INNER_NAMESPACES))):
        namespace = attrgetter(place[:-1])(mr) if place else mr
        stub = ast.parse(Path(str(namespace.__file__)).with_suffix(".pyi").read_text())
        for node in ast.walk(stub):
            if isinstance(node, ast.ImportFrom):
                found.update({f"{place}{each.name}": getattr(namespace, each.name) for each in node.names})
    return found


def test_every_listed_name_can_be_had() -> None:
    assert {name for name in dict(public()) if not name.startswith("errors.")} == set(in_stubs())
    assert set(NAMESPACES) <= set(dir(mr))
    assert all(issubclass(getattr(mr.errors, name), BaseException) for name in dir(mr.errors))


USER_SCRIPT = """
import mrwork as mr

test: mr.DamperTest = mr.synthetic_test("spencer1997")
fit: mr.Fit = mr.identify("normalised_bouc_wen", test, rng=0)
share: float = fit.fit_percent
frame: mr.Building = mr.buildings.building("uts")
noise = mr.uncertainty.noise_model("iid")
law = mr.control.control_law("clipped_optimal")
score: float = mr.closed_loop.STANDARD_GRAVITY
axes = fit.plot.loops(over="velocity", legend=False)
axes.no_such_thing
mr.predict(fit, test).plot.residuals().no_such_thing
fit.plot.loops(oven="velocity")
motion: mr.motions.GroundMotion = mr.motions.synthetic_motion
"""


# Scripts as users write them, which `users/test_scripts.py` runs.
USERS = Path(__file__).parent / "users"

# As of an installed package: what it declares is read, its own functions and what they use is not checked once more.
MYPY = """[mypy]
strict = True
follow_imports = silent
[mypy-arviz_base.*,arviz_stats.*,clarabel.*,cvxpy.*,equinox.*,h5py.*,jax.*,jaxlib.*,jaxtyping.*,jinja2.*,lineax.*,\
matplotlib.*,numpyro.*,optimistix.*,pandas.*,pyarrow.*,pymoo.*,scipy.*,xarray.*]
follow_imports = skip
"""


@pytest.mark.long
def test_users_scripts_are_typed(tmp_path: Path) -> None:
    (tmp_path / "script.py").write_text(USER_SCRIPT)
    users = [path for path in USERS.glob("*.py") if not path.name.startswith("test_")]
    assert users
    for path in users:
        (tmp_path / path.name).write_text(path.read_text())
    (tmp_path / "written.py").write_text("\n".join(["import mrwork as mr", *written_names()]))
    (tmp_path / "mypy.ini").write_text(MYPY)
    done = ran(
        *(sys.executable, "-m", "mypy", "--config-file=mypy.ini", "--cache-dir=cache"),
        *("script.py", "written.py"),
        *(path.name for path in users),
        env={"PATH": "/usr/bin:/bin", "MYPYPATH": str(Path(mr.__file__).parents[1])},
        cwd=tmp_path,
    )
    # Four lines of the first script are wrong on purpose: names without types would let them pass.
    wrong = re.findall(r"(\w+)\.py:(\d+): error", done.stdout)
    lines = USER_SCRIPT.splitlines()
    on_purpose = [n for n, line in enumerate(lines, 1) if re.search("no_such|oven|motion:", line)]
    assert wrong == [("script", str(number)) for number in on_purpose], done.stdout


def written_names() -> list[str]:
    """Every `mr.a.b` of the README, of the pages by hand and of the docstrings."""
    root = measured_data.ROOT
    pages = [root / "README.md", *root.glob("docs/**/*.md"), *root.glob("python/mrwork/**/*.py")]
    found = {
        name
        for path in pages
        for name in re.findall(r"(?<![\w./])mr(?:\.[A-Za-z_]\w*)+", path.read_text(encoding="utf-8"))
    }
    return sorted(found)


RESOLVED = """
import sys
from types import ModuleType
import mrwork as mr

for name in sys.stdin.read().split():
    value = mr
    for part in name.split(".")[1:]:
        # By the stub alone: what another name has loaded is an attribute of its package, too.
        value = value.__getattr__(part) if isinstance(value, ModuleType) else getattr(value, part)
"""


@pytest.mark.long
def test_every_name_that_the_docs_write_works_alone() -> None:
    names = written_names()
    assert {"mr.tuning.judge", "mr.jax.force", "mr.Journal"} <= set(names)
    done = ran(sys.executable, "-c", RESOLVED, input="\n".join(names))
    assert done.stderr == ""


def sources() -> list[tuple[str, str]]:
    """Scripts of the studies, and the Python blocks of the README."""
    root = measured_data.ROOT
    scripts = [
        (str(path.relative_to(root)), path.read_text()) for path in sorted(root.glob("studies/**/*.py"))
    ]
    blocks = re.findall(r"```python\n(.*?)```", (root / "README.md").read_text(), flags=re.DOTALL)
    return [*scripts, *((f"README, block {number}", block) for number, block in enumerate(blocks))]


def imported_from(node: ast.ImportFrom) -> list[str]:
    """Modules of the package that a `from` import reaches."""
    if node.module != "mrwork":
        return [node.module or ""]
    return [f"mrwork.{alias.name}" for alias in node.names if alias.name in NAMESPACES]


def test_studies_and_readme_import_no_deeper_than_a_namespace() -> None:
    allowed = {"mrwork", *(f"mrwork.{name}" for name in (*NAMESPACES, *OWN_PATHS))}
    for place, source in sources():
        imported: list[str] = []
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.ImportFrom):
                imported += imported_from(node)
            elif isinstance(node, ast.Import):
                imported += [alias.name for alias in node.names]
        deep = [name for name in imported if name.partition(".")[0] == "mrwork" and name not in allowed]
        assert not deep, f"{place} imports {deep}; give the names to a namespace"


def results() -> dict[str, object]:
    """One of each kind of value that can be had quickly."""
    test = mr.synthetic_test("rd1005_1a")
    fit = mr.identify("static_hysteretic", test, rng=0)
    frame = mr.building("uts")
    plant = mr.control.plant_of(frame, frame.storeys[0])
    regulator = mr.control.regulator_of_state(plant, plant.energy, 1e-12)
    profiles = mr.profile(fit, [test], parameters=["c"])
    return {
        "test": test,
        "fit": fit,
        "motion": mr.synthetic_motion(duration=5.0),
        "building": mr.building("uts"),
        "law": mr.ControlLaw(name="passive", gains={"command": [1.0]}),
        "spec": mr.damper("modified_bouc_wen"),
        "prediction": mr.predict(fit, test),
        "trace": fit.trace,
        "quality": fit.quality[0],
        "loading": mr.Loading(dt=1e-3, displacement=np.zeros(20_000), velocity=np.zeros(20_000)),
        "preset": mr.damper("modified_bouc_wen").preset("dyke1996"),
        "design": mr.dampers.design.twenty_ton_damper(),
        "fluid": mr.dampers.design.fluid("MRF-132DG"),
        "plant": plant,
        "regulator": regulator,
        "surface": mr.control.optimal_surface(plant),
        "certificate": mr.control.design_weights(
            frame, frame.storeys[:1], limits={"rms_drift": 2e-3}, budget=500.0
        ).certificate,
        "lyapunov": mr.control.lyapunov_function(plant),
        "profile": profiles.profiles[0],
    }


@pytest.fixture(scope="module")
def shown() -> dict[str, object]:
    """Values, once for the module."""
    return results()


def fits_on_a_screen(value: object) -> bool:
    """Whether the text is short, and there is the same for a notebook."""
    text, html = repr(value), value._repr_html_()  # type: ignore[attr-defined] # what a user has is typed as `object` here
    lines = text.splitlines()
    short = len(text) < 2000 and len(lines) <= 30 and max(map(len, lines)) <= 100
    return short and html.startswith("<div") and "<strong>" in html


def test_every_result_shows_itself_on_one_screen(shown: dict[str, object]) -> None:
    assert [kind for kind, value in shown.items() if not fits_on_a_screen(value)] == []


def test_a_list_of_fields_fits_on_a_screen_whatever_they_hold() -> None:
    """Of all classes that leave their summary to `Summarised`: values of 10 000 numbers, and long collections."""
    in_stubs()  # loads the modules of all of them
    listed = [kind for kind in summarised() if kind._summary is Summarised._summary]
    assert len(listed) > 20
    many = np.arange(1e4).reshape(10, 1000)
    for content in (many, tuple(many[0, :200]), dict.fromkeys(map(str, range(100)), many), "text\n" * 1000):
        for kind in listed:
            value = object.__new__(kind)
            for field in fields(kind):
                object.__setattr__(value, field.name, content)
            assert fits_on_a_screen(value), kind


def test_a_listed_field_has_its_unit(shown: dict[str, object]) -> None:
    text = repr(shown["loading"])
    assert re.search(r"dt +0.001 s\n", text)
    assert re.search(r"velocity +shape 20000, from 0 to 0 m/s\n", text)
    assert re.search(r"poles .* 1/s\n", repr(shown["regulator"]))


def test_long_tables_and_lines_are_cut() -> None:
    summary = Summary(
        title="t" * 300, tables=[Table(columns=("a", "b"), rows=[(str(k), "1") for k in range(100)])]
    )
    assert len(summary.text().splitlines()) < 24
    assert "85 more rows" in summary.text()
    assert "85 more rows" in summary.html()
    assert max(map(len, summary.text().splitlines())) == 100


def test_what_a_notebook_shows_is_escaped() -> None:
    assert "<script>" not in Summary(title="<script>", facts=(("<b>", "<i>"),)).html()


def summarised(kind: type = Summarised) -> Iterator[type]:
    """Every class whose values show themselves as a summary, whether a stub lists it or only a result holds it."""
    for each in kind.__subclasses__():
        yield each
        yield from summarised(each)


def public_dataclasses() -> dict[str, type]:
    """All of them, of both tiers, by name."""
    return {
        name.rpartition(".")[2]: value
        for name, value in in_stubs().items()
        if isclass(value) and is_dataclass(value) and name.rpartition(".")[2] not in ("Summary",)
    }


def test_every_public_dataclass_is_summarised_or_a_small_value() -> None:
    found = public_dataclasses()
    whole = {name for name, value in found.items() if not issubclass(value, Summarised)}
    whole = {name for name in whole if not name.endswith("Settings")}
    assert whole - SMALL_VALUES - SETTINGS == set()
    assert whole >= SMALL_VALUES | SETTINGS, "names that no longer stand for such a class"
    for name in whole:
        arrays = [each.name for each in fields(found[name]) if re.search(r"Floats|Array", str(each.type))]
        assert not arrays or name in SETTINGS, f"{name} prints {arrays}"


def test_no_public_name_is_that_of_a_module() -> None:
    # An import of the module would put it in the place of the name, unless the module is the value itself.
    for name in (None, *NAMESPACES, *INNER_NAMESPACES):
        namespace = mr if name is None else importlib.import_module(f"mrwork.{name}")
        folder = Path(str(namespace.__file__)).parent
        modules = {path.stem for path in folder.glob("*.py")} | {
            path.name for path in folder.iterdir() if path.is_dir()
        }
        taken = [
            each
            for each in namespace.__all__
            if each in modules
            and importlib.import_module(f"{namespace.__name__}.{each}") is not getattr(namespace, each)
        ]
        assert not taken, f"{namespace.__name__}: {taken}"
