"""Equations as the package writes them, such as `w' = rho (v - |v| w)`, in TeX.

The text is split into names, numbers and signs. Layout stays as written: a quotient is on one line, and whatever is no
name of the equation is a word.
"""

from __future__ import annotations

import re
from collections.abc import Collection

_TOKEN = re.compile(r"\s+|(?:[A-Za-z][A-Za-z0-9]*(?:_[A-Za-z0-9]+)?)|[0-9]+(?:\.[0-9]+)?|.")
_NAME = re.compile(r"([A-Za-z]+?)([0-9]*)(?:_([A-Za-z0-9]+))?")
_GREEK = frozenset(
    {
        *(
            "alpha",
            "beta",
            "gamma",
            "delta",
            "epsilon",
            "eta",
            "kappa",
            "lambda",
            "mu",
            "nu",
            "omega",
            "phi",
            "rho",
        ),
        *("sigma", "tau", "theta", "xi", "zeta"),
    }
)
_FUNCTIONS = frozenset({"tanh", "cosh", "sinh", "exp", "ln", "min", "max"})
_OPERATORS = frozenset({"sgn", "sat", "argmin"})
_SIGNS = {"{": r"\{", "}": r"\}", "'": r"^{\prime}", ",": r",\;", ";": r";\;", "*": r"\cdot "}


def tex(equation: str, variables: Collection[str] = ()) -> str:
    """An equation of one or several lines in TeX; `variables` are names that would pass for words."""
    lines = [_line(line, variables) for line in equation.splitlines()]
    if len(lines) == 1:
        return lines[0]
    aligned = " \\\\\n".join(line.replace("=", "&=", 1) if "=" in line else f"& {line}" for line in lines)
    return f"\\begin{{aligned}}\n{aligned}\n\\end{{aligned}}"


def _line(line: str, variables: Collection[str]) -> str:
    tokens = _TOKEN.findall(line)
    words = [_is_word(token, variables) for token in tokens]
    written: list[str] = []
    bars = 0
    position = 0
    while position < len(tokens):
        token = tokens[position]
        if words[position] or (token == "a" and _between_words(words, position)):
            position, text = _words(tokens, words, position)
            written.append(text)
        elif token == "^":
            position, exponent = _exponent(tokens, position + 1, variables)
            written.append(f"^{{{exponent}}}")
        elif token.isspace():
            written.append(_space(tokens, words, position))
            position += 1
        elif token == "|":
            written.append(r"\left|" if bars % 2 == 0 else r"\right|")
            bars += 1
            position += 1
        else:
            written.append(_symbol(token))
            position += 1
    return "".join(written).strip()


def _is_word(token: str, variables: Collection[str]) -> bool:
    """Whether a token is a word of English, not a name of the equation."""
    if not re.fullmatch(r"[A-Za-z]{2,}", token) or token in variables:
        return False
    return token not in _GREEK | _FUNCTIONS | _OPERATORS | {"sum"}


def _between_words(words: list[bool], position: int) -> bool:
    return 1 < position < len(words) - 2 and words[position - 2] and words[position + 2]


def _words(tokens: list[str], words: list[bool], position: int) -> tuple[int, str]:
    """Position after neighbouring words, and these with a space on either side."""
    end = position + 1
    while (
        end + 1 < len(tokens)
        and tokens[end].isspace()
        and (words[end + 1] or (tokens[end + 1] == "a" and _between_words(words, end + 1)))
    ):
        end += 2
    after = "" if end < len(tokens) and tokens[end] in ",;." else " "
    return end, rf"\text{{ {''.join(tokens[position:end])}{after}}}"


def _exponent(tokens: list[str], start: int, variables: Collection[str]) -> tuple[int, str]:
    """Position after an exponent, a token or all within its brackets, and its TeX."""
    if tokens[start] != "(":
        return start + 1, _symbol(tokens[start])
    depth, end = 1, start + 1
    while depth and end < len(tokens):
        depth += {"(": 1, ")": -1}.get(tokens[end], 0)
        end += 1
    return end, _line("".join(tokens[start + 1 : end - 1]), variables)


def _space(tokens: list[str], words: list[bool], position: int) -> str:
    """A thin space where two factors stand side by side."""
    if not 0 < position < len(tokens) - 1 or words[position - 1] or words[position + 1]:
        return ""
    before, after = tokens[position - 1], tokens[position + 1]
    ends = before[-1].isalnum() or before in ")|'"
    return r"\," if ends and (after[0].isalnum() or after in "(|") else " "


def _symbol(token: str) -> str:
    if token in _SIGNS:
        return _SIGNS[token]
    if token in _FUNCTIONS:
        return rf"\{token} "
    if token in _OPERATORS:
        return rf"\operatorname{{{token}}}"
    found = _NAME.fullmatch(token)
    if found is None:
        return token
    base, digits, below = found.groups()
    subscript = _upright(digits or below or "")
    letter = rf"\{base} " if base in _GREEK | {"sum"} else _upright(base)
    return f"{letter.strip()}_{{{subscript}}}" if subscript else letter


def _upright(text: str) -> str:
    """Letters as one name where there are several."""
    if text in _GREEK:
        return rf"\{text}"
    return rf"\mathrm{{{text}}}" if len(text) > 1 and text.isalpha() else text
