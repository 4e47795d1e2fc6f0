"""One search of another library, held in a state: asked and told like our own, but only once.

A library keeps its progress in an object that changes when it is told. So a state of it can be told once; to go on
from an earlier one start again and tell the same misfits, which a journal keeps. Otherwise the contract holds: each
replicate is a search of its own with a seed of its own, whoever runs beside it.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from types import ModuleType
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.search.course import Course, put
from mrwork.search.elite import EliteRule
from mrwork.search.population import proposed
from mrwork.search.proposal import Proposal
from mrwork.search.stop_rules import StopRules

# Libraries compute with misfits, so a failure is told as a number worse than any.
_FAILURE = 1e100


class Peer(Protocol):
    """What a library does in one generation."""

    def ask(self) -> NDArray[np.float64]:
        """Candidates, shape (n_ask, n_params), at most the population that was agreed."""

    def tell(self, misfit: NDArray[np.float64]) -> None:
        """Their misfits, shape (n_ask,), all finite."""


class OneSearch:
    """A peer and the candidates it has asked but not been told."""

    def __init__(self, peer: Peer) -> None:
        self._peer = peer
        self._generation = 0
        self._asked: NDArray[np.float64] | None = None

    def ask(self, generation: int) -> NDArray[np.float64]:
        """Candidates of this generation, the same however often they are asked."""
        self._check(generation)
        if self._asked is None:
            self._asked = np.clip(self._peer.ask(), 0.0, 1.0)
        return self._asked

    def tell(self, generation: int, misfit: NDArray[np.float64]) -> None:
        """Misfits of all that was asked in this generation, shape (n_ask,)."""
        self._check(generation)
        self._peer.tell(np.where(np.isfinite(misfit), misfit, _FAILURE))
        self._generation, self._asked = generation + 1, None

    def _check(self, generation: int) -> None:
        if generation != self._generation:
            raise SettingError(
                f"this state is of generation {generation}, its library has gone on to {self._generation}; "
                "start again and tell the same misfits"
            )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PeerState:
    """Searches of another library, one of each replicate.

    `population` (n_replicates, n_population, n_params) with `misfit` (n_replicates, n_population) were told last.
    """

    course: Course
    population: NDArray[np.float64]
    misfit: NDArray[np.float64]
    searches: tuple[OneSearch, ...]


def library(name: str) -> ModuleType:
    """Import a module of an optional library.

    Raises
    ------
    SettingError
        Where it is not installed.
    """
    try:
        return importlib.import_module(name)
    except ImportError as error:
        raise SettingError(
            f"{name.partition('.')[0]} is not installed; install it with: pip install 'mrwork[peers]'"
        ) from error


def peers_begun(course: Course, size: int, start: Callable[[int], Peer]) -> PeerState:
    """Start one search for each replicate, from a seed of its own."""
    shape = (len(course.replicate), size)
    return PeerState(
        course=course,
        population=np.zeros((*shape, course.best_unit.shape[1])),
        misfit=np.full(shape, math.inf),
        searches=tuple(OneSearch(start(int(seed))) for seed in course.streams.seeds()),
    )


def ask_peers(state: PeerState) -> Proposal:
    """What the searches of the replicates that run ask; a slot that a library leaves empty is not simulated."""
    course, rows = state.course, state.course.running
    size = state.misfit.shape[1]
    population = state.population[rows].copy()
    changed = np.zeros((rows.size, size), np.bool_)
    for place, row in enumerate(rows):
        asked = state.searches[row].ask(int(course.generation[row]))
        population[place, : len(asked)] = asked
        changed[place, : len(asked)] = True
    return proposed(course, population, known=state.misfit[rows], changed=changed)


def tell_peers(
    state: PeerState,
    proposal: Proposal,
    misfit: NDArray[np.float64],
    *,
    elite: EliteRule,
    stop: StopRules,
) -> PeerState:
    """State after the simulations asked for; that before cannot be told again."""
    course, rows = state.course, state.course.running
    told = proposal.told(misfit)
    for place, row in enumerate(rows):
        state.searches[row].tell(int(course.generation[row]), told[place, proposal.changed[place]])
    after = np.where(proposal.changed, told, proposal.known)
    return PeerState(
        course=course.after(
            proposal, told, population=proposal.population, misfit=after, elite=elite, stop=stop
        ),
        population=put(state.population, rows, proposal.population),
        misfit=put(state.misfit, rows, after),
        searches=state.searches,
    )
