"""Fragility: the intensity at which a limit is reached, lognormal over records, with bands, paired between rows.

The intensity at which a record first reaches the limit is interpolated between two of its levels, or known to lie
between them where a run diverged; a record that reaches the limit at its lowest level lies below, one that never does
lies above. The likelihood is concave in the slope and the place of the normal distribution of the logarithms (Burridge,
Biometrika 68, 1981), so that Newton's method finds its maximum, if there is one. Truncated incremental dynamic analyses
have this likelihood, and so have counts at each level, with one level for each record (Baker, Earthquake Spectra 31,
2015).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Annotated, Any, ClassVar, Final, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike

from mrwork.base.arguments import Level, Positive, Seed, checked
from mrwork.base.hints import May
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes
from mrwork.base.numbers import counted, format_rounded, shortest, significant
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, named
from mrwork.base.table import Column, Table
from mrwork.base.units import STANDARD_GRAVITY, number_in
from mrwork.base.values import Floats, array_dataclass
from mrwork.closed_loop.evaluation import Scales
from mrwork.closed_loop.evaluation import criterion as criterion_named
from mrwork.closed_loop.responses import in_command_unit
from mrwork.errors import SettingError, UnknownNameError
from mrwork.study.comparison import small_first
from mrwork.study.judged_motions import RecordLevels
from mrwork.study.results import StudyResults
from mrwork.study.row_kinds import ROW_KINDS, Kind
from mrwork.study.run_options import BandLevel, FragilityLimit, ModellingDispersion
from mrwork.study.runs import numbered
from mrwork.study.storeys import COLLAPSED

_DRAWS = 2000
COLLAPSE: Mapping[str, float] = {"peak_drift_ratio": COLLAPSED}
"""Limit of a study that names none."""

_FEWEST_LEVELS = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Crossing:
    """The interval of intensity [m/s^2] in which a record first reaches the limit: from 0, or to infinity.

    `unresolved` is whether it ends at a level whose run could not be resolved. `interpolated` is the intensity between
    two levels at which a straight line through both responses has the limit, NaN where there are no two.
    """

    record: str
    above: float
    below: float
    unresolved: bool = False
    interpolated: float = math.nan

    @property
    def ends(self) -> tuple[float, float]:
        """The interval, or the interpolated intensity twice."""
        between = self.interpolated
        return (self.above, self.below) if math.isnan(between) else (between, between)


_UNRESOLVED: Final = RemarkKind(
    "records_unresolved",
    "{records} ended at a run that could not be resolved, and count as above",
    "give a shorter step of [hardware]",
)
_EXTRAPOLATED: Final = RemarkKind(
    "levels_extrapolated",
    "from {level} g on dampers go beyond their tests or their rating, so that their force is extrapolated",
    warns=True,
)
_LEVELS_COARSE: Final = RemarkKind(
    "levels_coarse",
    "one intensity separates all records, so that the dispersion is not known",
    "give finer levels",
)
_MEDIAN_UNKNOWN: Final = RemarkKind(
    "median_unknown",
    "median and dispersion are not determined, as where each record reaches the limit at its lowest level or never",
    "give further levels",
)
_BAND_OPEN: Final = RemarkKind(
    "median_band_open",
    "{percent} % of the draws of the bootstrap do not determine the median, so that the band has an open end",
    "give further levels",
)
_FEW_RECORDS: Final = RemarkKind(
    "records_few",
    "{count} records are few: a band between them holds the median in {holds} % of cases at most, not in {level:.0f} %",
    "give {needed} or more",
)


@array_dataclass(repr=False)
class Fragility(Summarised):
    """The intensity [m/s^2] at which an arrangement reaches the limit, over records.

    `measure` is what the intensity is, in words, as "PGA"; `crossings` say what is known of each record.
    `median` [m/s^2] and `dispersion`, the standard deviation of the logarithm with any modelling dispersion, are NaN
    where no maximum of the likelihood was found. The median is infinite where no record reaches the limit, 0 where all
    do at their lowest level; the dispersion is 0 where one intensity separates all records.

    `medians` are of the bootstrap, of the same records for every arrangement, shape (n_draws,), and lie between the
    `ends`, shape (2, n_draws): an infinite one, one of 0, and all where the dispersion is 0 in the interval that the
    records leave, a NaN anywhere. `band` has the lower and upper end of the median.
    At each of the `levels`, shape (n_levels,), `crossed` is the share of the resolved runs that reach the limit, and
    `outside` of all runs that go beyond the tested ranges of a damper; NaN where there is none. `responses` are the
    criterion of each record at each level, shape (n_records, n_levels): infinite where the run diverged, NaN where it
    could not be resolved, and where no run was made.
    """

    _made_by: ClassVar[str] = "mr.fragility(results, limit={'peak_drift_ratio': 0.01})[label]"

    label: str
    kind: Kind
    measure: str
    median: float
    dispersion: float
    band: tuple[float, float]
    medians: Floats
    ends: Floats
    crossings: tuple[Crossing, ...]
    levels: Floats
    crossed: Floats
    outside: Floats
    responses: Floats

    @checked
    def probability(self, intensity: Positive) -> float:
        """Probability that the limit is reached at an intensity [m/s^2]; NaN where the median is not determined."""
        if math.isnan(self.median):
            return math.nan
        if self.dispersion == 0.0 or not 0.0 < self.median < math.inf:
            return float(intensity > self.median)
        return float(scipy.special.ndtr(math.log(intensity / self.median) / self.dispersion))

    @property
    def reaching(self) -> str:
        """How many records reach the limit at any level, such as "7 of 20"."""
        run = [each for each in self.crossings if each.unresolved or each.ends != (0.0, math.inf)]
        return f"{sum(crossing.below < math.inf for crossing in run)} of {len(run)}"

    @property
    def bound(self) -> Literal["above", "below", "not determined", ""]:
        """How the levels bound a median beyond all of them; "not determined" for NaN; else empty."""
        if math.isnan(self.median):
            return "not determined"
        return "above" if self.median > self.levels[-1] else "below" if self.median < self.levels[0] else ""

    @property
    def median_in_words(self) -> str:
        """The median in g, or how it is bounded, as "above 0.6 g"."""
        if self.bound == "not determined":
            return self.bound
        end = {"above": self.levels[-1], "below": self.levels[0], "": self.median}[self.bound]
        return f"{self.bound} {_in_g(end)} g".lstrip()

    @property
    def brief(self) -> str:
        """The median with its band in parentheses, or how it is bounded."""
        band = "" if self.bound in ("above", "below") else f" ({' to '.join(map(_in_g, self.band))})"
        return f"{self.median_in_words}{band}"

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On runs that were not resolved, on levels beyond tested ranges, and on what levels do not tell."""
        return tuple(self._remarks())

    def _remarks(self) -> Iterator[Remark]:
        unresolved = sum(crossing.unresolved for crossing in self.crossings)
        beyond, unknown = self.levels[self.outside > 0.0], 100.0 * float(np.isnan(self.medians).mean())
        above, below = np.array([crossing.ends for crossing in self.crossings]).T
        if unresolved:
            yield _UNRESOLVED.remark(records=counted(unresolved, "record"))
        if beyond.size:
            least = float(beyond.min())
            yield _EXTRAPOLATED.remark(measured=Measured(least, "m/s^2"), level=_in_g(least))
        if not self.bound and above.max() <= below.min():
            yield _LEVELS_COARSE.remark()
        if self.bound == "not determined":
            yield _MEDIAN_UNKNOWN.remark()
        elif unknown > 0.0 and not (self.band[0] > 0.0 and math.isfinite(self.band[1])):
            yield _BAND_OPEN.remark(percent=significant(unknown, 2))

    def _summary(self) -> Summary:
        return Summary(
            title=f"Fragility, {self.measure}: {self.label}: {self.brief}; {self.reaching} records reach it",
            facts=(("dispersion", format_rounded(self.dispersion)),),
            remarks=self.remarks,
        )


def _in_g(intensity: float) -> str:
    return significant(intensity / STANDARD_GRAVITY, 3)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Fragilities(Plotted, WithAxes, Summarised):
    """The fragility of each arrangement of a study by its label: `fragilities["Passive-on"].median`.

    Its arrays are the probability by the lognormal distribution, the share that `reached` the limit and that `outside`
    of tested ranges over row and intensity, and the response of each record.
    Bands are of this `level`, `criterion` has the `limit`, in this unit. `study_remarks` are taken from the results.
    """

    _made_by: ClassVar[str] = "mr.fragility(results, limit={'peak_drift_ratio': 0.01})"

    criterion: str
    limit: float
    unit: str
    level: float
    rows: Mapping[str, Fragility] = field(default_factory=dict)
    study_remarks: tuple[Remark, ...] = ()

    def _named_arrays(self) -> NamedArrays:
        first, *_ = every = [*self.rows.values()]
        fitted = [[*map(row.probability, row.levels.tolist())] for row in every]
        shares: dict[str, tuple[list[Any], str]] = {
            "probability": (fitted, f"probability that {self.limit_in_words}"),
            "reached": ([row.crossed for row in every], "share of the runs that reach the limit"),
            "outside": ([row.outside for row in every], "share of the runs beyond tested ranges"),
        }
        axes = {
            "row": NamedArray.of([*self.rows]),
            "record": NamedArray.of([crossing.record for crossing in first.crossings]),
            "intensity": NamedArray.of(first.levels, unit="m/s^2", long_name=first.measure),
        }
        responses = [row.responses for row in every]
        return NamedArrays(
            title=f"Fragility, {self.title}",
            rows=("row", "intensity"),
            labels=axes,
            arrays={
                name: NamedArray.of(values, "row", "intensity", unit="1", long_name=words)
                for name, (values, words) in shares.items()
            }
            | {"response": NamedArray.of(responses, *axes, unit=self.unit, long_name=self.title)},
        )

    def __getitem__(self, label: str) -> Fragility:
        if label not in self.rows:
            raise UnknownNameError(f"there is no arrangement {label!r}; there are {', '.join(self.rows)}")
        return self.rows[label]

    @checked
    def ratio(self, label: str, against: str) -> tuple[float, tuple[float, float]]:
        """Ratio of the medians of two arrangements, and its band, by bootstrap over the records of both together.

        NaN where a median lies beyond the levels or is not determined; the band then says what is known.
        """
        one, other = self[label], self[against]
        with np.errstate(divide="ignore"):
            band = _band(one.ends / other.ends[::-1], self.level, len(one.crossings))
        return math.nan if one.bound or other.bound else one.median / other.median, band

    @property
    def reference(self) -> str:
        """Label of what others are compared with: the best constant command, else the building without dampers."""
        kinds = {row.kind: label for label, row in [*self.rows.items()][::-1]}
        return kinds.get("best_passive") or kinds.get("uncontrolled") or next(iter(self.rows))

    @property
    def limit_in_words(self) -> str:
        """Text such as "the peak drift ratio reaches 1 %"."""
        return f"the {self.title} reaches {self.limit_value}"

    @property
    def title(self) -> str:
        """Title of the criterion as it stands within a sentence, such as "peak drift ratio"."""
        return small_first(criterion_named(self.criterion).title)

    @property
    def limit_value(self) -> str:
        """Text of the limit with its unit, such as "1 %"."""
        return criterion_named(self.criterion).in_words(self.limit, self.unit)

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On the limit, on what the band of few records can be, on rows, each once behind its labels, on the study."""
        by_remark: dict[Remark, list[str]] = {}
        for label, row in self.rows.items():
            for remark in row.remarks:
                by_remark.setdefault(remark, []).append(label)
        of_rows = (
            replace(remark, message=f"{'; '.join(labels)}: {remark.message}", words=tuple(labels))
            for remark, labels in by_remark.items()
        )
        unusual = criterion_named(self.criterion).unusual_limit(self.limit)
        count = len(next(iter(self.rows.values())).crossings)
        holds, needed = 1.0 - 0.5 ** (count - 1), math.ceil(1.0 - math.log2(1.0 - self.level))
        held, level = shortest(100.0 * holds, 3), 100.0 * self.level
        few = _FEW_RECORDS.remark(count=count, holds=held, level=level, needed=needed)
        return (*unusual, *([few] if holds < self.level else []), *of_rows, *self.study_remarks)

    @checked
    def in_words(self, against: str | None = None) -> tuple[str, ...]:
        """A sentence on the median of each other arrangement against one, by default the `reference`."""
        base = self[self.reference if against is None else against]
        rows = [row for row in self.rows.values() if row is not base and ROW_KINDS[row.kind].is_alternative]
        return tuple(self._against(entry, base) for entry in rows)

    def _against(self, one: Fragility, base: Fragility) -> str:
        _, (low, high) = self.ratio(one.label, base.label)
        both = f"is {one.median_in_words}, against {base.median_in_words} with {base.label}"
        what = f"{one.label}: the median {one.measure} at which {self.limit_in_words} {both}"
        if (low, high) == (0.0, math.inf):
            return f"{what}; their ratio is not known: give further levels."
        band = f"{100.0 * self.level:.0f} % band of the ratio {significant(low, 3)} to {significant(high, 3)}"
        tied = ", which holds 1: they are not told apart" if low <= 1.0 <= high else ""
        return f"{what}; {band}{tied}."

    @checked
    def document(self, against: str | None = None) -> dict[str, Any]:
        """What `mrwork fragility --json` prints, compared with the arrangement of a label."""
        facts = ("label", "kind", "measure", "median", "dispersion", "band", "bound", "remarks")
        shares = ("levels", "crossed", "outside")
        return {
            **named(self, "criterion", "limit", "unit", "level", "remarks"),
            "arrangements": [
                named(row, *facts, *shares) | {"crossings": [*map(asdict, row.crossings)]}
                for row in self.rows.values()
            ],
            "sentences": self.in_words(against),
        }

    def _summary(self, against: str | None = None) -> Summary:
        first = next(iter(self.rows.values()))
        columns = (
            Column("label", "arrangement"),
            Column("median_in_words", "median", "g", shown=lambda text: text.removesuffix(" g")),
            Column(
                "band",
                f"{100.0 * self.level:.0f} % band",
                "g",
                shown=lambda band: " to ".join(map(_in_g, band)),
            ),
            Column(heading="dispersion", of=lambda row: row.dispersion or None, shown=2),
            Column("reaching", "reached by"),
        )
        return Summary(
            title=f"{first.measure} at which {self.limit_in_words}, over {counted(len(first.crossings), 'record')}",
            tables=[Table.of(columns, self.rows.values())],
            remarks=self.remarks,
            notes=self.in_words(against),
        )


@checked
def fragility(
    results: StudyResults,
    limit: FragilityLimit = None,
    *,
    level: BandLevel = 0.9,
    modelling_dispersion: ModellingDispersion = 0.0,
    seed: Seed = 0,
) -> Fragilities:
    """The intensity at which each arrangement of a study reaches a limit, lognormal over the records of its motions.

    Give the records several levels, as `pga = ["0.1 g", "0.2 g", ...]` of a `[[motion]]` (incremental dynamic
    analysis), or each record one (stripes). The intensity is what the motions are scaled to, `sa` or `pga`. The laws
    and the best constant command of the study are the same at every level. A run that diverged has reached the
    limit; one that could not be resolved is taken to lie above the level before. Copies of a record count once. The
    bootstrap draws the same records for every arrangement; the dispersion of models is added as a square. In Python the
    limit is a mapping, as `{"peak_drift_ratio": 0.01}`.

    Parameters
    ----------
    seed
        Seed of the bootstrap.

    Raises
    ------
    SettingError
        If the study was interrupted, the limit is not one criterion with a positive number, the study does not have the
        criterion, there are fewer than two records or one level only, or intensities of several measures.

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
    if forced := next((motion.name for motion in results.motions if motion.peak_force), None):
        raise SettingError(
            f"a fragility is over intensities of the ground, and motion {forced!r} has forces on floors; leave that "
            "motion out of the study"
        )
    limits = limit if limit is not None else results.limit or COLLAPSE
    ((name, value),) = limit_of(limits, results.command_unit, results.building.scales).items()
    at = results.motions.by_record
    runs = results.criteria_of_runs
    if name not in runs.numbers:
        runs = results.quantities.criteria(results.building.scales, results.command_unit, (name,))
    responses = runs.up_to_collapse(name)[:, :, 0]
    outside = np.zeros(responses.shape)
    for run, demands in results.demanded.items():
        outside[run] = any(demand.outside.exceedances for demand in demands)
    responses, outside = (
        np.where(at.places >= 0, each[:, at.places], np.nan) for each in (responses, outside)
    )
    found = Fragilities(
        criterion=name,
        limit=value,
        unit=in_command_unit(criterion_named(name).unit, results.command_unit),
        level=level,
        study_remarks=results.study_remarks,
    )
    kinds = {row.label: row.kind for row in results.rows}
    return _with_rows(found, kinds, at, responses, outside, seed, modelling_dispersion)


@checked
def fragilities_of(
    responses: Mapping[str, Annotated[ArrayLike, May.BE_INFINITE, May.BE_NAN]],
    levels: ArrayLike,
    limit: Positive,
    *,
    criterion: str = "peak_drift",
    level: Level = 0.9,
    measure: str = "PGA",
    unresolved: Mapping[str, ArrayLike] | None = None,
    seed: Seed = 0,
) -> Fragilities:
    """Fragilities of responses that another program computed: incremental dynamic analyses, or stripes.

    Stripes have other records at each level: a row for each record, with one response.

    Parameters
    ----------
    responses
        The criterion of each record at each level, shape (n_records, n_levels), by the label of the arrangement, in
        SI; infinite where a run collapsed, NaN where no run was made. `uncontrolled` is the label of the bare building.
    levels
        Levels of the intensity [m/s^2], rising, shape (n_levels,).
    limit
        Limit of the criterion, in its unit.
    criterion
        What was judged, as in `mr.closed_loop.criteria()`.
    level
        Level of the bands, by bootstrap over the records; the same records are drawn for every arrangement.
    measure
        The measure of intensity in words.
    unresolved
        1 where a run was made and failed, so that neither response nor collapse is known, else 0, by label in the shape
        of `responses`, which are NaN there: the record lies above the level before. By default there are none.
    seed
        Seed of the bootstrap.

    Raises
    ------
    SettingError
        If shapes do not agree, a response is known where a run failed, levels do not rise, or there are fewer than two
        records or levels.

    Examples
    --------
    >>> import mrwork as mr
    >>> drift = [[0.004, 0.011, 0.02], [0.003, 0.008, 0.015], [0.006, 0.012, 0.03]]
    >>> found = mr.study.fragilities_of({"uncontrolled": drift}, [1.0, 2.0, 3.0], 0.01, criterion="peak_drift_ratio")
    >>> f"{found['uncontrolled'].median:.2f} m/s^2"
    '1.92 m/s^2'
    """
    at = np.asarray(levels, dtype=float)
    stacked = [np.asarray(response, dtype=float) for response in responses.values()]
    failed = {} if unresolved is None else {name: np.asarray(each, bool) for name, each in unresolved.items()}
    count = len(next(iter(stacked), ()))
    shape = (count, at.size)
    if not stacked or any(response.shape != shape for response in stacked):
        text = ", ".join(f"{label} {np.shape(response)}" for label, response in responses.items())
        raise SettingError(
            f"`responses` have the shapes {text or 'of nothing'}; give (n_records, n_levels) for each label, here "
            f"{shape}, with `levels` of shape (n_levels,)"
        )
    flags = np.array([failed.pop(label, np.zeros(shape, bool)) for label in responses])
    if failed or flags.shape != (len(stacked), *shape) or (flags & ~np.isnan(stacked)).any():
        raise SettingError(
            f"`unresolved` has for labels of `responses` 1 where a run failed and 0 elsewhere, in their shape {shape}, "
            "and the response is NaN there; give it so, or leave it out where NaN is no run"
        )
    kinds: dict[str, Kind] = {
        label: "uncontrolled" if label == "uncontrolled" else "controller" for label in responses
    }
    places = np.zeros(shape, dtype=np.int64)
    records = numbered(count)
    of_levels = RecordLevels(records=records, measures=(measure,), unit="m/s^2", levels=at, places=places)
    found = Fragilities(criterion=criterion, limit=limit, unit=criterion_named(criterion).unit, level=level)
    outside = np.where(np.isnan(stacked) & ~flags, np.nan, 0.0)
    return _with_rows(found, kinds, of_levels, np.array(stacked), outside, seed)


def _with_rows(
    found: Fragilities,
    kinds: Mapping[str, Kind],
    at: RecordLevels,
    responses: Floats,
    outside: Floats,
    seed: int,
    modelling_dispersion: float = 0.0,
) -> Fragilities:
    """The fragilities of arrangements by label, of their responses, and 1 where a run is beyond tested ranges.

    Both arrays are over row, record and level; NaN is where there is no run.
    """
    levels = at.levels
    if min(len(at.records), levels.size) < _FEWEST_LEVELS or not np.all(np.diff(levels, prepend=0.0) > 0.0):
        raise SettingError(
            f"a fragility is over two records or more at several rising levels above 0, and here are "
            f"{counted(len(at.records), 'record')} at the levels {levels.tolist()} m/s^2; give several, as "
            'pga = ["0.1 g", "0.2 g"] of each [[motion]]'
        )
    weights, by_label = drawn_weights(len(at.records), seed), {}
    for (label, kind), lines, beyond in zip(kinds.items(), responses, outside, strict=True):
        there = ~np.isnan(beyond)
        crossings = tuple(
            _crossing(record, levels[mask], line[mask], found.limit)
            for record, mask, line in zip(at.records, there, lines, strict=True)
        )
        above, below = np.array([crossing.ends for crossing in crossings]).T
        medians, (dispersion, *_), ends = lognormal_of(above, below, weights)
        if dispersion != 0.0:
            ends = np.where((medians > 0.0) & (medians < np.inf), medians, ends)
        with np.errstate(invalid="ignore"):
            crossed = (lines >= found.limit).sum(axis=0) / (~np.isnan(lines)).sum(axis=0)
            shares = (beyond == 1.0).sum(axis=0) / there.sum(axis=0)
        by_label[label] = Fragility(
            label=label,
            kind=kind,
            measure=at.measure,
            median=float(medians[0]),
            dispersion=math.hypot(dispersion, modelling_dispersion),
            band=_band(ends[:, 1:], found.level, len(crossings)),
            medians=medians[1:],
            ends=ends[:, 1:],
            crossings=crossings,
            levels=levels,
            crossed=crossed,
            outside=shares,
            responses=lines,
        )
    return replace(found, rows=by_label)


def limit_of(limit: Mapping[str, float | str], command_unit: str, scales: Scales) -> dict[str, float]:
    """A criterion with its limit, in SI; refused where it is none, or `scales` lack what it is divided by."""
    if len(limit) != 1:
        raise SettingError(
            f"`limit` names {', '.join(limit) or 'no criterion'}; give one criterion with its limit, as "
            "{'peak_drift_ratio': 0.01}"
        )
    ((name, value),) = limit.items()
    limited = criterion_named(name)
    if reason := limited.unknown_in(command_unit):
        raise SettingError(reason)
    unit = in_command_unit(limited.unit, command_unit)
    if isinstance(value, str):
        number = number_in(value, unit)
        if isinstance(number, str):
            raise SettingError(f"the limit of {name} {number}")
        value = number
    if not 0.0 < value < math.inf:
        raise SettingError(f"the limit of {name} is {value:g}; give a positive number [{unit}]")
    limited.check_scale(scales)
    return {name: float(value)}


# A response this many limits high is of a frame that collapses in the step between two levels, whether its run diverged
# or not: the limit lies anywhere between them.
_FAR = 10.0


def _crossing(record: str, levels: Floats, responses: Floats, limit: float) -> Crossing:
    """The interval of a record from its responses at its levels, rising, and the intensity interpolated in it."""
    above, before = 0.0, math.nan
    for level, response in zip(levels.tolist(), responses.tolist(), strict=True):
        if math.isnan(response):
            return Crossing(record=record, above=above, below=math.inf, unresolved=True)
        if response >= limit:
            share = (limit - before) / (response - before) if response < _FAR * limit else math.nan
            between = above + share * (level - above)
            return Crossing(record=record, above=above, below=level, interpolated=between)
        above, before = level, response
    return Crossing(record=record, above=above, below=math.inf)


def drawn_weights(n_records: int, seed: int) -> Floats:
    """How often each record counts: once, and then as in each draw of the bootstrap, shape (1 + n_draws, n_records)."""
    equal = np.full(n_records, 1.0 / n_records)
    drawn = np.random.default_rng(seed).multinomial(n_records, equal, size=_DRAWS)
    return np.vstack([np.ones(n_records), drawn])


def _band(ends: Floats, level: float, n_records: int) -> tuple[float, float]:
    """Bootstrap band of numbers between these ends; of few records its quantiles lie further out, as Student's t.

    The expanded percentile interval of Hesterberg, The American Statistician 69, 2015, 371-386.
    """
    reach = scipy.stats.t.ppf(0.5 + level / 2.0, n_records - 1) * math.sqrt(n_records / (n_records - 1.0))
    tail = float(scipy.stats.norm.sf(reach))
    pairs = zip(ends, (tail, 1.0 - tail), strict=True)
    lower, upper = (np.quantile(*pair, method="inverted_cdf") for pair in pairs)
    return float(lower), float(upper)


# A record of so little more or less weight than half of all is still a middle one, and intensities that differ by less
# are one.
_TIE = 1e-9
# Steps of Newton's method and halvings of one, the largest step in standard deviations or of a larger slope, relative
# length of a step at the maximum, and the least probability of an interval.
_STEPS, _HALVINGS, _LONGEST, _CONVERGED, _TINY = 60, 40, 1.5, 1e-6, 1e-290


def lognormal_of(above: Floats, below: Floats, weights: Floats) -> tuple[Floats, Floats, Floats]:
    """Medians and dispersions of the lognormal distributions of largest likelihood, and ends of the medians.

    `above` and `below` are the ends of the interval of each record, shape (n_records,): 0 and infinity where one is
    open, equal where the intensity is known. `weights` say how often each record counts, shape (n_draws, n_records).
    The shapes are (n_draws,), (n_draws,) and (2, n_draws).

    Where one intensity separates all records, the misses at or below it and the hits at or above, the median lies
    between the highest miss and the lowest hit, and the dispersion is 0. Without any hit or miss the median is infinite
    or 0, and known to the interval of the middle records. Elsewhere nothing is known beside the maximum of the
    likelihood; without one, median and dispersion are NaN.
    """
    # A record without a run says nothing; of stripes many are known alike.
    weights = weights * ((above > 0.0) | np.isfinite(below))
    alike, places = np.unique(np.stack([above, below]), axis=1, return_inverse=True)
    if 2 * alike.shape[1] < len(above):
        (above, below), weights = alike, weights @ np.eye(alike.shape[1])[places.ravel()]
    counts = weights > 0.0
    lowest = np.where(counts, below, np.inf).min(axis=1)
    highest = np.where(counts, above, 0.0).max(axis=1)
    low, high = _middle(above, weights, 0.5 - _TIE), _middle(below, weights, 0.5 + _TIE)
    with np.errstate(invalid="ignore"):
        medians = np.sqrt(highest * lowest)
    medians[_middle(above, weights, 0.5 + _TIE) == 0.0] = 0.0
    medians[np.isinf(_middle(below, weights, 0.5 - _TIE))] = np.inf
    # An end that is open here is none of the distribution where other records lie beyond it.
    is_apart = highest <= (1.0 + _TIE) * lowest
    both = (highest > 0.0) & np.isfinite(lowest) & is_apart
    medians[both], low[both], high[both] = _between(above, below, weights[both])
    dispersions, is_open = np.zeros(len(weights)), ~(is_apart & counts.any(axis=1))
    medians[is_open], dispersions[is_open], low[is_open], high[is_open] = np.nan, np.nan, 0.0, np.inf
    # Of records with one end each it rises with the slope at 0 where the mean of the upper ends lies above the other.
    is_below, is_above = np.isfinite(below), above > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        upper, lower = (
            weights[:, side] @ np.log(ends[side]) / weights[:, side].sum(axis=1)
            for ends, side in ((below, is_below & ~is_above), (above, is_above & ~is_below))
        )
    has_maximum = is_open & (weights[:, is_below & is_above].any(axis=1) | (upper - lower > 1e-12))
    if has_maximum.any():
        medians[has_maximum], dispersions[has_maximum] = _newton(above, below, weights[has_maximum])
    return medians, dispersions, np.stack([low, high])


def _between(above: Floats, below: Floats, weights: Floats) -> Floats:
    """Medians and their ends, shape (3, n_draws), where misses lie at or below hits and there are both.

    The median lies anywhere between the highest miss and the lowest hit. Where they are one level, what most records do
    at it says on which side, as far as to the next end of an interval.
    """
    highest = np.where(weights > 0.0, above, 0.0).max(axis=1)[:, None]
    lowest = np.where(weights > 0.0, below, np.inf).min(axis=1)[:, None]
    before = np.where((weights > 0.0) & (above < highest), above, 0.0).max(axis=1)
    after = np.where((weights > 0.0) & (below > lowest), below, np.inf).min(axis=1)
    # Records with one end, at another level, say nothing of this one.
    known = weights * ((above > 0.0) & np.isfinite(below) | (above == highest) | (below == lowest))
    total = known.sum(axis=1)
    hits, misses = ((known * side).sum(axis=1) / total for side in (above < highest, below > lowest))
    low, high = highest[:, 0], lowest[:, 0]
    medians, is_one = np.sqrt(low * high), low >= high
    medians = np.where(is_one & (hits > 0.5 + _TIE) & (before == 0.0), 0.0, medians)
    medians = np.where(is_one & (misses > 0.5 + _TIE) & np.isinf(after), np.inf, medians)
    low = np.where(is_one & (hits > 0.5 - _TIE), before, low)
    return np.array([medians, low, np.where(is_one & (misses > 0.5 - _TIE), after, high)])


def _middle(values: Floats, weights: Floats, share: float) -> Floats:
    """The value up to which a share of the weights lies, shape (n_draws,)."""
    order = np.argsort(values)
    shares = np.cumsum(weights[:, order], axis=1) / np.maximum(weights.sum(axis=1, keepdims=True), _TINY)
    return np.asarray(values[order][(shares > share).argmax(axis=1)])


def _newton(above: Floats, below: Floats, weights: Floats) -> Floats:
    """Medians and dispersions, shape (2, n_draws)."""
    with np.errstate(divide="ignore"):
        low, high = np.log(above), np.log(below)
    ends = np.concatenate([low[np.isfinite(low)], high[np.isfinite(high)]])
    centre, scale = float(ends.mean()), float(ends.std()) or 1.0
    low, high = (low - centre) / scale, (high - centre) / scale
    # Slope and offset of z = slope * x - offset.
    at = np.tile([1.0, 0.0], (len(weights), 1))
    total, gradient, curvature = _likelihood(low, high, weights, at)
    for _ in range(_STEPS):
        step = np.linalg.solve(curvature + 1e-12 * np.eye(2), gradient[..., None])[..., 0]
        length, slope = np.abs(step).max(axis=1), at[:, 0]
        converged = (np.abs(step) < _CONVERGED * np.stack([slope, 1.0 + np.abs(at[:, 1])], axis=1)).all(
            axis=1
        )
        if length.max() < 1e-10:
            break
        step *= np.minimum(1.0, _LONGEST * np.maximum(1.0, slope) / np.maximum(length, 1e-300))[:, None]
        for _ in range(_HALVINGS):
            after, *_ = _likelihood(low, high, weights, at + step)
            worse = ~(after >= total - 1e-12 * np.abs(total))
            if not worse.any():
                break
            step[worse] *= 0.5
        at = np.where(worse[:, None], at, at + step)
        total, gradient, curvature = _likelihood(low, high, weights, at)
    slope, offset = np.where(converged, at.T, np.nan)
    # Of a likelihood that hardly falls towards a flat distribution the median is of any size.
    with np.errstate(over="ignore"):
        return np.array([np.exp(centre + scale * offset / slope), scale / slope])


def _likelihood(low: Floats, high: Floats, weights: Floats, at: Floats) -> tuple[Floats, Floats, Floats]:
    """Logarithm of the likelihood of each row of weights, its gradient in slope and offset, and minus its curvature.

    It is NaN or low where the slope is not positive.
    """
    slope, offset = at[:, :1], at[:, 1:]
    # Where the intensity is known the likelihood is its density, slope times the density of z.
    exact, ndtr = low == high, scipy.special.ndtr
    with np.errstate(all="ignore"):
        za, zb = slope * low - offset, slope * high - offset
        da, db = (np.exp(-0.5 * z * z) / math.sqrt(2.0 * math.pi) for z in (za, zb))
        # An open end adds nothing, and in the upper tail the difference of the complements is exact.
        xa, xb = (np.where(np.isfinite(x), x, 0.0) for x in (low, high))
        p = np.maximum(np.where(za > 0.0, ndtr(-za) - ndtr(-zb), ndtr(zb) - ndtr(za)), _TINY)
        ua, ub = (np.where(density > 0.0, z * density, 0.0) for z, density in ((za, da), (zb, db)))
        by_slope = np.where(exact, 1.0 / slope - za * xa, (xb * db - xa * da) / p)
        by_offset = np.where(exact, za, (da - db) / p)
        logs = np.where(exact, np.log(slope) - 0.5 * za * za, np.log(p))
        second = ((xa * xa * ua - xb * xb * ub) / p, (xb * ub - xa * ua) / p, (ua - ub) / p)
        first = (by_slope * by_slope, by_slope * by_offset, by_offset * by_offset)
        of_known = (slope**-2 + xa * xa, -xa, np.ones_like(za))
        a, b, c = (
            (weights * np.where(exact, alone, one - two)).sum(axis=1)
            for alone, one, two in zip(of_known, first, second, strict=True)
        )
    gradient = np.stack([(weights * by_slope).sum(axis=1), (weights * by_offset).sum(axis=1)], axis=1)
    return (weights * logs).sum(axis=1), gradient, np.array([[a, b], [b, c]]).transpose(2, 0, 1)
