"""Derivative-free search of the unit cube: an ask/tell loop, optimisers for it, and when to stop."""

from mrwork.search.ceiling import Ceiling
from mrwork.search.course import Course, Trace
from mrwork.search.differential_evolution import DifferentialEvolution
from mrwork.search.efficient_genetic import EfficientGA, GAState
from mrwork.search.elite import EliteRule, distinct_best
from mrwork.search.loop import (
    AbortableObjective,
    GenerationEvent,
    Objective,
    OnGeneration,
    Optimiser,
    SearchInterrupted,
    run_replicates,
    run_search,
)
from mrwork.search.particle_swarm import CONSTRICTION, ParticleSwarm, SwarmState
from mrwork.search.population import PopulationState
from mrwork.search.proposal import Proposal
from mrwork.search.result import ReplicatedSearch, RunTrace, SearchResult
from mrwork.search.standard_genetic import StandardGA
from mrwork.search.state import SearchState, arrays_of, select, state_from_arrays
from mrwork.search.stop_rules import StopRules
from mrwork.search.termination import ExpectedTermination, expected_termination

__all__ = [
    "CONSTRICTION",
    "AbortableObjective",
    "Ceiling",
    "Course",
    "DifferentialEvolution",
    "EfficientGA",
    "EliteRule",
    "ExpectedTermination",
    "GAState",
    "GenerationEvent",
    "Objective",
    "OnGeneration",
    "Optimiser",
    "ParticleSwarm",
    "PopulationState",
    "Proposal",
    "ReplicatedSearch",
    "RunTrace",
    "SearchInterrupted",
    "SearchResult",
    "SearchState",
    "StandardGA",
    "StopRules",
    "SwarmState",
    "Trace",
    "arrays_of",
    "distinct_best",
    "expected_termination",
    "run_replicates",
    "run_search",
    "select",
    "state_from_arrays",
]
