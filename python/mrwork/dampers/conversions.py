"""Relations between models: exact conversions between equivalent forms, and the simpler model that a model contains.

A conversion accepts NumPy and JAX arrays, its Jacobian NumPy arrays only. A nested model is a limit of the other;
`Nesting` gives points near it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import e, inf, log
from typing import Annotated, Any, Final

import numpy as np

from mrwork.base.arguments import AnyArray, Positive, Shape, checked
from mrwork.base.hints import Within
from mrwork.base.values import Floats
from mrwork.errors import SettingError

# NumPy or JAX.
Array = Any

# A number that is not finite is refused in a sentence.
_QUIET = np.errstate(divide="ignore", invalid="ignore", over="ignore")


# Imaginary step of a derivative, far below what adds to a real part.
_STEP = 1e-100


@dataclass(frozen=True, slots=True, kw_only=True)
class Conversion:
    """A map of parameter sets, shape (..., n_from) to (..., n_to), and its Jacobian, shape (..., n_to, n_from)."""

    convert: Callable[..., Array]
    jacobian: Callable[[Floats], Floats]

    @classmethod
    def of(cls, convert: Callable[..., Array]) -> Conversion:
        """The conversion by an analytic function, whose Jacobian is its imaginary part after an imaginary step.

        It is exact to rounding (Squire & Trapp, SIAM Rev. 40, 1998, 110-112).
        """

        def jacobian(theta: Floats) -> Floats:
            stepped = theta[..., None, :] + 1j * _STEP * np.eye(theta.shape[-1])
            return np.asarray(np.swapaxes(convert(stepped).imag / _STEP, -1, -2))

        return cls(convert=convert, jacobian=jacobian)

    def __call__(self, theta: Array) -> Array:
        """Converted parameters, shape (..., n_to)."""
        return self.convert(theta)

    def at(self, A: float) -> Conversion:
        """The same conversion with a fixed `A`, for forms with one redundant scale parameter."""
        return Conversion.of(lambda theta: self.convert(theta, A))


def _check_columns(theta: Array, count: int) -> None:
    if theta.ndim < 1 or theta.shape[-1] != count:
        raise SettingError(
            f"`theta` has shape {theta.shape}; give shape (..., {count}), one value a parameter"
        )


def _refuse_infinite(theta: Array) -> Array:
    """Converted parameters; those that JAX traces have no values yet."""
    if isinstance(theta, np.ndarray) and not np.isfinite(theta).all():
        raise SettingError(
            "the parameters have no equivalent in this form: a number would not be finite; give a positive A, rho and "
            "sum of gamma and beta, closer to nominal values"
        )
    return theta


@_QUIET
def _normalised_from_bouc_wen(theta: Array) -> Array:
    _check_columns(theta, 8)
    xp = theta.__array_namespace__()
    c0, k0, x0, alpha, gamma, beta, A, n = (theta[..., index] for index in range(8))
    z_max = (A / (beta + gamma)) ** (1.0 / n)
    return _refuse_infinite(
        xp.stack([c0, k0, x0, alpha * z_max, A / z_max, gamma / (beta + gamma), n], axis=-1)
    )


@_QUIET
def _bouc_wen_from_normalised(theta: Array, A: float) -> Array:
    _check_columns(theta, 7)
    xp = theta.__array_namespace__()
    c, k, x0, k_w, rho, sigma, n = (theta[..., index] for index in range(7))
    z_max = A / rho
    sum_ = A / z_max**n
    return _refuse_infinite(
        xp.stack([c, k, x0, k_w / z_max, sigma * sum_, (1.0 - sigma) * sum_, xp.full(n.shape, A), n], axis=-1)
    )


@checked
def normalised_from_bouc_wen(theta: AnyArray) -> Array:
    """Parameters of `normalised_bouc_wen`, shape (..., 7), equal in force to a `bouc_wen`, shape (..., 8).

    With z_max = (A/(beta+gamma))^(1/n): rho = A/z_max, sigma = gamma/(beta+gamma), k_w = alpha z_max
    (Ikhouane, Rodellar 2007).
    """
    return _normalised_from_bouc_wen(theta)


@checked
def bouc_wen_from_normalised(theta: AnyArray, A: float) -> Array:
    """Parameters of `bouc_wen`, shape (..., 8), equal in force to a `normalised_bouc_wen`, shape (..., 7).

    The Spencer form has one redundant scale parameter, which `A` fixes.
    """
    return _bouc_wen_from_normalised(theta, A)


NORMALISED_FROM_BOUC_WEN: Final = Conversion.of(_normalised_from_bouc_wen)
BOUC_WEN_FROM_NORMALISED: Final = Conversion.of(_bouc_wen_from_normalised)


@_QUIET
def rescaled_bouc_wen(theta: AnyArray, A: float) -> Array:
    """Rescale a `bouc_wen`, shape (..., 8), to another `A`: z is multiplied by s = A_new/A, the force is the same."""
    _check_columns(theta, 8)
    xp = theta.__array_namespace__()
    c0, k0, x0, alpha, gamma, beta, old, n = (theta[..., index] for index in range(8))
    s = A / old
    power = s ** (1.0 - n)
    return _refuse_infinite(
        xp.stack([c0, k0, x0, alpha / s, power * gamma, power * beta, xp.full(n.shape, A), n], axis=-1)
    )


OpenSeesError = Annotated[float, Within(least=1e-6, most=0.2)]
OpenSeesTimeStep = Annotated[float, Within(least=1e-6, most=1.0)]
USUAL_OPENSEES_ERROR: Final = 0.005
"""Error of z in OpenSees, as a share of its largest value, for which a strain step is stated where none is wanted."""


@checked
class OpenSeesBoucWen:
    """Uniaxial material `BoucWen` of OpenSees, with its names and order of arguments.

    ``f = alpha ko x + (1 - alpha) ko z``, ``z' = (A - |z|^n (gamma + beta sgn(v z)) nu) v / eta``, where A, nu and eta
    depend on the absorbed energy e: A = Ao - deltaA e, nu = 1 + deltaNu e, eta = 1 + deltaEta e (`setTrialStrain` in
    SRC/material/uniaxial/BoucWenMaterial.cpp; its z after each step solves the backward Euler rule).
    Thus beta multiplies ``|v| z``, like gamma of Spencer, and gamma multiplies ``v |z|``, like his beta.
    """

    alpha: float
    ko: float
    n: float
    gamma: float
    beta: float
    Ao: float
    deltaA: float = 0.0  # noqa: N815 - OpenSees' own spelling
    deltaNu: float = 0.0  # noqa: N815 - OpenSees' own spelling
    deltaEta: float = 0.0  # noqa: N815 - OpenSees' own spelling

    @property
    def is_bounded(self) -> bool:
        """Whether z stays bounded and closed loops dissipate, without degradation."""
        degrades = self.deltaA or self.deltaNu or self.deltaEta
        return self.Ao > 0.0 and self.gamma + self.beta > 0.0 and self.beta > 0.0 and not degrades

    @property
    def z_max(self) -> float:
        """Largest value of z, of a loop that is bounded."""
        return float((self.Ao / (self.gamma + self.beta)) ** (1.0 / self.n))

    @property
    def finds_its_root(self) -> bool:
        """Whether the Newton iteration for z converges, of a loop that is bounded.

        It starts at z = 0.01 in every step and ends after 20 iterations. Beyond the largest z it gains a factor of
        n/(n-1) an iteration for sigma >= 1/2, and may diverge below.
        """
        if self.z_max >= _NEWTON_START:
            return True
        gain = log(self.n / (self.n - 1.0)) if self.n > 1.0 else inf
        return self.beta >= self.gamma and log(_NEWTON_START / self.z_max) / gain <= _FAR_ITERATIONS

    @checked
    def strain_step(self, error: OpenSeesError) -> float:
        """Strain step [m] up to which OpenSees keeps the error of z below a share `error` of its largest value.

        Its backward Euler rule is of first order in the strain step d. With w = z/z_max, rho = Ao/z_max,
        sigma = beta/(beta+gamma) and ``phi(w) = 1 - |w|^n (1 - sigma + sigma sgn(w))``, a branch from w_0 has the error
        ``rho d phi ln(phi/phi_0) / 2`` to first order. Its largest value after a full reversal, from w_0 = -1, is
        ``rho d sigma / e`` for sigma >= 1/2; below, ``rho d max(1/e, ln(1/(2 sigma))) / 2``. Irregular motions with
        reversals within the loop reach up to 1.05 times this for sigma >= 1/2 and 1.42 times below, for which there is
        a margin.
        """
        if not self.is_bounded:
            raise SettingError(
                "the strain step is known only for a loop that is bounded and does not degrade; give positive Ao, beta "
                "and gamma + beta, and zero deltaA, deltaNu and deltaEta"
            )
        total = self.gamma + self.beta
        rho, sigma = self.Ao / self.z_max, self.beta / total
        of_passive, of_others = _MARGIN_PASSIVE * sigma / e, _MARGIN * 0.5 * max(1.0 / e, log(0.5 / sigma))
        largest = of_passive if sigma >= 0.5 else of_others
        return error / (rho * largest)


# Largest error of irregular motions over the error of a full reversal, measured with sums of four sines, sigma from 0.1
# to 1.3 and n from 1 to 5.
_MARGIN_PASSIVE = 1.1
_MARGIN = 1.5
# Start of the iteration of OpenSees, and how many of its 20 iterations may pass far from the root.
_NEWTON_START = 0.01
_FAR_ITERATIONS = 14.0


@checked
def opensees_from_bouc_wen(
    theta: Annotated[Floats, Shape(("n_params",))], *, Ao: Positive = 1.0
) -> tuple[OpenSeesBoucWen, float]:
    """OpenSees material equal to a `bouc_wen`, shape (8,), and the dashpot c0 [N s/m] to add in parallel.

    `BoucWen` of OpenSees has no dashpot; c0 becomes a parallel `Viscous` material. With `Ao` = 1, ko is the initial and
    alpha ko the post-yield stiffness, as in its manual.

    Raises
    ------
    SettingError
        If no such material exists; the message gives the reason.
    """
    _check_columns(theta, 8)
    if theta[6] <= 0.0:
        raise SettingError(f"A is {theta[6]:g}; the loop has a stiffness only where A is positive")
    c0, k0, x0, alpha, gamma, beta, _, n = map(float, rescaled_bouc_wen(theta, Ao))
    if k0 * x0 != 0.0:
        raise SettingError(
            f"x0 is {x0:g} m and offsets the force by -k0 x0 = {-k0 * x0:g} N, which OpenSees' BoucWen cannot; "
            "convert with x0=0 and apply that force as a constant load"
        )
    if k0 < 0.0 or alpha <= 0.0:
        raise SettingError(
            f"k0 is {k0:g} N/m and alpha {theta[3]:g} N/m, so the post-yield ratio of OpenSees would be "
            f"{k0 / (k0 + alpha) if k0 + alpha else float('inf'):g}, outside [0, 1); only k0 >= 0 and alpha > 0 convert"
        )
    ko = k0 + alpha
    return OpenSeesBoucWen(alpha=k0 / ko, ko=ko, n=n, gamma=beta, beta=gamma, Ao=Ao), c0


@checked
def bouc_wen_from_opensees(material: OpenSeesBoucWen, *, c0: float = 0.0) -> Floats:
    """Parameters of `bouc_wen`, shape (8,), equal in force to an OpenSees material and a parallel dashpot c0 [N s/m].

    A equals Ao: z is the same variable in both.

    Raises
    ------
    SettingError
        If the material degrades, or a value is outside the ranges of the OpenSees manual.
    """
    m = material
    degradation = {"deltaA": m.deltaA, "deltaNu": m.deltaNu, "deltaEta": m.deltaEta}
    if any(degradation.values()):
        given = ", ".join(f"{name} = {value:g}" for name, value in degradation.items() if value)
        raise SettingError(
            f"{given}: the material degrades with absorbed energy, and a bouc_wen does not; set it to 0"
        )
    if not 0.0 <= m.alpha < 1.0:
        raise SettingError(f"alpha is {m.alpha:g}; a ratio of post-yield to initial stiffness lies in [0, 1)")
    if not (m.ko > 0.0 and m.Ao > 0.0):
        raise SettingError(f"ko is {m.ko:g} and Ao {m.Ao:g}; both must be positive")
    return np.array([c0, m.alpha * m.ko, 0.0, (1.0 - m.alpha) * m.ko, m.beta, m.gamma, m.Ao, m.n])


def solver_remarks(material: OpenSeesBoucWen, error: float = USUAL_OPENSEES_ERROR) -> tuple[str, ...]:
    """Remarks on the OpenSees solver for z, whose error is of first order in the strain step."""
    if not material.is_bounded:
        return ()
    step = (
        f"the error of OpenSees is proportional to its strain step: steps of at most {material.strain_step(error):.3g} "
        f"m keep that of z below {100.0 * error:g} % of its largest value; a smaller tolerance changes nothing"
    )
    if material.finds_its_root:
        return (step,)
    scale = material.Ao / material.z_max
    return (
        f"OpenSees starts its iteration at z = {_NEWTON_START:g}, far beyond the largest value {material.z_max:.2g} "
        f"here, and may find no root; convert with the scale {scale:.6g}, for which that is 1",
        step,
    )


def require_bounded_loop(theta: Floats) -> Floats:
    """The parameters of a `bouc_wen`, shape (8,), which are refused without a normalised form."""
    alpha, gamma, beta, A, n = map(float, theta[3:])
    if not (alpha > 0.0 and A > 0.0 and n >= 1.0):
        raise SettingError(
            f"alpha is {alpha:g}, A {A:g} and n {n:g}; the normalised form wants alpha, A > 0 and n >= 1"
        )
    if gamma + beta <= 0.0:
        raise SettingError(
            f"gamma + beta is {gamma + beta:g}; z is bounded, and can be normalised, only where the sum is positive"
        )
    if gamma <= 0.0:
        raise SettingError(
            f"the factor of |v| z is {gamma:g}, so no loop dissipates; "
            "if the source has it the other way round, swap gamma and beta"
        )
    return theta


def convention_remarks(theta: Floats) -> tuple[str, ...]:
    """Remarks on a `bouc_wen`, shape (8,), whose source may have gamma and beta interchanged."""
    gamma, beta = float(theta[4]), float(theta[5])
    if gamma == beta or gamma + beta <= 0.0:
        return ()
    remarks = []
    sigma = gamma / (gamma + beta)
    if gamma > 0.0 and beta > 0.0:
        remarks.append(
            f"the factors of |v| z and v |z| differ and papers swap their names: here sigma is {sigma:.4g}, "
            f"swapped {1.0 - sigma:.4g}, and both make sense; check which factor the source multiplies by |v|"
        )
    if sigma < 0.5:
        remarks.append(
            f"sigma is {sigma:.4g}, below 1/2: closed loops dissipate, but the element is not passive"
        )
    return tuple(remarks)


def of_modified(plain: Conversion) -> Conversion:
    """The conversion for modified Bouc-Wen models: c0, k0, c1, k1 and x0 stay, the loop is converted."""

    def without_series(theta: Array) -> Array:
        """Parameters that a modified Bouc-Wen model shares with the plain one: c0, k0, x0 and the loop."""
        return theta.__array_namespace__().concat([theta[..., :2], theta[..., 4:]], axis=-1)

    def convert(theta: Array, *scale: float) -> Array:
        loop = plain.convert(without_series(theta), *scale)
        return theta.__array_namespace__().concat([theta[..., :5], loop[..., 3:]], axis=-1)

    return Conversion.of(convert)


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
    """A simpler `model` in the limit of a larger one, with the parameters that they share.

    `near`: the other parameters of the larger one, from the parameters of the simpler one in the scales of the tests,
    as a distance of at least 1 grows.
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


_NORMALISED = ("c", "k", "x0", "k_w", "rho", "sigma", "n")


def _small_shift(side: str, width: Callable[[Scales], float]) -> Callable[[Values, Scales, float], Values]:
    return lambda _, tests, distance: {
        "mu": 0.1 * tests.speed / distance,
        "share": 0.5,
        side: 0.1 * width(tests),
    }


def _series_dashpot(p: Values, tests: Scales, distance: float) -> Values:
    """A dashpot c1 in series that hardly moves; the stiffness in parallel is divided between k0 and k1."""
    k0 = 0.1 * tests.force / tests.stroke
    k1 = p["k"] - k0
    x0 = p["k"] * p["x0"] / k1 if k1 else p["x0"]
    return {"c0": p["c"], "k0": k0, "c1": distance * tests.force / tests.speed, "k1": k1, "x0": x0}


def _exponential_knee(p: Values, tests: Scales, distance: float) -> Values:
    """The loop of Dahl; a small stiffness carries the offset of the force."""
    k = tests.force / tests.stroke / distance
    return {"c": p["k_x"], "k": k, "x0": -p["f0"] / k, "sigma": 1.0, "n": 1.0 + 1.0 / distance}


NESTINGS: Mapping[str, Nesting] = {
    "viscous_dahl": Nesting(model="dahl", shared=("k_w", "rho", "f0"), near=lambda _, tests, distance: {
        "k_x": tests.force / tests.speed / distance}),
    "lugre": Nesting(model="viscous_dahl", shared=("f0",), near=lambda p, tests, distance: {
        "sigma_0": p["k_w"] * p["rho"], "a0": p["rho"], "sigma_1": 0.1 * tests.force / tests.speed / distance,
        "sigma_2": p["k_x"]}),
    "normalised_bouc_wen": Nesting(model="viscous_dahl", shared=("k_w", "rho"), near=_exponential_knee),
    "backlash_bouc_wen": Nesting(model="normalised_bouc_wen", shared=_NORMALISED, near=lambda _, tests, distance: {
        "g": 0.3 * tests.stroke / distance}),
    "normalised_modified_bouc_wen": Nesting(model="normalised_bouc_wen", shared=("k_w", "rho", "sigma", "n"),
        near=_series_dashpot),
    "shear_thinning_modified_bouc_wen": Nesting(model="normalised_modified_bouc_wen",
        shared=("c0", "k0", "c1", "k1", "x0", "k_w", "rho", "sigma", "n"), near=lambda _, tests, distance: {
        "c2": tests.force / tests.speed / distance, "v_s": 0.3 * tests.speed}),
    "non_symmetric_bouc_wen": Nesting(model="normalised_bouc_wen", shared=_NORMALISED,
        near=_small_shift("w_s", lambda _: 1.0)),
    "non_symmetric_bouc_wen_displacement": Nesting(model="normalised_bouc_wen", shared=_NORMALISED,
        near=_small_shift("x_s", lambda tests: tests.stroke)),
    "elasto_visco_plastic": Nesting(model="bingham", shared=("f0",), near=lambda p, tests, distance: {
        "f_y": p["f_c"], "v_r": p["v_s"], "c": p["c0"], "rho": distance / tests.stroke,
        "r": tests.speed / tests.stroke / distance, "k": 0.0}),
    "extended_bingham": Nesting(model="bingham", shared=("f_c", "c0", "f0"), near=lambda _, tests, distance: {
        "rho": distance / tests.stroke, "a": 1.0 / distance, "tau": tests.stroke / tests.speed / distance}),
    "hyperbolic_tangent_gavin": Nesting(model="bingham", shared=("c0", "f0"), near=lambda p, tests, distance: {
        "f_o": p["f_c"], "V_r": p["v_s"], "d_r": distance * tests.stroke * p["v_s"] / tests.speed, "k0": 0.0}),
    "hyperbolic_tangent_guo": Nesting(model="bingham", shared=("f0",), near=lambda p, tests, distance: {
        "A1": p["f_c"], "A2": p["c0"], "A3": 1.0 / p["v_s"], "omega": tests.speed / tests.stroke / distance}),
    # From Gavin's x/d_r: with a wide x_s, delta tanh(x/x_s) is proportional to x.
    "static_hysteretic": Nesting(model="hyperbolic_tangent_gavin", shared=("f0",), near=lambda p, tests, distance: {
        "c": p["c0"], "k": p["k0"], "alpha": p["f_o"], "beta": 1.0 / p["V_r"],
        "delta": distance * tests.stroke / p["d_r"], "x_s": distance * tests.stroke}),
    "polynomial_fitting": Nesting(model="bingham", shared=("f0",), near=lambda p, tests, distance: {
        "a": p["f_c"], "b": 2.0 / p["v_s"], "v0": 0.0, "c": p["c0"], "h": tests.force / distance, "v1": 0.0,
        "w": 0.3 * tests.speed, "x_s": 0.3 * tests.stroke}),
}  # fmt: skip
"""The simpler model of each model that contains one."""
