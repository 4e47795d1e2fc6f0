"""Refinement finds the nominal parameters again in data without noise, from a start 10 to 20 % away."""

from dataclasses import replace

import numpy as np
from damper_samples import noise, noise_free_test

from mrwork.dampers import Box
from mrwork.identification import Objective
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.objective import linearise_residuals

# 0.3 s of motion in a wide band feel every parameter.
N_TIME = 301


def start(spec, rng):
    """10 to 20 % off in every parameter, either way, inside the admissible range."""
    generator = np.random.default_rng(rng)
    size = len(spec.parameters)
    factor = 1.0 + generator.uniform(0.1, 0.2, size) * generator.choice([-1.0, 1.0], size)
    lower = np.array([parameter.lower for parameter in spec.parameters])
    upper = np.array([parameter.upper for parameter in spec.parameters])
    moved = spec.nominal * factor
    return np.where((moved < lower) | (moved > upper), spec.nominal * (2.0 - factor), moved)


def test_nominal_parameters_are_recovered(spec):
    motion = noise()
    motion = replace(motion, displacement=motion.displacement[:N_TIME])
    objective = Objective.of(spec, (noise_free_test(spec, motion),))
    box = Box.of(spec)
    away = start(spec, 1)
    assert objective(away[None])[0] > 1e-2
    refined = find_minima(objective, box, away[None], max_iterations=300, tolerance=1e-12)
    assert refined.misfit[0] < 1e-6
    # Directions that the force does not feel (Bouc-Wen has one, a scaling of its state) stay where the start
    # put them; the data fix the others. Sensitivities are to relative changes, so that units do not matter.
    sensitivity = linearise_residuals(objective, np.array([spec.nominal]), box.free)[1][0].T * spec.nominal
    _, strength, directions = np.linalg.svd(sensitivity, full_matrices=False)
    seen = strength > 1e-8 * strength[0]
    felt = directions[seen]
    assert len(felt) >= len(spec.parameters) - 1
    off = np.log(refined.theta[0] / spec.nominal)
    # The misfit may be 1e-6, and that leaves a direction open by as much over its strength.
    assert np.all(np.abs(felt @ off) < np.maximum(1e-4, 1e-6 / strength[seen]))
