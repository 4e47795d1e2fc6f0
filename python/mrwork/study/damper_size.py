"""Demand of the runs of a study on its dampers: what lies outside their tested ranges, and whether their size is right.

Their force is compared with the base shear of the building without dampers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import counted, round_to
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.buildings.device import Device
from mrwork.closed_loop.evaluation import ratio
from mrwork.closed_loop.responses import demand_of
from mrwork.control.weights.limits import sine_force
from mrwork.dampers.spec import LAW_BEYOND, worst_laws
from mrwork.dampers.tested_range import Outside, outside_remark, worst_of
from mrwork.study.results import DeviceDemand, StudyResults
from mrwork.study.runs import Runs
from mrwork.study.storeys import storey_remarks
from mrwork.study.study import Study

# Share of the base shear below which dampers hardly change a response: with 2 % of it the peak drift of a frame of six
# storeys under El Centro decreases by 5 % at the most.
_WEAK = 0.02
_ADVISED = 0.1
# Peak force over peak stroke beside the stiffness of the storey, above which a damper acts as a rigid brace. In frames
# of one and six storeys under El Centro, by the number of dampers: below 1 where the score is least, accelerations of
# the six storeys exceed those without dampers above 2, and above 5 less than half of the energy that the best number
# dissipates is left.
_RIGID, _FREE = 5.0, 1.0
# Share of the largest command above which a constant one is the largest; those that are tried are further apart.
_LARGEST = 0.99
_NAMED = 3


def demands_of(
    runs: Runs, row: int, motion: int, devices: Sequence[Device], seconds: float
) -> tuple[DeviceDemand, ...]:
    """The demand of a run that lasts `seconds` [s] on each device; none without dampers, or with actuators instead."""
    run = runs.at(row, motion)
    # Actuators have forces but no currents; a run that did not finish has no peaks.
    if not devices or not runs.finished[row, motion, 0] or math.isnan(run["peak_current"][0]):
        return ()
    demands = []
    for number, device in enumerate(devices):
        least = float(run["least_stroke"][number])
        demand = demand_of(
            device, run, number, seconds=seconds, least_stroke=None if math.isnan(least) else least
        )
        demands.append(DeviceDemand(device=device.name, demand=demand, outside=device.outside(demand)))
    return tuple(demands)


def _beyond(results: StudyResults) -> Iterator[Remark]:
    """Remarks on each quantity outside the tested ranges, with its worst run, and on each law out of its range."""
    every, limits = [], []
    for (row, motion), demands in results.demanded.items():
        under = f"under {results.motions[motion].name} with {results.rows[row].label}"
        for worst, name, _ in worst_of([(demand.device, demand.outside) for demand in demands]):
            every.append((f"{name} {under}", Outside(exceedances=(worst,))))
        limits += [limit for demand in demands for limit in demand.outside.laws]
    n_runs = sum(map(bool, results.demanded.values()))
    for worst, label, count in worst_of(every):
        yield outside_remark(worst, f", {label}, in {count} of {n_runs} runs with dampers")
    yield from (limit.remark(LAW_BEYOND) for limit in worst_laws(limits))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reach:
    """Largest forces of the dampers by the index of their storey, on the base, and the base shear without them [N]."""

    motion: int
    forces: Mapping[int, float]
    force: float
    on_base: bool
    shear: float

    @property
    def share(self) -> float:
        return self.force / self.shear


def shares_in_words(results: StudyResults) -> tuple[str, ...]:
    """A sentence on the force of the dampers beside the base shear of the building without them."""
    reaches = _reaches(results)
    if not reaches:
        return ()
    least, most = (choose(reaches, key=lambda reach: reach.share) for choose in (min, max))
    shares = dict.fromkeys(_percent(reach.share) for reach in (least, most))
    under = results.motions[most.motion].name
    if len(reaches) > 1:
        under = f"{counted(len(reaches), 'motion')}, most under {under}"
    names = {damper.storey: damper.place or f"storey {damper.storey + 1}" for damper in results.dampers}
    by_storey = [
        f"{round_to(1e-3 * force, 3):g} kN in {names[storey]}"
        for storey, force in sorted(most.forces.items())
    ]
    largest = f"; {'on the base' if most.on_base else 'at most'} {round_to(1e-3 * most.force, 3):g} kN"
    return (
        f"The dampers reach {list_names(by_storey, _NAMED)}{largest if len(by_storey) > 1 else ''}, "
        f"{' to '.join(shares)} % of the peak base shear without them "
        f"({round_to(1e-3 * most.shear, 3):g} kN, {round_to(results.building.total_mass, 3):,.10g} kg), under {under}.",
    )


def judged_by_demand(results: StudyResults, study: Study) -> StudyResults:
    """Results of a study with the demands on its devices, and with the remarks on them."""
    motions = results.motions
    demanded = {
        (row, motion): demands_of(results.quantities, row, motion, study.devices, motions[motion].duration)
        for row, motion in np.argwhere(results.quantities.done[:, :, 0]).tolist()
    }
    results = replace(results, demanded=demanded)
    rigidity = _rigidity(results, study) if results.dampers else None
    of_size = (
        ()
        if rigidity is None
        else (*_at_largest(results, study, rigidity), *_locked_storeys(results, study, rigidity))
    )
    return replace(
        results, damper_remarks=(*_beyond(results), *_weak(results), *of_size, *storey_remarks(results))
    )


_WEAK_DAMPERS: Final = RemarkKind(
    "dampers_weak",
    f"the dampers reach {{percent}} % of the base shear at most, and below {100.0 * _WEAK:g} % they hardly change the "
    "response",
    f"{{0}} would reach {100.0 * _ADVISED:g} %, or larger dampers",
)


def _weak(results: StudyResults) -> Iterator[Remark]:
    """Warn of dampers that are too weak for their building."""
    most = max(_reaches(results), key=lambda reach: reach.share, default=None)
    if most is not None and most.share < _WEAK:
        factor, own = _ADVISED / most.share, {damper.count for damper in results.dampers}
        counts = f"{math.ceil(round_to(factor, 2))} times the count of each [[damper]]"
        if len(own) == 1:
            where = "the" if len(results.dampers) == 1 else "each"
            counts = f"count = {math.ceil(round_to(own.pop() * factor, 2))} in {where} [[damper]]"
        yield _WEAK_DAMPERS.remark(counts, measured=Measured(most.share, ""), percent=_percent(most.share))


BEST_AT_LARGEST: Final = RemarkKind(
    "largest_command_best",
    "the largest command is the best constant one ({0}), so the dampers are small for this structure",
    "more or larger dampers would reduce its response further{unless}",
)


def _at_largest(results: StudyResults, study: Study, rigidity: Floats) -> Iterator[Remark]:
    """Warn of dampers of which the largest command is the best constant one, and none is stiff at it."""
    best, judged = results.row_of("best_passive"), results.judged_motions
    if best is None or not results.finished_under(best, judged):
        return
    largest = np.array([device.largest_command for device in study.devices if device.is_commanded])
    reached = results.quantities.numbers["peak_current"][best, list(judged), 0, : largest.size]
    if (reached > _LARGEST * largest).all() and not (rigidity[best] > _FREE).any():
        yield BEST_AT_LARGEST.remark(results.rows[best].label, unless="")


def _rigidity(results: StudyResults, study: Study) -> Floats:
    """Peak force over peak stroke over the stiffness of the storey, shape (n_rows, n_motions, n_dampers)."""
    rows = study.building.storeys[[damper.storey for damper in results.dampers]]
    # Against opposite forces at the two ends of the storey.
    flexibility = np.einsum("ij,ji->i", rows, np.linalg.solve(study.building.stiffness, rows.T))
    shares = np.array([damper.share for damper in results.dampers])
    force, stroke = (
        results.quantities.numbers[name][..., 0, : len(shares)] for name in ("peak_force", "peak_stroke")
    )
    return np.asarray(shares**2 * ratio(force, stroke) * flexibility)


_LOCKED: Final = RemarkKind(
    "storey_locked",
    "{0} locks its {place} {when}: {force:g} kN at a stroke of {stroke:g} mm is {times:g} times the stiffness of the "
    "{place} (under {motion} with {row}), and a rigid brace dissipates little and may raise accelerations",
    "{1}",
)


def _locked_storeys(results: StudyResults, study: Study, rigidity: Floats) -> Iterator[Remark]:
    """Warn of each device that locks its storey at i = 0, else with a law or a constant command."""
    off, commanded = results.row_of("passive_off"), _commanded(results)
    stroke, force = (results.quantities.numbers[name][..., 0, :] for name in ("peak_stroke", "peak_force"))
    for device in range(len(results.dampers)):
        ratios = rigidity[..., device]
        stiff = commanded & (ratios > _RIGID)
        at_zero = off is not None and bool(stiff[off].any())
        if at_zero:
            stiff &= np.arange(len(stiff))[:, None] == off
        if not stiff.any():
            continue
        worst = np.unravel_index(int(np.argmax(np.where(stiff, ratios, 0.0))), ratios.shape)
        labels = [results.rows[row].label for row in np.flatnonzero(stiff.any(axis=1))]
        others = [f"{len(labels) - _NAMED} more"] if len(labels) > _NAMED + 1 else labels[_NAMED:]
        named = list_names([*labels[:_NAMED], *others])
        when, remedy = (
            ("already at i = 0", _fewer(results, study, device, int(worst[1])))
            if at_zero
            else (f"with {named}", "a smaller largest_command of the law or fewer dampers free it")
        )
        yield _LOCKED.remark(
            results.dampers[device].name,
            remedy,
            measured=Measured(float(ratios[worst]), ""),
            place="place" if results.building.parts else "storey",
            when=when,
            force=round_to(1e-3 * float(force[(*worst, device)]), 3),
            stroke=round_to(1e3 * float(stroke[(*worst, device)]), 2),
            times=round_to(float(ratios[worst]), 2),
            motion=results.motions[worst[1]].name,
            row=results.rows[worst[0]].label,
        )


def _commanded(results: StudyResults) -> NDArray[np.bool_]:
    """Whether each run finished and has dampers that follow a command, shape (n_rows, n_motions)."""
    kinds = np.array([row.what.has_commands for row in results.rows])
    return np.asarray(results.quantities.finished[:, :, 0] & kinds[:, None])


def _fewer(results: StudyResults, study: Study, number: int, motion: int) -> str:
    """How many dampers have a tenth of the base shear at the drift without dampers."""
    bare, device, damper = results.quantities.at(0, motion), study.devices[number], results.dampers[number]
    axes = results.quantities.axes
    name, axis = ("peak_drift", "storey") if damper.place in axes["storey"] else ("peak_stroke", "device")
    # An older run folder has no places, and the drift of what was built in without a stroke is not known.
    if not results.finished_under(0, (motion,)) or damper.place not in axes[axis]:
        return "take fewer or smaller dampers"
    drift = damper.share * float(bare[name][axes[axis].index(damper.place)])
    rate = 2.0 * math.pi * float(study.building.frequencies[0]) * drift
    force = damper.share * float(np.abs(sine_force(device, drift, rate, device.largest_command)).max())
    count = device.count * _ADVISED * float(bare["peak_base_shear"]) / force
    if count < 1.0:
        return f"one alone has {_percent(_ADVISED / count)} % of the base shear, take a smaller damper"
    percent = f"{_percent(_ADVISED)} % of the base shear at the largest command"
    return f"count = {math.ceil(round_to(count, 2))} has {percent}"


def _reaches(results: StudyResults) -> list[_Reach]:
    """The run of the largest force on the base under each judged motion."""
    reaches, commanded = [], _commanded(results)
    numbers = results.quantities.numbers
    shears, forces = numbers["peak_base_shear"][..., 0], numbers["peak_force"][..., 0, :]
    # Beside actuators dampers are a part of what holds the building, and across the motion of the ground a force is no
    # part of the base shear.
    has_actuators = any(damper.command_unit == "N" for damper in results.dampers)
    storeys = [damper.storey if damper.share else -1 for damper in results.dampers]
    beside = set[int]() if has_actuators else {*storeys} - {-1}
    grounded = {damper.storey for damper in results.dampers if damper.on_ground or damper.storey == 0}
    for motion in results.judged_motions:
        shear, rows = float(shears[0, motion]), np.flatnonzero(commanded[:, motion])
        if shear > 0.0 and beside and rows.size:
            # Passive elements of the building are behind the devices.
            by_damper = forces[rows, motion, : len(storeys)] * [damper.share for damper in results.dampers]
            by_storey = {storey: by_damper[:, np.equal(storeys, storey)].sum(axis=1) for storey in beside}
            # Storeys stand on each other, so that forces of others do not add to those on the base.
            of_base = [by_storey[storey] for storey in beside & grounded]
            on_base = np.sum(of_base, axis=0) if of_base else np.max([*by_storey.values()], axis=0)
            most = int(np.argmax(on_base))
            held = {storey: float(force[most]) for storey, force in by_storey.items()}
            force, base = float(on_base[most]), bool(of_base)
            reaches.append(_Reach(motion=motion, forces=held, force=force, on_base=base, shear=shear))
    return reaches


def _percent(share: float) -> str:
    return f"{round_to(100.0 * share, 2):g}" if share < 1.0 else f"{100.0 * share:.0f}"
