"""Parameters of functions, declared once: their texts in docstrings, and functions that take the fields of a value."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import MISSING, fields
from functools import cache, wraps
from textwrap import dedent
from typing import Any, ParamSpec, TypeVar, get_type_hints

from mrwork.base.arguments import checked
from mrwork.base.docstrings import PARAMETERS, SECTION, with_parameters

Given = ParamSpec("Given")
Value = TypeVar("Value")
Result = TypeVar("Result")

# One or several names, and the indented lines below them.
_ENTRY = re.compile(r"^(\w+(?:, \w+)*)\n((?:(?: +.*)?\n)+)", re.MULTILINE)


@cache
def parameter_texts(declaring: Any) -> dict[str, str]:
    """What the docstring of a function, or of a dataclass and its bases, says of each parameter."""
    if isinstance(declaring, type):
        bases = [each for each in reversed(declaring.__mro__) if each is not object]
        return {name: text for base in bases for name, text in _texts_in(base.__doc__).items()}
    return _texts_in(declaring.__doc__)


def _texts_in(docstring: str | None) -> dict[str, str]:
    _, _, below = inspect.cleandoc(docstring or "").partition(PARAMETERS)
    section = SECTION.split(f"{below}\n", maxsplit=1)[0]
    return {
        name: dedent(text).strip() for names, text in _ENTRY.findall(section) for name in names.split(", ")
    }


def takes_fields(
    kind: Callable[Given, Value],
) -> Callable[[Callable[[Value], Result]], Callable[Given, Result]]:
    """Let a function of one value, a dataclass, take the fields of this value as its checked arguments.

    The docstring of the function has the parameters of that class before its first section.
    """
    declaring: Any = kind
    hints = get_type_hints(declaring, include_extras=True)
    made = {
        each.name: each.default_factory for each in fields(declaring) if each.default_factory is not MISSING
    }
    # Names in the annotations are those of the modules of the fields.
    parameters = [
        each.replace(annotation=hints[name], default=made[name]() if name in made else each.default)
        for name, each in inspect.signature(declaring).parameters.items()
    ]

    def decorated(function: Callable[[Value], Result]) -> Callable[Given, Result]:
        @wraps(function)
        def taking(*args: Given.args, **given: Given.kwargs) -> Result:
            return function(kind(*args, **given))

        texts = parameter_texts(declaring)
        taking.__doc__ = with_parameters(
            function.__doc__ or "", {each.name: texts[each.name] for each in parameters}
        )
        taking.__signature__ = inspect.signature(function).replace(parameters=parameters)  # type: ignore[attr-defined]
        return checked(taking)

    return decorated
