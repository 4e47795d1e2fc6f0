"""Roads under a vehicle as ground motions: a profile of a file or of an ISO 8608 class, at a speed.

A road is the displacement of the ground under a tyre. Heights are sampled every `dt`, with the cubic spline between;
its second derivative is linear between samples, as a ground acceleration is.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Final, Literal, get_args
from warnings import warn

import numpy as np

from mrwork.base.arguments import Positive, Samples, Seed, checked
from mrwork.base.hints import InUnit, Says, Within
from mrwork.base.remark import warnings_of
from mrwork.errors import MrworkWarning, RecordError, SettingError
from mrwork.files.grid import grid
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import ColumnTable, words_and_unit
from mrwork.files.open_table import open_table
from mrwork.files.roles import TIME, Role, Series, Stated, series_of
from mrwork.motions.ground_motion import GroundMotion, check_samples

Speed = Annotated[float, Within(above=0.0), InUnit("m/s")]

RoadClass = Literal["A", "B", "C", "D", "E", "F", "G", "H"]
"""Class of ISO 8608: each is four times as rough in its spectral density as the one before."""

_DISTANCES: Final = frozenset({
    "distance", "dist", "s", "x", "station", "chainage", "position", "pos", "travel", "weg", "strecke",
    "distancia", "abscisse",
})  # fmt: skip
_HEIGHTS: Final = frozenset({
    "height", "elevation", "profile", "road", "z", "h", "u", "q", "displacement", "level", "höhe", "altura", "hauteur",
})  # fmt: skip


def _is_called(words: frozenset[str]) -> Callable[[str], bool]:
    return lambda name: words_and_unit(name)[0].strip(" _-").casefold() in words


DISTANCE: Final = Role(
    noun="distance", quantity="displacement", is_called=_is_called(_DISTANCES), example="m"
)
HEIGHT: Final = Role(
    noun="height",
    quantity="displacement",
    is_called=_is_called(_HEIGHTS),
    example="mm",
    elsewhere={"acceleration": "a road is its heights; give it as file"},
    any_name=True,
)
# Spline through fewer samples has no end condition.
_FEWEST_OF_SPLINE: Final = 4
# Of the classes: the density of class A at the reference frequency [m3], and the band [cycles/m].
_DENSITY_OF_A, _REFERENCE, _LOWEST, _HIGHEST = 16e-6, 0.1, 0.01, 2.83
# Length that is drawn at least [m], ten of the longest waves, so that a short road begins anywhere in them.
_LONGEST_WAVES: Final = 10.0 / _LOWEST
# Time in which a computed road rises from level [s].
_FADE: Final = 1.0


@checked
def road_motion(
    heights: Samples, dt: Positive, *, name: str = "road", source: str = "a road"
) -> GroundMotion:
    """The ground motion of a road under a tyre: the second derivative of the spline through its heights.

    The cubic spline through the heights less the first has the slope zero at the start and a not-a-knot end (C. de
    Boor, A Practical Guide to Splines, 1978, chapter IV). Its second derivative is linear between samples. Coordinates
    of a building stay relative to the road, so that the drift of the row of a tyre is the deflection of the tyre.

    Parameters
    ----------
    heights
        Heights of the road [m], shape (n_time,), four or more; at a speed v a profile every d metres is one every d / v
        seconds.
    dt
        Time between two heights [s].

    Returns
    -------
    GroundMotion
        Its `displacement` are the heights less the first. `remarks` tell of kerbs, of a slope at the start and of steps
        too long for the hop of wheels; the size of its acceleration is not compared with earthquakes.

    Raises
    ------
    RecordError
        If there are fewer than four heights.

    Examples
    --------
    >>> import numpy as np
    >>> time = 0.001 * np.arange(2001)
    >>> bump = np.where(np.abs(time - 0.65) < 0.15, 0.025 * (1.0 + np.cos(2.0 * np.pi * (time - 0.65) / 0.3)), 0.0)
    >>> round(float(road_motion(bump, 0.001).displacement.max()), 6)
    0.05
    """
    from scipy.interpolate import CubicSpline  # slow to load

    if heights.size < _FEWEST_OF_SPLINE:
        raise RecordError(f"{name}: a road of {heights.size} heights; give {_FEWEST_OF_SPLINE} or more")
    time = dt * np.arange(heights.size, dtype=np.float64)
    spline = CubicSpline(time, heights - heights[0], bc_type=((1, np.zeros(())), "not-a-knot"))
    return GroundMotion(name=name, dt=dt, acceleration=spline(time, 2), source=source, is_road=True)


@checked
def iso_8608_road(
    road_class: Annotated[RoadClass, Says("class of the road, A to H; C is an average one")] = "C",
    *,
    speed: Speed,
    rng: np.random.Generator | Seed,
    duration: Positive = 30.0,
    dt: Positive = 0.001,
    name: str = "",
) -> GroundMotion:
    """A random road of a class of ISO 8608 at a speed, as a ground motion.

    Sines of random phases have the spectral density `4^k 16e-6 m3 (n / 0.1)^-2` over the spatial frequency n, k = 0 for
    class A to 7 for class H, from 0.01 to 2.83 cycles/m (ISO 8608:2016, geometric means of the classes). The road rises
    from level by `x^3 (10 - 15 x + 6 x^2)`, x = t / 1 s, in its first second.

    Parameters
    ----------
    speed
        Speed of the vehicle [m/s].
    rng
        Random generator, or its seed.
    duration, dt
        Length and step [s].

    Raises
    ------
    SettingError
        If the step is too long for the shortest waves at this speed.

    Examples
    --------
    >>> road = iso_8608_road("C", speed=20.0, rng=1, duration=10.0)
    >>> road.n_time, road.name
    (10001, 'ISO 8608 class C, 20 m/s')
    """
    if not speed * _HIGHEST * dt < 0.5:
        raise SettingError(
            f"at {speed:g} m/s a road has waves up to {speed * _HIGHEST:.3g} Hz, and samples every {dt:g} s hold "
            f"nothing above {0.5 / dt:g} Hz; give a `dt` below {0.5 / (speed * _HIGHEST):.2g} s"
        )
    if duration < _FEWEST_OF_SPLINE * dt:
        raise SettingError(
            f"a road of {duration:g} s every {dt:g} s; give a longer duration, or a shorter step"
        )
    n_time = round(duration / dt) + 1
    n_drawn = max(n_time, int(np.ceil(_LONGEST_WAVES / (speed * dt))))
    check_samples(n_drawn * dt, dt)
    frequency = np.fft.rfftfreq(n_drawn, speed * dt)
    inside = (frequency >= _LOWEST) & (frequency <= _HIGHEST)
    of_class = 4.0 ** get_args(RoadClass).index(road_class) * _DENSITY_OF_A
    density = of_class * (frequency[inside] / _REFERENCE) ** -2
    phases = np.random.default_rng(rng).uniform(0.0, 2.0 * np.pi, density.size)
    spectrum = np.zeros(frequency.size, dtype=np.complex128)
    spectrum[inside] = 0.5 * n_drawn * np.sqrt(2.0 * density * frequency[1]) * np.exp(1j * phases)
    x = np.minimum(dt * np.arange(n_time) / _FADE, 1.0)
    heights = np.fft.irfft(spectrum, n_drawn)[:n_time] * x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    title = f"ISO 8608 class {road_class}, {speed:g} m/s"
    drawn = f"seed {rng}" if isinstance(rng, int) else "a generator that was passed"
    return road_motion(heights, dt, name=name or title, source=f"{title}, {drawn}")


@checked
def read_road(
    path: str | os.PathLike[str],
    *,
    speed: Speed | None = None,
    unit: str | None = None,
    column: str | None = None,
    dt: Positive | None = None,
) -> GroundMotion:
    """Read a road: heights over distances, driven over at a speed, or over times.

    Parameters
    ----------
    path
        A text, .xlsx, .mat or .tdms file with a column of heights, and one of distances or times, evenly spaced.
    speed
        Speed of the vehicle [m/s]; needed over distances.
    unit
        Unit of the heights, where the file does not state it.
    column
        Column of the heights, by name or by number from 1, where it is not plain.
    dt
        Time between two heights [s], where the file has neither distances nor times.

    Raises
    ------
    RecordError, UnitError, SettingError
        If the file holds no road, does not say which column or unit is meant, or an option does not fit it.

    Examples
    --------
    >>> read_road("profile.csv", speed=20.0)  # doctest: +SKIP
    """
    road = road_of_file(Path(path), speed=speed, unit=unit, column=column, dt=dt)
    for sentence in warnings_of(road.remarks):
        warn(sentence, MrworkWarning, stacklevel=3)
    return road


def road_of_file(
    path: Path, *, speed: float | None, unit: str | None, column: str | None, dt: float | None
) -> GroundMotion:
    """The road of a file, without a word on its `remarks`."""
    table = open_table(path, lambda _: True)
    _refuse_axis(table, column, speed, str(path))
    series = series_of(
        table,
        HEIGHT,
        Stated(unit=unit, dt=dt, column=column),
        source=str(path),
        axis=TIME if speed is None else DISTANCE,
        choose=lambda names: _heights_among(names, table),
    )
    at = "" if speed is None else f", {speed:g} m/s"
    source = f"'{series.names[0]}' of {path.name}{at}"
    step = _spacing(series) if series.along is not None else series.dt
    assert step is not None
    return road_motion(series.samples[0], step / (speed or 1.0), name=path.stem, source=source)


def _refuse_axis(table: ColumnTable, column: str | None, speed: float | None, source: str) -> None:
    """Refuse a speed over times, and distances without a speed."""
    others = [name for name in table.names if name != column]
    times, distances = ([name for name in others if axis.is_called(name)] for axis in (TIME, DISTANCE))
    is_nameless = table.names == numbered_names(len(table.names))
    if speed is None and is_nameless and len(others) > 1:
        raise RecordError(
            f"{source}: the file does not state whether column {others[0]} holds distances or times; give the "
            'speed, as speed = "72 km/h", for distances, or write names above, as time_s, height_mm'
        )
    if speed is None and distances and not times:
        raise SettingError(
            f"{source}: column '{distances[0]}' holds distances, over which the vehicle has a speed; give it, as "
            'speed = "72 km/h"'
        )
    if speed is not None and not distances and (not is_nameless or len(table.names) == 1):
        what, cure = (
            "there is no column of distances",
            "name it distance_m, or leave `speed` out and give `dt`",
        )
        if times:
            what, cure = f"column '{times[0]}' holds times", "leave it out"
        raise SettingError(f"{source}: {what}, and `speed` is for heights over distances; {cure}")


def _heights_among(names: Sequence[str], table: ColumnTable) -> Sequence[str]:
    """The candidates: of two columns without names the last, and none that holds times or distances."""
    if table.names == numbered_names(len(table.names)):
        return names[-1:] if len(table.names) <= 2 else names
    return [name for name in names if not (TIME.is_called(name) or DISTANCE.is_called(name))] or names


def _spacing(series: Series) -> float:
    """Spacing of distances or times, which are in equal steps but for jitter and rounding."""
    assert series.along is not None
    along = grid(series.along)
    if along.uniform is None:
        row = int(np.flatnonzero(~along.regular)[0])
        raise RecordError(
            f"{series.where(row + 1)}: a step of {along.steps[row]:.4g} where others are {along.median:.4g}; give "
            "heights at equal steps"
        )
    return along.step
