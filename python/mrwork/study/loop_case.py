"""A loop of a study at work: an arrangement under motions, with hardware and realisations, in one call of the core."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial, reduce
from typing import Final

import numpy as np

from mrwork.base.summary import named
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.device import Device, ideal_actuator
from mrwork.buildings.yielding import with_factors
from mrwork.closed_loop.evaluation import SCORE, Scales
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.responses import Responses, command_unit_of
from mrwork.closed_loop.simulate import LoopVariation, simulate_loop
from mrwork.control.laws.control_law import ControlLaw
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.motions.ground_motion import on_floors
from mrwork.study.realisations import Realisations, nominal
from mrwork.study.runs import Runs, asks_for_weighted, candidate_axes, numbered, runs_of
from mrwork.study.study import Arrangement, Study, StudyLaw

OnBlock = Callable[[int, int], None]
"""Called with the runs that are done and all of a call."""
REACH: Final = 1e-5
"""How far responses are moved along slopes: far above rounding, far below what turns the order of two peaks."""


def unobserved(hardware: Hardware) -> Hardware:
    """The hardware of a loop in which nothing is fed back, which needs no observer."""
    return replace(hardware, feedback="state", measured_floors=None, known_ground=False, kinematic=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopCase:
    """An arrangement under motions, with hardware, and realisations or none: what a study or a tuning simulates.

    With `dampers_only` its peak stroke is that of dampers, also where isolators have one. Criteria `asked` for are
    those on request, as at a place, and `scored` those of the score.
    """

    arrangement: Arrangement
    motions: Sequence[GroundMotion]
    hardware: Hardware
    realisations: Realisations | None = None
    threads: int = 0
    on_block: OnBlock | None = None
    dampers_only: bool = False
    asked: tuple[str, ...] = ()
    scored: tuple[str, ...] = SCORE

    def under(self, law: StudyLaw | None, devices: Sequence[Device] = ()) -> LoopCase:
        """The case under a law, perhaps with other devices in the places of the own ones."""
        devices = tuple(devices) or self.arrangement.devices
        return replace(self, arrangement=replace(self.arrangement, law=law, devices=devices))

    def responses(
        self,
        *,
        motion_numbers: Sequence[int] | None = None,
        histories: bool = False,
        step_factor: int = 1,
        varied: Building | None = None,
        variation: LoopVariation | None = None,
        largest_commands: Floats | None = None,
        shaping: Floats | None = None,
    ) -> Responses:
        """Responses as `simulate_loop` returns them, of the building or one that is `varied`.

        The observer, if there is one, is designed for the building, and laws go on believing in it. Without devices
        the loop gets an actuator of zero force.
        """
        building, devices = self.arrangement.building, self.arrangement.devices
        law, hardware = self.arrangement.law, self.hardware
        assert law is not None
        if not devices:
            devices = (ideal_actuator(name="none", row=building.storeys[0]),)
            law = ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * building.n_coordinates))})
            hardware = unobserved(hardware)
        return simulate_loop(
            varied or building,
            devices,
            law,
            [
                on_floors(each, self.arrangement.bare.floor_names, building.floor_names)
                for each in self.motions
            ],
            hardware,
            histories=histories,
            step_factor=step_factor,
            nominal=building,
            largest_commands=largest_commands,
            shaping=shaping,
            variation=variation,
            motion_numbers=motion_numbers,
            threads=self.threads,
            on_progress=self.on_block,
        )

    def criteria(
        self,
        *,
        largest_commands: Floats | None = None,
        shaping: Floats | None = None,
        changes: Floats | None = None,
    ) -> Runs:
        """Criteria of the candidates of the law, with realisations or once.

        `largest_commands` and `shaping` belong to the candidates, see `simulate_loop`. With `changes` of the gains of
        one law, two candidates for each follow it, whose responses are moved by `REACH` along the slopes and against.
        Storeys that yield have one strength in a call: realisations of their stiffness are calls of their own.
        """
        arrangement, devices = self.arrangement, self.arrangement.devices
        realisations = nominal(devices) if self.realisations is None else self.realisations
        count, yields = len(realisations), any(each.in_stiffness for each in arrangement.building.elements)
        if yields and count > 1 and (realisations.stiffness != 1.0).any():
            calls = [
                replace(
                    self,
                    realisations=realisations.alone(index),
                    on_block=self.on_block and partial(_count_on, self.on_block, index, count),
                ).criteria(largest_commands=largest_commands, shaping=shaping, changes=changes)
                for index in range(count)
            ]
            return reduce(Runs.beside, calls).with_labels("realisation", numbered(count))
        noisy = any(noise for noise, _ in self.hardware.sensors)
        vary = cache(partial(vary_building, arrangement))
        varied = tuple(map(vary, realisations.stiffness.tolist(), realisations.damping.tolist()))
        draws = zip(devices, realisations.theta, strict=True) if devices else ()
        drawn = [replace(device, theta=theta) for device, theta in draws]
        responses = self.under(arrangement.law, drawn).responses(
            varied=varied[0] if yields else None,
            variation=LoopVariation(
                buildings=varied,
                delay=realisations.delay,
                seed=realisations.seed if noisy else np.zeros_like(realisations.seed),
                changes=changes,
            ),
            largest_commands=largest_commands,
            shaping=shaping,
            histories=asks_for_weighted(self.asked),
        )
        if changes is not None:
            responses = _beside(responses)
        axes = candidate_axes(responses.shape[0], self.motions, count)
        runs = runs_of(responses, arrangement, axes, self.asked)
        if self.dampers_only:
            strokes = runs.numbers["peak_stroke"][..., : len(devices)]
            runs = replace(runs, numbers={**runs.numbers, "peak_stroke": strokes})
        return runs.criteria(criterion_scales(arrangement), command_unit_of(devices), self.asked)


def training_case(study: Study, *, threads: int = 0, on_block: OnBlock | None = None) -> LoopCase:
    """The dampers of a study under the motions on which its laws are chosen."""
    return LoopCase(
        arrangement=study.at_zero,
        motions=study.chosen_on,
        hardware=study.hardware,
        threads=threads,
        on_block=on_block,
        asked=study.asked,
        scored=study.scored,
    )


def _count_on(on_block: OnBlock, index: int, count: int, done: int, of: int) -> None:
    """Report the runs of one of several calls among those of all."""
    on_block(index * of + done, count * of)


def _beside(responses: Responses) -> Responses:
    """The responses of one candidate, and beside them two for each of their slopes, moved along it and against."""
    moves = [(reach, slopes) for slopes in responses.slopes for reach in (REACH, -REACH)]
    return replace(
        responses,
        shape=(1 + len(moves), *responses.shape[1:]),
        outcome=np.tile(responses.outcome, 1 + len(moves)),
        steps=np.tile(responses.steps, 1 + len(moves)),
        numbers={
            name: np.concatenate([values, *(values + reach * slopes[name] for reach, slopes in moves)])
            for name, values in responses.numbers.items()
        },
    )


def criterion_scales(arrangement: Arrangement) -> Scales:
    """What the criteria of an arrangement are divided by: numbers of its own storeys, which baselines may change.

    The weight is that of the building without dampers, and on isolators with their slab.
    """
    adds_slab = arrangement.building.isolates.any() and not arrangement.bare.isolates.any()
    weighed = arrangement.building if adds_slab else arrangement.bare
    arrays, storeys = (
        named(arrangement.building, "heights", "yield_drifts", "loads"),
        arrangement.places["storey"],
    )
    of_storeys = {name: array[storeys] if array.size else array for name, array in arrays.items()}
    return Scales(weight=Scales.of(weighed).weight, **of_storeys)


def vary_building(arrangement: Arrangement, stiffness: float, damping: float) -> Building:
    """The building of an arrangement with factors of stiffness and damping of the bare building.

    What is built into it stays, such as the spring of a tuned mass, so that it is no longer tuned. Storeys that yield
    keep their yield drift: before and after yielding, and in strength, they change by the factor of the stiffness.
    """
    if stiffness == 1.0 and damping == 1.0:
        return arrangement.building
    building, bare = arrangement.building, arrangement.bare
    drifts = bare.chain
    if building.n_coordinates == bare.n_coordinates:
        back: Floats = np.eye(bare.n_coordinates)
    elif drifts.shape[0] == bare.n_coordinates and np.linalg.matrix_rank(drifts) == bare.n_coordinates:
        places = [*map(building.storey_names.index, bare.storey_names[: len(drifts)])]
        # Displacements of the bare building relative to its base, from its drifts within the arrangement.
        back = np.asarray(np.linalg.solve(drifts, building.storeys[places]))
    else:
        raise SettingError(
            f"{building.name}: stiffness and damping of the building cannot be told from what additions have of "
            "both, because its storeys do not determine its coordinates; leave both out of its uncertainty"
        )
    return replace(
        building,
        stiffness=building.stiffness + (stiffness - 1.0) * back.T @ bare.stiffness @ back,
        damping=building.damping + (damping - 1.0) * back.T @ bare.damping @ back,
        elements=with_factors(building, stiffness=stiffness).elements,
    )
