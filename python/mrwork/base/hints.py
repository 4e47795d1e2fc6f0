"""What the annotation of a value declares, as a tree of nodes.

Checks of arguments, readers of documents and readers of stored JSON walk these trees; no other module takes an
annotation apart. The notes of an annotation, such as `Annotated[float, Within(above=0.0)]`, hold for all numbers in it.
An annotation of an unknown form is a `TypeError`.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum, auto
from functools import cache
from types import NoneType, SimpleNamespace, UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

# Products of three numbers up to this size are finite, and so are products of their inverses.
LARGEST = 1e100
SMALLEST = 1.0 / LARGEST
"""Least positive number of a quantity that is divided by, or of which the logarithm or the square is taken."""

NOTES = "notes"
"""Name of the notes in the metadata of a field, which hold beside the notes of its annotation."""


class May(Enum):
    """Numbers that are not finite, and nevertheless mean something where an annotation names them; arrays of JAX."""

    BE_INFINITE = auto()
    BE_NAN = auto()
    BE_TRACED = auto()


@dataclass(frozen=True, slots=True)
class Shape:
    """Names of the axes of an array; an axis has the same length in all arguments of a call that name it."""

    axes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class InUnit:
    """Unit of a number, for which a text may have another, as "2 mm"; "1" without one, empty where no text may."""

    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Within:
    """Range of a number, or of every number of an array."""

    least: float = -math.inf
    above: float = -math.inf
    most: float = math.inf
    below: float = math.inf

    @property
    def in_words(self) -> str:
        """The range as a message states it."""
        if math.isfinite(self.least) and math.isfinite(self.most):
            return f"from {_end(self.least)} to {_end(self.most)}"
        ends = {"at least": self.least, "above": self.above, "at most": self.most, "below": self.below}
        return " and ".join(f"{word} {_end(end)}" for word, end in ends.items() if math.isfinite(end))

    def excludes(self, values: Any) -> Any:
        """Which numbers lie outside; NaN does not. What must be positive may be divided by, and squared."""
        return (
            (values < self.least)
            | (values <= self.above) & (self.above > -math.inf)
            | (values < SMALLEST) & (self.above == 0.0)
            | (values > self.most) | (values >= self.below) & (self.below < math.inf)
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Says:
    """What an argument or a field means, which makes it a key of documents, and how a document has it.

    A number with a `unit` of SI may be a text with another unit in a document; a number beyond the `usual`,
    of an array the largest, is asked about. `span` is the range in which a search looks for it. A number that counts
    `from_one` in a document counts from 0 in Python; `named` is the name in a document, where it is another one.
    `matrix` permits a matrix, also as the name of a text file with it. A text that may name a `file` is relative to the
    folder of the document. The table of a key with `functions` holds arguments of one or several of these.
    """

    words: str
    unit: str = ""
    usual: tuple[float, float] | None = None
    span: Any = None
    from_one: bool = False
    named: str = ""
    matrix: bool = False
    file: bool = False
    functions: tuple[Callable[..., Any], ...] = ()


def _end(value: float) -> str:
    return str(value) if isinstance(value, int) or float(f"{value:g}") != value else f"{value:g}"


Notes = tuple[Any, ...]
# Whole numbers without an upper limit of their own, and numbers that are not to be infinite.
_WORD, _FINITE = Within(least=-(2**63), most=2**63 - 1), Within(least=-LARGEST, most=LARGEST)


def instead_of(value: float, notes: Notes) -> str:
    """What to give instead of a number that notes exclude, as "a number above 0"; empty for one that they permit."""
    whole, may_be_infinite = isinstance(value, int), May.BE_INFINITE in notes
    if (value != value and May.BE_NAN not in notes) or (abs(value) == math.inf and not may_be_infinite):
        return "a finite number"
    ranges = [note for note in notes if isinstance(note, Within)]
    if whole and all(within.most == math.inf for within in ranges):
        ranges.append(_WORD)
    if not whole and not may_be_infinite:
        ranges.append(_FINITE)
    for within in ranges:
        if within.excludes(value):
            is_small = within.above == 0.0 < value < SMALLEST
            words = f"of at least {SMALLEST:g}" if is_small else within.in_words
            return f"a {'whole ' * whole}number {words}"
    return ""


NoteT = TypeVar("NoteT")

Form = Literal[
    "anything", "scalar", "enumerated", "array", "fixed", "items", "by_name", "record", "instance", "function", "either"
]  # fmt: skip


@dataclass(frozen=True, slots=True)
class Hint:
    """What an annotation declares: its form, what the `kind` is then, and the `parts` of a container.

    "anything" cannot be checked, such as `Any`; a "scalar" is a number, flag, text or `None` of this class, and an
    "enumerated" value is in its kind. An "array" has this kind of numbers, and is also what NumPy turns into one where
    that is `None`. A "fixed" tuple has an item of each part, "items" are any number of one part, and values "by_name"
    have nodes of names and of values. A "record" is a dataclass, with `nodes_of` its fields, an "instance" of another
    class. A "function" has the list of what it takes, or an ellipsis, and what it returns. "either" is one of the
    parts, also `None` where that is its kind.
    """

    form: Form = "anything"
    kind: Any = object
    parts: tuple[Hint, ...] = ()
    notes: Notes = ()


def resolved(hint: Any) -> Any:
    """The annotation that an alias of PEP 695 stands for, with its arguments; others as they are."""
    alias, arguments = get_origin(hint) or hint, get_args(hint)
    if not hasattr(alias, "__value__"):
        return hint
    return resolved(alias.__value__[arguments] if arguments else alias.__value__)


def _members(hint: Any) -> Iterator[Any]:
    """Members of a union and of the unions and aliases among them."""
    hint = resolved(hint)
    if get_origin(hint) in (Union, UnionType):
        for member in get_args(hint):
            yield from _members(member)
    else:
        yield hint


# An alias or a union, which changes with the version of NumPy.
_ARRAY_LIKE = frozenset(_members(ArrayLike))


def node_of(hint: Any, notes: Notes = ()) -> Hint:
    """What an annotation declares, with the notes of those around it."""
    hint = resolved(hint)
    origin, inner = get_origin(hint), get_args(hint)
    if origin is Annotated:
        return node_of(inner[0], (*notes, *inner[1:]))
    if origin in (Union, UnionType):
        members = dict.fromkeys(_members(hint))
        takes_arrays = members.keys() >= _ARRAY_LIKE
        others = [member for member in members if not (takes_arrays and member in _ARRAY_LIKE)]
        parts = [node_of(other, notes) for other in others if other is not NoneType]
        # NumPy makes an array of what other members are meant for.
        parts.sort(key=lambda part: part.form == "array")
        parts += [Hint("array", None, (), notes)] * takes_arrays
        return Hint("either", NoneType if NoneType in members else object, tuple(parts), notes)
    if origin is Literal:
        return Hint("enumerated", inner, (), notes)
    if origin is np.ndarray:
        # NDArray[T] is ndarray[shape, dtype[T]].
        return Hint("array", get_args(inner[1])[0], (), notes)
    if hint in (float, int, bool, str, NoneType):
        return Hint("scalar", hint, (), notes)
    if hint is Any and May.BE_TRACED in notes:
        return Hint("array", None, (), notes)
    kind: Any = origin or hint
    if kind in (Any, object):
        return Hint(notes=notes)
    if isinstance(kind, TypeVar):
        return node_of(kind.__bound__ or object, notes)
    if not isinstance(kind, type):
        raise TypeError(
            f"the annotation {hint!r} is of a form that `node_of` does not know; add the form, or use Any"
        )
    if is_dataclass(kind):
        return Hint("record", kind, (), notes)
    if kind is Callable:
        return Hint("function", inner or (..., Any), (), notes)
    if issubclass(kind, Mapping):
        name, value = inner or (Any, Any)
        return Hint("by_name", kind, (node_of(name), node_of(value, notes)), notes)
    if kind is tuple and inner and inner[1:] != (...,):
        return Hint("fixed", kind, tuple(node_of(entry, notes) for entry in inner), notes)
    if inner and (kind is Iterable or issubclass(kind, Sequence)):
        if get_origin(inner[0]) in (tuple, Sequence):
            # A range holds for numbers and arrays of numbers, but not for entries beside the diagonal of a matrix.
            notes = tuple(note for note in notes if not isinstance(note, Within))
        return Hint("items", kind, (node_of(inner[0], notes),), notes)
    return Hint("instance", kind, tuple(map(node_of, inner)), notes)


def note_of(node: Hint, kind: type[NoteT], *, inside: bool = False) -> NoteT | None:
    """The first note of a kind that an annotation has, or a member of a union, or with `inside` any part of it."""
    notes = (note for note in node.notes if isinstance(note, kind))
    parts = node.parts if inside or node.form == "either" else ()
    further = (note_of(part, kind, inside=inside) for part in parts)
    return next(notes, None) or next(filter(None, further), None)


@cache
def nodes_of(declaring: Any) -> Mapping[str, Hint]:
    """What a function declares of each parameter, or a dataclass of each field: by annotation, default and `key`."""
    if isinstance(declaring, type):
        hints = get_type_hints(declaring, include_extras=True)
        entries = {
            entry.name: (entry.default, entry.metadata.get(NOTES, ()))
            for entry in fields(declaring)
            if entry.init
        }
    else:
        parameters = inspect.signature(declaring).parameters
        entries = {
            name: (parameter.default, ())
            for name, parameter in parameters.items()
            if parameter.annotation is not parameter.empty and parameter.kind is not parameter.VAR_KEYWORD
        }
        # Without what the function returns, which may be a name for the type checker only.
        annotated = SimpleNamespace(__annotations__={name: parameters[name].annotation for name in entries})
        hints = get_type_hints(annotated, inspect.unwrap(declaring).__globals__, include_extras=True)
    declared = {}
    for name, (default, notes) in entries.items():
        # Numbers may be infinite or NaN where the default is.
        if isinstance(default, float) and not math.isfinite(default):
            notes = (*notes, May.BE_NAN if math.isnan(default) else May.BE_INFINITE)
        declared[name] = node_of(hints[name], notes)
    return declared
