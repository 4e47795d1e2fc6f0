"""Every optimiser by name, with its default settings.

A module of its own because `identify` imports all optimisers only where a search is named.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mrwork.search.evolution import DifferentialEvolution, EfficientGA, StandardGA
from mrwork.search.loop import Optimiser
from mrwork.search.particle_swarm import CONSTRICTION, ParticleSwarm
from mrwork.search.peers import CMAEvolution

# Any: each optimiser has its own type of state.
OPTIMISERS: Mapping[str, Optimiser[Any]] = {
    "standard_ga": StandardGA(),
    "genetic": EfficientGA(),
    "particle_swarm": ParticleSwarm(),
    "particle_swarm_constriction": CONSTRICTION,
    "differential_evolution": DifferentialEvolution(),
    "differential_evolution_random": DifferentialEvolution(base="random"),
}
"""Searches of the package by name, with their default settings."""

PEERS: Mapping[str, CMAEvolution] = {"cma": CMAEvolution()}
"""Searches of other libraries by name; each library is imported when its search starts."""

ALL_OPTIMISERS: Mapping[str, Optimiser[Any]] = {**OPTIMISERS, **PEERS}
