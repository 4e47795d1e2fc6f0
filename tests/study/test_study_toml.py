"""What a study file means, however it is written: its form, its units, and the line of every key."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hypothesis.strategies as st
import numpy as np
import own_dampers
import pytest
from examples import examples
from hypothesis import given
from refusals import refusal
from test_study_keys import SOUND, members
from tuning_samples import study_file

import mrwork as mr
from mrwork.base.documents import given_values
from mrwork.base.hints import Hint
from mrwork.base.keys import Key, Table, keys_of, tables, toml_text, toml_value
from mrwork.base.places import KeyPath, Place
from mrwork.base.units import number_in
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.laws.weights import WeightWishes
from mrwork.errors import SettingError
from mrwork.study import read_study
from mrwork.study.reading import parse
from mrwork.study.schema import StudyTable
from mrwork.study.study import study_fingerprint

Document = dict[str, Any]


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
    lines = [f"{name} = {toml_value(value)} # {name}" for name, value in draw(st.permutations(pairs))]
    return "# a study\r\n" + "\r\n\r\n".join(lines)


@examples(25)
@given(data=st.data(), title=st.text(max_size=8))
def test_a_study_means_the_same_however_it_is_written(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject, title: str
) -> None:
    # Neither takes the time in which the spectra of motions are computed.
    document = {
        "title": title,
        **{name: SOUND[name] for name in SOUND if name not in ("target", "uncertainty")},
    }
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_bytes(toml_text(document).encode())
    first = read_study(path)
    assert first.title == (title or first.building.name)
    path.write_bytes(dotted(with_units(document, data.draw), data.draw).encode())
    assert study_fingerprint(read_study(path)) == study_fingerprint(first)


def with_units(document: Document, draw: Any) -> Document:
    """The document with numbers as texts in the unit of SI, which changes no bit."""
    motion, building = document["motion"][0], document["building"]
    if draw(st.booleans()):
        motion = {**motion, "duration": f"{motion['duration']!r} s", "dt": f"{motion['dt']!r} s"}
    if draw(st.booleans()):
        building = {**building, "masses": [f"{each!r} kg" for each in building["masses"]]}
    return {**document, "motion": [motion], "building": building}


# Units


# A unit of each dimension with a prefix, and its size in SI. A unit that is new to the keys wants its line.
PREFIXED = {
    "s": ("ms", 1e-3),
    "1/s": ("1/ms", 1e3),
    "Hz": ("mHz", 1e-3),
    "rad": ("mrad", 1e-3),
    "rad/s": ("mrad/s", 1e-3),
    "m": ("um", 1e-6),
    "m/s": ("mm/s", 1e-3),
    "m/s2": ("cm/s2", 1e-2),
    "m2/s3": ("cm2/s3", 1e-4),
    "kg": ("t", 1e3),
    "N": ("MN", 1e6),
    "N/m": ("MN/m", 1e6),
    "N s/m": ("kN s/mm", 1e6),
    "1/N2": ("1/kN2", 1e-6),
    "1/m2": ("1/mm2", 1e6),
    "1/J": ("1/kJ", 1e-3),
    "s2/m2": ("s2/mm2", 1e6),
    "s4/m2": ("s4/mm2", 1e6),
    "A": ("mA", 1e-3),
    "A or V": ("mV", 1e-3),
    "A or V or N": ("kN", 1e3),
    "A/s or V/s or N/s": ("kN/s", 1e3),
}


def keys_with_units() -> Iterator[Any]:
    for kind in (*(kind for _, kind in tables(StudyTable)), *dict.fromkeys(SETTINGS.values()), WeightWishes):
        for entry in keys_of(kind):
            if entry.says.unit:
                yield pytest.param(kind, entry, id=f"{getattr(kind, '__name__', '')} {entry.name_in_file}")


def written(node: Hint, text: str) -> Iterator[Any]:
    """A text as a number, as an array and as a matrix, of which the key takes some."""
    kinds = [each.kind for each in members(node)]
    if float in kinds and str not in kinds:
        yield text
    for each in members(node):
        if each.form in ("fixed", "items", "array"):
            yield (
                [[text, text]]
                if any(part.form in ("fixed", "items") for part in each.parts[:1])
                else [text, text]
            )


def read(kind: Table, entry: Key, value: Any) -> Any:
    given = {entry.name_in_file: value}
    (read,) = given_values(kind, given, Place(origin="study.toml", path=("table",))).values()
    return read


@pytest.mark.parametrize(("kind", "entry"), list(keys_with_units()))
def test_every_key_takes_its_number_in_a_prefixed_unit(kind: Table, entry: Key) -> None:
    unit, size = PREFIXED[entry.says.unit]
    for value in written(entry.node, f"2.5 {unit}"):
        assert np.allclose(read(kind, entry, value), 2.5 * size, rtol=1e-15)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        # An exponent without digits is the beginning of a unit.
        ("12e", "whose unit is not known"),
        ("0x1Fm", "whose unit is not known"),
        ("12e3", "is the text"),
        ("1,5m", "give a number"),
        ("nanm", "give a number"),
        ("\u0661\u0662m", "give a number"),
        ("12g", "where a number"),
    ],
)
def test_what_is_no_number_with_a_unit_is_refused(text: str, says: str) -> None:
    found = number_in(text, "m")
    assert isinstance(found, str)
    assert says in found


def test_a_weight_as_text_has_its_unit_and_is_no_name_of_a_file(tmp_path: Path) -> None:
    laws = []
    for weight in ("1e-12", '"1e-6 1/kN2"'):
        table = f'[[controller]]\nlaw = "clipped_optimal"\nsettings = {{ drifts = 1.0, control_weight = {weight} }}\n'
        study = mr.read_study(study_file(tmp_path, tune="", more=table))
        laws.append(study.arrangements[-1].law)
    np.testing.assert_allclose(laws[0].gains["gain"], laws[1].gains["gain"], rtol=1e-9)


# Lines


DOCUMENT = '''# a comment with [brackets] and key = 1
title = "one # two"   # three
"quoted.key" = 'a\\'

[building]
mass = [
  1.0, # first
  2.0,
]
shape.form = "shear"

[[damper]]
storey = 1
text = """
[not a table]
x = "y" \\
"""
parameters = { c0 = [1, 2], "k 0" = { deep = "}" } }

[[damper]]
storey = 2
  [damper.more]
  when = 1979-05-27 07:32:00

[[damper.part]]
size = +1_000.5e-3
'''


def paths_of(value: Any, prefix: KeyPath = ()) -> set[KeyPath]:
    """Every key and array element of a parsed document."""
    entries = (
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    found = {prefix} - {()}
    for key, entry in entries:
        found |= paths_of(entry, (*prefix, key))
    return found


LINES: dict[KeyPath, int] = {
    ("title",): 2,
    ("quoted.key",): 3,
    ("building", "mass", 1): 8,
    ("building", "shape", "form"): 10,
    ("damper", 0, "parameters", "k 0", "deep"): 18,
    ("damper", 1): 20,
    ("damper", 1, "more", "when"): 23,
    ("damper", 1, "part", 0, "size"): 26,
}


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_every_key_has_the_line_where_it_stands(end: str) -> None:
    document, lines = parse(DOCUMENT.replace("\n", end), "a.toml")
    assert set(lines) == paths_of(document)
    assert {path: lines[path] for path in LINES} == LINES


def test_what_is_no_toml_is_refused_with_its_line() -> None:
    with pytest.raises(SettingError, match=r"a\.toml is not TOML: .*line 2"):
        parse("a = 1\nb = \n", "a.toml")


def test_a_damper_of_the_user_with_stated_parameters_stands_in_a_file_that_runs_nothing(
    tmp_path: Path,
) -> None:
    """Its formulas are data; one that was changed is refused with the line of the study."""
    damper = {
        "storey": 1,
        "model": own_dampers.loop,
        "parameters": dict(zip(own_dampers.loop.names, own_dampers.loop.nominal.tolist(), strict=True))
        | {"c": (100.0, 200.0)},
        "largest_command": 2.0,
    }
    study = mr.study_of(
        building=mr.building("uts"),
        dampers=[damper],
        laws=["passive_on"],
        motions=[mr.synthetic_motion(duration=0.5)],
    )
    study.to_toml(tmp_path / "study.toml")
    again = read_study(tmp_path / "study.toml")
    assert again.devices[0].spec == study.devices[0].spec
    (tmp_path / "elsewhere").mkdir()
    again.to_toml(tmp_path / "elsewhere" / "study.toml")
    moved = read_study(tmp_path / "elsewhere" / "study.toml")
    mine, its = (mr.run_study(each, threads=1).quantities.peak_drift for each in (study, moved))
    np.testing.assert_array_equal(mine, its)
    (place,) = tmp_path.rglob("*.json")
    text = place.read_text()
    for damaged, words in (
        (text.replace('"multiply"', '"sine"'), "no operation of a tape is called `sine`"),
        (text[:100], "is no damper model"),
        ("[]", "is no damper model"),
        (text.replace('"my_loop"', '"bouc_wen"', 1), "is the name of a model of the package"),
    ):
        place.write_text(damaged)
        refusal(read_study, tmp_path / "study.toml", match=rf"study\.toml, line \d+: .*{words}")
