"""Generations of a search in a journal, and what a journal and a search must agree on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.search.proposal import Proposal
from mrwork.search.state import SearchState
from mrwork.store import Journal, digest_of
from mrwork.store.plain import array_of, plain

_STEP = "generation"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Generation:
    """What a search cannot compute again: misfits as the optimiser took them (n_ask,), time since it began [s]."""

    misfit: NDArray[np.float64]
    seconds: float


def agree_on_search(journal: Journal, optimiser: object, state: SearchState) -> None:
    """Write down which search this is, or check that a journal is of the same.

    Raises
    ------
    JournalError
        Where it is not; the message names what differs.
    """
    course = state.course
    journal.agree(
        "search",
        {
            "optimiser": type(optimiser).__name__,
            "settings": plain(optimiser),
            "seed": course.rng,
            "replicates": course.replicate,
            "n_params": state.population.shape[2],
            "generation": course.generation.max(),
        },
    )


def recalled_generation(journal: Journal, proposal: Proposal) -> Generation | None:
    """The generation that came of this proposal, `None` where it is not recorded yet."""
    recalled = journal.recall(_STEP, _digest(proposal)) if journal.recalling else None
    if recalled is None:
        return None
    return Generation(misfit=array_of(recalled["misfit"]), seconds=float(recalled["search_seconds"]))


def record_generation(
    journal: Journal, proposal: Proposal, state: SearchState, generation: Generation
) -> None:
    """Record a generation; beside what is needed to go on, what people look for."""
    course = state.course
    journal.record(
        _STEP,
        _digest(proposal),
        {
            "generation": course.generation.max(),
            "evaluations": course.evaluations.sum(),
            "best": course.best_misfit.min(),
            "median": np.median(course.trace.median[:, -1]),
            # Random numbers are a function of seed, replicate and generation: this is all of their state.
            "next_stream": {"seed": course.rng, "generation": course.generation.max()},
            "misfit": generation.misfit,
            "search_seconds": generation.seconds,
        },
    )


def _digest(proposal: Proposal) -> str:
    return digest_of(proposal.number, proposal.population, proposal.changed, proposal.threshold)
