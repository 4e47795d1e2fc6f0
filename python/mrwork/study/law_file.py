"""A control law of a study in a Python file of its user, which is run as Python when the study is read."""

from __future__ import annotations

import inspect
import sys
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from mrwork.closed_loop.user_code import Undone, in_words, place_of, place_raised
from mrwork.closed_loop.user_law import MOST_MEMORY, UserLaw
from mrwork.keys import Place, key, suggestion
from mrwork.store import digest_of
from mrwork.store.input_file import FileKind, text_of
from mrwork.study.declared import located

_PYTHON = FileKind(name="the Python file of a law", largest=1 << 20, remedy="give the Python file of the law")


@dataclass(frozen=True, slots=True, kw_only=True)
class LawFileTable:
    """A law in Python instead of one of the registry, slower; see `mr.closed_loop.UserLaw`.

    The file is run as Python when the study is read. It may import installed packages, but no other files: a study is
    resumed only if the text of this one is the same.
    """

    file: str = key("Python file of the law, relative to the study file")
    function: str = key("function in it, of a LoopSample and the memory, that returns the commands")
    memory: int = key(
        "numbers that each run keeps from sample to sample", default=0, least=0, most=MOST_MEMORY
    )
    place: Place


def running_in_words(table: LawFileTable, folder: Path) -> str:
    """Which file is about to run as Python, and which line of the study names it."""
    return f"{table.place.within('file')}: running {folder / table.file} as Python, for its function {table.function}"


def law_of_file(table: LawFileTable, folder: Path) -> UserLaw:
    """The law of a file, whose name is relative to `folder`."""
    name = table.function
    module, text = _run(table, folder / table.file)
    functions = [each for each, value in vars(module).items() if inspect.isfunction(value)]
    function = getattr(module, name, None)
    if not callable(function):
        near = suggestion(name, functions, otherwise="it has")
        table.place.within("function").refuse(f"{table.file} has no function {name!r}{near}")
    try:
        inspect.signature(function).bind(None, None)
    except TypeError:
        table.place.within("function").refuse(
            f"{name} ({place_of(function) or table.file}) does not take two arguments; write it as "
            f"def {name}(sample, memory)"
        )
    except ValueError:
        # A function of a compiled module may tell no arguments.
        pass
    with located(table.place.within("function")):
        return UserLaw(name=name, command=function, n_memory=table.memory, source=digest_of(text))


def _run(table: LawFileTable, path: Path) -> tuple[ModuleType, str]:
    """The file as a module, and its text."""
    where = table.place.within("file")
    with located(where):
        text = text_of(path, _PYTHON)
    module: Any = ModuleType(f"mrwork_law_{digest_of(text)}")
    module.__file__ = str(path)
    # Dataclasses look for the module of their class.
    sys.modules[module.__name__] = module
    try:
        with Undone():
            exec(compile(text, str(path), "exec"), vars(module))
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        raised = place_raised(error, str(path)) or str(path)
        where.refuse(f"{raised} failed when the file was run: {in_words(error)}; correct it")
    return module, text
