"""Every optimiser by name, with its default settings: what a study or a test may choose from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mrwork.search.differential_evolution import DifferentialEvolution
from mrwork.search.efficient_genetic import EfficientGA
from mrwork.search.loop import Optimiser
from mrwork.search.particle_swarm import CONSTRICTION, ParticleSwarm
from mrwork.search.peers import CMAEvolution, PymooGA
from mrwork.search.scipy_differential_evolution import ScipyDifferentialEvolution
from mrwork.search.standard_genetic import StandardGA

# Any: each optimiser has states of its own kind.
OPTIMISERS: Mapping[str, Optimiser[Any]] = {
    "standard_ga": StandardGA(),
    "genetic": EfficientGA(),
    "particle_swarm": ParticleSwarm(),
    "particle_swarm_constriction": CONSTRICTION,
    "differential_evolution": DifferentialEvolution(),
    "differential_evolution_random": DifferentialEvolution(base="random"),
}

# Those of other libraries; starting one asks for its library.
PEERS: Mapping[str, Optimiser[Any]] = {
    "cma": CMAEvolution(),
    "pymoo_ga": PymooGA(),
    "scipy_differential_evolution": ScipyDifferentialEvolution(),
}
