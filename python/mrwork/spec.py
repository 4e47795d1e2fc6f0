"""Damper models by name: what the Rust core says of each, as plain frozen data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork import _rust
from mrwork.errors import SettingError, UnknownNameError
from mrwork.presets import PUBLISHED_SETS, PublishedSet

Scale = Literal["linear", "log", "offset"]
LawName = Literal["constant", "linear", "quadratic", "cubic", "exponential"]
CommandUnit = Literal["A", "V"]


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
    is_exponent: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class CurrentLaws:
    """How each parameter of the plain model follows the command, which is in `unit`.

    With `u` the command as the coil gets it: constant `p = p.0`; linear, quadratic and cubic
    `p = p.0 + p.1 u + p.2 u^2 + p.3 u^3`; exponential `p = p.0 + p.1 exp(p.2 u)`. A parameter that follows the
    command stays within the range the plain model admits. A lagged driver has `u' = -eta (u - command)`.
    """

    unit: CommandUnit
    laws: tuple[LawName, ...]
    lagged: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class DamperSpec:
    """A damper model: equations, source, parameters in order. Declared in Rust, beside the equations.

    A model with current laws has their coefficients for parameters, named `k_w.0`, `k_w.1`; `plain` has those of the
    model itself.
    """

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
    plain: tuple[ParamSpec, ...]
    current: CurrentLaws | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def nominal(self) -> NDArray[np.float64]:
        """Typical parameter values, shape (n_params,)."""
        return np.array([parameter.nominal for parameter in self.parameters])

    def with_current_laws(
        self, laws: Mapping[str, LawName], *, unit: CommandUnit = "A", lagged: bool = False
    ) -> DamperSpec:
        """Return the model with parameters that follow the command; those not named are constant.

        Parameters
        ----------
        laws
            Parameter name to the name of its law.
        unit
            What the command is measured in; a test in the other unit is refused.
        lagged
            Whether the command reaches the coil through a first-order lag, with its rate `eta` for a parameter.

        Raises
        ------
        UnknownNameError
            Where the model has no such parameter, or there is no such law.
        SettingError
            Where the model has current laws already.

        Examples
        --------
        >>> import mrwork as mr
        >>> model = mr.damper("dahl").with_current_laws({"k_w": "quadratic"})
        >>> model.names
        ('k_w.0', 'k_w.1', 'k_w.2', 'rho', 'f0')
        """
        if self.current is not None:
            raise SettingError(
                f"{self.name} has current laws already; give them to the plain model, all at once"
            )
        for name, law in laws.items():
            if name not in self.names:
                raise UnknownNameError(
                    f"{self.name} has no parameter {name!r} to follow the command; it has {', '.join(self.names)}"
                )
            if law not in _coefficient_counts():
                raise UnknownNameError(
                    f"no current law is called {law!r}; choose one of {', '.join(_coefficient_counts())}"
                )
        chosen: tuple[LawName, ...] = tuple(laws.get(name, "constant") for name in self.names)
        parameters: list[ParamSpec] = []
        for parameter, law in zip(self.plain, chosen, strict=True):
            parameters += _coefficients(parameter, law, unit)
        if lagged:
            parameters.append(_DRIVER_RATE)
        followed = [
            _equation(name, law) for name, law in zip(self.names, chosen, strict=True) if law != "constant"
        ]
        driver = f"u' = -eta (u - command) [{unit}]" if lagged else f"u = command [{unit}]"
        return replace(
            self,
            equation="\n".join([self.equation, *followed, driver]),
            parameters=tuple(parameters),
            current=CurrentLaws(unit=unit, laws=chosen, lagged=lagged),
        )

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the model's published parameter sets."""
        return tuple(entry.name for entry in PUBLISHED_SETS if entry.model == self.name)

    def preset(self, name: str) -> Preset:
        """Return a published parameter set of the model.

        Raises
        ------
        UnknownNameError
            Where the model has no such set; the message lists those it has.

        Examples
        --------
        >>> import mrwork as mr
        >>> prototype = mr.damper("modified_bouc_wen").preset("dyke1996")
        >>> prototype.status, prototype.spec.current.unit, len(prototype.theta)
        ('verified', 'V', 14)
        """
        for entry in PUBLISHED_SETS:
            if (entry.model, entry.name) == (self.name, name):
                return _preset(self, entry)
        known = ", ".join(self.presets) or "none"
        raise UnknownNameError(f"{self.name} has no published set called {name!r}; it has {known}")


@dataclass(frozen=True, slots=True, kw_only=True)
class Preset:
    """A published set ready to be simulated: the model with its current laws, and `theta` in its order.

    `status` says whether the set was verified or is only published; see `PublishedSet`.
    """

    name: str
    spec: DamperSpec
    theta: tuple[float, ...]
    source: str
    status: Literal["verified", "published"]
    largest_command: float | None
    note: str


def _preset(plain: DamperSpec, entry: PublishedSet) -> Preset:
    degrees: tuple[LawName, ...] = ("constant", "linear", "quadratic", "cubic")
    laws: dict[str, LawName] = {}
    theta: list[float] = []
    for name in plain.names:
        value = entry.values[name]
        coefficients = value if isinstance(value, tuple) else (value,)
        laws[name] = degrees[len(coefficients) - 1]
        theta += coefficients
    spec = plain
    if entry.unit is not None:
        spec = plain.with_current_laws(laws, unit=entry.unit, lagged=entry.eta is not None)
        theta += () if entry.eta is None else (entry.eta,)
    return Preset(
        name=entry.name,
        spec=spec,
        theta=tuple(theta),
        source=entry.source,
        status=entry.status,
        largest_command=entry.largest_command,
        note=entry.note,
    )


# Lag of an MR damper's coil and driver: 190 1/s in Spencer et al. 1997 and Dyke et al. 1996.
_DRIVER_RATE = ParamSpec(
    name="eta",
    unit="1/s",
    scale="log",
    lower=1.0,
    upper=1e5,
    nominal=190.0,
    description="rate of the driver's first-order lag",
)


@cache
def _coefficient_counts() -> dict[str, int]:
    return dict(_rust.current_laws())


def _coefficients(parameter: ParamSpec, law: LawName, unit: CommandUnit) -> list[ParamSpec]:
    """The numbers of a parameter's law; the nominal ones make it constant."""
    if law == "constant":
        return [parameter]
    widest = max(abs(parameter.lower), abs(parameter.upper))
    entries = []
    for power in range(_coefficient_counts()[law]):
        exponent = law == "exponential" and power == 2
        bound = 20.0 if exponent else widest
        divisor = (
            ""
            if power == 0 or (law == "exponential" and not exponent)
            else unit
            if power == 1 or exponent
            else f"{unit}^{power}"
        )
        own = "" if exponent else parameter.unit
        entries.append(
            replace(
                parameter,
                name=f"{parameter.name}.{power}",
                unit=_per(own, divisor),
                scale="linear",
                lower=-bound,
                upper=bound,
                is_exponent=exponent,
                nominal=parameter.nominal if power == 0 else -1.0 if exponent else 0.0,
                description=f"{parameter.description}; coefficient {power} of its {law} law",
            )
        )
    return entries


def _equation(name: str, law: LawName) -> str:
    if law == "exponential":
        return f"{name} = {name}.0 + {name}.1 exp({name}.2 u)"
    powers = ["", " u", " u^2", " u^3"][: _coefficient_counts()[law]]
    return f"{name} = " + " + ".join(f"{name}.{power}{factor}" for power, factor in enumerate(powers))


def _per(unit: str, divisor: str) -> str:
    """`unit` divided by `divisor`, as units are written here: N/(m A), 1/A."""
    if not divisor:
        return unit
    if unit in ("", "1"):
        return f"1/{divisor}"
    numerator, slash, denominator = unit.partition("/")
    return f"{numerator}/({denominator} {divisor})" if slash else f"{numerator}/{divisor}"


@cache
def dampers() -> tuple[DamperSpec, ...]:
    """Every registered damper model."""
    return tuple(
        DamperSpec(
            **(
                entry
                | dict.fromkeys(
                    ("parameters", "plain"),
                    tuple(ParamSpec(**parameter) for parameter in entry["parameters"]),
                )
            )
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
