"""Particle swarm optimisation (Kennedy & Eberhart, ICNN 1995), as used for dampers by Kwok et al. (2006).

Particle i has a personal best position `p`; `g` is the best position of the swarm. In each generation, with
u1, u2 ~ U(0, 1) per gene,

    v <- w v + c1 u1 (p - x) + c2 u2 (g - x),   |v| <= v_max,   x <- x + v

where the inertia w decreases from 0.9 to 0.4 over the generations allowed (Shi & Eberhart, CEC 1998). `CONSTRICTION`
is the other usual choice in the same equation, constant w = 0.7298 and c1 = c2 = 1.49618 (Clerc & Kennedy, IEEE
Trans. Evol. Comput. 6, 2002, 58-73).

A particle that leaves the box is reflected, and its velocity becomes the displacement that resulted (our definition).
Failures do not attract. The misfit of a particle is used only if it is below that of its personal best, so a
simulation may stop at that threshold.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Annotated, ClassVar

import numpy as np

from mrwork.base.arguments import AnyNumbers, Seed, Share, Within, checked
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.search.course import (
    Course,
    Dimension,
    Proposal,
    Replicate,
    propose,
    with_better_members,
    with_rows,
)
from mrwork.search.rules import LARGEST_POPULATION, EliteRule, StopRules
from mrwork.search.unit_cube import latin_hypercube, reflect


@array_dataclass(repr=False)
class SwarmState(Summarised):
    """State of a swarm.

    `population` (n_replicates, n_population, n_params) are the personal bests of the particles with `misfit`
    (n_replicates, n_population). `position` and `velocity` (n_replicates, n_population, n_params) are the present
    positions and last displacements; at generation 0 the initial ones, before the first simulation.
    """

    _made_by: ClassVar[str] = "optimiser.start(n_params, rng)"

    course: Course
    population: Floats
    misfit: Floats
    position: Floats
    velocity: Floats


@checked
class ParticleSwarm:
    """Settings of a particle swarm; its methods are pure functions of the state.

    Parameters
    ----------
    population
        Particles, at least 2.
    inertia
        Inertia w in the first and in the last generation that `stop` allows.
    own_attraction, common_attraction
        Attraction to the personal best, c1, and to the best of the swarm, c2.
    velocity_limit
        Largest change of a gene in a generation, a share of the box.
    stop
        When to end.
    elite
        Which points of the run are kept as starts of a local minimisation.
    """

    population: Annotated[int, Within(least=2, most=LARGEST_POPULATION)] = 60
    inertia: tuple[Share, Share] = (0.9, 0.4)
    own_attraction: Annotated[float, Within(least=0.0, most=4.0)] = 1.49618
    common_attraction: Annotated[float, Within(least=0.0, most=4.0)] = 1.49618
    velocity_limit: Share = 0.2
    stop: StopRules = field(default_factory=StopRules)
    elite: EliteRule = field(default_factory=EliteRule)

    @checked
    def start(self, n_params: Dimension, rng: Seed, replicates: Sequence[Replicate] = (0,)) -> SwarmState:
        """Initial state with Latin hypercube samples of the unit cube and velocities up to the limit."""
        course = Course.begin(n_params, rng, replicates, self.elite)
        position = latin_hypercube(course.streams, self.population, n_params)
        # The hypercube used the first numbers of the stream.
        drawn = course.streams.uniform(3 * position[0].size)[:, 2 * position[0].size :]
        return SwarmState(
            course=course,
            population=position,
            misfit=np.full(position.shape[:2], math.inf),
            position=position,
            velocity=self.velocity_limit * (2.0 * drawn.reshape(position.shape) - 1.0),
        )

    @checked
    def ask(self, state: SwarmState) -> Proposal:
        """Next position of every particle."""
        course, rows = state.course, state.course.running
        position, velocity = state.position[rows], state.velocity[rows]
        own, misfit = state.population[rows], state.misfit[rows]
        if course.is_first:
            return propose(course, position)
        uniform = course.streams.uniform(2 * position[0].size).reshape(-1, 2, *position.shape[1:])
        first, last = self.inertia
        done = np.minimum(course.generation[rows] / self.stop.max_generations, 1.0)[:, None, None]
        to_own = np.where(np.isfinite(misfit)[..., None], own - position, 0.0)
        known_best = np.isfinite(course.best_misfit[rows])[:, None, None]
        to_common = np.where(known_best, course.best_unit[rows][:, None] - position, 0.0)
        velocity = (
            (first + (last - first) * done) * velocity
            + self.own_attraction * uniform[:, 0] * to_own
            + self.common_attraction * uniform[:, 1] * to_common
        )
        limited = np.clip(velocity, -self.velocity_limit, self.velocity_limit)
        return propose(course, reflect(position + limited), limit=misfit)

    @checked
    def tell(self, state: SwarmState, proposal: Proposal, misfit: AnyNumbers) -> SwarmState:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        rows = state.course.running
        # The first generation is simulated at the initial positions and keeps the initial velocities.
        moved = state.velocity if state.course.is_first else proposal.population - state.position[rows]
        return replace(
            with_better_members(state, proposal, misfit, elite=self.elite, stop=self.stop),
            position=with_rows(state.position, rows, proposal.population),
            velocity=with_rows(state.velocity, rows, moved),
        )


# Constriction factors of Clerc & Kennedy.
CONSTRICTION = ParticleSwarm(inertia=(0.7298, 0.7298))
