"""Laws that are tried on the training motions: the best constant commands, and settings that a law leaves out.

Constant commands are levels from zero to the largest of all dampers together, and then of each group alone. A setting
that a law lacks is taken from the response of the dampers, or is the best of a few values by score. Without weights a
regulator weighs all drifts alike, and R is scanned. On test motions that scored 0.795 on average over eleven studies of
1 to 20 storeys, and convex weights as they are designed for the force of the dampers 0.845, which were better in one,
of 20 storeys.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.keys import as_document, keys_of, toml_value
from mrwork.base.numbers import counted, round_to
from mrwork.base.places import keyed, read_each
from mrwork.base.progress import OnProgress
from mrwork.base.remark import warnings_of
from mrwork.base.summary import list_names
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.device import Device
from mrwork.buildings.groups import commanded, largest_command, products_of, sends_shares
from mrwork.closed_loop.evaluation import searched
from mrwork.closed_loop.responses import command_unit_of, in_command_unit
from mrwork.control.laws.control_law import ControlLaw, control_law
from mrwork.control.laws.law_problem import DesignProblem, Magnitude, Magnitudes, ReferencePeaks
from mrwork.control.laws.law_settings import SETTINGS, design_candidates, settings_of
from mrwork.errors import SettingError, SimulationError
from mrwork.motions import GroundMotion
from mrwork.motions.ground_motion import peak_push
from mrwork.store.journal import Journal
from mrwork.store.long_call import LongCall
from mrwork.study.loop_case import LoopCase, training_case
from mrwork.study.run_reports import LEVELS, ROUNDS, RunReports
from mrwork.study.runs import Runs
from mrwork.study.schema import PASSIVE_OFF, PASSIVE_ON
from mrwork.study.study import (
    WEIGHT,
    Arrangement,
    NamedLaw,
    Study,
    TakenSettings,
    constant_commands,
    constant_share,
    digest_of_run,
)

# Devices of a group that a sentence names.
_NAMED = 3
# Values of a setting that is scanned, over the range in which a search would look for it.
_STEPS = 13
# Smallest over largest of the motion that a static model of the damper is fitted to.
_SMALLEST = 0.1

_MAGNITUDES: Mapping[Magnitude, str] = {
    "force": "the peak force of the dampers at the largest command",
    "stroke": "the peak stroke at i = 0",
    "rate": "the peak stroke at i = 0 times the first natural frequency",
    "ground": "the peak acceleration of the ground, and of forces over the mass",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class BestConstant:
    """The constant commands of the lowest score: one share of the largest ones, or one command for each group.

    `commands` are sent to the devices that follow one [A or V], and are 0 without any score. `scores` are of all shares
    that were tried, from i = 0 to the largest. A search by group took `rounds`, the last one perhaps in part, from the
    score `of_share`, and tried so many commands.
    """

    commands: tuple[float, ...]
    score: float
    runs: int
    scores: tuple[float, ...] = ()
    of_share: float = math.nan
    rounds: int = 0
    tried: int = 0

    def in_words(self, label: str, devices: Sequence[Device]) -> str:
        """The choice in a sentence, with the ends of the scan, or the devices of each group."""
        driven, runs = commanded(devices), counted(self.runs, "run")
        if math.isnan(self.score):
            return f"{label} is at i = 0: no constant command has a score ({runs})."
        if not self.rounds:
            largest = np.array([device.largest_command for device in driven])
            off, on = (_share_in_words(driven, share * largest) for share in (0.0, 1.0))
            return (
                f"{label} is the best of {len(self.scores)} constant commands, score {self.score:.3f}: from "
                f"{PASSIVE_OFF}, {off}, {self.scores[0]:.3f}, to {PASSIVE_ON}, {on}, {self.scores[-1]:.3f} ({runs} in "
                "one batch)."
            )
        names = [
            list_names([driven[member].name for member in group], _NAMED) for group in products_of(driven)
        ]
        held = zip(self._by_group(driven), names, strict=True)
        tried, rounds = counted(self.tried, "constant command"), counted(self.rounds, "round")
        return (
            f"{label}: {'; '.join(map(' in '.join, held))}; score {self.score:.3f}, beside {self.of_share:.3f} of one "
            f"share of the largest commands ({tried} in {rounds} of coordinate search, {runs})."
        )

    def label(self, devices: Sequence[Device]) -> str:
        """The commands in words, after a search by group a command for each group."""
        driven = commanded(devices)
        return list_names(self._by_group(driven)) if self.rounds else _share_in_words(driven, self.commands)

    def _by_group(self, driven: Sequence[Device]) -> list[str]:
        return [_command(driven[first], self.commands[first]) for first, *_ in products_of(driven)]


def _share_in_words(driven: Sequence[Device], commands: Sequence[float] | Floats) -> str:
    """One share of the largest commands in words: the command where that is the same of all dampers."""
    if len({(device.largest_command, device.spec.command_unit) for device in driven}) == 1:
        return _command(driven[0], commands[0])
    return f"{100.0 * commands[0] / driven[0].largest_command:.0f} %"


def _command(device: Device, command: float) -> str:
    return f"{command:.3g} {device.spec.command_unit or 'A'}"


def _levels(case: LoopCase) -> Floats:
    """The constant commands that are tried, a row of one share of all largest ones for each level."""
    largest = [device.largest_command for device in commanded(case.arrangement.devices)]
    return np.linspace(0.0, largest, LEVELS)


def scan(case: LoopCase) -> tuple[BestConstant, Runs]:
    """The best share of the largest commands, and the criteria under it; a command has no score if a run failed."""
    commands = _levels(case)
    runs = case.under(constant_commands(commands)).criteria()
    scores = runs.scores(runs.of_row(0), case.scored).mean(axis=(1, 2))
    best = int(np.argmin(searched(scores)))
    return BestConstant(
        commands=tuple(commands[best].tolist()),
        score=float(scores[best]),
        scores=tuple(scores.tolist()),
        runs=runs.outcome.size,
    ), runs.of_row(best)


def with_best_commands(
    case: LoopCase, call: LongCall[Any], shares: dict[str, BestConstant]
) -> tuple[Arrangement, str]:
    """The arrangement under its best constant commands, and a sentence on the choice.

    `shares` are the best shares of the largest commands that were found, by the digest of the runs.
    """
    arrangement = case.arrangement
    inputs = digest_of_run(arrangement, *case.motions)
    if inputs not in shares:
        shares[inputs] = call.step("best_constant", BestConstant, lambda: scan(case)[0], inputs)
    best = shares[inputs]
    # The row that the study has added may be without a score.
    if math.isnan(best.score) and not arrangement.added:
        raise _without_score(case)
    if arrangement.row.kind == "best_passive_by_group":
        best = call.step("best_by_group", BestConstant, partial(_best_by_group, case, best), inputs)
    label = f"{arrangement.row.label}, {best.label(arrangement.devices)}"
    row, law = replace(arrangement.row, label=label), constant_commands(best.commands)
    return replace(arrangement, row=row, law=law), best.in_words(label, arrangement.devices)


def _best_by_group(case: LoopCase, start: BestConstant) -> BestConstant:
    """The best constant command of each group, from one share on: the levels of a group, then of the next.

    Scores are over i = 0. A search ends where the levels of every group were tried since the last change.
    """
    if math.isnan(start.score):
        return replace(start, runs=0)
    levels, groups = _levels(case), products_of(commanded(case.arrangement.devices))
    off = case.under(constant_commands(levels[:1])).criteria()
    commands, score = np.array(start.commands), start.score
    steps, changed = 0, 0
    while steps < ROUNDS * len(groups) and steps - changed < len(groups):
        group = groups[steps % len(groups)]
        tried = np.tile(commands, (LEVELS, 1))
        tried[:, group] = levels[:, group]
        runs = case.under(constant_commands(tried)).criteria()
        scores = searched(runs.scores(off, case.scored).mean(axis=(1, 2)))
        best = int(np.argmin(scores))
        if scores[best] < score:
            commands, score, changed = tried[best], float(scores[best]), steps
        steps += 1
    return BestConstant(
        commands=tuple(commands.tolist()),
        score=score,
        of_share=start.score,
        tried=steps * LEVELS,
        rounds=math.ceil(steps / len(groups)),
        runs=(1 + steps * LEVELS) * len(case.motions),
    )


def reference_peaks(case: LoopCase) -> ReferencePeaks:
    """The best share of the largest commands, and the mean peaks under it, to four digits."""
    best, runs = scan(case)
    if math.isnan(best.score):
        raise _without_score(case)
    drift, acceleration = (
        round_to(float(runs.numbers[name].mean())) for name in ("peak_drift", "peak_acceleration")
    )
    return ReferencePeaks(
        commands=tuple(map(round_to, best.commands)), drift=drift, acceleration=acceleration
    )


def _without_score(case: LoopCase) -> SimulationError:
    return SimulationError(
        f"{case.arrangement.row.label}: no constant command has a score, because under "
        f"{list_names([motion.name for motion in case.motions])} the run at i = 0, or at every command, "
        "did not finish or has no response; check the dampers and the step, or leave best_passive out"
    )


def magnitudes_of_runs(
    building: Building, motions: Sequence[GroundMotion], off: Runs, on: Runs, devices: Sequence[Device]
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
            f"which the law takes its settings; {next(iter(warnings_of(building.remarks)), otherwise)}"
        )

    def at_zero(name: str) -> float:
        return middle(off.numbers[name][0, :, 0])

    displacement, stroke = at_zero("peak_displacement"), at_zero("peak_stroke")
    velocity = first * displacement
    return Magnitudes(
        drift=at_zero("peak_drift"),
        displacement=displacement,
        velocity=velocity,
        acceleration=at_zero("peak_acceleration"),
        energy=building.reference_mass * velocity**2,
        force=middle(on.peak_force[0, :, 0]),
        stroke=stroke,
        rate=first * stroke,
        ground=middle(np.array([peak_push(motion, building.reference_mass) for motion in motions])),
        command=largest_command(devices),
        shares=sends_shares(devices),
    )


@checked
def designed(study: Study, *, journal: Journal | None = None, on_progress: OnProgress | None = None) -> Study:
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
    if all(arrangement.named is None for arrangement in study.arrangements):
        return study
    call, course = (LongCall[Study](journal=journal, on_progress=on_progress), RunReports(on_progress))
    case = training_case(study, on_block=course.advance)
    lacking = _Lacking(case=case, whole=study.problem.whole, call=call, course=course)

    def arranged(arrangement: Arrangement) -> Arrangement:
        if arrangement.named is None:
            return arrangement
        law, taken = lacking.design(arrangement.named)
        return replace(arrangement, law=law, taken=taken, named=None)

    with study.origin.place.prefix_errors(SettingError):
        made = replace(study, arrangements=tuple(read_each(arranged, study.arrangements)))
        made.check_readings()
    return made


@dataclass(frozen=True, kw_only=True)
class _Lacking:
    """Runs from which settings that laws lack are taken; none is simulated before a law asks."""

    case: LoopCase
    whole: DesignProblem
    call: LongCall[Study]
    course: RunReports

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
                digest_of_run(self.case.under(None, problem.all_devices).arrangement, *problem.motions),
            )
            return named.design(problem, taken.settings), taken

    @cached_property
    def _shaken(self) -> DesignProblem:
        """The problem with the motion that the response of its dampers lets expect."""
        whole, (_, _, expected) = self.whole, self._response
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
        scanned: dict[str, list[float]] = {}
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
                steps = np.linspace(lower, upper, LEVELS) if linear else np.geomspace(lower, upper, _STEPS)
                scanned[entry.name] = [*map(round_to, steps.tolist())]
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
        scanned: Mapping[str, Sequence[float]],
        problem: DesignProblem,
    ) -> tuple[dict[str, float], str]:
        """The values of the lowest score, all scanned settings from the one end to the other together."""
        law, active = named.table.law, control_law(named.table.law).commands_force
        many = [dict(zip(scanned, values, strict=True)) for values in zip(*scanned.values(), strict=True)]
        designed = design_candidates(law, problem, [settings_of(law, {**held, **item}) for item in many])
        (off, on, _), scores = self._response, np.full(len(many), math.inf)
        self.course.begin(f"settings of {law}")
        # What no candidate can be designed for, the design of the chosen one refuses.
        if designed.law is not None:
            runs = self.case.under(named.shaped(designed.law), problem.all_devices).criteria()
            of_runs = runs.scores(off, self.case.scored).mean(axis=(1, 2))
            if active:
                within = (runs.peak_force <= on.peak_force)[:, :, 0].all(axis=1)
                of_runs = np.where(within, of_runs, math.nan)
            scores[list(designed.designed)] = searched(of_runs)
        unit = command_unit_of(problem.devices)
        units = {entry.name: in_command_unit(entry.says.unit, unit) for entry in keys_of(SETTINGS[law])}
        spans = (
            f"{name} from {ends[0]:.3g} to {ends[-1]:.3g} {units[name]}" for name, ends in scanned.items()
        )
        ranges, of = list_names([span.rstrip() for span in spans]), f"of {len(many)} values"
        if not np.isfinite(scores).any():
            return many[len(many) // 2], f"{ranges}, the middle, since none {of} has a score"
        number, best = len(problem.motions), int(np.argmin(scores))
        judged_on = f"the {'motion' if number == 1 else counted(number, 'motion')} that it is judged on, too"
        motions = judged_on if problem.judged else counted(number, "training motion")
        limit = " with no more force than the dampers at the largest command" if active else ""
        return many[best], f"{ranges}, the best {of}{limit} (score {scores[best]:.3f} on {motions})"

    @cached_property
    def _response(self) -> tuple[Runs, Runs, Magnitudes]:
        """Criteria of the dampers at i = 0 and at the largest command, and the magnitudes that follow from them."""
        problem = self.whole
        self.course.begin("dampers at i = 0 and at the largest command")
        case = replace(self.case, dampers_only=True)
        off, on = (case.under(constant_share(problem.devices, share)).criteria() for share in (0.0, 1.0))
        magnitudes = magnitudes_of_runs(problem.building, problem.motions, off, on, problem.devices)
        return off, on, magnitudes
