"""Models that are identified in an equivalent form without redundant parameters, and mapped back exactly."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any

from mrwork.convert import bouc_wen_from_normalised
from mrwork.coordinates import Box
from mrwork.errors import SettingError
from mrwork.spec import DamperSpec, damper


@dataclass(frozen=True, slots=True, kw_only=True)
class Form:
    """What is searched: a model, its bounds, the map to the parameters asked for, and what that map holds fixed.

    `mirrored` parameters can change sign together with little effect: an offset -k x0 can be made by either
    sign of a small k, but a descent cannot cross k = 0, where x0 is infinite.
    """

    spec: DamperSpec
    box: Box
    back: Callable[[Any], Any]
    held: tuple[str, ...] = ()
    mirrored: tuple[int, ...] = ()


def identifiable_form(spec: DamperSpec, bounds: Mapping[str, tuple[float, float]]) -> Form:
    """Return the form in which a model is identified, with the user's bounds.

    The Spencer form of Bouc-Wen is searched as `normalised_bouc_wen`: its alpha, gamma, beta and A share one freedom
    of scale, so no search or standard error could settle them. A is held at the fixed value asked for,
    or at its nominal one.

    Raises
    ------
    SettingError
        Where a bound is impossible, or cannot be translated into that form.
    """
    if spec.name == "bouc_wen" and spec.current is not None:
        raise SettingError(
            "bouc_wen with current laws is identified as normalised_bouc_wen, whose parameters the data settle; "
            "give the laws to that model (c for c0, k for k0, k_w for alpha)"
        )
    if spec.name != "bouc_wen":
        box = Box.of(spec).with_bounds(bounds)
        return Form(spec=spec, box=box, back=lambda theta: theta, mirrored=_mirrored(box))
    checked = Box.of(spec).with_bounds(bounds)
    index = spec.names.index("A")
    scale = spec.parameters[index].nominal
    translated: dict[str, tuple[float, float]] = {}
    for name, (lower, upper) in bounds.items():
        if name == "A" and lower == upper:
            scale = checked.lower[index]
        elif name in _SAME:
            translated[_SAME[name]] = (lower, upper)
        else:
            raise SettingError(
                f"bounds of {name} cannot be kept: in bouc_wen the data settle alpha, gamma, beta and A only up to a "
                "common scale; fix A=VALUE to choose the scale, or identify normalised_bouc_wen"
            )
    normalised = damper("normalised_bouc_wen")
    box = Box.of(normalised).with_bounds(translated)
    return Form(
        spec=normalised,
        box=box,
        back=partial(bouc_wen_from_normalised, A=scale),
        held=("A",),
        mirrored=_mirrored(box),
    )


def _mirrored(box: Box) -> tuple[int, ...]:
    """The stiffness k and its free length x0, where both are free and may have either sign."""
    pair = tuple(box.names.index(name) for name in ("k", "x0") if name in box.names)
    free = all(box.lower[index] < 0.0 < box.upper[index] for index in pair)
    return pair if len(pair) == 2 and free else ()


# Parameters that mean the same in both forms.
_SAME = {"c0": "c", "k0": "k", "x0": "x0", "n": "n"}
