r"""Characters that a reader cannot see, written as escapes, as in `\x1b`.

A name from a file may hold control characters. As they are, they command the terminal, end a line, turn the direction
of writing or make an SVG invalid; half a character, as in a file name that is not UTF-8, cannot be printed at all.
"""

from __future__ import annotations

import re

# Controls, ends of lines and paragraphs, marks of direction, halves of characters, and what no text may hold.
_HIDDEN = "\x00-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ufffe\uffff\ud800-\udfff"
_ANY = re.compile(f"[{_HIDDEN}]")
_BUT_LINES = re.compile(f"(?!\n)[{_HIDDEN}]")


def escaped(text: str) -> str:
    """A name or a sentence, which is to stay in its line."""
    return _ANY.sub(_escape, text)


def escaped_lines(text: str) -> str:
    """A text whose ends of lines are meant."""
    return _BUT_LINES.sub(_escape, text)


def _escape(character: re.Match[str]) -> str:
    return character.group().encode("unicode_escape").decode("ascii")
