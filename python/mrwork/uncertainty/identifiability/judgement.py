"""The verdict on a parameter: the one rule that standard errors, profiles and posterior draws are judged by."""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from mrwork.identification.fit import VerdictName
from mrwork.summary import of_unit

# A standard deviation above this share of the value, or of 1 in the logarithm, is no determination.
WEAK = 0.25
# A parameter that changes the force by no more than this share of its standard deviation is negligible.
NEGLIGIBLE = 0.01
# Standard deviations that the 95 % interval of a normal density reaches to either side.
DEVIATIONS = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterScale:
    """Size of a relevant change of one parameter, in its `unit`: its value, or half its range where `of_range`.

    `lower` and `upper` are that range, `bounds` the admissible one, and `log` whether it is positive with a logarithmic
    scale. `sensitivity` is the root mean square of the change of force per unit, in standard deviations of the force.
    """

    name: str
    unit: str
    value: float
    size: float
    of_range: bool
    lower: float
    upper: float
    log: bool
    bounds: tuple[float, float]
    sensitivity: float

    def share(self, share: float) -> str:
        """A share of the size, such as "40 % of its value", or "33 times its value" above 100 %."""
        whole = "its value"
        if self.of_range:
            limits = f"{self.lower:.3g} to {of_unit(self.upper, self.unit, 3)}"
            whole = f"half its range for these tests ({limits})"
        return _times(share, whole)


@dataclass(frozen=True, slots=True, kw_only=True)
class ReasonedVerdict:
    """Verdict on a parameter, with the reason."""

    verdict: VerdictName
    reason: str


def judge_error(error: float, scale: ParameterScale) -> ReasonedVerdict:
    """Judge a parameter by its standard error, in its unit."""
    half = DEVIATIONS * error
    ends = scale.value - half, scale.value + half
    share = error / abs(scale.value) if scale.value else np.inf
    width = f"its standard error is {_times(share, 'its value')}" if scale.value else "its value is 0"
    return _judge(scale, ends, share, width)


def judge_interval(
    ends: tuple[float | None, float | None], deviations: float, scale: ParameterScale, *, opened: str
) -> ReasonedVerdict:
    """Judge a parameter by its interval, in its unit; an end at which the data do not bound it is `None`.

    Parameters
    ----------
    deviations
        Number of standard deviations that the interval of a normal density would reach to either side.
    opened
        Reason for an open end.
    """
    lower, upper = ends
    if lower is None or upper is None:
        return _judge(scale, ends, np.inf, opened)
    if scale.log:
        half = 0.5 * float(np.log(upper / lower))
        width = f"the interval is a factor of {np.exp(half):.2g} wide to either side"
    else:
        centre = 0.5 * abs(lower + upper)
        half = 0.5 * (upper - lower) / centre if centre else np.inf
        width = f"the interval is {_times(half, 'its value')} wide to either side"
    return _judge(scale, ends, half / deviations, width)


def _judge(
    scale: ParameterScale, ends: tuple[float | None, float | None], share: float, width: str
) -> ReasonedVerdict:
    """Judge by the standard deviation, as a `share` of the value, and by the interval about it."""
    if share <= WEAK:
        return ReasonedVerdict(verdict="identifiable", reason="")
    lower, upper = scale.bounds
    low = lower if ends[0] is None else max(ends[0], lower)
    high = upper if ends[1] is None else min(ends[1], upper)
    # Without a logarithmic scale the force is near to linear in the parameter, so that it may be left out.
    effect = scale.sensitivity * max(abs(low), abs(high))
    if not scale.log and lower <= 0.0 <= upper and effect <= NEGLIGIBLE:
        reason = (
            f"its whole interval changes the force by at most {100.0 * effect:.2g} % of the force's deviation"
        )
        return ReasonedVerdict(verdict="negligible", reason=reason)
    if ends == (None, None):
        return ReasonedVerdict(verdict="not identifiable", reason=width)
    if low < 0.0 < high:
        return ReasonedVerdict(
            verdict="sign unknown",
            reason=f"{width}; the interval, {low:.4g} to {of_unit(high, scale.unit)}, includes zero",
        )
    return ReasonedVerdict(verdict="weakly identifiable", reason=width)


def _times(share: float, whole: str) -> str:
    return f"{100.0 * share:.2g} % of {whole}" if share < 1.0 else f"{share:.3g} times {whole}"
