"""States of a search: what they have in common, some replicates of one, and one as plain arrays."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from mrwork.search.course import Course


class SearchState(Protocol):
    """What the loop reads of an optimiser's state, whichever optimiser it is.

    A frozen dataclass whose fields are a `Course` and arrays with a leading axis of replicates, so that `select`,
    `arrays_of` and `state_from_arrays` serve all.
    """

    @property
    def course(self) -> Course:
        """How far each replicate has come."""

    @property
    def population(self) -> NDArray[np.float64]:
        """Current candidates, shape (n_replicates, n_population, n_params), in the unit cube."""

    @property
    def misfit(self) -> NDArray[np.float64]:
        """Their misfits, shape (n_replicates, n_population); `inf` for failures, and before the first generation."""


T = TypeVar("T")


def select(state: T, rows: Sequence[int]) -> T:
    """The same state with only these rows of its leading axis, in this order; traces end with the longest."""
    index = np.asarray(rows, dtype=np.int64)

    def part(value: Any) -> Any:
        if isinstance(value, np.ndarray):
            return value[index]
        if isinstance(value, tuple):
            return tuple(value[row] for row in index)
        return _with_parts(value, part) if dataclasses.is_dataclass(value) else value

    def shortened(value: Any) -> Any:
        if isinstance(value, Course):
            n_generations = int(value.generation.max(initial=0))
            trace = _with_parts(value.trace, lambda entries: entries[:, :n_generations])
            return dataclasses.replace(value, trace=trace)
        return value

    return _with_parts(_with_parts(state, part), shortened)


def arrays_of(state: object) -> dict[str, NDArray[Any]]:
    """Every number of a state as plain arrays, named by their fields: `course.best_unit` and so on."""
    arrays: dict[str, NDArray[Any]] = {}
    for field in dataclasses.fields(state):  # type: ignore[arg-type] # an `object` that is a dataclass
        value = getattr(state, field.name)
        if dataclasses.is_dataclass(value):
            arrays |= {f"{field.name}.{name}": each for name, each in arrays_of(value).items()}
        else:
            # An unsigned number holds every seed.
            arrays[field.name] = value if isinstance(value, np.ndarray) else np.array(value, np.uint64)
    return arrays


def state_from_arrays(kind: type[T], arrays: Mapping[str, NDArray[Any]]) -> T:
    """Undo `arrays_of`, to the same bits; `kind` is the class of the state."""
    hints = get_type_hints(kind)
    values: dict[str, Any] = {}
    for name, hint in hints.items():
        if dataclasses.is_dataclass(hint):
            inner = {key.removeprefix(f"{name}."): each for key, each in arrays.items()}
            values[name] = state_from_arrays(hint, inner)  # type: ignore[arg-type] # a hint is a class here
        else:
            values[name] = int(arrays[name]) if hint is int else arrays[name]
    return kind(**values)


def _with_parts(value: T, change: Callable[[Any], Any]) -> T:
    """A dataclass with each field changed."""
    names = [field.name for field in dataclasses.fields(value)]  # type: ignore[arg-type] # T is a dataclass
    changed = {name: change(getattr(value, name)) for name in names}
    return dataclasses.replace(value, **changed)  # type: ignore[type-var] # T is a dataclass
