"""Every key of a study file with a number out of its range: refused by file and line, without a name of the code."""

from __future__ import annotations

import copy
import inspect
import math
import pkgutil
import re
from collections.abc import Callable, Iterator
from dataclasses import Field, dataclass, is_dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, get_args, get_type_hints

import pytest
from test_study_values import Document, places, with_headers

import mrwork
from mrwork.base.hints import May
from mrwork.base.keys import keys_of, name_in_file, tables
from mrwork.base.places import KeyPath
from mrwork.buildings.from_file import Addition
from mrwork.control import SETTINGS, WeightWishes
from mrwork.errors import MrworkError
from mrwork.study import read_study
from mrwork.study.reading import parse
from mrwork.study.schema import StudyTable
from mrwork.tuning.space import objective_of

SOUND: Document = {
    "building": {"masses": [300.0, 200.0], "stiffnesses": [1e6, 8e5], "rayleigh": {"a0": 0.1, "a1": 1e-4}},
    "damper": [{"storey": 1, "preset": "kwok2006", "brace": {"stiffness": 1e7}}],
    "controller": [],
    "motion": [{"synthetic": "kanai_tajimi", "duration": 1.0, "dt": 0.02, "soil": {"damping": 0.6}}],
    "hardware": {"feedback": "observer", "fault": [{"signal": "force", "start": 0.1, "end": 0.3}]},
    "uncertainty": {"realisations": 2, "stiffness": 0.1},
    "clairvoyant": {"interval": 0.02},
    "places": {"dampers": 2},
    "target": {"code": "en_1998", "a_g": 2.0},
    "report": {},
    "tune": [{"laws": ["lyapunov"], "risk": "cvar"}],
    "baseline": [],
}


BUILDINGS: list[Document] = [
    {
        "masses": [300.0, 200.0],
        "stiffnesses": [1e6, 8e5],
        "storey_damping": [10.0, 20.0],
        "modal_damping": {"ratios": [0.02]},
        "isolation": {"mass": 300.0, "period": 2.0, "ratio": 0.1},
        "viscous": [{"storey": 1, "damping": 10.0}],
        "yielding": [{"storey": 1, "yield_force": 10.0, "yield_displacement": 0.01, "post_yield_ratio": 0.1}],
        "friction": [{"storey": 1, "slip_load": 10.0, "stiffness": 1e5, "sharpness": 2.0}],
        "brace": [{"storey": 1, "stiffness": 1e7, "mass": 1.0, "damping": 1.0}],
        "tuned_mass": [{"floor": 1, "mass": 5.0, "frequency": 2.0, "ratio": 0.1}],
        "liquid_column": [
            {"floor": 1, "mass": 5.0, "frequency": 0.5, "width_ratio": 0.5, "head_loss": 1.0},
        ],
    },
    {
        "mass": [[300.0, 0.0], [0.0, 200.0]],
        "stiffness": [[2e6, -1e6], [-1e6, 1e6]],
        "damping": [[10.0, 0.0], [0.0, 10.0]],
        "influence": [1.0, 1.0],
        "lead_rubber": {
            "mass": 300.0,
            "period": 2.0,
            "yield_force": 10.0,
            "yield_displacement": 0.01,
            "ratio": 0.1,
        },
        "tuned_mass": [{"floor": 1, "mass_ratio": 0.01, "mode": 1}],
        "liquid_column": [
            {"floor": 1, "mass_ratio": 0.01, "width_ratio": 0.5, "rms_velocity": 0.1, "mode": 1}
        ],
    },
    {
        "masses": [300.0],
        "stiffnesses": [1e6],
        "n_storeys": 2,
        "rayleigh": {"ratios": [0.02, 0.02], "modes": [1, 2]},
        "storeys_that_yield": {"yield_drift": 0.01, "post_yield_ratio": 0.1, "sharpness": 2.0},
    },
]
"""With every addition to a building and each of its forms."""


ESSENTIAL = ("building", "damper", "controller", "motion")


def essential(**tables: Any) -> Document:
    """The sound study with what every study has, and these tables."""
    return {**{name: SOUND[name] for name in ESSENTIAL}, **tables}


def with_controller(table: Document) -> Document:
    """Without the brace, whose stiffness wants small steps: references of a law are simulated at every reading."""
    return essential(controller=[table], damper=[{"storey": 1, "preset": "kwok2006"}])


# Tables that exclude others of the sound study, or that it has not.
TABLES: dict[str, tuple[Document, KeyPath]] = {
    "": (SOUND, ()),
    "[motion.suite]": (essential(motion=[{"suite": {"motions": 8}, "dt": 0.02}]), ("motion", 0, "suite")),
    "[[building.element]]": (
        essential(building={**SOUND["building"], "element": [{"name": "e", "row": [1.0, 0.0]}]}),
        ("building", "element", 0),
    ),
    "[[controller]]": (with_controller({"law": "passive_on"}), ("controller", 0)),
    "[controller.user]": (
        with_controller({"user": {"file": "law.py", "function": "command"}}),
        ("controller", 0, "user"),
    ),
    "[[baseline]]": (
        {**SOUND, "baseline": [{"label": "b", "building": {"name": "b"}}]},
        ("baseline", 0),
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Mistake:
    """A document, the place in it, and the number that is put there."""

    document: Document
    path: KeyPath
    number: float

    def __str__(self) -> str:
        return f"{'.'.join(map(str, self.path))}={self.number:g}"


def place_of(heading: str) -> KeyPath:
    path: list[str | int] = []
    table: Any = SOUND
    for name in heading.strip("[]").split("."):
        path.append(name)
        table = table[name]
        if isinstance(table, list):
            path.append(0)
            table = table[0]
    return tuple(path)


def numbers_out_of_range(entry: Field[Any], kind: type) -> Iterator[float]:
    notes, within, first = entry.metadata, entry.metadata["within"], int(entry.metadata["from_one"])
    if math.isfinite(within.least):
        yield within.least + first - 1
    if math.isfinite(within.above):
        yield within.above if kind is float else int(within.above)
        if kind is float and within.above == 0.0:
            yield 1e-200
    if math.isfinite(within.most):
        yield within.most + first + 1
    if math.isfinite(within.below):
        yield within.below
    if kind is int:
        yield from (2**63, -(2**63) - 1)
    else:
        if May.BE_NAN not in notes["notes"]:
            yield math.nan
        if entry.default != math.inf:
            yield math.inf
        yield from (-math.inf, 1e101, -1e101)


def absurd_numbers(entry: Field[Any], kind: type) -> Iterator[float]:
    """Numbers in the range of a key that hardly any study can mean."""
    yield from (2**62, -(2**62)) if kind is int else (1e99, -1e99, 1e-99, 1e12)


def numeric(hint: Any) -> type | None:
    """Kind of the number that a key takes, alone or in an array; none where it takes no number."""
    inner = (one for each in get_args(hint) for one in get_args(each) if isinstance(one, type))
    kinds = {hint, *get_args(hint), *inner}
    return float if float in kinds else int if int in kinds and bool not in kinds else None


def documents() -> Iterator[tuple[Document, KeyPath, type]]:
    """Every table that a study file may have: a document with it, its place, and its declaration."""
    for heading, kind in tables(StudyTable):
        _, *inner = heading.strip("[]").split(".")
        if heading in TABLES:
            yield (*TABLES[heading], kind)
        elif inner and issubclass(kind, Addition):
            building = next(each for each in BUILDINGS if inner[0] in each)
            several = isinstance(building[inner[0]], list)
            yield {**SOUND, "building": building}, ("building", inner[0], *((0,) if several else ())), kind
        else:
            place = place_of(heading)
            yield essential(**{str(place[0]): SOUND[str(place[0])]}), place, kind
    for law, kind in SETTINGS.items():
        yield with_controller({"law": law, "settings": {}}), ("controller", 0, "settings"), kind
    wishes = {"law": "clipped_optimal", "settings": {"designed": {"budget": 1e3}}}
    yield with_controller(wishes), ("controller", 0, "settings", "designed"), WeightWishes


def mistakes_in(
    document: Document, place: KeyPath, kind: type, numbers: Callable[[Field[Any], type], Iterator[float]]
) -> Iterator[Mistake]:
    hints = get_type_hints(kind)
    for entry in keys_of(kind):
        hint = hints[entry.name]
        if any(is_dataclass(each) for each in (hint, *get_args(hint))) or (found := numeric(hint)) is None:
            continue
        for number in numbers(entry, found):
            yield Mistake(document=document, path=(*place, name_in_file(entry)), number=number)


@cache
def names_of_the_code() -> frozenset[str]:
    """Names of all classes of the package that no one would write in a sentence."""
    found = set()
    for module in pkgutil.walk_packages(mrwork.__path__, "mrwork."):
        if "twins" in module.name or module.name.endswith("__main__"):
            continue
        found |= {
            name
            for name, each in inspect.getmembers(import_module(module.name), inspect.isclass)
            if each.__module__.startswith("mrwork")
        }
    return frozenset(found)


def sentence_on(document: Document, folder: Path) -> str:
    if not (folder / "law.py").is_file():
        (folder / "law.py").write_text("def command(sample, memory):\n    return [0.0]\n")
    (folder / "study.toml").write_text(with_headers(document))
    try:
        study = read_study(folder / "study.toml")
        for table in study.tunes:
            objective_of(table, "A")
    except MrworkError as refusal:
        return str(refusal)
    return ""


def with_mistake(mistake: Mistake) -> Document:
    changed = copy.deepcopy(mistake.document)
    *outer, last = mistake.path
    table: Any = changed
    for name in outer:
        table = table[name]
    table[last] = mistake.number
    return changed


def names_code(sentence: str, folder: Path) -> bool:
    """Whether a sentence names a class, or the argument of a function."""
    words = set(re.findall(r"\w+", sentence.replace(str(folder), "")))
    return bool(words & names_of_the_code()) or bool(re.search(r"` of \w+ (is|has)", sentence))


TABLES_OF_A_STUDY = pytest.mark.parametrize(
    ("document", "place", "kind"),
    [pytest.param(*each, id=f"{'.'.join(map(str, each[1]))} {each[2].__name__}") for each in documents()],
)


@TABLES_OF_A_STUDY
def test_a_number_out_of_range_is_refused_by_its_line(
    document: Document, place: KeyPath, kind: type, tmp_path: Path
) -> None:
    for mistake in mistakes_in(document, place, kind, numbers_out_of_range):
        sentence = sentence_on(with_mistake(mistake), tmp_path)
        line = parse((tmp_path / "study.toml").read_text(), "")[1][mistake.path]
        assert f"line {line}: " in sentence, (str(mistake), sentence)
        assert not names_code(sentence, tmp_path), sentence


@TABLES_OF_A_STUDY
def test_an_absurd_number_is_read_or_refused_by_a_line(
    document: Document, place: KeyPath, kind: type, tmp_path: Path
) -> None:
    wrong = []
    for mistake in mistakes_in(document, place, kind, absurd_numbers):
        sentence = sentence_on(with_mistake(mistake), tmp_path)
        begins = re.match(
            re.escape(str(tmp_path / "study.toml")) + r"(, | has \d+ mistakes:\n  )line \d+: ", sentence
        )
        if sentence and (not begins or names_code(sentence, tmp_path)):
            wrong.append(f"{mistake}: {sentence}")
    assert not wrong, "\n".join(wrong)


def numbers_in(document: Document) -> Iterator[KeyPath]:
    for path in places(document):
        value: Any = document
        for key in path:
            value = value[key]
        if isinstance(value, int | float):
            yield path


@pytest.mark.parametrize("number", [math.nan, math.inf, -1, 1e101, -1e101, 1e99, -1e99, 1e-200, 2**70])
@pytest.mark.parametrize("building", BUILDINGS, ids=["of storeys", "of matrices", "of equal storeys"])
def test_a_number_of_a_building_is_read_or_refused_by_a_line(
    building: Document, number: float, tmp_path: Path
) -> None:
    wrong = []
    for path in numbers_in(building):
        mistake = Mistake(document=essential(building=building), path=("building", *path), number=number)
        sentence = sentence_on(with_mistake(mistake), tmp_path)
        begins = re.match(
            re.escape(str(tmp_path / "study.toml")) + r"(, | has \d+ mistakes:\n  )line \d+: ", sentence
        )
        if sentence and (not begins or names_code(sentence, tmp_path)):
            wrong.append(f"{mistake}: {sentence}")
        if not sentence and not abs(number) <= 1e100:
            wrong.append(f"{mistake}: accepted")
    assert not wrong, "\n".join(wrong)
