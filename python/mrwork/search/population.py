"""State of a search: what the loop reads of it, its plain arrays, and what population-based optimisers make of it."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import checked
from mrwork.errors import ArgumentError, SettingError
from mrwork.search.course import Course, Proposal, with_rows
from mrwork.search.rules import EliteRule, StopRules, check_ranges
from mrwork.summary import Summarised
from mrwork.values import holds_arrays


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


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class PopulationState(Summarised):
    """A population and its misfits, (n_replicates, n_population, n_params) and (n_replicates, n_population).

    They are the last simulated generation, or the initial one with misfit `inf` at generation 0.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng)"

    course: Course
    population: NDArray[np.float64]
    misfit: NDArray[np.float64]

    @classmethod
    @checked
    def begun(cls, course: Course, population: NDArray[np.float64]) -> PopulationState:
        """State before the first simulation."""
        return cls(course=course, population=population, misfit=np.full(population.shape[:2], math.inf))


def propose(
    course: Course,
    population: NDArray[np.float64],
    *,
    known: NDArray[np.float64] | None = None,
    changed: NDArray[np.bool_] | None = None,
    limit: NDArray[np.float64] | float = math.inf,
) -> Proposal:
    """Proposal of this population for the running replicates.

    Only `changed` members are simulated, by default all; the misfits of the others are `known`. Misfits at or above
    `limit`, a number or an array (n_running, 1) or (n_running, n_population), count as failures.
    """
    shape = population.shape[:2]
    changed = np.ones(shape, np.bool_) if changed is None else changed
    return Proposal(
        number=course.replicate[course.running],
        population=population,
        known=np.full(shape, math.inf) if known is None else np.where(changed, math.inf, known),
        changed=changed,
        limit=np.broadcast_to(limit, shape),
    )


def with_generation(
    state: StateT, proposal: Proposal, misfit: NDArray[np.float64], *, elite: EliteRule, stop: StopRules
) -> StateT:
    """State after a generation that replaces the old population; `misfit` (n_ask,) is that of `Proposal.unit`."""
    simulated = proposal.member_misfits(misfit)
    after = np.where(proposal.changed, simulated, proposal.known)
    return _replace_population(state, proposal, simulated, proposal.population, after, elite, stop)


def with_better_members(
    state: StateT, proposal: Proposal, misfit: NDArray[np.float64], *, elite: EliteRule, stop: StopRules
) -> StateT:
    """State after a generation in which each proposed member replaces the old one if it is better."""
    rows = state.course.running
    simulated = proposal.member_misfits(misfit)
    better = simulated < state.misfit[rows]
    population = np.where(better[..., None], proposal.population, state.population[rows])
    after = np.where(better, simulated, state.misfit[rows])
    return _replace_population(state, proposal, simulated, population, after, elite, stop)


def _replace_population(
    state: StateT,
    proposal: Proposal,
    simulated: NDArray[np.float64],
    population: NDArray[np.float64],
    misfit: NDArray[np.float64],
    elite: EliteRule,
    stop: StopRules,
) -> StateT:
    """State in which the running replicates have this population with these misfits; other fields are the same."""
    rows = state.course.running
    return replace(  # type: ignore[type-var] # a state is a dataclass
        state,
        course=state.course.after(
            proposal, simulated, population=population, misfit=misfit, elite=elite, stop=stop
        ),
        population=with_rows(state.population, rows, population),
        misfit=with_rows(state.misfit, rows, misfit),
    )


def relative_fitness(misfit: NDArray[np.float64]) -> NDArray[np.float64]:
    """`F = (e_max - e)/(e_max - e_min)` in each population, shape (n_replicates, n_population).

    The extremes are those of the simulations that succeeded. Failures have fitness 0; where all errors are equal, all
    have fitness 0.
    """
    succeeded = np.isfinite(misfit)
    best = np.min(misfit, axis=1, keepdims=True)
    worst = np.max(np.where(succeeded, misfit, -math.inf), axis=1, keepdims=True)
    varied = succeeded & (worst > best)
    above = np.where(varied, worst, 0.0) - np.where(varied, misfit, 0.0)
    span = np.where(varied, worst, 1.0) - np.where(varied, best, 0.0)
    return np.asarray(above / span)


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Ceiling:
    """Misfit at or above which a chromosome counts as failed; the lower of the two limits applies, `None` is no limit.

    In a genetic algorithm the rank of every misfit matters, so a simulation that stops early would change later
    generations. With a ceiling, misfits above it have no rank, so that the result does not depend on early stopping.

    On 2000 samples of a measured test (10 mm, 1 Hz, 0.5 A), with the non-symmetric Bouc-Wen model, 8 free parameters
    and 24 replicates of 120 generations of the efficient algorithm; the share of steps is estimated, assuming that the
    squared error grows evenly in time:

    =========================  ===========  ==================  ============  ==========
    ceiling                    simulations  median best misfit  below 0.1     steps done
    =========================  ===========  ==================  ============  ==========
    none                       4252         0.0785              0.79          1.00
    1                          4539         0.0742              0.88          0.92
    1 and 3 times the median   5248         0.0666              0.96          0.75
    1 and 2 times              5272         0.0678              0.92          0.73
    1 and 1.5 times            5319         0.0673              0.88          0.71
    1 and 1 times              5427         0.0673              0.88          0.66
    =========================  ===========  ==================  ============  ==========

    None of the ceilings reduced the quality (the difference between 0.79 and 0.96 of 24 is little more than chance).
    Failures mutate, so more chromosomes change and are simulated, yet the number of steps decreases.

    Parameters
    ----------
    absolute
        A misfit. The natural value for an NRMSE is 1, the misfit of a constant force.
    over_median
        A multiple, at least 1, of the median misfit of the previous generation.
    """

    absolute: float | None = None
    over_median: float | None = None

    def __post_init__(self) -> None:
        check_ranges(
            {"absolute": (self.absolute, 0.0, math.inf), "over_median": (self.over_median, 1.0, math.inf)}
        )

    @checked
    def limit(self, course: Course) -> NDArray[np.float64]:
        """The ceiling of each running replicate, shape (n_running, 1); `inf` where there is none."""
        rows = course.running
        limit = np.full((rows.size, 1), math.inf if self.absolute is None else self.absolute)
        if self.over_median is None or course.is_first:
            return limit
        return np.asarray(np.minimum(limit, self.over_median * course.trace.median[rows, -1:]))
