"""Arguments of public functions, and of the dataclasses that users build, are checked before anything runs."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import is_dataclass
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from mrwork.errors import ArgumentError, MrworkError

NAMESPACES: tuple[str, ...] = ()
# Built by the package, never by a user.
RESULTS: frozenset[str] = frozenset()
# Nothing can be checked against these: anything at all, type variables, types of libraries that are loaded late.
UNCHECKED = re.compile(r"\b(Any|object|T|StateT|Array|Axes|Figure)\b")


class Nothing:
    """Of no kind that a function takes."""


def public() -> Iterator[Any]:
    seen = set()
    for place in NAMESPACES:
        namespace = import_module(place)
        for name in namespace.__all__:
            found = getattr(namespace, name)
            built = is_dataclass(found) and isinstance(found, type) and name not in RESULTS
            if (inspect.isfunction(found) or built) and found not in seen:
                seen.add(found)
                yield pytest.param(found, id=f"{place}.{name}")


def parameters(target: Any) -> list[inspect.Parameter]:
    found = inspect.signature(target).parameters.values()
    return [each for each in found if not UNCHECKED.search(str(each.annotation))]


@pytest.mark.parametrize("target", list(public()))
def test_an_argument_of_another_kind_is_refused_by_its_name(target: Any) -> None:
    for each in parameters(target):
        with pytest.raises(ArgumentError) as refusal:
            target(**{each.name: Nothing()})
        words = str(refusal.value)
        assert words.startswith(f"`{each.name}` of {target.__name__} is a Nothing; give "), words
        assert words.isprintable()


@pytest.mark.parametrize("target", list(public()))
def test_a_number_that_is_not_finite_is_refused(target: Any) -> None:
    for each in parameters(target):
        if each.annotation in ("float", "float | None", "ArrayLike") and each.default != np.inf:
            with pytest.raises(MrworkError, match=f"`{each.name}` of {target.__name__} is nan"):
                target(**{each.name: np.nan})
