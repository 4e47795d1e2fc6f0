"""Parameters of a Bouc-Wen damper in a named convention: Spencer's, normalised, or OpenSees'."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Annotated, Literal

import numpy as np

from mrwork.base.hints import Within
from mrwork.base.keys import suggestion
from mrwork.base.summary import Summarised, Summary
from mrwork.base.values import Floats
from mrwork.dampers.conversions import (
    USUAL_OPENSEES_ERROR,
    OpenSeesBoucWen,
    OpenSeesError,
    bouc_wen_from_normalised,
    bouc_wen_from_opensees,
    convention_remarks,
    normalised_from_bouc_wen,
    opensees_from_bouc_wen,
    require_bounded_loop,
    rescaled_bouc_wen,
    solver_remarks,
)
from mrwork.dampers.spec import damper
from mrwork.errors import SettingError

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
    remarks: tuple[str, ...] = ()

    @property
    def units(self) -> Mapping[str, str]:
        """Units by name."""
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
        return Summary(
            title=f"Bouc-Wen parameters, {self.convention}",
            columns=("parameter", "value", "unit"),
            rows=[(name, f"{value:.12g}", units.get(name, "")) for name, value in self.parameters.items()],
            notes=[f"note: {each}" for each in self.remarks],
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
    remarks = () if source == "normalised" else convention_remarks(theta)
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
        if name not in names:
            near = suggestion(name, names, otherwise="it has")
            raise SettingError(f"{convention} has no parameter {name!r}{near}")
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
    spencer: Floats = bouc_wen_from_normalised(theta, A=nominal if scale is None else scale)
    return spencer
