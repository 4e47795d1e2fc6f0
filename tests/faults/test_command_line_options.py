"""Every option of every verb, given what it cannot take: exit 2, one sentence on stderr, no traceback.

The options are those of the parser itself: a new one is covered by being declared.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
import pytest
from command_line import Ended, mrwork, printed

from mrwork.cli.door import verbs
from mrwork.cli.numbers import Range, named_path
from tools.faults.options import (
    NO_NUMBERS,
    NO_PATHS,
    NO_TEXTS,
    arguments_of,
    is_number,
    options_of,
    written_record,
)

OPTIONS = [(verb, option) for verb in verbs() for option in options_of(verb) if option.option_strings]
NUMBERS = [(verb, option) for verb, option in OPTIONS if is_number(option)]
CHOICES = [(verb, option) for verb, option in OPTIONS if option.choices]
PATHS = [(verb, option) for verb, option in OPTIONS if option.type is named_path]
TEXTS = [(verb, option) for verb, option in OPTIONS if option.type is None and not option.choices]
ARGUMENTS = [(verb, each) for verb in verbs() for each in options_of(verb) if not each.option_strings]


def named(value: object) -> str:
    return value if isinstance(value, str) else (value.option_strings or [value.dest])[0]  # type: ignore[attr-defined] # argparse does not say what it holds


def refused(ended: Ended, given: object) -> None:
    assert ended.returncode == 2, (given, ended)
    assert ended.stdout == "", given
    assert ended.stderr.count("\n") == 1, (given, ended.stderr)
    assert ended.stderr.endswith("\n")
    assert ended.stderr[:-1].isprintable(), (given, ended.stderr)


@pytest.fixture(scope="module")
def record(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return written_record(tmp_path_factory.mktemp("record") / "10mm1Hz.csv")


@pytest.fixture(scope="module")
def run(record: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("faults") / "run"
    printed("identify", record, "--model", "static_hysteretic", "--quiet", "--out", place)
    return place


@pytest.fixture
def given(verb: str, record: Path, run: Path, tmp_path: Path) -> list[object]:
    return arguments_of(verb, record, run, tmp_path)


def test_every_option_is_tried() -> None:
    tried = [*NUMBERS, *CHOICES, *PATHS, *TEXTS]
    assert len(tried) == len(OPTIONS), (
        "a number has a range of `cli.numbers`, all else is a choice, path or text"
    )


@pytest.mark.parametrize(("verb", "option"), NUMBERS, ids=named)
def test_a_number_outside_its_range_is_refused_with_the_range(verb: str, option: argparse.Action) -> None:
    assert option.help is not None
    assert option.type.in_words in option.help  # type: ignore[union-attr] # argparse does not say what it holds
    limits = option.type if isinstance(option.type, Range) else option.type.of  # type: ignore[union-attr] # argparse does not say what it holds
    least, most = limits.within.least, limits.within.most
    beyond = (least - 1, most + 1, np.nextafter(least, -np.inf))
    for value in (*NO_NUMBERS, *beyond):
        ended = mrwork(verb, f"{option.option_strings[0]}={value}")
        refused(ended, value)
        assert limits.in_words in ended.stderr, value


@pytest.mark.parametrize(("verb", "option"), CHOICES, ids=named)
def test_what_is_no_choice_is_refused(verb: str, option: argparse.Action) -> None:
    for value in ("", "nan", "x" * 300, "\x1b[31m", "\udcff", "a\nb"):
        refused(mrwork(verb, f"{option.option_strings[0]}={value}"), value)


@pytest.mark.parametrize(("verb", "option"), PATHS, ids=named)
def test_an_impossible_path_is_refused(verb: str, option: argparse.Action, given: list[object]) -> None:
    for value in NO_PATHS:
        refused(mrwork(verb, *given, f"{option.option_strings[0]}={value}"), value)


@pytest.mark.parametrize(("verb", "option"), TEXTS, ids=named)
def test_a_text_that_means_nothing_is_refused(
    verb: str, option: argparse.Action, given: list[object]
) -> None:
    for value in NO_TEXTS:
        refused(mrwork(verb, *given, f"{option.option_strings[0]}={value}"), value)


@pytest.mark.parametrize(("verb", "argument"), ARGUMENTS, ids=named)
def test_an_impossible_argument_is_refused(
    verb: str, argument: argparse.Action, record: Path, run: Path
) -> None:
    first = [run] if argument.dest == "files" and verb in ("predict", "calibrate") else []
    for value in (*NO_PATHS, "nan", "\x1b[31m\n", "\udcff"):
        refused(mrwork(verb, *first, value), value)
