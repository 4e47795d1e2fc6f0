"""The damper of a fit at one command, which the tables and OpenSees take, and what of a fit cannot be exported."""

from __future__ import annotations

from mrwork.command_signal import command_noise
from mrwork.dampers.spec import law_limits, plain_parameters
from mrwork.errors import SettingError
from mrwork.identification.fit import Fit
from mrwork.numbers import of_unit
from mrwork.records.columns import StatedCommand
from mrwork.values import Floats


def refuse_bounds(fit: Fit) -> None:
    """Refuse a fit whose parameters lie on their bounds: a better one may lie beyond."""
    for each in fit.estimates:
        if each.remark in ("at lower bound", "at upper bound"):
            raise SettingError(
                f"{each.name} is {each.remark.replace('at', 'at its')}, {of_unit(each.value, each.unit)}, and a better "
                "fit may lie beyond; fit again with a wider bound, or hold the parameter fixed, and export that"
            )


def parameters_at(fit: Fit, stated: StatedCommand | None) -> tuple[Floats, float | None]:
    """Parameters of the plain model at a command, shape (n_plain,), and the command in the unit of the laws."""
    current = fit.spec.current
    if current is None:
        if stated is not None:
            raise SettingError(
                "this fit has no current laws, so its damper is the same at any command; leave the command out"
            )
        return plain_parameters(fit.spec, fit.theta, 0.0), None
    if stated is None:
        raise SettingError(
            f"the parameters follow the command; give one with its unit, as in 0.5{current.unit}"
        )
    unit = {"current": "A", "voltage": "V"}.get(stated.quantity or "", stated.unit)
    if stated.value is None or unit != current.unit:
        raise SettingError(
            f"the laws of this fit take the command in {current.unit}; give a number with that unit, as in "
            f"0.5{current.unit}"
        )
    value = stated.value
    tested = None if fit.tested is None else fit.tested.command
    noise = command_noise(0.0, current.unit)
    if tested is not None and not tested[0] - noise <= value <= tested[1] + noise:
        raise SettingError(
            f"{of_unit(value, current.unit)} is outside the tested commands, {tested[0]:g} to "
            f"{of_unit(tested[1], current.unit)}; give one within"
        )
    if limits := law_limits(fit.spec, fit.theta, (value, value)):
        raise SettingError(f"{limits[0].in_words}; give another command")
    return plain_parameters(fit.spec, fit.theta, value), value
