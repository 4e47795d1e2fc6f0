"""Run a study: every arrangement under every motion, and the non-causal optimum; a journal records each run."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType

import numpy as np

from mrwork.base.arguments import Threads, checked
from mrwork.base.numbers import counted, round_to
from mrwork.base.summary import list_names
from mrwork.base.units import STANDARD_GRAVITY
from mrwork.base.values import Floats
from mrwork.buildings import Building
from mrwork.buildings.groups import largest_command
from mrwork.closed_loop.evaluation import Scales, score, values
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.responses import Responses, history_signals
from mrwork.closed_loop.simulate import loop_observer, measured_floors, simulate_loop
from mrwork.control.laws.law_problem import ReferencePeaks
from mrwork.errors import Interrupted, JournalError, SimulationError
from mrwork.motions import GroundMotion
from mrwork.store.journal import Journal
from mrwork.study.course import Course, Part, PartKey, StudyProgress, excerpts_of, stiffness_in_words
from mrwork.study.loop_runs import OnBlock, simulate_criteria, with_devices
from mrwork.study.results import Key, MotionFacts, StudyResults, judged_by_demand
from mrwork.study.run_result import (
    HALF_STEP,
    NOMINAL,
    LabelledRuns,
    RunHistory,
    RunResult,
    candidate_axes,
    criteria_of_study,
    history_of,
    knows_least_strokes,
    numbered,
    read_recorded,
    recall_or_compute,
    recall_or_compute_runs,
    results_of,
)
from mrwork.study.schema import PASSIVE_OFF, PASSIVE_ON
from mrwork.study.study import (
    Arrangement,
    Realisations,
    Study,
    constant_command,
    digest_of_run,
    fingerprint_of,
)
from mrwork.workers.engine import Workers, on_executor, present_workers

# Realisations of a trial: they fill the lanes of some threads.
_TRIED_REALISATIONS = 64
# Buildings, motions and histories that are named as the reason of a long study.
_MANY_COORDINATES, _MANY_SAMPLES, _MANY_BYTES = 50, 200_000, 1e8

# Histories that need more memory than this are simulated one at a time.
_MOST_HISTORY_BYTES = 2.0**28

LEVELS = 21
"""Number of constant commands, equally spaced from zero to the largest, among which the best is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class BestConstant:
    """Constant command with the lowest score, of those from i = 0 to the largest, with all scores and the runs.

    Without any score the command is 0.
    """

    command: float
    score: float
    scores: tuple[float, ...]
    runs: int

    def in_words(self, label: str, largest: float, unit: str) -> str:
        """The choice in a sentence, with the ends of the scan."""
        cost = f"{counted(self.runs, 'run')} in one batch"
        if math.isnan(self.score):
            return f"{label} is at i = 0: none of {len(self.scores)} constant commands has a score ({cost})."
        return (
            f"{label} is the best of {len(self.scores)} constant commands, score {self.score:.3f}: from {PASSIVE_OFF}, "
            f"0 {unit}, {self.scores[0]:.3f}, to {PASSIVE_ON}, {largest:.3g} {unit}, {self.scores[-1]:.3f} ({cost})."
        )


@checked
@on_executor
def run_study(
    study: Study,
    *,
    journal: Journal | None = None,
    kept: Callable[[int, int], bool] = lambda row, motion: True,
    keep: Callable[[int, int, RunHistory], None] = lambda row, motion, history: None,
    on_progress: Callable[[StudyProgress], None] | None = None,
    check_step: bool = False,
    threads: Threads = 0,
    executor: Executor | Workers | None = None,  # noqa: ARG001, of the decorator
) -> StudyResults:
    """Run a study; runs in the journal are not repeated.

    Parameters
    ----------
    journal
        Records the runs, and recalls those of a study that was interrupted; `None` for no record.
    kept
        Whether the history of a (row, motion) is stored already; a missing one is simulated again.
    keep
        Stores the history of a (row, motion).
    on_progress
        Called with the progress, which tells how long the study will take: it is tried first on parts of the motions.
    check_step
        Repeat every run with half the step at the end.
    executor
        Does the runs in chunks: an executor of `concurrent.futures`, Dask, mpi4py or loky, or `Workers`. The results
        have the same bits. By default this process does them, as always those of laws in Python.

    Raises
    ------
    WorkerError
        If the executor or one of its workers is lost; a journal keeps what was finished.
    Interrupted
        On Ctrl-C, with the `StudyResults` of the runs that are done.
    JournalError
        If the journal belongs to another study.

    Examples
    --------
    >>> import mrwork as mr
    >>> results = mr.run_study(mr.read_study("study.toml"))  # doctest: +SKIP
    >>> results.criteria(0, 0)["peak_drift"]  # doctest: +SKIP
    0.0236
    """
    if journal is not None:
        journal.agree("study", fingerprint_of(study))
    arrangements = list(study.arrangements)
    runs: dict[Key, RunResult] = {}
    halved: dict[Key, RunResult] | None = {} if check_step else None
    realised: dict[int, LabelledRuns] = {}
    choices: list[str] = []
    bare, study_warnings = study.building, study.warnings

    steps = (NOMINAL, HALF_STEP) if check_step else (NOMINAL,)

    def results() -> StudyResults:
        rows = tuple(arrangement.row for arrangement in arrangements)
        axes = {
            "row": tuple(row.label for row in rows),
            "motion": tuple(motion.name for motion in study.motions),
            "realisation": steps,
        }
        n_realisations = 0 if study.realisations is None else len(study.realisations)
        nominal = {(*key, 0): run for key, run in runs.items()}
        made = StudyResults(
            title=study.title,
            rows=rows,
            motions=tuple(map(MotionFacts.of, study.motions)),
            runs=dict(runs),
            halved=None if halved is None else dict(halved),
            floor_names=bare.floor_names,
            storey_names=bare.storey_names[: len(bare.drifts)],
            labelled=criteria_of_study(
                nominal | {(*key, 1): run for key, run in (halved or {}).items()},
                realised,
                axes | {"realisation": (*steps, *numbered(n_realisations))},
                study.command_unit,
                [_scales_of(each, bare) for each in arrangements],
            ),
            chosen_on=tuple(ground.name for ground in study.chosen_on),
            design_levels=study.design_levels,
            limit=study.limit,
            choices=tuple(choices),
            command_unit=study.command_unit,
            facts=study.facts,
            study_warnings=study_warnings,
            detailed=study.detailed,
            with_histories=tuple(study.report.select_drawn([row.label for row in rows])),
        )
        return judged_by_demand(made, study.devices, bare, study.device_storeys)

    course = Course(
        _parts(study, threads, halves=check_step),
        on_progress,
        total=len(study.rows) * len(study.motions) * len(steps),
        reasons=partial(_reasons, study),
    )

    def report(label: str, key: PartKey | None = None) -> None:
        recalling = journal is not None and journal.recalling
        course.begin(key, label, len(runs) + len(halved or ()), recalling=recalling)

    try:
        for row, arrangement in enumerate(arrangements):
            known: Mapping[int, RunResult] = {}
            if arrangement.law is None:
                report(arrangement.row.label, (row, "levels"))
                arrangements[row], known, choice = _choose_best_constant(
                    study, arrangement, journal, threads, course.advance
                )
                choices.append(choice)
            report(arrangements[row].row.label, (row, "runs"))
            fresh: dict[int, RunHistory | None] = {}
            for motion, result in runs_of(
                study, arrangements[row], journal, threads, fresh=fresh, known=known, on_block=course.advance
            ):
                runs[row, motion] = result
            for motion in study.histories:
                # The history of a run that did not finish holds numbers that are not finite.
                if not runs[row, motion].finished:
                    continue
                if motion in fresh or not kept(row, motion):
                    # No name holds a history, which may be hundreds of megabytes, while the next one is simulated.
                    again = partial(simulate_history, study, arrangements[row], motion, threads)
                    keep(row, motion, fresh.pop(motion, None) or again())
        # After all other runs, so that a study without this check can be resumed with it.
        if halved is not None:
            for row, arrangement in enumerate(arrangements):
                report(f"{arrangement.row.label}, half the step", (row, "half"))
                for motion, result in runs_of(
                    study, arrangement, journal, threads, step_factor=2, on_block=course.advance
                ):
                    halved[row, motion] = result
        if study.realisations is not None:
            for row, arrangement in enumerate(arrangements):
                report(f"{arrangement.row.label}, realisations", (row, "realisations"))
                realised[row] = _criteria_of_realisations(
                    study, arrangement, journal, threads, course.advance
                )
    except KeyboardInterrupt:
        raise Interrupted(results(), "study") from None
    return results()


def runs_of(
    study: Study,
    arrangement: Arrangement,
    journal: Journal | None,
    threads: int,
    *,
    fresh: dict[int, RunHistory | None] | None = None,
    known: Mapping[int, RunResult] = MappingProxyType({}),
    step_factor: int = 1,
    on_block: OnBlock | None = None,
) -> Iterator[tuple[int, RunResult]]:
    """The run of an arrangement under each motion: from the journal, from `known`, or simulated.

    `fresh` collects the simulated motions, with their histories if the study keeps them and they fit into memory
    together: a run with its history takes half the time of one without and another with it. Where small strokes are
    outside the tested range of a damper, runs are simulated with their histories, as many together as fit.
    """
    step = "run" if step_factor == 1 else "run with half the step"
    simulated = dict(known)
    histories: dict[int, RunHistory] = {}
    for motion, ground in enumerate(study.grounds):
        inputs = digest_of_run(arrangement, ground)
        read = partial(read_recorded, arrangement=arrangement)
        recalled = None if journal is None else journal.recall(step, inputs, read)
        if recalled is not None:
            yield motion, recalled
            continue
        if motion not in simulated:
            to_end = len(study.motions) - motion
            together = _histories_together(study, arrangement, motion)
            demanded = step_factor == 1 and knows_least_strokes(arrangement)
            count = together if demanded else to_end
            stored = [
                number for number in study.histories if step_factor == 1 and 0 <= number - motion < count
            ]
            responses = _simulate(
                arrangement,
                study.grounds[motion : motion + count],
                study,
                # Workers send none back: this process simulates the ones to be stored again.
                histories=demanded or (bool(stored) and together == to_end and present_workers() is None),
                step_factor=step_factor,
                threads=threads,
                on_block=on_block,
            )
            simulated |= enumerate(results_of(responses, arrangement), motion)
            if responses.histories is not None:
                histories = {
                    number: history_of(responses.histories[number - motion], arrangement) for number in stored
                }
        if journal is not None:
            journal.record(step, inputs, simulated[motion].as_record())
        if fresh is not None:
            fresh[motion] = histories.get(motion)
        yield motion, simulated[motion]


def _parts(study: Study, threads: int, *, halves: bool) -> dict[PartKey, Part]:
    """Parts of a study in the order of simulation, with trials that estimate their time."""
    n_motions = len(study.motions)
    parts: dict[PartKey, Part] = {}
    half: dict[PartKey, Part] = {}
    last: dict[PartKey, Part] = {}

    def excerpts(grounds: Sequence[GroundMotion], share: float) -> tuple[list[GroundMotion], float]:
        return excerpts_of(grounds, share, study.hardware.sample_time, study.building)

    for row, arrangement in enumerate(study.arrangements):
        fixed, grounds = arrangement, study.grounds
        if arrangement.law is None:
            best = constant_command(arrangement.devices, _levels(arrangement)[-1])
            fixed = replace(arrangement, law=best)
            if not knows_least_strokes(arrangement):
                chosen = {id(ground) for ground in study.chosen_on}
                grounds = tuple(ground for ground in grounds if id(ground) not in chosen)

            def levels(share: float, arrangement: Arrangement = arrangement) -> tuple[float, int]:
                cut, tried = excerpts(study.chosen_on, share)
                return tried, int(_simulate_levels(arrangement, cut, study.hardware, threads).steps.max())

            parts[row, "levels"] = Part(n_runs=LEVELS * len(study.chosen_on), trial=levels)

        stored = [study.grounds[number] for number in study.histories]
        with_all = knows_least_strokes(fixed) or (
            bool(stored) and len(grounds) == n_motions and _histories_together(study, fixed, 0) == n_motions
        )
        batches = [(grounds, with_all), (() if with_all else stored, True)]

        def runs(
            share: float,
            fixed: Arrangement = fixed,
            batches: Sequence[tuple[Sequence[GroundMotion], bool]] = batches,
        ) -> tuple[float, int]:
            steps, tried = 0, 1.0
            for motions, histories in batches:
                if motions:
                    cut, tried = excerpts(motions, share)
                    responses = _simulate(fixed, cut, study, histories=histories, threads=threads)
                    steps = max(steps, int(responses.steps.max()))
                    for history in (responses.histories or ())[: len(study.histories)]:
                        history_of(history, fixed)
            return tried, steps

        parts[row, "runs"] = Part(n_runs=len(grounds), trial=runs, prepare=partial(_observe, study, fixed))
        if halves:
            half[row, "half"] = Part(n_runs=n_motions, trial=runs, times=2.0)
        realisations = study.realisations
        if realisations is not None:
            tried_realisations = realisations.first(_TRIED_REALISATIONS)

            def simulate_part(
                share: float, fixed: Arrangement = fixed, own: Realisations = tried_realisations
            ) -> tuple[float, int]:
                assert fixed.law is not None
                cut, tried = excerpts(study.grounds, share)
                simulate_criteria(
                    fixed, fixed.law, cut, study.hardware, own, bare=study.building, threads=threads
                )
                return tried, 0

            last[row, "realisations"] = Part(
                n_runs=n_motions * len(realisations),
                trial=simulate_part,
                repeats=len(realisations) / len(tried_realisations),
            )
    return parts | half | last


def _observe(study: Study, arrangement: Arrangement) -> None:
    """Design the observer that the runs of an arrangement share, if they have one."""
    building, hardware = arrangement.building, study.hardware
    if arrangement.devices and hardware.feedback == "observer":
        loop_observer(building, arrangement.devices, hardware, measured_floors(building, hardware))


def _reasons(study: Study, n_runs: int, steps: int) -> tuple[str, ...]:
    """Reasons why a study of `n_runs` runs with `steps` integration steps per sample takes long."""
    hardware, n = study.hardware, study.building.n_coordinates
    longest = max(study.grounds, key=lambda ground: ground.duration)
    samples = round(longest.duration / hardware.sample_time)
    kept = sum(study.grounds[motion].duration for motion in study.histories)
    # In single precision.
    stored = 0.5 * sum(_bytes_per_second(study, arrangement) for arrangement in study.arrangements) * kept
    reasons = [f"{n_runs:,} runs"]
    if stiff := stiffness_in_words(study.devices, study.building, hardware, steps):
        reasons.append(stiff)
    if n >= _MANY_COORDINATES:
        reasons.append(f"the building has {n:,} coordinates")
    if samples >= _MANY_SAMPLES:
        reasons.append(f"{longest.name} lasts {longest.duration:,.0f} s, {samples:,} samples of the hardware")
    if stored >= _MANY_BYTES:
        reasons.append(
            f'histories take {stored / 1e9:.2g} GB on disk, which histories = "none" in [report] spares'
        )
    return tuple(reasons)


def simulate_history(study: Study, arrangement: Arrangement, motion: int, threads: int) -> RunHistory:
    """The history of an arrangement under a motion, by its index."""
    responses = _simulate(
        arrangement, study.grounds[motion : motion + 1], study, histories=True, threads=threads
    )
    assert responses.histories is not None
    return history_of(responses.histories[0], arrangement)


def _histories_together(study: Study, arrangement: Arrangement, first: int) -> int:
    """Number of motions from `first` on, at least one, whose histories fit into memory together."""
    seconds = np.cumsum([motion.duration for motion in study.grounds[first:]])
    needed = _bytes_per_second(study, arrangement) * seconds
    return max(1, int(np.sum(needed < _MOST_HISTORY_BYTES)))


def _bytes_per_second(study: Study, arrangement: Arrangement) -> float:
    """Memory of a run's history per second of motion [bytes/s]."""
    building = arrangement.building
    columns = {
        "run": 1,
        "floor": len(building.floors),
        "storey": len(building.storeys),
        "device": max(len(arrangement.devices), 1),
        "element": len(building.elements),
        "state": 2 * building.n_coordinates,
    }
    width = sum(columns[signal.axis] for signal in history_signals())
    return 8.0 * width / study.hardware.sample_time


def _simulate(
    arrangement: Arrangement,
    motions: Sequence[GroundMotion],
    study: Study,
    *,
    histories: bool = False,
    step_factor: int = 1,
    threads: Threads = 0,
    on_block: OnBlock | None = None,
) -> Responses:
    """Simulate an arrangement under these motions; without devices it gets an actuator of zero force."""
    assert arrangement.law is not None
    devices, law = with_devices(arrangement, arrangement.law)
    hardware = study.hardware
    if not arrangement.devices:
        # What nothing is fed back to needs no observer.
        hardware = replace(hardware, feedback="state", measured_floors=None, known_ground=False)
    return simulate_loop(
        arrangement.building,
        devices,
        law,
        motions,
        hardware,
        histories=histories,
        step_factor=step_factor,
        threads=threads,
        on_progress=on_block,
    )


def _choose_best_constant(
    study: Study, arrangement: Arrangement, journal: Journal | None, threads: int, on_block: OnBlock
) -> tuple[Arrangement, Mapping[int, RunResult], str]:
    """The arrangement at its best constant command, its runs unless recalled, and a sentence on the choice.

    Where the study adds it by itself and no command has a score, the command is 0.
    """
    known: dict[int, RunResult] = {}

    def search() -> BestConstant:
        try:
            best, runs, _ = _best_level(arrangement, study.chosen_on, study.hardware, threads, on_block)
        except SimulationError:
            if not arrangement.added:
                raise
            return BestConstant(command=0.0, score=math.nan, scores=(math.nan,) * LEVELS, runs=0)
        if not knows_least_strokes(arrangement):
            known.update(
                (motion, run)
                for motion, ground in enumerate(study.grounds)
                for chosen, run in zip(study.chosen_on, runs, strict=True)
                if ground is chosen
            )
        return best

    inputs = digest_of_run(arrangement, *study.chosen_on)
    best = recall_or_compute(journal, "best_constant", inputs, BestConstant, search)
    if journal is not None and best.command not in _levels(arrangement):
        raise JournalError(
            f"{journal.path} has a best constant command of {best.command:g} {study.command_unit}, which is "
            "none of those that are tried; run again with --replace, not --resume"
        )
    label = f"{arrangement.row.label}, {best.command:.3g} {study.command_unit}"
    with_command = replace(
        arrangement,
        row=replace(arrangement.row, label=label),
        law=constant_command(arrangement.devices, best.command),
    )
    largest = float(_levels(arrangement)[-1])
    return with_command, known, best.in_words(label, largest, study.command_unit)


def _levels(arrangement: Arrangement) -> Floats:
    return np.linspace(0.0, largest_command(arrangement.devices), LEVELS)


def _simulate_levels(
    arrangement: Arrangement,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    threads: int,
    on_block: OnBlock | None = None,
) -> Responses:
    devices, law = with_devices(arrangement, constant_command(arrangement.devices, *_levels(arrangement)))
    return simulate_loop(
        arrangement.building, devices, law, motions, hardware, threads=threads, on_progress=on_block
    )


def _best_level(
    arrangement: Arrangement,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    threads: int,
    on_block: OnBlock | None = None,
) -> tuple[BestConstant, list[RunResult], list[dict[str, Floats]]]:
    """Best constant command by the score, with its runs and their criteria, one for each motion.

    A command has no score if one of its runs failed.
    """
    commands, scales = _levels(arrangement), Scales(weight=arrangement.building.total_mass * STANDARD_GRAVITY)
    runs = results_of(_simulate_levels(arrangement, motions, hardware, threads, on_block), arrangement)
    levels = [runs[start : start + len(motions)] for start in range(0, len(runs), len(motions))]
    criteria = [[_criteria(result, scales) for result in level] for level in levels]
    # The first command is i = 0.
    scores = [float(score(level, criteria[0])) for level in criteria]
    if np.isnan(scores).all():
        raise SimulationError(
            f"{arrangement.row.label}: no constant command has a score, because under "
            f"{list_names([ground.name for ground in motions])} the run at i = 0, or at every command, "
            "did not finish or has no response; check the dampers and the step, or leave best_passive out"
        )
    best = int(np.nanargmin(scores))
    constant = BestConstant(
        command=float(commands[best]), score=scores[best], scores=tuple(scores), runs=len(runs)
    )
    return constant, levels[best], criteria[best]


def reference_peaks_of(
    arrangement: Arrangement, motions: Sequence[GroundMotion], hardware: Hardware
) -> ReferencePeaks:
    """The best constant command of an arrangement on these motions, and the mean peaks under it, to four digits."""
    best, _, criteria = _best_level(arrangement, motions, hardware, 0)

    def mean(name: str) -> float:
        return round_to(float(np.mean([of_run[name] for of_run in criteria])))

    return ReferencePeaks(
        command=round_to(best.command), drift=mean("peak_drift"), acceleration=mean("peak_acceleration")
    )


def _scales_of(arrangement: Arrangement, bare: Building) -> Scales:
    """What the criteria of an arrangement are divided by: numbers of its own storeys, which baselines may change."""
    own, storeys = arrangement.building, [*arrangement.storeys]
    heights, yields, loads = (
        each[storeys] if each.size else each for each in (own.heights, own.yield_drifts, own.loads)
    )
    return Scales(weight=Scales.of(bare).weight, heights=heights, yield_drifts=yields, loads=loads)


def _criteria(result: RunResult, scales: Scales) -> dict[str, Floats]:
    criterion_values = values(result, scales)
    return criterion_values if result.finished else {name: np.array(np.nan) for name in criterion_values}


def _criteria_of_realisations(
    study: Study, arrangement: Arrangement, journal: Journal | None, threads: int, on_block: OnBlock
) -> LabelledRuns:
    """Criteria of an arrangement under all motions with realisations, from the journal if it has them."""
    law, realisations = arrangement.law, study.realisations
    assert law is not None
    assert realisations is not None

    def simulate() -> LabelledRuns:
        return simulate_criteria(
            arrangement,
            law,
            study.grounds,
            study.hardware,
            realisations,
            bare=study.building,
            threads=threads,
            on_block=on_block,
        )

    inputs = digest_of_run(arrangement, *study.grounds)
    axes = candidate_axes(1, study.grounds, realisations)
    return recall_or_compute_runs(journal, "realisations", inputs, axes, simulate)
