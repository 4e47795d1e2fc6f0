"""Arguments of public functions and methods, and of the dataclasses that users build, are checked before anything runs.

A public dataclass is built by users if a public function or such a class takes one, unless its `_made_by` names what
makes it.
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from dataclasses import is_dataclass
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from mrwork.base.arguments import Kind, kind_of, nodes_of
from mrwork.errors import ArgumentError, MrworkError

NAMESPACES: tuple[str, ...] = (
    "mrwork.dampers",
    "mrwork.dampers.design",
    "mrwork.records",
    "mrwork.motions",
    "mrwork.identification",
    "mrwork.uncertainty",
    "mrwork.search",
    "mrwork.dampers.simulation",
    "mrwork.store",
    "mrwork.buildings",
    "mrwork.control",
    "mrwork.closed_loop",
    "mrwork.study",
    "mrwork.tuning",
    "mrwork.report",
    "mrwork.twins",
    "mrwork",
)
# Nothing can be checked against these: anything at all, and type variables.
UNCHECKED = re.compile(r"\b(Any|object|T|StateT|Array)\b")
# NumPy arrays, or arrays that JAX traces.
TRACED = {"Noise.log_densities", "Iid.log_likelihood_of_sum", "Noise.log_likelihood_of_sum"}
# Called for each candidate, or with arrays that JAX traces, by functions that check.
INNER = re.compile(r"(\w+Settings|TuningObjective|SettingSpace)\.\w+|power|simulate")
_CALLED = re.compile(r"\bCallable\[.*\]|\bIterator\[.*\]")


class Nothing:
    """Of no kind that a function takes."""


def named() -> Iterator[tuple[str, Any]]:
    seen = set()
    for place in NAMESPACES:
        namespace = import_module(place)
        names = getattr(namespace, "__all__", None)
        for name in names or [each for each in vars(namespace) if each[0] != "_"]:
            found = getattr(namespace, name)
            home = str(getattr(found, "__module__", ""))
            inside = home.startswith("mrwork.") if names else home == place
            usable = isinstance(found, type) or inspect.isfunction(inspect.unwrap(found))
            if inside and usable and found not in seen:
                seen.add(found)
                yield f"{place}.{name}", found


def is_data(found: Any) -> bool:
    return isinstance(found, type) and is_dataclass(found)


def methods(of: type) -> Iterator[tuple[str, Any]]:
    for name, member in vars(of).items():
        function = getattr(member, "__func__", member)
        own = name == "__init__" and not is_dataclass(of)
        if (own or not name.startswith("_")) and inspect.isfunction(function):
            yield name, function


def functions() -> list[tuple[str, Any]]:
    found = []
    for name, target in named():
        if inspect.isfunction(target):
            found.append((name, target))
        elif isinstance(target, type) and not getattr(target, "_is_protocol", False):
            found += [(f"{name}.{own}", function) for own, function in methods(target)]
    return found


def built() -> dict[str, Any]:
    """The dataclasses that users build."""
    data = {target.__name__: (name, target) for name, target in named() if is_data(target)}
    taken = " ".join(
        _CALLED.sub("", str(each.annotation))
        for _, function in functions()
        for each in inspect.signature(function).parameters.values()
    )
    found: dict[str, Any] = {}
    asked = [taken]
    while asked:
        words = set(re.findall(r"\w+", asked.pop()))
        for short in sorted(words & set(data) - set(found)):
            name, target = data[short]
            made = getattr(target, "_made_by", "")
            if not made or made.startswith(f"{short}("):
                found[short] = (name, target)
                asked.append(" ".join(str(each) for each in target.__annotations__.values()))
    checked = {
        short: each for short, each in data.items() if hasattr(vars(each[1])["__init__"], "__wrapped__")
    }
    return dict((found | checked).values())


def public() -> list[Any]:
    targets = [*functions(), *built().items()]
    return [
        pytest.param(target, id=name)
        for name, target in targets
        if target.__qualname__ not in TRACED and not INNER.fullmatch(target.__qualname__) and kinds(target)
    ]


def kinds(target: Any) -> dict[str, Kind]:
    """What the parameters take; of a method without its object."""
    return {name: kind for name, kind in declared(target).items() if kind.words != "anything"}


def declared(target: Any) -> dict[str, Kind]:
    function = vars(target)["__init__"] if isinstance(target, type) else target
    owner = target if isinstance(target, type) else object
    nodes = nodes_of(inspect.unwrap(function), inspect.signature(target), owner)
    return {name: kind_of(node) for name, node in nodes.items()}


def shown(target: Any) -> str:
    return str(target.__qualname__).removesuffix(".__init__")


def called(target: Any, name: str, value: object) -> None:
    first = next(iter(inspect.signature(target).parameters))
    target(*([None] if first in ("self", "cls") else []), **{name: value})


@pytest.mark.parametrize("target", public())
def test_an_argument_of_another_kind_is_refused_by_its_name(target: Any) -> None:
    for name in kinds(target):
        with pytest.raises(ArgumentError) as refusal:
            called(target, name, Nothing())
        words = str(refusal.value)
        assert words.startswith(f"`{name}` of {shown(target)} is a Nothing; give "), words
        assert words.isprintable()


@pytest.mark.parametrize("target", public())
def test_a_number_that_is_not_finite_is_refused(target: Any) -> None:
    for name, each in inspect.signature(target).parameters.items():
        if each.annotation in ("float", "float | None", "ArrayLike") and each.default != np.inf:
            with pytest.raises(MrworkError, match=f"`{name}` of {shown(target)} is nan"):
                called(target, name, np.nan)


@pytest.mark.parametrize("target", public())
def test_what_takes_anything_says_so(target: Any) -> None:
    for name, kind in declared(target).items():
        annotation = str(inspect.signature(target).parameters[name].annotation)
        assert kind.words != "anything" or UNCHECKED.search(annotation), f"{name}: {annotation}"


def test_what_makes_an_object_exists() -> None:
    for _, target in named():
        made = getattr(target, "_made_by", "")
        if isinstance(target, type) and made.startswith("mr."):
            place: Any = import_module("mrwork")
            for word in re.match(r"[\w.]+", made)[0].split(".")[1:]:  # type: ignore[index] # the text matches
                place = getattr(place, word)
            assert callable(place), made
