"""Public functions, methods and classes of data with one wrong argument: of another kind, shape, size, range or name.

What its annotation excludes is refused by an error of ours that names the argument and says what to give. Any other
call ends in an error of ours in one printable line, or in a result, and soon.
"""

import inspect
import re
import signal
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import is_dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
import pytest

from mrwork.base.arguments import Refusal, accept, hint_in_words
from mrwork.base.hints import Hint, nodes_of
from mrwork.errors import ArgumentError, MistakesError, MrworkError
from tests.contract import valid_calls_dampers, valid_calls_fits, valid_calls_loop
from tests.contract.wrong_arguments import Calls, Nothing, ValidCall, wrong

NAMESPACES = (
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
TRACED = {"Iid.log_densities", "Iid.log_likelihood_of_sum"}
# Called for each candidate, or with arrays that JAX traces, by functions that check.
INNER = re.compile(r"(\w+Settings|TuningObjective|SettingSpace|MRFluid|Steel)\.\w+|power|simulate")
_CALLED = re.compile(r"\bCallable\[.*\]|\bIterator\[.*\]")
REMEDY = re.compile(r"give|choose|did you mean|fill|leave")


# What is public


def named(namespaces: Iterable[str] = NAMESPACES) -> Iterator[tuple[str, Any]]:
    seen = set()
    for place in namespaces:
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


def methods(of: type) -> Iterator[tuple[str, Any]]:
    for name, member in vars(of).items():
        function = getattr(member, "__func__", member)
        own = name == "__init__" and not is_dataclass(of)
        if (own or not name.startswith("_")) and inspect.isfunction(function):
            yield name, function


def functions() -> Iterator[tuple[str, Any]]:
    for name, target in named():
        if inspect.isfunction(target):
            yield name, target
        elif isinstance(target, type) and not getattr(target, "_is_protocol", False):
            yield from ((f"{name}.{own}", function) for own, function in methods(target))


def built() -> Iterator[tuple[str, Any]]:
    """Data classes that users build: a public function or such a class takes one, and no `_made_by` says otherwise."""
    data = {
        each.__name__: (name, each) for name, each in named() if isinstance(each, type) and is_dataclass(each)
    }
    parameters = [each for _, one in functions() for each in inspect.signature(one).parameters.values()]
    asked = [_CALLED.sub("", str(each.annotation)) for each in parameters]
    found = {short for short, (_, kind) in data.items() if hasattr(vars(kind)["__init__"], "__wrapped__")}
    while asked:
        for short in (set(re.findall(r"\w+", asked.pop())) & set(data)) - found:
            made = getattr(data[short][1], "_made_by", "")
            if not made or made.startswith(f"{short}("):
                found.add(short)
                asked += [str(each) for each in data[short][1].__annotations__.values()]
    yield from (data[short] for short in sorted(found))


def checked_parameters(target: Any) -> dict[str, Hint]:
    """Those of the parameters that are checked against their annotation."""
    return {name: node for name, node in nodes_of(target).items() if hint_in_words(node) != "anything"}


PUBLIC = [
    pytest.param(target, id=name)
    for name, target in [*functions(), *built()]
    if target.__qualname__ not in TRACED
    and not INNER.fullmatch(target.__qualname__)
    and checked_parameters(target)
]


def called(target: Any, name: str, value: object) -> None:
    first = next(iter(inspect.signature(target).parameters))
    target(*([None] if first in ("self", "cls") else []), **{name: value})


def excludes(node: Hint | None, value: Any) -> bool:
    try:
        if node is not None:
            accept(node, value)
    except Refusal:
        return True
    return False


NOTHING = Nothing()
ODD = (
    *(NOTHING, "x\x1b\n", b"x", None, int, [], {}, 1j, True, -1, 0, 0.5, 1e308, 1e-300, np.nan, np.inf),
    *(2**70, 10**400, np.array([[1.0]]), np.array([np.nan]), np.array(["x"]), np.datetime64("2020-01-01")),
)


@pytest.mark.parametrize("target", PUBLIC)
def test_what_an_annotation_excludes_is_refused_with_the_argument_and_a_remedy(target: Any) -> None:
    for name, node in nodes_of(target).items():
        parameter = inspect.signature(target).parameters[name]
        if hint_in_words(node) == "anything":
            assert UNCHECKED.search(str(parameter.annotation)), f"{name} takes anything and does not say so"
            continue
        finite = (
            parameter.annotation in ("float", "float | None", "ArrayLike") and parameter.default != np.inf
        )
        for value in ODD:
            if value is NOTHING or (value is np.nan and finite) or excludes(node, value):
                with pytest.raises(ArgumentError if value is NOTHING else MrworkError) as refused:
                    called(target, name, value)
                told = str(refused.value)
                assert f"`{name}" in told, told
                assert REMEDY.search(told), told
                assert told.isprintable(), ascii(told)


def test_what_makes_an_object_exists() -> None:
    for _, target in named():
        made = getattr(target, "_made_by", "")
        if isinstance(target, type) and made.startswith("mr."):
            place: Any = import_module("mrwork")
            for word in re.match(r"[\w.]+", made)[0].split(".")[1:]:
                place = getattr(place, word)
            assert callable(place), made


# Valid calls that are made wrong

ROOMS = (*valid_calls_dampers.ROOMS, *valid_calls_fits.ROOMS, *valid_calls_loop.ROOMS)
# A refusal takes milliseconds; what takes this long would run for hours.
SECONDS = 20.0


@contextmanager
def soon() -> Iterator[None]:
    def late(*_: object) -> None:
        raise TimeoutError(f"longer than {SECONDS:g} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.setitimer(signal.ITIMER_REAL, SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def checked_kinds(function: Any) -> dict[str, Hint]:
    checks = vars(function)["__init__"] if isinstance(function, type) else function
    return checked_parameters(function) if hasattr(checks, "__wrapped__") else {}


def complaint(valid: ValidCall, argument: str, value: Any, node: Hint | None) -> str:
    """What is wrong with how the call ends that has another value of an argument; empty where nothing is."""
    excluded = excludes(node, value)
    try:
        with soon():
            valid.function(**{**valid.arguments, argument: value})
    except MrworkError as error:
        # Of several mistakes of a study each has a line.
        lines = error.mistakes if isinstance(error, MistakesError) else (error,)
        printable = all(str(each).isprintable() for each in lines)
        names = not excluded or (f"`{argument}" in str(error) and REMEDY.search(str(error)))
        return "" if printable and names else f"not one line with the argument and a remedy: {error!r}"
    except Exception as error:
        return repr(error)
    return "accepted, though its annotation excludes it" if excluded else ""


@pytest.mark.parametrize("room", ROOMS, ids=lambda room: room.__name__)
def test_a_wrong_argument_is_refused_or_accepted_soon(
    room: Callable[[Path], Calls], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    broken = []
    with warnings.catch_warnings():
        # Absurd numbers overflow.
        warnings.simplefilter("ignore")
        for valid in room(tmp_path):
            valid.function(**valid.arguments)
            kinds = checked_kinds(valid.function)
            for argument, value in valid.arguments.items():
                broken += [
                    f"{valid.name}: `{argument}`, {ascii(other)[:60]}: {found}"
                    for other in wrong(value)
                    if (found := complaint(valid, argument, other, kinds.get(argument)))
                ]
    plt.close("all")
    assert not broken, "\n".join(broken)
