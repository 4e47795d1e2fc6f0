"""Problems on the unit cube whose answers are known, optimisers by name, and a run watched state by state."""

import dataclasses

import numpy as np
import pytest

from mrwork.search import OPTIMISERS, PEERS, EfficientGA, StopRules


def sphere(unit):
    """Minimum 0 at 0.3 in every gene; the misfit at distance d is d squared."""
    return np.sum((unit - 0.3) ** 2, axis=1)


def rosenbrock(unit):
    """Curved valley on [-2, 2]^n, n >= 2, minimum 0 at (1, 1, ...), that is 0.75 in the cube."""
    x = 4.0 * unit - 2.0
    return np.sum((1.0 - x[:, :-1]) ** 2 + 100.0 * (x[:, 1:] - x[:, :-1] ** 2) ** 2, axis=1)


def ripples(unit):
    """Rastrigin's shape on [-1.6, 2.4]^n: a dozen local minima >= 0.97, the least 0 at 0.4 in every gene."""
    x = 4.0 * (unit - 0.4)
    return np.sum(x**2 + 2.0 * (1.0 - np.cos(2.0 * np.pi * x)), axis=1)


def half_failing(unit):
    """Sphere with a forbidden half: every simulation with a first gene above 0.5 diverges."""
    return np.where(unit[:, 0] > 0.5, np.inf, sphere(unit))


def with_floor(unit):
    """Model error of 0.1, as in measured data, that no parameters remove."""
    return 0.1 + 0.1 * sphere(unit)


def flat(unit):
    """Every misfit alike."""
    return np.ones(len(unit))


def all_failing(unit):
    """No simulation succeeds."""
    return np.full(len(unit), np.inf)


def only_capped(most):
    """Settings whose only stop is the cap on generations, to look at the algorithm alone."""
    return EfficientGA(stop=StopRules(min_generations=10**9, max_generations=most))


def optimiser_named(name):
    """An optimiser of the registry; the test is skipped where its library is absent."""
    if name in OPTIMISERS:
        return OPTIMISERS[name]
    pytest.importorskip(name, reason=f"{name} is not installed: pip install 'mrwork[peers]'")
    return PEERS[name]


def generations_of(optimiser, objective, *, n_params, rng, most):
    """State before, proposal and state after of each generation of a run."""
    state = optimiser.start(n_params, rng)
    for _ in range(most):
        if not state.course.running:
            return
        proposal = optimiser.ask(state)
        before, state = state, optimiser.tell(state, proposal, objective(proposal.unit))
        yield before, proposal, state


def states(optimiser, objective, *, n_params, rng, generations):
    """Every state of a run, from the start."""
    run = list(generations_of(optimiser, objective, n_params=n_params, rng=rng, most=generations))
    return [run[0][0]] + [after for _, _, after in run]


def arrays_of(state):
    """Arrays and other values of a state by field name, such as `course.best_unit`."""
    arrays = {}
    for field in dataclasses.fields(state):
        value = getattr(state, field.name)
        if dataclasses.is_dataclass(value):
            arrays |= {f"{field.name}.{name}": each for name, each in arrays_of(value).items()}
        else:
            arrays[field.name] = np.asarray(value)
    return arrays


def bits(state):
    """All numbers of a state of our own, or of the course of any."""
    return {name: (array.shape, array.tobytes()) for name, array in arrays_of(state).items()}
