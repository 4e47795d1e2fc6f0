"""Figures of Pareto fronts: of control laws, and of designs of dampers."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, overload

import numpy as np
from matplotlib.axes import Axes

from mrwork.arguments import checked
from mrwork.closed_loop.evaluation import criterion
from mrwork.dampers.design.sizing import SizeFront
from mrwork.errors import SettingError
from mrwork.labelled import NamedArray, NamedArrays, number_labels
from mrwork.plots.sheet import add_key, axes_for, chosen
from mrwork.report import style
from mrwork.report.canvas import draw_points
from mrwork.report.study.tuning_page import add_front
from mrwork.tuning.results import Front, TuningResults

if TYPE_CHECKING:
    from mrwork.labelled import DataFrame


@overload
def fronts(
    result: Front | TuningResults | SizeFront,
    ax: Axes | None = None,
    *,
    law: str | int | None = None,
    data: Literal[False] = False,
) -> Axes: ...
@overload
def fronts(
    result: Front | TuningResults | SizeFront,
    ax: Axes | None = None,
    *,
    law: str | int | None = None,
    data: Literal[True],
) -> DataFrame: ...
@checked
@style.drawn_in_style()
def fronts(
    result: Front | TuningResults | SizeFront,
    ax: Axes | None = None,
    *,
    law: str | int | None = None,
    data: bool = False,
) -> Axes | DataFrame:
    """Points of a front: the first two objectives of a law, or volume and dynamic range of dampers.

    Parameters
    ----------
    result
        A front, or a tuning with fronts.
    ax
        Axes to draw into; by default those of a new figure.
    law
        Label or number of the front of a tuning, by default the first.
    data
        Whether to return the table behind the figure instead.

    Raises
    ------
    SettingError
        If a tuning has no front, or not that of this law.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.tune(study).plot.fronts()  # doctest: +SKIP
    """
    if isinstance(result, SizeFront):
        return _designs(result, ax, data=data)
    if isinstance(result, TuningResults):
        if not result.fronts:
            raise SettingError(
                f"the tuning {result.title!r} has no front; give two `objectives` or more in its table [[tune]]"
            )
        result = result.fronts[chosen(law, [each.label for each in result.fronts], "law")]
    if data:
        return result.to_pandas()
    axes = axes_for(ax)
    add_front(axes, result)
    first, second = (criterion(name).title for name in result.objectives[:2])
    axes.set_xlabel(f"{first} over i = 0")
    axes.set_ylabel(f"{second} over i = 0")
    add_key(axes)
    return axes


def _designs(front: SizeFront, ax: Axes | None, *, data: bool) -> Axes | DataFrame:
    columns = {
        name: (np.array([getattr(each, name) for each in front.designs]), unit, words)
        for name, unit, words in (
            ("envelope_volume", "m^3", "volume of the envelope"),
            ("dynamic_range", "1", "dynamic range"),
            ("power", "W", "power"),
        )
    }
    if data:
        return NamedArrays(
            title="Front of dampers",
            rows=("design",),
            labels={"design": number_labels(len(front.designs))},
            arrays={
                name: NamedArray.of(values, "design", unit=unit, long_name=words)
                for name, (values, unit, words) in columns.items()
            },
        ).to_pandas()
    axes = axes_for(ax)
    volume, dynamic_range = columns["envelope_volume"][0], columns["dynamic_range"][0]
    draw_points(axes, 1e3 * volume, dynamic_range, size=4.5, colour=style.MODEL)
    axes.set_xlabel("Volume (l)")
    axes.set_ylabel("Dynamic range")
    return axes
