"""Ground motion: horizontal acceleration of the ground and forces on floors, sampled uniformly; processing, and copies.

Each function of the processing returns a new motion; its `changes` state what was done.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field, replace
from typing import Annotated, ClassVar, Final

import numpy as np
from numpy.polynomial import Legendre

from mrwork.base.arguments import AnyNumbers, May, Positive, checked
from mrwork.base.hints import SMALLEST
from mrwork.base.numbers import counted, in_newtons
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.values import Floats, array_dataclass, keep_arrays
from mrwork.errors import MrworkWarning, RecordError, SettingError
from mrwork.motions.examination import motion_remarks, refuse_absurd, road_remarks


@checked
@array_dataclass(repr=False)
class GroundMotion(Plotted, Summarised):
    """Ground acceleration [m/s^2], shape (n_time,), every `dt` [s], linear between samples.

    `forces` [N], shape (n_floors, n_time), empty by default, act on the floors of a building at the same times, linear
    between samples and zero after the last; both may act at once. `force_motion` has forces over a ground at rest.
    `source` states its origin; `changes` lists the processing since, in order. `groups` name what it has in common with
    others, such as its soil; tables of a study have the score of each group. `is_road` says that the ground is a road
    under a vehicle (`road_motion`), whose size is not that of earthquakes.
    """

    _made_by: ClassVar[str] = "mr.read_motion(path)"

    name: str
    dt: Annotated[float, May.BE_INFINITE, May.BE_NAN]
    acceleration: AnyNumbers
    source: str = ""
    changes: tuple[str, ...] = ()
    groups: tuple[str, ...] = ()
    forces: AnyNumbers = field(default_factory=lambda: np.empty((0, 0)))
    is_road: bool = False

    def __post_init__(self) -> None:
        keep_arrays(self, "acceleration", "forces")
        if self.acceleration.ndim != 1 or self.acceleration.size < 2:
            raise RecordError(
                f"ground motion {self.name}: a record of {self.acceleration.size} samples; give two or more"
            )
        if not np.isfinite(self.acceleration).all():
            first = int(np.flatnonzero(~np.isfinite(self.acceleration))[0])
            raise RecordError(f"ground motion {self.name}: sample {first} is not a finite number")
        if not (np.isfinite(self.dt) and self.dt >= SMALLEST):
            raise RecordError(f"ground motion {self.name}: its step is {self.dt} s; give a positive number")
        if not self.forces.size:
            object.__setattr__(self, "forces", np.empty((0, self.n_time)))
        if self.forces.ndim != 2 or self.forces.shape[1] != self.n_time:
            raise RecordError(
                f"ground motion {self.name}: its forces have shape {self.forces.shape}, and its acceleration "
                f"{self.n_time} samples; give the forces a row for each floor, and as many samples"
            )
        if not np.isfinite(self.forces).all():
            floor, first = np.argwhere(~np.isfinite(self.forces))[0]
            raise RecordError(
                f"ground motion {self.name}: sample {first} of the force on floor {floor + 1} is not a finite number"
            )

    @property
    def n_time(self) -> int:
        """Number of samples."""
        return self.acceleration.size

    @property
    def peak(self) -> float:
        """Largest magnitude of the ground acceleration [m/s^2]."""
        return float(np.abs(self.acceleration).max())

    @property
    def peak_force(self) -> float:
        """Largest magnitude of the sum of the forces on the floors [N], zero without any."""
        return float(np.abs(self.forces.sum(axis=0)).max())

    @property
    def duration(self) -> float:
        """Time from the first sample to the last [s]."""
        return self.dt * (self.acceleration.size - 1)

    @property
    def time(self) -> Floats:
        """Times of the samples [s], shape (n_time,), the first at zero."""
        return self.dt * np.arange(self.n_time, dtype=np.float64)

    @property
    def velocity(self) -> Floats:
        """Ground velocity [m/s], shape (n_time,), from rest: exact integral of the piecewise linear acceleration."""
        a = self.acceleration
        return np.concatenate(([0.0], np.cumsum(0.5 * self.dt * (a[:-1] + a[1:]))))

    @property
    def displacement(self) -> Floats:
        """Ground displacement [m], shape (n_time,), from rest at zero, integrated exactly as `velocity`.

        Records do not preserve the baseline, so it drifts unless the motion was corrected (`baseline_corrected`).
        """
        a, h = self.acceleration, self.dt
        steps = h * self.velocity[:-1] + h * h * (2.0 * a[:-1] + a[1:]) / 6.0
        return np.concatenate(([0.0], np.cumsum(steps)))

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """On a step, size or mean that no accelerogram has, wild samples, clipped peaks; of a road on its heights."""
        return examined(self, scaled=False)

    def _summary(self) -> Summary:
        return Summary(
            title=f"Ground motion {self.name}",
            facts=(
                *[("peak", f"{self.peak:.4g} m/s^2")] * bool(self.peak or not self.forces.size),
                *[("peak of the forces", in_newtons(self.peak_force))] * bool(self.forces.size),
                ("duration", f"{self.duration:.5g} s, {self.n_time} samples every {self.dt:.6g} s"),
                ("source", self.source),
                ("changes", "; ".join(self.changes) or "none"),
            ),
            remarks=self.remarks,
        )


def examined(motion: GroundMotion, *, scaled: bool) -> tuple[Remark, ...]:
    """The `remarks` of a motion; of one that is to be scaled to an intensity, none on its size."""
    if motion.forces.size and not motion.peak:
        return ()
    if motion.is_road:
        return tuple(road_remarks(motion.name, motion.displacement, motion.dt))
    return tuple(motion_remarks(motion.name, motion.acceleration, motion.velocity, motion.dt, scaled=scaled))


@checked
def force_motion(forces: AnyNumbers, dt: float, *, name: str = "forces", source: str = "") -> GroundMotion:
    """Forces on the floors of a building [N], as of a shaker or the wind, over a ground at rest.

    Parameters
    ----------
    forces
        Force on each floor in the direction of its displacement [N], shape (n_floors, n_time), linear between samples
        and zero after the last.
    dt
        Step of the samples [s].

    Examples
    --------
    >>> force_motion([[0.0, 0.0, 0.0], [0.0, 2e3, 0.0]], 0.01).peak_force
    2000.0
    """
    rows = np.asarray(forces, dtype=np.float64)
    if rows.ndim != 2 or not rows.size:
        raise RecordError(
            f"{name}: the forces have shape {rows.shape}; give a row of samples for each floor, zeros where none acts"
        )
    return GroundMotion(name=name, dt=dt, acceleration=np.zeros(rows.shape[1]), source=source, forces=rows)


def replace_samples(
    motion: GroundMotion, acceleration: Floats, dt: float, change: str, *, forces: Floats | None = None
) -> GroundMotion:
    """Return the motion with other samples, and forces or its own, and one more entry in `changes`."""
    forces = motion.forces if forces is None else forces
    return replace(motion, acceleration=acceleration, forces=forces, dt=dt, changes=(*motion.changes, change))


def peak_push(motion: GroundMotion, mass: float) -> float:
    """Largest ground acceleration that pushes a building of this mass as the motion and its forces do [m/s^2]."""
    return float(np.abs(motion.acceleration - motion.forces.sum(axis=0) / mass).max())


def refuse_floors(motion: GroundMotion, floors: Sequence[str]) -> None:
    """Refuse a motion whose forces are not on floors of these names."""
    if len(motion.forces) not in (0, len(floors)):
        raise SettingError(
            f"ground motion {motion.name} has forces on {counted(len(motion.forces), 'floor')}, and the building "
            f"{counted(len(floors), 'floor')}, {list_names(floors)}; give a row for each, zeros where no force acts"
        )


def on_floors(motion: GroundMotion, own: Sequence[str], floors: Sequence[str]) -> GroundMotion:
    """The motion with its forces, which are on the floors `own`, among `floors`, to which a building may add some."""
    if not motion.forces.size or own == floors:
        return motion
    refuse_floors(motion, own)
    forces = np.zeros((len(floors), motion.n_time))
    forces[[*map(floors.index, own)]] = motion.forces
    return replace(motion, forces=forces)


def refuse_forces(motion: GroundMotion, what: str) -> None:
    """Refuse what is done to an accelerogram, and would leave out the forces of a motion."""
    if motion.forces.size:
        raise SettingError(
            f"ground motion {motion.name}: {what} is of ground accelerations, and it has forces on floors; scale it by "
            "a `factor`, or leave this out"
        )


def _refuse_road(motion: GroundMotion, what: str) -> None:
    """Refuse what is done to an accelerogram, and would make another road of a road."""
    if motion.is_road:
        raise SettingError(
            f"motion {motion.name}: {what}; change its heights or its speed, and make the road anew with road_motion"
        )


# Copies that were cut, corrected, resampled or scaled have 0.95 or more. Different motions have less: up to 0.45 among
# twenty measured records, up to 0.81 among synthetic ones of soft soil, which are nearly harmonic.
_COPY = 0.9
_COMPARED_STEP = 0.01
# Share of the energy of one motion, and of the other, that an overlap must hold.
_MOST_ENERGY, _LEAST = 0.5, 0.1


def correlation_of_motions(one: GroundMotion, other: GroundMotion) -> float:
    """Largest correlation of two motions over all shifts in time, 0 to 1: 1 for a copy, also with another factor.

    The accelerations are correlated where the two overlap, in absolute value, for shifts that leave half the energy of
    one motion and a tenth of the energy of the other in the overlap. Motions with different steps are also compared
    sample by sample, which finds a copy with another time axis. Of forces over a ground at rest the changes between
    samples are compared as they are: two winds of one mean are no copies.
    """
    if not (one.peak or other.peak):
        return _likeness_of_forces(one, other)
    correlation = _largest_correlation(_on_step(one), _on_step(other))
    if abs(one.dt - other.dt) > 1e-6 * one.dt:
        correlation = max(correlation, _largest_correlation(one.acceleration, other.acceleration))
    return correlation


def _likeness_of_forces(one: GroundMotion, other: GroundMotion) -> float:
    """Correlation of the changes of the forces between samples, which are as many; zero where there are others."""
    if one.forces.shape != other.forces.shape:
        return 0.0
    changes = np.diff(one.forces), np.diff(other.forces)
    norms = float(np.prod([*map(np.linalg.norm, changes)]))
    return abs(float(np.vdot(*changes))) / norms if norms else 0.0


def is_copy(one: GroundMotion, other: GroundMotion) -> bool:
    """Whether two motions are the same record up to its scale, a shift, cut ends, another step or time axis."""
    return correlation_of_motions(one, other) > _COPY


# Lags [samples of 10 ms] of the autocorrelations of which copies have nearly the same, and by how much they may differ.
_LAGS, _APART = 100, 0.05


def copies_among(motions: Sequence[GroundMotion]) -> dict[int, int]:
    """Index of the first record by the index of each copy of it; levels of one record are no copies.

    Neither are motions of one ground with other forces on floors.

    Autocorrelations, which neither a factor nor a shift or padding changes, tell which motions to compare at all.
    """
    firsts: list[int] = []
    prints = np.array([_autocorrelation(_on_step(motion)) for motion in motions])
    copies: dict[int, int] = {}
    for number, motion in enumerate(motions):
        near = [first for first in firsts if np.abs(prints[first] - prints[number]).max() < _APART]
        alike = (each for each in near if _have_one_load(motions[each], motion))
        first = next((each for each in alike if is_copy(motions[each], motion)), None)
        if first is None:
            firsts.append(number)
        elif motion.name != motions[first].name or motion.peak == motions[first].peak:
            copies[number] = first
    return copies


def _have_one_load(one: GroundMotion, other: GroundMotion) -> bool:
    """Whether forces of two motions of one ground are alike too, or neither has any."""
    return not (one.forces.any() or other.forces.any()) or _likeness_of_forces(one, other) > _COPY


def _autocorrelation(samples: Floats) -> Floats:
    """Normalised autocorrelation at the lags of copies, shape (n_lags,); of a motion at rest zeros."""
    size = 1 << (samples.size + _LAGS).bit_length()
    products = np.fft.irfft(np.abs(np.fft.rfft(samples, size)) ** 2, size)[: _LAGS + 1]
    return np.asarray(products[1:] / (products[0] or 1.0))


_COPIES: Final = RemarkKind(
    "records_copied",
    "{copies} of the record {0}, up to a factor, a shift or padding, and count with it as one record",
    "leave all but one out",
)


def copies_remarks(names: Mapping[str, Iterable[str]]) -> Iterator[Remark]:
    """A remark for each record with the names of its copies, each once."""
    for first, every in names.items():
        copies = tuple(dict.fromkeys(every))
        yield _COPIES.remark(
            first, *copies, copies=f"{list_names(copies)} {'is a copy' if len(copies) == 1 else 'are copies'}"
        )


# Part of a record that is compared with others [s].
_LONGEST_COMPARED = 3600.0


def _on_step(motion: GroundMotion) -> Floats:
    """Accelerations every 10 ms: means of finer samples, straight lines between coarser ones."""
    time = np.arange(0.0, min(motion.duration, _LONGEST_COMPARED), _COMPARED_STEP)
    if motion.dt >= 0.999 * _COMPARED_STEP:
        acceleration = np.interp(time, motion.time, motion.acceleration)
    else:
        # The mean over a step is a difference of the velocity.
        edges = np.append(time, time[-1] + _COMPARED_STEP) - 0.5 * _COMPARED_STEP
        acceleration = np.diff(np.interp(edges, motion.time, motion.velocity)) / _COMPARED_STEP
    return np.asarray(acceleration, dtype=np.float64)


def _largest_correlation(one: Floats, other: Floats) -> float:
    # Samples of `one` from k on overlap samples of `other` from the start, for shifts k from -(m - 1) to n - 1.
    n, m = one.size, other.size
    size = 1 << (n + m - 1).bit_length()
    spectrum = np.fft.rfft(one, size) * np.conj(np.fft.rfft(other, size))
    products = np.roll(np.fft.irfft(spectrum, size), m - 1)[: n + m - 1]
    shifts = np.arange(-(m - 1), n)
    first, last = np.maximum(shifts, 0), np.minimum(shifts + m, n)
    energy = [np.concatenate(([0.0], np.cumsum(signal * signal))) for signal in (one, other)]
    within = [energy[0][last] - energy[0][first], energy[1][last - shifts] - energy[1][first - shifts]]
    if energy[0][-1] == 0.0 or energy[1][-1] == 0.0:
        return 0.0
    shares = np.stack([part / total[-1] for part, total in zip(within, energy, strict=True)])
    whole = (shares.max(axis=0) >= _MOST_ENERGY) & (shares.min(axis=0) >= _LEAST)
    if not whole.any():
        return 0.0
    correlations = np.abs(products[whole]) / np.sqrt(within[0][whole] * within[1][whole])
    return min(1.0, float(correlations.max()))


@checked
def scaled(motion: GroundMotion, factor: float) -> GroundMotion:
    """Multiply the acceleration of a motion by `factor`."""
    if factor == 0.0:
        raise SettingError(f"ground motion {motion.name}: scaled by 0; give another factor")
    scales = "forces" if motion.forces.size and not motion.peak else "acceleration"
    scales += " and forces" * bool(motion.forces.size and motion.peak)
    change, forces = f"{scales} x {factor:.6g}", factor * motion.forces
    return replace_samples(motion, factor * motion.acceleration, motion.dt, change, forces=forces)


@checked
def scaled_to_peak(motion: GroundMotion, peak: float) -> GroundMotion:
    """Scale a motion to the peak ground acceleration `peak` [m/s^2]; a motion that is zero throughout is refused."""
    return scaled_level(motion, motion.peak, peak, "a peak")


def scaled_level(motion: GroundMotion, found: float, value: float, words: str) -> GroundMotion:
    """Scale a motion from the intensity `found`, called by these words, to another value [m/s^2]."""
    refuse_forces(motion, words)
    if not value > 0.0:
        raise SettingError(
            f"ground motion {motion.name}: {words} of {value} m/s2 was requested; give a positive one"
        )
    if found == 0.0:
        raise SettingError(f"ground motion {motion.name}: is zero throughout and cannot be scaled to {words}")
    change = f"scaled from {words} of {found:.6g} to {value:.6g} m/s2"
    acceleration = motion.acceleration * (value / found)
    if not motion.is_road:
        refuse_absurd(acceleration, source=f"ground motion {motion.name} with {words} of {value:.6g} m/s2")
    return replace_samples(motion, acceleration, motion.dt, change)


@checked
def time_scaled(motion: GroundMotion, factor: Positive) -> GroundMotion:
    """Multiply the time axis of a motion by `factor`: 0.2 makes it five times as fast.

    Accelerations do not change, as similitude requires for a model of length scale `factor` squared.

    Examples
    --------
    >>> from mrwork.motions.synthetic import synthetic_motion
    >>> time_scaled(synthetic_motion(), 0.2).changes[-1]
    'time axis x 0.2'
    """
    _refuse_road(motion, "another time axis changes the heights of a road")
    return replace_samples(motion, motion.acceleration, factor * motion.dt, f"time axis x {factor:.6g}")


@checked
def trimmed(motion: GroundMotion, *, start: float = 0.0, end: float = math.inf) -> GroundMotion:
    """Keep the samples from `start` to `end` [s], both included; an end after the last sample keeps the rest."""
    # A bound that is a multiple of the step up to rounding includes its sample.
    slack = 1e-6 * motion.dt
    first = max(0, math.ceil((min(start, motion.duration) - slack) / motion.dt)) if start > 0.0 else 0
    last = motion.n_time - 1
    if end < motion.duration:
        last = math.floor((max(end, 0.0) + slack) / motion.dt)
    if not (last > first):
        raise SettingError(
            f"ground motion {motion.name}: from {start:g} to {end:g} s it has fewer than two samples; "
            f"it lasts {motion.duration:g} s"
        )
    if (first, last) == (0, motion.n_time - 1):
        return motion
    if first:
        _refuse_road(motion, "a road begins level, and the part from a later start would be tilted")
    change = f"cut to {first * motion.dt:.6g} to {last * motion.dt:.6g} s"
    kept = slice(first, last + 1)
    acceleration, forces = motion.acceleration[kept].copy(), motion.forces[:, kept].copy()
    return replace_samples(motion, acceleration, motion.dt, change, forces=forces)


# Of a motion, and bytes of each in the arrays of a Fourier transform.
_MOST_SAMPLES = 4_000_000
_BYTES = 48
# Error of the velocity over its largest, up to 0.27 for a measured record of which every second sample is taken.
_LOST = 0.3


def check_samples(duration: float, dt: float) -> None:
    """Refuse a motion that would not fit into memory."""
    if duration / dt > _MOST_SAMPLES:
        raise SettingError(
            f"a motion of {duration:g} s every {dt:g} s would have {duration / dt:.3g} samples and take "
            f"{_BYTES * duration / dt / 1e9:.3g} GB; give a shorter duration, or a longer step"
        )


@checked
def resampled(motion: GroundMotion, dt: float) -> GroundMotion:
    """Resample a motion every `dt` [s] by linear interpolation, as simulations interpolate it.

    A finer grid that contains the old samples gives the same motion. A coarser grid aliases frequencies above half its
    rate, with a warning where the velocity changes by it. A remainder of less than a step at the end is dropped.
    """
    if not (0.0 < dt <= motion.duration * (1.0 + 1e-9)):
        raise SettingError(
            f"ground motion {motion.name}: resampled every {dt} s; give a positive step up to its {motion.duration:g} s"
        )
    check_samples(motion.duration, dt)
    n_time = math.floor(motion.duration / dt * (1.0 + 1e-12) + 1e-9) + 1
    at, time = dt * np.arange(n_time), motion.time
    forces = np.array([np.interp(at, time, force) for force in motion.forces])
    result = replace_samples(
        motion,
        np.interp(at, time, motion.acceleration),
        dt,
        f"resampled from {motion.dt:.6g} to {dt:.6g} s, straight between",
        forces=forces,
    )
    off = np.abs(result.velocity - np.interp(result.time, motion.time, motion.velocity)).max()
    if off > _LOST * np.abs(motion.velocity).max():
        warnings.warn(
            f"ground motion {motion.name}: resampled every {dt:g} s its velocity is off by up to {off:.3g} m/s, since "
            f"what lies between the new samples is lost; simulate it every {motion.dt:g} s, without `resample`",
            MrworkWarning,
            stacklevel=3,
        )
    if not forces.size:
        return result
    lost = np.array([np.interp(time, at, force) for force in forces]) - motion.forces
    swing = motion.forces - motion.forces.mean(axis=1, keepdims=True)
    impulses = [float(np.abs(np.cumsum(each, axis=1)).max()) for each in (lost, swing)]
    if impulses[0] > _LOST * impulses[1]:
        warnings.warn(
            f"motion {motion.name}: resampled every {dt:g} s the impulse of its forces is off by up to "
            f"{100.0 * impulses[0] / impulses[1]:.3g} % of its swing, since what lies between the new samples is lost; "
            f"simulate it every {motion.dt:g} s, without `resample`",
            MrworkWarning,
            stacklevel=3,
        )
    return result


HIGHEST_ORDER = 10
"""Highest order of the polynomial of a baseline."""


@checked
def baseline_corrected(motion: GroundMotion, *, order: int) -> GroundMotion:
    """Subtract the best-fitting polynomial from the acceleration of a motion.

    Parameters
    ----------
    order
        Order of the polynomial, 0 to 10, fitted to the acceleration by least squares: 0 removes the mean, 1 a straight
        line. The corresponding drift of the velocity is one order higher.
    """
    refuse_forces(motion, "a baseline")
    _refuse_road(motion, "heights of a road have no drift of a baseline")
    highest = min(HIGHEST_ORDER, motion.n_time - 2)
    if not 0 <= order <= highest:
        raise SettingError(f"ground motion {motion.name}: baseline of order {order}; give 0 to {highest}")
    # Legendre polynomials on [-1, 1] keep the fit well conditioned where powers of seconds do not.
    at = np.linspace(-1.0, 1.0, motion.n_time)
    drift = np.asarray(Legendre.fit(at, motion.acceleration, order)(at), dtype=np.float64)
    change = f"baseline of order {order} taken from the acceleration, up to {np.abs(drift).max():.3g} m/s2"
    return replace_samples(motion, motion.acceleration - drift, motion.dt, change)


def brought_to_rest(motion: GroundMotion) -> GroundMotion:
    """Bring a motion to rest at its end by `sin^2(pi t / T) (a + b t)` in the acceleration, over its length T."""
    if motion.n_time < 5:
        raise SettingError(
            f"ground motion {motion.name}: {motion.n_time} samples cannot be brought to rest; give five or more"
        )
    at = np.linspace(-1.0, 1.0, motion.n_time)
    bell = np.cos(0.5 * np.pi * at) ** 2
    shapes = (bell, bell * at)
    shaped = [replace(motion, acceleration=shape) for shape in shapes]
    system = np.array(
        [[float(one.velocity[-1]) for one in shaped], [float(one.displacement[-1]) for one in shaped]]
    )
    weights = np.linalg.solve(system, [motion.velocity[-1], motion.displacement[-1]])
    drift = weights[0] * shapes[0] + weights[1] * shapes[1]
    change = f"brought to rest at its end, by up to {np.abs(drift).max():.3g} m/s2"
    return replace_samples(motion, motion.acceleration - drift, motion.dt, change)
