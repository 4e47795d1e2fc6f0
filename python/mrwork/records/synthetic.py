"""Synthetic damper tests from published parameter sets, with given motion, sensor noise and seed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.keys import suggestion
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.dampers.spec import damper
from mrwork.errors import UnknownNameError
from mrwork.records import DamperTest, build_damper_test

_DT = 1e-3
_FORCE_NOISE_N = 8.0
_DISPLACEMENT_NOISE_M = 5e-6
_VELOCITY_NOISE_MPS = 5e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class SyntheticTest:
    """A sinusoidal test of a model with its nominal, published parameters, from rest at mid-stroke."""

    model: str
    amplitude: float
    frequency: float
    cycles: int
    rng: int


SYNTHETIC_TESTS = {
    "spencer1997": SyntheticTest(model="bouc_wen", amplitude=0.015, frequency=2.5, cycles=5, rng=1997),
    "spencer1997_slow": SyntheticTest(model="bouc_wen", amplitude=0.025, frequency=0.5, cycles=2, rng=1998),
    "spencer1997_fast": SyntheticTest(model="bouc_wen", amplitude=0.004, frequency=5.0, cycles=10, rng=1999),
    "rd1005_1a": SyntheticTest(model="static_hysteretic", amplitude=0.010, frequency=1.0, cycles=4, rng=2006),
}


@checked
def synthetic_test(name: str) -> DamperTest:
    """Generate the synthetic test with this name; the same name gives the same bits.

    The force is simulated for the exact motion. White sensor noise is then added, with standard deviations of 8 N for
    the force, 5 um for the displacement and 0.5 mm/s for the velocity.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.synthetic_test("spencer1997").n_time
    2001
    """
    if name not in SYNTHETIC_TESTS:
        raise UnknownNameError(f"no synthetic test is called {name!r}{suggestion(name, [*SYNTHETIC_TESTS])}")
    recipe = SYNTHETIC_TESTS[name]
    spec = damper(recipe.model)
    omega = 2.0 * np.pi * recipe.frequency
    time = _DT * np.arange(round(recipe.cycles / recipe.frequency / _DT) + 1)
    displacement = recipe.amplitude * np.sin(omega * time)
    velocity = recipe.amplitude * omega * np.cos(omega * time)
    force = simulate_force(spec, spec.nominal, Loading(dt=_DT, displacement=displacement, velocity=velocity))
    rng = np.random.default_rng(recipe.rng)

    def noise(deviation: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        return deviation * rng.standard_normal(time.size)

    return build_damper_test(
        name=f"synthetic {name}",
        time=time,
        displacement=displacement + noise(_DISPLACEMENT_NOISE_M),
        velocity=velocity + noise(_VELOCITY_NOISE_MPS),
        force=force + noise(_FORCE_NOISE_N),
        amplitude=recipe.amplitude,
        frequency=recipe.frequency,
        synthetic=True,
        path=f"synthetic:{name}",
    )
