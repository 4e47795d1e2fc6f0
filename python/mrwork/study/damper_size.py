"""Size of the dampers of a study: whether their force is considerable, and their strokes are not next to nothing.

The force is compared with the base shear of the building without dampers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mrwork.base.numbers import counted, round_to
from mrwork.base.summary import list_names
from mrwork.closed_loop.evaluation import ratio
from mrwork.control.weights.limits import sine_force
from mrwork.study.demand import damper_warnings, demands_of
from mrwork.study.results import BuildingFacts, DamperFacts, StudyResults
from mrwork.study.study import Study

# Share of the base shear below which dampers hardly change a response: with 2 % of it the peak drift of a frame of six
# storeys under El Centro decreases by 5 % at the most.
_WEAK = 0.02
_ADVISED = 0.1
# Peak force over peak stroke beside the stiffness of the storey, above which a damper acts as a rigid brace. In frames
# of one and six storeys under El Centro, by the number of dampers: below 1 where the score is least, accelerations of
# the six storeys exceed those without dampers above 2, and above 5 less than half of the energy that the best number
# dissipates is left.
_RIGID = 5.0
_NAMED = 3

_COMMANDED = ("passive_off", "passive", "best_passive", "best_passive_by_group", "controller")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reach:
    """Largest forces of the dampers by the index of their storey, and the base shear without them [N]."""

    motion: int
    forces: Mapping[int, float]
    shear: float

    @property
    def force(self) -> float:
        """That on the base; storeys stand on each other, so that forces of others do not add to it."""
        return self.forces[0] if 0 in self.forces else max(self.forces.values())

    @property
    def share(self) -> float:
        return self.force / self.shear


def shares_in_words(results: StudyResults) -> tuple[str, ...]:
    """A sentence on the force of the dampers beside the base shear of the building without them."""
    reaches = _reaches(results)
    if not reaches:
        return ()
    least, most = (choose(reaches, key=lambda each: each.share) for choose in (min, max))
    shares = dict.fromkeys(_percent(each.share) for each in (least, most))
    under = results.motions[most.motion].name
    if len(reaches) > 1:
        under = f"{counted(len(reaches), 'motion')}, most under {under}"
    by_storey = [
        f"{round_to(1e-3 * force, 3):g} kN in {results.storey_names[storey]}"
        for storey, force in sorted(most.forces.items())
    ]
    largest = f"; {'on the base' if 0 in most.forces else 'at most'} {round_to(1e-3 * most.force, 3):g} kN"
    return (
        f"The dampers reach {list_names(by_storey, _NAMED)}{largest if len(by_storey) > 1 else ''}, "
        f"{' to '.join(shares)} % of the peak base shear of the building without them "
        f"({round_to(1e-3 * most.shear, 3):g} kN), under {under}.",
    )


def judged_by_demand(results: StudyResults, study: Study) -> StudyResults:
    """Results of a study with the demands on its devices, and with the warnings on them."""
    motions, devices = results.motions, study.devices
    demanded = {
        (row, motion): demands_of(results.quantities, row, motion, devices, motions[motion].duration)
        for row, motion in np.argwhere(results.quantities.done[:, :, 0]).tolist()
    }
    results = replace(
        results,
        demanded=demanded,
        building=BuildingFacts.of(study.building),
        dampers=tuple(
            DamperFacts.of(device, study.building, table.storey)
            for device, table in zip(devices, study.table.damper, strict=True)
        ),
    )
    named = {
        (results.rows[row].label, motions[motion].name): each for (row, motion), each in demanded.items()
    }
    warnings = (*damper_warnings(named), *_weak(results), *_locked_storeys(results, study))
    return replace(results, damper_warnings=warnings)


def _weak(results: StudyResults) -> Iterator[str]:
    """A sentence on dampers that are too weak for their building."""
    most = max(_reaches(results), key=lambda each: each.share, default=None)
    if most is None or not most.share < _WEAK:
        return
    yield (
        f"the dampers reach {_percent(most.share)} % of the base shear at most, and below {_percent(_WEAK)} % they "
        f"hardly change the response: {_counts(results, _ADVISED / most.share)} would reach {_percent(_ADVISED)} %, "
        "or larger dampers."
    )


def _locked_storeys(results: StudyResults, study: Study) -> Iterator[str]:
    """A sentence for each device that locks its storey at i = 0, else with a law or a constant command."""
    off, commanded = results.row_of("passive_off"), _commanded(results)
    stroke, force = (results.quantities.numbers[name][..., 0, :] for name in ("peak_stroke", "peak_force"))
    for device, damper in enumerate(results.dampers):
        row = study.building.storeys[damper.storey]
        # Against opposite forces at the two ends of the storey.
        stiffness = 1.0 / float(row @ np.linalg.solve(study.building.stiffness, row))
        ratios = damper.share**2 * ratio(force[..., device], stroke[..., device]) / stiffness
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
            else (f"with {named}", "; a smaller largest_command of the law or fewer dampers free it")
        )
        reached, moved = float(force[(*worst, device)]), float(stroke[(*worst, device)])
        yield (
            f"{results.device_names[device]} locks its storey {when}: {round_to(1e-3 * reached, 3):g} kN at a stroke "
            f"of {round_to(1e3 * moved, 2):g} mm is {round_to(float(ratios[worst]), 2):g} times the stiffness of the "
            f"storey (under {results.motions[worst[1]].name} with {results.rows[worst[0]].label}). It acts as a rigid "
            f"brace, which dissipates little and may raise accelerations{remedy}."
        )


def _commanded(results: StudyResults) -> NDArray[np.bool_]:
    """Whether each run finished and has dampers that follow a command, shape (n_rows, n_motions)."""
    kinds = np.array([row.kind in _COMMANDED for row in results.rows])
    return np.asarray(results.quantities.finished[:, :, 0] & kinds[:, None])


def _fewer(results: StudyResults, study: Study, number: int, motion: int) -> str:
    """How many dampers have a tenth of the base shear at the drift without dampers."""
    bare, device, damper = results.quantities.at(0, motion), study.devices[number], results.dampers[number]
    # A storey of what was built in, such as a tuned mass, is none of the building without dampers.
    if not results.finished_under(0, (motion,)) or damper.storey >= len(bare["peak_drift"]):
        return ""
    drift = damper.share * float(bare["peak_drift"][damper.storey])
    rate = 2.0 * math.pi * float(study.building.frequencies[0]) * drift
    force = damper.share * float(np.abs(sine_force(device, drift, rate, device.largest_command)).max())
    count = device.count * _ADVISED * float(bare["peak_base_shear"]) / force
    if count < 1.0:
        return f"; one alone has {_percent(_ADVISED / count)} % of the base shear, take a smaller damper"
    return (
        f"; count = {_round_count(count)} has {_percent(_ADVISED)} % of the base shear at the largest command"
    )


def _reaches(results: StudyResults) -> list[_Reach]:
    reaches, commanded = [], _commanded(results)
    shears, forces = (results.quantities.numbers[name] for name in ("peak_base_shear", "peak_force"))
    for motion in results.judged_motions:
        shear = float(shears[0, motion, 0])
        if not shear > 0.0 or not results.dampers:
            continue
        of_runs = []
        for row in np.flatnonzero(commanded[:, motion]):
            by_storey: dict[int, float] = {}
            # Passive elements of the building are behind the devices.
            for damper, force in zip(results.dampers, forces[row, motion, 0].tolist(), strict=False):
                by_storey[damper.storey] = by_storey.get(damper.storey, 0.0) + damper.share * force
            of_runs.append(_Reach(motion=motion, forces=by_storey, shear=shear))
        reaches += [max(of_runs, key=lambda each: each.force)] if of_runs else []
    return reaches


def _counts(results: StudyResults, factor: float) -> str:
    counts = {device.count for device in results.dampers}
    if len(counts) == 1:
        where = "the" if len(results.dampers) == 1 else "each"
        return f"count = {_round_count(counts.pop() * factor)} in {where} [[damper]]"
    return f"{_round_count(factor)} times the count of each [[damper]]"


def _round_count(count: float) -> int:
    """A whole number of dampers, to two digits."""
    return math.ceil(round_to(count, 2))


def _percent(share: float) -> str:
    return f"{round_to(100.0 * share, 2):g}" if share < 1.0 else f"{100.0 * share:.0f}"
