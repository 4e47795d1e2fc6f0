"""Every error of the package pickles and copies, as a pool of processes needs: type, text and attributes."""

import copy
import importlib
import inspect
import pickle
import pkgutil
from collections.abc import Iterator
from typing import Any

import pytest

import mrwork
from mrwork import errors
from mrwork.errors import Interrupted, MrworkError, RecordError


def classes_of_the_package() -> Iterator[type]:
    for found in pkgutil.walk_packages(mrwork.__path__, "mrwork."):
        if found.name.endswith("__main__"):
            continue
        module = importlib.import_module(found.name)
        yield from (
            each for each in vars(module).values() if isinstance(each, type) and each.__module__ == found.name
        )


ERRORS = {
    f"{each.__module__}.{each.__name__}": each
    for each in classes_of_the_package()
    if issubclass(each, BaseException)
}
# What a constructor takes, by the name of the argument; a text for any other.
GIVEN: dict[str, Any] = {
    "kind": RecordError,
    "error": RecordError,
    "stopped": True,
    "mistakes": (RecordError("the mass is 0"),),
}


def an_error(kind: type[BaseException]) -> BaseException:
    """An error as the package raises it, with attributes and a note."""
    if not inspect.isfunction(kind.__init__):
        made = kind("no file of that name; check it")
    else:
        given: dict[str, Any] = {}
        words: list[Any] = []
        for name, each in inspect.signature(kind).parameters.items():
            if each.kind is each.KEYWORD_ONLY:
                given[name] = GIVEN.get(name, name)
            elif each.kind is each.POSITIONAL_OR_KEYWORD:
                words.append(GIVEN.get(name, name))
        made = kind(*words, **given)
    if isinstance(made, MrworkError):
        made.document, made.key, made.in_a_file = "a.toml", "mass", "a.toml: the mass is 0"
    made.add_note("run the same command with --resume to continue")
    return made


def facts_of(error: BaseException) -> tuple[object, ...]:
    # Errors in an error are other objects afterwards, which are the same in writing; Dask, where a test has loaded it,
    # pickles attributes in another order.
    attributes = repr(sorted(vars(error).items()))
    return type(error), str(error), repr(error.args), attributes, getattr(error, "stopped", None)


def test_the_walk_finds_the_errors() -> None:
    assert {f"mrwork.errors.{name}" for name in errors.__all__} <= ERRORS.keys()
    assert "mrwork.base.arguments.Refusal" in ERRORS


@pytest.mark.parametrize("name", ERRORS)
def test_an_error_is_the_same_after_pickling_and_copying(name: str) -> None:
    error = an_error(ERRORS[name])
    for protocol in range(pickle.HIGHEST_PROTOCOL + 1):
        assert facts_of(pickle.loads(pickle.dumps(error, protocol))) == facts_of(error)
    assert facts_of(copy.copy(error)) == facts_of(error)
    assert facts_of(copy.deepcopy(error)) == facts_of(error)


def test_an_interrupt_says_in_another_process_that_a_callback_has_ended_the_run() -> None:
    interrupt: Interrupted[int] = Interrupted(3, "fit")
    interrupt.__cause__ = Interrupted(2, "search", stopped=True)
    read = pickle.loads(pickle.dumps(interrupt))
    assert (str(read), read.result, read.stopped) == ("fit interrupted", 3, True)
