"""Nested models: the simpler model that a damper model contains as a limit, and points near that limit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from mrwork.dampers.spec import DamperSpec

Values = Mapping[str, float]

# Distances from the limit, in the scale of the tests: the nearest has the simpler model's force within a few per cent,
# from the others a local minimisation sees the parameters of the larger model.
_DISTANCES = (3.0, 10.0, 30.0, 100.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Scales:
    """Half ranges of the tests: `stroke` [m], `speed` [m/s], `force` [N]."""

    stroke: float
    speed: float
    force: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Nesting:
    """A simpler `model` in the limit of a larger one.

    Parameters
    ----------
    model
        Name of the simpler model.
    shared
        Parameters that the two models share with the same meaning.
    near
        Parameters of the larger model by name that approach the force of the simpler one with these parameters, as a
        distance, at least 1, grows; in the scales of the tests.
    """

    model: str
    shared: tuple[str, ...]
    near: Callable[[Values, Scales, float], Values]

    def points(self, simpler: Values, scales: Scales) -> tuple[Values, ...]:
        """Points of the larger model near the simpler one with these parameters, farthest first."""
        return tuple(
            {**{name: simpler[name] for name in self.shared}, **self.near(simpler, scales, distance)}
            for distance in _DISTANCES
        )


def nesting_of(spec: DamperSpec) -> Nesting | None:
    """The simpler model that a model contains; `None` for the simplest of a family."""
    return NESTINGS.get(spec.name)


def _series_dashpot(p: Values, scales: Scales, distance: float) -> Values:
    """A dashpot c1 in series that hardly moves; the stiffness in parallel is divided between k0 and k1."""
    k0 = 0.1 * scales.force / scales.stroke
    k1 = p["k"] - k0
    return {
        "c0": p["c"],
        "k0": k0,
        "c1": distance * scales.force / scales.speed,
        "k1": k1,
        "x0": p["k"] * p["x0"] / k1 if k1 else p["x0"],
    }


def _no_thinning(_: Values, scales: Scales, distance: float) -> Values:
    return {"c2": scales.force / scales.speed / distance, "v_s": 0.3 * scales.speed}


def _small_shift(scale_of_side: str, side: float) -> Callable[[Values, Scales, float], Values]:
    def near(_: Values, scales: Scales, distance: float) -> Values:
        width = side * (scales.stroke if scale_of_side == "x_s" else 1.0)
        return {"mu": 0.1 * scales.speed / distance, "share": 0.5, scale_of_side: width}

    return near


def _soft_bristles(p: Values, scales: Scales, distance: float) -> Values:
    return {
        "sigma_0": p["k_w"] * p["rho"],
        "a0": p["rho"],
        "sigma_1": 0.1 * scales.force / scales.speed / distance,
        "sigma_2": p["k_x"],
    }


def _no_dashpot(_: Values, scales: Scales, distance: float) -> Values:
    return {"k_x": scales.force / scales.speed / distance}


def _small_play(_: Values, scales: Scales, distance: float) -> Values:
    return {"g": 0.3 * scales.stroke / distance}


def _exponential_knee(p: Values, scales: Scales, distance: float) -> Values:
    """The loop of Dahl; a small stiffness carries the offset of the force."""
    k = scales.force / scales.stroke / distance
    return {"c": p["k_x"], "k": k, "x0": -p["f0"] / k, "sigma": 1.0, "n": 1.0 + 1.0 / distance}


def _stiff_spring(p: Values, scales: Scales, distance: float) -> Values:
    return {
        "f_y": p["f_c"],
        "v_r": p["v_s"],
        "c": p["c0"],
        "rho": distance / scales.stroke,
        "r": scales.speed / scales.stroke / distance,
        "k": 0.0,
    }


def _stiff_series(_: Values, scales: Scales, distance: float) -> Values:
    return {
        "rho": distance / scales.stroke,
        "a": 1.0 / distance,
        "tau": scales.stroke / scales.speed / distance,
    }


def _narrow_loop(p: Values, scales: Scales, distance: float) -> Values:
    return {
        "f_o": p["f_c"],
        "V_r": p["v_s"],
        "d_r": distance * scales.stroke * p["v_s"] / scales.speed,
        "k0": 0.0,
    }


def _narrow_tied_loop(p: Values, scales: Scales, distance: float) -> Values:
    return {
        "A1": p["f_c"],
        "A2": p["c0"],
        "A3": 1.0 / p["v_s"],
        "omega": scales.speed / scales.stroke / distance,
    }


def _side_of_displacement(p: Values, scales: Scales, distance: float) -> Values:
    """From Gavin's x/d_r: with a wide x_s, delta tanh(x/x_s) is proportional to x."""
    wide = distance * scales.stroke
    return {
        "c": p["c0"],
        "k": p["k0"],
        "alpha": p["f_o"],
        "beta": 1.0 / p["V_r"],
        "delta": wide / p["d_r"],
        "x_s": wide,
    }


def _thin_loop(p: Values, scales: Scales, distance: float) -> Values:
    return {
        "a": p["f_c"],
        "b": 2.0 / p["v_s"],
        "v0": 0.0,
        "c": p["c0"],
        "h": scales.force / distance,
        "v1": 0.0,
        "w": 0.3 * scales.speed,
        "x_s": 0.3 * scales.stroke,
    }


NESTINGS: Mapping[str, Nesting] = {
    "viscous_dahl": Nesting(model="dahl", shared=("k_w", "rho", "f0"), near=_no_dashpot),
    "lugre": Nesting(model="viscous_dahl", shared=("f0",), near=_soft_bristles),
    "normalised_bouc_wen": Nesting(model="viscous_dahl", shared=("k_w", "rho"), near=_exponential_knee),
    "backlash_bouc_wen": Nesting(
        model="normalised_bouc_wen",
        shared=("c", "k", "x0", "k_w", "rho", "sigma", "n"),
        near=_small_play,
    ),
    "normalised_modified_bouc_wen": Nesting(
        model="normalised_bouc_wen", shared=("k_w", "rho", "sigma", "n"), near=_series_dashpot
    ),
    "shear_thinning_modified_bouc_wen": Nesting(
        model="normalised_modified_bouc_wen",
        shared=("c0", "k0", "c1", "k1", "x0", "k_w", "rho", "sigma", "n"),
        near=_no_thinning,
    ),
    "non_symmetric_bouc_wen": Nesting(
        model="normalised_bouc_wen",
        shared=("c", "k", "x0", "k_w", "rho", "sigma", "n"),
        near=_small_shift("w_s", 0.1),
    ),
    "non_symmetric_bouc_wen_displacement": Nesting(
        model="normalised_bouc_wen",
        shared=("c", "k", "x0", "k_w", "rho", "sigma", "n"),
        near=_small_shift("x_s", 0.1),
    ),
    "elasto_visco_plastic": Nesting(model="bingham", shared=("f0",), near=_stiff_spring),
    "extended_bingham": Nesting(model="bingham", shared=("f_c", "c0", "f0"), near=_stiff_series),
    "hyperbolic_tangent_gavin": Nesting(model="bingham", shared=("c0", "f0"), near=_narrow_loop),
    "hyperbolic_tangent_guo": Nesting(model="bingham", shared=("f0",), near=_narrow_tied_loop),
    "static_hysteretic": Nesting(
        model="hyperbolic_tangent_gavin", shared=("f0",), near=_side_of_displacement
    ),
    "polynomial_fitting": Nesting(model="bingham", shared=("f0",), near=_thin_loop),
}
"""The simpler model of each model that contains one."""
