"""The verdict on a parameter: the one rule that standard errors, profiles and posterior draws are judged by.

It measures them by the size of a relevant change of the parameter.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.fit import VerdictName
from mrwork.identification.search_ranges import search_box
from mrwork.records import DamperTest
from mrwork.summary import of_unit
from mrwork.values import holds_arrays

# A standard deviation above this share of the value, or of 1 in the logarithm, is no determination.
WEAK = 0.25
# A parameter that changes the force by no more than this share of its standard deviation is negligible.
NEGLIGIBLE = 0.01
# A value smaller than this share of the nominal one counts as zero.
_AS_ZERO = 0.01
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


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Size of a relevant change of each parameter, shape (n_params,): its value, or half its range where `of_range`.

    The size of a parameter with a logarithmic scale is its value. Other parameters may be zero; their size is half the
    range derived from the scales of the records, where this is larger. `ranges` are the ranges so derived, within
    the admissible ones of `box`; `theta` are the values, shape (n_params,).
    """

    box: Box
    ranges: Box
    theta: NDArray[np.float64]
    size: NDArray[np.float64]
    of_range: NDArray[np.bool_]

    @classmethod
    def of(
        cls, spec: DamperSpec, box: Box, tests: tuple[DamperTest, ...], theta: NDArray[np.float64]
    ) -> Scale:
        """Scales at `theta`, shape (n_params,)."""
        ranges = _scaled_ranges(spec, box, tests, theta)
        half = 0.5 * (np.array(ranges.upper) - np.array(ranges.lower))
        size = np.abs(theta)
        of_range = ~np.array(box.log) & (half > size)
        return cls(
            box=box, ranges=ranges, theta=theta, size=np.where(of_range, half, size), of_range=of_range
        )

    def of_parameter(self, spec: DamperSpec, index: int, derivative: NDArray[np.float64]) -> ParameterScale:
        """Scale of one parameter of the model, with the derivative of the residuals by it, shape (n_residuals,)."""
        return ParameterScale(
            name=spec.names[index],
            unit=spec.parameters[index].unit,
            value=float(self.theta[index]),
            size=float(self.size[index]),
            of_range=bool(self.of_range[index]),
            lower=self.ranges.lower[index],
            upper=self.ranges.upper[index],
            log=self.box.log[index],
            bounds=(self.box.lower[index], self.box.upper[index]),
            sensitivity=float(np.linalg.norm(derivative)),
        )


def _scaled_ranges(
    spec: DamperSpec, box: Box, tests: tuple[DamperTest, ...], theta: NDArray[np.float64]
) -> Box:
    """The box narrowed to the scales of the records; where these give no range, to the size of the value.

    Where the value is negligible beside the nominal one, such as a share at its bound of zero, to the nominal size.
    """
    searched = search_box(spec, box, tests)
    own = {}
    for index, name in enumerate(box.names):
        as_wide = searched.lower[index] == box.lower[index] and searched.upper[index] == box.upper[index]
        size, typical = abs(float(theta[index])), abs(spec.parameters[index].nominal)
        size = size if size > _AS_ZERO * typical else typical
        if as_wide and not box.log[index] and size > 0.0:
            own[name] = (max(box.lower[index], -size), min(box.upper[index], size))
    return searched.with_bounds({name: pair for name, pair in own.items() if pair[0] < pair[1]})


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
