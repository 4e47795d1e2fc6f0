"""Docstrings in the form of numpydoc: their text, and what they say of parameters."""

from __future__ import annotations

import inspect
import re
from collections.abc import Mapping, Sequence
from functools import cache
from textwrap import dedent, indent
from typing import Any

PARAMETERS = "Parameters\n----------\n"
SECTION = re.compile(r"^\w[\w ]*\n-+$", re.MULTILINE)
"""Heading of a section: a line, and dashes below it."""
# One or several names, and the indented lines below them.
_ENTRY = re.compile(r"^(\w+(?:, \w+)*)\n((?:(?: +.*)?\n)+)", re.MULTILINE)


def before_sections(docstring: str) -> str:
    """Text of a docstring before its first section."""
    return SECTION.split(inspect.cleandoc(docstring), maxsplit=1)[0].rstrip()


def with_parameters(docstring: str, texts: Mapping[str, str], order: Sequence[str]) -> str:
    """A docstring with texts on parameters among its own, in the order of these names."""
    text = inspect.cleandoc(docstring)
    before, head, below = text.partition(PARAMETERS)
    if not head:
        before = before_sections(text)
        before, below = f"{before}\n\n", text[len(before) :].lstrip("\n")
    section = SECTION.split(f"{below}\n", maxsplit=1)[0] if head else ""
    entries = [*_ENTRY.findall(section), *((name, indent(words, "    ")) for name, words in texts.items())]
    entries.sort(key=lambda entry: order.index(entry[0].partition(",")[0]))
    parameters = "".join(f"{names}\n{words.rstrip()}\n" for names, words in entries)
    rest = below[len(section) :]
    return "\n".join([f"{before}{PARAMETERS}{parameters}", *filter(None, [rest])])


@cache
def parameter_texts(declaring: Any) -> dict[str, str]:
    """What the docstring of a function, or of a dataclass and its bases, says of each parameter."""
    if isinstance(declaring, type):
        bases = [base for base in reversed(declaring.__mro__) if base is not object]
        return {name: text for base in bases for name, text in texts_in(base.__doc__).items()}
    return texts_in(declaring.__doc__)


def texts_in(docstring: str | None) -> dict[str, str]:
    """Text of each parameter of a numpydoc docstring, dedented; empty without a section of parameters."""
    _, _, below = inspect.cleandoc(docstring or "").partition(PARAMETERS)
    section = SECTION.split(f"{below}\n", maxsplit=1)[0]
    entries = _ENTRY.findall(section)
    return {name: dedent(text).strip() for names, text in entries for name in names.split(", ")}
