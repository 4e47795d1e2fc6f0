r"""Characters that a reader cannot see, written as escapes, as in `\x1b`.

A name from a file may hold control characters. As they are, they command the terminal, end a line, turn the direction
of writing or make an SVG invalid; half a character, as in a file name that is not UTF-8, cannot be printed at all.
"""

from __future__ import annotations

import re

# Controls, ends of lines and paragraphs, marks of direction and others without a shape, halves of characters, what no
# font has, and what no text may hold; the end of a line is hidden where it is not meant.
_HIDDEN = (
    "\x00-\x09\x0b-\x1f\x7f-\x9f\xad\u0600-\u0605\u061c\u06dd\u070f\u0890\u0891\u08e2\u180e\u200b-\u200f\u2028-\u202e"
    "\u2060-\u206f\ud800-\uf8ff\ufdd0-\ufdef\ufeff\ufff0-\ufffb\ufffe\uffff\U000110bd\U000110cd"
    "\U00013430-\U0001343f\U0001bca0-\U0001bca3\U0001d173-\U0001d17a\U000e0000-\U000e00ff\U000f0000-\U0010ffff"
)
_ANY = re.compile(f"[\n{_HIDDEN}]")
_BUT_LINES = re.compile(f"[{_HIDDEN}]")


def escape_text(text: str) -> str:
    """A name or a sentence, which is to stay in its line."""
    return _ANY.sub(_escape, text)


def escaped_lines(text: str) -> str:
    """A text whose ends of lines are meant."""
    return _BUT_LINES.sub(_escape, text)


def _escape(character: re.Match[str]) -> str:
    return character.group().encode("unicode_escape").decode("ascii")
