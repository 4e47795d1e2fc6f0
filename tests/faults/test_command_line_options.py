"""Every option of every verb, given what it cannot take: exit 2, one sentence on stderr, no traceback.

The options are those of the parser itself: a new one is covered by being declared.
"""

from __future__ import annotations

import argparse
from itertools import cycle
from pathlib import Path

import numpy as np
import pytest
from command_line import Ended, mrwork, printed
from study_texts import study_text

from mrwork.cli.door import parser, verbs
from mrwork.cli.numbers import Listed, OrWord, Range, named_path

NO_NUMBERS = (
    *("nan", "-nan", "inf", "-inf", "1e400", "-1e400", "1e30", "-1e30", str(2**70), str(-(2**70))),
    *("9" * 20, "9" * 5000, "", " ", "x", "0x10", "1:2", "1;2", "\x1b[31m", "\udcff", "1\n2", "\u202e1"),
)
NO_VALUES = (
    *("nan", "inf", "-inf", "1e400", "-1e400", "1e30", "-1e30", "9" * 400, "1e30A", "-5A", "1e9A", "", "x"),
    *("nan:1", "1:nan", "inf:1", "2:1", "1:1e400", "normal:nan:1", "uniform:-inf:inf", "\x1b[31m", "\udcff"),
)
NAMES = ("force", "command", "delay", "offset", "mass", "average", "lowpass", "gain", "c", "k", "no")
NO_TEXTS = (
    *("", "=", "nan", "1", "=1", "\x1b[31m", "\udcff", "x" * 300, "a\nb", "lowpass=0", "average=1e5"),
    *(f"{name}={value}" for name, value in zip(cycle(NAMES), NO_VALUES, strict=False)),
)
NO_PATHS = ("", "x" * 300, "/dev/null/x", "/dev/null/\x1b[31m", "/dev/null/\u202e\udcff")


def options_of(verb: str) -> list[argparse.Action]:
    """Options of a verb that take a value, and its arguments."""
    (commands,) = (each for each in parser([verb])._actions if isinstance(each, argparse._SubParsersAction))
    return [each for each in commands.choices[verb]._actions if each.nargs != 0]


def is_number(option: argparse.Action) -> bool:
    return isinstance(option.type, Range | Listed | OrWord)


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


def written_record(path: Path) -> Path:
    """A test of a damper with friction and viscosity."""
    time = np.arange(0.0, 2.0, 0.01)
    velocity = 20.0 * np.pi * np.cos(2.0 * np.pi * time)
    columns = (time, 10.0 * np.sin(2.0 * np.pi * time), 0.4 * np.tanh(velocity / 10.0) + 0.005 * velocity)
    rows = "\n".join(",".join(f"{number:.9f}" for number in row) for row in zip(*columns, strict=True))
    path.write_text(f"t_s,displacement_mm,force_kN\n{rows}\n")
    return path


def arguments_of(verb: str, record: Path, run: Path, folder: Path) -> list[object]:
    """Arguments with which a verb would run, writing into a folder; a new verb needs its line."""
    study = folder / "study.toml"
    study.write_text(study_text("control_weight = 1e-13"))
    arguments: dict[str, list[object]] = {
        "demo": ["--out", folder / "demo"],
        "init": ["study", folder / "sample"],
        "models": [],
        "check": [record],
        "identify": [record, "--model", "static_hysteretic", "--out", folder / "new"],
        "profile": [run],
        "sample": [run, "--steps", "2"],
        "calibrate": [run, record],
        "predict": [run, record],
        "report": [run],
        "plan": [run],
        "respond": [study, "--out", folder / "study"],
        "tune": [study, "--out", folder / "tuned", "--quick"],
        "convert": ["spencer", "--to", "normalised", "alpha=1", "A=1", "n=2", "gamma=1", "beta=1"],
        "export": [run, "--to", "csv"],
        "cite": [run],
        "completion": ["bash"],
    }
    return arguments[verb]


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
