"""Figures of studies and tunings: profiles over the height, energies, fragilities and fronts."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_hex

from mrwork.base.keys import check_known
from mrwork.base.units import STANDARD_GRAVITY
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import criterion
from mrwork.closed_loop.responses import History, Responses, quantity_named, run_quantities
from mrwork.errors import SettingError
from mrwork.plots import style
from mrwork.plots.canvas import vertical_grid
from mrwork.plots.sheet import (
    Ax,
    GivenAxes,
    Legend,
    Panels,
    all_chosen,
    axes_for,
    chosen_number,
    figure,
    finished,
    panels_for,
    shown_unit_of,
)
from mrwork.plots.style import DisplayUnit, with_unit
from mrwork.study.fragilities import Fragilities
from mrwork.study.least_counts import DamperCounts
from mrwork.study.results import StudyResults
from mrwork.tuning.judging import TunedStudy
from mrwork.tuning.tuned_laws import Front, TuningResults

_NONE_FINISHED = "none of these runs finished, and there is nothing to draw; see `outcome`"
RATIO = "peak_drift_ratio"
MARKERS = ("o", "s", "^", "D", "v", "P")
_DOTTED, _DASHED = (0, (1.2, 1.6)), (0, (5, 2))


@dataclass(frozen=True, slots=True)
class Stroke:
    """Colour, pattern, width [pt] and marker of the lines of a row."""

    colour: str
    pattern: str | tuple[int, tuple[float, ...]] = "-"
    width: float = 1.4
    marker: str = "o"

    @property
    def marked(self) -> dict[str, Any]:
        """Arguments of a line of Matplotlib with markers."""
        line = {"color": self.colour, "linestyle": self.pattern, "linewidth": self.width}
        return {**line, "marker": self.marker}


def strokes(
    results: StudyResults | Fragilities | DamperCounts, coloured: Collection[int] | None = None
) -> tuple[Stroke, ...]:
    """The stroke of each row: dark tones and grey for references, a hue for each of six others, thin grey for more.

    Of the others those in `coloured` have hues, in its order; by default the first.
    """
    references = {
        "uncontrolled": Stroke(colour=style.DATA, pattern=_DOTTED, width=1.7),
        "passive_off": Stroke(colour=style.FAINT_INK, pattern=_DASHED, width=1.3),
        "best_passive": Stroke(colour=style.INK, width=1.6),
        "best_passive_by_group": Stroke(colour=style.INK, pattern=_DASHED, width=1.6),
    }
    kinds = [
        row.kind for row in (results.rows.values() if isinstance(results, Fragilities) else results.rows)
    ]
    rows = range(len(kinds)) if coloured is None else coloured
    others = [row for row in rows if kinds[row] not in references]
    named = (Stroke(hue, marker=marker) for hue, marker in zip(style.HUES, MARKERS, strict=True))
    hues = dict(zip(others, named, strict=False))
    return tuple(references.get(kind) or hues.get(number, _OTHER) for number, kind in enumerate(kinds))


_OTHER = Stroke(colour=style.DATA, width=0.6, marker="")


def short(text: str, most: int) -> str:
    """A label of at most `most` characters."""
    return text if len(text) <= most else f"{text[: most - 1]}…"


@figure
def storey_profiles(
    result: Responses | StudyResults,
    ax: Ax = None,
    *,
    quantity: str = "peak_drift",
    motion: str | int | None = None,
    rows: Sequence[str | int] = (),
    behind: Sequence[str | int] = (),
    legend: Legend = True,
) -> Axes:
    """A quantity of storeys or floors over the height, a line for each row or candidate that finished.

    Parameters
    ----------
    result
        Runs of a batch, of which the first draw is shown, or of a study, also where `mr.load` has read it.
    quantity
        Quantity of a run that storeys or floors have, such as "peak_drift" or "peak_acceleration"; of a study whose
        building has heights also "peak_drift_ratio", with its limit dashed.
    motion
        Name or number of the ground motion; by default the first of a batch, and of a study the mean over the motions
        on which it is judged, with the range of the first row shaded.
    rows
        Labels or numbers of rows of a study, or numbers of candidates, the first in front; by default all. More than
        eight are drawn in tones from light to dark.
    behind
        Rows of a study that are drawn behind, in thin grey.

    Examples
    --------
    >>> import mrwork as mr
    >>> responses = mr.simulate_loop(frame, dampers, law, motions)  # doctest: +SKIP
    >>> axes = responses.plot.storey_profiles(rows=[0, 5])  # doctest: +SKIP
    """
    choices = [quantity.name for quantity in run_quantities() if quantity.axis in ("storey", "floor")]
    facts = result.building if isinstance(result, StudyResults) else None
    if facts is not None and facts.has_ratios:
        choices.append(RATIO)
    check_known(quantity, choices, f"storeys and floors have no quantity {quantity!r}", otherwise="they have")
    base = "peak_drift" if quantity == RATIO else quantity
    (axis,) = quantity_named(base).own_axes
    if isinstance(result, StudyResults):
        names = result.quantities.axes[axis]
        lines = _lines_of_study(result, base, motion, rows, behind)
    else:
        runs = _runs(result, motion, rows)
        lines = [
            (label, numbers[base][None], _stroke(number, len(runs)))
            for number, (label, numbers) in enumerate(runs.items())
        ]
        names = tuple(f"{axis} {number}" for number in range(1, 1 + lines[0][1].shape[1]))
    factor: Floats | float
    if quantity == RATIO and facts is not None:
        factor, symbol = 100.0 / np.array(facts.heights), "%"
    else:
        unit = shown_unit_of(
            quantity_named(quantity).unit, max(float(values.max()) for _, values, _ in lines)
        )
        factor, symbol = unit.factor, unit.symbol
    words = quantity.replace("storey_", "") if facts is not None and facts.parts else quantity
    axes, heights = axes_for(ax), np.arange(1, len(names) + 1)
    for number, (label, values, stroke) in enumerate(lines):
        order = 3.0 - number / len(lines)
        means = factor * values.mean(axis=0)
        axes.plot(means, heights, label=label, markersize=3.2, zorder=order, **stroke.marked)
    first = factor * lines[0][1]
    if len(first) > 1:
        ends = first.min(axis=0), first.max(axis=0)
        axes.fill_betweenx(heights, *ends, color=style.BAND, linewidth=0.0, zorder=0.5)
    if quantity == RATIO and facts is not None and facts.drift_limit:
        axes.axvline(100.0 * facts.drift_limit, color=style.INK, linestyle=style.DASHED, linewidth=0.9)
    axes.set_xlim(left=0.0)
    name_heights(axes, names)
    return finished(
        axes,
        with_unit(words.replace("_", " ").capitalize(), symbol),
        "",
        legend=legend and len(lines) <= len(style.HUES),
    )


def _lines_of_study(
    results: StudyResults,
    quantity: str,
    motion: str | int | None,
    rows: Sequence[str | int],
    behind: Sequence[str | int],
) -> list[tuple[str, Floats, Stroke]]:
    """Rows that finished under a motion, else under all judged ones: label, values (n_motions, n_heights), stroke."""
    labels = [row.label for row in results.rows]
    motions = (
        results.judged_motions
        if motion is None
        else (chosen_number(motion, results.motions.names, "motion"),)
    )
    others = all_chosen(behind, labels, "row") if behind else []
    first = [row for row in all_chosen(rows, labels, "row") if rows or row not in others]
    of_row = strokes(results, first)
    finished = set(range(len(labels))).intersection(*(results.finished_rows(motion) for motion in motions))
    lines = [
        (labels[row], results.quantities.numbers[quantity][row, list(motions), 0], of_row[row])
        for row in (*first, *others)
        if row in finished
    ]
    if not lines:
        raise SettingError(_NONE_FINISHED)
    return lines


def name_heights(axes: Axes, names: Sequence[str], *, numbers: bool = False) -> None:
    """Names of storeys or floors at their numbers on the ordinate, or these numbers alone."""
    # Of many floors only every second, fifth or tenth is labelled.
    room = 8 if numbers else 14
    step = next(step for step in (1, 2, 5, 10, 20) if len(names) <= room * step or step == 20)
    places = [n for n in range(1, len(names) + 1) if step == 1 or n % step == 0]
    axes.set_yticks(places, [str(n) if numbers else short(names[n - 1], 13) for n in places])
    axes.set_ylim(0.6, len(names) + 0.4)


ENERGY_PARTS = {"Dampers": style.MODEL, "Structure": style.BAND_EDGE, "Still moving": style.DATA}
"""Where the input energy is at the end of a motion, with the tones."""
# Bars that fit into a figure, and samples of a course.
_MOST_BARS, _COURSE_SAMPLES = 60, 350


@figure
def energies(
    result: Responses | StudyResults | History,
    ax: Ax = None,
    *,
    motion: str | int | None = None,
    rows: Sequence[str | int] = (),
    legend: Legend = True,
) -> Axes:
    """Input energy and its distribution: a bar for each run at the end of the motion, or the course of one run.

    Of a history, what dampers and structure have not dissipated is still moving: kinetic and strain energy; all
    elements of its building count as dampers, storeys that yield among them.

    Parameters
    ----------
    result, motion, rows
        As in `storey_profiles`; also the history of a run, which has neither motions nor rows.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.run_study(study).plot.energies()  # doctest: +SKIP
    """
    if isinstance(result, History):
        return _course(result, ax, legend=legend)
    runs = _runs(result, motion, rows)
    parts = np.array([energy_parts(run) for run in runs.values()])
    if len(runs) > _MOST_BARS:
        raise SettingError(
            f"there are {len(runs)} runs, and {_MOST_BARS} bars can be read; choose some by `rows`"
        )
    axes = axes_for(ax, rows=len(runs))
    rising = parts[::-1]
    unit = shown_unit_of("J", float(np.abs(rising).sum(axis=1).max(initial=0.0)))
    ends, places = np.zeros(len(runs)), range(len(runs))
    for amounts, (label, tone) in zip(unit.factor * rising.T, ENERGY_PARTS.items(), strict=True):
        axes.barh(places, amounts, left=ends, height=0.62, color=tone, label=label)
        ends = ends + amounts
    axes.set_yticks(places, [*reversed(runs)])
    axes.set_xlim(0.0, 1.02 * float(ends.max(initial=0.0)) or 1.0)
    vertical_grid(axes)
    return finished(axes, f"Energy ({unit.symbol})", "", legend=legend)


def energy_parts(numbers: Mapping[str, Any]) -> tuple[float, float, float]:
    """The energy of each of `ENERGY_PARTS` at the end of a run, of which these are the quantities [J].

    What is not in the devices and does not move is in the structure: its damping, and its storeys that yield.
    """
    devices = np.nansum(numbers["device_energy"])
    if "element_energy" in numbers:
        # The elements of `Responses` are the passive devices and the storeys that yield.
        devices += np.sum(numbers["element_energy"]) - np.nansum(numbers["storey_energy"])
    moving = numbers["kinetic_energy"] + numbers["strain_energy"]
    return float(devices), float(numbers["input_energy"] - devices - moving), float(moving)


def _course(history: History, ax: Axes | None, *, legend: bool) -> Axes:
    """The energy that was given, cumulative over time, above its `ENERGY_PARTS`."""
    numbers: Mapping[str, Floats] = history.numbers
    total, damping = numbers["input_energy"], numbers["damping_energy"]
    devices = numbers["device_energy"].sum(axis=1) + numbers["element_energy"].sum(axis=1)
    unit = shown_unit_of("J", float(np.abs(total).max(initial=0.0)))
    every = slice(None, None, max(1, len(total) // _COURSE_SAMPLES))
    time, total, devices, damping = (
        history.time[every],
        *(unit.factor * energy[every] for energy in (total, devices, damping)),
    )
    parts, axes = (devices, damping, total - devices - damping), axes_for(ax)
    axes.stackplot(time, *parts, colors=[*ENERGY_PARTS.values()], labels=[*ENERGY_PARTS], linewidth=0.0)
    axes.plot(time, total, color=style.INK, linewidth=0.9, label="Input")
    # An actuator may supply energy; the energy that it takes up is then negative.
    axes.set_ylim(0.0, 1.05 * max(float(total.max()), float((devices + damping).max()), 1e-9))
    axes.margins(x=0.0)
    return finished(axes, "Time (s)", f"Energy ({unit.symbol})", legend=legend)


def _runs(
    result: Responses | StudyResults, motion: str | int | None, rows: Sequence[str | int]
) -> dict[str, Mapping[str, Any]]:
    """Quantities of the runs of these rows or candidates under a motion that finished, by their labels."""
    if isinstance(result, StudyResults):
        index = chosen_number(motion, result.motions.names, "motion")
        labels = [row.label for row in result.rows]
        numbers = {row: result.quantities.at(row, index) for row in result.finished_rows(index)}
    else:
        n_candidates, n_motions, n_draws = result.shape
        names = result.motions if len(result.motions) == n_motions else [str(n) for n in range(n_motions)]
        index = chosen_number(motion, names, "motion")
        labels = [f"candidate {number}" for number in range(n_candidates)]
        at = [(number * n_motions + index) * n_draws for number in range(n_candidates)]
        numbers = {
            number: {name: values[run] for name, values in result.numbers.items()}
            for number, run in enumerate(at)
            if np.isfinite(result.energy_error[run])
        }
    runs = {labels[row]: numbers[row] for row in all_chosen(rows, labels, "row") if row in numbers}
    if not runs:
        raise SettingError(_NONE_FINISHED)
    return runs


def _stroke(number: int, count: int) -> Stroke:
    """A hue for each of a few candidates; of many a tone, and thin lines."""
    if count <= len(style.HUES):
        return Stroke(style.hue(number), marker=MARKERS[number])
    return Stroke(to_hex(style.TONES(number / (count - 1))), width=0.6)


@figure
def fronts(
    result: Front | TuningResults | TunedStudy,
    ax: Ax = None,
    *,
    law: str | int | None = None,
    legend: Legend = True,
) -> Axes:
    """Points of a front: the first two objectives of a law.

    Parameters
    ----------
    result
        A front, or a tuning with fronts.
    law
        Label or number of the front of a tuning, by default the first.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.tune(study).plot.fronts()  # doctest: +SKIP
    """
    if isinstance(result, TunedStudy):
        result = result.tuned
    if isinstance(result, TuningResults):
        if not result.fronts:
            raise SettingError(
                f"the tuning {result.title!r} has no front; give two `objectives` or more in its table [[tune]]"
            )
        result = result.fronts[chosen_number(law, [front.label for front in result.fronts], "law")]
    axes, (first, second) = axes_for(ax), result.objectives[:2]
    for label, colour, marker, points in (
        ("training", style.FAINT_INK, "o-", [point.train for point in result.points]),
        ("test", style.MODEL, "o", [point.test for point in result.points if point.test is not None]),
    ):
        if points:
            drawn = np.array(sorted(((point[first], point[second]) for point in points), key=itemgetter(0))).T
            axes.plot(*drawn, marker, markersize=4, color=colour, label=label)
    names = (f"{criterion(name).title} over i = 0" for name in (first, second))
    return finished(axes, *names, legend=legend)


# Panels of incremental dynamic analyses that can be read.
_MOST_PANELS = 6
# Shares of the records in an incremental dynamic analysis, and how far beyond the limit responses are drawn.
_SHARES, _BEYOND = (0.16, 0.5, 0.84), 3.0
_CURVE_POINTS = 120


def _unit_of_limit(result: Fragilities | DamperCounts) -> DisplayUnit:
    if criterion(result.criterion).scale == "height":
        return DisplayUnit(symbol="%", factor=100.0)
    return shown_unit_of(result.unit, result.limit)


@figure
def ida(result: Fragilities, ax: GivenAxes = None, *, rows: Sequence[str | int] = ()) -> Panels:
    """Incremental dynamic analysis: intensity over the criterion of the limit, a panel for each arrangement.

    A thin line for each record, thick ones below which 16, 50 and 84 % of the records lie, and the limit dashed. A line
    ends where the record's run diverged or could not be resolved.

    Parameters
    ----------
    result
        What `mr.fragility` has found, of a study with records at several levels.
    ax
        Axes to draw into, as many as there are panels; by default a new figure's.
    rows
        Labels or numbers of arrangements; by default the first six.

    Examples
    --------
    >>> import mrwork as mr
    >>> found = mr.fragility(results, limit={"peak_drift_ratio": "1 %"})  # doctest: +SKIP
    >>> panels = found.plot.ida(rows=["uncontrolled", "Passive-on"])  # doctest: +SKIP
    """
    labels = [*result.rows]
    unit = _unit_of_limit(result)
    drawn = all_chosen(rows or range(min(len(labels), _MOST_PANELS)), labels, "arrangement")
    panels = panels_for(ax, len(drawn), "ida")
    every = unit.factor * np.concatenate([row.responses for row in result.rows.values()])
    largest, limit = every[np.isfinite(every)].max(initial=0.0), unit.factor * result.limit
    for axes, row in zip(panels, drawn, strict=True):
        one = result[labels[row]]
        levels = np.concatenate([[0.0], one.levels]) / STANDARD_GRAVITY
        responses = unit.factor * np.pad(one.responses, ((0, 0), (1, 0)))
        axes.axvline(limit, color=style.RESIDUAL, linestyle=style.DASHED, linewidth=1.0, label="limit")
        for number, line in enumerate(responses):
            finite = np.isfinite(line)
            label = "a record" if number == 0 else f"_{one.crossings[number].record}"
            axes.plot(line[finite], levels[finite], color=style.DATA, linewidth=0.6, label=label)
        whole = ~np.isnan(responses).any(axis=0)
        for share, width in zip(_SHARES, (1.1, 1.9, 1.1), strict=True):
            at = np.quantile(responses[:, whole], share, axis=0, method="inverted_cdf")
            finite = np.isfinite(at)
            label = "16, 50, 84 % of them" if share == _SHARES[0] else f"_{100.0 * share:.0f} %"
            colour = strokes(result)[row].colour
            axes.plot(at[finite], levels[whole][finite], color=colour, linewidth=width, label=label)
        axes.set_xlim(0.0, min(max(float(largest), 1.1 * limit), _BEYOND * limit))
        axes.set_ylim(0.0, 1.02 * float(levels[-1]))
        finished(axes, with_unit(criterion(result.criterion).title, unit.symbol), f"{one.measure} (g)")
        axes.set_title(short(one.label, 26), loc="left", fontsize="small")
    return panels


@figure
def damper_counts(result: DamperCounts, ax: Ax = None, *, legend: Legend = True) -> Axes:
    """Criterion of each arrangement over the number of dampers in each place, with the limit.

    Parameters
    ----------
    result
        What `mr.study.damper_counts` has found.

    Examples
    --------
    >>> import mrwork as mr
    >>> found = mr.study.damper_counts(study, limit={"peak_drift": "10 mm"})  # doctest: +SKIP
    >>> axes = found.plot.damper_counts()  # doctest: +SKIP
    """
    axes, unit = axes_for(ax), _unit_of_limit(result)
    for row, stroke in zip(result.rows, strokes(result), strict=True):
        every = [(count, tried.value) for tried in row.tried if (count := tried.uniform) is not None]
        across, up = np.array(every).T
        axes.plot(across, unit.factor * up, markersize=3.6, label=row.label, **stroke.marked)
    axes.axhline(
        unit.factor * result.limit, color=style.RESIDUAL, linestyle=style.DASHED, linewidth=1.0, label="limit"
    )
    axes.set_xscale("log", base=2)
    axes.xaxis.set_major_formatter("{x:g}")
    axes.set_ylim(bottom=0.0)
    return finished(
        axes,
        "Dampers in each place",
        with_unit(criterion(result.criterion).title, unit.symbol),
        legend=legend,
    )


@figure
def fragility(
    result: Fragilities, ax: Ax = None, *, rows: Sequence[str | int] = (), legend: Legend = True
) -> Axes:
    """Probability that the limit is reached over intensity: the lognormal curve of each arrangement.

    Points are the shares of the records at each level, the bar at one half is the band of the median.

    Parameters
    ----------
    result
        What `mr.fragility` has found.
    rows
        As in `ida`; by default all.

    Examples
    --------
    >>> import mrwork as mr
    >>> axes = mr.fragility(results, limit={"peak_drift_ratio": "1 %"}).plot.fragility()  # doctest: +SKIP
    """
    axes, labels, of_row = axes_for(ax), [*result.rows], strokes(result)
    for row in all_chosen(rows, labels, "arrangement"):
        one, stroke = result[labels[row]], of_row[row]
        levels = one.levels / STANDARD_GRAVITY
        over = np.linspace(0.0, 1.02 * float(levels[-1]), _CURVE_POINTS)[1:]
        reached = [one.probability(STANDARD_GRAVITY * float(level)) for level in over]
        axes.plot(over, reached, label=one.label, **stroke.marked | {"marker": ""})
        axes.plot(levels, one.crossed, markersize=3.6, **stroke.marked | {"linestyle": "none"})
        if not one.bound:
            ends = np.minimum(np.array(one.band) / STANDARD_GRAVITY, over[-1])
            axes.plot(ends, [0.5, 0.5], color=stroke.colour, linewidth=4.0, alpha=0.35, solid_capstyle="butt")
        axes.set_xlim(0.0, float(over[-1]))
        axes.set_ylim(-0.02, 1.02)
    ordinate = f"Probability ({result.title} ≥ {result.limit_value})"
    return finished(axes, f"{result[labels[0]].measure} (g)", ordinate, legend=legend)
