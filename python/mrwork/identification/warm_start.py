"""Starts that are given rather than searched: by hand, or from an earlier fit of this or a kindred model."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from mrwork.dampers.parameters import LawName, current_laws
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SettingError, UnknownNameError
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import Fit
from mrwork.identification.settings import Start


def start_from(fit: Fit, model: DamperSpec) -> dict[str, float]:
    """What an earlier fit says of the parameters of a model: those that both have, by name and unit.

    A law may be the same or of a higher degree, whose further coefficients then start where they change nothing.

    Raises
    ------
    SettingError
        Where nothing is shared, a law cannot be carried over, or the laws take another command.
    """
    earlier = fit.spec
    plain, earlier_plain = damper(model.name), damper(earlier.name)
    units = {parameter.name: parameter.unit for parameter in earlier_plain.parameters}
    if model.current and earlier.current and model.current.unit != earlier.current.unit:
        raise SettingError(
            f"the laws of the earlier fit take {earlier.current.unit}, those of {model.name} "
            f"{model.current.unit}; start from a fit in {model.current.unit}"
        )
    values = dict(zip(earlier.names, fit.theta, strict=True))
    start: dict[str, float] = {}
    for name in (each.name for each in plain.parameters if units.get(each.name) == each.unit):
        was, law = _law_of(earlier, name), _law_of(model, name)
        if law != was and not current_laws()[was].raised_to(current_laws()[law]):
            raise SettingError(
                f"{name} is {was} in the earlier fit and {law} in {model.name}; "
                "a start can keep a law or raise its degree"
            )
        for parameter in model.parameters:
            if parameter.name == name or (was == "constant" and parameter.name == f"{name}.0"):
                start[parameter.name] = values[name]
            elif parameter.name.startswith(f"{name}."):
                start[parameter.name] = values.get(parameter.name, parameter.nominal)
    if not start:
        raise SettingError(
            f"{model.name} shares no parameter with {earlier.name}; start from a model with some of "
            f"{', '.join(plain.names)}"
        )
    if "eta" in model.names and "eta" in values:
        start["eta"] = values["eta"]
    return start


def _law_of(spec: DamperSpec, name: str) -> LawName:
    if spec.current is None:
        return "constant"
    return spec.current.laws[damper(spec.name).names.index(name)]


def check_starts(spec: DamperSpec, form: Form, starts: Sequence[Start]) -> None:
    """Refuse starts that cannot be used, before anything is searched.

    Raises
    ------
    UnknownNameError
        Where the model has no such parameter.
    SettingError
        Where a value is not finite, or the model is identified in a form that needs all of its parameters.
    """
    for start in starts:
        for name, value in start.items():
            if name not in spec.names:
                raise UnknownNameError(
                    f"a start names {name!r}, which {spec.name} does not have; it has {', '.join(spec.names)}"
                )
            if not isfinite(value):
                raise SettingError(f"a start gives {name} the value {value}; a finite number is expected")
        missing = [name for name in spec.names if name not in start]
        if missing and form.spec.name != spec.name:
            raise SettingError(
                f"{spec.name} is identified as {form.spec.name}, which takes a start only as a whole; "
                f"give {', '.join(missing)} too"
            )
