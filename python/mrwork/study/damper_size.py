"""Whether dampers are of a size with their building: their force beside its base shear, and strokes next to nothing."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mrwork.base.numbers import counted, round_to
from mrwork.base.summary import list_names
from mrwork.buildings import Building
from mrwork.control.weights.limits import sine_force

if TYPE_CHECKING:
    from mrwork.study.results import StudyResults

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

_COMMANDED = ("passive_off", "passive", "best_passive", "controller", "clairvoyant")


@dataclass(frozen=True, slots=True, kw_only=True)
class DevicePlace:
    """Index and stiffness [N/m] of the storey where a device stands, and the first natural frequency [Hz]."""

    storey: int
    stiffness: float
    frequency: float

    @staticmethod
    def of(building: Building, storey: int) -> DevicePlace:
        """Of a storey of the building without dampers, its stiffness against opposite forces at its two ends."""
        row = building.storeys[storey]
        return DevicePlace(
            storey=storey,
            stiffness=1.0 / float(row @ np.linalg.solve(building.stiffness, row)),
            frequency=float(building.frequencies[0]),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reach:
    """The largest force of the dampers together in any run under a motion, and the base shear without them [N]."""

    motion: int
    force: float
    shear: float

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
    return (
        f"The dampers reach {round_to(1e-3 * most.force, 3):g} kN together, {' to '.join(shares)} % of the peak base "
        f"shear of the building without them ({round_to(1e-3 * most.shear, 3):g} kN), under {under}.",
    )


def size_warnings(results: StudyResults) -> tuple[str, ...]:
    """Sentences on dampers that are too weak for their building, and on those that lock their storey."""
    return (*_weak(results), *_locked_storeys(results))


def _weak(results: StudyResults) -> Iterator[str]:
    most = max(_reaches(results), key=lambda each: each.share, default=None)
    if most is None or not most.share < _WEAK:
        return
    yield (
        f"the dampers reach {_percent(most.share)} % of the base shear at most, and below {_percent(_WEAK)} % they "
        f"hardly change the response: {_counts(results, _ADVISED / most.share)} would reach {_percent(_ADVISED)} %, "
        "or larger dampers."
    )


def _locked_storeys(results: StudyResults) -> Iterator[str]:
    """A sentence for each device that locks its storey at i = 0, else with a law or a constant command."""
    off = results.row_of("passive_off")
    for device, place in enumerate(results.device_places):
        stiff = {key: ratio for key in results.runs if (ratio := _stiffness(results, key, device)) > _RIGID}
        at_zero = {key: ratio for key, ratio in stiff.items() if key[0] == off}
        chosen = at_zero or stiff
        if not chosen:
            continue
        worst = max(chosen, key=lambda key: chosen[key])
        labels = list(dict.fromkeys(results.rows[row].label for row, _ in chosen))
        others = [f"{len(labels) - _NAMED} more"] if len(labels) > _NAMED + 1 else labels[_NAMED:]
        named = list_names([*labels[:_NAMED], *others])
        when, remedy = (
            ("already at i = 0", _fewer(results, device, place, worst[1]))
            if at_zero
            else (f"with {named}", "; a smaller largest_command of the law or fewer dampers free it")
        )
        stroke, force = (
            float(each[device]) for each in (results.runs[worst].peak_stroke, results.runs[worst].peak_force)
        )
        yield (
            f"{results.device_names[device]} locks its storey {when}: {round_to(1e-3 * force, 3):g} kN at a stroke of "
            f"{round_to(1e3 * stroke, 2):g} mm is {round_to(chosen[worst], 2):g} times the stiffness of the storey "
            f"(under {results.motions[worst[1]].name} with {results.rows[worst[0]].label}). It acts as a rigid "
            f"brace, which dissipates little and may raise accelerations{remedy}."
        )


def _stiffness(results: StudyResults, key: tuple[int, int], device: int) -> float:
    """Peak force over peak stroke of a device over the stiffness of its storey; 0 for runs without these."""
    run = results.runs[key]
    commanded = run.finished and results.rows[key[0]].kind in _COMMANDED
    if not commanded or not run.peak_stroke[device] > 0.0:
        return 0.0
    return float(run.peak_force[device] / run.peak_stroke[device]) / results.device_places[device].stiffness


def _fewer(results: StudyResults, device: int, place: DevicePlace, motion: int) -> str:
    """How many dampers have a tenth of the base shear at the drift without dampers."""
    of_study, bare = results.devices[device], results.runs.get((0, motion))
    if bare is None or not bare.finished:
        return ""
    drift = float(bare.peak_drift[place.storey])
    rate = 2.0 * math.pi * place.frequency * drift
    force = float(np.abs(sine_force(of_study, drift, rate, of_study.largest_command)).max())
    count = of_study.count * _ADVISED * float(bare.peak_base_shear) / force
    if count < 1.0:
        return f"; one alone has {_percent(_ADVISED / count)} % of the base shear, take a smaller damper"
    return (
        f"; count = {_round_count(count)} has {_percent(_ADVISED)} % of the base shear at the largest command"
    )


def _reaches(results: StudyResults) -> list[_Reach]:
    reaches = []
    for motion in results.judged_motions:
        bare = results.runs.get((0, motion))
        forces = [
            # Passive elements of the building are behind the devices.
            float(np.sum(run.peak_force[: len(results.devices)]))
            for (row, other), run in results.runs.items()
            if other == motion and run.finished and results.rows[row].kind in _COMMANDED
        ]
        if bare is not None and bare.finished and bare.peak_base_shear > 0.0 and results.devices and forces:
            reaches.append(_Reach(motion=motion, force=max(forces), shear=float(bare.peak_base_shear)))
    return reaches


def _counts(results: StudyResults, factor: float) -> str:
    counts = {device.count for device in results.devices}
    if len(counts) == 1:
        where = "the" if len(results.devices) == 1 else "each"
        return f"count = {_round_count(counts.pop() * factor)} in {where} [[damper]]"
    return f"{_round_count(factor)} times the count of each [[damper]]"


def _round_count(count: float) -> int:
    """A whole number of dampers, to two digits."""
    return math.ceil(round_to(count, 2))


def _percent(share: float) -> str:
    return f"{round_to(100.0 * share, 2):g}" if share < 1.0 else f"{100.0 * share:.0f}"
