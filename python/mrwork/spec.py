"""Damper models by name: what the Rust core says of each, as plain frozen data."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.errors import UnknownNameError

Scale = Literal["linear", "log", "offset"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ParamSpec:
    """One parameter: SI unit, admissible range, how it is spread over it, a typical value."""

    name: str
    unit: str
    scale: Scale
    lower: float
    upper: float
    nominal: float
    description: str


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperSpec:
    """A damper model: equations, source, parameters in order. Declared in Rust, beside the equations."""

    name: str
    title: str
    equation: str
    description: str
    source: str
    nominal_source: str
    n_states: int
    odd: bool
    relaxes: bool
    parameters: tuple[ParamSpec, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def nominal(self) -> NDArray[np.float64]:
        """Typical parameter values, shape (n_params,)."""
        return np.array([parameter.nominal for parameter in self.parameters])


@cache
def dampers() -> tuple[DamperSpec, ...]:
    """Every registered damper model."""
    return tuple(
        DamperSpec(
            **(entry | {"parameters": tuple(ParamSpec(**parameter) for parameter in entry["parameters"])})
        )
        for entry in _rust.damper_specs()
    )


def damper(name: str) -> DamperSpec:
    """Return the damper model called `name`.

    Raises
    ------
    UnknownNameError
        Where no model has that name; the message lists those that exist.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.damper("normalised_bouc_wen").names
    ('c', 'k', 'x0', 'k_w', 'rho', 'sigma', 'n')
    """
    for spec in dampers():
        if spec.name == name:
            return spec
    known = ", ".join(spec.name for spec in dampers())
    raise UnknownNameError(f"no damper model is called {name!r}; choose one of {known}")
