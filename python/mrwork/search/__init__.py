"""Derivative-free search of the unit cube: an ask/tell loop, optimisers for it, and when to stop."""

from mrwork.search.genetic import EfficientGA, GAState
from mrwork.search.loop import (
    GenerationEvent,
    Objective,
    Optimiser,
    SearchInterrupted,
    SearchResult,
    run_search,
)
from mrwork.search.state import SearchState, Trace, distinct_best
from mrwork.search.termination import ExpectedTermination, expected_termination

__all__ = [
    "EfficientGA",
    "ExpectedTermination",
    "GAState",
    "GenerationEvent",
    "Objective",
    "Optimiser",
    "SearchInterrupted",
    "SearchResult",
    "SearchState",
    "Trace",
    "distinct_best",
    "expected_termination",
    "run_search",
]
