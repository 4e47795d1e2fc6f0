"""The line of every key of a TOML document."""

from __future__ import annotations

from typing import Any

import pytest
from examples import examples
from hypothesis import given
from hypothesis import strategies as st

from mrwork.base.places import KeyPath
from mrwork.errors import SettingError
from mrwork.study.reading import parse

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


def test_every_key_of_the_document_has_a_line() -> None:
    document, lines = parse(DOCUMENT, "a.toml")
    assert set(lines) == paths_of(document)


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("title",), 2),
        (("quoted.key",), 3),
        (("building",), 5),
        (("building", "mass", 1), 8),
        (("building", "shape", "form"), 10),
        (("damper", 0), 12),
        (("damper", 0, "parameters", "k 0", "deep"), 18),
        (("damper", 1), 20),
        (("damper", 1, "more", "when"), 23),
        (("damper", 1, "part", 0, "size"), 26),
    ],
)
def test_the_line_is_where_the_key_stands(path: KeyPath, line: int) -> None:
    assert parse(DOCUMENT, "a.toml")[1][path] == line
    assert parse(DOCUMENT.replace("\n", "\r\n"), "a.toml")[1][path] == line


VALUES = st.recursive(
    st.sampled_from(["1", "-2.5", "true", '"a]b"', "'{'", '"""x\ny"""', "inf"]),
    lambda inner: (
        st.lists(inner, max_size=3).map(lambda entries: "[" + ",\n".join(entries) + "]")
        | st.lists(inner, max_size=3).map(
            lambda entries: "{" + ", ".join(f"k{n} = {entry}" for n, entry in enumerate(entries)) + "}"
        )
    ),
    max_leaves=8,
)


@examples(60)
@given(st.lists(VALUES, min_size=1, max_size=6))
def test_a_marker_after_any_values_is_found_on_its_line(values: list[str]) -> None:
    # TOML 1.0 wants an inline table on one line.
    values = [value.replace("\n", " ") if "{" in value else value for value in values]
    text = "".join(f"v{n} = {value}\n" for n, value in enumerate(values))
    text += "marker = 1"
    document, lines = parse(text, "a.toml")
    assert lines[("marker",)] == text.count("\n") + 1
    assert set(lines) == paths_of(document)


def test_what_is_no_toml_is_refused_with_its_line() -> None:
    with pytest.raises(SettingError, match=r"a\.toml is not TOML: .*line 2"):
        parse("a = 1\nb = \n", "a.toml")
