"""Settings of an identification: its search by name, what is fitted and how tests weigh."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field, replace
from functools import cache
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, get_type_hints

from mrwork.base.arguments import Count, NotNegative, Positive, Seed, checked
from mrwork.base.hints import Says, Within
from mrwork.base.keys import look_up
from mrwork.base.units import CommandUnit
from mrwork.errors import RecordError
from mrwork.identification.indistinct import refuse_indistinct
from mrwork.records.observation import DETECT, Effect, Observe, Observing
from mrwork.search import Optimiser
from mrwork.search.rules import LARGEST_POPULATION
from mrwork.store.codec import built, plain


@checked
class Race:
    """Settings of the race, the default search: unlike routes to the least misfit, in rounds until two of them agree.

    One route are local minimisations from samples of wide ranges, the other a population of differential evolution, of
    which half begins in the ranges that suit the tests, and whose best members are minimised too.

    Parameters
    ----------
    samples
        Points of the Latin hypercube per free parameter; local minimisations start from the best of them.
    starts
        Least number of local minimisations of a round from samples, which run in one batch.
    population, generations
        Members and generations of differential evolution in a round.
    most_rounds
        Largest number of rounds. Where no two routes have agreed by then, a lower minimum is possible, and the fit says
        so.
    most_iterations
        Largest number of iterations of a local minimisation.
    sure_steps
        Where the first round took fewer time steps than this, in proportion to its minima that are the least one,
        another round confirms what its routes agree on.
    most_steps
        Time steps of all simulations together after which no further round begins.
    """

    name: ClassVar[str] = "race"
    samples: Count = 8
    starts: Count = 8
    population: Annotated[int, Within(least=5, most=LARGEST_POPULATION)] = 60
    generations: Count = 20
    most_rounds: Count = 3
    most_iterations: Count = 40
    sure_steps: NotNegative = 4e6
    most_steps: Positive = 4e8


Search: TypeAlias = Race | Optimiser


def resize_search(
    search: Search,
    *,
    population: Annotated[int, Within(least=2, most=LARGEST_POPULATION)] | None = None,
    generations: Annotated[int, Within(least=1, most=1_000_000)] | None = None,
) -> Search:
    """The search of another size; `None` keeps the present one.

    Parameters
    ----------
    population
        Number of candidates in a generation; not for the race.
    generations
        Largest number of generations; not for the race.
    """
    # Any: whoever asks for another size has seen that it is no race.
    settings: Any = search
    if population is not None:
        settings = replace(settings, population=population)
    if generations is not None:
        settings = replace(settings, stop=replace(settings.stop, max_generations=generations))
    return settings  # type: ignore[no-any-return] # of the same class


@cache
def searches() -> Mapping[str, Search]:
    """Every search with its default settings, by the name that users and records use.

    The first call imports the optimisers, a tenth of the time of a small fit.
    """
    from mrwork.search.registry import ALL_OPTIMISERS

    return {Race.name: Race(), **ALL_OPTIMISERS}


def search_named(name: str) -> Search:
    """The search called `name`, with its default settings."""
    return look_up(name, searches(), f"there is no search called {name!r}")


def _search_of_record(record: Mapping[str, Any]) -> Search:
    """The search of its record."""
    # The default search is not looked up, because that would import all optimisers.
    kind = Race if record["name"] == Race.name else type(search_named(record["name"]))
    return built(kind, record)  # type: ignore[no-any-return] # the type is the one given


# What makes the final fit: our minimisation, all starts in lanes, or optimistix through JAX.
Engine = Literal["lanes", "optimistix"]

Fold = Literal["test", "motion", "command"]
LeaveOut = Annotated[
    Fold | None,
    Says(
        "with several models or laws to choose: tests that are left out together and predicted: all of one motion "
        "(default from three motions on), each test alone, or all at one command"
    ),
]
LawUnit = Annotated[
    CommandUnit,
    Says(
        "unit of the command in the laws, where tests have several: A or V, or another scalar's, as mm, %, bar, psi, "
        "lb or degC"
    ),
]
Lagged = Annotated[
    bool,
    Says(
        "let the command reach the coil through a first-order lag; its rate eta [1/s] is a parameter of the fit; for "
        "records of a set point that varies, rather than of the current itself; left out where the tests show none"
    ),
]
"""Tests that are left out together: each by itself, all of one amplitude and frequency, all at one command."""

# Values of parameters by name.
Start = Mapping[str, float]

# Exponent with which every test has the same weight: errors that grow in proportion to the force.
EQUAL_SHARES = 1.0


@checked
class FitSettings:
    """Settings of an identification, which are recorded with its fit and in its journal.

    Arguments of `identify` and options of `mrwork identify` are declared here alone.

    Parameters
    ----------
    search
        Global search; by default a race of unlike routes, which goes on until two of them agree on the minimum. With
        any other search the fit says that a lower minimum is possible. In Python it is a name, or a search of the
        package with its settings; `mr.objective` is for searches of your own.
    bounds
        Range of a parameter, by name; equal bounds fix it, and others have their admissible range. In Python a
        mapping from names to (lower, upper).
    starts
        Also start the final fit from these values, by parameter name; `start_from` takes them from an earlier fit. A
        parameter that is not named has the value of the best point found; a value outside the bounds is moved inside.
    ties
        Tie a parameter to an expression of others, as k to ``2*c``: numbers, parameters, parentheses, ``+ - * / **``;
        for one model whose parameters are constant. In Python a mapping such as {"k": "2*c"}. Tied parameters are not
        searched; each stays inside its bounds, and its standard error follows from the standard errors of the others.
    force_exponent
        Assume that errors grow between tests with the standard deviation of the force to this power: 1 gives all tests
        the same weight, 0 compares errors in newtons.
    engine
        What makes the final fit: lanes, or optimistix, which takes longer to reach the same minimum and serves
        comparisons.
    observe
        Observation model of the tests that have none of their own, the effect of the measurement on the force: "detect"
        applies a moving average that was found in the record also to the model's force, and has no effect where none
        was found; "none" compares the model's force as it is; "average=0.1T" (T is the dominant period), "lowpass=50",
        "lag=0.012" (of first order), "delay=0.002", "mass=20" (that moves between damper and load cell), "gain=1.02"
        and "offset=-20" give values [s, Hz, kg, N]; "mass=free", "lag=free" or "delay=free" is one number of all tests,
        fitted with the parameters; "offset=each", "gain=each" or "delay=each" is estimated for each test from its
        measured force; "weigh" fits those of mass, lag and delay with which tests at several frequencies are predicted
        better, if any. What is free stands among the parameters with its error, and predictions have it. With
        "offset=each" the model's own force offset is fixed at zero, because the two cannot be distinguished.
    rng
        Seed of the search. The same seed gives the same bits on any number of threads.

    Raises
    ------
    SettingError
        Where the exponent of the force, the engine or an observation is impossible.
    UnknownNameError
        Where no search of the package has the name.
    """

    search: Search | str | None = None
    bounds: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    starts: Sequence[Start] = ()
    ties: Mapping[str, str] = field(default_factory=dict)
    force_exponent: Annotated[float, Within(least=0.0, most=EQUAL_SHARES)] = EQUAL_SHARES
    engine: Engine = "lanes"
    observe: Observe = DETECT
    rng: Seed = 0

    def __post_init__(self) -> None:
        search = search_named(self.search) if isinstance(self.search, str) else self.search
        if not isinstance(search, Race | None):
            # A fit tells its search by name.
            search_named(search.name)
        plain: dict[str, Any] = {
            "search": search,
            "observe": Observing.of(self.observe),
            "starts": tuple(self.starts),
        }
        for name, value in plain.items():
            object.__setattr__(self, name, value)
        refuse_indistinct(self.observing)

    @property
    def observing(self) -> Observing:
        """What sensors do to the force of the tests, as `observe` says."""
        assert isinstance(self.observe, Observing)  # since it was made
        return self.observe

    def with_effects(self, values: Mapping[Effect, float | None]) -> FitSettings:
        """The settings with these effects given, or free where there is no value, whatever they say of them."""
        return replace(self, observe=self.observing.with_effects(values))

    @property
    def again(self) -> FitSettings:
        """The settings for a fit to other tests: without starts, in lanes."""
        return replace(self, starts=(), engine="lanes")

    def as_record(self) -> dict[str, Any]:
        """Plain values of all fields, for JSON; a search is a record with its name."""
        search = self.search
        assert not isinstance(search, str)
        record: dict[str, Any] = plain(self) | {"observe": self.observing.words}
        if search is None:
            return record
        return record | {"search": {"name": search.name, **plain(search)}}

    @classmethod
    @checked
    def of_record(cls, record: Mapping[str, Any]) -> FitSettings:
        """Undo `as_record`. Missing fields have their defaults, unknown keys are ignored."""
        try:
            search = record.get("search")
            values = {
                name: built(kind, record[name])
                for name, kind in get_type_hints(cls, include_extras=True).items()
                if name in record and name != "search"
            }
            return cls(search=None if search is None else _search_of_record(search), **values)
        except (TypeError, ValueError, KeyError, AttributeError) as reason:
            raise RecordError(
                f"the settings of this fit cannot be read ({reason}); run `mrwork identify` again"
            ) from None
