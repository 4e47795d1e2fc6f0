"""Options that are parameters of functions, or fields of settings: kind, range, default and help are those declared.

The help is what the note `Says` of the annotation means, or the first sentence that the docstring has of the parameter.
What a text becomes is what the annotation says: a number of its range, one of several words, a flag, a list by
repetition, or by commas where it is of numbers, and a mapping by repeated NAME=VALUE. Of a function whose module is
slow to load the option has the annotation of the parameter alone.
"""

from __future__ import annotations

import argparse
import inspect
import re
from collections.abc import Callable, Collection
from dataclasses import MISSING, dataclass, fields, replace
from functools import partial
from typing import Annotated, Any, get_origin

from mrwork.base.docstrings import parameter_texts
from mrwork.base.hints import Hint, Says, node_of, nodes_of, note_of
from mrwork.cli.command_parser import CommandParser
from mrwork.cli.number_texts import Listed, Range, finite_number
from mrwork.errors import MrworkError

Declaring = object

_FIRST_SENTENCE = re.compile(r".*?(?=(?<!\.)\.(?:\s|$)|$)", re.DOTALL)
# Options that are not called as the parameter.
_CALLED = {"rng": "seed"}
_DERIVED = "derived"
UNCHANGED: Any = object()
"""The default of a parameter."""


def add_options_of(parser: CommandParser, declaring: Declaring, title: str, *names: str) -> None:
    """Declare options for parameters of a function, or fields of a class, in the group of this title."""
    for name in names:
        add_option_of(parser, declaring, title, name)


def add_option_of(
    parser: CommandParser,
    declaring: Declaring,
    title: str,
    name: str,
    option: str = "",
    *,
    default: Any = UNCHANGED,
    choices: Collection[str] = (),
    reads: Callable[[str], Any] | None = None,
    metavar: str | None = None,
    more: str = "",
) -> None:
    """Declare the option for one parameter, called `option` where that is another word; or for an annotation.

    The `default` may be another; `choices` are words for a text, or further words for a list of words; `reads` makes
    the value from a text that the annotation does not describe, as an object; and `more` is added to the help.
    """
    node, own_default, text = _declared(declaring, name)
    form = _form_of(node, reads)
    if form is None:
        raise TypeError(f"no text stands for `{name}`; say how one is read")
    option = option or _CALLED.get(name) or (name.removesuffix("s") if form.repeated else name)
    listed = f"one of {', '.join(choices)}" if metavar and choices and not form.repeated else ""
    parser.option(
        title,
        f"--{option.replace('_', '-')}",
        "; ".join(filter(None, (_as_help(text), listed, more))),
        form.reads,
        metavar=metavar or form.metavar,
        default=own_default if default is UNCHANGED else default,
        dest=name,
        choices=[*form.choices, *choices] or None,
        repeated=form.repeated,
    )
    if _is_annotation(declaring):
        return
    derived = parser.get_default(_DERIVED) or {}
    parser.set_defaults(**{_DERIVED: derived | {declaring: (*derived.get(declaring, ()), name)}})


def arguments_of(options: argparse.Namespace, declaring: Declaring) -> dict[str, Any]:
    """The arguments of a function that the command line gives."""
    return {name: getattr(options, name) for name in getattr(options, _DERIVED)[declaring]}


def _is_annotation(declaring: object) -> bool:
    return get_origin(declaring) is Annotated


def _declared(declaring: Any, name: str) -> tuple[Hint, Any, str]:
    """Annotation, default and text of a parameter."""
    node = node_of(declaring) if _is_annotation(declaring) else nodes_of(declaring)[name]
    says = note_of(node, Says)
    text = parameter_texts(declaring)[name] if says is None else says.words
    if _is_annotation(declaring):
        return node, None, text
    if isinstance(declaring, type):
        (field,) = (entry for entry in fields(declaring) if entry.name == name)
        made = field.default_factory
        return node, field.default if made is MISSING else made(), text
    return node, inspect.signature(declaring).parameters[name].default, text


def _as_help(text: str) -> str:
    (first,) = re.findall(_FIRST_SENTENCE, " ".join(text.split()))[:1]
    plain: str = first.replace("`", "")
    return plain[0].lower() + plain[1:] if plain[1:2].islower() else plain


@dataclass(frozen=True, slots=True, kw_only=True)
class _Form:
    """How a text is read, and whether the option may be repeated."""

    reads: Callable[[str], Any] | None = None
    choices: tuple[str, ...] = ()
    metavar: str | None = None
    repeated: bool = False


def _form_of(node: Hint, reads: Callable[[str], Any] | None) -> _Form | None:
    """The form of what an annotation declares; `None` where no text stands for it."""
    match node:
        case Hint("by_name", _, (_, value)):
            read, shape = (reads, "VALUE") if reads is not None else _entry_of(value)
            return _Form(reads=partial(read_entry, read, shape), metavar=f"NAME={shape}", repeated=True)
        case Hint("items", _, (Hint("scalar", kind) as item,)) if kind in (int, float):
            return _Form(reads=Listed(Range.of(item)), metavar="LIST")
        case Hint("items", _, (item,)):
            inner = _form_of(item, reads)
            return None if inner is None else replace(inner, repeated=True)
        case Hint("either"):
            forms = [form for part in node.parts if (form := _form_of(part, reads)) is not None]
            words = [word for form in forms for word in form.choices]
            numbers = [form.reads for form in forms if isinstance(form.reads, Range)]
            if words and numbers:
                return _Form(reads=replace(numbers[0], word=words[0]))
            return next((form for form in forms if form.repeated), next(iter(forms), None))
        case Hint("enumerated", choices):
            return _Form(choices=choices)
        case Hint("scalar", kind) if kind is bool:
            return _Form(reads=bool)
        case Hint("scalar", kind) if kind in (int, float):
            number = Range.of(node)
            return _Form(reads=number, metavar=number.metavar)
        case Hint("scalar"):
            return _Form(metavar="NAME")
    return None if reads is None else _Form(reads=reads, metavar="VALUE")


def read_entry(reads: Callable[[str], Any], form: str, text: str) -> tuple[str, Any]:
    """Name and value of NAME=VALUE."""
    name, _, value = (part.strip() for part in text.partition("="))
    if not name or not value or (":" in form and ":" not in value):
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME={form}; write it so")
    try:
        return name, reads(value)
    except MrworkError as refusal:
        raise argparse.ArgumentTypeError(str(refusal)) from None


def ends_of(text: str) -> tuple[float, float]:
    """The two numbers of LOWER:UPPER."""
    lower, _, upper = text.partition(":")
    return finite_number(lower), finite_number(upper)


def _entry_of(value: Hint) -> tuple[Callable[[str], Any], str]:
    if value.form in ("fixed", "items"):
        return ends_of, "LOWER:UPPER"
    return (finite_number, "NUMBER") if value.kind is float else (str, "VALUE")
