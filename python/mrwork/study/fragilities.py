"""Fragility: the intensity at which a limit is reached, lognormal over records, with bands, paired between rows.

A record of which the limit is first reached between two of its levels is known to lie between them; one that reaches it
at the lowest lies below, one that never does lies above. The likelihood of these intervals is concave in the slope and
the place of the normal distribution of the logarithms (Burridge, Biometrika 68, 1981), so that Newton's method finds
its maximum. With one level for each record it is that of counts at each level (Baker, Earthquake Spectra 31, 2015).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import scipy

from mrwork.base.arguments import Level, NotNegative, Positive, Seed, checked
from mrwork.base.numbers import counted, format_rounded, significant
from mrwork.base.summary import Summarised, Summary
from mrwork.base.units import STANDARD_GRAVITY, number_in
from mrwork.base.values import Floats, array_dataclass
from mrwork.closed_loop.evaluation import criterion
from mrwork.closed_loop.responses import in_command_unit
from mrwork.errors import SettingError, UnknownNameError
from mrwork.study.results import StudyResults
from mrwork.study.run_result import FINISHED

_DRAWS = 2000
_COLLAPSE = 0.1
_FEWEST = 2
# Peaks of one level agree to so many decimals [m/s^2].
_DECIMALS = 9


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """The interval of intensity [m/s^2] in which a record first reaches the limit: from 0, or to infinity.

    `unresolved` is whether it ends at a level whose run could not be resolved.
    """

    record: str
    above: float
    below: float
    unresolved: bool = False


@array_dataclass(repr=False)
class Fragility(Summarised):
    """The intensity, peak ground acceleration [m/s^2], at which an arrangement reaches the limit, over records.

    Parameters
    ----------
    median, dispersion
        Median [m/s^2], and standard deviation of the logarithm; with added modelling dispersion, if any was given.
        The median is infinite where no record reaches the limit, 0 where all do at their lowest level. The dispersion
        is 0 where one intensity separates all records, so that finer levels are needed.
    band
        Lower and upper end of the band of the median [m/s^2], by bootstrap over the records.
    medians
        Medians of the bootstrap [m/s^2], shape (n_draws,), of the same records for every arrangement.
    crossings
        What is known of each record.
    bound
        "above" or "below" where the median lies beyond all levels, so that these bound it only; else empty.
    levels, crossed, outside
        Levels [m/s^2], shape (n_levels,), the share of the runs at each that reach the limit, and of those that go
        beyond the tested ranges of a damper.
    """

    _made_by: ClassVar[str] = "mr.fragility(results, limit={'peak_drift_ratio': 0.01})[label]"

    label: str
    median: float
    dispersion: float
    band: tuple[float, float]
    medians: Floats
    crossings: tuple[Crossing, ...]
    bound: Literal["above", "below", ""]
    levels: Floats
    crossed: Floats
    outside: Floats

    @checked
    def probability(self, intensity: Positive) -> float:
        """Probability that the limit is reached at an intensity [m/s^2]."""
        if self.dispersion == 0.0 or not 0.0 < self.median < math.inf:
            return float(intensity > self.median)
        return float(scipy.special.ndtr(math.log(intensity / self.median) / self.dispersion))

    @property
    def in_words(self) -> str:
        """The median in g with its band, or how it is bounded."""
        reached = sum(each.below < math.inf for each in self.crossings)
        count = f"{reached} of {counted(len(self.crossings), 'record')} reach it"
        if self.bound:
            end = self.levels[-1] if self.bound == "above" else self.levels[0]
            return f"{self.label}: {self.bound} {_in_g(end)} g, beyond the levels ({count})"
        return f"{self.label}: {_in_g(self.median)} g, {_in_g(self.band[0])} to {_in_g(self.band[1])} g ({count})"

    @property
    def cautions(self) -> tuple[str, ...]:
        """Sentences on runs that were not resolved, on levels beyond tested ranges, and on levels too coarse."""
        unresolved = sum(each.unresolved for each in self.crossings)
        beyond = [level for level, share in zip(self.levels, self.outside, strict=True) if share > 0.0]
        said = (
            (
                unresolved,
                f"{counted(unresolved, 'record')} ended at a run that could not be resolved, and count as above",
            ),
            (
                len(beyond),
                f"from {_in_g(min(beyond, default=0.0))} g on dampers go beyond their tests: extrapolated",
            ),
            (
                not self.bound
                and max(each.above for each in self.crossings) <= min(each.below for each in self.crossings),
                "one intensity separates all records, so that the dispersion is not known: give finer levels",
            ),
        )
        return tuple(f"{self.label}: {sentence}" for holds, sentence in said if holds)

    def _summary(self) -> Summary:
        return Summary(
            title=f"Fragility: {self.in_words}",
            facts=(("dispersion", format_rounded(self.dispersion)),),
            columns=("level [g]", "reached [%]", "beyond tests [%]"),
            rows=[
                (_in_g(level), *(significant(100.0 * share, 3) for share in shares))
                for level, *shares in zip(self.levels, self.crossed, self.outside, strict=True)
            ],
            notes=self.cautions,
        )


def _in_g(intensity: float) -> str:
    return significant(intensity / STANDARD_GRAVITY, 3)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Fragilities(Summarised):
    """The fragility of each arrangement of a study by its label: `fragilities["Passive-on"].median`.

    `level` is that of the bands, `limit` the criterion with its limit.
    """

    _made_by: ClassVar[str] = "mr.fragility(results, limit={'peak_drift_ratio': 0.01})"

    criterion: str
    limit: float
    level: float
    rows: Mapping[str, Fragility]

    def __getitem__(self, label: str) -> Fragility:
        if label not in self.rows:
            raise UnknownNameError(f"there is no arrangement {label!r}; there are {', '.join(self.rows)}")
        return self.rows[label]

    @checked
    def ratio(self, label: str, against: str) -> tuple[float, tuple[float, float]]:
        """Ratio of the medians of two arrangements, and its band, by bootstrap over the records of both together.

        NaN where a median is not known.
        """
        one, other = self[label], self[against]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratios = one.medians / other.medians
            found = float(np.divide(one.median, other.median))
        return found, _band(ratios, self.level, len(one.crossings))

    def _summary(self) -> Summary:
        first = next(iter(self.rows.values()))
        return Summary(
            title=f"Fragility over {counted(len(first.crossings), 'record')}, where the "
            f"{criterion(self.criterion).title.lower()} reaches {format_rounded(self.limit)}",
            columns=(
                "",
                "median [g]",
                f"{100.0 * self.level:.0f} % band [g]",
                "dispersion",
                "records that reach it",
            ),
            rows=[
                (
                    label,
                    {"above": "> ", "below": "< ", "": ""}[each.bound]
                    + _in_g({"above": each.levels[-1], "below": each.levels[0], "": each.median}[each.bound]),
                    " to ".join(map(_in_g, each.band)),
                    significant(each.dispersion, 2),
                    f"{sum(one.below < math.inf for one in each.crossings)} of {len(each.crossings)}",
                )
                for label, each in self.rows.items()
            ],
            notes=[sentence for each in self.rows.values() for sentence in each.cautions],
        )


@checked
def fragility(
    results: StudyResults,
    limit: Mapping[str, float | str] | None = None,
    *,
    level: Level = 0.9,
    modelling_dispersion: NotNegative = 0.0,
    seed: Seed = 0,
) -> Fragilities:
    """The intensity at which each arrangement of a study reaches a limit, lognormal over the records of its motions.

    Give the records several levels, as `pga = ["0.1 g", "0.2 g", ...]` of a `[[motion]]` (incremental dynamic
    analysis), or each record one (stripes). The intensity is the peak ground acceleration. The laws and the best
    constant command are those of the study, the same at every level. A run that diverged has reached the limit; one
    that could not be resolved is taken to lie above the level before.

    Parameters
    ----------
    limit
        A criterion and its limit, as `{"peak_drift_ratio": 0.01}` or `"1 %"`; by default the drift ratio of collapse,
        0.1.
    level
        Level of the bands, by bootstrap over the records; the same records are drawn for every arrangement.
    modelling_dispersion
        Further standard deviation of the logarithm, which is added to the dispersion as a square.
    seed
        Seed of the bootstrap.

    Raises
    ------
    SettingError
        If the study was interrupted, the limit is not one criterion with a positive number, the study does not have the
        criterion, or there are fewer than two records or one level only.

    Examples
    --------
    >>> import mrwork as mr
    >>> found = mr.fragility(results, limit={"peak_drift_ratio": 0.01})  # doctest: +SKIP
    >>> found["Passive-on"].median, found.ratio("Passive-on", "uncontrolled")  # doctest: +SKIP
    """
    if not results.complete:
        raise SettingError(
            f"the study was interrupted: {results.done} of {results.total} runs are done, and a record without its "
            "runs would look safe; finish it with --resume"
        )
    name, value = _limit_of(limit, results)
    peaks = {motion: results.motions[motion].peak for motion in results.judged_motions}
    levels = np.unique([round(peak, _DECIMALS) for peak in peaks.values()])
    records: dict[str, list[int]] = {}
    for motion in peaks:
        facts = results.motions[motion]
        records.setdefault(facts.record or facts.name, []).append(motion)
    if len(records) < _FEWEST or levels.size < _FEWEST:
        raise SettingError(
            "a fragility is over two records or more at several levels, and here are "
            f"{counted(len(records), 'record')} "
            f'and {counted(levels.size, "level")}; give several, as pga = ["0.1 g", "0.2 g"] of each [[motion]]'
        )
    equal = np.full(len(records), 1.0 / len(records))
    drawn = np.random.default_rng(seed).multinomial(len(records), equal, size=_DRAWS)
    weights = np.vstack([np.ones(len(records)), drawn])
    rows = {}
    for row, arrangement in enumerate(results.rows):
        if arrangement.kind == "clairvoyant":
            # Its commands are found anew for each motion.
            continue
        reached = _reached(results, row, name, value)
        crossings = [_crossing(record, peaks, motions, reached) for record, motions in records.items()]
        medians, dispersions = lognormal_of(
            np.array([each.above for each in crossings]),
            np.array([each.below for each in crossings]),
            weights,
        )
        at_level = [
            [each for each in reached if round(peaks[each], _DECIMALS) == each_level] for each_level in levels
        ]
        rows[arrangement.label] = Fragility(
            label=arrangement.label,
            median=float(medians[0]),
            dispersion=math.hypot(float(dispersions[0]), modelling_dispersion),
            band=_band(medians[1:], level, len(records)),
            medians=medians[1:],
            crossings=tuple(crossings),
            bound="above" if medians[0] > levels[-1] else "below" if medians[0] < levels[0] else "",
            levels=levels,
            crossed=np.array([_share(reached[each] is True for each in motions) for motions in at_level]),
            outside=np.array(
                [_share(_is_outside(results, row, each) for each in motions) for motions in at_level]
            ),
        )
    return Fragilities(criterion=name, limit=value, level=level, rows=rows)


def _limit_of(limit: Mapping[str, float | str] | None, results: StudyResults) -> tuple[str, float]:
    given = {"peak_drift_ratio": _COLLAPSE} if limit is None else dict(limit)
    if len(given) != 1:
        raise SettingError(
            f"`limit` names {', '.join(given) or 'no criterion'}; give one criterion with its limit, as "
            "{'peak_drift_ratio': 0.01}"
        )
    ((name, value),) = given.items()
    unit = in_command_unit(criterion(name).unit, results.command_unit)
    if isinstance(value, str):
        number = number_in(value, unit)
        if isinstance(number, str):
            raise SettingError(f"the limit of {name} {number}")
        value = number
    if not 0.0 < value < math.inf:
        raise SettingError(f"the limit of {name} is {value:g}; give a positive number [{unit}]")
    scale = criterion(name).scale
    if results.building is not None and (lacking := results.building.scales.lacking(scale)):
        raise SettingError(f"{name} stands on {lacking}; give {lacking} in [building]")
    return name, float(value)


def _reached(results: StudyResults, row: int, name: str, limit: float) -> dict[int, bool | None]:
    """Whether each run reached the limit, by its motion; `None` of one that could not be resolved."""
    reached: dict[int, bool | None] = {}
    for motion in results.judged_motions:
        run = results.runs.get((row, motion))
        if run is None:
            continue
        if run.outcome in FINISHED:
            value = (results.criteria(row, motion) or {}).get(name, math.nan)
            reached[motion] = None if math.isnan(value) else value >= limit
        else:
            reached[motion] = True if run.outcome == "diverged" else None
    return reached


def _crossing(
    record: str, peaks: Mapping[int, float], motions: Sequence[int], reached: Mapping[int, bool | None]
) -> Crossing:
    """The interval of a record, of whose motions some were simulated."""
    above = 0.0
    for motion in sorted((each for each in motions if each in reached), key=lambda each: peaks[each]):
        if reached[motion] is None:
            return Crossing(record=record, above=above, below=math.inf, unresolved=True)
        if reached[motion]:
            return Crossing(record=record, above=above, below=peaks[motion])
        above = peaks[motion]
    return Crossing(record=record, above=above, below=math.inf)


def _is_outside(results: StudyResults, row: int, motion: int) -> bool:
    return any(each.outside.exceedances for each in results.demands(row, motion))


def _share(values: Iterable[bool]) -> float:
    flags = list(values)
    return sum(flags) / len(flags) if flags else math.nan


def _band(numbers: Floats, level: float, n_records: int) -> tuple[float, float]:
    """Ends of a bootstrap band; of few records its quantiles lie further out, as those of Student's t.

    The expanded percentile interval of Hesterberg, The American Statistician 69, 2015, 371-386.
    """
    reach = scipy.stats.t.ppf(0.5 + level / 2.0, n_records - 1) * math.sqrt(n_records / (n_records - 1.0))
    tail = float(scipy.stats.norm.sf(reach))
    known = numbers[~np.isnan(numbers)]
    if not known.size:
        return math.nan, math.nan
    low, high = np.quantile(known, (tail, 1.0 - tail), method="inverted_cdf")
    return float(low), float(high)


# Steps of Newton's method, largest step in standard deviations, and the least probability of an interval.
_STEPS, _LONGEST, _TINY = 60, 1.5, 1e-290


def lognormal_of(above: Floats, below: Floats, weights: Floats) -> tuple[Floats, Floats]:
    """Median and dispersion of the lognormal distribution of largest likelihood, for each row of weights.

    Parameters
    ----------
    above, below
        Ends of the interval of each record, shape (n_records,): 0 and infinity where one is open.
    weights
        How often each record counts, shape (n_draws, n_records).

    Returns
    -------
    medians, dispersions
        Shape (n_draws,). Where one intensity separates all records the dispersion is 0, and the median is that
        intensity; it is infinite if no record has an upper end, 0 if none has a lower one.
    """
    counts = weights > 0.0
    lowest = np.where(counts, below, np.inf).min(axis=1)
    highest = np.where(counts, above, 0.0).max(axis=1)
    with np.errstate(invalid="ignore"):
        medians = np.where(np.isinf(lowest), np.inf, np.sqrt(highest * lowest))
    dispersions = np.zeros(len(weights))
    open_ = highest > lowest
    if open_.any():
        medians[open_], dispersions[open_] = _newton(above, below, weights[open_])
    return medians, dispersions


def _newton(above: Floats, below: Floats, weights: Floats) -> tuple[Floats, Floats]:
    with np.errstate(divide="ignore"):
        low, high = np.log(above), np.log(below)
    ends = np.concatenate([low[np.isfinite(low)], high[np.isfinite(high)]])
    centre, scale = float(ends.mean()), float(ends.std()) or 1.0
    low, high = (low - centre) / scale, (high - centre) / scale
    # z = slope * x - place.
    slope, place = np.ones(len(weights)), np.zeros(len(weights))
    total, gradient, curvature = _likelihood(low, high, weights, slope, place)
    for _ in range(_STEPS):
        step = np.linalg.solve(curvature + 1e-12 * np.eye(2), gradient[..., None])[..., 0]
        length = np.abs(step).max(axis=1)
        if length.max() < 1e-10:
            break
        step *= np.minimum(1.0, _LONGEST / np.maximum(length, 1e-300))[:, None]
        factor = np.ones(len(weights))
        for _ in range(40):
            new_slope, new_place = slope + factor * step[:, 0], place + factor * step[:, 1]
            usable = new_slope > 0.0
            new = _likelihood(low, high, weights, np.where(usable, new_slope, slope), new_place)
            worse = ~usable | (new[0] < total - 1e-12 * np.abs(total))
            if not worse.any():
                break
            factor = np.where(worse, 0.5 * factor, factor)
        keep = ~worse
        slope, place = np.where(keep, new_slope, slope), np.where(keep, new_place, place)
        total, gradient, curvature = _likelihood(low, high, weights, slope, place)
    return np.exp(centre + scale * place / slope), scale / slope


def _likelihood(
    low: Floats, high: Floats, weights: Floats, slope: Floats, place: Floats
) -> tuple[Floats, Floats, Floats]:
    """Logarithm of the likelihood of each row of weights, its gradient in slope and place, and minus its curvature."""
    (xa, za, da), (xb, zb, db) = (_at_end(x, slope, place) for x in (low, high))
    # In the upper tail the difference of the complements is exact.
    ndtr = scipy.special.ndtr
    p = np.maximum(np.where(za > 0.0, ndtr(-za) - ndtr(-zb), ndtr(zb) - ndtr(za)), _TINY)
    with np.errstate(invalid="ignore"):
        ua, ub = (np.where(density > 0.0, z * density, 0.0) for z, density in ((za, da), (zb, db)))
    by_slope, by_place = (xb * db - xa * da) / p, (da - db) / p
    second = ((xa * xa * ua - xb * xb * ub) / p, (xb * ub - xa * ua) / p, (ua - ub) / p)
    first = (by_slope * by_slope, by_slope * by_place, by_place * by_place)
    a, b, c = ((weights * (one - two)).sum(axis=1) for one, two in zip(first, second, strict=True))
    gradient = np.stack([(weights * by_slope).sum(axis=1), (weights * by_place).sum(axis=1)], axis=1)
    return (weights * np.log(p)).sum(axis=1), gradient, np.array([[a, b], [b, c]]).transpose(2, 0, 1)


def _at_end(x: Floats, slope: Floats, place: Floats) -> tuple[Floats, Floats, Floats]:
    """An end of each interval, its normal coordinate for each draw, and the density there; an open end has x = 0."""
    z = slope[:, None] * x - place[:, None]
    return np.where(np.isfinite(x), x, 0.0), z, np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi)
