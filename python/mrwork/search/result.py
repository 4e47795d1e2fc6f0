"""States of a search, their conversion to plain arrays, and results of a search."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, NamedTuple, Protocol, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.errors import ArgumentError, SettingError
from mrwork.search.course import Course
from mrwork.summary import Summarised, Summary, rounded


class SearchState(Protocol):
    """The part of an optimiser's state that the loop reads.

    A state is a frozen dataclass whose fields are a `Course` and arrays with a leading axis of replicates; `select`,
    `arrays_of` and `state_from_arrays` work on all such states.
    """

    @property
    def course(self) -> Course:
        """Progress of each replicate."""

    @property
    def population(self) -> NDArray[np.float64]:
        """Current candidates, shape (n_replicates, n_population, n_params), in the unit cube."""

    @property
    def misfit(self) -> NDArray[np.float64]:
        """Their misfits, shape (n_replicates, n_population); `inf` for failures, and before the first generation."""


T = TypeVar("T")
StateT = TypeVar("StateT", bound=SearchState)


@checked
def select(state: StateT, rows: Sequence[int]) -> StateT:
    """The state of these replicates only, in this order; traces have the length of the longest of them."""
    if not isinstance(getattr(state, "course", None), Course):
        raise ArgumentError(
            "`state` of select is no state of a search; give one from `optimiser.start` or a result"
        )
    n_replicates = len(state.course.replicate)
    if not all(-n_replicates <= row < n_replicates for row in rows):
        raise SettingError(
            f"`rows` are {list(rows)}; the state has {n_replicates} replicates, counted from 0"
        )
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
    """Plain arrays of a state by field name, such as `course.best_unit`."""
    arrays: dict[str, NDArray[Any]] = {}
    for field in dataclasses.fields(state):  # type: ignore[arg-type] # an `object` that is a dataclass
        value = getattr(state, field.name)
        if dataclasses.is_dataclass(value):
            arrays |= {f"{field.name}.{name}": each for name, each in arrays_of(value).items()}
        else:
            # Unsigned, because a seed may take all 64 bits.
            arrays[field.name] = value if isinstance(value, np.ndarray) else np.array(value, np.uint64)
    return arrays


@checked
def state_from_arrays(kind: type[T], arrays: Mapping[str, NDArray[Any]]) -> T:
    """Undo `arrays_of`, bit for bit; `kind` is the class of the state.

    Raises
    ------
    SettingError
        Where the arrays are not those of such a state.
    """
    try:
        return _from_arrays(kind, arrays)
    except (KeyError, TypeError, ValueError, AttributeError) as reason:
        raise SettingError(
            f"the arrays are not those of a {kind.__name__} ({type(reason).__name__}: {reason}); "
            "give those of `arrays_of`"
        ) from None


def _from_arrays(kind: type[T], arrays: Mapping[str, NDArray[Any]]) -> T:
    hints = get_type_hints(kind)
    values: dict[str, Any] = {}
    for name, hint in ((each.name, hints[each.name]) for each in dataclasses.fields(kind)):  # type: ignore[arg-type] # a dataclass
        if dataclasses.is_dataclass(hint):
            inner = {key.removeprefix(f"{name}."): each for key, each in arrays.items()}
            values[name] = _from_arrays(hint, inner)  # type: ignore[arg-type] # a hint is a class here
        else:
            values[name] = int(arrays[name]) if hint is int else arrays[name]
    return kind(**values)


def _with_parts(value: T, change: Callable[[Any], Any]) -> T:
    """A dataclass with `change` applied to each field."""
    names = [field.name for field in dataclasses.fields(value)]  # type: ignore[arg-type] # T is a dataclass
    changed = {name: change(getattr(value, name)) for name in names}
    return dataclasses.replace(value, **changed)  # type: ignore[type-var] # T is a dataclass


class RunTrace(NamedTuple):
    """Progress of one replicate, as in `Trace`, each of shape (n_generations,)."""

    evaluations: NDArray[np.int64]
    best: NDArray[np.float64]
    median: NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class SearchResult(Summarised, Generic[StateT]):
    """Result of one replicate, its stop reason, and the state from which it can be resumed alone.

    `best_unit` (n_params,) has `best_misfit`, `inf` if no simulation succeeded. `elite` (n_elite, n_params) are the
    best mutually distant points of the whole run with `elite_misfit` (n_elite,), best first, empty if no simulation
    succeeded; they are starts for a local minimisation. `evaluations` and `generations` count from the start of the
    search, `seconds` is the time of this call, for all replicates together.
    """

    _made_by: ClassVar[str] = "mr.search.run_search(optimiser, objective, rng=..., n_params=...)"

    replicate: int
    best_unit: NDArray[np.float64]
    best_misfit: float
    elite: NDArray[np.float64]
    elite_misfit: NDArray[np.float64]
    trace: RunTrace
    evaluations: int
    generations: int
    stop_reason: str
    seconds: float
    state: StateT

    def _summary(self) -> Summary:
        return Summary(
            title=f"Search, replicate {self.replicate}: least misfit {rounded(self.best_misfit, 6)}",
            facts=(
                (
                    "ended",
                    f"{self.stop_reason} after {self.generations} generations, {self.evaluations} simulations",
                ),
                ("seconds", rounded(self.seconds, 3)),
                ("elite", str(len(self.elite))),
            ),
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class ReplicatedSearch(Summarised, Generic[StateT]):
    """Results of replicates that ran in one call, and the state from which all can be resumed."""

    _units: ClassVar[Mapping[str, str]] = {"seconds": "s"}

    results: tuple[SearchResult[StateT], ...]
    seconds: float
    state: StateT

    @property
    def best(self) -> SearchResult[StateT]:
        """The result with the least misfit."""
        return min(self.results, key=lambda result: result.best_misfit)


def results_of(state: StateT, reason: str, seconds: float) -> ReplicatedSearch[StateT]:
    """Results of a search that ends in this state; `reason` is that of replicates that no rule has ended."""
    return ReplicatedSearch(
        results=tuple(
            _result(select(state, [row]), reason, seconds) for row in range(len(state.course.replicate))
        ),
        seconds=seconds,
        state=state,
    )


def _result(state: StateT, reason: str, seconds: float) -> SearchResult[StateT]:
    course = state.course
    found = np.isfinite(course.elite_misfit[0])
    return SearchResult(
        replicate=int(course.replicate[0]),
        best_unit=course.best_unit[0],
        best_misfit=float(course.best_misfit[0]),
        elite=course.elite_unit[0, found],
        elite_misfit=course.elite_misfit[0, found],
        trace=RunTrace(
            evaluations=course.trace.evaluations[0],
            best=course.trace.best[0],
            median=course.trace.median[0],
        ),
        evaluations=int(course.evaluations[0]),
        generations=int(course.generation[0]),
        stop_reason=course.stop_reasons[0] or reason,
        seconds=seconds,
        state=state,
    )
