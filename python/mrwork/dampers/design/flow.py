"""Flow of a yield-stress fluid through the slot between piston and cylinder: exactly, and by the usual approximations.

The shear stress of the fluid is `tau_y + K (du/dy)^n`, Bingham for n = 1 and Herschel-Bulkley otherwise. The inner
wall, the piston, may move against the flow.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, ClassVar, Final, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import checked
from mrwork.base.hints import Within
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats
from mrwork.dampers.design.materials import FlowIndex, Viscosity
from mrwork.errors import SettingError

FlowModel = Literal["annulus", "plates", "sum"]
# From a micrometre to a hundred metres.
Length = Annotated[float, Within(least=1e-6, most=100.0)]
Stresses = Annotated[ArrayLike, Within(least=0.0, most=1e9)]
Flows = Annotated[ArrayLike, Within(least=0.0, most=1e3)]
WallSpeeds = Annotated[ArrayLike, Within(least=0.0, most=1e3)]

# Gauss-Legendre nodes and weights of [0, 1].
_GAUSS = np.polynomial.legendre.leggauss(24)
_NODES, _WEIGHTS = 0.5 + 0.5 * _GAUSS[0], 0.5 * _GAUSS[1]
# Doublings of the pressure gradient in the search of its upper bound.
_DOUBLINGS = 200
# Steps of a root, and its relative tolerance.
_MOST_ROOT_STEPS = 200
_TOLERANCE = 4.0 * np.finfo(np.float64).eps


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Slot(Summarised):
    """Annular slot around a piston: radius of the piston, radial gap, and length along the flow [m]."""

    _units: ClassVar[Mapping[str, str]] = {"inner_radius": "m", "gap": "m", "length": "m"}

    inner_radius: Length
    gap: Length
    length: Length

    @property
    def width(self) -> float:
        """Mean circumference, the width of the slot as parallel plates [m]."""
        return 2.0 * np.pi * (self.inner_radius + self.gap / 2.0)

    @property
    def volume(self) -> float:
        """Volume of the fluid in the slot [m^3]."""
        return self.width * self.gap * self.length


@checked
def pressure_drop(
    slot: Slot,
    flow_model: FlowModel = "annulus",
    *,
    flow: Flows,
    yield_stress: Stresses,
    viscosity: Viscosity,
    flow_index: FlowIndex = 1.0,
    wall_speed: WallSpeeds = 0.0,
) -> Floats:
    """Pressure drop of a fluid that flows through a slot, exactly in the annulus by default.

    - ``annulus``: the shear stress is `(g/2) (a^2/r - r)` with the pressure gradient g and the radius a of zero stress,
      which follow from the speed of the inner wall and from the flow (Fredrickson & Bird, Ind. Eng. Chem. 50(3), 1958,
      347-352, for walls at rest). The integrals of the velocity are Gaussian, on either side of the plug.
    - ``plates``: parallel plates as wide as the mean circumference, exactly. With walls at rest and n = 1 it is the
      root of the cubic of Phillips (Engineering Applications of Fluids with a Variable Yield Stress, thesis, Berkeley,
      1969), with a moving wall of his quintic.
    - ``sum``: a viscous and a yield part, the usual approximation: `12 eta L (Q + w h v/2)/(w h^3) + c tau_y L/h`, for
      n other than 1 with the viscosity at the wall of a fluid without yield stress. The factor c is of Phillips' cubic,
      linearised: `2.07 + 1/(1 + 0.4 T)`, `T = w h^2 tau_y/(12 Q eta)` (Yang, Spencer, Carlson, Sain, Eng. Struct.
      24(3), 2002, 309-323).

    Parameters
    ----------
    slot
        The slot.
    flow_model
        How the pressure drop is computed.
    flow
        Volume per second through the slot, relative to the outer wall [m^3/s]. At 0 the fluid is about to flow.
    yield_stress
        [Pa].
    viscosity, flow_index
        Plastic viscosity, or the consistency K [Pa s^n], and the exponent n.
    wall_speed
        Speed of the inner wall against the flow [m/s].

    Returns
    -------
    NDArray
        [Pa], of the shape to which `flow`, `yield_stress` and `wall_speed` broadcast.
    """
    flow, tau, speed = broadcast(flow=flow, yield_stress=yield_stress, wall_speed=wall_speed)
    # The flow fills what the wall displaces, too.
    mean = (flow / slot.width + speed * slot.gap / 2.0) / slot.gap
    rate = 6.0 * mean / slot.gap * (2.0 * flow_index + 1.0) / (3.0 * flow_index)
    viscous = 2.0 / slot.gap * (viscosity * rate**flow_index)
    return slot.length * _GRADIENTS[flow_model](
        _Passage(slot, flow, tau, speed, viscosity, flow_index, viscous)
    )


class _Passage(NamedTuple):
    """A flow that passes a slot, and its pressure gradient between plates without yield stress [Pa/m]."""

    slot: Slot
    flow: Floats
    tau: Floats
    wall_speed: Floats
    viscosity: float
    flow_index: float
    viscous: Floats

    def shear_rate(self, excess: Floats) -> Floats:
        """Shear rate [1/s] where the stress exceeds the yield stress by `excess` [Pa], and 0 elsewhere."""
        rate = np.maximum(excess, 0.0) / self.viscosity
        return rate if self.flow_index == 1.0 else rate ** (1.0 / self.flow_index)

    def gradient(self, compute_flow: Callable[[Floats], Floats]) -> Floats:
        """Pressure gradient [Pa/m] at which a profile moves the flow; `compute_flow` maps gradients to flows."""
        at_rest, flowing = 2.0 * self.tau / self.slot.gap, self.viscous > 0.0
        low = np.where(flowing, at_rest + 0.1 * self.viscous, 1.0)
        high = np.where(flowing, 1.5 * at_rest + 1.5 * self.viscous, 2.0)

        def excess(gradient: Floats) -> Floats:
            return compute_flow(gradient) - self.flow

        for _ in range(_DOUBLINGS):
            short = flowing & (excess(high) < 0.0)
            if not short.any():
                break
            high = np.where(short, 2.0 * high, high)
        return np.where(flowing, roots_between(excess, low, high), at_rest)


def _annular_gradient(given: _Passage) -> Floats:
    inner, outer = given.slot.inner_radius, given.slot.inner_radius + given.slot.gap

    def profile(gradient: Floats, neutral: Floats) -> tuple[Floats, Floats]:
        delta = given.tau / gradient
        root = np.sqrt(delta**2 + neutral**2)
        moving, moved = np.zeros_like(gradient), np.zeros_like(gradient)
        for sign, wall, edge in ((1.0, inner, root - delta), (-1.0, outer, root + delta)):
            edge = np.clip(edge, inner, outer)
            # Squared distances from the edge of the plug make any power of the shear rate smooth.
            radius = edge[..., None] + (wall - edge)[..., None] * _NODES**2
            weights = 2.0 * np.abs(wall - edge)[..., None] * _NODES * _WEIGHTS
            stress = 0.5 * gradient[..., None] * (neutral[..., None] ** 2 / radius - radius)
            rate = sign * given.shear_rate(sign * stress - given.tau[..., None])
            moving += np.sum(weights * rate, axis=-1)
            moved -= np.pi * np.sum(weights * rate * (radius**2 - inner**2), axis=-1)
        return moving, moved

    def compute_flow(gradient: Floats) -> Floats:
        ends = np.full_like(gradient, inner), np.full_like(gradient, outer)
        neutral = roots_between(lambda neutral: profile(gradient, neutral)[0] - given.wall_speed, *ends)
        return profile(gradient, neutral)[1]

    return given.gradient(compute_flow)


def _plate_gradient(given: _Passage) -> Floats:
    gap, speed, power = given.slot.gap, given.wall_speed, 1.0 + 1.0 / given.flow_index

    def compute_flow(gradient: Floats) -> Floats:
        # The sheared layers at the inner and the outer wall, `free` thick together.
        free = np.maximum(gap - 2.0 * given.tau / gradient, 1e-12 * gap)
        rate = given.shear_rate(gradient)
        scale = power / rate
        if given.flow_index == 1.0:
            difference = speed * scale / free
        elif not speed.any():
            difference = np.zeros_like(free)
        else:

            def excess(difference: Floats) -> Floats:
                return ((free + difference) / 2) ** power - ((free - difference) / 2) ** power - speed * scale

            difference = roots_between(excess, np.zeros_like(free), free)
        inner, outer = (free + difference) / 2.0, np.maximum(free - difference, 0.0) / 2.0
        layers = gap * outer**power / power - (inner ** (power + 1) + outer ** (power + 1)) / (
            power * (power + 1)
        )
        return given.slot.width * rate * layers

    return given.gradient(compute_flow)


def _summed_gradient(given: _Passage) -> Floats:
    gap, tau, viscous = given.slot.gap, given.tau, given.viscous
    ratio = np.divide(tau, gap * viscous, out=np.full(tau.shape, np.inf), where=viscous > 0.0)
    c: Floats = 2.07 + 1.0 / (1.0 + 0.4 * ratio)
    return viscous + c * tau / gap


_GRADIENTS: Final[Mapping[FlowModel, Callable[[_Passage], Floats]]] = {
    "annulus": _annular_gradient,
    "plates": _plate_gradient,
    "sum": _summed_gradient,
}


def broadcast(**values: ArrayLike) -> tuple[Floats, ...]:
    """Arguments of a function as arrays of the shape to which they broadcast."""
    arrays = [np.asarray(value, dtype=np.float64) for value in values.values()]
    try:
        return tuple(np.broadcast_arrays(*arrays))
    except ValueError:
        shapes = ", ".join(f"`{name}` {array.shape}" for name, array in zip(values, arrays, strict=True))
        raise SettingError(
            f"the shapes are {shapes}; give shapes that broadcast against each other"
        ) from None


def roots_between(function: Callable[[Floats], Floats], low: Floats, high: Floats) -> Floats:
    """Where a function is zero, element by element, between `low` and `high`; an end where it does not change sign.

    Chandrupatla's method: inverse quadratic interpolation where the function is smooth enough, bisection otherwise
    (Chandrupatla, Adv. Eng. Softw. 28(3), 1997, 145-149).
    """
    b, a = np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)
    f_b, f_a = function(b), function(a)
    c, f_c = a.copy(), f_a.copy()
    share = np.full(a.shape, 0.5)
    one_signed = np.sign(f_a) == np.sign(f_b)
    best = np.where(np.abs(f_a) < np.abs(f_b), a, b)
    for _ in range(_MOST_ROOT_STEPS):
        x = a + share * (b - a)
        f_x = function(x)
        same = np.sign(f_x) == np.sign(f_a)
        c, f_c = np.where(same, a, b), np.where(same, f_a, f_b)
        b, f_b = np.where(same, b, a), np.where(same, f_b, f_a)
        a, f_a = x, f_x
        best = np.where(one_signed, best, np.where(np.abs(f_a) < np.abs(f_b), a, b))
        width = np.abs(b - a)
        nearest = _TOLERANCE * np.abs(best)
        done = one_signed | (width <= 2.0 * nearest) | (f_a == 0.0) | ~np.isfinite(f_a)
        if done.all():
            break
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            xi, phi = (a - b) / (c - b), (f_a - f_b) / (f_c - f_b)
            smooth = (phi**2 < xi) & ((1.0 - phi) ** 2 < 1.0 - xi)
            quadratic = f_a / (f_b - f_a) * f_c / (f_b - f_c) + (c - a) / (b - a) * f_a / (
                f_c - f_a
            ) * f_b / (f_c - f_b)
            least = np.where(width > 0.0, nearest / width, 0.5)
        share = np.where(smooth & np.isfinite(quadratic), quadratic, 0.5)
        share = np.clip(share, np.minimum(least, 0.5), np.maximum(1.0 - least, 0.5))
    return best
