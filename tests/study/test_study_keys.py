"""Every key of every table of a study file, given wrongly: named in its line, with what to give, and no other."""

import copy
import math
import random
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest
from refusals import command_refusal, refusal
from tuning_samples import motion

import mrwork as mr
from mrwork.base.hints import Hint, May
from mrwork.base.keys import Key, Table, keys_of, tables, toml_text
from mrwork.base.places import KeyPath
from mrwork.closed_loop.evaluation import Scales
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.laws.weights import WeightWishes
from mrwork.errors import MistakesError, MrworkError, SettingError
from mrwork.study import read_study
from mrwork.study.reading import parse
from mrwork.study.schema import StudyTable, schema_text
from mrwork.tuning.space import tuning_objective

Document = dict[str, Any]
SOUND: Document = {
    "building": {"masses": [300.0, 200.0], "stiffnesses": [1e6, 8e5], "rayleigh": {"a0": 0.1, "a1": 1e-4}},
    "damper": [{"storey": 1, "preset": "kwok2006", "brace": {"stiffness": 1e7}}],
    "controller": [],
    "motion": [{"synthetic": "kanai_tajimi", "duration": 1.0, "dt": 0.02, "soil": {"damping": 0.6}}],
    "hardware": {"feedback": "observer", "fault": [{"signal": "force", "start": 0.1, "end": 0.3}]},
    "uncertainty": {"realisations": 2, "stiffness": 0.1},
    "places": {"dampers": 2},
    "target": {"code": "en_1998", "a_g": 2.0},
    "report": {},
    "tune": [{"laws": ["lyapunov"], "risk": "cvar"}],
    "baseline": [],
}
# Everything that may be added to a building, a table each.
ADDITIONS: Document = {
    "rayleigh": {"a0": 0.1, "a1": 1e-4},
    "modal_damping": {"ratios": [0.02]},
    "isolation": {"mass": 300.0, "period": 2.0, "ratio": 0.1},
    "lead_rubber": {
        "mass": 300.0,
        "period": 2.0,
        "yield_force": 10.0,
        "yield_displacement": 0.01,
        "ratio": 0.1,
    },
    "viscous": [{"storey": 1, "damping": 10.0}],
    "yielding": [{"storey": 1, "yield_force": 10.0, "yield_displacement": 0.01, "post_yield_ratio": 0.1}],
    "friction": [{"storey": 1, "slip_load": 10.0, "stiffness": 1e5, "sharpness": 2.0}],
    "brace": [{"storey": 1, "stiffness": 1e7, "mass": 1.0, "damping": 1.0}],
    "tuned_mass": [{"floor": 1, "mass": 5.0, "frequency": 2.0, "ratio": 0.1}],
    "liquid_column": [{"floor": 1, "mass": 5.0, "frequency": 0.5, "width_ratio": 0.5, "head_loss": 1.0}],
    "storeys_that_yield": {"yield_drift": 0.01, "post_yield_ratio": 0.1, "sharpness": 2.0},
}


def essential(**more: Any) -> Document:
    """The sound study with what every study has, and these tables."""
    return {**{name: SOUND[name] for name in ("building", "damper", "controller", "motion")}, **more}


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
    "[controller.process]": (
        with_controller({"process": {"program": ["./controller"]}}),
        ("controller", 0, "process"),
    ),
    "[[baseline]]": ({**SOUND, "baseline": [{"label": "b", "building": {"name": "b"}}]}, ("baseline", 0)),
}


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


def documents() -> Iterator[tuple[Document, KeyPath, Table]]:
    """Every table that a study file may have: a document with it, its place, and its declaration."""
    for heading, kind in tables(StudyTable):
        _, *inner = heading.strip("[]").split(".")
        if heading in TABLES:
            yield (*TABLES[heading], kind)
        elif inner and inner[0] in ADDITIONS:
            building = {"masses": [300.0, 200.0], "stiffnesses": [1e6, 8e5], inner[0]: ADDITIONS[inner[0]]}
            several = isinstance(ADDITIONS[inner[0]], list)
            yield essential(building=building), ("building", inner[0], *((0,) if several else ())), kind
        else:
            place = place_of(heading)
            yield essential(**{str(place[0]): SOUND[str(place[0])]}), place, kind
    for law, kind in SETTINGS.items():
        yield with_controller({"law": law, "settings": {}}), ("controller", 0, "settings"), kind
    wishes = {"law": "clipped_optimal", "settings": {"designed": {"budget": 1e3}}}
    yield with_controller(wishes), ("controller", 0, "settings", "designed"), WeightWishes


TABLES_OF_A_STUDY = pytest.mark.parametrize(
    ("document", "place", "kind"),
    [
        pytest.param(*each, id=".".join(map(str, (*each[1], getattr(each[2], "__name__", "")))))
        for each in documents()
    ],
)

LISTS = ("fixed", "items")


def members(node: Hint) -> tuple[Hint, ...]:
    """The kinds of which a value of a key may be."""
    return node.parts if node.form == "either" else (node,)


def numeric(node: Hint) -> type | None:
    """Kind of the number that a key takes, alone or in an array; none where it takes no number."""
    inner = [one for each in members(node) for one in (each, *members(each), *each.parts)]
    kinds = [float if each.form == "array" else each.kind for each in inner]
    return float if float in kinds else int if int in kinds and bool not in kinds else None


def wrong_values(entry: Key) -> Iterator[Any]:
    """Of other kinds, then numbers out of range and in another unit."""
    node, says = entry.node, entry.says
    kinds = [each.kind for each in members(node)]
    notes = {note for each in (node, *node.parts) for note in each.notes}
    yield 3 if bool in kinds else True
    yield [[True]] if any(each.form in ("record", "by_name") for each in members(node)) else {}
    if any(each.form in LISTS and each.parts[0].form in LISTS for each in members(node)):
        yield [[math.nan]]
    if (kind := numeric(node)) is not None and not any(each.form == "record" for each in members(node)):
        wrong: list[Any] = [*numbers_out_of_range(entry, kind, notes)]
        if says.unit and str not in kinds and not says.matrix:
            wrong.append("2.5 kN" if says.unit != "N" else "2.5 mm")
        yield from wrong if kind in kinds else ([each] for each in wrong)


def numbers_out_of_range(entry: Key, kind: type, notes: set[Any]) -> Iterator[float]:
    within = entry.within
    if math.isfinite(within.least):
        yield within.least - 1
    if math.isfinite(within.above):
        yield within.above if kind is float else int(within.above)
        if kind is float and within.above == 0.0:
            yield 1e-200
    if math.isfinite(within.most):
        yield within.most + 1
    if math.isfinite(within.below):
        yield within.below
    if kind is int:
        yield from (2**63, -(2**63) - 1)
    else:
        if May.BE_NAN not in notes:
            yield math.nan
        if May.BE_INFINITE not in notes:
            yield from (math.inf, -math.inf, 1e101, -1e101)


def with_values(document: Document, place: KeyPath, given: Mapping[str, Any]) -> Document:
    changed = copy.deepcopy(document)
    table: Any = changed
    for name in place:
        table = table[name]
    table |= given
    return changed


def mistakes_of(document: Document, folder: Path) -> tuple[Sequence[MrworkError], dict[KeyPath, int]]:
    """What a study is refused with, and the line of each key; none where it is read."""
    path, text, told = folder / "study.toml", toml_text(document), tuple[MrworkError, ...]()
    (folder / "law.py").write_text("def command(sample, memory):\n    return [0.0]\n")
    path.write_text(text)
    try:
        study = read_study(path)
        for table in study.tunes:
            tuning_objective(table, "A", Scales.of(study.building))
    except SettingError as error:
        told = error.mistakes if isinstance(error, MistakesError) else (error,)
    assert all(each.document == str(path) and str(each).isprintable() for each in told), told
    return told, parse(text, "")[1]


REMEDY = re.compile(r"; (give|choose|leave|it has|its unit)|, did you mean")


@TABLES_OF_A_STUDY
def test_every_wrong_key_is_named_in_its_line_with_what_to_give(
    document: Document, place: KeyPath, kind: Table, tmp_path: Path
) -> None:
    wrong = {entry.name_in_file: [*wrong_values(entry)] for entry in keys_of(kind)}
    for turn in range(max(map(len, wrong.values()), default=1)):
        given = {name: values[turn] for name, values in wrong.items() if turn < len(values)}
        given |= {"surplus_qzx": 1} if turn == 0 else {}
        told, lines = mistakes_of(with_values(document, place, given), tmp_path)
        sentences = {each.line: [] for each in told} | {lines[*place, name]: [] for name in given}
        for each in told:
            sentences[each.line].append(str(each))
        for name, value in given.items():
            about = [each for each in sentences[lines[*place, name]] if re.search(rf"\b{name}\b", each)]
            assert about, (name, value, list(map(str, told)))
            assert any(REMEDY.search(each) for each in about), about
        # Nothing that follows from a mistake is told.
        assert len(told) == len(given), list(map(str, told))


def test_mistakes_of_several_tables_are_told_together_and_no_others(tmp_path: Path) -> None:
    rng = random.Random(1)
    inner = [(place_of(heading), kind) for heading, kind in tables(StudyTable) if is_sound(heading)]
    for _ in range(20):
        document, expected = SOUND, []
        for name in rng.sample(sorted({str(place[0]) for place, _ in inner}), 4):
            place, kind = rng.choice([each for each in inner if each[0][0] == name])
            entry = rng.choice(keys_of(kind))
            value = rng.choice([*wrong_values(entry)])
            document = with_values(document, place, {entry.name_in_file: value})
            expected.append((*place, entry.name_in_file))
        told, lines = mistakes_of(document, tmp_path)
        found = [each.line for each in told]
        assert found == sorted(lines[path] for path in expected), (expected, list(map(str, told)))


def is_sound(heading: str) -> bool:
    """Whether the sound study has this table."""
    try:
        return bool(place_of(heading))
    except (IndexError, KeyError):
        return False


# What is printed of the schema, and how it is read.


@pytest.mark.parametrize(("heading", "kind"), list(tables(StudyTable)))
def test_the_printed_schema_has_every_key_that_the_reader_knows(heading: str, kind: Any) -> None:
    block = next(block for block in schema_text().split("\n\n") if block.startswith(heading or "at the top"))
    words = " ".join(block.split())
    for entry in keys_of(kind):
        default = "required" if entry.is_required else ""
        found = re.search(rf" {entry.name_in_file} {default}.*{re.escape(entry.says.words)}", words)
        assert found, entry.name


# Mistakes in every table, of its keys and of what these name.
WRONG = """[building]
masses = ["12t", 2000.0]
stiffnesses = [1e6, "1e3 kg"]
damping_ratio = 0.02
[[damper]]
storey = 1
preset = "kwok2006"
lagg = 3
[[law]]
law = "lqr"
[[motion]]
synthetic = "kanai_tajimi"
duration = -3
[hardware]
sample_time = "1 kg"
delay = true
[report]
histories = "some"
[[tune]]
law = ["clipped_optimal"]
[[baseline]]
building = { rayleigh = { alpha = 0.1 } }
[[damper]]
storey = 1
preset = "kwok2007"
[[controller]]
law = "lqr"
[[controller]]
law = "clipped_optimal"
settings = { drfts = 1.0 }
[[motion]]
file = "absent.AT2"
[[tune]]
laws = ["lyapunof", "clipped"]
criteria = { peak_drft = 1 }
"""
LINES = [3, 4, 8, 9, 10, 13, 15, 16, 18, 20, 21, 22, 25, 27, 30, 32, 34, 34, 35]


def study_in(folder: Path, text: str) -> Path:
    path = folder / "study.toml"
    path.write_text(text)
    return path


def told_of(path: Path) -> list[tuple[int, str]]:
    """Line and sentence of each mistake of a study."""
    with pytest.raises(SettingError) as refusal:
        mr.read_study(path)
    error = refusal.value
    return [(each.line, str(each)) for each in error.mistakes or (error,)]


def test_the_command_lists_them_below_each_other(tmp_path: Path) -> None:
    path = study_in(tmp_path, WRONG)
    for verb in ("respond", "tune"):
        head, *lines = command_refusal(verb, path, match="mistakes").splitlines()
        assert head == f"mrwork: {path} has {len(LINES)} mistakes:"
        assert [line.partition(": ")[0] for line in lines] == [f"  line {line}" for line in LINES]


@pytest.mark.parametrize(
    ("old", "new", "n_mistakes"),
    [
        # What depends on it is not read; it is no mistake of its own.
        ("storey = 1", "store = 1", 1),
        ("[[damper]]", "[[dampr]]", 1),
        ("[building]", "[buildin]", 1),
        ('"uts"', '"utz"', 1),
        ("[[motion]]", "[[earthquake]]", 1),
        ("drifts = 1.0", "drifts = nan", 1),
        ("storey = 1", 'storey = "roof"', 1),
        ("peak_drift = 1", "peak_drft = 1", 1),
        ('laws = ["lyapunov"]', 'laws = ["liapunov", "mpc"]\nobjectives = ["peak", "rms_drift"]', 3),
        # Two in one table.
        ("storey = 1", "storey = 1\nsurplus = 2\nlag = -1", 2),
    ],
)
def test_what_follows_from_a_mistake_is_not_told(old: str, new: str, n_mistakes: int, tmp_path: Path) -> None:
    text = f"""[building]
published = "uts"
[[damper]]
storey = 1
preset = "kwok2006"
[[controller]]
law = "clipped_optimal"
settings = {{ drifts = 1.0, control_weight = 1e-9 }}
[hardware]
delay = "1 ms"
[report]
controllers = ["Clipped-optimal"]
[[tune]]
laws = ["lyapunov"]
criteria = {{ peak_drift = 1 }}
{motion("A", 1)}"""
    assert old in text
    mr.read_study(study_in(tmp_path, text))
    found = told_of(study_in(tmp_path, text.replace(old, new, 1)))
    assert len(found) == n_mistakes, found
    here = 1 + text[: text.index(old)].count("\n")
    assert all(here - 1 <= line <= here + 2 for line, _ in found), found


def test_a_building_of_another_file_has_its_lines_behind_that_of_the_study(tmp_path: Path) -> None:
    (tmp_path / "frame.toml").write_text("masses = [1.0]\nstifnesses = [-1.0]\nzeta = 0.02\n")
    path = study_in(tmp_path, '[building]\nfile = "frame.toml"\n[[motion]]\nfile = "absent.AT2"\n')
    error = refusal(
        mr.read_study, path, match=r"line 2: \S*frame.toml, line 3: the building has no key 'zeta'"
    )
    assert isinstance(error, MistakesError)
    assert [each.line for each in error.mistakes] == [2, 2, 4]
