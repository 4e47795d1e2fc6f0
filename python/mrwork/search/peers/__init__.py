"""Optimisers of other libraries behind the same ask and tell; install them with the extra `peers`."""

from mrwork.search.peers.cma_evolution import CMAEvolution
from mrwork.search.peers.pymoo_genetic import PymooGA
from mrwork.search.peers.scipy_differential_evolution import ScipyDifferentialEvolution

__all__ = ["CMAEvolution", "PymooGA", "ScipyDifferentialEvolution"]
