"""Sliding-mode laws: surfaces of a building with devices, the gains, and the settings of the laws."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.base.arguments import checked
from mrwork.base.keys import key, positive
from mrwork.base.summary import Summarised
from mrwork.base.values import Floats, array_dataclass
from mrwork.control.laws.law_problem import Design, DesignProblem, LawSettings, Span
from mrwork.control.linear.plant import Plant
from mrwork.control.linear.riccati import solve_riccati
from mrwork.errors import SettingError


@array_dataclass(repr=False)
class SlidingSurface(Summarised):
    """`sigma = S s`, scaled so that S B = 1: `sigma' = drift s + f + ground a_g`, and sigma is an impulse [N s].

    `drift` is S A, shape (n_devices, 2n): the resisting force `f = -drift s` keeps sigma constant without ground
    motion. `ground` is S E, the effect of a ground acceleration on sigma; `poles` belong to the motion on sigma = 0,
    shape (2n - n_devices,).
    """

    _units: ClassVar[Mapping[str, str]] = {"poles": "1/s", "ground": "kg"}

    S: Floats
    drift: Floats
    ground: Floats
    poles: NDArray[np.complex128]


@checked
def optimal_surface(plant: Plant) -> SlidingSurface:
    """The surface that minimises `int s'Q s dt`, the energy (Utkin & Young, Autom. Remote Control 39, 1978, 1466-1470).

    In coordinates in which B = [0; B_2], x_2 is the part of the state that the devices drive directly, and acts as the
    control of the other part x_1; its regulator x_2 = -F x_1 is the surface.

    Raises
    ------
    SettingError
        If devices act on the same coordinates.
    """
    back, A, n_moved = _regular_form(plant)
    Q, size = back.T @ plant.energy @ back, len(A)
    rest = slice(None, size - n_moved)
    moved = slice(size - n_moved, None)
    F, _ = solve_riccati(
        A[rest, rest],
        A[rest, moved],
        Q[rest, rest],
        Q[moved, moved],
        Q[rest, moved],
        scaling=np.eye(size - n_moved),
    )
    rows = np.hstack([F, np.eye(n_moved)]) @ np.linalg.inv(back)
    S = np.linalg.solve(rows @ plant.B, rows)
    return SlidingSurface(
        S=S,
        drift=S @ plant.A,
        ground=S @ plant.E,
        poles=np.linalg.eigvals(A[rest, rest] - A[rest, moved] @ F).astype(np.complex128),
    )


def _regular_form(plant: Plant) -> tuple[Floats, Floats, int]:
    """T of s = T [x_1; x_2] and T^-1 A T, with T^-1 B = [0; B_2], and the size of x_2."""
    B = np.linalg.solve(plant.scaling, plant.B)
    orthogonal, triangular = np.linalg.qr(B, mode="complete")
    n_moved = plant.n_devices
    diagonal = np.abs(np.diag(triangular))
    if not diagonal.min() > 1e-10 * diagonal.max():
        raise SettingError(
            "two devices act on the building in the same way; a sliding surface needs one device for each "
            "direction: design it for one of them and share its force"
        )
    back = plant.scaling @ np.hstack([orthogonal[:, n_moved:], orthogonal[:, :n_moved]])
    return back, np.linalg.solve(back, plant.A @ back), n_moved


@dataclass(frozen=True, slots=True, kw_only=True)
class _SurfaceSettings(LawSettings):
    """A sliding surface of least energy of the building, with gains for ground motions of a given peak."""

    peak_acceleration: float = key(
        "peak acceleration of the ground motions",
        unit="m/s2",
        above=0.0,
        span=Span(lower=0.01, upper=10.0, start=1.0, of=(("ground", 1.0),)),
    )
    largest_force: float = key(
        "largest force of each device with all its dampers",
        unit="N",
        above=0.0,
        span=Span(lower=0.1, upper=10.0, start=1.0, of=(("force", 1.0),), free=False),
    )
    frequency: float = positive(
        "highest frequency at which the ground reaches its peak acceleration",
        unit="Hz",
        default=5.0,
        span=Span(lower=0.2, upper=20.0, free=False),
    )
    margin: float = key("switching force over the disturbance", default=1.2, above=1.0)
    bandwidth: float = positive(
        "bandwidth inside the boundary layer; below the bandwidth of the driver",
        unit="1/s",
        default=100.0,
        span=Span(lower=10.0, upper=180.0),
    )

    _gains: ClassVar[tuple[str, ...]]
    # In the loop the force decreases sigma, hence the sign.
    _side: ClassVar[float] = -1.0

    def design(self, problem: DesignProblem) -> Design:
        """The design of the law on the optimal surface of the building, which the problem keeps."""
        surface = problem._keep(optimal_surface, lambda: optimal_surface(problem.plant))
        gains = self.gains(surface)
        return Design(
            gains={"surface": self._side * surface.S, **{name: gains[name] for name in self._gains}}
        )

    def gains(self, surface: SlidingSurface) -> dict[str, Floats]:
        """Gains by name that keep the state on a surface under ground motions of the peak, a number for each device.

        `switching` and `boundary` are rho [N] and phi [N s] of `f_c = -drift s - rho sat(sigma/phi)`, `adaptation` is
        gamma [1/s^2] of the gain `rho' = gamma |sigma| sgn(|sigma| - phi)` within floor and ceiling [N] (Plestan et
        al., Int. J. Control 83(9), 2010, 1907-1919), `root_gain` and `integral_gain` are k_1 [N/(N s)^0.5] and k_2
        [N/s] of the super-twisting `f_c = -drift s - k_1 |sigma|^0.5 sgn sigma + w, w' = -k_2 sgn sigma` (Levant, Int.
        J. Control 58(6), 1993, 1247-1263).

        The disturbance is d = ground a_g. Switching rejects it if rho > |d|: `rho = margin |ground| peak`. Inside the
        boundary layer sigma decays with rho/phi, so `phi = rho/bandwidth` (Slotine & Li, Applied Nonlinear Control,
        1991, 7.2); above the rate of the driver's lag, 190 1/s in Spencer et al. 1997, the law chatters. The
        super-twisting law requires |d'| <= L = margin |ground| 2 pi frequency peak: `k_1 = 1.5 L^0.5, k_2 = 1.1 L`
        (Levant, Int. J. Control 76(9-10), 2003, 924-941). The adaptive gain rises from zero to rho in a tenth of a
        second at |sigma| = 2 phi, at most to the largest force of the device.
        """
        # A device without disturbance needs a gain, too: a thousandth of its force.
        disturbance = self.margin * np.abs(surface.ground) * self.peak_acceleration
        switching = np.maximum(disturbance, 1e-3 * self.largest_force)
        boundary = switching / self.bandwidth
        slope = 2.0 * np.pi * self.frequency * switching
        return {
            "gain": surface.drift,
            "switching": switching,
            "boundary": boundary,
            "adaptation": switching / (0.1 * 2.0 * boundary),
            "floor": 0.01 * switching,
            "ceiling": np.maximum(self.largest_force, switching),
            "drift": surface.drift,
            "push": np.ones(len(surface.S)),
            "root_gain": 1.5 * np.sqrt(slope),
            "integral_gain": 1.1 * slope,
        }


@checked
class SlidingSettings(_SurfaceSettings):
    """A sliding mode with a boundary layer."""

    _gains = ("gain", "boundary", "switching")


@checked
class AdaptiveSlidingSettings(_SurfaceSettings):
    """A sliding mode whose gain adapts."""

    _gains = ("gain", "boundary", "adaptation", "floor", "ceiling")


@checked
class SuperTwistingSettings(_SurfaceSettings):
    """A second-order sliding mode."""

    _gains = ("drift", "push", "root_gain", "integral_gain")
    _side = 1.0
