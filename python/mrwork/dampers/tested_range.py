"""Ranges in which a damper was tested, the demand on it outside of them, and a fitted damper with its ranges."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf
from typing import ClassVar, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.arguments import NotNegative, checked
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.command import command_noise
from mrwork.dampers.spec import LAW_BEYOND, DamperSpec, DependenceLimit, law_limits

OperatingQuantity = Literal["stroke", "velocity", "frequency", "command", "force", "power"]
_ORDER: tuple[OperatingQuantity, ...] = get_args(OperatingQuantity)

# Demand beyond a tested range by less than this share is within it: rigs repeat a motion to a few per cent.
_TOLERANCE = 0.05
# A gap between tested commands is wide if it is this share of their range and this factor wider than any other; or, if
# its upper end is this multiple of its lower one, as in no series that doubles, by the smaller factor.
_WIDE, _FAR_WIDER, _MULTIPLE, _WIDER = 0.25, 2.5, 2.2, 1.9
# Cycles of a motion differ in length, and half cycles in amplitude, by more than that.
_CYCLE_TOLERANCE = 0.1
# Share of the travel in half cycles that are smaller than the smallest tested amplitude, beyond which they matter.
_SMALL = 0.2

# Of each quantity its unit, the displayed one, the factor between them, and the unit of large numbers, from 1000 on.
_UNITS: dict[OperatingQuantity, tuple[str, str, float, str]] = {
    "stroke": ("m", "mm", 1e3, "m"),
    "velocity": ("m/s", "mm/s", 1e3, "m/s"),
    "force": ("N", "N", 1.0, "kN"),
    "power": ("W", "W", 1.0, "kW"),
    "frequency": ("Hz", "Hz", 1.0, "kHz"),
}
_NAMES: dict[OperatingQuantity, str] = {"power": "mean power"}
_OUTSIDE = RemarkKind("outside_tested_range", "{demand}{where}", "test there before you rely on it")
_BEYOND_RATING = RemarkKind("demand_beyond_rating", "{demand}{where}", warns=True)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Exceedance(Summarised):
    """Demand on a damper outside the tested range of one quantity, all in `unit`: SI, or the unit of the command.

    A command between `lowest` and `highest` is in a gap of the tested ones. `extrapolated` are the parameters whose
    laws are used at a command that was not tested. A demand beyond what the damper is `rated` for has no tested range.
    """

    quantity: OperatingQuantity
    demanded: float
    lowest: float
    highest: float
    unit: str
    extrapolated: tuple[str, ...] = ()
    rated: bool = False

    @property
    def below(self) -> bool:
        """Whether the demand is below the tested range, and not above."""
        return self.demanded < self.lowest

    @property
    def between(self) -> bool:
        """Whether the demand is in a gap of the tested commands."""
        return self.quantity == "command" and self.lowest < self.demanded < self.highest

    @property
    def rank(self) -> tuple[bool, int]:
        """Place among others: small strokes, which every earthquake has, come last."""
        return self.quantity == "stroke" and self.below, _ORDER.index(self.quantity)

    @property
    def times(self) -> float:
        """Demand over the highest tested value; infinite where that is zero."""
        return self.demanded / self.highest if self.highest > 0.0 else inf

    @property
    def severity(self) -> float:
        """Factor between the demand and the tested range, for comparison of exceedances of one quantity."""
        if not self.below:
            return self.times
        return self.lowest / self.demanded if self.demanded > 0.0 else inf

    @property
    def in_words(self) -> str:
        """Text such as "velocity 313 mm/s, tested to 88 mm/s (3.6 times)"."""
        if self.quantity == "stroke" and self.below:
            (demanded, lowest), unit = _format_values(self.quantity, (self.demanded, self.lowest), self.unit)
            return (
                f"small half cycles, {demanded} {unit} or less, make {100 * _SMALL:.0f} % of the travel or more, "
                f"tested from {lowest} {unit}, so the hysteresis of small strokes is extrapolated"
            )
        (demanded, lowest, highest), unit = _format_values(
            self.quantity, (self.demanded, self.lowest, self.highest), self.unit
        )
        tested = f"to {highest}"
        if self.quantity in ("frequency", "command"):
            single = _is_single(self.lowest, self.highest)
            tested = f"at {highest}" if single else f"from {lowest} to {highest}"
        if self.between:
            tested = f"up to {lowest} {unit} and from {highest}"
        no_times = self.between or self.below or not 1.005 <= self.times < inf
        times = "" if no_times else f" ({self.times:.{3 if self.times < 1.1 else 2}g} times)"
        name = _NAMES.get(self.quantity, self.quantity)
        laws = ""
        if self.extrapolated:
            plural, verb = ("", "is") if len(self.extrapolated) == 1 else ("s", "are")
            how = "interpolated, and no test shows by which form" if self.between else "extrapolated"
            laws = f"; the law{plural} of {', '.join(self.extrapolated)} {verb} {how}"
        return f"{name} {demanded} {unit}, {'rated' if self.rated else 'tested'} {tested} {unit}{times}{laws}"

    def _summary(self) -> Summary:
        return Summary(title=self.in_words)


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class OperatingRange(Summarised):
    """Ranges of motion, command and load of a damper: those it was tested in, or those that a simulation demands.

    `stroke` is half the peak-to-peak elongation [m], or its peak from rest; half cycles of the amplitude `least_stroke`
    [m] and smaller make a fifth of the travel, `None` if unknown, of several tests the least; `velocity` [m/s] and
    `force` [N] are peaks; `power` is the largest mean dissipated power of a test [W], which heats the damper.
    `frequency` [Hz] counts the cycles, without the slowest and the fastest tenth; `command`, in
    `command_unit`, is the lowest and the highest, `None` if unknown, and `levels` are those at which it stays, lowest
    first, empty if unknown.
    """

    stroke: NotNegative
    velocity: NotNegative
    frequency: tuple[float, float] | None
    command: tuple[float, float] | None
    command_unit: CommandUnit | None
    force: NotNegative
    power: NotNegative
    least_stroke: NotNegative | None = None
    levels: tuple[float, ...] = ()

    @property
    def gap(self) -> tuple[float, float] | None:
        """Neighbouring levels of the command between which no test is, where every other gap is far narrower."""
        gaps = sorted(pairwise(self.levels), key=lambda gap: gap[1] - gap[0])
        if len(gaps) < 2:
            return None
        low, high = gaps[-1]
        span, second = self.levels[-1] - self.levels[0], gaps[-2][1] - gaps[-2][0]
        factor = _WIDER if high > _MULTIPLE * low else _FAR_WIDER
        # Levels that noise sets apart are one.
        is_wide = second > _TOLERANCE * span and high - low >= max(factor * second, _WIDE * span)
        return (low, high) if is_wide else None

    @checked
    def exceeded_by(self, demand: OperatingRange) -> tuple[Exceedance, ...]:
        """Quantities in which a demand is outside these ranges by more than 5 %, frequency and least stroke 10 %.

        Half cycles below the least tested stroke count where they make a fifth of the travel of the demand. A command
        in a `gap` of the tested ones is outside, too: a level of the demand, or an end of its range.
        """
        exceedances = [
            _exceedance(quantity, unit, (0.0, getattr(self, quantity)), (0.0, getattr(demand, quantity)))
            for quantity, (unit, *_) in _UNITS.items()
            if quantity != "frequency"
        ]
        if self.least_stroke is not None and (least := demand.least_stroke) is not None:
            tested = self.least_stroke, max(self.stroke, least)
            exceedances.insert(
                0, _exceedance("stroke", "m", tested, (least, least), relative=_CYCLE_TOLERANCE)
            )
        if self.frequency is not None and demand.frequency is not None:
            ranges = self.frequency, demand.frequency
            exceedances.append(_exceedance("frequency", "Hz", *ranges, relative=_CYCLE_TOLERANCE))
        unit = self.command_unit
        if self.command and demand.command and unit is not None and unit == demand.command_unit:
            exceedances.append(
                _exceedance("command", unit, self.command, demand.command, command_noise(0.0, unit))
            )
            if (gap := self.gap) is not None and not exceedances[-1]:
                low, high = gap
                depth, level = max(
                    (min(level - low, high - level), level) for level in demand.levels or demand.command
                )
                if depth > _TOLERANCE * (high - low):
                    exceedances.append(
                        Exceedance(quantity="command", demanded=level, lowest=low, highest=high, unit=unit)
                    )
        return tuple(sorted(filter(None, exceedances), key=lambda exceedance: exceedance.rank))

    @property
    def in_words(self) -> str:
        """Text such as "stroke to 25 mm, velocity to 88 mm/s, frequency 0.1 to 5 Hz, command 0 to 1 A, ..."."""
        return ", ".join(f"{name} {span}" for name, span in self.rows())

    def rows(self) -> list[tuple[str, str]]:
        """Each known quantity with its range in displayed units, for a table."""
        rows = []
        for quantity in _ORDER:
            value = getattr(self, quantity)
            if value is None:
                continue
            ends = value if isinstance(value, tuple) else (value,)
            if quantity == "stroke" and self.least_stroke is not None:
                ends = ends if _is_single(self.least_stroke, value) else (self.least_stroke, value)
            shown, unit = _format_values(quantity, ends, str(self.command_unit))
            span = f"to {shown[0]}"
            if len(shown) == 2:
                span = f"at {shown[1]}" if _is_single(*ends) else f"{shown[0]} to {shown[1]}"
            if quantity == "command" and self.gap is not None:
                (low, high), _ = _format_values(quantity, self.gap, unit)
                unit += f" without tests between {low} and {high} {unit}"
            rows.append((_NAMES.get(quantity, quantity), f"{span} {unit}"))
        return rows

    def _summary(self) -> Summary:
        return Summary(title="Operating range", facts=self.rows())


def outside_remark(exceedance: Exceedance, where: str = "") -> Remark:
    """The warning of a demand outside a tested or rated range, and `where` it is the worst of several."""
    demanded = Measured(exceedance.demanded, exceedance.unit)
    kind = _BEYOND_RATING if exceedance.rated else _OUTSIDE
    return kind.remark(exceedance.quantity, measured=demanded, demand=exceedance.in_words, where=where)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Outside(Summarised):
    """Demand on a damper outside its tested ranges, and laws that leave their admissible range under that demand.

    `known` is false where the damper has no tested ranges, as one of a published set.
    """

    _made_by: ClassVar[str] = "fit.outside(test)"

    exceedances: tuple[Exceedance, ...] = ()
    laws: tuple[DependenceLimit, ...] = ()
    known: bool = True

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the quantities that are outside, one for each exceedance."""
        return tuple(exceedance.quantity for exceedance in self.exceedances)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """A warning of each quantity and law."""
        return (*map(outside_remark, self.exceedances), *(limit.remark(LAW_BEYOND) for limit in self.laws))

    def _summary(self) -> Summary:
        title = "Within the tested ranges" if self.known else "Tested ranges not known"
        if self.names:
            title = f"Outside the tested ranges in {', '.join(self.names)}"
        return Summary(title=title, remarks=self.remarks)


@dataclass(frozen=True, slots=True, kw_only=True)
class FittedDamper:
    """Model and parameters of an identified damper, and the ranges of its tests, `None` if unknown.

    `draws` reads its posterior draws, shape (n_draws, n_params), `None` where there are none. `others` are the same
    damper with other sets of laws that predict nearly as well. `files` are the files of a run folder that has it, by
    name.
    """

    spec: DamperSpec
    theta: tuple[float, ...]
    tested: OperatingRange | None = None
    draws: Callable[[], Floats | None] = lambda: None
    others: tuple[FittedDamper, ...] = ()
    files: Callable[[], Mapping[str, bytes]] = dict


def outside_of(
    spec: DamperSpec, theta: ArrayLike, tested: OperatingRange | None, demand: OperatingRange
) -> Outside:
    """Compare a demand with the tested ranges of a damper, and evaluate its laws at the demanded commands."""
    exceedances = () if tested is None else tested.exceeded_by(demand)
    laws = {"command": spec.following}
    return Outside(
        exceedances=tuple(replace(each, extrapolated=laws.get(each.quantity, ())) for each in exceedances),
        laws=() if demand.command is None else law_limits(spec, theta, demand.command),
        known=tested is not None,
    )


def beyond_rating(
    demand: OperatingRange, *, force: float | None, stroke: float | None, command: float | None = None
) -> tuple[Exceedance, ...]:
    """What of a demand is beyond force [N], stroke [m] and command that a damper is rated for, `None` if unknown."""
    rated: tuple[tuple[OperatingQuantity, str, float, float | None], ...] = (
        ("stroke", "m", demand.stroke, stroke),
        ("force", "N", demand.force, force),
        ("command", demand.command_unit or "A", demand.command[1] if demand.command else 0.0, command),
    )
    return tuple(
        Exceedance(quantity=quantity, demanded=peak, lowest=0.0, highest=most, unit=unit, rated=True)
        for quantity, unit, peak, most in rated
        if most is not None and peak > most
    )


def covering(ranges: Sequence[OperatingRange]) -> OperatingRange:
    """The smallest range that covers all; they have one unit of the command."""
    units = [each.command_unit for each in ranges if each.command_unit is not None]
    return OperatingRange(
        stroke=max(each.stroke for each in ranges),
        velocity=max(each.velocity for each in ranges),
        frequency=_hull(each.frequency for each in ranges),
        command=_hull(each.command for each in ranges),
        command_unit=units[0] if units else None,
        levels=tuple(sorted({level for each in ranges for level in each.levels})),
        force=max(each.force for each in ranges),
        power=max(each.power for each in ranges),
        least_stroke=min(
            (each.least_stroke for each in ranges if each.least_stroke is not None), default=None
        ),
    )


def worst_of(cases: Sequence[tuple[str, Outside]]) -> list[tuple[Exceedance, str, int]]:
    """For each quantity, above, below or in a gap of its range, or above its rating: worst, label and number."""
    groups: dict[tuple[str, bool, bool, bool], list[tuple[str, Exceedance]]] = {}
    for label, outside in cases:
        for exceedance in outside.exceedances:
            key = exceedance.quantity, exceedance.below, exceedance.between, exceedance.rated
            groups.setdefault(key, []).append((label, exceedance))
    worst = []
    for members in groups.values():
        label, exceedance = max(members, key=lambda member: member[1].severity)
        worst.append((exceedance, label, len(members)))
    return sorted(worst, key=lambda row: row[0].rank)


def _exceedance(
    quantity: OperatingQuantity,
    unit: str,
    tested: tuple[float, float],
    demand: tuple[float, float],
    absolute: float = 0.0,
    *,
    relative: float = _TOLERANCE,
) -> Exceedance | None:
    lowest, highest = tested
    # Only commands, as temperatures, may be negative.
    above = (1.0 + relative) * highest if highest > 0.0 else highest - relative * highest
    below = lowest / (1.0 + relative) if lowest > 0.0 else (1.0 + relative) * lowest
    if demand[1] > above + absolute:
        demanded = demand[1]
    elif demand[0] < below - absolute:
        demanded = demand[0]
    else:
        return None
    return Exceedance(quantity=quantity, demanded=demanded, lowest=lowest, highest=highest, unit=unit)


# Reversals of less than this fraction of the peak-to-peak displacement are noise.
_LEAST_HALF_CYCLE = 0.01


def half_cycle_ends(displacement: Floats) -> NDArray[np.intp]:
    """Samples between which the half cycles of a motion lie, from reversal to reversal, shape (n_half_cycles + 1,).

    What lies before the first reversal and after the last is no half cycle; a motion with fewer than two reversals
    counts as one, between its extremes. Reversals of less than 1 % of the peak-to-peak displacement of the record are
    ignored.
    """
    least = _LEAST_HALF_CYCLE * float(np.ptp(displacement))
    turned = np.flatnonzero(np.diff(np.sign(np.diff(displacement)))) + 1
    samples = np.concatenate([[0], turned, [displacement.size - 1]])
    reversals, ends = [float(displacement[0])], [0]
    # 1, -1: the motion goes up, down since the last reversal; 0: it has not begun.
    way = 0
    for sample, turned_at in zip(samples.tolist(), displacement[samples].tolist(), strict=True):
        moved = turned_at - reversals[-1]
        if way * moved > 0.0:
            reversals[-1], ends[-1] = turned_at, sample
        elif abs(moved) > least:
            reversals.append(turned_at)
            ends.append(sample)
            way = 1 if moved > 0.0 else -1
    if len(ends) > 3:
        return np.array(ends[1:-1], dtype=np.intp)
    return np.sort([np.argmin(displacement), np.argmax(displacement)])


def least_stroke(displacement: Floats) -> float:
    """Amplitude [m] of half cycles that make, with all smaller ones, a fifth of the travel of a displacement [m]."""
    ranges = np.sort(np.abs(np.diff(displacement[half_cycle_ends(displacement)])))
    travelled = np.cumsum(ranges)
    return 0.5 * float(ranges[np.searchsorted(travelled, _SMALL * travelled[-1])])


def _hull(spans: Iterable[tuple[float, float] | None]) -> tuple[float, float] | None:
    bounds = [span for span in spans if span is not None]
    return (min(low for low, _ in bounds), max(high for _, high in bounds)) if bounds else None


def _is_single(lowest: float, highest: float) -> bool:
    """Whether a range is one value: the cycles of a rig differ by a sample or two."""
    return highest - lowest <= 0.5 * _TOLERANCE * highest


def _format_values(quantity: OperatingQuantity, values: Sequence[float], unit: str) -> tuple[list[str], str]:
    """Values with three significant digits, and their common displayed unit."""
    _, small, factor, large = _UNITS.get(quantity, (unit, unit, 1.0, unit))
    if max(factor * value for value in values) >= 1000.0:
        factor, small = 1e-3 * factor if large != small else factor, large
    return [f"{factor * value:.3g}" for value in values], small
