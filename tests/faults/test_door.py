"""Options given what they cannot be, and commands whose stdout or stderr is full, closed or left: how they end."""

import argparse
import json
import re
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import COMMAND, mrwork, ran
from refusals import command_refusal
from verb_folders import COMMANDS

from mrwork.cli.number_texts import Listed, Range
from mrwork.cli.output import print_json
from mrwork.cli.terminal import note, show

DECLARED = [
    (verb, action) for verb, parser in COMMANDS.items() for action in parser._actions if action.nargs != 0
]
WRONG = ("", "nan", "\x1b[31m", "\udcff", "x" * 300, "/dev/null/x")
NO_NUMBERS = ("nan", "-inf", "1e400", str(2**70), "9" * 5000, "", "x", "1:2", "\x1b[31m", "1\n2")


def named(value: object) -> str:
    return value if isinstance(value, str) else (value.option_strings or [value.dest])[0]  # type: ignore[attr-defined] # argparse does not say what it holds


@pytest.mark.parametrize(("verb", "action"), DECLARED, ids=named)
def test_what_it_cannot_be_is_refused_in_one_line(verb: str, action: argparse.Action) -> None:
    match, wrong = "", WRONG if action.choices or not action.option_strings else ()
    if isinstance(action.type, Range | Listed):
        limits = replace(action.type if isinstance(action.type, Range) else action.type.of, word="")
        least, most, match = limits.within.least, limits.within.most, re.escape(limits.in_words)
        assert action.help is not None
        assert action.type.in_words in action.help
        wrong = (*NO_NUMBERS, *map(str, (least - 1, most + 1, np.nextafter(least, -np.inf))))
    for value in wrong:
        given = f"{action.option_strings[0]}={value}" if action.option_strings else value
        line = command_refusal(verb, given, match=match)
        assert line.count("\n") == 1
        assert line[:-1].isprintable(), line


def in_a_shell(line: str) -> subprocess.CompletedProcess[str]:
    return ran("bash", "-c", line, "bash", *COMMAND)


@pytest.mark.parametrize(
    ("line", "words"),
    [('"$@" models > /dev/full', "No space left"), ('"$@" models >&-', "standard output is closed")],
)
def test_a_full_or_closed_stdout_is_one_sentence(line: str, words: str) -> None:
    ended = in_a_shell(line)
    assert ended.returncode == 2, ended
    assert words in ended.stderr
    assert len(ended.stderr.splitlines()) == 1


def test_a_reader_that_leaves_is_no_error_and_results_are_written_without_one(tmp_path: Path) -> None:
    words = f"identify synthetic:rd1005_1a --model bingham --every 20 --quiet --out {tmp_path}/run"
    ended = in_a_shell(f'"$@" {words} | true; echo ${{PIPESTATUS[0]}}')
    assert (ended.stdout, ended.stderr) == ("0\n", "")
    assert mrwork("report", tmp_path / "run").returncode == 0


@pytest.mark.parametrize("stderr", ["2>&-", "2>/dev/full"])
def test_without_stderr_the_status_and_stdout_stay(stderr: str) -> None:
    refused = in_a_shell(f'"$@" models none {stderr}')
    assert (refused.returncode, refused.stdout) == (2, "")
    done = in_a_shell(f'"$@" models bingham --json {stderr}')
    assert done.returncode == 0
    assert json.loads(done.stdout)["name"] == "bingham"


def test_json_is_strict(capsys: pytest.CaptureFixture[str]) -> None:
    print_json({"a": float("inf"), "b": [float("nan"), np.float64("-inf"), 1.0], "c": "\x1b\udcff\u00b5"})
    text = capsys.readouterr().out
    strict = json.loads(text, parse_constant=lambda constant: pytest.fail(f"{constant} is not JSON"))
    assert strict == {"a": None, "b": [None, None, 1.0], "c": "\x1b\udcff\u00b5"}
    assert text[:-1].isprintable()


def test_control_characters_are_shown_as_escapes(capsys: pytest.CaptureFixture[str]) -> None:
    name = "a\x1b[31m\x07\x9b\u202eb\r"
    show(f"{name}\nnext")
    note(f"{name}\nnext")
    shown = capsys.readouterr()
    assert shown.out == r"a\x1b[31m\x07\x9b\u202eb\r" + "\nnext\n"
    assert shown.err == r"mrwork: a\x1b[31m\x07\x9b\u202eb\r\nnext" + "\n"
