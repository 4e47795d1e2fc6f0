"""The direct-current laws in the forms of the thesis: sheets, every floor with bands, and dampers that push one way.

Sheets are figures 6.3 to 6.10, the floors tables 6.1 and 6.2.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mrwork.closed_loop import Device, History, Responses, simulate_loop
from mrwork.control import ControlLaw, lyapunov_function, plant_of
from mrwork.motions import GroundMotion
from studies.chapter_6.tuning import control_law_of, kept
from studies.former.arrays import Floats
from studies.former.frame import FRAME, HARDWARE, LEVELS, Bench, level_name, pair
from studies.former.scores import constant_commands

OFF, CONSTANT = "i = 0", "best constant"
LYAPUNOV, PROPORTIONAL, INVERSE = "lyapunov_direct", "proportional_direct", "inverse_direct"
DIRECT = (LYAPUNOV, PROPORTIONAL, INVERSE)
"""That of figures 6.3 to 6.6 and table 6.1, then two forms of that of figures 6.7 to 6.10 and table 6.2."""
SHOWN = (LYAPUNOV, PROPORTIONAL)
"""One of each: those of the sheets."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Controlled:
    """A law with its numbers, and the device that it drives."""

    label: str
    law: ControlLaw
    device: Device


def controlled_at(level: int, constant: float, laws: Sequence[str] = DIRECT) -> tuple[Controlled, ...]:
    """i = 0, the constant current [A], and laws with their settings of a level, by its place in `LEVELS`."""
    settings = kept()
    return (
        *(
            Controlled(label=label, law=constant_commands(current), device=pair())
            for label, current in ((OFF, 0.0), (CONSTANT, constant))
        ),
        *(
            Controlled(label=law, law=control_law_of(tuned), device=tuned.device)
            for law in laws
            for tuned in [settings[law][level]]
        ),
    )


def motions_at(over: Bench, level: int) -> tuple[GroundMotion, ...]:
    """The motions of a level, by its place in `LEVELS`."""
    count = len(over.motions) // len(LEVELS)
    return over.motions[level * count : (level + 1) * count]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sheet:
    """Histories of a row under a record, with control and without."""

    record: str
    label: str
    controlled: History
    reference: History


def sheets_at(over: Bench, level: int, constant: float) -> Iterator[Sheet]:
    """Sheets of a level, by its place in `LEVELS`: of the best constant current [A] and the laws under each record."""
    off, *others = controlled_at(level, constant, SHOWN)
    for motion in motions_at(over, level):
        reference = _history(over, off, motion)
        for row in others:
            yield Sheet(
                record=motion.name,
                label=row.label,
                controlled=_history(over, row, motion),
                reference=reference,
            )


def sheets_found(over: Bench, constants: Sequence[float], *, quick: bool) -> dict[str, Any]:
    """By level, row and record, numbers of the sheets; the quick form has the first level only."""
    return {
        level_name(level): _numbers(sheets_at(over, number, constants[number]))
        for number, level in enumerate(LEVELS[:1] if quick else LEVELS)
    }


def _numbers(sheets: Iterator[Sheet]) -> dict[str, Any]:
    function = lyapunov_function(plant_of(FRAME, FRAME.storeys[:1]))
    table: dict[str, Any] = {}
    for sheet in sheets:
        value, without = function.value(sheet.controlled.state), function.value(sheet.reference.state)
        table.setdefault(sheet.label, {})[sheet.record] = {
            "peak_function": float(value.max()),
            "peak_function_ratio": float(value.max() / without.max()),
            "mean_function_ratio": float(value.mean() / without.mean()),
            "mean_current": float(sheet.controlled.current[:, 0].mean()),
            "peak_force": float(np.abs(sheet.controlled.force[:, 0]).max()),
        }
    return table


def _history(over: Bench, row: Controlled, motion: GroundMotion) -> History:
    found = simulate_loop(
        FRAME, [row.device], row.law, [motion], HARDWARE, histories=True, threads=over.threads
    ).histories
    assert found is not None
    return found[0]


BAND = (0.05, 0.95)
"""Quantiles of the band over the draws of the damper."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """A peak or rms of a motion of every floor, or of the storey below it: its unit, and the factor from SI."""

    kind: str
    motion: str
    unit: str
    factor: float

    @property
    def name(self) -> str:
        """Its name among the quantities of a run."""
        return f"{self.kind}_{self.motion}"

    @property
    def title(self) -> str:
        """Its name in tables."""
        return f"{self.kind} {self.motion}"


PEAKS, MEANS = (
    tuple(
        Quantity(kind=kind, motion=motion, unit=unit, factor=factor)
        for motion, unit, factor in (
            ("displacement", "mm", 1e3),
            ("drift", "mm", 1e3),
            ("acceleration", "m/s2", 1.0),
        )
    )
    for kind in ("peak", "rms")
)
QUANTITIES = (*PEAKS, *MEANS)


def floors_found(over: Bench, constants: Sequence[float], draws: Floats) -> dict[str, Any]:
    """By level, label, record and quantity: values, ratios to i = 0 and their bands, a number for each floor.

    Parameters
    ----------
    constants
        The best constant current of each level [A].
    draws
        Parameters of one damper, shape (n_draws, n_params). A ratio of a draw is over i = 0 of the same draw.
    """
    return {
        level_name(level): _at_level(
            over, motions_at(over, number), controlled_at(number, constants[number]), draws
        )
        for number, level in enumerate(LEVELS)
    }


def _at_level(
    over: Bench, motions: Sequence[GroundMotion], rows: Sequence[Controlled], draws: Floats
) -> dict[str, Any]:
    def responses(row: Controlled) -> dict[str, Floats]:
        # The published damper, then the draws.
        device = replace(row.device, theta=np.vstack([row.device.draws, draws]))
        found = simulate_loop(FRAME, [device], row.law, motions, HARDWARE, threads=over.threads)
        return _of_floors(found, len(motions))

    by_label = {row.label: responses(row) for row in rows}
    off = by_label[OFF]
    table = {}
    for label, runs in by_label.items():
        by_record: dict[str, Any] = {motion.name: {} for motion in motions}
        for quantity in QUANTITIES:
            value = quantity.factor * runs[quantity.name][:, 0]
            ratios = runs[quantity.name] / off[quantity.name]
            low, high = np.quantile(ratios[:, 1:], BAND, axis=1)
            for place, motion in enumerate(motions):
                by_record[motion.name][quantity.name] = {
                    "values": value[place].tolist(),
                    "ratios": ratios[place, 0].tolist(),
                    "low": low[place].tolist(),
                    "high": high[place].tolist(),
                }
        table[label] = by_record
    return table


def _of_floors(responses: Responses, n_motions: int) -> dict[str, Floats]:
    """Each quantity, shape (n_motions, 1 + n_draws, n_floors)."""
    return {
        quantity.name: np.asarray(getattr(responses, quantity.name)).reshape(n_motions, -1, len(FRAME.floors))
        for quantity in QUANTITIES
    }


def worse_found(floors: dict[str, Any]) -> dict[str, Any]:
    """By level, law and quantity: on how many floors of all records the law is worse than what it is compared with.

    `than_off` and `than_constant` count floors; `surely` are those whose band lies above i = 0, `within` those whose
    ratio lies within its band. `worst` is the largest ratio to i = 0, with its `record` and `floor`.
    """
    return {
        level: {
            law: {quantity.name: _worse(table, law, quantity.name) for quantity in QUANTITIES}
            for law in (CONSTANT, *DIRECT)
        }
        for level, table in floors.items()
    }


def _worse(table: dict[str, Any], law: str, quantity: str) -> dict[str, Any]:
    records = tuple(table[OFF])

    def of(label: str, part: str) -> Floats:
        return np.array([table[label][record][quantity][part] for record in records])

    ratios, low, high = (of(law, part) for part in ("ratios", "low", "high"))
    record, floor = np.unravel_index(ratios.argmax(), ratios.shape)
    return {
        "of": int(ratios.size),
        "than_off": int((ratios > 1.0).sum()),
        "surely": int((low > 1.0).sum()),
        "than_constant": int((ratios > of(CONSTANT, "ratios")).sum()),
        "within": int(((low <= ratios) & (ratios <= high)).sum()),
        "widest": float((high - low).max()),
        "worst": float(ratios.max()),
        "record": records[int(record)],
        "floor": FRAME.floor_names[int(floor)],
    }


PAIR, TWO, ONE = "pair in opposition", "two, one way", "one"
ARRANGEMENTS: dict[str, tuple[float, bool]] = {PAIR: (1.0, True), TWO: (2.0, False), ONE: (1.0, False)}
"""Number of dampers of each direction, and whether as many are opposed to them."""
# The frame is at rest before a record, and comes to rest after it; in the last second of each the offset is read [s].
_STILL, _READ = 20.0, 1.0


def arrangements_found(over: Bench, constants: Sequence[float], *, quick: bool) -> dict[str, Any]:
    """By level, control, arrangement and record: offsets of floor 1 [mm], peaks, and the current at rest [A].

    Laws have the settings of the pair. The quick form has the first record at the first level.
    """
    levels = LEVELS[:1] if quick else LEVELS
    return {
        level_name(level): {
            row.label: {
                name: _of(over, row, arrangement, motions_at(over, number)[: 1 if quick else None])
                for name, arrangement in ARRANGEMENTS.items()
            }
            for row in controlled_at(number, constants[number], SHOWN)
        }
        for number, level in enumerate(levels)
    }


def _of(
    over: Bench, row: Controlled, arrangement: tuple[float, bool], motions: Sequence[GroundMotion]
) -> dict[str, Any]:
    count, differential = arrangement
    device = replace(row.device, count=count, differential=differential)
    table = {}
    for motion in motions:
        found = simulate_loop(
            FRAME, [device], row.law, [between_rests(motion)], HARDWARE, histories=True, threads=over.threads
        )
        assert found.histories is not None
        (history,) = found.histories
        before = (history.time > _STILL - _READ) & (history.time <= _STILL)
        after = history.time > history.time[-1] - _READ
        table[motion.name] = {
            "before": 1e3 * float(history.displacement[before, 0].mean()),
            "after": 1e3 * float(history.displacement[after, 0].mean()),
            "current_before": float(history.current[before, 0].mean()),
            "current_after": float(history.current[after, 0].mean()),
            "peak_displacement": 1e3 * float(found.peak_displacement[0, 0]),
            "peak_drift": 1e3 * float(found.peak_drift[0].max()),
            "peak_acceleration": float(found.peak_acceleration[0].max()),
            "peak_acceleration_1": float(found.peak_acceleration[0, 0]),
        }
    return table


def between_rests(motion: GroundMotion) -> GroundMotion:
    """A motion with the ground at rest before and after it."""
    # Between samples the ground runs straight: it is at rest up to the last zero.
    still = np.zeros(round(_STILL / motion.dt) + 1)
    acceleration = np.concatenate([still, np.asarray(motion.acceleration), still])
    return GroundMotion(name=motion.name, dt=motion.dt, acceleration=acceleration)
