"""Arguments of public functions, checked against the annotations that the functions have anyway.

`@checked` stands on functions, and on classes of data that users build, which it makes dataclasses. A number or an
array is finite unless its default is infinite or NaN, or its annotation says otherwise, as
`Annotated[ArrayLike, May.BE_NAN]`; a range is written `Annotated[float, Within(above=0.0)]`, or declared by the `key`
of a field. What must be above zero is at least 1e-100, so that its inverse and its square are finite. Lists become
tuples, and numbers become arrays, where the annotation says so. `Any` takes everything. A protocol is one that
`isinstance` may check. A class says in `_made_by` how a user gets one of its objects.

Every refusal has one form: the argument, what came, and what to give.
"""

from __future__ import annotations

import inspect
import math
import operator
import os
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from contextlib import suppress
from dataclasses import MISSING, dataclass, field, fields
from functools import wraps
from numbers import Real
from types import NoneType
from typing import Annotated, Any, ParamSpec, TypeVar, cast, dataclass_transform, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.docstrings import parameter_texts, with_parameters
from mrwork.base.hints import LARGEST, Hint, InUnit, Says, instead_of, nodes_of, note_of
from mrwork.base.hints import May as May
from mrwork.base.hints import Shape as Shape
from mrwork.base.hints import Within as Within
from mrwork.base.keys import Arguments, documented, keys_of, quote_value, suggestion
from mrwork.base.numbers import counted
from mrwork.base.units import number_in
from mrwork.base.values import Floats
from mrwork.errors import (
    ArgumentError,
    InvalidSettingError,
    MrworkError,
    Restorable,
    SettingError,
    UnknownChoiceError,
)

Positive = Annotated[float, Within(above=0.0)]
NotNegative = Annotated[float, Within(least=0.0)]
Share = Annotated[float, Within(least=0.0, most=1.0)]
# Of a band.
Level = Annotated[float, Within(above=0.0, below=1.0)]
Whole = Annotated[int, Within(least=0, most=2**63 - 1)]
Count = Annotated[int, Within(least=1, most=2**63 - 1)]
Seed = Annotated[int, Within(least=0, most=2**64 - 1)]
Threads = Annotated[
    int, Within(least=0, most=1024), Says("threads to use, 0 for all; they change no bit of the result")
]
# Misfits of failed candidates are infinite, and the functions say more of a wrong number than its place.
AnyNumbers = Annotated[Floats, May.BE_INFINITE, May.BE_NAN]
# A force, or a history of something else; draws or candidates in rows.
Samples = Annotated[Floats, Shape(("n_time",))]
Rows = Annotated[Floats, Shape(("n_batch", "n_time"))]
# Of NumPy or JAX.
AnyArray = Annotated[Any, May.BE_TRACED, May.BE_INFINITE, May.BE_NAN]
AnyArrayLike = Annotated[ArrayLike, May.BE_INFINITE, May.BE_NAN]

TargetT = TypeVar("TargetT", bound=Callable[..., Any])
Given = ParamSpec("Given")
Value = TypeVar("Value")
Result = TypeVar("Result")


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(field,))
def checked(target: TargetT) -> TargetT:
    """Check the arguments of a function, or of the constructor of a dataclass, before it runs.

    A class becomes a frozen, slotted, keyword-only dataclass, unless it is a dataclass already. An argument of another
    kind than its annotation, unknown, missing or by position where a name is wanted is an `ArgumentError`; a value out
    of its range, or not among those to choose from, a `SettingError`. The docstring has what the notes `Says` mean.
    """
    if isinstance(target, type):
        kind: Any = target
        if "__dataclass_fields__" not in vars(target):
            kind = dataclass(frozen=True, slots=True, kw_only=True)(target)
        kind.__init__ = _check_calls(kind.__init__, kind.__name__, kind)
        with suppress(NameError):
            kind.__doc__ = documented(kind, nodes_of(kind))
        return cast(TargetT, kind)
    # A method is named with its class, a constructor by its class, a function within a function by its own name.
    name = target.__qualname__.rpartition("<locals>.")[2].removesuffix(".__init__")
    return cast(TargetT, _check_calls(target, name))


def unchecked(function: TargetT) -> TargetT:
    """A `checked` function without its checks, for loops over arguments that have been checked before."""
    return cast(TargetT, vars(function)["__wrapped__"])


def replace_unchecked(value: Value, **changes: Any) -> Value:
    """A `checked` dataclass with other fields, without its checks, for loops over values that are known to be right."""
    same, kind = object.__new__(type(value)), cast(Any, value)
    given = {entry.name: getattr(value, entry.name) for entry in fields(kind) if entry.init}
    unchecked(type(kind).__init__)(same, **given | changes)
    return same


def takes_fields(
    kind: Callable[Given, Value],
) -> Callable[[Callable[[Value], Result]], Callable[Given, Result]]:
    """Let a function of one value, a dataclass, take the fields of this value as its checked arguments.

    The docstring of the function has the parameters of that class before its first section.
    """
    declaring: Any = kind
    hints = get_type_hints(declaring, include_extras=True)
    made = {
        entry.name: entry.default_factory
        for entry in fields(declaring)
        if entry.default_factory is not MISSING
    }
    # The annotations use names of the modules of the fields.
    parameters = [
        parameter.replace(annotation=hints[name], default=made[name]() if name in made else parameter.default)
        for name, parameter in inspect.signature(declaring).parameters.items()
    ]

    def decorated(function: Callable[[Value], Result]) -> Callable[Given, Result]:
        @wraps(function)
        def taking(*args: Given.args, **kwargs: Given.kwargs) -> Result:
            return function(kind(*args, **kwargs))

        said = parameter_texts(declaring)
        texts = {parameter.name: said[parameter.name] for parameter in parameters if parameter.name in said}
        order = [parameter.name for parameter in parameters]
        taking.__doc__ = with_parameters(function.__doc__ or "", texts, order)
        signature = inspect.signature(function).replace(parameters=parameters)
        taking.__signature__ = signature  # type: ignore[attr-defined] # `inspect` reads it, stubs lack it
        return checked(taking)

    return decorated


def _check_calls(function: Any, name: str, owner: type | None = None) -> Any:
    """The function with its arguments checked; a constructor takes the fields of its class, the `owner`."""
    signature = inspect.signature(function)
    parameters = signature.parameters
    by_place = [name for name, entry in parameters.items() if entry.kind is entry.POSITIONAL_OR_KEYWORD]
    is_plain = all(
        entry.kind in (entry.POSITIONAL_OR_KEYWORD, entry.KEYWORD_ONLY) for entry in parameters.values()
    )
    required = [
        parameter
        for parameter, entry in parameters.items()
        if entry.default is entry.empty and entry.kind is not entry.VAR_POSITIONAL
    ]
    declared: dict[str, Hint] = {}
    shapes: dict[str, Shape] = {}

    def read_annotations() -> None:
        declared.update(nodes_of(owner or function))
        shapes.update({name: shape for name, node in declared.items() if (shape := note_of(node, Shape))})

    # An annotation may name what is defined after the function; the first call reads it then.
    with suppress(NameError):
        read_annotations()

    @wraps(function)
    def checking(*args: Any, **kwargs: Any) -> Any:
        if not declared:
            read_annotations()
        values = dict(zip(by_place, args, strict=False)) | kwargs
        # The binding of the standard library takes longer than many a call.
        binds = is_plain and len(values) == len(args) + len(kwargs) and values.keys() <= parameters.keys()
        try:
            call = None if binds else signature.bind_partial(*args, **kwargs)
        except TypeError as reason:
            known = [parameter for parameter in parameters if parameter not in ("self", "cls")]
            if unknown := [word for word in kwargs if word not in parameters]:
                named = suggestion(unknown[0], known, otherwise="it takes")
                raise ArgumentError(f"{name} has no argument `{unknown[0]}`{named}") from None
            raise ArgumentError(f"{name} has {reason}; give each argument once, by name") from None
        values = values if call is None else call.arguments
        for parameter, value in values.items():
            if parameter in declared:
                try:
                    values[parameter] = accept(declared[parameter], value)
                except Refusal as refusal:
                    raise _error(parameter, name, refusal, owner) from None
        if missing := [f"`{parameter}`" for parameter in required if parameter not in values]:
            raise ArgumentError(f"{name} lacks {', '.join(missing)}; give {'them' if missing[1:] else 'it'}")
        if shapes:
            _check_shapes(shapes, name, values)
        return function(**values) if call is None else function(*call.args, **call.kwargs)

    checking.__doc__ = documented(function, declared)
    return checking


def _error(parameter: str, function: str, refusal: Refusal, owner: type | None = None) -> MrworkError:
    name = f"`{parameter}{''.join(f'[{key!r}]' for key in refusal.path)}`"
    sentence = f"{name} of {function} {refusal.in_words()}"
    is_setting = owner is not None and issubclass(refusal.error, SettingError)
    error = InvalidSettingError(parameter, sentence) if is_setting else refusal.error(sentence)
    error.key, error.in_a_file = parameter, f"{name} {refusal.in_words()}"
    return error


def _check_shapes(shapes: Mapping[str, Shape], function: str, values: Mapping[str, Any]) -> None:
    lengths: dict[str, int] = {}
    for parameter, shape in shapes.items():
        value = values.get(parameter)
        # A number may stand for an array where the annotation has both.
        if value is None or isinstance(value, int | float):
            continue
        came = np.shape(value)
        wanted = tuple(lengths.get(axis, length) for axis, length in zip(shape.axes, came, strict=False))
        if len(came) != len(shape.axes) or wanted != came:
            axes = (f"{axis} = {lengths[axis]}" if axis in lengths else axis for axis in shape.axes)
            end = f"; give shape ({', '.join(axes)})"
            refusal = Refusal(Hint(), value, f"has shape {came}", end, SettingError)
            raise _error(parameter, function, refusal)
        lengths |= zip(shape.axes, came, strict=True)


class Refusal(Restorable, Exception):  # noqa: N818 # becomes an error where the name of the argument is known
    """Refusal of a value that a node declares: what `came`, the `end` of the sentence, and the error to raise.

    By default the value is of another kind than the node, and another member of a union may accept it. The `path` leads
    to the value in the argument.
    """

    def __init__(
        self,
        node: Hint,
        value: object,
        came: str = "",
        end: str | None = None,
        error: type[MrworkError] = ArgumentError,
    ) -> None:
        super().__init__(node, value, came, end)
        self.is_other_kind, self.error, self.path = not came, error, tuple[Any, ...]()

    def in_words(self, *, in_file: bool = False) -> str:
        """What came and what to give, behind the name of the argument, or of the key `in_file`."""
        node, value, came, end = self.args
        quoted = "a table" if in_file and isinstance(value, dict) else quote_value(value)
        wanted = f"; give {hint_in_words(node, in_file=in_file)}" if end is None else end
        return f"{came or f'is {quoted}'}{wanted}"


def accept(node: Hint, value: Any, *key: Any) -> Any:
    """The value, converted to what the annotation declares; raises `Refusal` where it is something else.

    The `key`, if any, leads to the value in what is around it.
    """
    try:
        return _accepted(node, value)
    except Refusal as refusal:
        refusal.path = (*key, *refusal.path)
        raise


def _accepted(node: Hint, value: Any) -> Any:
    kind, parts = node.kind, node.parts
    match node.form:
        case "scalar" if kind in (int, float):
            return _number(node, value) if kind is float else _whole(node, value)
        case "scalar" | "record" | "instance":
            value = value.item() if isinstance(value, np.bool_) else value
            is_protocol = getattr(kind, "_is_protocol", False)
            if isinstance(value, kind) and not (is_protocol and isinstance(value, type)):
                return value
        case "array":
            return _array(node, value)
        case "enumerated":
            return _choice(node, value)
        case "items":
            return _sequence(node, value)
        case "fixed":
            listed = _listed(node, value)
            if len(listed) != len(parts):
                raise Refusal(node, value, f"has {len(listed)} values")
            pairs = enumerate(zip(parts, listed, strict=True))
            return tuple(accept(part, item, index) for index, (part, item) in pairs)
        case "by_name" if isinstance(value, Mapping):
            names, values = parts
            accepted = {accept(names, key, key): accept(values, item, key) for key, item in value.items()}
            return value if all(accepted[key] is value[key] for key in accepted) else accepted
        case "function" if callable(value):
            # Some compiled functions have no signature.
            with suppress(ValueError):
                try:
                    if kind[0] is not ...:
                        inspect.signature(value).bind(*kind[0])
                except TypeError:
                    raise Refusal(node, value, "is a function of other arguments") from None
            return value
        case "either" if value is None and kind is NoneType:
            return None
        case "either":
            refusals: list[Refusal] = []
            for part in parts:
                try:
                    return accept(part, value)
                except Refusal as refusal:
                    # Of a member of the kind of the value, or of what is in the value.
                    if refusal.path or not refusal.is_other_kind:
                        refusals.append(refusal)
            raise next(iter(refusals), Refusal(node, value))
        case "anything":
            return value
    raise Refusal(node, value)


def hint_in_words(node: Hint, *, in_file: bool = False, several: bool = False) -> str:
    """What an annotation takes, as "a number", or "anything" where no value is refused; in the plural for `several`.

    The words are for a document `in_file`, which holds no objects.
    """

    def noun(word: str, rest: str = "") -> str:
        return f"{word}s{rest}" if several else f"{'an' if word[0] in 'AEIOUaeiou' else 'a'} {word}{rest}"

    def words(part: Hint, several: bool = several) -> str:
        return hint_in_words(part, in_file=in_file, several=several)

    match node:
        case Hint("scalar", kind) if kind in _NOUNS:
            unit = note_of(node, InUnit)
            return noun(_NOUNS[kind], f" [{unit.unit}]" if unit and unit.unit not in ("", "1") else "")
        case Hint("scalar", kind):
            return "true or false" if kind is bool else "None"
        case Hint("enumerated", choices):
            return " or ".join(map(repr, choices))
        case Hint("array", kind):
            return noun("array", " of numbers" if kind in _NUMBERS else f" of {np.dtype(kind)}")
        case Hint("items", _, (item,)):
            items = words(item, several=True)
            alone = item.form == "items" or (in_file and item.form == "record")
            return items if alone else noun("row" if several else "list", f" of {items}")
        case Hint("fixed", _, parts):
            return f"{len(parts)} values: {', '.join(map(words, parts))}"
        case Hint("by_name", _, (_, value)):
            values = words(value, several=True)
            return noun("table" if in_file else "dict", "" if values == "anything" else f" of {values}")
        case Hint("either", _, parts):
            return " or ".join(filter(None, map(words, parts)))
        case Hint("record", kind) if in_file and (kind is Arguments or keys_of(kind)):
            return noun("table")
        case Hint("record" | "instance" | "function") if in_file:
            return ""
        case Hint("function", (takes, _)):
            return noun("function", "" if takes is ... else f" of {counted(len(takes), 'argument')}")
        case Hint("record" | "instance", kind):
            made = getattr(kind, "_made_by", "")
            return noun("path" if kind is os.PathLike else kind.__name__, made and f", made by {made}")
    return "anything"


_NOUNS = {float: "number", int: "whole number", str: "text"}


def _number(node: Hint, value: Any) -> Any:
    number = value.item() if isinstance(value, np.ndarray) and value.ndim == 0 else value
    unit = note_of(node, InUnit)
    symbol = unit.unit if unit else ""
    if isinstance(value, str) and symbol and (symbol != "1" or value.rstrip().endswith("%")):
        number = number_in(value, symbol)
        if isinstance(number, str):
            raise Refusal(node, value, number, "", SettingError)
    if not isinstance(number, Real) or isinstance(number, bool):
        raise Refusal(node, value)
    try:
        plain = float(number)
    except OverflowError:
        plain = math.inf
    if (node.notes or not abs(plain) <= LARGEST) and (wanted := instead_of(plain, node.notes)):
        raise Refusal(node, value, f"is {plain:g}", f"; give {wanted}", SettingError)
    exact = isinstance(number, float) or (isinstance(number, int) and abs(number) < 2**53)
    return number if exact and unit is None else plain


def _whole(node: Hint, value: Any) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        raise Refusal(node, value) from None
    if isinstance(value, bool | np.bool_):
        raise Refusal(node, value)
    if wanted := instead_of(number, node.notes):
        raise Refusal(node, value, f"is {quote_value(number)}", f"; give {wanted}", SettingError)
    return number


def _choice(node: Hint, value: Any) -> Any:
    # An array would be compared element by element, and 1 equals true.
    if any(type(value) is type(choice) and value == choice for choice in node.kind):
        return value
    texts = [choice for choice in node.kind if isinstance(choice, str)]
    if isinstance(value, str) and texts:
        raise Refusal(node, value, f"is {quote_value(value)}", suggestion(value, texts), UnknownChoiceError)
    raise Refusal(node, value)


_NUMBERS = (None, np.float64, np.complex128)
# Kinds of numbers that an array of each kind is made of.
_MADE_OF = {"f": "iuf", "i": "iu", "u": "iu", "c": "iufc", "b": "b"}


def _array(node: Hint, value: Any) -> Any:
    traced = node.kind is None and May.BE_TRACED in node.notes
    if traced and hasattr(value, "__array_namespace__") and not isinstance(value, np.ndarray | np.generic):
        return value
    scalar = np.dtype(node.kind or np.float64)
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise Refusal(node, value, "has masked values", "; fill them in or leave them out")
    try:
        array = np.asarray(value)
    except (ValueError, TypeError):
        raise Refusal(
            node, value, "is no array", f"; give {hint_in_words(node)} in rows of one length"
        ) from None
    # A text, a set or a dict is a single object to NumPy.
    if array.ndim == 0 and array.dtype.kind not in "biufc":
        raise Refusal(node, value)
    if array.size and array.dtype.kind not in _MADE_OF[scalar.kind]:
        raise Refusal(node, value, f"has values of type {array.dtype}")
    array = array if array.size else array.astype(scalar)
    # The limits are beyond single precision.
    size = np.abs(array.astype(np.float64) if array.dtype.itemsize < 8 else array)
    permitted = size <= LARGEST
    if node.notes and not permitted.all():
        permitted |= (May.BE_INFINITE in node.notes) & (size > LARGEST)
        permitted |= (May.BE_NAN in node.notes) & np.isnan(size)
    for note in node.notes:
        if isinstance(note, Within):
            permitted &= ~note.excludes(array)
    if not permitted.all():
        first = tuple(map(int, np.argwhere(~permitted)[0]))
        number, where = array[first].item(), f" at {first[0] if len(first) == 1 else first}" if first else ""
        end = f"; give {instead_of(number, node.notes)}"
        raise Refusal(node, array, f"is {number:g}{where}", end, SettingError)
    if node.kind is None and not traced:
        return value if isinstance(value, int | float | list | tuple) else array
    return array.astype(scalar, copy=False)


def _sequence(node: Hint, value: Any) -> Any:
    if node.kind is Iterable and isinstance(value, Iterable) and not isinstance(value, Sequence):
        if not isinstance(value, Set | Mapping):
            return value
        value = tuple(value)
    (of,) = node.parts
    # The rows of a matrix are items of their own where items are lists or arrays.
    rows = any(part.form in ("items", "fixed", "array") for part in (of, *of.parts))
    listed = _listed(node, value, most_axes=2 if rows else 1)
    items = [accept(of, item, index) for index, item in enumerate(listed)]
    return items if isinstance(listed, list) and node.kind is not tuple else tuple(items)


def _listed(node: Hint, value: Any, most_axes: int = 1) -> Any:
    if isinstance(value, np.ndarray) and 1 <= value.ndim <= most_axes and not np.ma.is_masked(value):
        return value.tolist()
    if isinstance(value, str | bytes) or not isinstance(value, Sequence):
        raise Refusal(node, value)
    return value if isinstance(value, list | tuple) else tuple(value)
