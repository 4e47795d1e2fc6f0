"""JSON and TOML texts that may be damaged or hostile: too deep, with numbers that nothing can hold, or ambiguous."""

from __future__ import annotations

import json
import re
import tomllib
from collections import Counter
from typing import Any, Final, NoReturn

_DEEPEST: Final = 100
# Of a whole number: the state of a random generator has 39.
_MOST_DIGITS: Final = 100
# Characters of a key in a message.
_SHOWN: Final = 40
# A key of many parts takes the parser of TOML time and memory in the square of their number.
_LONG_KEY: Final = re.compile(
    rf"""(?:^|[\[{{,])[ \t]*(?:(?:[\w-]+|"(?:[^"\\\n]|\\.)*"|'[^'\n]*')[ \t]*\.[ \t]*){{{_DEEPEST}}}""",
    re.MULTILINE | re.ASCII,
)
_TOO_DEEP: Final = f"tables and arrays are nested more than {_DEEPEST} deep"


def json_value(text: str) -> Any:
    """The value of a JSON text."""
    try:
        value = _DECODER.decode(text)
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    _check_depth(value)
    return value


def toml_table(text: str) -> dict[str, Any]:
    """The tables of a TOML text."""
    if _LONG_KEY.search(text):
        raise ValueError(f"a key has more than {_DEEPEST} parts")
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise ValueError(_TOO_DEEP) from None
    except ValueError:
        # Python's limit of 4300 digits, without its advice to programmers.
        raise ValueError(f"a whole number has more than {_MOST_DIGITS} digits") from None
    _check_depth(table)
    return table


def _whole(digits: str) -> int:
    if len(digits) > _MOST_DIGITS:
        raise ValueError(f"a whole number has {len(digits)} digits")
    return int(digits)


def _no_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """An object, each of whose keys stands once; Python's own reader keeps the last of several."""
    found = dict(pairs)
    if len(found) < len(pairs):
        ((twice, _),) = Counter(key for key, _ in pairs).most_common(1)
        raise ValueError(f"the key {twice[:_SHOWN]!r} stands more than once in one object")
    return found


_DECODER: Final = json.JSONDecoder(parse_int=_whole, parse_constant=_no_constant, object_pairs_hook=_object)


def _check_depth(value: Any) -> None:
    level = [value]
    for _ in range(_DEEPEST):
        inner: list[Any] = []
        for each in level:
            entries = each.values() if isinstance(each, dict) else each
            for entry in entries if isinstance(each, dict | list) else ():
                if isinstance(entry, dict | list):
                    inner.append(entry)
                elif isinstance(entry, int) and entry.bit_length() > 4 * _MOST_DIGITS:
                    raise ValueError(f"a whole number has more than {_MOST_DIGITS} digits")
        if not inner:
            return
        level = inner
    raise ValueError(_TOO_DEEP)
