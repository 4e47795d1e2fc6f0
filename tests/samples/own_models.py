"""Every model of the package as a damper of a user, by the text of its twin with NumPy in place of JAX."""

import __future__

import inspect
from functools import cache
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.twins import model_twins, powers

_FIRST, _END = "@_twin()\ndef bingham", "@dataclass"


@cache
def _equations() -> dict[str, tuple[Any, Any]]:
    """Rate and force of each model."""
    found: dict[str, tuple[Any, Any]] = {}

    def twin(rate: Any = model_twins._without_states) -> Any:
        return lambda force: found.setdefault(force.__name__, (rate, force))[1]

    text = inspect.getsource(model_twins)
    start = text.index(_FIRST)
    # At the lines of the file, whose text is looked at when it is recorded.
    part = "\n" * text[:start].count("\n") + text[start : text.index(_END, start)]
    names = (
        vars(model_twins) | vars(powers) | {"jnp": np, "EQUATIONS": found, "_twin": twin, "__name__": "own"}
    )
    exec(compile(part, model_twins.__file__, "exec", flags=__future__.annotations.compiler_flag), names)
    return found


@cache
def own_model(name: str) -> mr.DamperSpec:
    """The model of that name, recorded."""
    spec, (rate, force) = mr.damper(name), _equations()[name]
    in_states = {"rate": rate, "states": spec.n_states} if spec.n_states else {}
    given = {each.name: each for each in spec.parameters}
    return mr.own_damper(f"my_{name}", parameters=given, force=force, **in_states)
