"""Every number, choice and file of every verb, given what it cannot be: exit 2, and one printable line on stderr.

The options are those of the parser itself: a new one is covered by being declared.
"""

from __future__ import annotations

import argparse
import re

import numpy as np
import pytest
from refusals import command_refusal
from verb_folders import COMMANDS

from mrwork.cli.numbers import Listed, OrWord, Range

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
    if isinstance(action.type, Range | Listed | OrWord):
        limits = action.type if isinstance(action.type, Range) else action.type.of
        least, most, match = limits.within.least, limits.within.most, re.escape(limits.in_words)
        assert action.help is not None
        assert action.type.in_words in action.help
        wrong = (*NO_NUMBERS, *map(str, (least - 1, most + 1, np.nextafter(least, -np.inf))))
    for value in wrong:
        given = f"{action.option_strings[0]}={value}" if action.option_strings else value
        line = command_refusal(verb, given, match=match)
        assert line.count("\n") == 1
        assert line[:-1].isprintable(), line
