"""Task of every contender of `study.py loop`: clipped-optimal control of a five-storey building.

The building is `uts` of the published ones, the device a differential pair of RD-1005-3 dampers across the first storey
(`static_hysteretic`, set `kwok2006`) behind a driver with a lag of 190 1/s. A candidate is a row of gains K: every
1 ms the desired force is f_c = -K [q; v], and the command i_max H((f_c - f) f) holds (Dyke et al. 1996). One classical
Runge-Kutta step per control sample, the ground's acceleration straight between the samples of its record. Each run
is reduced as it goes on; nothing else is kept of it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_continuous_are

from mrwork.buildings import building
from mrwork.dampers import damper
from mrwork.motions import GroundMotion, synthetic_motion, trimmed
from mrwork.twins import stage_values
from studies.former.arrays import Floats

N_STOREYS = 5
LAG = 190.0
LARGEST_COMMAND = 1.88
STEP = 1e-3
# Of the ground [m/s^2].
PEAK = 0.3 * 9.81

# What is kept of a run, by our names; of the floors five numbers each, lowest first.
KEPT = (
    *(
        "peak_displacement",
        "rms_displacement",
        "peak_acceleration",
        "rms_acceleration",
        "peak_drift",
        "rms_drift",
    ),
    *("peak_base_shear", "rms_base_shear", "peak_force", "rms_force", "peak_stroke", "peak_rate"),
    *("peak_current", "mean_current", "rms_current"),
    *("device_energy", "input_energy", "kinetic_energy", "strain_energy", "damping_energy"),
)
N_REDUCTIONS = 6 * N_STOREYS + 2 + 2 + 2 + 3 + 5
_SQUARES = [*range(5, 10), *range(15, 20), *range(25, 30), 31, 33, 38]
_SUM = 37


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopWorkload:
    """Candidates and ground motions; a run is one candidate under one motion.

    Attributes
    ----------
    mass : (5,) of the floors [kg], lowest first.
    stiffness, damping : (5, 5) matrices of a chain, K [N/m] and C [N s/m].
    device : (12,) laws of the damper in the coil's current: c.0, c.1, k.0, k.1, alpha.0, alpha.1, alpha.2, beta,
        delta.0, delta.1, x_s, f0.0 (the last cancels in the pair).
    gains : (n_candidates, 10) K, desired force [N] from floor displacements [m] and velocities [m/s].
    records : of the ground.
    ground : (n_motions, n_steps, 3) its acceleration [m/s^2] at start, middle and end of each step.
    """

    mass: Floats
    stiffness: Floats
    damping: Floats
    device: Floats
    gains: Floats
    records: tuple[GroundMotion, ...]
    ground: Floats

    @property
    def n_steps(self) -> int:
        """Integration steps of a run."""
        return int(self.ground.shape[1])

    def cut(self, *, candidates: int, motions: int, n_steps: int) -> LoopWorkload:
        """Return the first candidates, motions and steps."""
        return LoopWorkload(
            mass=self.mass,
            stiffness=self.stiffness,
            damping=self.damping,
            device=self.device,
            gains=self.gains[:candidates],
            records=tuple(trimmed(each, end=n_steps * STEP) for each in self.records[:motions]),
            ground=np.ascontiguousarray(self.ground[:motions, :n_steps]),
        )


def loop_workload(candidates: int = 1000, motions: int = 4, seconds: float = 30.0) -> LoopWorkload:
    """Candidates from the LQR with scattered weights, synthetic motions with a peak of 0.3 g."""
    # A generator for each, so that more of one leaves the other as it was.
    of_gains, of_motions = np.random.default_rng([1996, 0]), np.random.default_rng([1996, 1])
    uts = building("uts")
    mass = np.diag(uts.mass)
    shaken = [synthetic_motion(rng=of_motions, duration=seconds, peak=PEAK) for _ in range(motions)]
    return LoopWorkload(
        mass=mass,
        stiffness=uts.stiffness,
        damping=uts.damping,
        # The offset, whose first coefficient is the last here, cancels in the pair.
        device=np.array(damper("static_hysteretic").preset("kwok2006").theta[:12]),
        gains=np.array([_gain(mass, uts.stiffness, uts.damping, of_gains) for _ in range(candidates)]),
        records=tuple(shaken),
        ground=np.array(
            [
                stage_values(motion.acceleration, motion.dt, STEP, round(motion.duration / STEP))
                for motion in shaken
            ]
        ),
    )


def averaged(kept: Floats, n_steps: int) -> Floats:
    """Root mean squares and means from sums over the steps, shape (..., N_REDUCTIONS)."""
    found = kept.copy()
    found[..., _SQUARES] = np.sqrt(found[..., _SQUARES] / n_steps)
    found[..., _SUM] /= n_steps
    return found


def chain_springs(stiffness: Floats) -> Floats:
    """Stiffness of each storey of a chain [N/m], lowest first, shape (5,)."""
    between = -np.diag(stiffness, 1)
    return np.concatenate([[stiffness[0, 0] - between[0]], between])


def _gain(mass: Floats, stiffness: Floats, damping: Floats, rng: np.random.Generator) -> Floats:
    """K of an LQR that weighs strain, kinetic energy and force, each with a factor of its own, in kN."""
    per_mass = np.diag(1.0 / mass)
    zero, one = np.zeros((N_STOREYS, N_STOREYS)), np.eye(N_STOREYS)
    state = np.block([[zero, one], [-per_mass @ stiffness, -per_mass @ damping]])
    # The device pulls the first floor back.
    effect = np.zeros((2 * N_STOREYS, 1))
    effect[N_STOREYS, 0] = -1e3 / mass[0]
    strain, kinetic = 10.0 ** rng.uniform(-1.0, 1.0, 2)
    weight = np.block([[strain * stiffness, zero], [zero, kinetic * np.diag(mass)]])
    cost = 10.0 ** rng.uniform(0.0, 2.0)
    riccati = solve_continuous_are(state, effect, weight, np.array([[cost]]))
    gain: Floats = 1e3 * (effect.T @ riccati)[0] / cost
    return gain
