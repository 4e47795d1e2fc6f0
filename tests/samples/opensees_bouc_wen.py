"""The material `BoucWen` as OpenSees computes it, to the bit: `setTrialStrain` in BoucWenMaterial.cpp."""

import numpy as np

from mrwork.base.values import Floats
from mrwork.dampers import OpenSeesBoucWen

# The solver starts at this z in every step, and gives up after so many iterations.
_START = 0.01
_MOST = 20


def force_in_opensees(material: OpenSeesBoucWen, path: Floats, *, tolerance: float = 1e-8) -> Floats:
    """Force at every point of a path of strains, without degradation."""
    m = material
    forces = np.empty(path.size)
    last_z, last_strain = 0.0, 0.0
    for index, strain in enumerate(path.tolist()):
        change = strain - last_strain
        z, before, after = _START, _START, 1.0
        for _ in range(_MOST):
            if abs(before - after) <= tolerance:
                break
            psi = m.gamma + m.beta * np.sign(change * z)
            misfit = z - last_z - (m.Ao - abs(z) ** m.n * psi) * change
            slope = 1.0 + m.n * abs(z) ** (m.n - 1.0) * np.sign(z) * psi * change
            before, after = z, z - misfit / slope
            z = after
        else:
            raise AssertionError(f"no z was found in {_MOST} iterations")
        forces[index] = m.alpha * m.ko * strain + (1.0 - m.alpha) * m.ko * z
        last_z, last_strain = z, strain
    return forces
