"""Settings that a law of a study leaves out: taken from the response of the dampers, or the best of a few by score.

Without weights a regulator weighs all drifts alike, and R is scanned. On test motions that scored 0.795 on average over
eleven studies of 1 to 20 storeys, and convex weights as they are designed for the force of the dampers 0.845, which
were better in one, of 20 storeys.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.keys import as_document, keys_of, toml_value
from mrwork.base.numbers import counted, round_to
from mrwork.base.places import keyed, read_each
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.groups import largest_command, sends_shares
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.evaluation import searched
from mrwork.closed_loop.responses import command_unit_of, in_command_unit
from mrwork.control.laws.control_law import ControlLaw, control_law
from mrwork.control.laws.law_problem import DesignProblem, Magnitude, Magnitudes, ReferencePeaks
from mrwork.control.laws.law_settings import SETTINGS, design_candidates, settings_of
from mrwork.errors import SettingError
from mrwork.motions import GroundMotion
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall
from mrwork.study.course import Course, StudyProgress
from mrwork.study.loop_runs import simulate_criteria
from mrwork.study.runs import Runs
from mrwork.study.study import (
    WEIGHT,
    Arrangement,
    NamedLaw,
    Study,
    TakenSettings,
    constant_share,
    digest_of_run,
)

# Values of a setting that is scanned, over the range in which a search would look for it.
_STEPS, _LEVELS = 13, 21
# Smallest over largest of the motion that a static model of the damper is fitted to.
_SMALLEST = 0.1

_MAGNITUDES: Mapping[Magnitude, str] = {
    "force": "the peak force of the dampers at the largest command",
    "stroke": "the peak stroke at i = 0",
    "rate": "the peak stroke at i = 0 times the first natural frequency",
    "ground": "the peak of the ground motions",
}


def magnitudes_of_runs(
    building: Building,
    motions: Sequence[GroundMotion],
    off: Runs,
    on: Runs,
    *,
    devices: Sequence[Device],
    constant: ReferencePeaks | None = None,
) -> Magnitudes:
    """Typical peaks of the response, medians over the motions, from the runs at i = 0 and at the largest command."""
    first = 2.0 * math.pi * float(building.frequencies[0])

    def middle(values: Floats) -> float:
        finite = values[np.isfinite(values) & (values > 0.0)]
        if finite.size:
            return float(np.median(finite))
        otherwise = "shorten the step of [hardware], or check building and dampers"
        raise SettingError(
            "the dampers at i = 0 or at the largest command have no finite response under the training motions, from "
            f"which the law takes its settings; {next(iter(building.warnings), otherwise).removesuffix('.')}"
        )

    def at_zero(name: str) -> float:
        return middle(off.numbers[name][0, :, 0])

    displacement, stroke = at_zero("peak_displacement"), at_zero("peak_stroke")
    velocity = first * displacement
    return Magnitudes(
        constant_drift=0.0 if constant is None else constant.drift,
        constant_acceleration=0.0 if constant is None else constant.acceleration,
        drift=at_zero("peak_drift"),
        displacement=displacement,
        velocity=velocity,
        acceleration=at_zero("peak_acceleration"),
        energy=building.total_mass * velocity**2,
        force=middle(on.peak_force[0, :, 0]),
        stroke=stroke,
        rate=first * stroke,
        ground=middle(np.array([motion.peak for motion in motions])),
        command=largest_command(devices),
        shares=sends_shares(devices),
    )


@checked
def designed(
    study: Study,
    *,
    journal: Journal | None = None,
    on_progress: Callable[[StudyProgress], None] | None = None,
) -> Study:
    """Return the study with the gains of all its laws, as `run_study` and `tune` make it first.

    Laws whose settings are complete are designed where a study is made. Settings that a law lacks are taken from the
    response of the dampers, which is simulated.

    Parameters
    ----------
    journal
        Records the settings that are taken, and recalls them after an interrupt.
    on_progress
        Called with the progress of the runs from which settings are taken.

    Raises
    ------
    SettingError
        If a law cannot be designed.

    Examples
    --------
    >>> import mrwork as mr
    >>> study = mr.study.designed(mr.read_study("study.toml"))  # doctest: +SKIP
    >>> study.taken_settings  # doctest: +SKIP
    """
    lacking = [arrangement.named for arrangement in study.arrangements if arrangement.named is not None]
    if not lacking:
        return study
    call = LongCall[StudyProgress, Study](journal=journal, on_progress=on_progress)
    trials = _Trials(study=study, call=call, course=Course(on_progress))

    def arranged(arrangement: Arrangement) -> Arrangement:
        if arrangement.named is None:
            return arrangement
        law, taken = trials.design(arrangement.named)
        return replace(arrangement, law=law, taken=taken, named=None)

    with study.place.prefix_errors(SettingError):
        made = replace(study, arrangements=tuple(read_each(arranged, study.arrangements)))
        made.check_readings()
    return made


@dataclass(frozen=True, kw_only=True)
class _Trials:
    """Runs from which settings of laws are taken, on the training motions; none is simulated before a law asks."""

    study: Study
    call: LongCall[StudyProgress, Study]
    course: Course

    def design(self, named: NamedLaw) -> tuple[ControlLaw, TakenSettings]:
        """A law with the settings that it lacks, and how they came."""
        law, problem, beside = named.table.law, named.problem, ""
        with keyed("controller", named.number):
            if named.lacks_motion:
                limited = problem is not problem.whole
                problem = self._shaken.limited_to(problem.largest_command) if limited else self._shaken
                beside = (
                    f"amplitude = {toml_value(problem.amplitude)} and velocity = {toml_value(problem.velocity)} of the "
                    "[[damper]] for its static model, up to the peak stroke at i = 0"
                )
            taken = self.call.step(
                f"settings of {law}",
                TakenSettings,
                partial(self._take, named, problem, beside),
                law,
                toml_value(as_document(named.given)),
                digest_of_run(self._arranged(problem, None), *problem.motions),
            )
            return named.design(problem, taken.settings), taken

    @cached_property
    def _shaken(self) -> DesignProblem:
        """The problem with the motion that the response of its dampers lets expect."""
        whole, (_, _, expected) = self.study.problem.whole, self._response
        amplitude, velocity = (
            (round_to(_SMALLEST * value), round_to(value)) for value in (expected.stroke, expected.rate)
        )
        return replace(whole, amplitude=whole.amplitude or amplitude, velocity=whole.velocity or velocity)

    def _take(self, named: NamedLaw, problem: DesignProblem, beside: str) -> TakenSettings:
        """The settings that a law lacks; `beside` says what else was taken for it."""
        kind, settings, missing = SETTINGS[named.table.law], named.given, named.missing
        if not missing:
            return TakenSettings(settings={}, origin=(beside,), remedy="")
        taken, says = dict[str, Any](), list[str]()
        # Of a regulator without R.
        if WEIGHT in [entry.name for entry in missing]:
            if "designed" in settings:
                taken, says = {WEIGHT: 1.0}, ["control_weight, R as designed"]
            elif not kind.weight_names() & settings.keys():
                taken, says = dict(kind.weighed_by_default), ["equal weights of all drifts"]
        _, _, magnitudes = self._response
        magnitudes = replace(magnitudes, cost=kind.cost({**settings, **taken}, magnitudes))
        scanned: dict[str, Floats] = {}
        for entry in (entry for entry in missing if entry.name not in taken):
            span = entry.says.span
            if span.entries:
                taken[entry.name] = span.entries
                says.append(f"{entry.name} that is about the clipped-optimal law")
            elif span.start is not None:
                taken[entry.name] = round_to(span.start * span.unit(magnitudes))
                says.append(f"{entry.name}, {_MAGNITUDES[span.of[0][0]]}")
            else:
                lower, upper = (end * span.unit(magnitudes) for end in (span.lower, span.upper))
                linear = span.scale == "linear"
                steps = np.linspace(lower, upper, _LEVELS) if linear else np.geomspace(lower, upper, _STEPS)
                scanned[entry.name] = np.array([round_to(step) for step in steps])
        if scanned:
            chosen, sentence = self._scan(named, {**settings, **taken}, scanned, problem)
            taken |= chosen
            says.append(sentence)
        return TakenSettings(
            settings=taken,
            runs=len(next(iter(scanned.values()), ())) * len(problem.motions),
            origin=tuple([*says, beside] if beside else says),
            remedy=f"settings = {toml_value(as_document(settings) | taken)}",
        )

    def _scan(
        self,
        named: NamedLaw,
        held: Mapping[str, Any],
        scanned: Mapping[str, Floats],
        problem: DesignProblem,
    ) -> tuple[dict[str, float], str]:
        """The values of the lowest score, all scanned settings from the one end to the other together."""
        law, count = named.table.law, len(next(iter(scanned.values())))
        many = [{name: float(law[step]) for name, law in scanned.items()} for step in range(count)]
        designed = design_candidates(law, problem, [settings_of(law, {**held, **item}) for item in many])
        (off, on, _), scores = self._response, np.full(count, math.inf)
        self.course.begin(f"settings of {law}")
        # What no candidate can be designed for, the design of the chosen one refuses.
        if designed.law is not None:
            runs = self._run(problem, named.shaped(designed.law))
            of_runs = runs.scores(off).mean(axis=(1, 2))
            if control_law(law).commands_force:
                within = (runs.peak_force <= on.peak_force)[:, :, 0].all(axis=1)
                of_runs = np.where(within, of_runs, math.nan)
            scores[list(designed.designed)] = searched(of_runs)
        best = int(np.argmin(scores)) if np.isfinite(scores).any() else count // 2
        unit = command_unit_of(problem.devices)
        units = {entry.name: in_command_unit(entry.says.unit, unit) for entry in keys_of(SETTINGS[law])}
        spans = (f"{name} from {law[0]:.3g} to {law[-1]:.3g} {units[name]}" for name, law in scanned.items())
        ranges = list_names([span.rstrip() for span in spans])
        if not np.isfinite(scores).any():
            return many[best], f"{ranges}, the middle, since none of {count} values has a score"
        number, active = len(problem.motions), control_law(law).commands_force
        motions = counted(number, "training motion")
        if problem.judged:
            motions = (
                f"the {'motion' if number == 1 else counted(number, 'motion')} that it is judged on, too"
            )
        limit = " with no more force than the dampers at the largest command" if active else ""
        score = f"(score {scores[best]:.3f} on {motions})"
        return many[best], f"{ranges}, the best of {count} values{limit} {score}"

    @cached_property
    def _response(self) -> tuple[Runs, Runs, Magnitudes]:
        """Criteria of the dampers at i = 0 and at the largest command, and the magnitudes that follow from them."""
        problem = self.study.problem.whole
        self.course.begin("dampers at i = 0 and at the largest command")
        off, on = (self._run(problem, constant_share(problem.devices, share)) for share in (0.0, 1.0))
        magnitudes = magnitudes_of_runs(problem.building, problem.motions, off, on, devices=problem.devices)
        return off, on, magnitudes

    def _run(self, problem: DesignProblem, law: ControlLaw) -> Runs:
        arrangement, hardware = self._arranged(problem, law), self.study.hardware
        return simulate_criteria(arrangement, problem.motions, hardware, on_block=self.course.advance)

    def _arranged(self, problem: DesignProblem, law: ControlLaw | None) -> Arrangement:
        return replace(self.study.at_zero, devices=problem.all_devices, law=law)
