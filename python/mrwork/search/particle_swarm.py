"""Particle swarm optimisation (Kennedy & Eberhart, ICNN 1995), as used for dampers by Kwok et al. (2006).

Particle i has a personal best position `p`; `g` is the best position of the swarm. In each generation, with
u1, u2 ~ U(0, 1) per gene,

    v <- w v + c1 u1 (p - x) + c2 u2 (g - x),   |v| <= v_max,   x <- x + v

where the inertia w decreases from 0.9 to 0.4 over the generations allowed (Shi & Eberhart, CEC 1998). `CONSTRICTION`
is the other usual choice in the same equation, constant w = 0.7298 and c1 = c2 = 1.49618 (Clerc & Kennedy, IEEE
Trans. Evol. Comput. 6, 2002, 58-73).

A particle that leaves the box is reflected, and its velocity becomes the displacement that resulted (our definition).
Failures do not attract.
"""

from __future__ import annotations

from dataclasses import field, replace
from typing import Annotated

import numpy as np

from mrwork.base.arguments import AnyNumbers, Seed, Share, Within, checked
from mrwork.base.values import Floats, array_dataclass
from mrwork.search.course import Dimension, Proposal, State
from mrwork.search.rules import LARGEST_POPULATION, Elite, EliteRule, SearchName, Stop, StopRules
from mrwork.search.unit_cube import reflect


@array_dataclass()
class Motion:
    """Positions of the particles and their last displacements, (n_population, n_params); at first the initial ones.

    The population of a swarm's state has the personal bests.
    """

    position: Floats
    velocity: Floats


@checked
class ParticleSwarm:
    """Settings of a particle swarm; its methods are pure functions of the state, whose `extra` is a `Motion`.

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
    """

    name: SearchName = "particle_swarm"
    population: Annotated[int, Within(least=2, most=LARGEST_POPULATION)] = 60
    inertia: tuple[Share, Share] = (0.9, 0.4)
    own_attraction: Annotated[float, Within(least=0.0, most=4.0)] = 1.49618
    common_attraction: Annotated[float, Within(least=0.0, most=4.0)] = 1.49618
    velocity_limit: Share = 0.2
    stop: Stop = field(default_factory=StopRules)
    elite: Elite = field(default_factory=EliteRule)

    @checked
    def start(self, n_params: Dimension, rng: Seed) -> State:
        """Initial state with Latin hypercube samples of the unit cube and velocities up to the limit."""
        state = State.sampled(n_params, rng, self.population)
        # The hypercube used the first two thirds of the numbers.
        drawn = state.course.streams.uniform(3, *state.population.shape)[2]
        velocity = self.velocity_limit * (2.0 * drawn - 1.0)
        return replace(state, extra=Motion(position=state.population, velocity=velocity))

    @checked
    def ask(self, state: State) -> Proposal:
        """Next position of every particle."""
        course, best, motion = state.course, state.population, state.extra
        if not course.generation:
            return Proposal.of(motion.position)
        uniform = course.streams.uniform(2, *best.shape)
        first, last = self.inertia
        done = min(course.generation / self.stop.max_generations, 1.0)
        to_own = np.where(np.isfinite(state.misfit)[:, None], best - motion.position, 0.0)
        to_common = np.where(np.isfinite(course.best_misfit), course.best_unit - motion.position, 0.0)
        velocity = (
            (first + (last - first) * done) * motion.velocity
            + self.own_attraction * uniform[0] * to_own
            + self.common_attraction * uniform[1] * to_common
        )
        limited = np.clip(velocity, -self.velocity_limit, self.velocity_limit)
        return Proposal.of(reflect(motion.position + limited))

    @checked
    def tell(self, state: State, proposal: Proposal, misfit: AnyNumbers) -> State:
        """State after the simulations of the proposal; `misfit` (n_ask,), `inf` marks a failed one."""
        motion, position = state.extra, proposal.population
        # The first generation is simulated at the initial positions and keeps the initial velocities.
        velocity = position - motion.position if state.course.generation else motion.velocity
        next_state = state.with_better_members(proposal, misfit, self)
        return replace(next_state, extra=Motion(position=position, velocity=velocity))


# Constriction factors of Clerc & Kennedy.
CONSTRICTION = ParticleSwarm(name="particle_swarm_constriction", inertia=(0.7298, 0.7298))
