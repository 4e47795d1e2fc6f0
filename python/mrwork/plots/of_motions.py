"""Figures of ground motions: response spectra."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import ArrayLike

from mrwork.arguments import checked
from mrwork.errors import SettingError
from mrwork.labelled import NamedArray, NamedArrays, labels_of
from mrwork.motions.ground_motion import GroundMotion
from mrwork.motions.spectrum import ResponseSpectrum, response_spectrum
from mrwork.plots.sheet import add_key, axes_for, shown_unit_of
from mrwork.report import style
from mrwork.report.study.figures import HUES

if TYPE_CHECKING:
    from mrwork.labelled import DataFrame

SpectrumQuantity = Literal[
    "pseudo_acceleration", "pseudo_velocity", "acceleration", "velocity", "displacement"
]

_UNITS: dict[SpectrumQuantity, str] = {
    "pseudo_acceleration": "m/s^2",
    "pseudo_velocity": "m/s",
    "acceleration": "m/s^2",
    "velocity": "m/s",
    "displacement": "m",
}
# Periods of most buildings [s].
_PERIODS = (0.05, 4.0, 120)


@overload
def spectra(
    result: GroundMotion | ResponseSpectrum,
    ax: Axes | None = None,
    *,
    quantity: SpectrumQuantity = "pseudo_acceleration",
    periods: ArrayLike | None = None,
    damping: float | None = None,
    data: Literal[False] = False,
) -> Axes: ...
@overload
def spectra(
    result: GroundMotion | ResponseSpectrum,
    ax: Axes | None = None,
    *,
    quantity: SpectrumQuantity = "pseudo_acceleration",
    periods: ArrayLike | None = None,
    damping: float | None = None,
    data: Literal[True],
) -> DataFrame: ...
@checked
@style.drawn_in_style()
def spectra(
    result: GroundMotion | ResponseSpectrum,
    ax: Axes | None = None,
    *,
    quantity: SpectrumQuantity = "pseudo_acceleration",
    periods: ArrayLike | None = None,
    damping: float | None = None,
    data: bool = False,
) -> Axes | DataFrame:
    """Response spectrum over the period; several motions are drawn one after the other into the same axes.

    Parameters
    ----------
    result
        A motion, or a spectrum of one.
    ax
        Axes to draw into; by default those of a new figure.
    quantity
        Ordinate.
    periods, damping
        Of the spectrum of a motion [s, 1]; by default from 0.05 to 4 s at 5 % damping.
    data
        Whether to return the table behind the figure instead, with all quantities.

    Raises
    ------
    SettingError
        As `mr.response_spectrum`; also if periods or damping are given for a spectrum, which has its own.

    Examples
    --------
    >>> import mrwork as mr
    >>> motion = mr.synthetic_motion(duration=5.0)
    >>> motion.plot.spectra(data=True, periods=[0.5, 1.0]).index.tolist()
    [0.5, 1.0]
    """
    if isinstance(result, GroundMotion):
        label = result.name
        shares = np.geomspace(*_PERIODS) if periods is None else periods
        spectrum = response_spectrum(result, shares, damping=0.05 if damping is None else damping)
    elif periods is None and damping is None:
        label, spectrum = f"{100.0 * result.damping:g} % damping", result
    else:
        raise SettingError("a spectrum has its own periods and damping; leave both out, or give the motion")
    if data:
        return NamedArrays(
            title=f"Response spectrum at {100.0 * spectrum.damping:g} % damping",
            rows=("period",),
            labels={"period": labels_of(spectrum.periods, unit="s", long_name="period")},
            arrays={
                name: NamedArray.of(
                    getattr(spectrum, name), "period", unit=unit, long_name=f"peak {name.replace('_', '-')}"
                )
                for name, unit in _UNITS.items()
            },
        ).to_pandas()
    axes, values = axes_for(ax), getattr(spectrum, quantity)
    unit = shown_unit_of(_UNITS[quantity], float(values.max()))
    colour = HUES[len(axes.get_lines()) % len(HUES)]
    axes.plot(spectrum.periods, values * unit.factor, color=colour, linewidth=1.4, label=label)
    axes.set_xlabel("Period (s)")
    axes.set_ylabel(f"{quantity.replace('_', '-').capitalize()} ({unit.symbol})")
    axes.set_ylim(bottom=0.0)
    add_key(axes)
    return axes
