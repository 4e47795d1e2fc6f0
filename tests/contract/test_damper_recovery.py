"""Refinement finds the nominal parameters again in data without noise, from a start 10 to 20 % away."""

from __future__ import annotations

import numpy as np
import pytest
from damper_samples import noise, test_of

from mrwork.coordinates import Box
from mrwork.identification.objective import Objective
from mrwork.identification.refine import jacobian, refine



def relative(spec, theta):
    """Parameters over their nominal values, as logarithms where both have one sign."""
    return np.log(theta / spec.nominal)


def start(spec, rng):
    """10 to 20 % off in every parameter, either way, inside the admissible range."""
    generator = np.random.default_rng(rng)
    size = len(spec.parameters)
    factor = 1.0 + generator.uniform(0.1, 0.2, size) * generator.choice([-1.0, 1.0], size)
    lower = np.array([parameter.lower for parameter in spec.parameters])
    upper = np.array([parameter.upper for parameter in spec.parameters])
    moved = spec.nominal * factor
    return np.where((moved < lower) | (moved > upper), spec.nominal * (2.0 - factor), moved)


@pytest.mark.parametrize("rng", [1, 2])
def test_nominal_parameters_are_recovered(spec, rng):
    test = test_of(spec, noise())
    objective = Objective.of(spec, (test,))
    box = Box.of(spec)
    refined = refine(objective, box, start(spec, rng)[None])
    print(spec.name, refined, relative(spec, refined.theta))
    assert refined.misfit < 1e-4
    # Directions that the force does not feel (Bouc-Wen has one, a scaling of its state) are free; the data
    # fix the others. Relative sensitivities of the force, so that no unit decides which are which.
    sensitivity = jacobian(objective, box, spec.nominal) * spec.nominal
    _, strength, directions = np.linalg.svd(sensitivity, full_matrices=False)
    felt = strength > 1e-8 * strength[0]
    print(strength, directions[felt] @ relative(spec, refined.theta))
