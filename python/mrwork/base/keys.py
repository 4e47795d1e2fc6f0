"""Declared tables: the meaning, unit and range of each key, in words and as TOML.

A table is a dataclass, or one or several functions whose arguments it holds. Its keys are the fields and parameters
with the note `Says`: in the annotation, or by `key`, which declares a field of a dataclass. The reader of documents,
the printed schema and scripts that build the same values all use these notes.
"""

from __future__ import annotations

import inspect
import json
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from difflib import get_close_matches
from functools import cache, partial
from typing import Any, NoReturn, TypeVar, cast

from mrwork.base.docstrings import texts_in, with_parameters
from mrwork.base.hints import NOTES, Hint, Says, Within, nodes_of, note_of
from mrwork.base.places import Place, all_mistakes
from mrwork.base.synonyms import SYNONYMS, without_style
from mrwork.errors import InvalidSettingError, MrworkError, UnknownNameError

ValueT = TypeVar("ValueT")

LARGEST_SEED = 2**53 - 1
"""Largest seed, an integer that every reader of JSON keeps."""


def quote_value(value: object) -> str:
    """A value as messages quote it: in short, or only its type."""
    if isinstance(value, str | bytes | int | float | complex | None):
        text = repr(value)
        return text if len(text) <= 40 else f"{text[:40]}…"
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
    """Refuse an unknown name, by this sentence with a `suggestion` behind it."""
    if name not in known:
        raise kind(f"{sentence}{suggestion(name, [*known], otherwise=otherwise)}")


def look_up(
    name: str,
    known: Mapping[str, ValueT],
    sentence: str,
    *,
    otherwise: str = "choose one of",
    kind: type[MrworkError] = UnknownNameError,
) -> ValueT:
    """The value of a name, which is refused as by `check_known` where it is unknown."""
    check_known(name, known, sentence, otherwise=otherwise, kind=kind)
    return known[name]


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
    word = without_style(name)
    spelled = {word, word.removesuffix("s"), word.removesuffix("es")}
    for targets, words in SYNONYMS.items():
        alike = targets.split() if spelled & {without_style(part) for part in words.split()} else ()
        for likely in alike:
            if near := [plain[word] for part in likely.split("|") if (word := without_style(part)) in plain]:
                return near
    if near := get_close_matches(name, known, n=1):
        return near
    # Short names, as of units, are like too many others then.
    alike = get_close_matches(without_style(name), plain, n=1) if len(name) >= 6 else []
    return [plain[word] for word in alike]


def key(
    words: str,
    *,
    unit: str = "",
    default: Any = MISSING,
    least: float = -math.inf,
    above: float = -math.inf,
    most: float = math.inf,
    below: float = math.inf,
    matrix: bool = False,
    span: Any = None,
    from_one: bool = False,
    named: str = "",
    file: bool = False,
    usual: tuple[float, float] | None = None,
    functions: tuple[Callable[..., Any], ...] = (),
) -> Any:
    """Declare a field of a dataclass as a key, by the notes `Within` and `Says`; without a default it is required."""
    terms = locals()
    within, says = (
        kind(**{entry.name: terms[entry.name] for entry in fields(kind)}) for kind in (Within, Says)
    )
    # Without a range of its own the annotation may have one.
    metadata = {NOTES: (says,) if within == Within() else (within, says)}
    return field(metadata=metadata) if default is MISSING else field(default=default, metadata=metadata)


optional = partial(key, default=None)
"""Declare a key that may be left out, and is `None` then."""
positive = partial(optional, above=0.0)
"""Declare a key of a number above zero that may be left out, and is `None` then or its default."""

Table = type | tuple[Callable[..., Any], ...]
"""What declares the keys of a table: a dataclass, or functions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Key:
    """A key of a table: a field of a dataclass or an argument of a function, and what its notes declare."""

    name: str
    node: Hint
    default: Any
    says: Says

    @property
    def name_in_file(self) -> str:
        """Name of the key in a document: the one that its note states, else the name of the field or argument."""
        return self.says.named or self.name

    @property
    def is_required(self) -> bool:
        """Whether the key has no default, so that a document must give it."""
        return self.default is inspect.Parameter.empty

    @property
    def in_words(self) -> str:
        """Meaning of the key and its unit."""
        return f"{self.says.words}{f' [{self.says.unit}]' if self.says.unit else ''}"

    @property
    def within(self) -> Within:
        """Permitted range of its numbers in a document, where counts may start from one."""
        within = note_of(self.node, Within, inside=True) or Within()
        if not self.says.from_one:
            return within
        return replace(within, least=within.least + 1, most=within.most + 1)


def _keys_of(table: Table) -> tuple[Key, ...]:
    functions = table if isinstance(table, tuple) else (table,)
    alike: dict[str, list[Key]] = {}
    for function in functions:
        parameters = inspect.signature(function).parameters
        for name, node in nodes_of(function).items():
            if says := note_of(node, Says):
                entry = Key(name=name, node=node, default=parameters[name].default, says=says)
                alike.setdefault(entry.name_in_file, []).append(entry)
    for keys in alike.values():
        if len(keys) < len(functions):
            default = next((key.default for key in keys if not key.is_required), None)
            keys[0] = replace(keys[0], default=default)
    return tuple(keys[0] for keys in alike.values())


keys_of: Callable[[Table], tuple[Key, ...]] = cache(_keys_of)
"""The keys of a table: of functions all that one of them has, which is required where it is of each."""


def given_in(table: Any) -> dict[str, Any]:
    """The keys of a table that are not as by default, as a document has them: what `read_table` reads back."""
    document = {}
    for entry in keys_of(type(table)):
        value = getattr(table, entry.name)
        if type(value) is not type(entry.default) or value != entry.default:
            document[entry.name_in_file] = as_document(value, from_one=entry.says.from_one)
    return document


def as_document(value: Any, *, from_one: bool = False) -> Any:
    """A value of a key as a document has it: tables and arrays of plain values."""
    if isinstance(value, Arguments):
        return as_document(value.given)
    if isinstance(value, Mapping):
        return {name: as_document(item, from_one=from_one) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [as_document(item, from_one=from_one) for item in value]
    if is_dataclass(value) and keys_of(type(value)):
        return given_in(value)
    return value + 1 if from_one else value


def documented(target: Any, declared: Mapping[str, Hint]) -> str | None:
    """The docstring of a function or class with what the notes of its parameters say, where it says nothing itself."""
    if not target.__doc__ or not any(note_of(node, Says) for node in declared.values()):
        return cast("str | None", target.__doc__)
    texts, own = {}, texts_in(target.__doc__)
    for entry in (entry for entry in keys_of((target,)) if entry.name not in own):
        words = ", ".join(filter(None, (entry.in_words, entry.within.in_words)))
        texts[entry.name] = f"{words[:1].upper()}{words[1:]}."
    return with_parameters(target.__doc__, texts, [*declared])


def refuse_missing(entry: Key, place: Place) -> NoReturn:
    """Refuse a table that does not give a key."""
    place.refuse(f"{place.table} has no {entry.name_in_file}; give {entry.in_words}")


def own_keys(functions: Sequence[Callable[..., Any]]) -> list[list[str]]:
    """Names of the keys of each function in a document, without the keys that all functions have."""
    names = [[entry.name_in_file for entry in keys_of((function,))] for function in functions]
    return [[name for name in keys if any(name not in other for other in names)] for keys in names]


@dataclass(frozen=True, slots=True, kw_only=True)
class Arguments:
    """Arguments of `functions` that a table of a document gives, by their names there."""

    functions: tuple[Callable[..., Any], ...]
    given: Mapping[str, Any]
    place: Place

    def of(self, function: Callable[..., Any]) -> dict[str, Any]:
        """The values of one of the functions, by its own names."""
        names = {entry.name_in_file: entry.name for entry in keys_of((function,))}
        return {names[name]: value for name, value in self.given.items() if name in names}

    def refuse_others(self, functions: tuple[Callable[..., Any], ...], reason: str, remedy: str) -> None:
        """Refuse the first given key that none of these functions has, as "KEY reason; remedy"."""
        names = {entry.name_in_file for entry in keys_of(functions)}
        for name in self.given:
            if name not in names:
                self.place.within(name).refuse(f"{name} {reason}; {remedy}")

    def call(self) -> Callable[..., Any]:
        """The one of the functions whose keys are given, with these as its arguments; errors begin with the place."""
        function = self.functions[0] if len(self.functions) == 1 else self._chosen()
        with all_mistakes() as part:
            for entry in keys_of((function,)):
                if entry.is_required and entry.name_in_file not in self.given:
                    with part():
                        refuse_missing(entry, self.place)

        def called(*args: Any) -> Any:
            with self.place.prefix_errors():
                return function(*args, **self.of(function))

        return called

    def _chosen(self) -> Callable[..., Any]:
        """A table with keys of two functions is refused, or with none; keys that all functions have tell nothing."""
        ways = own_keys(self.functions)
        names = [[name for name in way if name in self.given] for way in ways]
        used = [(function, given) for function, given in zip(self.functions, names, strict=True) if given]
        choice = " or by ".join(" and ".join(filter(None, (", ".join(way[:-1]), way[-1]))) for way in ways)
        if not used:
            self.place.refuse(f"{self.place.table} is given by {choice}; give one of these")
        if len(used) > 1:
            # Fewer keys are given of the function that was not meant.
            odd = min(reversed(used), key=lambda pair: len(pair[1]))[1][0]
            self.place.within(odd).refuse(f"{self.place.table} is given by {choice}; keep one")
        return used[0][0]


def tables(table: Table, path: str = "") -> Iterator[tuple[str, Table]]:
    """Headings and declarations of a table and all tables in it, outer tables first, each declaration once."""
    by_table = {table: path}
    for entry in keys_of(table):
        inner, several = inner_table(entry)
        if inner is not None:
            name = ".".join(filter(None, (path.strip("[]"), entry.name_in_file)))
            for heading, nested in tables(inner, f"[[{name}]]" if several else f"[{name}]"):
                by_table.setdefault(nested, heading)
    yield from ((heading, declaration) for declaration, heading in by_table.items())


def inner_table(entry: Key) -> tuple[Table | None, bool]:
    """What declares the table that a key holds, if any, and whether the key may hold several."""
    kind, several = _table_in(entry.node)
    return (entry.says.functions if kind is Arguments else kind), several


def _table_in(node: Hint) -> tuple[type | None, bool]:
    if node.form == "record":
        return (node.kind if node.kind is Arguments or keys_of(node.kind) else None), False
    inner = [_table_in(part) for part in node.parts]
    kind = next((table for table, _ in inner if table is not None), None)
    return kind, node.form in ("fixed", "items") or any(several for _, several in inner)


def refuse_repeated(table: Any) -> None:
    """Refuse a name that stands twice in an array of a table."""
    for entry in fields(table):
        value = getattr(table, entry.name)
        for name in value if isinstance(value, tuple) else ():
            if isinstance(name, str) and value.count(name) > 1:
                raise InvalidSettingError(entry.name, f"{entry.name} has {name!r} twice; give each once")


def toml_value(value: Any) -> str:
    """TOML text of a value; a mapping becomes an inline table, a sequence an array."""
    if isinstance(value, bool | str):
        # JSON and TOML have the same escapes.
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{ " + ", ".join(toml_lines_of(value)) + " }" if value else "{}"
    if isinstance(value, Sequence):
        return "[" + ", ".join(toml_value(item) for item in value) + "]"
    return repr(value)


def toml_lines_of(table: Mapping[str, Any]) -> list[str]:
    """A line NAME = VALUE of TOML for each key of a table; a name that TOML does not take bare is quoted."""
    return [
        f"{name if re.fullmatch('[A-Za-z0-9_-]+', name) else toml_value(name)} = {toml_value(value)}"
        for name, value in table.items()
    ]


def toml_text(document: Mapping[str, Any]) -> str:
    """A document as TOML: its own keys, then its tables below their headings, and what is in these in their lines."""
    values, blocks = {}, []
    for name, value in document.items():
        several = isinstance(value, list) and all(isinstance(entry, dict) for entry in value)
        if not several and not isinstance(value, dict):
            values[name] = value
            continue
        heading = f"[[{name}]]" if several else f"[{name}]"
        blocks += [[heading, *toml_lines_of(entry)] for entry in (value if several else [value])]
    return "\n\n".join("\n".join(block) for block in [toml_lines_of(values), *blocks] if block) + "\n"
