"""Refusals that tests provoke, with their whole sentences in one file, `tests/sentences.toml`.

A test asks for `refused` and gives it each call that must be refused: `refused(mr.building, "dyke")`. `make sentences`
writes the file anew, so that a change of wording is one diff.
"""

import json
import os
import re
import tomllib
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from command_line import mrwork
from measured_data import DATA

TESTS = Path(__file__).parent.parent
GOLDEN = TESTS / "sentences.toml"
MEANT = "if this is meant: make sentences"
WRITES = os.environ.get("MRWORK_SENTENCES") == "write"

PLACES = {TESTS: "{tests}", DATA: "{data}"}
# What is of the machine, or of this Python.
VARYING = {
    r"\bprocess \d+ on \S+": "process {number} on {machine}",
    r"is not TOML(:| \()[^()]*\(at": r"is not TOML\1{reason} (at",
}


@cache
def golden() -> dict[str, dict[str, list[str]]]:
    """The lines of each test, by its file and its name."""
    return tomllib.loads(GOLDEN.read_text())


class Refused:
    """Calls what must be refused, and compares error and sentence with the next line of the test's entry."""

    def __init__(self, expected: list[str], base: Path) -> None:
        self.expected = expected
        self.came: list[str] = []
        self.failed = False
        self._folder = re.compile(re.escape(str(base)) + r"/\w+")

    def __call__(self, call: Callable[..., object], *args: Any, **kwargs: Any) -> Exception:
        """Return the error, for a test that says more about it; arguments are of any type, as they are to be wrong."""
        try:
            result = call(*args, **kwargs)
        except Exception as error:
            key = getattr(error, "key", "")
            self._compare(f"{type(error).__name__}{f' of `{key}`' if key else ''}: {error}")
            return error
        self.failed = True
        pytest.fail(f"nothing was refused; it returned {result!r}")

    def command(self, *arguments: object) -> None:
        """Compare the one line with which a command line ends: status 2, and nothing on stdout."""
        ended = mrwork(*arguments)
        assert (ended.returncode, ended.stdout) == (2, ""), ended.stderr
        self._compare(f"exit 2: {ended.stderr.rstrip()}")

    def _compare(self, line: str) -> None:
        line = self._folder.sub("{folder}", line)
        for place, name in PLACES.items():
            line = line.replace(str(place), name)
        for pattern, constant in VARYING.items():
            line = re.sub(pattern, constant, line)
        self.failed = not WRITES and self.expected[len(self.came) :][:1] != [line]
        if self.failed:
            assert line == "".join(self.expected[len(self.came) :][:1]), MEANT
        head, *mistakes = line.split("\n  ")
        assert not mistakes or head.endswith(f" has {len(mistakes)} mistakes:"), line
        assert all(map(str.isprintable, (head, *mistakes))), (
            "a refusal is printable text, in a line or one a mistake"
        )
        self.came.append(line)


def write(came: dict[str, dict[str, list[str]]]) -> None:
    """Write the sentences of the tests that were run; those of the others stay, where the test still exists."""
    lines = ["# Written by `make sentences`: what each test has refused, in its order."]
    for module in sorted({*golden(), *came}):
        tests = former(module, came.get(module, {})) | came.get(module, {})
        lines += ["", f"[{json.dumps(module)}]"] if any(tests.values()) else []
        for name, sentences in sorted(tests.items()):
            quoted = [f"    {json.dumps(sentence, ensure_ascii=False)}," for sentence in sentences]
            lines += [f"{json.dumps(name, ensure_ascii=False)} = [", *quoted, "]"] if quoted else []
    GOLDEN.write_text("\n".join(lines) + "\n")


def former(module: str, ran: Iterable[str]) -> dict[str, list[str]]:
    """The entries of tests that were not run, as where their data are absent."""
    known = {function_of(name) for name in ran}
    return {
        name: lines
        for name, lines in golden().get(module, {}).items()
        if function_of(name) not in known and is_there(module, name)
    }


def function_of(name: str) -> str:
    return name.partition("[")[0]


def is_there(module: str, name: str) -> bool:
    """Whether the test of an entry still exists, and asks for `refused`."""
    file = TESTS / module
    _, _, test = (file.read_text() if file.is_file() else "").partition(f"def {function_of(name)}(")
    return "refused: Refused" in test.partition(":\n")[0]
