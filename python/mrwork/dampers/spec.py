"""Specifications of the damper models, as declared by the Rust core, and published parameter sets."""

from __future__ import annotations

import keyword
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache, partial
from math import ceil, inf, log10
from typing import ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from mrwork import _rust
from mrwork.base.arguments import checked
from mrwork.base.keys import look_up
from mrwork.base.numbers import NOTHING, format_fixed, format_rounded, in_newtons, of_unit
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.dependence import CONSTANT, CurrentLaws, Dependence, LawName, dependences_in_order
from mrwork.dampers.own_equations import OwnEquations
from mrwork.dampers.parameters import DRIVER_RATES, RATE_NAMES, Lag, ParamSpec
from mrwork.errors import SettingError

# In place of the name of one model: every model, and those that predict a few of the tests best.
ALL = "all"
SCREENED = "screened"
DEFAULT_MODELS = ("normalised_bouc_wen", "hyperbolic_tangent_guo", "viscous_dahl")
"""The model where none is named, the first, and with it others that differ in kind, where nothing can be screened."""

_Value = float | tuple[float, ...]

_PARAMETERS = (
    Column("name", "parameter"),
    *(Column(key, key, shown=format_rounded) for key in ("nominal", "lower", "upper")),
    *(Column(key, key) for key in ("scale", "unit")),
    Column("description", "meaning"),
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class DamperSpec(Summarised):
    """A damper model: equations, source and parameters in order, declared in Rust beside the equations.

    `plain` has the parameters of the model itself, `laws` the law of the command of each; `parameters` are the
    coefficients of the laws, named `k_w.0`, `k_w.1`, and the rates of the `lag` of the driver. `command_unit` is `None`
    for the plain model. With `u` the command received by the coil, a constant parameter is `p = p.0`; linear, quadratic
    and cubic laws are `p = p.0 + p.1 u + p.2 u^2 + p.3 u^3`, an exponential one `p = p.0 + p.1 exp(p.2 u)`;
    "quadratic:0,0.5,1" is the polynomial through values at these commands, "log_quadratic:0,0.5,1" the one through the
    logarithms of a positive parameter; "straight:0,0.5,1" and "straight_log:0,0.5,1" have straight lines in place of
    the polynomials, "monotone:0,0.5,1" cubics that are monotone where the values are. "exponential:0,1" and "tanh:0,1"
    saturate, `p = p0 + (p1 - p0) g(u)` with g = 0 and 1 at these commands, a part of 1 - exp(-c u) or of tanh(c u), and
    have the rate c as `k_w.rate`. A parameter that follows the command is limited to the admissible range of the plain
    model. A lag has `u' = -eta (u - command)`; of two rates eta is `eta_rise` while `u < command`, else `eta_fall`.

    `spring` names the stiffness k and the free length x0 of the accumulator; its force k (x - x0) depends on x0 through
    the product k x0 alone. `odd` says whether the opposite motion gives the opposite force, `relaxes` whether states
    move at rest, `None` where nobody claims it. `own` are the equations of a damper of the user, see
    `mrwork.own_damper`.
    """

    _made_by: ClassVar[str] = "mr.damper(name)"

    name: str
    title: str
    equation: str
    description: str
    source: str
    nominal_source: str
    n_states: int
    odd: bool | None = None
    relaxes: bool | None = None
    spring: tuple[str, str] | None
    parameters: tuple[ParamSpec, ...]
    plain: tuple[ParamSpec, ...]
    laws: tuple[Dependence, ...]
    command_unit: CommandUnit | None = None
    lag: Lag = "none"
    own: OwnEquations | None = None

    def disagreement(self) -> str:
        """What is wrong with a damper of the user; empty if nothing is."""
        if not self.name.isidentifier() or keyword.iskeyword(self.name):
            return "is no name of a damper; give letters, digits and underscores, and begin with a letter"
        if any(model.name == self.name for model in damper_models()):
            return "is the name of a model of the package; give another one"
        if not self.parameters:
            return "has no parameters; give those that are to be identified"
        for entry in self.parameters:
            if (
                not entry.name.isidentifier()
                or keyword.iskeyword(entry.name)
                or entry.name.startswith("_")
                or entry.name in RATE_NAMES
            ):
                names = ", ".join(sorted(RATE_NAMES))
                return f"has a parameter {entry.name!r}; give letters, digits and underscores, and none of {names}"
            if not -inf < entry.lower <= entry.nominal <= entry.upper < inf:
                return (
                    f"has {entry.name} from {entry.lower:g} to {entry.upper:g}, nominally {entry.nominal:g}; give "
                    "finite numbers: a lower bound, a nominal value and an upper bound, in this order"
                )
            if entry.lower == entry.upper:
                return f"has {entry.name} with equal bounds; give a range, and hold it in a fit by `bounds`"
            if entry.scale == "log" and entry.lower <= 0.0:
                return f"has {entry.name} on a logarithmic scale from {entry.lower:g}; give a positive lower bound"
        unknown = [name for name in self.spring or () if name not in self.names]
        return f"has no parameter {unknown[0]!r} of its spring" if unknown else ""

    @property
    def core_name(self) -> str:
        """The name by which the core knows the model: of a damper of the user one that its equations have."""
        return self.name if self.own is None else self.own.core_name(self.plain, self.n_states)

    @property
    def without_laws(self) -> DamperSpec:
        """The plain model, whose parameters are constant."""
        laws = (CONSTANT,) * len(self.plain)
        return replace(self, parameters=self.plain, laws=laws, command_unit=None, lag="none")

    @property
    def equations(self) -> str:
        """The equation of the model, then a line for each law that is not constant and for the driver."""
        lines = [
            law.equation(parameter, self.command_unit)
            for parameter, law in self.law_pairs
            if not law.is_constant
        ]
        lines += [f"{_DRIVERS[self.lag]} [{self.command_unit}]"] if self.command_unit else []
        return "\n".join([self.equation, *lines])

    @property
    def law_pairs(self) -> list[tuple[ParamSpec, Dependence]]:
        """Each parameter of the plain model with its law."""
        return list(zip(self.plain, self.laws, strict=True))

    @property
    def laws_by_name(self) -> dict[str, Dependence]:
        """The law of each parameter of the plain model by its name."""
        return {parameter.name: law for parameter, law in self.law_pairs}

    @property
    def current_laws(self) -> CurrentLaws | None:
        """The laws as files have them; `None` for the plain model."""
        if self.command_unit is None:
            return None
        return CurrentLaws(
            unit=self.command_unit,
            laws=tuple(map(str, self.laws)),
            lagged=self.n_rates > 0,
            two_rates=self.lag == "two_rates",
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Parameter names, in order."""
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def nominal(self) -> Floats:
        """Typical parameter values, shape (n_params,)."""
        return np.array([parameter.nominal for parameter in self.parameters])

    @property
    def spring_indices(self) -> tuple[int, int] | None:
        """Indices of the two parameters of `spring`; `None` if there is none, or one of them follows a law."""
        if self.spring is None or not set(self.spring) <= set(self.names):
            return None
        stiffness, free_length = self.spring
        return self.names.index(stiffness), self.names.index(free_length)

    @property
    def following(self) -> tuple[str, ...]:
        """Names of the parameters of the plain model that depend on the command."""
        return tuple(parameter.name for parameter, law in self.law_pairs if not law.is_constant)

    @property
    def n_rates(self) -> int:
        """Number of rates of the driver's lag, the last of the parameters; zero without one."""
        return len(DRIVER_RATES[self.lag])

    @property
    def follows_command(self) -> bool:
        """Whether any parameter depends on the command; a damper without such a parameter is passive."""
        return bool(self.following)

    @checked
    def with_current_laws(
        self, laws: Mapping[str, LawName | Dependence], *, unit: CommandUnit = "A", lag: Lag = "none"
    ) -> DamperSpec:
        """Return the model with parameters that depend on the command; those not named are constant.

        Parameters
        ----------
        laws
            Parameter name to its law or the text of the law.
        unit
            Unit of the command; a test in the other unit is refused.
        lag
            Whether the command reaches the coil at once, or through a first-order lag with one rate or two, which are
            further parameters: `eta`, or `eta_rise` and `eta_fall`.

        Examples
        --------
        >>> import mrwork as mr
        >>> model = mr.damper("dahl").with_current_laws({"k_w": "quadratic"})
        >>> model.names
        ('k_w.0', 'k_w.1', 'k_w.2', 'rho', 'f0')
        """
        if self.command_unit is not None:
            raise SettingError(
                f"{self.name} has current laws already; give them to the plain model, all at once"
            )
        all_laws = dependences_in_order(self.plain, laws, self.name)
        pairs = zip(self.plain, all_laws, strict=True)
        parameters = [
            coefficient for parameter, law in pairs for coefficient in law.coefficients_of(parameter, unit)
        ]
        parameters += DRIVER_RATES[lag]
        return replace(self, parameters=tuple(parameters), laws=all_laws, command_unit=unit, lag=lag)

    @property
    def presets(self) -> tuple[str, ...]:
        """Names of the model's published parameter sets."""
        return tuple(law_set.name for law_set in published_sets() if law_set.model == self.name)

    @checked
    def preset(self, name: str) -> Preset:
        """Return a published parameter set of the model.

        Examples
        --------
        >>> import mrwork as mr
        >>> prototype = mr.damper("modified_bouc_wen").preset("dyke1996")
        >>> prototype.status, prototype.spec.command_unit, len(prototype.theta)
        ('verified', 'V', 14)
        """
        presets = {law_set.name: law_set for law_set in published_sets() if law_set.model == self.name}
        return look_up(name, presets, f"{self.name} has no published set called {name!r}", otherwise="it has")

    def _summary(self) -> Summary:
        return Summary(
            title=f"Damper model {self.name}: {self.title}",
            facts=(
                ("equation", self.equations.replace("\n", "; ")),
                ("meaning", self.description),
                ("source", self.source),
                ("nominal", self.nominal_source),
            ),
            tables=[Table.of(_PARAMETERS, self.parameters)],
        )


PRESETS = (
    Column("force_class", "force class", shown=lambda words: words or "not known"),
    Column("name", "preset"),
    Column("spec", "model", shown=lambda spec: spec.name),
    Column("rated_force", "force", "N", shown=partial(format_fixed, decimals=0)),
    Column(
        "rated_stroke",
        "stroke",
        "mm",
        shown=lambda stroke: NOTHING if stroke is None else f"{1e3 * stroke:g}",
    ),
    Column("command_in_words", "command", shown=lambda words: words or NOTHING),
    Column("status", "status"),
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Preset(Summarised):
    """A published set: the model with its current laws, and `theta` in order.

    `values` has each parameter of the plain `model`, or its coefficients of a polynomial in a command in `unit`; `eta`
    [1/s] is the rate of the driver's lag; without a command the `note` tells it. `status` is "verified" if an
    independent simulation reproduced the results of the paper, "published" if the numbers are only quoted.
    `rated_force` [N] and `rated_stroke` [m], to either side, are what source or data sheet state.
    """

    name: str
    model: str
    values: Mapping[str, _Value] = field(compare=False)
    unit: Literal["A", "V"] | None = None
    eta: float | None = None
    source: str
    status: Literal["verified", "published"] = "published"
    largest_command: float | None = None
    rated_force: float | None = None
    rated_stroke: float | None = None
    note: str = ""
    spec: DamperSpec = field(init=False)
    theta: tuple[float, ...] = field(init=False)

    def __post_init__(self) -> None:
        spec = damper(self.model)
        listed = [np.atleast_1d(self.values[name]).tolist() for name in spec.names]
        theta = [coefficient for coefficients in listed for coefficient in coefficients]
        if self.unit is not None:
            laws = {
                name: Dependence(len(coefficients) - 1)
                for name, coefficients in zip(spec.names, listed, strict=True)
            }
            spec = spec.with_current_laws(
                laws, unit=self.unit, lag="none" if self.eta is None else "one_rate"
            )
            theta += () if self.eta is None else (self.eta,)
        object.__setattr__(self, "spec", spec)
        object.__setattr__(self, "theta", tuple(theta))

    @property
    def command_in_words(self) -> str:
        """The range of the command, as "0 to 5 V"; empty without one."""
        unit = self.spec.command_unit
        return "" if unit is None or self.largest_command is None else f"0 to {self.largest_command:g} {unit}"

    @property
    def force_class(self) -> str:
        """The decade of the rated force, as "up to 10 kN"; empty where that is not known."""
        if self.rated_force is None:
            return ""
        return f"up to {in_newtons(10.0 ** ceil(log10(self.rated_force)))}"

    def _summary(self) -> Summary:
        rows = [
            (parameter.name, format_rounded(value, 6), parameter.unit)
            for parameter, value in zip(self.spec.parameters, self.theta, strict=True)
        ]
        return Summary(
            title=f"Preset {self.name} of {self.spec.name}, {self.status}: {self.source}",
            facts=(
                ("command", self.command_in_words),
                ("rated force", "" if self.rated_force is None else in_newtons(self.rated_force)),
                ("rated stroke", "" if self.rated_stroke is None else f"+-{1e3 * self.rated_stroke:g} mm"),
            ),
            tables=[Table(columns=("parameter", "value", "unit"), rows=rows)],
            notes=(self.note,),
        )


@cache
def damper_models() -> tuple[DamperSpec, ...]:
    """All registered damper models, without laws of the command, in the order of the registry."""
    models = []
    for entry in _rust.damper_specs():
        plain = tuple(ParamSpec(**parameter) for parameter in entry["parameters"])
        laws = (CONSTANT,) * len(plain)
        models.append(DamperSpec(**entry | {"parameters": plain, "plain": plain, "laws": laws}))
    return tuple(models)


def presets_by_force(models: Iterable[DamperSpec]) -> list[Preset]:
    """The published sets of models, the smallest dampers first."""
    presets = [spec.preset(name) for spec in models for name in spec.presets]
    return sorted(presets, key=lambda preset: (preset.rated_force or inf, preset.name, preset.model))


@checked
def damper(name: str) -> DamperSpec:
    """Return the damper model with this name.

    Examples
    --------
    >>> import mrwork as mr
    >>> mr.damper("normalised_bouc_wen").names
    ('c', 'k', 'x0', 'k_w', 'rho', 'sigma', 'n')
    """
    specs = {spec.name: spec for spec in damper_models()}
    return look_up(name, specs, f"no damper model is called {name!r}")


def _with_loop(
    others: Mapping[str, _Value], alpha: _Value, *, gamma: float, A: float, n: float
) -> dict[str, _Value]:
    """Values with a Bouc-Wen loop whose gamma and beta are equal."""
    return {**others, "alpha": alpha, "gamma": gamma, "beta": gamma, "A": A, "n": n}


_SPENCER = "Spencer, Dyke, Sain, Carlson, J. Eng. Mech. 123(3), 1997, 230-238"

# The prototype of Spencer, Dyke and co-workers, also of Leva and Piroddi: 3000 N, +-25 mm.
_FORCE, _STROKE = 3000.0, 0.025


# Dampers of buildings between the prototypes of 3 kN and the one of 1000 kN [N].
_BETWEEN: Final = (100e3, 200e3, 400e3)


def _of_similar(preset: Preset, rated_force: float) -> Preset:
    """A published set of another force: gap, stroke, fluid and field stay, widths and with them all forces change.

    Stresses are those of the same speeds, so that what is in N, N s/m or N/m is in the ratio of the forces.
    """
    assert preset.rated_force is not None
    share = rated_force / preset.rated_force
    units = {parameter.name: parameter.unit for parameter in damper(preset.model).parameters}
    values = {
        name: tuple(share * np.atleast_1d(value)) if units[name].startswith("N") else value
        for name, value in preset.values.items()
    }
    return replace(
        preset,
        name=f"{preset.name}_{1e-3 * rated_force:.0f}kN",
        values=values,
        rated_force=rated_force,
        status="published",
        source=f"scaled by similarity from {preset.source}",
        note=f"no damper that was built: forces of {preset.name}, {1e-3 * preset.rated_force:.0f} kN, times {share:g}, "
        "as of one with narrower poles and the same gap, stroke, fluid and field",
    )


@cache
def published_sets() -> tuple[Preset, ...]:
    """Every published parameter set of every model, in SI units, and some of other forces by similarity."""
    sets = _as_published()
    large = next(preset for preset in sets if preset.name == "yoshida2004")
    return (*sets, *(_of_similar(large, force) for force in _BETWEEN))


def _as_published() -> tuple[Preset, ...]:
    return (
        Preset(name="spencer1997", model="bingham", source=_SPENCER, rated_force=_FORCE, rated_stroke=_STROKE,
            values={"f_c": 670.0, "v_s": 1e-3, "c0": 5000.0, "f0": -95.0},
            note="at 1.5 V; v_s is ours, the paper has sgn(v)"),
        Preset(name="spencer1997", model="bouc_wen", source=_SPENCER, rated_force=_FORCE, rated_stroke=_STROKE,
            values=_with_loop({"c0": 5000.0, "k0": 2500.0, "x0": 0.038}, 88e3, gamma=1e6, A=120.0, n=2.0),
            note="at 1.5 V"),
        Preset(name="jansen2000", model="bouc_wen", status="verified",
            values=_with_loop({"c0": (0.64, 0.52), "k0": 0.0, "x0": 0.0}, (866.0, 886.0), gamma=3e6, A=120.0, n=2.0),
            unit="V", largest_command=5.0, eta=190.0, rated_force=29.0,
            source="Jansen, Dyke, J. Eng. Mech. 126(8), 2000, 795-803"),
        Preset(name="yoshida2004", model="bouc_wen", note="a damper of 1000 kN",
            values=_with_loop({"c0": (440.0, 4400.0), "k0": 0.0, "x0": 0.0}, (1.0872e7, 4.9616e7), gamma=300.0,
                A=1.2, n=1.0),
            unit="V", largest_command=10.0, eta=50.0, rated_force=1e6,
            source="Yoshida, Dyke, J. Eng. Mech. 130(4), 2004"),
        Preset(name="dyke1996", model="modified_bouc_wen", status="verified",
            values=_with_loop({"c0": (2100.0, 350.0), "k0": 4690.0, "c1": (28300.0, 295.0), "k1": 500.0, "x0": 0.143},
                (14000.0, 69500.0), gamma=3.63e6, A=301.0, n=2.0),
            unit="V", largest_command=2.25, eta=190.0, rated_force=_FORCE, rated_stroke=_STROKE,
            source="Dyke, Spencer, Sain, Carlson, Smart Mater. Struct. 5, 1996, 565-575",
            note="the prototype; in a building drop the constant force k1 x0. Stiff: the loop yields within 0.02 mm"),
        Preset(name="leva2002", model="modified_bouc_wen",
            values=_with_loop({"c0": (2020.0, 268.0), "k0": 1500.0, "c1": (35000.0, 7070.0), "k1": 537.0, "x0": 0.0},
                (4490.0, 63800.0), gamma=3.93e5, A=47.2, n=2.0),
            unit="V", largest_command=2.25, eta=251.0, rated_force=_FORCE, rated_stroke=_STROKE,
            source="Leva, Piroddi, Smart Mater. Struct. 11, 2002, 79",
            note="the largest command is that of the same prototype in Dyke et al. 1996"),
        Preset(name="kwok2006", model="static_hysteretic",
            values={"c": (1232.0, 1929.0), "k": (5100.0, -1700.0), "alpha": (32.0, 918.0, -244.0), "beta": 100.0,
                "delta": (0.58, 0.30), "x_s": 1e-4, "f0": (57.0, -18.0)},
            unit="A", largest_command=1.88, rated_force=2224.0, rated_stroke=0.0265,
            source="Kwok, Ha, Nguyen, Li, Samali, Sens. Actuators A 132, 2006, 441-451",
            note="RD-1005-3, of which the data sheet has more than 2224 N at 1 A and a stroke of 53 mm; beyond 1.88 A "
            "alpha would fall again. x_s is ours, the paper has sgn(x)"),
    )  # fmt: skip


# The driver of each lag.
_DRIVERS: Mapping[Lag, str] = {
    "none": "u = command",
    "one_rate": "u' = -eta (u - command)",
    "two_rates": "u' = -(eta_rise where u < command, else eta_fall) (u - command)",
}


def with_other_dependences(
    spec: DamperSpec, laws: Mapping[str, Dependence] | None = None, *, lag: Lag | None = None
) -> DamperSpec:
    """A model with current laws with these in place of its own, and with this lag of the driver if given."""
    assert spec.command_unit is not None
    return spec.without_laws.with_current_laws(
        {**spec.laws_by_name, **(laws or {})},
        unit=spec.command_unit,
        lag=lag or spec.lag,
    )


# Commands at which a law is evaluated.
_N_COMMANDS = 201
# A positive parameter below this share of its largest value has vanished.
VANISHED = 1e-3
# Share of a bound that rounding may add to a value on it.
_OVER_BOUND = 1e-9
LAW_LEAVES_RANGE = RemarkKind("law_leaves_range", "{limit}, within the tested commands", "choose another law")
LAW_BEYOND = RemarkKind("law_leaves_range_beyond", "{limit}", "test there before you rely on it")


@dataclass(frozen=True, slots=True, kw_only=True)
class DependenceLimit:
    """A parameter whose law gives a `value` that is not admissible, or has vanished, from command `first` to `last`."""

    parameter: str
    unit: str
    value: float
    used: float
    command: float
    first: float
    last: float
    command_unit: CommandUnit

    @property
    def in_words(self) -> str:
        """Text such as "the law of k_w turns negative: -120 N at 0 A, taken as 0.001 N from 0 to 0.12 A"."""
        what = "turns negative" if self.value < 0.0 <= self.used else "leaves the admissible range"
        if self.value == self.used:
            what = "vanishes"
        unit = "" if self.unit == "1" else self.unit
        value = of_unit(self.value, unit, 3)
        at = of_unit(self.command, self.command_unit, 3)
        taken = "" if self.value == self.used else f", taken as {of_unit(self.used, unit, 3)}"
        span = (
            ""
            if self.first == self.last
            else f" from {self.first:.3g} to {self.last:.3g} {self.command_unit}"
        )
        return f"the law of {self.parameter} {what}: {value} at {at}{taken}{span}"

    def remark(self, kind: RemarkKind) -> Remark:
        """A remark of a kind whose text has the `limit` in words."""
        return kind.remark(self.parameter, measured=Measured(self.value, self.unit), limit=self.in_words)


def law_limits(
    spec: DamperSpec, theta: ArrayLike, commands: tuple[float, float]
) -> tuple[DependenceLimit, ...]:
    """Parameters whose law leaves its admissible range, or vanishes, between the smallest and the largest command.

    There the damper differs from what was identified: a stiffness or yield force of next to nothing, or an equation
    too stiff to be solved. A number without a unit is a shape, which does not vanish.
    """
    if spec.command_unit is None:
        return ()
    command = np.linspace(*commands, _N_COMMANDS)
    limits = []
    for parameter, value in law_values(spec, np.asarray(theta, dtype=np.float64), command):
        used = np.clip(value, parameter.lower, parameter.upper)
        beyond = np.abs(value - used)
        beyond[beyond <= _OVER_BOUND * np.abs(used)] = 0.0
        if parameter.lower > 0.0 and parameter.unit != "1":
            beyond[(beyond == 0.0) & (value < VANISHED * value.max())] = np.finfo(float).tiny
        outside = np.flatnonzero(beyond)
        if outside.size:
            worst = int(np.argmax(beyond))
            limits.append(
                DependenceLimit(
                    parameter=parameter.name,
                    unit=parameter.unit,
                    value=float(value[worst]),
                    used=float(used[worst]),
                    command=float(command[worst]),
                    first=float(command[outside[0]]),
                    last=float(command[outside[-1]]),
                    command_unit=spec.command_unit,
                )
            )
    return tuple(limits)


def worst_laws(limits: Iterable[DependenceLimit]) -> list[DependenceLimit]:
    """For each parameter the limit with the largest deviation."""
    worst: dict[str, DependenceLimit] = {}
    for limit in limits:
        previous = worst.get(limit.parameter)
        if previous is None or abs(limit.value - limit.used) > abs(previous.value - previous.used):
            worst[limit.parameter] = limit
    return list(worst.values())


def plain_parameters(spec: DamperSpec, theta: ArrayLike, command: float) -> Floats:
    """Parameters of the plain model at a command, within their admissible range, shape (n_plain,)."""
    values = []
    for (parameter, law), coefficients in zip(
        spec.law_pairs, by_parameter(spec, np.asarray(theta, dtype=np.float64)), strict=False
    ):
        value = float(law.values(coefficients, np.float64(command)))
        values.append(value if law.is_constant else float(np.clip(value, parameter.lower, parameter.upper)))
    return np.array(values)


def by_parameter(spec: DamperSpec, theta: Floats) -> list[Floats]:
    """Coefficients of each parameter of the plain model, on the last axis; last what follows, the driver's rates."""
    return np.split(theta, np.cumsum([law.n_coefficients for law in spec.laws]), axis=-1)


def law_values(spec: DamperSpec, theta: Floats, command: Floats) -> Iterator[tuple[ParamSpec, Floats]]:
    """Each parameter that follows the command, with the values that its law gives at commands, shape (n,)."""
    for (parameter, law), coefficients in zip(spec.law_pairs, by_parameter(spec, theta), strict=False):
        if not law.is_constant:
            yield parameter, law.values(coefficients, command)
