"""Evaluation criteria by name, with their labels in papers.

Each is one number of a run. Papers report its ratio: the benchmarks to the value without dampers (Dyke, Jansen,
Ohtori), the thesis to the value at i = 0. `||.||` is the root mean square over the record.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mrwork.base.arguments import AnyNumbers, NotNegative, Positive, Whole
from mrwork.base.units import STANDARD_GRAVITY as STANDARD_GRAVITY
from mrwork.base.values import Floats
from mrwork.closed_loop.responses import axis_of, unit_of
from mrwork.errors import ArgumentError, SettingError, UnknownNameError
from mrwork.store.codec import OrNan


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """One number of a run, computed from one of its quantities; smaller is better.

    The value is the maximum of `quantity`, by default the one of its name, over floors, storeys or devices, or the sum
    if `summed`, divided by the weight of the building if `over_weight`; each is divided by the height of its storey if
    `over_height`, NaN where heights are not known. If `ratio`, papers report its ratio to the
    value without dampers, under these `labels`. A number that is `of_command` is zero at i = 0, one that is `counted`
    jumps by whole counts, one that is `optional` is unknown in earlier files or without heights.
    `over` names the criterion of the building without dampers in the
    denominator, if it is another one. `short` is the title in a narrow column.
    """

    name: str
    title: str
    short: str
    quantity: str = ""
    summed: bool = False
    over_weight: bool = False
    over_height: bool = False
    labels: tuple[str, ...] = ()
    over: str = ""
    ratio: bool = True
    of_command: bool = False
    counted: bool = False
    optional: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "quantity", self.quantity or self.name)

    @property
    def reference_criterion(self) -> str:
        """Criterion of the building without dampers in the denominator of the ratio; empty if there is none."""
        return self.over or (self.name if self.ratio else "")

    @property
    def unit(self) -> str:
        """Unit of the number, as in tables."""
        return "1" if self.over_weight or self.over_height else unit_of(self.quantity).replace("^", "")

    def value(
        self, responses: object, weight: Positive, heights: Sequence[NotNegative] | Floats = ()
    ) -> Floats:
        """The value for each run of `responses`, which has the quantities of runs as attributes.

        `weight` is that of the building [N], `heights` those of its storeys [m].
        """
        if isinstance(responses, type) or not hasattr(responses, self.quantity):
            raise ArgumentError(
                f"`responses` is a {type(responses).__name__} without {self.quantity}; give the Responses of "
                "mr.simulate_loop, or a run of mr.run_study"
            )
        values = np.asarray(getattr(responses, self.quantity))
        if self.over_height:
            values = drift_ratios(values, heights)
        if axis_of(self.quantity) == "run":
            per_run = values
        elif self.summed:
            per_run = np.sum(values, axis=-1)
        else:
            # A building without devices has an axis of length zero: its largest force is zero.
            per_run = np.max(values, axis=-1, initial=0.0)
        return np.asarray(per_run / weight if self.over_weight else per_run)


def criteria() -> tuple[Criterion, ...]:
    """Every criterion, in the order of tables.

    Examples
    --------
    >>> from mrwork.closed_loop.evaluation import criterion
    >>> criterion("peak_drift").labels
    ('J1 of Ohtori et al. 2004', 'J2 of Jansen & Dyke 2000')
    """
    return _CRITERIA


def criterion(name: str) -> Criterion:
    """Return the criterion called `name`."""
    for entry in _CRITERIA:
        if entry.name == name:
            return entry
    known = ", ".join(entry.name for entry in _CRITERIA)
    raise UnknownNameError(f"no criterion is called {name!r}; choose from {known}")


def values(
    responses: object, *, weight: Positive, heights: Sequence[NotNegative] | Floats = ()
) -> dict[str, Floats]:
    """Every criterion of `responses`, which has the quantities of runs as attributes.

    `weight` is that of the building [N], `heights` those of its storeys [m], as `Building.heights`.
    """
    return {entry.name: entry.value(responses, weight, heights) for entry in _CRITERIA}


def drift_ratios(drifts: AnyNumbers, heights: Sequence[NotNegative] | Floats) -> Floats:
    """Drifts [m], shape (..., n_storeys), over the heights of their storeys [m]; 0 of a row that is no storey.

    NaN where heights are not known, which are none.
    """
    tall = np.asarray(heights, dtype=np.float64)
    if not tall.size:
        return np.full(np.shape(drifts), np.nan)
    if tall.shape != np.shape(drifts)[-1:]:
        raise SettingError(
            f"there are {tall.size} heights for {np.shape(drifts)[-1]} storeys; give one for each"
        )
    return np.divide(drifts, tall, out=np.zeros(np.shape(drifts)), where=tall > 0.0)


def ratio(numerator: AnyNumbers, denominator: AnyNumbers) -> Floats:
    """The quotient, NaN for a zero denominator, infinite beyond the range of numbers."""
    try:
        above, below = np.broadcast_arrays(numerator, denominator)
    except ValueError:
        raise SettingError(
            f"`numerator` has shape {numerator.shape} and `denominator` {denominator.shape}; give shapes that broadcast"
        ) from None
    with np.errstate(over="ignore"):
        quotient: Floats = np.divide(above, below, out=np.full(above.shape, np.nan), where=below != 0.0)
    return quotient


SCORE = ("peak_drift", "peak_acceleration", "rms_drift", "rms_acceleration")
"""Criteria whose ratios are averaged in the score."""


def score(
    controlled: Sequence[Mapping[str, AnyNumbers]], passive: Sequence[Mapping[str, AnyNumbers]]
) -> Floats:
    """Mean over motions and `SCORE` of the ratio of each criterion to its value at i = 0, as defined in this project.

    Parameters
    ----------
    controlled, passive
        Criteria of one law and of i = 0, for each motion.
    """
    if not controlled or len(controlled) != len(passive):
        raise SettingError(
            f"criteria of {len(controlled)} motions with the law and of {len(passive)} at i = 0 were given; give both "
            "for each of one or more motions"
        )
    missing = next((name for name in SCORE for each in (*controlled, *passive) if name not in each), None)
    if missing is not None:
        raise SettingError(f"a motion has no {missing}; give the criteria {', '.join(SCORE)} for each motion")
    ratios = [
        ratio(with_law[name], without[name])
        for with_law, without in zip(controlled, passive, strict=True)
        for name in SCORE
    ]
    if len({each.shape for each in ratios}) > 1:
        raise SettingError("the criteria have different numbers of runs; give the same runs of each")
    mean: Floats = np.mean(np.stack(ratios), axis=0)
    return mean


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Distribution of a number over ground motions: how many, mean, least, quartiles, median and most.

    Quartiles are interpolated linearly between the ordered values, as `numpy.quantile` does.
    """

    motions: Whole
    mean: OrNan
    least: OrNan
    lower_quartile: OrNan
    median: OrNan
    upper_quartile: OrNan
    most: OrNan

    @staticmethod
    def of(values: Sequence[float]) -> Spread:
        """The spread of one value for each motion; all NaN where there is none, or one is not a number."""
        numbers = np.asarray(values, dtype=np.float64)
        if not numbers.size or np.isnan(numbers).any():
            quantiles, mean = np.full(5, np.nan), float("nan")
        else:
            quantiles, mean = np.quantile(numbers, (0.0, 0.25, 0.5, 0.75, 1.0)), float(np.mean(numbers))
        least, lower, median, upper, most = quantiles.tolist()
        return Spread(
            motions=numbers.size,
            mean=mean,
            least=least,
            lower_quartile=lower,
            median=median,
            upper_quartile=upper,
            most=most,
        )


def is_within_spread(differences: Sequence[float]) -> bool:
    """Whether a mean difference over motions is at most two standard errors, so that the motions do not tell it from 0.

    Of one motion nothing is told; equal numbers are within their spread.
    """
    numbers = np.asarray(differences, dtype=np.float64)
    if numbers.size < 2 or not np.isfinite(numbers).all():
        return False
    error = float(np.std(numbers, ddof=1)) / float(np.sqrt(numbers.size))
    return bool(abs(float(np.mean(numbers))) <= 2.0 * error)


def ties_in_words(
    leading: str, scores: Sequence[float], others: Mapping[str, Sequence[float]]
) -> tuple[str, ...]:
    """A sentence on the rows whose scores under single motions the leading one does not beat beyond their spread."""
    tied = {
        label: np.subtract(each, scores)
        for label, each in others.items()
        if is_within_spread([one - lead for one, lead in zip(each, scores, strict=True)])
    }
    if not tied:
        return ()
    listed = ", ".join(f"{label} ({float(np.mean(each)):+.3f})" for label, each in tied.items())
    return (
        f"On these {len(scores)} motions the score of {leading} is not told apart from that of {listed}: the mean "
        f"difference{' is' if len(tied) == 1 else 's are'} within two standard errors over the motions.",
    )


_OHTORI = "Ohtori et al. 2004"
_JANSEN = "Jansen & Dyke 2000"

_CRITERIA = (
    Criterion(
        name="peak_displacement", title="Peak displacement", short="Displ.", labels=(f"J1 of {_JANSEN}",)
    ),
    Criterion(
        name="peak_drift", title="Peak drift", short="Drift", labels=(f"J1 of {_OHTORI}", f"J2 of {_JANSEN}")
    ),
    Criterion(
        name="peak_drift_ratio",
        title="Peak drift ratio",
        short="Drift ratio",
        quantity="peak_drift",
        over_height=True,
        ratio=False,
        optional=True,
    ),
    Criterion(
        name="peak_acceleration",
        title="Peak acceleration",
        short="Acc.",
        labels=(f"J2 of {_OHTORI}", f"J3 of {_JANSEN}"),
    ),
    Criterion(name="peak_base_shear", title="Peak base shear", short="Shear", labels=(f"J3 of {_OHTORI}",)),
    Criterion(
        name="base_shear_coefficient",
        title="Peak base shear over weight",
        short="Shear over weight",
        quantity="peak_base_shear",
        over_weight=True,
        ratio=False,
        optional=True,
    ),
    Criterion(name="rms_displacement", title="RMS displacement", short="RMS displ."),
    Criterion(name="rms_drift", title="RMS drift", short="RMS drift", labels=(f"J4 of {_OHTORI}",)),
    Criterion(
        name="rms_acceleration", title="RMS acceleration", short="RMS acc.", labels=(f"J5 of {_OHTORI}",)
    ),
    Criterion(name="rms_base_shear", title="RMS base shear", short="RMS shear", labels=(f"J6 of {_OHTORI}",)),
    Criterion(name="peak_force", title="Peak device force", short="Force", ratio=False),
    Criterion(
        name="peak_force_share",
        title="Peak device force over weight",
        short="Force share",
        quantity="peak_force",
        over_weight=True,
        labels=(f"J11 of {_OHTORI}", f"J4 of {_JANSEN}"),
        ratio=False,
    ),
    Criterion(
        name="peak_stroke",
        title="Peak stroke",
        short="Stroke",
        labels=(f"J12 of {_OHTORI}",),
        over="peak_drift",
        ratio=False,
    ),
    Criterion(name="mean_current", title="Mean command", short="Mean command", ratio=False, of_command=True),
    Criterion(name="rms_current", title="RMS command", short="RMS command", ratio=False, of_command=True),
    Criterion(
        name="command_travel",
        title="Command travel per second",
        short="Travel",
        ratio=False,
        of_command=True,
    ),
    Criterion(
        name="switching_rate",
        title="Switchings of the command per second",
        short="Switchings",
        ratio=False,
        of_command=True,
        counted=True,
    ),
    Criterion(
        name="device_energy", title="Energy taken up by devices", short="Energy", summed=True, ratio=False
    ),
)
