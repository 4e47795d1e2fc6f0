"""Roads under a vehicle as ground motions: a profile of a file or of an ISO 8608 class, at a speed.

A road is the displacement of the ground under a tyre. Heights are sampled every `dt`, with the cubic spline between;
its second derivative is linear between samples, as a ground acceleration is.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Final, Literal, get_args
from warnings import warn

import numpy as np

from mrwork.base.arguments import Positive, Samples, Seed, checked
from mrwork.base.hints import InUnit, Says, Within
from mrwork.base.remark import warnings_of
from mrwork.base.summary import list_names
from mrwork.base.units import factor_of, factor_to_si
from mrwork.base.values import Floats
from mrwork.errors import MrworkWarning, RecordError, SettingError, UnitError
from mrwork.files.layout import numbered_names
from mrwork.files.named_columns import ColumnTable, find_column, unit_in_name, words_and_unit
from mrwork.files.open_table import open_table
from mrwork.files.rounded_times import regular_steps, rounded_grid
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
# Spline through fewer samples has no end condition.
_FEWEST: Final = 4
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

    if heights.size < _FEWEST:
        raise RecordError(f"{name}: a road of {heights.size} heights; give {_FEWEST} or more")
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
    if duration < _FEWEST * dt:
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
    height = _height_column(table, column, str(path))
    along = _column_along(table, height, speed, dt, str(path))
    factor = _factor_of_heights(table, height, unit, str(path))
    heights = factor * _finite(table, height, "height", path)
    if along is not None:
        # Overflowing steps are refused as uneven.
        with np.errstate(over="ignore", invalid="ignore"):
            spacing = _spacing(_finite(table, along, "time or distance", path), table, path)
        dt = _factor_along(table, along) * spacing
    elif dt is None:
        raise SettingError(
            f"{path}: there is no column of distances or times beside '{height}'; give the time between two heights as "
            "`dt`"
        )
    at = "" if speed is None else f", {speed:g} m/s"
    source = f"'{height}' of {path.name}{at}"
    return road_motion(heights, dt / (speed or 1.0), name=path.stem, source=source)


def _is_time(name: str) -> bool:
    return unit_in_name("time", name) is not None


def _is_distance(name: str) -> bool:
    words, unit = words_and_unit(name)
    return words.strip(" _-").casefold() in _DISTANCES and factor_of(unit or "m", "displacement") is not None


def _height_column(table: ColumnTable, column: str | None, source: str) -> str:
    names = table.names
    if column is not None:
        return find_column(column, names, source)
    if names == numbered_names(len(names)):
        candidates: Sequence[str] = names[-1:] if len(names) <= 2 else names
    else:
        free = [name for name in names if not _is_time(name) and not _is_distance(name)]
        called = [
            name for name in free or names if words_and_unit(name)[0].strip(" _-").casefold() in _HEIGHTS
        ]
        candidates = called if len(called) == 1 else free
    if len(candidates) == 1:
        return candidates[0]
    listed = list_names([f"{number} '{name}'" for number, name in enumerate(names, start=1)], 12)
    raise RecordError(
        f"{source}: the file does not state which column is the height of the road ({listed}); give it as here: "
        f'column="{len(names)}"'
    )


def _column_along(
    table: ColumnTable, height: str, speed: float | None, dt: float | None, source: str
) -> str | None:
    """The column of distances where there is a speed, else that of times; `None` where `dt` takes its place."""
    others = [name for name in table.names if name != height]
    times, distances = [*filter(_is_time, others)], [*filter(_is_distance, others)]
    if table.names == numbered_names(len(table.names)) and others:
        if speed is None:
            raise RecordError(
                f"{source}: the file does not state whether column {others[0]} holds distances or times; give the "
                'speed, as speed = "72 km/h", for distances, or write names above, as time_s, height_mm'
            )
        times, distances = [], others
    if speed is not None and distances:
        along: str | None = distances[0]
    elif speed is not None:
        what = f"column '{times[0]}' holds times" if times else "there is no column of distances"
        cure = (
            "name that column as distance_m" if others else "leave it out, and give `dt` between two heights"
        )
        cure = "leave it out" if times else cure
        raise SettingError(f"{source}: {what}, and `speed` is for heights over distances; {cure}")
    elif times:
        along = times[0]
    elif distances:
        raise SettingError(
            f"{source}: column '{distances[0]}' holds distances, over which the vehicle has a speed; give it, as "
            'speed = "72 km/h"'
        )
    else:
        along = None
    if along is not None and dt is not None:
        raise SettingError(f"{source}: column '{along}' says where the heights are; leave out `dt`")
    return along


def _factor_along(table: ColumnTable, along: str) -> float:
    if _is_time(along):
        unit = unit_in_name("time", along) or table.units.get(along, "") or "s"
        return factor_to_si(unit, "time", context=f"column '{along}'")
    unit = words_and_unit(along)[1] or table.units.get(along, "") or "m"
    return factor_to_si(unit, "displacement", context=f"column '{along}'")


def _factor_of_heights(table: ColumnTable, height: str, unit: str | None, source: str) -> float:
    own = words_and_unit(height)[1] or table.units.get(height, "")
    if own and factor_of(own, "acceleration") is not None:
        raise SettingError(
            f"{source}: column '{height}' is an acceleration [{own}], and a road is its heights; give it as file"
        )
    stated = factor_of(own, "displacement")
    if unit is None and stated is None:
        raise UnitError(
            f'{source}: the file does not state the unit of its heights; give it as here: unit="mm"'
        )
    if unit is None:
        return stated or 1.0
    factor = factor_to_si(unit, "displacement", context=f"{source}: `unit`")
    if stated is not None and factor != stated:
        raise SettingError(f"{source}: `unit` is '{unit}' where column '{height}' states {own}; leave it out")
    return factor


def _finite(table: ColumnTable, name: str, what: str, path: Path) -> Floats:
    values = table.read([name])[name]
    wrong = np.flatnonzero(~np.isfinite(values))
    if wrong.size:
        where = f"{path}: {table.locate(int(wrong[0]))}"
        raise RecordError(f"{where}: the {what} is no finite number; correct the value or delete the row")
    return values


def _spacing(along: Floats, table: ColumnTable, path: Path) -> float:
    """Spacing of distances or times, which increase in equal steps but for jitter and rounding."""
    wrong = np.flatnonzero(np.diff(along) <= 0.0)
    if wrong.size or along.size < _FEWEST:
        row = int(wrong[0]) + 1 if wrong.size else 0
        came = f"from {along[row - 1]:g} to {along[row]:g}" if row else f"over {along.size} rows"
        raise RecordError(
            f"{path}: {table.locate(row)}: the heights go {came}; give {_FEWEST} rows or more in rising order"
        )
    steps, median, regular = regular_steps(along)
    if not regular.all() and rounded_grid(along) is None:
        row = int(np.flatnonzero(~regular)[0]) + 1
        raise RecordError(
            f"{path}: {table.locate(row)}: a step of {steps[row - 1]:.4g} where others are {median:.4g}; give heights "
            "at equal steps"
        )
    return float(along[-1] - along[0]) / steps.size
