"""Run a study: every arrangement under every motion, and the non-causal optimum; a journal records each run."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType

import numpy as np

from mrwork.arguments import Threads, checked
from mrwork.buildings import Building
from mrwork.buildings.matrices import Device
from mrwork.closed_loop.clairvoyant_search import (
    Clairvoyant,
    ClairvoyantProgress,
    ClairvoyantStart,
    clairvoyant,
)
from mrwork.closed_loop.evaluation import score, values
from mrwork.closed_loop.hardware import Hardware
from mrwork.closed_loop.responses import Responses, history_signals
from mrwork.closed_loop.simulate import (
    LoopVariation,
    PrescribedCommands,
    simulate_loop,
    simulate_prescribed,
)
from mrwork.control.design_problem import ReferencePeaks
from mrwork.control.laws import ControlLaw
from mrwork.dampers.spec import damper
from mrwork.errors import Interrupted, JournalError, SettingError, SimulationError
from mrwork.motions import GroundMotion
from mrwork.numbers import counted, duration_in_words
from mrwork.store.codec import OrNan, digest_of
from mrwork.store.journal import Journal
from mrwork.study.arrangements import constant_command, constant_commands
from mrwork.study.damper_size import DevicePlace
from mrwork.study.labelled import (
    HALF_STEP,
    NOMINAL,
    LabelledRuns,
    Place,
    candidate_axes,
    criteria_of_runs,
    criteria_of_study,
    numbered,
    quantities_of_runs,
    recall_or_compute_runs,
)
from mrwork.study.results import MotionFacts, StudyResults
from mrwork.study.run_result import (
    RunHistory,
    RunResult,
    history_of,
    own_numbers,
    read_recorded,
    results_of,
)
from mrwork.study.schema import PASSIVE_OFF, PASSIVE_ON
from mrwork.study.study import (
    Arrangement,
    Realisations,
    Study,
    StudyLaw,
    digest_of_run,
    fingerprint_of,
)
from mrwork.summary import list_names
from mrwork.units import STANDARD_GRAVITY
from mrwork.values import Floats

# Histories that need more memory than this are simulated one at a time.
_MOST_HISTORY_BYTES = 2.0**28

LEVELS = 21
"""Number of constant commands, equally spaced from zero to the largest, among which the best is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class StudyProgress:
    """Progress of a study: runs done and in total, the label of the present ones, elapsed time [s]."""

    done: int
    total: int
    label: str
    seconds: float

    @property
    def in_words(self) -> str:
        """Progress in one line: completed runs, the next ones, the remaining time."""
        parts = [f"{self.done} of {self.total} runs", self.label, duration_in_words(self.seconds)]
        if self.done:
            left = self.seconds * (self.total - self.done) / self.done
            parts.append(f"about {duration_in_words(left)} left")
        return ", ".join(parts)

    @property
    def share(self) -> float | None:
        """Share that is done, `None` where it is not known."""
        return self.done / self.total if self.total else None


@dataclass(frozen=True, slots=True, kw_only=True)
class BestConstant:
    """The constant command with the lowest score, among those from i = 0 to the largest, and what the choice took.

    Journals that are older have neither the scores of these commands, nor the number of runs. Without any score the
    command is 0.
    """

    command: float
    score: OrNan
    scores: tuple[OrNan, ...] = ()
    runs: int = 0

    def in_words(self, label: str, largest: float, unit: str) -> str:
        """The choice in a sentence, with the ends of the scan; empty where its scores are not known."""
        if not self.scores:
            return ""
        cost = f"{counted(self.runs, 'run')} in one batch"
        if math.isnan(self.score):
            return f"{label} is at i = 0: none of {len(self.scores)} constant commands has a score ({cost})."
        return (
            f"{label} is the best of {len(self.scores)} constant commands, score {self.score:.3f}: from {PASSIVE_OFF}, "
            f"0 {unit}, {self.scores[0]:.3f}, to {PASSIVE_ON}, {largest:.3g} {unit}, {self.scores[-1]:.3f} ({cost})."
        )


@checked
def run_study(
    study: Study,
    *,
    journal: Journal | None = None,
    kept: Callable[[int, int], bool] = lambda row, motion: True,
    keep: Callable[[int, int, RunHistory], None] = lambda row, motion, history: None,
    on_progress: Callable[[StudyProgress], None] = lambda progress: None,
    check_step: bool = False,
    threads: Threads = 0,
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
    check_step
        Repeat every run with half the step at the end.

    Raises
    ------
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
    began = time.perf_counter()
    if journal is not None:
        journal.agree("study", fingerprint_of(study))
    arrangements = list(study.arrangements)
    runs: dict[Place, RunResult] = {}
    clairvoyants: dict[int, Clairvoyant] = {}
    realised: dict[int, LabelledRuns] = {}
    choices: list[str] = []
    played = PlayedCommands(study=study, threads=threads)
    bare, building_warnings = study.building, study.building_warnings

    steps = (NOMINAL, HALF_STEP) if check_step else (NOMINAL,)

    def results() -> StudyResults:
        rows = (*(each.row for each in arrangements), *study.rows[len(arrangements) :])
        axes = {
            "row": tuple(each.label for each in rows),
            "motion": tuple(each.name for each in study.motions),
            "realisation": steps,
        }
        places = {"floor": bare.floor_names, "storey": bare.storey_names[: len(bare.drifts)]}
        n_realisations = 0 if study.realisations is None else len(study.realisations)
        return StudyResults(
            title=study.title,
            rows=rows,
            motions=tuple(map(MotionFacts.of, study.motions)),
            quantities=quantities_of_runs(runs, axes | places, study.command_unit),
            labelled=criteria_of_study(
                runs,
                realised,
                axes | {"realisation": (*steps, *numbered(n_realisations))},
                study.command_unit,
                weight=bare.total_mass * STANDARD_GRAVITY,
            ),
            chosen_on=tuple(ground.name for ground in study.chosen_on),
            device_names=study.device_names,
            devices=study.devices,
            device_places=tuple(DevicePlace.of(bare, storey) for storey in study.device_storeys),
            choices=tuple(choices),
            command_unit=study.command_unit,
            facts=study.facts,
            clairvoyants=dict(clairvoyants),
            building_warnings=building_warnings,
        )

    def report(label: str) -> None:
        total, seconds = len(study.rows) * len(study.motions) * len(steps), time.perf_counter() - began
        on_progress(StudyProgress(done=len(runs), total=total, label=label, seconds=seconds))

    try:
        for row, arrangement in enumerate(arrangements):
            report(arrangement.row.label)
            known: Mapping[int, RunResult] = {}
            if arrangement.law is None:
                arrangements[row], known, choice = _choose_best_constant(study, arrangement, journal, threads)
                choices += [choice] if choice else []
            fresh: dict[int, RunHistory | None] = {}
            for motion, result in runs_of(
                study, arrangements[row], journal, threads, fresh=fresh, known=known
            ):
                runs[row, motion, 0] = result
            for motion in study.histories:
                # The history of a run that did not finish holds numbers that are not finite.
                if not runs[row, motion, 0].finished:
                    continue
                if motion in fresh or not kept(row, motion):
                    history = fresh.get(motion) or _history(study, arrangements[row], motion, threads)
                    keep(row, motion, history)
        if study.clairvoyant is not None:
            row = len(arrangements)
            for motion in range(len(study.motions)):
                # The searches start from the commands of the best law, too.
                found = played.search_optimum(motion, arrangements, results(), journal, report)
                clairvoyants[motion] = found
                runs[row, motion, 0], drawn = played.run(motion, found, histories=True)
                if motion in study.histories and runs[row, motion, 0].finished and not kept(row, motion):
                    assert drawn is not None
                    keep(row, motion, drawn)
        # After all other runs, so that a study without this check can be resumed with it.
        if check_step:
            for row, arrangement in enumerate(arrangements):
                report(f"{arrangement.row.label}, half the step")
                for motion, result in runs_of(study, arrangement, journal, threads, step_factor=2):
                    runs[row, motion, 1] = result
            for motion, found in clairvoyants.items():
                runs[len(arrangements), motion, 1], _ = played.run(motion, found, step_factor=2)
        if study.realisations is not None:
            for row, arrangement in enumerate(arrangements):
                report(f"{arrangement.row.label}, realisations")
                realised[row] = _criteria_of_realisations(study, arrangement, journal, threads)
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
) -> Iterator[tuple[int, RunResult]]:
    """The run under each motion: recalled, `known` from before, or simulated with later ones.

    `fresh` collects the simulated motions, with their histories if the study keeps them and they fit into memory
    together: a run with its history takes half the time of one without and another with it. Where small strokes are
    outside the tested range of a damper, runs are simulated with their histories, as many together as fit.
    """
    step = "run" if step_factor == 1 else "run with half the step"
    simulated = dict(known)
    histories: dict[int, RunHistory] = {}
    for motion, ground in enumerate(study.grounds):
        inputs = digest_of_run(arrangement, ground)
        recalled = (
            None
            if journal is None
            else journal.recall(step, inputs, lambda record: read_recorded(record, arrangement))
        )
        if recalled is not None:
            yield motion, recalled
            continue
        if motion not in simulated:
            to_end = len(study.motions) - motion
            together = _histories_together(study, arrangement, motion)
            demanded = step_factor == 1 and _knows_least_strokes(arrangement)
            count = together if demanded else to_end
            stored = [
                number for number in study.histories if step_factor == 1 and 0 <= number - motion < count
            ]
            responses = _simulate(
                arrangement,
                study.grounds[motion : motion + count],
                study,
                histories=demanded or (bool(stored) and together == to_end),
                step_factor=step_factor,
                threads=threads,
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


def _history(study: Study, arrangement: Arrangement, motion: int, threads: int) -> RunHistory:
    responses = _simulate(
        arrangement, study.grounds[motion : motion + 1], study, histories=True, threads=threads
    )
    assert responses.histories is not None
    return history_of(responses.histories[0], arrangement)


def _knows_least_strokes(arrangement: Arrangement) -> bool:
    """Whether small strokes can be outside the tested range of a damper."""
    return any(device.knows_least_stroke for device in arrangement.devices) and not arrangement.has_actuators


def _histories_together(study: Study, arrangement: Arrangement, first: int) -> int:
    """Number of motions from `first` on, at least one, whose histories fit into memory together."""
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
    seconds = np.cumsum([motion.duration for motion in study.grounds[first:]])
    needed = 8.0 * width * seconds / study.hardware.sample_time
    return max(1, int(np.sum(needed < _MOST_HISTORY_BYTES)))


def _simulate(
    arrangement: Arrangement,
    motions: Sequence[GroundMotion],
    study: Study,
    *,
    histories: bool = False,
    step_factor: int = 1,
    threads: Threads = 0,
) -> Responses:
    """Simulate an arrangement under these motions; without devices it gets an actuator of zero force."""
    assert arrangement.law is not None
    devices, law = with_devices(arrangement, arrangement.law)
    return simulate_loop(
        arrangement.building,
        devices,
        law,
        motions,
        study.hardware,
        histories=histories,
        step_factor=step_factor,
        threads=threads,
    )


def _choose_best_constant(
    study: Study, arrangement: Arrangement, journal: Journal | None, threads: int
) -> tuple[Arrangement, Mapping[int, RunResult], str]:
    """The arrangement with the constant command of the lowest score, its known runs unless it is recalled, and words.

    Where the study adds it by itself and no command has a score, the command is 0.
    """
    known: dict[int, RunResult] = {}

    def search() -> BestConstant:
        try:
            best, runs, _ = _best_level(arrangement, study.chosen_on, study.hardware, threads)
        except SimulationError:
            if not arrangement.added:
                raise
            return BestConstant(command=0.0, score=math.nan, scores=(math.nan,) * LEVELS)
        if not _knows_least_strokes(arrangement):
            known.update(
                (motion, run)
                for motion, ground in enumerate(study.grounds)
                for chosen, run in zip(study.chosen_on, runs, strict=True)
                if ground is chosen
            )
        return best

    if journal is None:
        best = search()
    else:
        inputs = digest_of_run(arrangement, *study.chosen_on)
        best = journal.once("best_constant", inputs, BestConstant, search)
        if best.command not in _levels(arrangement):
            raise JournalError(
                f"{journal.path} has a best constant command of {best.command:g} {study.command_unit}, which is "
                "none of those that are tried; run again without --resume"
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
    return np.linspace(0.0, min(device.largest_command for device in arrangement.devices), LEVELS)


def _best_level(
    arrangement: Arrangement, motions: Sequence[GroundMotion], hardware: Hardware, threads: int
) -> tuple[BestConstant, list[RunResult], list[dict[str, Floats]]]:
    """The constant command of the lowest score, and its runs and their criteria, one for each motion.

    A command has no score if one of its runs failed.
    """
    commands, weight = _levels(arrangement), arrangement.building.total_mass * STANDARD_GRAVITY
    devices, law = with_devices(arrangement, constant_commands(arrangement.devices, commands))
    responses = simulate_loop(arrangement.building, devices, law, motions, hardware, threads=threads)
    runs = results_of(responses, arrangement)
    levels = [runs[start : start + len(motions)] for start in range(0, len(runs), len(motions))]
    criteria = [[_criteria(result, weight) for result in level] for level in levels]
    # The first command is i = 0.
    scores = [float(score(each, criteria[0])) for each in criteria]
    if np.isnan(scores).all():
        raise SimulationError(
            f"{arrangement.row.label}: no constant command has a score, because under "
            f"{list_names([ground.name for ground in motions])} the run at i = 0, or at every command, "
            "did not finish or has no response; check the dampers and the step, or leave best_passive out"
        )
    best = int(np.nanargmin(scores))
    found = BestConstant(
        command=float(commands[best]),
        score=scores[best],
        scores=tuple(scores),
        runs=len(runs),
    )
    return found, levels[best], criteria[best]


def reference_peaks_of(
    arrangement: Arrangement, motions: Sequence[GroundMotion], hardware: Hardware
) -> ReferencePeaks:
    """The best constant command of an arrangement on these motions, and the mean peaks under it, to four digits."""
    best, _, criteria = _best_level(arrangement, motions, hardware, 0)

    def mean(name: str) -> float:
        return float(f"{np.mean([each[name] for each in criteria]):.4g}")

    return ReferencePeaks(
        command=float(f"{best.command:.4g}"),
        drift=mean("peak_drift"),
        acceleration=mean("peak_acceleration"),
    )


def _criteria(result: RunResult, weight: float) -> dict[str, Floats]:
    criterion_values = values(result, weight=weight)
    return criterion_values if result.finished else {name: np.array(np.nan) for name in criterion_values}


@dataclass(frozen=True, slots=True, kw_only=True)
class PlayedCommands:
    """The non-causal optimum of a study that asks for it, under each of its motions."""

    study: Study
    threads: int

    def search_optimum(
        self,
        motion: int,
        arrangements: Sequence[Arrangement],
        results: StudyResults,
        journal: Journal | None,
        report: Callable[[str], None],
    ) -> Clairvoyant:
        """The optimum under a motion; one of the starts are the commands of the best law of `results`."""
        asked, base = self.study.clairvoyant, self.study.at_zero
        assert asked is not None
        ground = self.study.grounds[motion]

        def recall(name: str, start: Floats, search: Callable[[], ClairvoyantStart]) -> ClairvoyantStart:
            report(f"{asked.row.label}, {ground.name}: {name}")
            if journal is None:
                return search()
            inputs = digest_of(digest_of_run(base, ground), asdict(asked.settings), name, start)
            return journal.once("clairvoyant", inputs, ClairvoyantStart, search)

        def on_progress(progress: ClairvoyantProgress) -> None:
            report(
                f"{asked.row.label}, {ground.name}: {progress.start}, iteration {progress.iteration} of "
                f"{progress.iterations}, score about {progress.smooth_score:.3f}"
            )

        return clairvoyant(
            base.building,
            base.devices,
            ground,
            self.study.hardware,
            settings=asked.settings,
            starts=self._law_starts(motion, arrangements, results),
            floors=base.floors,
            storeys=base.storeys,
            on_progress=on_progress,
            recall=recall,
            threads=self.threads,
        )

    def run(
        self, motion: int, optimum: Clairvoyant, *, histories: bool = False, step_factor: int = 1
    ) -> tuple[RunResult, RunHistory | None]:
        """The run of the loop with the commands that were found, and its history."""
        base = self.study.at_zero
        responses = simulate_prescribed(
            base.building,
            base.devices,
            optimum.commands,
            self.study.grounds[motion],
            self.study.hardware,
            histories=histories,
            step_factor=step_factor,
            threads=self.threads,
        )
        kept = None if responses.histories is None else history_of(responses.histories[0], base)
        return results_of(responses, base)[0], kept

    def _law_starts(
        self, motion: int, arrangements: Sequence[Arrangement], results: StudyResults
    ) -> dict[str, PrescribedCommands]:
        """Commands of the control law with the lowest score under a motion, if there is one."""
        asked = self.study.clairvoyant
        assert asked is not None
        laws = [
            (results.score_under(row, (motion,)), row)
            for row, each in enumerate(arrangements)
            if each.row.kind == "controller" and row in results.finished_rows(motion)
        ]
        if not laws:
            return {}
        best = arrangements[min(laws)[1]]
        assert best.law is not None
        run = simulate_loop(
            best.building,
            best.devices,
            best.law,
            [self.study.grounds[motion]],
            self.study.hardware,
            histories=True,
            threads=self.threads,
        )
        assert run.histories is not None
        return {
            best.row.label: PrescribedCommands.of_history(
                run.histories[0].command, self.study.hardware.sample_time, asked.settings.interval
            )
        }


def simulate_criteria(
    arrangement: Arrangement,
    law: StudyLaw,
    motions: Sequence[GroundMotion],
    hardware: Hardware,
    realisations: Realisations,
    *,
    bare: Building,
    largest_commands: Floats | None = None,
    shaping: Floats | None = None,
    threads: int = 0,
) -> LabelledRuns:
    """Simulate candidates of a law under motions, with realisations, in one call of the core.

    The arrangement has building and devices; the law may have one or many candidates. The observer, if there is one,
    is that of the nominal building. `largest_commands` and `shaping` are those of the candidates, see `simulate_loop`.
    """
    weight = bare.total_mass * STANDARD_GRAVITY
    noisy = any(noise for noise, _ in hardware.sensors)
    fitted, law = with_devices(arrangement, law)
    # Without dampers of its own an arrangement has a device without parameters to vary.
    theta = realisations.theta if arrangement.devices else tuple(device.draws for device in fitted)
    factors = list(zip(realisations.stiffness.tolist(), realisations.damping.tolist(), strict=True))
    buildings = {
        (stiffness, damping): vary_building(arrangement, bare, stiffness=stiffness, damping=damping)
        for stiffness, damping in dict.fromkeys(factors)
    }
    began = time.perf_counter()
    responses = simulate_loop(
        arrangement.building,
        tuple(replace(device, theta=rows) for device, rows in zip(fitted, theta, strict=True)),
        law,
        motions,
        hardware,
        largest_commands=largest_commands,
        shaping=shaping,
        variation=LoopVariation(
            buildings=tuple(buildings[each] for each in factors),
            delay=realisations.delay,
            seed=realisations.seed if noisy else np.zeros_like(realisations.seed),
        ),
        threads=threads,
    )
    seconds = time.perf_counter() - began
    own = responses.with_numbers(**own_numbers(responses, arrangement, law))
    found = criteria_of_runs(candidate_axes(responses.shape[0], motions, realisations))
    for name, array in values(own, weight=weight).items():
        found.numbers[name][...] = np.where(np.isfinite(array), array, np.inf).reshape(responses.shape)
    found.numbers["energy_error"][...] = responses.energy_error.reshape(responses.shape)
    return replace(found, seconds=seconds)


def with_devices(arrangement: Arrangement, law: StudyLaw) -> tuple[tuple[Device, ...], StudyLaw]:
    """Devices and law of an arrangement; without devices it gets an actuator of zero force."""
    if arrangement.devices:
        return arrangement.devices, law
    building, spec = arrangement.building, damper("dahl")
    device = Device(name="none", spec=spec, theta=spec.nominal, row=building.storeys[0], largest_command=1.0)
    still = ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * building.n_coordinates))})
    return (device,), still


def vary_building(arrangement: Arrangement, bare: Building, *, stiffness: float, damping: float) -> Building:
    """The building of an arrangement with factors of stiffness and damping of the bare building.

    What is built into it stays, such as the spring of a tuned mass, so that it is no longer tuned.
    """
    if stiffness == 1.0 and damping == 1.0:
        return arrangement.building
    building = arrangement.building
    drifts = bare.drifts
    if building.n_coordinates == bare.n_coordinates:
        back: Floats = np.eye(bare.n_coordinates)
    elif drifts.shape[0] == bare.n_coordinates and np.linalg.matrix_rank(drifts) == bare.n_coordinates:
        # Displacements of the bare building relative to its base, from its drifts within the arrangement.
        back = np.asarray(np.linalg.solve(drifts, building.storeys[list(arrangement.storeys)]))
    else:
        raise SettingError(
            f"{building.name}: stiffness and damping of the building cannot be told from those of what was added to "
            "it, because its storeys do not determine its coordinates; leave stiffness and damping out of [uncertainty]"
        )
    return replace(
        building,
        stiffness=building.stiffness + (stiffness - 1.0) * back.T @ bare.stiffness @ back,
        damping=building.damping + (damping - 1.0) * back.T @ bare.damping @ back,
    )


def _criteria_of_realisations(
    study: Study, arrangement: Arrangement, journal: Journal | None, threads: int
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
        )

    inputs = digest_of_run(arrangement, *study.grounds)
    axes = candidate_axes(1, study.grounds, realisations)
    return recall_or_compute_runs(journal, "realisations", inputs, axes, simulate)
