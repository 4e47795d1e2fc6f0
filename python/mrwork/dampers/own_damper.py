"""A damper of the user: its equations as functions of arrays, recorded and checked when it is made."""

from __future__ import annotations

import inspect
from collections import namedtuple
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np

from mrwork.base.arguments import Whole, checked
from mrwork.base.keys import suggestion
from mrwork.base.recording import Cell, NotRecordedError, Recording
from mrwork.base.side_effects import effect_of, with_numpy
from mrwork.base.slopes import Slopes, radius_of, slopes_of
from mrwork.base.summary import list_names
from mrwork.base.tape import Tape, tape_of
from mrwork.base.traced import Traced, bare, inputs
from mrwork.base.units import unit_of
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.dependence import CONSTANT
from mrwork.dampers.own_equations import OwnEquations
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.store.user_python import error_in_words, function_text, place_of, place_raised, run_text, start_of

_Given = ParamSpec | tuple[str, float, float, float]
_Role = Literal["force", "rate", "relaxation"]
# Most states that the core has room for, as MOST_STATES of `own.rs`.
_MOST_STATES: Final = 8
# Random points at which equations are looked at, and their displacement [m], velocity [m/s] and states.
_POINTS: Final = 16
_SPANS: Final = 0.01, 0.1, 0.5
# Share by which a recording may differ from its function.
_SAME: Final = 1e-9
_ARGUMENTS: Final[dict[_Role, str]] = {
    "force": "(p, state, displacement, velocity)",
    "rate": "(p, state, displacement, velocity)",
    "relaxation": "(p, displacement, velocity)",
}


@checked
def own_damper(
    name: str,
    *,
    parameters: Mapping[str, _Given],
    force: Callable[..., Any],
    rate: Callable[..., Any] | None = None,
    states: Whole = 0,
    relaxation: Callable[..., Any] | None = None,
    title: str = "",
    equation: str = "",
    source: str = "",
    spring: tuple[str, str] | None = None,
) -> DamperSpec:
    """Return a damper model of your own, for everything that takes a model of the package.

    Its functions are recorded once, as operations of the core: it is hashed, compared, stored and sent to other
    processes by these, and a function that is changed makes another damper.

    Parameters
    ----------
    name
        Name of the model, other than the names of `damper_models`.
    parameters
        Unit, lower bound, nominal value and upper bound of each parameter, as ``{"c": ("N s/m", 10, 500, 1e5)}``, or a
        `ParamSpec`. Searches take a logarithmic scale where the lower bound is positive; a parameter that only adds a
        constant force is an offset, as f0 of other models.
    force
        ``force(p, state, displacement, velocity)``, the force [N] from the parameters, as `p.c`, the states, shape
        (states,), displacement [m] and velocity [m/s], in NumPy or `jax.numpy`. It is positive against the velocity, so
        that force times velocity dissipates.
    rate
        ``rate(p, state, displacement, velocity)``, the time derivatives of the states, shape (states,), which begin at
        zero; needed where there are states.
    states
        Number of states.
    relaxation
        ``relaxation(p, displacement, velocity)``, an upper bound of how fast the states relax [1/s], from which the
        sub-steps follow; without it they follow from the derivatives of `rate` along each motion, in two or more runs.
    title, equation, source
        Name in prose, equations and reference, for tables and pages; the equation is by default the first line of the
        docstring of `force`.
    spring
        Names of a stiffness k and a free length x0 whose force k (x - x0) depends on x0 through k x0 alone.

    Raises
    ------
    SettingError
        Where an equation cannot be recorded, has another shape, is not a number at rest, or leaves a parameter out;
        with its line.

    Examples
    --------
    >>> import numpy as np
    >>> import mrwork as mr
    >>> def force(p, state, displacement, velocity):
    ...     return p.f_y * np.tanh(velocity / p.v_s) + p.c * velocity
    >>> spec = mr.own_damper(
    ...     "sliding",
    ...     parameters={"f_y": ("N", 1, 100, 1e4), "v_s": ("m/s", 1e-4, 0.01, 1), "c": ("N s/m", 1, 500, 1e5)},
    ...     force=force,
    ... )
    >>> mr.simulate_force(spec, spec.nominal, mr.Loading(dt=0.1, displacement=[0.0, 0.01, 0.0, -0.01, 0.0])).shape
    (5,)
    """
    specs = tuple(_parameter(key, value) for key, value in parameters.items())
    if (rate is None) != (states == 0):
        raise SettingError(
            f"`states` of {name} is {states}, and `rate` is {'missing' if rate is None else 'given'}; give both or "
            "neither"
        )
    if not 0 <= states <= _MOST_STATES:
        raise SettingError(f"`states` of {name} is {states}, and a damper has at most {_MOST_STATES}")
    if relaxation is not None and rate is None:
        raise SettingError(f"{name} has no states, and a relaxation; leave it out")
    first_line = (force.__doc__ or "").strip().partition("\n")[0]
    spec = DamperSpec(
        name=name,
        title=title or name.replace("_", " "),
        equation=equation or first_line or "f = force(p, state, x, v), see its source",
        description="A damper of the user, in Python.",
        source=source or "the user's own",
        nominal_source="the user's own",
        n_states=states,
        spring=spring,
        parameters=specs,
        plain=specs,
        laws=(CONSTANT,) * len(specs),
    )
    if fault := spec.disagreement():
        raise SettingError(f"{name or 'an empty text'} {fault}")
    for parameter in spec.parameters:
        if (unit := unit_of(parameter.unit)) is not None and unit.factor != 1.0:
            raise SettingError(
                f"{parameter.name} of {spec.name} is in {parameter.unit}, and numbers are in SI, not converted; give "
                "them in N, m, s and products of these"
            )
    given: dict[_Role, Callable[..., Any] | None] = {"force": force, "rate": rate, "relaxation": relaxation}
    functions = {role: function for role, function in given.items() if function is not None}
    formulas = {role: _Recorder(spec, role, function).formula() for role, function in functions.items()}
    shifts = _checked_parameters(spec, formulas)
    final = tuple(
        replace(parameter, scale="offset") if adds and parameter.scale == "linear" else parameter
        for parameter, adds in zip(specs, shifts, strict=True)
    )
    own = OwnEquations(
        force=formulas["force"].tape,
        rate=formulas["rate"].tape if rate is not None else None,
        relaxation=_relaxation(formulas),
        source=_text(spec, functions, formulas),
    )
    return replace(spec, own=own, parameters=final, plain=final)


def _parameter(name: str, entry: _Given) -> ParamSpec:
    if isinstance(entry, ParamSpec):
        lower, nominal, upper = float(entry.lower), float(entry.nominal), float(entry.upper)
        return replace(entry, name=name, lower=lower, nominal=nominal, upper=upper)
    unit, *ends = entry
    lower, nominal, upper = map(float, ends)
    return ParamSpec(
        name=name,
        unit=unit or "1",
        scale="log" if lower > 0.0 else "linear",
        lower=lower,
        upper=upper,
        nominal=nominal,
        description=name,
    )


def _text(
    spec: DamperSpec, functions: Mapping[_Role, Callable[..., Any]], formulas: Mapping[_Role, _Formula]
) -> str:
    """The text of functions and of what they use, for readers; empty where there is none of what was recorded."""
    try:
        text = function_text(*functions.values(), what="", remedy="")
        names = vars(run_text(text, f"<equations of {spec.name}>"))
        again = {
            role: _Recorder(spec, role, names[function.__name__]).recorded().tape
            for role, function in functions.items()
        }
    except (SettingError, KeyError):
        return ""
    # A file may be edited after its import.
    return text if all(again[role] == formulas[role].tape for role in again) else ""


@dataclass(frozen=True, slots=True)
class _Formula:
    """A recorded equation: nodes of its inputs, parameters first, then states and motion, and of its results."""

    where: str
    recording: Recording
    inputs: tuple[int, ...]
    ends: tuple[int, ...]

    @property
    def tape(self) -> Tape:
        try:
            return replace(tape_of(self.recording, self.inputs, self.ends), lines=())
        except NotRecordedError as error:
            raise SettingError(f"{self.where}: {error}") from None

    def values(self, point: Floats, ends: tuple[int, ...] | None = None) -> Floats:
        """Results, or other nodes, at a point: parameters, states, displacement and velocity."""
        named = {self.recording.nodes[at].of: value for at, value in zip(self.inputs, point, strict=True)}
        return np.array(self.recording.values(named, self.ends if ends is None else ends), dtype=np.float64)

    def slopes(self, n_first: int) -> _Formula:
        """Derivatives by the first inputs, one row of results after the other."""
        return self.with_ends([each for row in self._rows(self.inputs[:n_first]) for each in row])

    def radius(self, states: slice) -> _Formula:
        """Spectral radius of the rate in the states."""
        return self.with_ends([radius_of(self._rows(self.inputs[states]))])

    def _rows(self, of: tuple[int, ...]) -> Slopes:
        return slopes_of(self.recording, self.ends, of)

    def with_ends(self, cells: list[Any]) -> _Formula:
        """The same with other results."""
        return replace(self, ends=tuple(self.recording.cell(cell).at for cell in cells))


def _relaxation(formulas: Mapping[_Role, _Formula]) -> Tape | None:
    """How fast the states relax: what the user gives, or the radius of the rate."""
    if "rate" not in formulas:
        return None
    if "relaxation" in formulas:
        return formulas["relaxation"].tape
    rate = formulas["rate"]
    return rate.radius(slice(-2 - len(rate.ends), -2)).tape


class _Recorder:
    """Records an equation of a damper, and refuses in a sentence with its place what cannot be simulated."""

    def __init__(self, spec: DamperSpec, role: _Role, function: Callable[..., Any]) -> None:
        self._spec, self._role, self._given = spec, role, function
        self._function = with_numpy(function)
        self._theta: Any = namedtuple("p", spec.names)  # type: ignore[misc] # names are those of the user
        location = place_of(function)
        self._where = f"{role} of {spec.name}" + (f" ({location})" if location else "")

    def formula(self) -> _Formula:
        """The equation, recorded twice and compared with the function at random points."""
        self._refuse_arguments()
        if effect := effect_of(self._given, remedy="leave it out"):
            raise SettingError(f"{self._where} cannot be recorded: {effect}")
        formula = self.recorded()
        if not formula.recording.same_as(self.recorded().recording):
            raise SettingError(
                f"{self._where} is another one each time that it is recorded: a random number, a clock or a counter"
            )
        self._look_at_rest(formula)
        self._compare(formula)
        return formula

    def _refuse_arguments(self) -> None:
        wanted = _ARGUMENTS[self._role]
        try:
            taken = [*inspect.signature(self._given).parameters]
            inspect.signature(self._given).bind(*wanted.split(","))
        except TypeError:
            raise SettingError(
                f"{self._where} does not take {wanted}; write it with these arguments"
            ) from None
        if taken[-2:] in (["velocity", "displacement"], ["v", "x"]):
            raise SettingError(
                f"{self._where} takes {', '.join(taken[-2:])}, and is given {wanted}; exchange them"
            )

    def _call(self, theta: Any, state: Any, x: Any, v: Any) -> Any:
        p = self._theta(*theta)
        return self._function(p, x, v) if self._role == "relaxation" else self._function(p, state, x, v)

    def recorded(self) -> _Formula:
        """The equation as it is recorded, unchecked."""
        spec, recording = self._spec, Recording()
        theta = [inputs(recording, name, ()) for name in spec.names]
        state = inputs(recording, "state", (spec.n_states,))
        x, v = (inputs(recording, f"motion {name}", ()) for name in ("x", "v"))
        nodes = [cell.at for array in (*theta, state, x, v) for cell in array.cells.ravel()]
        try:
            result = self._call(theta, state, x, v)
        except NotRecordedError as error:
            raise SettingError(f"{self._where} cannot be recorded at {error}") from None
        except Exception as error:
            raise self._refusal(error) from None
        return _Formula(self._where, recording, tuple(nodes), self._ends(recording, result))

    def _refusal(self, error: Exception) -> SettingError:
        raised = place_raised(error, start_of(self._given)[0])
        hint = error_in_words(error)[:200]
        if "tuple indices" in hint:
            hint = "the parameters are p.NAME, not p['NAME']"
        elif isinstance(error, AttributeError) and isinstance(error.obj, self._theta):
            hint = f"p has no {error.name}{suggestion(str(error.name), self._spec.names, otherwise='it has')}"
        elif isinstance(error, IndexError):
            hint = f"{hint}; states are counted from 0"
        return SettingError(f"{self._where} cannot be recorded{f' at {raised}' if raised else ''}: {hint}")

    def _ends(self, recording: Recording, result: Any) -> tuple[int, ...]:
        shape = (self._spec.n_states,) if self._role == "rate" else ()
        wanted = "a single number, shape ()"
        if shape:
            wanted = f"shape {shape}, as by np.stack([...]), a rate for each state"
        if not isinstance(result, (Traced, np.ndarray, float, int, np.generic, list, tuple)):
            raise SettingError(f"{self._where} returns a {type(result).__name__}; return {wanted}")
        cells = bare(result)
        if cells.shape != shape:
            raise SettingError(f"{self._where} returns shape {cells.shape}; return {wanted}")
        if isinstance(result, Traced) and result.kind == "truth":
            raise SettingError(f"{self._where} returns a condition; return {wanted}")
        numbers = cells.ravel().tolist()
        if not all(isinstance(each, (Cell, float, int)) for each in numbers):
            raise SettingError(f"{self._where} returns {numbers!r}, which are no numbers; return {wanted}")
        return tuple(recording.cell(each).at for each in numbers)

    def _look_at_rest(self, formula: _Formula) -> None:
        spec = self._spec
        rest = np.concatenate([spec.nominal, np.zeros(spec.n_states + 2)])
        if not np.isfinite(formula.values(rest)).all():
            raise SettingError(
                f"{self._where} is not a finite number at rest, with nominal parameters and all states, displacement "
                "and velocity zero; every simulation begins there"
            )
        if self._role == "relaxation":
            if not all(0.0 <= formula.values(point)[0] < np.inf for point in _points(spec)):
                raise SettingError(
                    f"{self._where} is negative or no number at some motion; give a bound in 1/s"
                )
            return
        named = (*spec.names, *("the states" for _ in range(spec.n_states)))
        slopes = formula.slopes(len(named)).values(rest).reshape(-1, len(named))
        unknown = np.flatnonzero(~np.isfinite(slopes).all(axis=0))
        bad = dict.fromkeys(named[place] for place in unknown)
        if bad:
            raise SettingError(
                f"{self._where} is a number at rest, and its derivative by {list_names([*bad])} is none, which fits "
                "need; a root, and a power below 1, want a small number beside what is below them"
            )

    def _compare(self, formula: _Formula) -> None:
        """Refuse a recording that has other numbers than its function."""
        n_params, n_states = len(self._spec.names), self._spec.n_states
        for point in _points(self._spec):
            theta, state, (x, v) = np.split(point, [n_params, n_params + n_states])
            with np.errstate(all="ignore"):
                its = np.ravel(np.asarray(self._call(theta, state, x, v), dtype=np.float64))
            if not np.allclose(formula.values(point), its, rtol=_SAME, atol=0.0, equal_nan=True):
                raise SettingError(
                    f"{self._where} has other numbers where it is recorded than in Python; write it in functions of np"
                )


def _points(spec: DamperSpec) -> Iterator[Floats]:
    """Random points: parameters between their bounds or nominal ones, states, displacement and velocity."""
    rng = np.random.default_rng(0)
    for _ in range(_POINTS):
        unit = rng.uniform(0.3, 0.7, len(spec.names))
        theta = np.asarray(Box.of(spec).theta_from_unit(unit))
        x, v, state = (
            span * rng.uniform(-1.0, 1.0, size)
            for span, size in zip(_SPANS, (1, 1, spec.n_states), strict=True)
        )
        for parameters in (theta, spec.nominal):
            yield np.concatenate([parameters, state, x, v])


def _checked_parameters(spec: DamperSpec, formulas: Mapping[_Role, _Formula]) -> list[bool]:
    """Whether each parameter adds a constant force and does nothing else; refuses one that nothing uses."""
    n = len(spec.names)
    force = formulas["force"].slopes(n)
    rate = formulas["rate"].slopes(n) if spec.n_states else None
    used, shifts = np.zeros(n, dtype=np.bool_), np.ones(n, dtype=np.bool_)
    for point in _points(spec):
        slopes = force.values(point)
        rates = np.zeros((0, n)) if rate is None else rate.values(point).reshape(-1, n)
        used |= (slopes != 0.0) | (rates != 0.0).any(axis=0)
        shifts &= (slopes == 1.0) & ~rates.any(axis=0)
    if not used.all():
        unused = [name for name, is_used in zip(spec.names, used, strict=True) if not is_used]
        raise SettingError(
            f"nothing in {spec.name} uses {list_names(unused)}; leave it out, or correct the equations"
        )
    rest = np.concatenate([spec.nominal, np.zeros(spec.n_states + 1)])
    there, back, none = (formulas["force"].values(np.append(rest, v))[0] for v in (0.1, -0.1, 0.0))
    if there - none < 0.0 < back - none:
        raise SettingError(
            f"the force of {spec.name} has the direction of the velocity, so that it gives energy; turn its sign: "
            "force times velocity is the dissipated power"
        )
    return [bool(each) for each in shifts]
