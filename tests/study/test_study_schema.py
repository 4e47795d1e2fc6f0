"""Tables of a study: each mistake is one sentence with its line, and the printed schema is what the reader goes by."""

from __future__ import annotations

import re
from typing import Any

import pytest
from sentences import Refused

from mrwork.base.hints import node_of
from mrwork.base.keys import in_words, is_required, keys_of, name_in_file, read_table, tables
from mrwork.base.places import Place
from mrwork.study.reading import parse
from mrwork.study.schema import StudyTable, schema_text

STUDY = """\
title = "Five storeys"

[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"
differential = true

[[controller]]
law = "clipped_optimal"
settings = { control_weight = 1e-17 }

[[motion]]
synthetic = "kanai_tajimi"
pga = [0.981, 2.943]

[hardware]
sample_time = "2 ms"
"""


def study_of(text: str) -> StudyTable:
    document, lines = parse(text, "study.toml")
    return read_table(StudyTable, document, Place(origin="study.toml", lines=lines))


def test_a_study_is_read_with_its_units_and_defaults() -> None:
    study = study_of(STUDY)
    assert study.hardware.sample_time == pytest.approx(0.002)
    assert study.hardware.feedback == "state"
    assert study.motion[0].pga == (0.981, 2.943)
    assert study.damper[0].storey == 1
    assert str(study.damper[0].place) == "study.toml, line 6"
    assert study.controller[0].settings == {"control_weight": 1e-17}


def test_a_mistake_is_one_sentence_with_its_line(refused: Refused) -> None:
    for old, new in (
        ("storey = 1", "story = 1"),
        ("storey = 1\n", ""),
        ("storey = 1", "storey = 1.5"),
        ("storey = 1", "storey = true"),
        ("differential = true", 'differential = "yes"'),
        ('law = "clipped_optimal"', "law = 3"),
        ("{ control_weight = 1e-17 }", "1"),
        ('"kanai_tajimi"', '"kanai"'),
        ("[0.981, 2.943]", '"0.1 furlong"'),
        ("[0.981, 2.943]", '[0.1, "3 mm"]'),
        ('"2 ms"', '"2"'),
        ('"2 ms"', "0"),
        ('"2 ms"', "nan"),
        ("[hardware]", "[hardwear]"),
        ("[[motion]]", "[motion]"),
        ("[building]\n", "[[building]]\n"),
    ):
        assert old in STUDY
        refused(study_of, STUDY.replace(old, new, 1))


def test_a_unit_is_converted_to_si() -> None:
    text = STUDY.replace("[0.981, 2.943]", '"0.1 g"')
    assert study_of(text).motion[0].pga == pytest.approx(0.980665)


@pytest.mark.parametrize(("heading", "kind"), list(tables(StudyTable)))
def test_the_printed_schema_has_every_key_that_the_reader_knows(heading: str, kind: Any) -> None:
    block = next(block for block in schema_text().split("\n\n") if block.startswith(heading or "at the top"))
    assert max(len(line) for line in block.splitlines()) <= 120
    # Sections of docstrings are for callers in Python.
    assert "---" not in block
    words = " ".join(block.split())
    for entry in keys_of(kind):
        default = "required" if is_required(entry) else ""
        found = re.search(rf" {name_in_file(entry)} {default}.*{re.escape(entry.metadata['says'])} \(", words)
        assert found, entry.name


@pytest.mark.parametrize(
    ("hint", "words"),
    [(str | None, "text"), (int | str, "whole number or text"), (tuple[float, ...], "array of numbers")],
)
def test_types_are_printed_in_words(hint: Any, words: str) -> None:
    assert in_words(node_of(hint)) == words
