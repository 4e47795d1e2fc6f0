"""Target spectra of codes, motions scaled to them, and the check of a suite of motions against its target."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, Final, Literal

import numpy as np
from numpy.typing import ArrayLike

from mrwork.base.arguments import Positive, checked
from mrwork.base.hints import Says, Within
from mrwork.base.numbers import counted, format_rounded, least_to_most
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Column, Table
from mrwork.base.units import RATIOS, STANDARD_GRAVITY
from mrwork.base.values import Floats, array_dataclass
from mrwork.errors import SettingError
from mrwork.motions.ground_motion import (
    GroundMotion,
    copies_among,
    copies_remarks,
    refuse_forces,
    replace_samples,
)
from mrwork.motions.spectrum import Ratio, response_spectrum

Ground = Literal["A", "B", "C", "D", "E"]
ScaledBy = Literal["pga", "sa", "least_squares"]
"""What a motion takes from its target: peak, Sa at a period, or Sa over a range of periods."""

TargetDamping = Annotated[Ratio, Says("damping ratio; ASCE 7 has 0.05", usual=RATIOS)]

RANGE = (0.2, 2.0)
"""Ends of the range of periods of a suite, over the first period of the building."""
LEAST_RATIO = 0.9
"""Least ratio of the mean spectrum of a suite to its target within that range."""
# Factor from which a suite is not of its target: 48 synthetic suites scaled by least squares are within 0.9 and 1.2.
_FAR = 1.3
# Logarithmic steps of that range, and of what a figure shows on either side of it.
_STEPS, _MARGIN = 100, 30


@dataclass(frozen=True, slots=True, kw_only=True)
class SuiteRule:
    """Rule of a code for a suite: its clause, the fewest records, and the number from which responses are averaged.

    With `holds_peak` the mean of the peaks must not be below the target at the period zero.
    """

    clause: str
    fewest: int
    averaged_from: int
    holds_peak: bool


_EN_1998 = SuiteRule(clause="EN 1998-1, 3.2.3.1.2(4)", fewest=3, averaged_from=7, holds_peak=True)
_ASCE_7 = SuiteRule(clause="ASCE 7-16, 16.2", fewest=11, averaged_from=11, holds_peak=False)

# Soil factor, and corner periods T_B, T_C and T_D [s], by type and ground: EN 1998-1:2004, Tables 3.2 and 3.3.
_EN_1998_GROUNDS: dict[int, dict[Ground, tuple[float, float, float, float]]] = {
    1: {
        "A": (1.0, 0.15, 0.4, 2.0), "B": (1.2, 0.15, 0.5, 2.0), "C": (1.15, 0.2, 0.6, 2.0),
        "D": (1.35, 0.2, 0.8, 2.0), "E": (1.4, 0.15, 0.5, 2.0),
    },
    2: {
        "A": (1.0, 0.05, 0.25, 1.2), "B": (1.35, 0.05, 0.25, 1.2), "C": (1.5, 0.1, 0.25, 1.2),
        "D": (1.8, 0.1, 0.3, 1.2), "E": (1.6, 0.05, 0.25, 1.2),
    },
}  # fmt: skip


@array_dataclass(repr=False)
class TargetSpectrum(Summarised):
    """Elastic spectrum of horizontal pseudo-acceleration at one damping ratio that motions are scaled to.

    Parameters
    ----------
    name, source
        In tables and figures, and where it is from.
    damping
        Damping ratio.
    periods, accelerations
        Points between which it runs straight [s], [m/s^2], shape (n,).
    falls
        Periods from which the last acceleration falls as 1 / T, and as 1 / T^2 [s]; empty for a table, which ends
        there.
    rule
        What its code wants of a suite.
    """

    _made_by: ClassVar[str] = "mr.motions.en_1998_spectrum(a_g, ground)"

    name: str
    source: str
    damping: float
    periods: Floats
    accelerations: Floats
    falls: tuple[float, ...]
    rule: SuiteRule

    @checked
    def acceleration(self, periods: ArrayLike) -> Floats:
        """Pseudo-acceleration [m/s^2] in the shape of `periods` [s], from zero on."""
        period = np.asarray(periods, dtype=np.float64)
        low, high = self.ends
        if not ((period >= low) & (period <= high)).all():
            asked = dict.fromkeys(f"{end:.3g}" for end in (period.min(), period.max()))
            raise SettingError(
                f"target spectrum {self.name!r} is known from {low:g} to {high:g} s, and is asked for at "
                f"{' to '.join(asked)} s; choose periods within, or give more points"
            )
        acceleration = np.interp(period, self.periods, self.accelerations)
        for corner in self.falls:
            acceleration = acceleration * (corner / np.maximum(period, corner))
        return np.asarray(acceleration)

    @property
    def ends(self) -> tuple[float, float]:
        """Shortest and longest period at which it has a value [s]; infinite of a code."""
        return float(self.periods[0]), math.inf if self.falls else float(self.periods[-1])

    def _summary(self) -> Summary:
        columns = (
            Column("", "period", "s", shown=format_rounded, of=float),
            Column("", "acceleration", "m/s^2", shown=format_rounded, of=self.acceleration),
        )
        return Summary(
            title=f"Target spectrum {self.name}",
            facts=(("damping", f"{100.0 * self.damping:g} %"), ("source", self.source)),
            tables=[Table.of(columns, (*self.periods, *self.falls))],
        )


@checked
def en_1998_spectrum(
    a_g: Annotated[
        Positive,
        Says(
            "design ground acceleration of EN 1998-1 on ground A, with the importance factor",
            unit="m/s2",
            usual=(0.4, 15.0),
        ),
    ],
    ground: Annotated[Ground, Says("ground type of EN 1998-1")] = "A",
    *,
    spectrum_type: Annotated[
        int,
        Within(least=1, most=2),
        Says("type of EN 1998-1, 2 where magnitudes of surface waves are up to 5.5", named="type"),
    ] = 1,
    damping: TargetDamping = 0.05,
) -> TargetSpectrum:
    """Elastic horizontal spectrum of EN 1998-1:2004, 3.2.2.2, with the recommended values of Tables 3.2 and 3.3.

    `S_e = a_g S (1 + T / T_B (2.5 eta - 1))` up to T_B, `2.5 eta a_g S` up to T_C, `2.5 eta a_g S T_C / T` up to T_D,
    then `2.5 eta a_g S T_C T_D / T^2`, with `eta = sqrt(10 / (5 + xi)) >= 0.55` of the damping ratio xi in per cent.
    The clause ends at 4 s; the constant displacement is continued here, which is on the safe side of Annex A.

    Examples
    --------
    >>> en_1998_spectrum(2.0, "B").acceleration([0.0, 0.3, 1.0]).round(3).tolist()
    [2.4, 6.0, 3.0]
    """
    soil, first, second, third = _EN_1998_GROUNDS[spectrum_type][ground]
    plateau = 2.5 * max(0.55, math.sqrt(10.0 / (5.0 + 100.0 * damping)))
    return TargetSpectrum(
        name=f"EN 1998-1 type {spectrum_type}, ground {ground}, a_g {a_g / STANDARD_GRAVITY:.3g} g",
        source="EN 1998-1:2004, 3.2.2.2, Tables 3.2 and 3.3 with the recommended values",
        damping=damping,
        periods=np.array([0.0, first]),
        accelerations=a_g * soil * np.array([1.0, plateau]),
        falls=(second, third),
        rule=_EN_1998,
    )


# ASCE/SEI 7-16, Tables 11.6-1 and 11.6-2: below S_DS = 0.167 g and S_D1 = 0.067 g no seismic analysis is asked for.
# Codes give g, and a number of g that is taken for one of m/s2 lies there.
_LEAST_S_DS, _LEAST_S_D1 = 1.6, 0.65


@checked
def asce_7_spectrum(
    s_ds: Annotated[
        Positive,
        Says("design acceleration at short periods of ASCE 7", unit="m/s2", usual=(_LEAST_S_DS, 40.0)),
    ],
    s_d1: Annotated[
        Positive, Says("design acceleration at 1 s of ASCE 7", unit="m/s2", usual=(_LEAST_S_D1, 25.0))
    ],
    *,
    t_l: Annotated[Positive, Says("long-period transition period of ASCE 7", unit="s")],
) -> TargetSpectrum:
    """Design spectrum of ASCE/SEI 7-16, 11.4.6, at 5 % damping; with S_MS and S_M1 the MCE_R spectrum.

    `S_a = S_DS (0.4 + 0.6 T / T_0)` up to T_0, S_DS up to T_S, `S_D1 / T` up to T_L, then `S_D1 T_L / T^2`, with
    `T_S = S_D1 / S_DS` and `T_0 = 0.2 T_S`.

    Examples
    --------
    >>> asce_7_spectrum(10.0, 6.0, t_l=8.0).acceleration([0.0, 0.5, 2.0]).tolist()
    [4.0, 10.0, 3.0]
    """
    end = s_d1 / s_ds
    if not t_l > end:
        raise SettingError(
            f"t_l is {t_l:g} s, and the plateau ends at S_D1 / S_DS = {end:.3g} s; give a later one"
        )
    short, second = (f"{value / STANDARD_GRAVITY:.3g} g" for value in (s_ds, s_d1))
    return TargetSpectrum(
        name=f"ASCE 7-16, S_DS {short}, S_D1 {second}",
        source=f"ASCE/SEI 7-16, 11.4.6, T_L {t_l:g} s",
        damping=0.05,
        periods=np.array([0.0, 0.2 * end]),
        accelerations=np.array([0.4 * s_ds, s_ds]),
        falls=(end, t_l),
        rule=_ASCE_7,
    )


@checked
def table_spectrum(
    periods: Annotated[
        ArrayLike, Within(least=0.0), Says("increasing periods of a table, shape (n,)", unit="s")
    ],
    accelerations: Annotated[
        ArrayLike,
        Within(above=0.0),
        Says("pseudo-accelerations of a table, shape (n,)", unit="m/s2", usual=(_LEAST_S_DS, 80.0)),
    ],
    *,
    name: Annotated[str, Says("name of a table in tables and figures")] = "target",
    damping: TargetDamping = 0.05,
) -> TargetSpectrum:
    """Target spectrum of a table, straight between its points, as of a hazard analysis; suites as by EN 1998-1."""
    period, acceleration = (np.asarray(values, dtype=np.float64) for values in (periods, accelerations))
    if period.ndim != 1 or period.shape != acceleration.shape or period.size < 2:
        raise SettingError(
            f"a target spectrum has as many periods as accelerations, two or more, and here are {period.size} and "
            f"{acceleration.size}"
        )
    if not (np.diff(period) > 0.0).all():
        raise SettingError("a target spectrum has increasing periods; sort its points")
    return TargetSpectrum(
        name=name,
        source=f"table of {period.size} points",
        damping=damping,
        periods=period,
        accelerations=acceleration,
        falls=(),
        rule=_EN_1998,
    )


def _range_of(period: float, margin: int = 0) -> Floats:
    """Periods of a range, in equal ratios; further ones on either side, as many as the margin."""
    low, high = RANGE
    return period * low * (high / low) ** (np.arange(-margin, _STEPS + margin + 1) / _STEPS)


@checked
def scaled_to_target(
    motion: GroundMotion, target: TargetSpectrum, *, by: ScaledBy, period: Positive | None = None
) -> GroundMotion:
    """Scale a motion to a target spectrum, at the damping ratio of the target.

    Parameters
    ----------
    by
        "pga": the peak becomes the target at the period zero. "sa": Sa at `period` becomes the target's.
        "least_squares": the factor `f = sum(Sa S) / sum(Sa^2)` has the least sum of `(f Sa - S)^2` over 101 periods in
        equal ratios from 0.2 to 2 times `period`, where S is the target.
    period
        First period of the building [s]; not needed for "pga".

    Raises
    ------
    SettingError
        If there is no period, the target has no value at one of the periods, or the motion is zero throughout.

    Examples
    --------
    >>> from mrwork.motions.synthetic import synthetic_motion
    >>> target = en_1998_spectrum(2.0, "B")
    >>> round(scaled_to_target(synthetic_motion(rng=0), target, by="pga").peak, 6)
    2.4
    """
    if by != "pga" and period is None:
        raise SettingError(
            f"`by` is {by!r}, which takes a period; give `period`, the first one of the building [s]"
        )
    refuse_forces(motion, "a target")
    if motion.peak == 0.0:
        raise SettingError(
            f"ground motion {motion.name}: is zero throughout and cannot be scaled to a target"
        )
    if by == "pga" or period is None:
        periods, ordinates = np.zeros(1), np.array([motion.peak])
    else:
        periods = np.array([period]) if by == "sa" else _range_of(period)
        ordinates = response_spectrum(motion, periods, damping=target.damping).pseudo_acceleration
    factor = float(ordinates @ target.acceleration(periods) / (ordinates @ ordinates))
    over = "PGA" if by == "pga" else f"{least_to_most(periods, '{:.3g}'.format)} s"
    change = f"acceleration x {factor:.6g}, to {target.name} at {over}"
    return replace_samples(motion, factor * motion.acceleration, motion.dt, change)


_RECORDS_FEW: Final = RemarkKind(
    "suite_records_few", "a suite has {fewest} records or more by {0}, and this one {count}"
)
_BELOW: Final = RemarkKind(
    "suite_below_target",
    "the mean spectrum falls to {value:.3g} % of the target at {at:.3g} s, and is to be {least:g} % or more from "
    "{span} by {0}; a factor of {factor:g} on every motion is enough",
)
_PEAKS_LOW: Final = RemarkKind(
    "suite_peaks_low",
    "the mean of the peaks is {value:.3g} % of the target at the period zero, and is to be 100 % or more by {0}; "
    "a factor of {factor:g} on every motion is enough",
)
_FAR_FROM_TARGET: Final = RemarkKind(
    "suite_far_from_target",
    "the mean spectrum of {count} is {value:.2g} times the target, {0}, on average from {span}: motions that are "
    "scaled to the target would be {1}, and so would the responses",
    warns=True,
)
_WORST_COUNTS: Final = RemarkKind(
    "suite_worst_response",
    "with fewer than {averaged} records the most unfavourable response counts by {0}, not the mean",
)


@array_dataclass(repr=False)
class SuiteCheck(Plotted, Summarised):
    """The spectra of a suite beside its target, and whether it meets the rule of the code.

    Parameters
    ----------
    target, period
        Target spectrum, and first period of the building [s].
    names, peaks
        Of the motions, shape (n_motions,), [m/s^2].
    periods
        Periods [s], shape (n_periods,), beyond the range of the rule on either side.
    spectra
        Pseudo-accelerations at the damping ratio of the target [m/s^2], shape (n_motions, n_periods).
    copies
        Names of copies of a motion, by its name: the same record once more, which does not count.
    """

    _made_by: ClassVar[str] = "mr.motions.check_suite(motions, target, period=...)"

    target: TargetSpectrum
    period: float
    names: tuple[str, ...]
    peaks: Floats
    periods: Floats
    spectra: Floats
    copies: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    @property
    def n_records(self) -> int:
        """Number of motions without the copies."""
        return len(self.names) - sum(map(len, self.copies.values()))

    @property
    def mean(self) -> Floats:
        """Mean spectrum [m/s^2], shape (n_periods,)."""
        return np.asarray(self.spectra.mean(axis=0))

    @property
    def _ratios(self) -> tuple[Floats, Floats]:
        """Periods within 0.2 to 2 times the period [s], and ratios of the mean spectrum to the target at them."""
        ends = _range_of(self.period)
        periods = self.periods[within := (self.periods >= ends[0]) & (self.periods <= ends[-1])]
        return periods, self.mean[within] / self.target.acceleration(periods)

    @property
    def least(self) -> tuple[float, float]:
        """Least ratio of the mean spectrum to the target within 0.2 to 2 times the period, and its period [s]."""
        periods, ratios = self._ratios
        at = int(ratios.argmin())
        return float(ratios[at]), float(periods[at])

    @property
    def mean_ratio(self) -> float:
        """Ratio of the mean spectrum to the target, mean over the range in equal steps of the logarithm of periods."""
        return float(self._ratios[1].mean())

    @property
    def peak_ratio(self) -> float | None:
        """Mean of the peaks over the target at the period zero; `None` where the target has no value there."""
        has_peak = self.target.ends[0] == 0.0
        return float(self.peaks.mean() / self.target.accelerations[0]) if has_peak else None

    @property
    def factor(self) -> float:
        """The factor of all motions with which their mean just meets the rule; 1 or less if it does already."""
        held = self.peak_ratio if self.target.rule.holds_peak else None
        return max(LEAST_RATIO / self.least[0], 0.0 if held is None else 1.0 / held)

    @property
    def shortcomings(self) -> tuple[Remark, ...]:
        """On what the rule wants and the suite does not have; empty if it meets the rule."""
        return tuple(self._missed())

    def _missed(self) -> Iterator[Remark]:
        rule, (least, at), peak, count = self.target.rule, self.least, self.peak_ratio, self.n_records
        factor = math.ceil(1e3 * self.factor) / 1e3
        if count < rule.fewest:
            yield _RECORDS_FEW.remark(rule.clause, fewest=rule.fewest, count=count)
        if least < LEAST_RATIO * _ROUNDED:
            yield _BELOW.remark(
                rule.clause,
                measured=Measured(100.0 * least, "%"),
                at=at,
                least=100.0 * LEAST_RATIO,
                span=self._range_in_words,
                factor=factor,
            )
        if rule.holds_peak and peak is not None and peak < _ROUNDED:
            yield _PEAKS_LOW.remark(rule.clause, measured=Measured(100.0 * peak, "%"), factor=factor)

    @property
    def far_from_target(self) -> tuple[Remark, ...]:
        """On a suite that is much weaker or stronger than its target."""
        ratio, count = self.mean_ratio, counted(len(self.names), "motion")
        if 1.0 / _FAR <= ratio <= _FAR:
            return ()
        would, measured = "stronger" if ratio < 1.0 else "weaker", Measured(ratio, "")
        return (
            _FAR_FROM_TARGET.remark(
                self.target.name, would, measured=measured, count=count, span=self._range_in_words
            ),
        )

    @property
    def _counting(self) -> tuple[Remark, ...]:
        """On how the responses of few records count."""
        rule = self.target.rule
        few = rule.fewest <= self.n_records < rule.averaged_from
        return (_WORST_COUNTS.remark(rule.clause, averaged=rule.averaged_from),) * few

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On copies, on what the rule wants, on a suite far from its target, and on how responses count."""
        copies = tuple(copies_remarks(self.copies))
        return copies + self.shortcomings + self.far_from_target + self._counting

    @property
    def in_words(self) -> tuple[str, ...]:
        """Sentences: how the mean spectrum lies beside the target, what is wrong, and how responses count."""
        told = [each.as_sentence for each in (*self.shortcomings, *self._counting)]
        return self._mean_in_words, *told

    @property
    def _mean_in_words(self) -> str:
        (least, at), meets = self.least, "does not meet" if self.shortcomings else "meets"
        return (
            f"The mean spectrum of {counted(self.n_records, 'motion')} is {100.0 * least:.3g} % of the target or more "
            f"from {self._range_in_words}, least at {at:.3g} s, and {meets} {self.target.rule.clause}."
        )

    @property
    def _range_in_words(self) -> str:
        return f"{least_to_most((end * self.period for end in RANGE), '{:.3g}'.format)} s"

    def _summary(self) -> Summary:
        peak = self.peak_ratio
        return Summary(
            title=f"Suite of {counted(len(self.names), 'motion')} beside {self.target.name}",
            facts=(
                ("least mean spectrum over target", f"{self.least[0]:.3f} at {self.least[1]:.3g} s"),
                ("mean peak over target", "" if peak is None else f"{peak:.3f}"),
            ),
            remarks=self.remarks,
            notes=(self._mean_in_words,),
        )


# A suite that was scaled to the limit may miss it by rounding.
_ROUNDED = 1.0 - 1e-9


@checked
def check_suite(motions: Sequence[GroundMotion], target: TargetSpectrum, *, period: Positive) -> SuiteCheck:
    """Check a suite of motions against a target spectrum, by EN 1998-1:2004, 3.2.3.1.2(4), or ASCE/SEI 7-16, 16.2.

    Both want the mean spectrum to be 90 % of the target or more from 0.2 to 2 times the first period of the building.
    EN 1998-1, whose rule holds for a table, too, wants three records, peaks whose mean is not below the target at the
    period zero, and seven records where responses are averaged (4.3.3.4.3(3)); ASCE 7-16 eleven records, the spectra of
    the direction of largest response, and the spectrum of MCE_R as the target.

    Parameters
    ----------
    motions
        The suite, as it is applied to the building.
    target
        Target spectrum, which must have values over the range.
    period
        First period of the building [s].

    Examples
    --------
    >>> from mrwork.motions.synthetic import suite
    >>> target = en_1998_spectrum(2.0, "B")
    >>> motions = [scaled_to_target(each, target, by="least_squares", period=0.8) for each in suite("firm", 3, rng=0)]
    >>> check = check_suite(motions, target, period=0.8)
    >>> raised = [replace_samples(each, check.factor * each.acceleration, each.dt, "raised") for each in motions]
    >>> check_suite(raised, target, period=0.8).shortcomings
    ()
    """
    if not motions:
        raise SettingError("a suite has one motion or more, and here is none; give `motions`")
    target.acceleration(_range_of(period))
    for each in motions:
        refuse_forces(each, "a target")
    periods = _range_of(period, _MARGIN)
    periods = periods[(periods >= target.ends[0]) & (periods <= target.ends[1])]
    copies: dict[str, tuple[str, ...]] = {}
    for copy, first in copies_among(motions).items():
        copies[motions[first].name] = (*copies.get(motions[first].name, ()), motions[copy].name)
    return SuiteCheck(
        target=target,
        period=period,
        names=tuple(motion.name for motion in motions),
        peaks=np.array([motion.peak for motion in motions]),
        periods=periods,
        spectra=np.array(
            [
                response_spectrum(motion, periods, damping=target.damping).pseudo_acceleration
                for motion in motions
            ]
        ),
        copies=copies,
    )
