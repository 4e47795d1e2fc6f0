"""Docstrings in the form of numpydoc: their text, and what they say of parameters."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping
from textwrap import indent

PARAMETERS = "Parameters\n----------\n"
SECTION = re.compile(r"^\w[\w ]*\n-+$", re.MULTILINE)
"""Heading of a section: a line, and dashes below it."""


def before_sections(docstring: str) -> str:
    """Text of a docstring before its first section."""
    return SECTION.split(inspect.cleandoc(docstring), maxsplit=1)[0].rstrip()


def with_parameters(docstring: str, texts: Mapping[str, str]) -> str:
    """A docstring with texts on parameters, before those that it has of others."""
    text = inspect.cleandoc(docstring)
    before, head, rest = text.partition(PARAMETERS)
    if not head:
        before = before_sections(text)
        before, rest = f"{before}\n\n", text[len(before) :].removeprefix("\n")
    entries = "".join(f"{name}\n{indent(words, '    ')}\n" for name, words in texts.items())
    return f"{before}{PARAMETERS}{entries}{rest}"
