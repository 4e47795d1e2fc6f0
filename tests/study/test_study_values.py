"""A study means the same however its TOML is written; any value is read, or refused in a sentence with its line."""

from __future__ import annotations

import copy
import re
from typing import Any

import hypothesis.strategies as st
import pytest
from examples import examples
from hypothesis import given

from mrwork.base.places import KeyPath
from mrwork.errors import SettingError
from mrwork.study import read_study
from mrwork.study.study import fingerprint_of

Document = dict[str, Any]

POSITIVE = st.floats(0.05, 20.0)
TUNED_MASS = {"tuned_mass": [{"floor": 1, "mass": 5.0, "frequency": 2.0, "ratio": 0.1}]}


@st.composite
def documents(draw: st.DrawFn) -> Document:
    """A valid study without files: a shear building, dampers, laws, synthetic motions, a loop."""
    floors = draw(st.integers(1, 4))

    def column(low: float, high: float) -> list[float]:
        return draw(st.lists(st.floats(low, high), min_size=floors, max_size=floors))

    motions = [
        {
            "synthetic": draw(st.sampled_from(["kanai_tajimi", "clough_penzien"])),
            "name": f"motion {number}",
            "duration": draw(st.floats(0.5, 2.0)),
            "dt": draw(st.sampled_from([0.01, 0.02])),
            "seed": draw(st.integers(0, 99)),
            "pga": draw(POSITIVE | st.lists(POSITIVE, min_size=1, max_size=2, unique=True)),
            "time_scale": draw(st.floats(0.2, 2.0)),
        }
        for number in range(draw(st.integers(1, 2)))
    ]
    return {
        "title": draw(st.text(max_size=8)),
        "building": {
            "masses": column(50.0, 500.0),
            "stiffnesses": column(1e5, 1e7),
            "rayleigh": {"a0": draw(st.floats(0.0, 1.0)), "a1": draw(st.floats(0.0, 1e-3))},
        },
        "damper": [
            {
                "storey": draw(st.integers(1, floors)),
                "preset": "kwok2006",
                "differential": draw(st.booleans()),
                "count": draw(st.integers(1, 3)),
                "largest_command": draw(st.floats(0.1, 1.5)),
                "brace": {"stiffness": draw(st.floats(1e6, 1e8)), "damping": draw(st.floats(0.0, 1e3))},
            }
        ],
        "controller": [
            {"law": "passive", "label": f"law {number}", "settings": {"command": draw(st.floats(0.0, 0.1))}}
            for number in range(draw(st.integers(0, 2)))
        ],
        "baseline": [{"label": "mass", "building": TUNED_MASS}] * draw(st.integers(0, 1)),
        "motion": motions,
        "report": {"histories": draw(st.sampled_from(["detailed", "all", "none"]))},
        "uncertainty": {
            "realisations": draw(st.integers(1, 3)),
            "stiffness": 0.1,
            "seed": draw(st.integers(0, 9)),
        },
        "tune": [
            {
                "laws": ["lyapunov"],
                "free": {"largest_command": [0.05, 0.1]},
                "criteria": {"peak_drift": draw(st.floats(0.1, 2.0))},
                "constraints": {"peak_stroke": "20 mm"},
                "risk": "cvar",
                "tail": draw(st.floats(0.1, 1.0)),
                "budget": draw(st.integers(5, 99)),
            }
        ],
        "hardware": {
            "sample_time": draw(st.sampled_from([0.001, 0.002, 0.004])),
            "step": 0.001,
            "feedback": "observer",
            "acceleration_noise": draw(st.floats(0.0, 1.0)),
            "deformation_noise": draw(st.floats(0.0, 1e-3)),
            "fault": [{"signal": "acceleration", "start": 0.1, "end": draw(st.floats(0.2, 1.0))}],
        },
    }


def in_toml(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{name} = {in_toml(each)}" for name, each in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(in_toml, value)) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    return in_quotes(value) if isinstance(value, str) else repr(value)


def in_quotes(text: str) -> str:
    """Every character that is not a plain one as an escape."""
    plain = (each if each.isascii() and each.isprintable() and each not in '"\\' else None for each in text)
    return '"' + "".join(each or f"\\U{ord(raw):08X}" for each, raw in zip(plain, text, strict=True)) + '"'


def with_headers(document: Document) -> str:
    """Tables below headers, what is in them on a line each."""
    lines = [f"{name} = {in_toml(value)}" for name, value in document.items() if not is_table(value)]
    for name, value in document.items():
        if is_table(value):
            for each in value if isinstance(value, list) else [value]:
                lines.append(f"\n[[{name}]]" if isinstance(value, list) else f"\n[{name}]")
                lines += [f"{key} = {in_toml(inner)}" for key, inner in each.items()]
    return "\n".join(lines) + "\n"


def is_table(value: Any) -> bool:
    return isinstance(value, dict) or (
        isinstance(value, list) and bool(value) and all(isinstance(each, dict) for each in value)
    )


def dotted(document: Document, draw: Any) -> str:
    """Dotted keys and arrays of inline tables, in any order, with remarks and ends of lines of another system."""
    pairs: list[tuple[str, Any]] = []

    def walk(prefix: str, value: Any) -> None:
        if isinstance(value, dict) and value:
            for name, inner in value.items():
                walk(f"{prefix}.{name}" if prefix else name, inner)
        else:
            pairs.append((prefix, value))

    walk("", document)
    lines = [f"{name} = {in_toml(value)} # {name}" for name, value in draw(st.permutations(pairs))]
    return "# a study\r\n" + "\r\n\r\n".join(lines)


@examples(25)
@given(data=st.data(), document=documents())
def test_a_study_means_the_same_however_it_is_written(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, document: Document
) -> None:
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_bytes(with_headers(document).encode())
    first = read_study(path)
    assert first.title == (document["title"] or first.building.name)
    path.write_bytes(dotted(with_units(document, data.draw), data.draw).encode())
    assert fingerprint_of(read_study(path)) == fingerprint_of(first)


UNITS = {"sample_time": "s", "step": "s", "deformation_noise": "m", "acceleration_noise": "m/s2"}


def with_units(document: Document, draw: Any) -> Document:
    """The document with numbers as texts in the unit of SI, which changes no bit."""
    changed = copy.deepcopy(document)
    for key, unit in UNITS.items():
        if draw(st.booleans()):
            changed["hardware"][key] = f"{changed['hardware'][key]!r} {unit}"
    return changed


ODD = [
    *(float("nan"), float("inf"), -float("inf"), -1, 0, -0.0, 1e308, -1e308, 1e-320, 2**62, -(2**62), 10**30),
    *("", "x", "1 kg", "1 s", "nan s", "1e400 s", "../..", "\n\x1b[31m", "\x00", True, False),
    *([], [[]], [1], [1, "x"], ["x"], [float("nan")], {}, {"x": 1}, [{}], [{"x": 1}]),
]


def places(value: Any, path: KeyPath = ()) -> list[KeyPath]:
    """Every value of a document, tables too."""
    found = [path] if path else []
    entries = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    for key, each in entries:
        found += places(each, (*path, key))
    return found


@examples(150)
@given(data=st.data(), document=documents())
def test_any_value_is_read_or_refused_in_a_sentence_with_its_line(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, document: Document
) -> None:
    path = tmp_path_factory.mktemp("study") / "study.toml"
    # Its parts are shared with other examples.
    changed = copy.deepcopy(document)
    *outer, last = data.draw(st.sampled_from(places(changed)))
    table: Any = changed
    for key in outer:
        table = table[key]
    match data.draw(st.sampled_from(["value", "value", "value", "gone", "name", "added"])):
        case "value":
            table[last] = data.draw(st.sampled_from(ODD))
        case "gone":
            del table[last]
        case "name" if isinstance(table, dict):
            table[f"{last}_"] = table.pop(last)
        case _:
            if isinstance(table, dict):
                table["surplus"] = 1
    path.write_bytes(with_headers(changed).encode())
    try:
        read_study(path)
    except SettingError as refusal:
        sentence = str(refusal)
        ok = re.match(re.escape(str(path)) + r"(, line \d+: |: the study has no |: two )", sentence)
        if not ok or "\n" in sentence:
            pytest.fail(sentence)
