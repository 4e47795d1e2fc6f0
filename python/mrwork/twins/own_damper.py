"""A damper of the user: its equations as functions of `jax.numpy`, checked when it is made."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import jaxprs_in_params

from mrwork.base.arguments import Whole, checked
from mrwork.base.keys import suggestion
from mrwork.base.summary import list_names
from mrwork.base.units import unit_of
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.dampers.laws import CONSTANT
from mrwork.dampers.own_equations import OwnEquations
from mrwork.dampers.parameters import ParamSpec
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.store.user_python import function_text, in_words, place_of, place_raised, start_of
from mrwork.twins.models import Twin, on_processor, twin_of, twin_with
from mrwork.twins.own_batches import computed

_Given = ParamSpec | tuple[str, float, float, float]
_SHORT_FLOATS = ("float16", "bfloat16", "float32")
_ADDRESS = re.compile(r"0x[0-9a-f]+")
_SHORT_ARRAY = re.compile(r"dtype='<f[24]'")
# Random points at which a parameter must matter somewhere, and their displacement [m], velocity [m/s] and states.
_POINTS = 16
_SPANS = 0.01, 0.1, 0.5
# Errors of JAX about values that Python asks for while they are traced.
_TRACED = (jax.errors.ConcretizationTypeError, jax.errors.TracerArrayConversionError)


@checked
@on_processor()
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

    It carries the text of its functions, with the helpers and constants that they use, not the functions: it is
    hashed, compared and sent to other processes by it, and a function that is changed makes another damper.

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
        (states,), displacement [m] and velocity [m/s], in `jax.numpy`. It is positive against the velocity, so that
        force times velocity dissipates.
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
        Where an equation cannot be traced, has another shape, is not a number at rest, or leaves a parameter out; with
        its line.

    Examples
    --------
    >>> import jax.numpy as jnp
    >>> import mrwork as mr
    >>> def force(p, state, displacement, velocity):
    ...     return p.f_y * jnp.tanh(velocity / p.v_s) + p.c * velocity
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
    if relaxation is not None and rate is None:
        raise SettingError(f"{name} has no states, and a relaxation; leave it out")
    functions = {"force": force, "rate": rate, "relaxation": relaxation}
    stated = {role: function for role, function in functions.items() if function is not None}
    names = [getattr(function, "__name__", "") for function in stated.values()]
    if len(set(names)) < len(names):
        raise SettingError(
            f"the functions of {name} are called {list_names(names)}; give each a name of its own"
        )
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
    # First as they are, so that what goes wrong has its line, then from their text alone.
    for parameter in spec.parameters:
        if (unit := unit_of(parameter.unit)) is not None and unit.factor != 1.0:
            raise SettingError(
                f"{parameter.name} of {spec.name} is in {parameter.unit}, and numbers are in SI, not converted; give "
                "them in N, m, s and products of these"
            )
    for role, function in stated.items():
        _refuse_arguments(role, function, name)
    given_check = _Check(spec, twin_with(spec, force, rate, relaxation))
    computed(lambda: given_check.run(stated))
    text = function_text(
        *stated.values(),
        what=f"the equations of {name} cannot be carried along:",
        remedy="write functions by def into a file or a cell of a notebook, and let them use numbers, arrays, "
        "installed packages and each other alone",
    )
    if _SHORT_ARRAY.search(text):
        raise SettingError(f"{name} uses constants of less precision than float64; convert them")
    equations = OwnEquations(source=text, **{role: function.__name__ for role, function in stated.items()})
    equations.trust()
    spec = replace(spec, own=equations)
    check = _Check(spec, twin_of(spec))
    computed(lambda: check.run(stated))
    if check.traces != given_check.traces:
        raise SettingError(f"the file of {name} was changed after it was run; run it again")
    final = tuple(
        replace(parameter, scale="offset") if shifts and parameter.scale == "linear" else parameter
        for parameter, shifts in zip(specs, check.shifts, strict=True)
    )
    return replace(spec, parameters=final, plain=final)


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


_ARGUMENTS = {"relaxation": "(p, displacement, velocity)"}


def _refuse_arguments(role: str, function: Callable[..., Any], name: str) -> None:
    wanted = _ARGUMENTS.get(role, "(p, state, displacement, velocity)")
    location = f" ({place_of(function)})" if place_of(function) else ""
    try:
        taken = [*inspect.signature(function).parameters]
        inspect.signature(function).bind(*wanted.split(","))
    except TypeError:
        raise SettingError(
            f"{role} of {name}{location} does not take {wanted}; write it with these arguments"
        ) from None
    if taken[-2:] in (["velocity", "displacement"], ["v", "x"]):
        raise SettingError(
            f"{role} of {name}{location} takes {', '.join(taken[-2:])}, and is given {wanted}; exchange them"
        )


class _Check:
    """Checks of the equations of a damper, at rest and at random points."""

    def __init__(self, spec: DamperSpec, twin: Twin) -> None:
        self._spec = spec
        self._twin = twin
        self.traces: dict[str, str] = {}
        """Each equation as JAX has traced it."""
        self.shifts = np.ones(len(spec.names), dtype=np.bool_)
        """Whether each parameter adds a constant force and does nothing else."""
        self._rest = jnp.asarray(spec.nominal), jnp.zeros(spec.n_states), jnp.float64(0.0), jnp.float64(0.0)

    def run(self, functions: Mapping[str, Callable[..., Any]]) -> None:
        """Refuse equations that cannot be simulated, in a sentence with the place of the function."""
        for role, function in functions.items():
            location = place_of(function)
            where = f"{role} of {self._spec.name}" + (f" ({location})" if location else "")
            self._trace(where, role, function)
            self._look_at_rest(where, role)
        self._find_unused()
        self._look_at_sign()

    def _of(self, role: str) -> Callable[..., Any]:
        """An equation of theta, state, displacement and velocity."""
        equation = getattr(self._twin, role)
        if role == "relaxation":
            return lambda theta, state, x, v: equation(self._twin.Theta(*theta), x, v)
        return lambda theta, state, x, v: equation(self._twin.Theta(*theta), state, x, v)

    def _trace(self, where: str, role: str, function: Callable[..., Any]) -> None:
        shape = (self._spec.n_states,) if role == "rate" else ()
        try:
            traced, result = jax.make_jaxpr(self._of(role), return_shape=True)(*self._rest)
        except Exception as error:
            raised = place_raised(error, start_of(function)[0])
            hint = in_words(error).partition(" See https")[0][:200]
            if isinstance(error, _TRACED):
                hint = (
                    "Python's if, and, or, float() and functions of math and numpy ask for a value that JAX does not "
                    "have while it traces; write jnp.where(condition, a, b) and functions of jax.numpy"
                )
            elif "tuple indices" in hint:
                hint = "the parameters are p.NAME, not p['NAME']"
            elif isinstance(error, AttributeError) and isinstance(error.obj, self._twin.Theta):
                hint = f"p has no {error.name}{suggestion(str(error.name), self._spec.names, otherwise='it has')}"
            raise SettingError(
                f"{where} cannot be traced{f' at {raised}' if raised else ''}: {hint}"
            ) from None
        if not hasattr(result, "shape") or result.shape != shape:
            came = f"shape {result.shape}" if hasattr(result, "shape") else f"a {type(result).__name__}"
            wanted = "a single number, shape ()"
            if shape:
                wanted = f"shape {shape}, as by jnp.stack([...]), a rate for each state"
            raise SettingError(f"{where} returns {came}; return {wanted}")
        if not jnp.issubdtype(result.dtype, jnp.floating):
            raise SettingError(f"{where} returns {result.dtype}; return a number of type float64")
        self._index(where, role)
        self.traces[role] = _ADDRESS.sub("", str(traced))
        if traced.effects:
            raise SettingError(
                f"{where} prints or calls Python while it runs; leave out jax.debug and callbacks"
            )
        short = {str(dtype) for dtype in _dtypes(traced.jaxpr)} & {*_SHORT_FLOATS}
        if short:
            raise SettingError(
                f"{where} computes in {', '.join(sorted(short))}, and fits need float64; leave out the dtype, and "
                "convert constants to float64"
            )

    def _index(self, where: str, role: str) -> None:
        """Refuse a state that does not exist, in whose place JAX takes the last one."""
        theta, state, x, v = (np.asarray(array) for array in self._rest)
        try:
            self._of(role)(theta, state, x, v)
        except IndexError as error:
            raise SettingError(f"{where}: {error}; states are counted from 0") from None
        except Exception:  # an equation need not be computable without JAX
            return

    def _look_at_rest(self, where: str, role: str) -> None:
        equation = self._of(role)
        slopes = jax.jacfwd(equation, argnums=(0, 1))(*self._rest)
        if role == "relaxation":
            bounds = [float(equation(theta, state, x, v)) for theta, state, x, v in self._points()]
            if not all(0.0 <= bound < np.inf for bound in bounds):
                raise SettingError(f"{where} is negative or no number at some motion; give a bound in 1/s")
        if not bool(jnp.all(jnp.isfinite(equation(*self._rest)))):
            raise SettingError(
                f"{where} is not a finite number at rest, with nominal parameters and all states, displacement and "
                "velocity zero; every simulation begins there"
            )
        by_parameter = np.asarray(slopes[0]).reshape(-1, len(self._spec.names))
        bad = [
            name
            for name, is_finite in zip(self._spec.names, np.isfinite(by_parameter).all(axis=0), strict=True)
            if not is_finite
        ]
        bad += [] if np.isfinite(np.asarray(slopes[1])).all() else ["the states"]
        if bad:
            raise SettingError(
                f"{where} is a number at rest, and its derivative by {list_names(bad)} is none, which fits need; a "
                "power of a signal that may be zero is mrwork.twins.power(jnp.abs(z), n), and a root wants a small "
                "number beside what is below it"
            )

    def _points(self) -> Iterator[tuple[Floats, Floats, float, float]]:
        """Random points: parameters between their bounds, states, displacement and velocity."""
        rng, spec = np.random.default_rng(0), self._spec
        for _ in range(_POINTS):
            unit = rng.uniform(0.3, 0.7, len(spec.names))
            theta = np.asarray(Box.of(spec).theta_from_unit(unit)) if len(spec.names) else np.empty(0)
            x, v, state = (
                span * rng.uniform(-1.0, 1.0, size)
                for span, size in zip(_SPANS, (1, 1, spec.n_states), strict=True)
            )
            for parameters in (theta, spec.nominal):
                yield parameters, state, float(x[0]), float(v[0])

    def _find_unused(self) -> None:
        spec = self._spec
        roles = ["force", *(["rate"] if spec.n_states else [])]
        slopes = jax.jit(lambda *point: [jax.jacfwd(self._of(role))(*point) for role in roles])
        used = np.zeros(len(spec.names), dtype=np.bool_)
        for point in self._points():
            force, *rates = (np.asarray(slope).reshape(-1, len(used)) for slope in slopes(*point))
            used |= (np.concatenate([force, *rates]) != 0.0).any(axis=0)
            self.shifts &= (force[0] == 1.0) & ~np.concatenate([np.zeros_like(force), *rates]).any(axis=0)
        if not used.all():
            unused = [name for name, is_used in zip(spec.names, used, strict=True) if not is_used]
            raise SettingError(
                f"nothing in {spec.name} uses {list_names(unused)}; leave it out, or correct the equations"
            )

    def _look_at_sign(self) -> None:
        theta, state, still, _ = self._rest
        force = self._of("force")
        there, back, none = (float(force(theta, state, still, jnp.float64(v))) for v in (0.1, -0.1, 0.0))
        if there - none < 0.0 < back - none:
            raise SettingError(
                f"the force of {self._spec.name} has the direction of the velocity, so that it gives energy; turn its "
                "sign: force times velocity is the dissipated power"
            )


def _dtypes(jaxpr: Any) -> Iterator[Any]:
    """Types of all values of a traced function and of the functions in it."""
    for equation in jaxpr.eqns:
        yield from (
            invar.aval.dtype
            for invar in (*equation.invars, *equation.outvars)
            if hasattr(invar.aval, "dtype")
        )
        for inner in jaxprs_in_params(equation.params):
            yield from _dtypes(inner)
