"""Entries: files of one function, how they are loaded, and what becomes of one that fails or takes too long."""

from __future__ import annotations

import importlib.util
import inspect
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType, ModuleType
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import ArrayLike

import mrwork as mr
from mrwork.errors import SettingError
from studies.former.arrays import Floats

# What the functions of entries are given.
Tests = Sequence[mr.DamperTest]
Motions = Sequence[mr.GroundMotion]
Rng = np.random.Generator
Predict = Callable[[mr.DamperTest], Floats]
"""Gives the force of a test, as its rig would record it [N], shape (n_time,)."""

HERE = Path(__file__).parent
LIMIT = 600.0
"""Longest time of a row [s]."""

ScoreT = TypeVar("ScoreT")


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A table's entries: their folder, and the function that each defines with the names of its arguments."""

    folder: Path
    function: str
    arguments: tuple[str, ...]


DAMPERS = Kind(folder=HERE / "dampers", function="identify", arguments=("tests", "rng"))
LAWS = Kind(
    folder=HERE / "laws",
    function="design",
    arguments=("building", "damper", "motions", "hardware", "rng"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """A loaded file: its name, the first line of its docstring, its function, its `N_PARAMS` if it states them."""

    name: str
    title: str
    function: Callable[..., Any]
    n_params: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Row(Generic[ScoreT]):
    """The row of an entry: its score, or why it has none; seconds of all that it did."""

    name: str
    seconds: float
    score: ScoreT | None
    failure: str = ""
    title: str = ""
    n_params: int | None = None


def recorded_force(spec: mr.DamperSpec, theta: ArrayLike, test: mr.DamperTest) -> Floats:
    """Free-run simulation of a test: the force of the damper as its rig would record it [N], shape (n_time,)."""
    unit = None if spec.current is None else spec.current.unit
    loading = mr.Loading(
        dt=test.dt,
        displacement=test.displacement,
        velocity=test.velocity,
        command=test.command_in(unit),
        command_unit=unit,
    )
    return test.observation.observe(mr.simulate_force(spec, theta, loading), test.dt)


def files_of(kind: Kind) -> dict[str, Path]:
    """The files of a folder by the names of their entries."""
    return {file.stem: file for file in sorted(kind.folder.glob("*.py"))}


def load(file: Path, kind: Kind) -> Entry:
    """Load the file of an entry."""
    module = _executed(file)
    if not (module.__doc__ or "").strip():
        raise SettingError(f"{file.name} has no docstring; begin it with method, authors and reference")
    function = getattr(module, kind.function, None)
    wanted = f"{kind.function}({', '.join(kind.arguments)})"
    if not callable(function):
        raise SettingError(f"{file.name} defines no function {kind.function}; define {wanted}")
    taken = tuple(inspect.signature(function).parameters)
    if taken != kind.arguments:
        raise SettingError(f"{kind.function} of {file.name} takes ({', '.join(taken)}); define {wanted}")
    return Entry(
        name=file.stem,
        title=(module.__doc__ or "").strip().splitlines()[0].rstrip("."),
        function=function,
        n_params=getattr(module, "N_PARAMS", None),
    )


def row_of(file: Path, kind: Kind, score: Callable[[Entry], ScoreT], *, limit: float = LIMIT) -> Row[ScoreT]:
    """The row of a file; one that raises, or takes longer than `limit` [s], is a row with its reason."""
    loaded: list[Entry] = []

    def load_and_score() -> ScoreT:
        loaded.append(load(file, kind))
        return score(loaded[0])

    row = attempt(file.stem, load_and_score, limit=limit)
    return replace(row, title=loaded[0].title, n_params=loaded[0].n_params) if loaded else row


def attempt(name: str, score: Callable[[], ScoreT], *, limit: float = LIMIT) -> Row[ScoreT]:
    """The row of a call that gives its score, or the reason why it did not."""
    began = time.perf_counter()
    found: ScoreT | None = None
    failure = ""
    try:
        with _time_limit(limit):
            found = score()
    except (Exception, SystemExit) as error:
        failure = f"{type(error).__name__}: {' '.join(str(error).split())}"
        found = None
    return Row(name=name, seconds=time.perf_counter() - began, score=found, failure=failure)


def chosen(kind: Kind, only: Sequence[str]) -> list[Path]:
    """The files of a folder, those named alone if any are."""
    return [file for name, file in files_of(kind).items() if not only or name in only]


def _executed(file: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"leaderboard_{file.parent.name}_{file.stem}", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def too_long(seconds: float) -> str:
    """What is said of a row that took longer."""
    return f"the row took longer than {seconds:g} s; make the entry faster"


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Raise TimeoutError in the block after `seconds`; where the system has no such timer, when the block ends."""
    began = time.perf_counter()
    sentence = too_long(seconds)

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError(sentence)

    timed = hasattr(signal, "setitimer") and threading.current_thread() is threading.main_thread()
    if timed:
        before = signal.signal(signal.SIGALRM, stop)
        signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        if timed:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, before)
    if time.perf_counter() - began > seconds:
        raise TimeoutError(sentence)
