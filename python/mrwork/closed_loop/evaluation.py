"""Evaluation criteria by name, with their labels in papers.

Each is one number of a run. Papers report its ratio: the benchmarks to the value without dampers (Dyke, Jansen,
Ohtori), the thesis to the value at i = 0. `||.||` is the root mean square over the record.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np

from mrwork.base.arguments import AnyNumbers, Whole
from mrwork.base.keys import look_up
from mrwork.base.numbers import format_rounded
from mrwork.base.remark import Remark
from mrwork.base.summary import Summarised, list_names
from mrwork.base.units import STANDARD_GRAVITY as STANDARD_GRAVITY
from mrwork.base.units import unusual_number
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.building_remarks import DRIFT_RATIOS
from mrwork.buildings.groups import BOTH_UNITS
from mrwork.buildings.plane_building import Building
from mrwork.closed_loop.responses import quantity_named
from mrwork.errors import SettingError

Scale = Literal["", "weight", "height", "yield drift", "stability"]


@array_dataclass(repr=False)
class Scales(Summarised):
    """What numbers of a run are divided by: the weight of the building [N], and numbers of its storeys, lowest first.

    The weight is NaN where nothing follows the ground. The others are heights [m], drifts at which storeys yield [m],
    and weights on the storeys [N] with P-delta, shape (..., n_storeys); a storey with 0 has none, NaN and empty arrays
    are not known.
    """

    weight: float | Floats
    heights: Floats = field(default_factory=lambda: np.empty(0))
    yield_drifts: Floats = field(default_factory=lambda: np.empty(0))
    loads: Floats = field(default_factory=lambda: np.empty(0))

    @staticmethod
    def of(building: Building) -> Scales:
        """The scales of a building without dampers."""
        return Scales(
            weight=building.total_mass * STANDARD_GRAVITY if building.follows_ground else np.nan,
            heights=building.of_drifts(building.heights),
            yield_drifts=building.of_drifts(building.yield_drifts),
            loads=building.of_drifts(building.loads),
        )

    @staticmethod
    def of_rows(scales: Sequence[Scales], n_further: int) -> Scales:
        """The scales of several rows along a first axis, before `n_further` axes of other things than storeys."""
        further = (1,) * n_further

        def stacked(name: str) -> Floats:
            arrays: list[Floats] = [getattr(one, name) for one in scales]
            size = max(map(np.size, arrays))
            rows = np.array([one if np.size(one) else np.full(size, np.nan) for one in arrays])
            return rows.reshape(len(rows), *further, size) if size else np.empty(0)

        return Scales(
            weight=np.array([one.weight for one in scales]).reshape(-1, *further),
            **{name: stacked(name) for name in ("heights", "yield_drifts", "loads")},
        )

    def lacking(self, scale: Scale) -> str:
        """The keys of [building] that a number over this scale needs and that were not given; empty if none."""
        needed = {
            "height": (self.heights, "height or heights"),
            "yield drift": (self.yield_drifts, "storeys_that_yield"),
            "stability": (self.loads, "p_delta"),
        }
        numbers, keys = needed.get(scale, (np.ones(1), ""))
        return "" if np.size(numbers) else keys

    def divide(self, values: Floats, scale: Scale, shears: Floats) -> Floats:
        """Numbers of storeys, shape (..., n_storeys), over the scale; 0 of a storey that has none, NaN if not known.

        Stability is `P d / (V h)` with the drift d and the shear V of the storey (EN 1998-1, 4.4.2.2).
        """
        if self.lacking(scale):
            return np.full(np.shape(values), np.nan)
        by = self.heights if scale == "height" else self.yield_drifts
        above = values
        if scale == "stability":
            above, by = values * self.loads, self.heights * shears
        by = np.broadcast_to(by, np.shape(values))
        # An unknown shear is no shear of zero.
        return np.divide(above, by, out=np.where(np.isnan(by), np.nan, 0.0), where=by > 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Criterion:
    """One number of a run, computed from one of its quantities; smaller is better.

    The value is the largest magnitude of `quantity`, by default the one of its name, over floors, storeys or devices,
    the value of the roof if `of_roof`, or the sum if `summed`, each divided by its `scale`, see `Scales`. If `ratio`,
    papers report its ratio to the value without dampers, under these `labels`. A number that is `of_command` is zero at
    i = 0, and in A or V unless it is `counted`, which jumps by whole counts. One that is `optional` may be unknown: in
    earlier files, where its scale is, or where commands have two units. `usual` is the range of its limits in SI,
    `None` where they are of any size. `over` names the criterion of the building without dampers in the denominator, if
    it is another one. `short` is the title in a narrow column. One `at` a place is of one floor, storey or device.
    """

    name: str
    title: str
    short: str
    of_quantity: str = ""
    summed: bool = False
    of_roof: bool = False
    scale: Scale = ""
    labels: tuple[str, ...] = ()
    over: str = ""
    ratio: bool = True
    of_command: bool = False
    counted: bool = False
    optional: bool = False
    usual: tuple[float, float] | None = None
    place: str = ""

    def at(self, place: str) -> Criterion:
        """The criterion at a floor, storey or device alone, by its name; one of the whole building is refused."""
        if quantity_named(self.quantity).axis == "run" or self.of_roof or self.summed:
            raise SettingError(
                f"{self.name} is one number of the whole building, and has no place; leave out @{place}"
            )
        name, title, short = f"{self.name}@{place}", f"{self.title}, {place}", f"{self.short} {place}"
        return replace(
            self,
            name=name,
            title=title,
            short=short,
            of_quantity=self.quantity,
            place=place,
            labels=(),
            over="",
        )

    def check_place(self, axes: Mapping[str, Sequence[str]]) -> None:
        """Refuse a place that is none of the labels along the axis of the quantity."""
        axis = quantity_named(self.quantity).axis
        if not self.place or self.place in axes[axis]:
            return
        other = next((other for other in ("floor", "storey", "device") if self.place in axes[other]), "")
        why = f"{self.place!r} is a {other}" if other else f"nothing is called {self.place!r}"
        raise SettingError(
            f"{self.name}: {why}, and {self.name.partition('@')[0]} is of a {axis}; give one of {', '.join(axes[axis])}"
        )

    def check_scale(self, scales: Scales) -> None:
        """Refuse a number over a scale that the building lacks, and that would be known of no run."""
        if lacking := scales.lacking(self.scale):
            raise SettingError(f"{self.name} is known only with {lacking} in [building]; give it")

    @property
    def quantity(self) -> str:
        """Quantity of a run that is reduced to it: of the same name where no other is stated."""
        return self.of_quantity or self.name

    @property
    def reference_criterion(self) -> str:
        """Criterion of the building without dampers in the denominator of the ratio; empty if there is none."""
        return self.over or (self.name if self.ratio else "")

    @property
    def unit(self) -> str:
        """Unit of the number, as in tables."""
        return self.declared_unit.replace("^", "")

    @property
    def declared_unit(self) -> str:
        """Unit of the number, as the core declares it."""
        return "1" if self.scale else quantity_named(self.quantity).unit

    def in_words(self, value: float, unit: str) -> str:
        """A value with its unit; a drift ratio in per cent."""
        if self.scale == "height":
            value, unit = 100.0 * value, "%"
        return f"{format_rounded(value)} {unit}".removesuffix(" 1")

    def unknown_in(self, command_unit: str) -> str:
        """Why it is not known where commands have this unit, with what to do; empty where it is."""
        if command_unit != BOTH_UNITS or not self.of_command or self.counted:
            return ""
        return (
            f"{self.name} is in one unit, and the dampers follow commands in A and in V; limit another criterion, as "
            "peak_force"
        )

    def unusual_limit(self, limit: float, where: str = "") -> Iterator[Remark]:
        """Warn of a limit of the criterion that is of an unusual size."""
        if self.usual is not None:
            yield from unusual_number(f"the limit of {self.name}", limit, self.usual, self.unit, where=where)

    def value(self, responses: object, scales: Scales) -> Floats:
        """The value for each run of `responses`, which has the quantities of runs as attributes."""
        return np.asarray(np.max(self.of_places(responses, scales), axis=-1, initial=0.0))

    def of_places(self, responses: Any, scales: Scales) -> Floats:
        """The numbers of each run whose largest is the value, along a last axis, as of floors or storeys."""
        values = np.abs(getattr(responses, self.quantity))
        if self.scale not in ("", "weight"):
            shears = np.asarray(getattr(responses, "peak_storey_shear", np.nan))
            values = scales.divide(values, self.scale, shears)
        axis = quantity_named(self.quantity).axis
        if self.place:
            self.check_place(responses.axes)
            values = values[..., [responses.axes[axis].index(self.place)]]
        if axis == "device":
            # What a run does not have, NaN, counts as nothing: without devices the largest force is zero.
            values = np.where(np.isnan(values), 0.0, values)
        if axis == "run":
            values = values[..., None]
        elif self.of_roof:
            values = values[..., -1:]
        elif self.summed:
            values = np.sum(values, axis=-1, keepdims=True)
        return np.asarray(values / np.expand_dims(scales.weight, -1) if self.scale == "weight" else values)


def criteria() -> tuple[Criterion, ...]:
    """Every criterion of a run in the order of tables; a study may also ask for one at a place, as ``peak_drift@tyre``.

    Examples
    --------
    >>> from mrwork.closed_loop.evaluation import criterion
    >>> criterion("peak_drift").labels
    ('J1 of Ohtori et al. 2004', 'J2 of Jansen & Dyke 2000')
    """
    return _CRITERIA


def criterion(name: str) -> Criterion:
    """The criterion of a name, such as `peak_drift`, or `peak_drift@tyre` at a place; an unknown name is refused."""
    base, at, place = name.partition("@")
    known = {entry.name: entry for entry in (*_CRITERIA, *_ON_REQUEST)}
    found = look_up(base, known, f"no criterion is called {base!r}")
    if at and not place:
        raise SettingError(f"{name}: no name stands behind @; give one, or leave @ out")
    return found.at(place) if at else found


def on_request(names: Iterable[str]) -> tuple[str, ...]:
    """The names of criteria that not every run has: at a place, or from histories; each once."""
    every = {entry.name for entry in _CRITERIA}
    return tuple(dict.fromkeys(name for name in names if name not in every))


def values(responses: object, scales: Scales, asked: Sequence[str] = ()) -> dict[str, Floats]:
    """Every criterion of `responses`, which has the quantities of runs as attributes, and those that are asked for."""
    entries = (*_CRITERIA, *map(criterion, asked))
    return {entry.name: entry.value(responses, scales) for entry in entries}


def ratio(numerator: AnyNumbers, denominator: AnyNumbers) -> Floats:
    """The quotient, NaN for a zero denominator, infinite beyond the range of numbers."""
    above, below = np.broadcast_arrays(numerator, denominator)
    with np.errstate(over="ignore"):
        quotient: Floats = np.divide(above, below, out=np.full(above.shape, np.nan), where=below != 0.0)
    return quotient


SCORE = ("peak_drift", "peak_acceleration", "rms_drift", "rms_acceleration")
"""Criteria whose ratios to i = 0 are averaged in the score, unless a study states others."""


def scored_in_words(names: Sequence[str]) -> str:
    """The criteria of a score, as part of a heading."""
    if tuple(names) == SCORE:
        return "peak and RMS drift and acceleration"
    return list_names([criterion(name).short for name in names])


def searched(numbers: Floats) -> Floats:
    """What a search minimises: a candidate without a number, NaN, is infinitely bad."""
    return np.where(np.isnan(numbers), np.inf, numbers)


_QUARTILES = (0.0, 0.25, 0.5, 0.75, 1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Distribution of a number over ground motions: how many, mean, least, quartiles, median and most.

    Quartiles are interpolated linearly between the ordered values, as `numpy.quantile` does.
    """

    motions: Whole
    mean: float
    least: float
    lower_quartile: float
    median: float
    upper_quartile: float
    most: float

    @staticmethod
    def of(values: Sequence[float]) -> Spread:
        """The spread of one value for each motion; all NaN where there is none, or one is not a number."""
        numbers = np.asarray(values, dtype=np.float64)
        if not numbers.size or np.isnan(numbers).any():
            quantiles, mean = np.full(5, np.nan), float("nan")
        else:
            # Between two infinite numbers, as of commands over none at i = 0, nothing can be interpolated.
            way: Any = "linear" if np.isfinite(numbers).all() else "inverted_cdf"
            quantiles, mean = np.quantile(numbers, _QUARTILES, method=way), float(np.mean(numbers))
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


def is_within_spread(numbers: Floats) -> bool:
    """Whether a mean difference over motions is at most two standard errors, so that the motions do not tell it from 0.

    Of one motion nothing is told; equal numbers are within their spread.
    """
    if numbers.size < 2 or not np.isfinite(numbers).all():
        return False
    error = float(np.std(numbers, ddof=1)) / float(np.sqrt(numbers.size))
    return bool(abs(float(np.mean(numbers))) <= 2.0 * error)


def ties_in_words(
    leading: str, scores: Sequence[float], others: Mapping[str, Sequence[float]], noun: str = "motions"
) -> tuple[str, ...]:
    """A sentence on the rows that the leading row does not beat by more than the spread over motions."""
    differences = {label: np.subtract(other, scores) for label, other in others.items()}
    tied = {label: each for label, each in differences.items() if is_within_spread(each)}
    if not tied:
        return ()
    listed = ", ".join(f"{label} ({float(np.mean(tie)):+.3f})" for label, tie in tied.items())
    return (
        f"On these {len(scores)} {noun} the score of {leading} is not told apart from the score of {listed}: the mean "
        f"difference{' is' if len(tied) == 1 else 's are'} within two standard errors over the {noun}.",
    )


_OHTORI = "Ohtori et al. 2004"
_JANSEN = "Jansen & Dyke 2000"

_CRITERIA = (
    Criterion(name="peak_displacement", title="Peak displacement", short="Displ.", labels=(f"J1 of {_JANSEN}",)),
    Criterion(name="peak_drift", title="Peak drift", short="Drift", labels=(f"J1 of {_OHTORI}", f"J2 of {_JANSEN}"),
        usual=(5e-5, 1.0)),
    Criterion(name="peak_drift_ratio", title="Peak drift ratio", short="Drift ratio", of_quantity="peak_drift",
        scale="height", ratio=False, optional=True, usual=DRIFT_RATIOS),
    Criterion(name="peak_roof_displacement", title="Peak displacement of the roof", short="Roof displ.",
        of_quantity="peak_displacement", of_roof=True, ratio=False, optional=True),
    Criterion(name="peak_ductility", title="Peak drift over yield drift", short="Ductility", of_quantity="peak_drift",
        scale="yield drift", ratio=False, optional=True),
    Criterion(name="stability_coefficient", title="Stability coefficient", short="Stability", of_quantity="peak_drift",
        scale="stability", ratio=False, optional=True),
    Criterion(name="residual_drift", title="Residual drift", short="Residual drift", ratio=False, optional=True),
    Criterion(name="residual_drift_ratio", title="Residual drift ratio", short="Residual ratio",
        of_quantity="residual_drift", scale="height", ratio=False, optional=True, usual=(1e-5, 0.1)),
    Criterion(name="peak_acceleration", title="Peak acceleration", short="Acc.",
        labels=(f"J2 of {_OHTORI}", f"J3 of {_JANSEN}"), usual=(0.1, 80.0)),
    Criterion(name="peak_base_shear", title="Peak base shear", short="Shear", labels=(f"J3 of {_OHTORI}",)),
    Criterion(name="base_shear_coefficient", title="Peak base shear over weight", short="Shear over weight",
        of_quantity="peak_base_shear", scale="weight", ratio=False, optional=True),
    Criterion(name="rms_displacement", title="RMS displacement", short="RMS displ."),
    Criterion(name="rms_drift", title="RMS drift", short="RMS drift", labels=(f"J4 of {_OHTORI}",)),
    Criterion(name="rms_acceleration", title="RMS acceleration", short="RMS acc.", labels=(f"J5 of {_OHTORI}",)),
    Criterion(name="rms_base_shear", title="RMS base shear", short="RMS shear", labels=(f"J6 of {_OHTORI}",)),
    Criterion(name="peak_force", title="Peak device force", short="Force", ratio=False),
    Criterion(name="peak_force_share", title="Peak device force over weight", short="Force share",
        of_quantity="peak_force", scale="weight", labels=(f"J11 of {_OHTORI}", f"J4 of {_JANSEN}"), ratio=False),
    Criterion(name="peak_stroke", title="Peak stroke", short="Stroke", labels=(f"J12 of {_OHTORI}",),
        over="peak_drift", ratio=False, usual=(1e-4, 1.0)),
    Criterion(name="mean_current", title="Mean command", short="Mean command", ratio=False, of_command=True,
        optional=True),
    Criterion(name="rms_current", title="RMS command", short="RMS command", ratio=False, of_command=True,
        optional=True),
    Criterion(name="command_travel", title="Command travel per second", short="Travel", ratio=False, of_command=True,
        optional=True),
    Criterion(name="switching_rate", title="Switchings of the command per second", short="Switchings", ratio=False,
        of_command=True, counted=True),
    Criterion(name="device_energy", title="Energy taken up by devices", short="Energy", summed=True, ratio=False),
    Criterion(name="storey_energy", title="Energy taken up by storeys that yield", short="Frame energy",
        summed=True, ratio=False, optional=True),
)  # fmt: skip

_ON_REQUEST = (
    Criterion(
        name="weighted_acceleration",
        title="Acceleration weighted by W_k",
        short="W_k acc.",
        optional=True,
        usual=(0.01, 20.0),
    ),
)
