"""Declared tables: the meaning, unit and range of each key, in words and as TOML.

A table is a dataclass. The annotation of a field is the type of its value; `key` declares the rest. The reader of
documents, the printed schema and scripts that build the same values all use these notes.
"""

from __future__ import annotations

import json
import math
import re
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, Field, field, fields, is_dataclass, replace
from difflib import get_close_matches
from functools import partial
from typing import Any, cast

from mrwork.base import hints as nodes
from mrwork.base.hints import NOTES, May, Node, Record, Within, fields_of
from mrwork.base.synonyms import synonyms, without_style
from mrwork.errors import InvalidSettingError, MrworkError, UnknownNameError

_REQUIRED: Any = MISSING
LARGEST_SEED = 2**53 - 1
"""Largest seed, an integer that every reader of JSON keeps."""
# As many characters of a value as a message repeats.
_SHOWN = 40


def quote_value(value: object) -> str:
    """A value as messages quote it: in short, or only its type."""
    if isinstance(value, str | bytes | int | float | complex | None):
        text = repr(value)
        return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"
    if isinstance(value, type):
        return f"the class {value.__name__}"
    name = type(value).__name__
    dtype = getattr(value, "dtype", None)
    numbers = "" if dtype is None else f" of shape {getattr(value, 'shape', ())} with values of type {dtype}"
    return f"{'an' if name[0] in 'AEIOUaeiou' else 'a'} {name}{numbers}"


def suggestion(name: object, known: Sequence[str], *, otherwise: str = "choose one of") -> str:
    """End of a message on an unknown name: the similar known names, or all where none is close."""
    near = " or ".join(meant(name, known))
    return f", did you mean {near}" if near else f"; {otherwise} {', '.join(known) or 'none'}"


def check_known(
    name: object,
    known: Collection[str],
    sentence: str,
    *,
    otherwise: str = "choose one of",
    kind: type[MrworkError] = UnknownNameError,
) -> None:
    """Refuse a name that is none of those known, by this sentence with a `suggestion` behind it."""
    if name not in known:
        raise kind(f"{sentence}{suggestion(name, [*known], otherwise=otherwise)}")


# Characters from which on a name in another style is compared with others that are only similar.
_LONG = 6


def closest(name: object, known: Sequence[str]) -> str:
    """Most similar known name; empty if none is close."""
    return next(iter(meant(name, known)), "")


def meant(name: object, known: Sequence[str]) -> list[str]:
    """Known names similar to an unknown one: the same in another style, a synonym, or a similar spelling."""
    if not isinstance(name, str):
        return []
    plain = {without_style(other): other for other in reversed(known)}
    if same := plain.get(without_style(name)):
        return [same]
    for alike in synonyms(name):
        if near := [plain[word] for synonym in alike if (word := without_style(synonym)) in plain]:
            return near
    if near := get_close_matches(name, known, n=1):
        return near
    # Short names, as of units, are like too many others then.
    alike = get_close_matches(without_style(name), plain, n=1) if len(name) >= _LONG else []
    return [plain[word] for word in alike]


def key(
    says: str,
    *,
    unit: str = "",
    default: Any = _REQUIRED,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
    below: float = math.inf,
    most_items: float = math.inf,
    may_be_nan: bool = False,
    matrix: bool = False,
    span: object = None,
    from_one: bool = False,
    named: str = "",
    file: bool = False,
    usual: tuple[float, float] | None = None,
) -> Any:
    """Declare a key of a table: what it means in a few words, and its range, as of `Within`.

    A number with a `unit`, which is that of SI, may be a text with another unit in a file. A key without a default is
    required. `matrix` permits a matrix, in a file also the name of a text file with it. `span` is the range in which a
    search looks for it. A number that counts `from_one` in a file counts from 0 in Python; `named` is the name in a
    file, where it is another one. A text that may name a `file` is relative to the folder of the document. A number
    other than 0 that is beyond the `usual`, of an array the largest, is asked about in `Place.questions`.
    """
    declared = {**locals(), "within": Within(least=least, above=above, most=most, below=below)}
    declared[NOTES] = (declared["within"], *([May.BE_NAN] * may_be_nan))
    return field(metadata=declared) if default is MISSING else field(default=default, metadata=declared)


optional = partial(key, default=None)
"""Declare a key that may be left out, and is `None` then."""
positive = partial(optional, above=0.0)
"""Declare a key of a number above zero that may be left out, and is `None` then or its default."""


def keys_of(table: type) -> tuple[Field[Any], ...]:
    """The keys of a table: its fields declared by `key`."""
    return tuple(entry for entry in fields(cast(Any, table)) if "says" in entry.metadata)


def name_in_file(entry: Field[Any]) -> str:
    """Name of a key in a file."""
    return entry.metadata["named"] or entry.name


def given_in(table: Any) -> dict[str, Any]:
    """The keys of a table that are not as by default, as a document has them: what `read_table` reads back."""
    given = {}
    for entry in keys_of(type(table)):
        value = getattr(table, entry.name)
        if type(value) is not type(entry.default) or value != entry.default:
            given[name_in_file(entry)] = as_document(value, from_one=entry.metadata["from_one"])
    return given


def as_document(value: Any, *, from_one: bool = False) -> Any:
    """A value of a key as a document has it: tables and arrays of plain values."""
    if isinstance(value, Mapping):
        return {name: as_document(item, from_one=from_one) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_document(item, from_one=from_one) for item in value]
    if is_dataclass(value) and keys_of(type(value)):
        return given_in(value)
    return value + 1 if from_one else value


def is_required(entry: Field[Any]) -> bool:
    """Whether the key must be given."""
    return entry.default is MISSING and entry.default_factory is MISSING


def describe_key(entry: Field[Any]) -> str:
    """Meaning of a key and its unit."""
    unit = entry.metadata["unit"]
    return f"{entry.metadata['says']}{f' [{unit}]' if unit else ''}"


def describe_repeat(name: str, values: Sequence[object]) -> str:
    """Message on the first repeated text of an array; empty if there is none."""
    texts = [value for value in values if isinstance(value, str)]
    twice = next((text for text, count in Counter(texts).items() if count > 1), None)
    return "" if twice is None else f"{name} has {twice!r} twice; give each once"


def range_of(entry: Field[Any]) -> Within:
    """Permitted range of a key's number in a file, where counts may start from one."""
    within: Within = entry.metadata["within"]
    if not entry.metadata["from_one"]:
        return within
    return replace(within, least=within.least + 1, most=within.most + 1)


def tables(kind: type, path: str = "") -> Iterator[tuple[str, type]]:
    """Headings and declarations of a table and all tables in it, outer tables first, each declaration once."""
    by_heading = {path: kind}
    for entry in keys_of(kind):
        inner, several = inner_table(fields_of(kind)[entry.name])
        if inner is not None:
            name = ".".join(filter(None, (path.strip("[]"), name_in_file(entry))))
            for heading, table in tables(inner, f"[[{name}]]" if several else f"[{name}]"):
                if table not in by_heading.values():
                    by_heading[heading] = table
    yield from by_heading.items()


def inner_table(node: Node) -> tuple[type | None, bool]:
    """Class of the table that a key holds, if any, and whether the key may hold several."""
    if isinstance(node, Record):
        return (node.kind if keys_of(node.kind) else None), False
    inner = [inner_table(part) for part in node.parts]
    kind = next((table for table, _ in inner if table is not None), None)
    return kind, isinstance(node, nodes.Fixed) or any(several for _, several in inner)


def refuse_repeated(table: Any) -> None:
    """Refuse a name that stands twice in an array of a table that a script has built."""
    for entry in fields(table):
        given = getattr(table, entry.name)
        if isinstance(given, tuple) and (refusal := describe_repeat(entry.name, given)):
            raise InvalidSettingError(entry.name, refusal)


def toml_value(value: Any) -> str:
    """TOML text of a setting's value."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        # The escapes of JSON are those of TOML.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{ " + ", ".join(toml_lines_of(value)) + " }" if value else "{}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    return repr(value)


def toml_lines_of(table: Mapping[str, Any]) -> list[str]:
    """A line of TOML for each key of a table."""
    return [
        f"{name if re.fullmatch('[A-Za-z0-9_-]+', name) else toml_value(name)} = {toml_value(value)}"
        for name, value in table.items()
    ]


def toml_text(document: Mapping[str, Any]) -> str:
    """A document as TOML: its own keys, then its tables below their headings, and what is in these in their lines."""
    own, blocks = {}, []
    for name, value in document.items():
        several = isinstance(value, list) and all(isinstance(each, dict) for each in value)
        if not several and not isinstance(value, dict):
            own[name] = value
            continue
        heading = f"[[{name}]]" if several else f"[{name}]"
        blocks += [[heading, *toml_lines_of(each)] for each in (value if several else [value])]
    return "\n\n".join("\n".join(block) for block in [toml_lines_of(own), *blocks] if block) + "\n"
