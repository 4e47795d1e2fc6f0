"""Characters that a reader cannot see are escapes, in texts and in the sentences of errors and warnings."""

from __future__ import annotations

import sys
import unicodedata

import pytest

from mrwork.errors import MrworkWarning, RecordError, escape_text, escaped_lines

# Controls, formats, private use, halves of characters, ends of lines and of paragraphs.
UNSEEN = {"Cc", "Cf", "Co", "Cs", "Zl", "Zp"}


def test_what_has_no_shape_is_escaped_and_all_else_is_kept() -> None:
    for number in range(sys.maxunicode + 1):
        character = chr(number)
        kind = unicodedata.category(character)
        if kind in UNSEEN:
            assert escape_text(character) != character, hex(number)
        elif kind != "Cn":
            assert escape_text(character) == character, hex(number)
    assert escaped_lines("a\nb\r") == "a\nb\\r"


@pytest.mark.parametrize("kind", [RecordError, MrworkWarning])
def test_a_sentence_is_one_line_whatever_it_quotes(kind: type[Exception]) -> None:
    assert (
        str(kind("rig.csv: has no column 'a\nb\x1b'; name one"))
        == r"rig.csv: has no column 'a\nb\x1b'; name one"
    )
    long = str(kind(f"rig.csv: has no column '{'a' * 100_000}'; name one"))
    assert len(long) <= 2000
    assert long.startswith("rig.csv: has no column 'aaa")
    assert long.endswith("aaa'; name one")
