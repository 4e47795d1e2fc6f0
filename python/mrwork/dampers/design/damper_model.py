"""The damper model of a design: a Bingham model whose parameters follow the current, as an identified one."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.parameters import LawName
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.summary import Summarised

Floats = NDArray[np.float64]

# Currents and velocities at which the model follows the forces of the design.
_N_CURRENTS, _N_VELOCITIES = 13, 16
# The yield force changes sign over this share of the rated velocity.
_TRANSITION = 0.02
_LAWS: Mapping[str, LawName] = {"f_c": "cubic", "c0": "cubic"}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DesignedModel(Summarised):
    """Model with current laws and its parameters `theta`, as `mr.Device` takes them.

    `nrmse` is the rms difference to the forces of the design over their rms, between zero and the largest current and
    up to the rated velocity.
    """

    _made_by: ClassVar[str] = "design.as_model()"
    _units: ClassVar[Mapping[str, str]] = {"largest_command": "A"}

    spec: DamperSpec
    theta: tuple[float, ...]
    largest_command: float
    nrmse: float

    @property
    def study_keys(self) -> str:
        """The damper as lines of a table `[[damper]]` of a study file; its storey is still to be given."""
        numbers = dict(zip(self.spec.names, map(float, self.theta), strict=True))
        coefficients = {
            parameter.name: [
                value for name, value in numbers.items() if name.partition(".")[0] == parameter.name
            ]
            for parameter in self.spec.plain
        }
        given = ", ".join(
            f"{name} = {values if len(values) > 1 else values[0]}" for name, values in coefficients.items()
        )
        return (
            f'model = "{self.spec.name}"\nparameters = {{ {given} }}\nlag = {numbers["eta"]}\n'
            f"largest_command = {self.largest_command}\n"
        )


def fitted_model(
    force: Callable[[Floats, Floats], Floats],
    *,
    velocity: float,
    largest_current: float,
    friction: float,
    response_time: float,
    transition: float | None,
) -> DesignedModel:
    """The Bingham model with current laws that follows steady forces, see `DamperDesign.as_model`.

    Parameters
    ----------
    force
        Force [N] at velocities [m/s] and currents [A] that broadcast.
    velocity, largest_current
        The model is fitted up to these [m/s] and [A].
    friction
        Yield force at zero current [N].
    response_time
        [s]; the rate of the lag is its inverse.
    transition
        Velocity over which the yield force changes sign [m/s]; 1/50 of `velocity` if none is given.
    """
    plain = damper("bingham")
    least = {parameter.name: parameter.lower for parameter in plain.plain}
    velocities = velocity * np.arange(1, _N_VELOCITIES + 1) / _N_VELOCITIES
    current = np.linspace(0.0, largest_current, _N_CURRENTS)
    wanted = force(velocities, current[:, None])
    terms = np.stack([np.ones_like(velocities), velocities], axis=1)
    yields, dampings = np.linalg.lstsq(terms, wanted.T, rcond=None)[0]
    f_c = _cubic(current, yields, max(friction, least["f_c"]))
    c0 = _cubic(current, dampings, max(float(dampings[0]), least["c0"]))
    powers = np.vander(current, 4, increasing=True)
    predicted = (powers @ f_c)[:, None] + (powers @ c0)[:, None] * velocities
    v_s = _TRANSITION * velocity if transition is None else transition
    return DesignedModel(
        spec=plain.with_current_laws(_LAWS, unit="A", lagged=True),
        theta=(*f_c.tolist(), v_s, *c0.tolist(), 0.0, 1.0 / response_time),
        largest_command=largest_current,
        nrmse=float(np.sqrt(np.mean((predicted - wanted) ** 2) / np.mean(wanted**2))),
    )


def _cubic(current: Floats, values: Floats, first: float) -> Floats:
    """Coefficients of the cubic that is `first` at zero current and fits the other values by least squares."""
    terms = np.vander(current, 4, increasing=True)[:, 1:]
    return np.array([first, *np.linalg.lstsq(terms, values - first, rcond=None)[0]])
