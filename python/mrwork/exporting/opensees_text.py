"""A fitted Bouc-Wen damper at one command as materials of OpenSees, in Tcl and in Python for openseespy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import astuple, dataclass
from math import ceil

import numpy as np

from mrwork.dampers.conversions import (
    USUAL_OPENSEES_ERROR,
    bouc_wen_from_normalised,
    normalised_from_bouc_wen,
    opensees_from_bouc_wen,
    require_bounded_loop,
)
from mrwork.dampers.spec import damper
from mrwork.errors import SettingError
from mrwork.exporting.single_command import parameters_at, refuse_bounds
from mrwork.identification.fit import Fit
from mrwork.numbers import of_unit
from mrwork.records.columns import StatedCommand
from mrwork.values import Floats

USUAL_TIME_STEP = 0.001
"""Step [s] of an analysis in OpenSees where none is given."""
# As many as the package itself takes in a step.
_MOST_SUBSTEPS = 256


def _spencer(theta: Floats) -> Floats:
    require_bounded_loop(theta)
    return np.asarray(normalised_from_bouc_wen(theta))


# Models that are BoucWen beside a dashpot and a spring, with the conversion to the normalised form.
_NORMALISED: dict[str, Callable[[Floats], Floats]] = {
    "normalised_bouc_wen": lambda theta: theta,
    "bouc_wen": _spencer,
}


@dataclass(frozen=True, slots=True)
class _Tag:
    """Tag of a part of the damper, counted from the tag of the damper."""

    number: int


@dataclass(frozen=True, slots=True, kw_only=True)
class _Material:
    """A command `uniaxialMaterial`: kind, tag, and numbers and tags behind it."""

    kind: str
    tag: _Tag
    arguments: tuple[float | _Tag, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenSeesDamper:
    """Materials, of which the last is the damper, and `facts` as lines of a comment."""

    facts: tuple[str, ...]
    materials: tuple[_Material, ...]

    @property
    def tcl(self) -> str:
        """Text for OpenSees; `damper TAG` makes the material."""

        def word(argument: float | _Tag) -> str:
            return f"[expr {{$tag + {argument.number}}}]" if isinstance(argument, _Tag) else repr(argument)

        commands = (
            f"    uniaxialMaterial {each.kind} {' '.join(map(word, (each.tag, *each.arguments)))}"
            for each in self.materials
        )
        return "\n".join([*(f"# {fact}" for fact in self.facts), "proc damper {tag} {", *commands, "}", ""])

    @property
    def python(self) -> str:
        """Text for openseespy; `damper(tag)` makes the material."""

        def word(argument: float | _Tag) -> str:
            return f"tag + {argument.number}" if isinstance(argument, _Tag) else repr(argument)

        calls = (
            f'    ops.uniaxialMaterial("{each.kind}", {", ".join(map(word, (each.tag, *each.arguments)))})'
            for each in self.materials
        )
        head = [*(f"# {fact}" for fact in self.facts), "import openseespy.opensees as ops", "", ""]
        return "\n".join([*head, "def damper(tag: int) -> None:", *calls, ""])


def opensees_damper(
    fit: Fit, stated: StatedCommand | None, *, error: float | None, time_step: float | None
) -> OpenSeesDamper:
    """The damper of a fit at a command, with the strain step and the sub-steps that keep the wanted error.

    The loop is BoucWen with z up to 1, from where the iteration of OpenSees starts near enough; dashpot and spring are
    materials of their own, the spring with the free length x0 as an initial strain.
    """
    if fit.model not in _NORMALISED:
        raise SettingError(
            f"OpenSees has no material that equals {fit.model}; fit {' or '.join(_NORMALISED)}, or export to csv"
        )
    refuse_bounds(fit)
    theta, command = parameters_at(fit, stated)
    normalised = _NORMALISED[fit.model](theta)
    c, k, x0, k_w, rho, _, _ = normalised.tolist()
    loop = normalised * np.array([0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    material, _ = opensees_from_bouc_wen(bouc_wen_from_normalised(loop, A=rho), Ao=rho)
    wanted = USUAL_OPENSEES_ERROR if error is None else error
    step = material.strain_step(wanted)
    at = (
        ""
        if command is None or fit.spec.current is None
        else f" at {of_unit(command, fit.spec.current.unit)}"
    )
    facts = [
        f"{damper(fit.model).title}{at}, fit {fit.fit_percent:.2f} %; units N, m, s",
        f"for an error of the hysteretic force below {100.0 * wanted:g} % of its largest value, {k_w:.4g} N,",
        f"let the strain change by at most {step:.3g} m in a step: the error of OpenSees is proportional to it",
    ]
    if fit.tested is not None and fit.tested.velocity > 0.0:
        facts.append(_substeps_in_words(fit.tested.velocity, step, time_step or USUAL_TIME_STEP))
    if k and x0:
        facts.append(f"the spring is free at {x0:.4g} m: at rest the force is {-k * x0:.4g} N")
    parts: list[tuple[str, tuple[float | _Tag, ...]]] = [("BoucWen", astuple(material))]
    parts += [("Viscous", (c, 1.0))] if c else []
    parts += [("Elastic", (k,))] if k else []
    joined = [_Tag(number) for number in range(1, len(parts) + 1)]
    if k and x0:
        parts.append(("InitStrainMaterial", (joined[-1], -x0)))
        joined[-1] = _Tag(len(parts))
    materials = [
        _Material(kind=kind, tag=_Tag(number), arguments=arguments)
        for number, (kind, arguments) in enumerate(parts, start=1)
    ]
    whole = _Material(kind="Parallel", tag=_Tag(0), arguments=tuple(joined))
    return OpenSeesDamper(facts=tuple(facts), materials=(*materials, whole))


def _substeps_in_words(velocity: float, step: float, time_step: float) -> str:
    """How many parts of a time step a velocity [m/s] needs for a strain step [m]; refused where they are too many."""
    count = ceil(velocity * time_step / step)
    if count > _MOST_SUBSTEPS:
        raise SettingError(
            f"OpenSees would need {count} sub-steps of {time_step:g} s at the largest tested velocity, {velocity:.3g} "
            f"m/s, and {_MOST_SUBSTEPS} are the most; give a larger error or a shorter time step"
        )
    return (
        f"at the largest tested velocity, {velocity:.3g} m/s, these are {count} sub-steps of {time_step:g} s"
    )
