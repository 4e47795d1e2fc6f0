"""A Bouc-Wen damper in a named convention, Spencer's, normalised, or OpenSees', and its material in OpenSees."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from math import e, inf, log
from typing import Annotated, Final, Literal

import numpy as np

from mrwork.base.arguments import Positive, Shape, checked
from mrwork.base.hints import InUnit, Within
from mrwork.base.keys import check_known
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.dampers.conversions import bouc_wen_from_normalised, normalised_from_bouc_wen, rescaled_bouc_wen
from mrwork.dampers.spec import damper
from mrwork.errors import SettingError

OpenSeesError = Annotated[float, Within(least=1e-6, most=0.2)]
OpenSeesTimeStep = Annotated[float, Within(least=1e-6, most=1.0), InUnit("s")]
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
_NO_ROOT: Final = RemarkKind(
    "opensees_start_far",
    f"OpenSees starts its iteration at z = {_NEWTON_START:g}, far beyond the largest value {{value:.2g}} here, and may "
    "find no root",
    "convert with the scale {scale:.6g}, for which that is 1",
)
_STRAIN_STEP: Final = RemarkKind(
    "opensees_strain_step",
    "the error of OpenSees is proportional to its strain step: steps of at most {value:.3g} m keep that of z below "
    "{percent:g} % of its largest value; a smaller tolerance changes nothing",
)
_SWAPPED: Final = RemarkKind(
    "factors_swapped",
    "the factors of |v| z and v |z| differ and papers swap their names: here sigma is {value:.4g}, swapped "
    "{swapped:.4g}, and both make sense",
    "check which factor the source multiplies by |v|",
)
_NOT_PASSIVE: Final = RemarkKind(
    "loop_not_passive",
    "sigma is {value:.4g}, below 1/2: closed loops dissipate, but the element is not passive",
)


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
    if len(theta) == 8 and theta[6] <= 0.0:
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
        terms = ", ".join(f"{name} = {value:g}" for name, value in degradation.items() if value)
        raise SettingError(
            f"{terms}: the material degrades with absorbed energy, and a bouc_wen does not; set it to 0"
        )
    if not 0.0 <= m.alpha < 1.0:
        raise SettingError(f"alpha is {m.alpha:g}; a ratio of post-yield to initial stiffness lies in [0, 1)")
    if not (m.ko > 0.0 and m.Ao > 0.0):
        raise SettingError(f"ko is {m.ko:g} and Ao {m.Ao:g}; both must be positive")
    return np.array([c0, m.alpha * m.ko, 0.0, (1.0 - m.alpha) * m.ko, m.beta, m.gamma, m.Ao, m.n])


def solver_remarks(material: OpenSeesBoucWen, error: float = USUAL_OPENSEES_ERROR) -> Iterator[Remark]:
    """Remarks on the OpenSees solver for z, whose error is of first order in the strain step."""
    if not material.is_bounded:
        return
    if not material.finds_its_root:
        yield _NO_ROOT.remark(measured=Measured(material.z_max, ""), scale=material.Ao / material.z_max)
    yield _STRAIN_STEP.remark(measured=Measured(material.strain_step(error), "m"), percent=100.0 * error)


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


def convention_remarks(theta: Floats) -> Iterator[Remark]:
    """Remarks on a `bouc_wen`, shape (8,), whose source may have gamma and beta interchanged."""
    gamma, beta = float(theta[4]), float(theta[5])
    if gamma == beta or gamma + beta <= 0.0:
        return
    sigma = Measured(gamma / (gamma + beta), "")
    if gamma > 0.0 and beta > 0.0:
        yield _SWAPPED.remark(measured=sigma, swapped=1.0 - sigma.value)
    if sigma.value < 0.5:
        yield _NOT_PASSIVE.remark(measured=sigma)


Convention = Literal["spencer", "normalised", "opensees"]

NAMES: Mapping[Convention, tuple[str, ...]] = {
    "spencer": damper("bouc_wen").names,
    "normalised": damper("normalised_bouc_wen").names,
    # c0 is a dashpot in parallel.
    "opensees": ("alpha", "ko", "n", "gamma", "beta", "Ao", "deltaA", "deltaNu", "deltaEta", "c0"),
}
# Parameters that are zero by default.
_OPTIONAL = ("c0", "k0", "x0", "c", "k", "deltaA", "deltaNu", "deltaEta")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Converted(Summarised):
    """Parameters by name in a convention, in SI, and remarks on their use."""

    convention: Convention
    parameters: Mapping[str, float]
    remarks: tuple[Remark, ...] = ()

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each parameter that has one, by its name in the convention."""
        if self.convention == "opensees":
            return {"ko": "N/m", "gamma": "m^-n", "beta": "m^-n", "c0": "N s/m, in parallel"}
        spec = damper("bouc_wen" if self.convention == "spencer" else "normalised_bouc_wen")
        return {parameter.name: parameter.unit for parameter in spec.parameters if parameter.unit != "1"}

    @property
    def material(self) -> str:
        """The lines of Tcl that make the damper in OpenSees; empty of another convention."""
        if self.convention != "opensees":
            return ""
        arguments = " ".join(f"{value:.12g}" for name, value in self.parameters.items() if name != "c0")
        dashpot = self.parameters["c0"]
        beside = f"\nuniaxialMaterial Viscous $tag {dashpot:.12g} 1  ;# in parallel" if dashpot else ""
        return f"uniaxialMaterial BoucWen $tag {arguments}{beside}"

    def _summary(self) -> Summary:
        units = self.units
        rows = [(name, f"{value:.12g}", units.get(name, "")) for name, value in self.parameters.items()]
        return Summary(
            title=f"Bouc-Wen parameters, {self.convention}",
            tables=[Table(columns=("parameter", "value", "unit"), rows=rows)],
            remarks=self.remarks,
        )


def convert(
    source: Convention,
    values: Mapping[str, float],
    to: Convention,
    *,
    scale: Annotated[float, Within(least=1e-12, most=1e12)] | None = None,
    error: OpenSeesError | None = None,
) -> Converted:
    """Parameters that give the same force in another convention.

    Parameters
    ----------
    source
        Convention of the values.
    values
        Parameters by name.
    to
        The other convention.
    scale
        A of spencer or Ao of opensees, a scale that does not affect the force; default: as in the source, 120 from
        normalised, Ao 1.
    error
        Wanted error of BoucWen in OpenSees, a share of the largest value of z, for which the strain step is stated;
        default 0.005.

    Raises
    ------
    SettingError
        Where a parameter is not known or missing, or the loop is not bounded.
    """
    theta = _spencer(source, _complete(source, values), scale)
    remarks = () if source == "normalised" else tuple(convention_remarks(theta))
    if to == "opensees":
        material, c0 = opensees_from_bouc_wen(theta, Ao=1.0 if scale is None else scale)
        parameters = asdict(material) | {"c0": c0}
        remarks = (*remarks, *solver_remarks(material, error or USUAL_OPENSEES_ERROR))
        return Converted(convention=to, parameters=parameters, remarks=remarks)
    if to == "normalised":
        require_bounded_loop(theta)
        theta = normalised_from_bouc_wen(theta)
    elif scale is not None:
        theta = rescaled_bouc_wen(theta, scale)
    return Converted(
        convention=to, parameters=dict(zip(NAMES[to], theta.tolist(), strict=True)), remarks=remarks
    )


def _complete(convention: Convention, values: Mapping[str, float]) -> dict[str, float]:
    names = NAMES[convention]
    for name in values:
        sentence = f"{convention} has no parameter {name!r}"
        check_known(name, names, sentence, otherwise="it has", kind=SettingError)
    missing = [name for name in names if name not in values and name not in _OPTIONAL]
    if missing:
        raise SettingError(f"{convention} also needs {', '.join(missing)}; give each as NAME=VALUE")
    return {name: values.get(name, 0.0) for name in names}


def _spencer(convention: Convention, values: dict[str, float], scale: float | None) -> Floats:
    """The given parameters as a `bouc_wen` has them, shape (8,)."""
    if convention == "opensees":
        c0 = values.pop("c0")
        return bouc_wen_from_opensees(OpenSeesBoucWen(**values), c0=c0)
    theta = np.array(list(values.values()))
    if convention == "spencer":
        return theta
    for name in ("k_w", "rho", "sigma"):
        if values[name] <= 0.0:
            raise SettingError(f"{name} is {values[name]:g}; it must be positive for the loop to dissipate")
    nominal = damper("bouc_wen").nominal[NAMES["spencer"].index("A")]
    return np.asarray(bouc_wen_from_normalised(theta, A=nominal if scale is None else scale))
