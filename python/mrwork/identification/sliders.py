"""Mass, lag and delay of the recorded force beside a damper of sliders and dashpots, in the place of any model.

A model takes effects for what it lacks, and the error that it gives a mass counts its own lack. A damper of many
elements is linear in what it does not know,

    F(t) = sum_j f_j(I) z_j(t) + sum_j c_j(I) g_j(v) + k x + f_0 + m a,

with sliders z_j in [-1, 1] that slip at displacements of their own (Iwan, J. Appl. Mech. 33, 1966, 893-900), odd
functions g_j of the velocity, and polynomials f_j and c_j of the command I. Behind a spring in series, as a mount or a
bushing is one, the motion of the elements is less by the measured force over its stiffness. Time shifts this force as a
whole: the least-squares elements follow from a lag or delay, which Gauss-Newton steps find.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from mrwork.base.arguments import replace_unchecked, unchecked
from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.command import command_level
from mrwork.identification.objective import NormalEquations
from mrwork.records import DamperTest
from mrwork.records.motion import SmoothMotion
from mrwork.records.observation import EFFECTS, Effect, Observation

_observe = unchecked(Observation.observe)

_MASS: Final = EFFECTS["mass"]
_MOST_DEGREE = 3
# Least sensitivity of a combination of elements that counts, squared, of that of a single one.
RIDGE: Final = 1e-7
# Most steps of a lag or delay, the largest [s], and the one that ends them, in samples.
_MOST_LATE_STEPS = 12
_LONGEST_STEP = 0.01
_CLOSE = 0.01
# Step of the difference quotient by a lag or delay, in samples.
_LATE_STEP = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class Elements:
    """Displacements at which sliders slip, `n_slips` of half the largest stroke, from the `least` to a half of it.

    Dashpots yield at velocities that are the shares `yields` of the largest, and one does not.
    """

    n_slips: int
    least: float
    yields: tuple[float, ...]


# With ten sliders or four dashpots that yield masses of synthetic rigs had no smaller errors.
FINE = Elements(n_slips=7, least=1.0 / 150.0, yields=(0.03, 0.15))
COARSE = Elements(n_slips=5, least=1.0 / 60.0, yields=(0.1,))


@array_dataclass()
class SliderFit:
    """Residuals of tests, (n_residuals,), with derivatives by all elements and the effects, which are last.

    The derivatives have the shape (n_free, n_residuals), and the `values` of the effects (n_effects,).
    """

    tests: tuple[DamperTest, ...]
    residuals: Floats
    by_free: Floats
    values: Floats


@array_dataclass()
class Sliders:
    """Forces of all elements in each test, (n_elements, n_time) [N], and the acceleration of its motion, (n_time,)."""

    tests: tuple[DamperTest, ...]
    elements: tuple[Floats, ...]
    accelerations: tuple[Floats, ...]

    @classmethod
    def of(cls, tests: Sequence[DamperTest], sizes: Elements = FINE) -> Sliders:
        """Elements of the size of the tests, each of which has a constant command, or none is known of."""
        return cls(
            tests=tuple(tests),
            elements=_elements_of(tests, sizes),
            accelerations=tuple(test.acceleration for test in tests),
        )

    def behind(self, compliance: float, forces: Sequence[SmoothMotion]) -> Sliders:
        """The elements behind a spring of this compliance [m/N], which takes its share of the motion by the force."""
        moved = [
            replace_unchecked(
                test,
                displacement=test.displacement - compliance * force.displacement,
                velocity=test.velocity - compliance * force.velocity,
            )
            for test, force in zip(self.tests, forces, strict=True)
        ]
        return replace(self, elements=_elements_of(moved, FINE))

    def fit(self, effects: tuple[Effect, ...]) -> SliderFit:
        """Least squares of the elements with these effects: a mass, a lag or a delay, or a mass with either."""
        late = next((effect for effect in effects if effect.of_time), None)
        forces = self.elements
        if _MASS in effects:
            pairs = zip(forces, self.accelerations, strict=True)
            forces = tuple(np.vstack([force, acceleration]) for force, acceleration in pairs)
        dt, seconds = min(test.dt for test in self.tests), 0.0
        every = np.zeros(sum(test.n_counted for test in self.tests), dtype=np.intp)

        def best_step(residuals: Floats, by_free: Floats) -> Floats:
            normal = NormalEquations.of_parts(residuals, by_free, every)
            held = np.zeros((1, len(by_free)), dtype=np.bool_)
            (step,) = normal.steps(np.ones((1, 1)), held, ridge=RIDGE)
            return np.asarray(step)

        measured = self._recorded()
        for _ in range(_MOST_LATE_STEPS):
            by_free = self._observed(forces, late, seconds)
            best = best_step(-measured, by_free)
            residuals = best @ by_free - measured
            if late is None:
                break
            summed = tuple(best @ force for force in forces)
            later = self._observed(summed, late, seconds + _LATE_STEP * dt) - self._observed(
                summed, late, seconds
            )
            by_free = np.vstack([by_free, later / (_LATE_STEP * dt)])
            step = np.clip(best_step(residuals, by_free)[-1], -_LONGEST_STEP, _LONGEST_STEP)
            last, seconds = seconds, float(np.clip(seconds + step, *(late.free or (-np.inf, np.inf))))
            if abs(seconds - last) < _CLOSE * dt:
                break
        return SliderFit(
            tests=self.tests,
            residuals=residuals,
            by_free=by_free,
            values=np.array([*(best[-1:] if _MASS in effects else ()), *((seconds,) if late else ())]),
        )

    def _observed(self, forces: Sequence[Floats], late: Effect | None, seconds: float) -> Floats:
        """Forces of each test, (..., n_time), as its observation and `late` record them, (..., n_residuals)."""
        parts = []
        for test, force in zip(self.tests, forces, strict=True):
            observation = replace(test.observation, mass=0.0, offset=0.0)
            if late is not None:
                observation = replace(observation, **{late.field: seconds})
            parts.append(_observe(observation, force, test.dt)[..., test.counted] * self._scale(test))
        return np.concatenate(parts, axis=-1)

    def _recorded(self) -> Floats:
        """Forces that are left to the elements, (n_residuals,): without the offset and inertia that are given."""
        parts = []
        for test, acceleration in zip(self.tests, self.accelerations, strict=True):
            given = _observe(test.observation, np.zeros(test.n_time), test.dt, acceleration)
            parts.append((test.force - given)[test.counted] * self._scale(test))
        return np.concatenate(parts)

    def _scale(self, test: DamperTest) -> float:
        """Factor on residuals [1/N] with which the sum of their squares is the squared misfit of all tests."""
        return float(1.0 / np.sqrt(len(self.tests) * test.n_counted * np.var(test.force[test.counted])))


def _elements_of(tests: Sequence[DamperTest], sizes: Elements) -> tuple[Floats, ...]:
    """Forces of all elements in each test, (n_elements, n_time)."""
    stroke = 0.5 * max(float(np.ptp(test.displacement)) for test in tests)
    fastest = max(float(np.abs(test.velocity).max()) for test in tests)
    commands = np.array([_command_of(test) for test in tests])
    degree = min(np.unique(commands).size - 1, _MOST_DEGREE)
    commands /= np.abs(commands).max() or 1.0
    slips = stroke * np.geomspace(sizes.least, 0.5, sizes.n_slips)
    elements = []
    for test, sliders, command in zip(tests, _slide(tests, slips), commands, strict=True):
        speed = test.velocity / fastest
        damping = np.array([*sliders, speed, *(np.tanh(speed / share) for share in sizes.yields)])
        by_command = np.concatenate([command**power * damping for power in range(degree + 1)])
        elements.append(np.vstack([by_command, test.displacement / stroke, np.ones(test.n_time)]))
    return tuple(elements)


def _command_of(test: DamperTest) -> float:
    """The first constant command, zero where none is known."""
    for values, unit in test.commands:
        if not isinstance(values, np.ndarray):
            return command_level(values, unit)
    return 0.0


def _slide(tests: Sequence[DamperTest], slips: Floats) -> list[Floats]:
    """States in each test, (n_slips, n_time), of sliders that slip at displacements `slips` [m], from zero."""
    longest = max(test.n_time for test in tests)
    steps = np.zeros((longest, len(tests), 1))
    for index, test in enumerate(tests):
        steps[1 : test.n_time, index, 0] = np.diff(test.displacement)
    states = np.zeros((longest, len(tests), slips.size))
    for before, state, step in zip(states[:-1], states[1:], steps[1:], strict=True):
        np.clip(before + step / slips, -1.0, 1.0, out=state)
    return [states[: test.n_time, index].T for index, test in enumerate(tests)]
