"""Work on other processes: its overhead, what is sent, its memory, and how far more workers would help.

python studies/many_workers/study.py [--quick] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import heapq
import multiprocessing
import os
import pickle
import statistics
import time
from argparse import Namespace
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from functools import partial
from itertools import chain
from operator import truediv
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import mrwork as mr
from mrwork.closed_loop import LoopVariation
from mrwork.report import Table
from studies.former.command import Command, Findings, Say
from studies.former.processor import processor
from studies.former.table import table_of

STUDY = """title = "Many runs"
[building]
n_storeys = 3
masses = [300]
stiffnesses = [400e3]
modal_damping = {{ ratios = [0.01] }}
[[damper]]
storey = 1
preset = "kwok2006"
lag = 190
[[controller]]
law = "clipped_optimal"
settings = {{ drifts = 1, control_weight = 1e-11 }}
[uncertainty]
realisations = {draws}
stiffness = 0.1
[[tune]]
laws = ["clipped_optimal"]
robust = true
budget = {budget}
"""
MOTION = """[[motion]]
synthetic = "kanai_tajimi"
name = "{use} {seed}"
duration = "15 s"
seed = {seed}
pga = "0.2 g"
use = "{use}"
"""
# Of fits that take about half a second of one thread.
MODELS = (
    "bouc_wen",
    "normalised_bouc_wen",
    "modified_bouc_wen",
    "shear_thinning_modified_bouc_wen",
    "backlash_bouc_wen",
    "non_symmetric_bouc_wen",
)
TESTS = ("spencer1997", "spencer1997_slow", "spencer1997_fast")
WORKERS = (1, 2, 10, 100, 1000)
N_FOLDS, N_STOREYS = 30, 120
# Of a million runs: 24 candidates under 50 motions with 20 draws, in chunks of 334 runs.
GENERATION, N_GENERATIONS = 72, 42
# Of the client, one gigabit [B/s].
LINK = 125e6


@dataclass(frozen=True, slots=True, kw_only=True)
class Chunk:
    """A chunk as it was done alone: bytes sent (of which `shared` by all) and received, and its time [s]."""

    shared: int
    sent: int
    received: int
    seconds: float


@dataclass(slots=True)
class Recording(Executor):
    """Does each chunk at once, on one thread of this process; `calls` has the chunks of each call of the package."""

    calls: list[list[Chunk]] = field(default_factory=list)

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        shared = len(args[3].data)
        if shared:  # of the first chunk of a call
            self.calls.append([])
        sent = len(pickle.dumps((function, args, kwargs)))
        began = time.process_time()
        result = function(*args, **kwargs)
        seconds = time.process_time() - began
        chunk = Chunk(shared=shared, sent=sent, received=len(pickle.dumps(result)), seconds=seconds)
        self.calls[-1].append(chunk)
        future: Future[Any] = Future()
        future.set_result(result)
        return future


def recorded(work: Callable[[], object]) -> tuple[list[list[Chunk]], float]:
    """Chunks of work by their calls, and the time of the client beside them [s]."""
    recording = Recording()
    began = time.process_time()
    with mr.working_on(mr.Workers(recording, 1)):
        work()
    spent = time.process_time() - began
    return recording.calls, spent - sum(each.seconds for call in recording.calls for each in call)


def study_of(*, motions: int, draws: int, budget: int) -> mr.Study:
    """Three storeys with a damper, training motions of 15 s and one more, draws of the stiffness."""
    uses = ["training"] * motions + ["test"]
    text = STUDY.format(draws=draws, budget=budget)
    text += "".join(MOTION.format(seed=seed, use=use) for seed, use in enumerate(uses, start=1))
    with TemporaryDirectory() as folder:
        (Path(folder) / "study.toml").write_text(text, encoding="utf-8")
        return mr.read_study(Path(folder) / "study.toml")


def tuned(study: mr.Study) -> object:
    """Settings of a tuning on two threads."""
    return [(law.settings, law.judged) for law in mr.tune(study, rng=1, threads=2).laws]


def chosen(models: Sequence[str], tests: Sequence[str]) -> object:
    """Parameters of a choice of models on two threads."""
    choice = mr.choose_model([mr.synthetic_test(name) for name in tests], models, threads=2)
    return [list(fit.theta) for fit in choice.fits]


def overhead(work: Callable[[], object], repeats: int) -> dict[str, Any]:
    """Times of the same work on two threads and on two processes in turn, which must give equal results.

    Wall times, and those of processors, of client and workers together, on which other work has less effect [s].
    """
    wall: dict[str, list[float]] = {"threads": [], "workers": []}
    spent: dict[str, list[float]] = {"threads": [], "workers": []}
    results = []
    for turn in range(repeats):
        for name in sorted(wall, reverse=bool(turn % 2)):
            began, before = time.perf_counter(), _processor_seconds()
            with mr.local_workers(2 if name == "workers" else 0) as pool, mr.working_on(pool):
                results.append(work())
            wall[name].append(time.perf_counter() - began)
            spent[name].append(_processor_seconds() - before)
    assert all(result == results[0] for result in results)
    return {
        name: {**times, "ratio": statistics.median(map(truediv, times["threads"], times["workers"]))}
        for name, times in (("wall", wall), ("processors", spent))
    }


def _processor_seconds() -> float:
    """Time of processors of this process and of its children that have ended [s]."""
    for child in multiprocessing.active_children():
        child.join()
    return sum(os.times()[:4])


def tall(*, draws: int, candidates: int) -> Callable[[], object]:
    """Runs of a tall frame whose stiffness is drawn."""
    ratios = [0.02] * N_STOREYS
    frame = mr.buildings.with_modal_damping(
        mr.buildings.shear_building(name="tall", masses=[4e5] * N_STOREYS, stiffnesses=[8e8] * N_STOREYS),
        ratios=ratios,
    )
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    device = mr.Device(
        name="damper", spec=preset.spec, theta=preset.theta, row=frame.storeys[0], largest_command=1.88
    )
    problem = mr.control.DesignProblem(building=frame, devices=[device], sample_time=1e-3)
    one = mr.control.design_law("lyapunov", problem, {})
    law = mr.ControlLaw(
        name=one.name, gains={name: np.stack([gain] * candidates) for name, gain in one.gains.items()}
    )
    rng = np.random.default_rng(1)
    varied = [rng.uniform(0.9, 1.1) * frame.stiffness for _ in range(draws)]
    variation = LoopVariation(
        buildings=tuple(_with_stiffness(frame, stiffness) for stiffness in varied),
        delay=np.zeros(draws),
        seed=np.zeros(draws, dtype=np.int64),
    )
    motions = [mr.synthetic_motion(rng=seed, duration=1.0, peak=1.0) for seed in range(3)]
    hardware = mr.Hardware(sample_time=1e-3)
    return partial(mr.simulate_loop, frame, [device], law, motions, hardware, variation=variation)


def _with_stiffness(frame: mr.Building, stiffness: Any) -> mr.Building:

    return replace(frame, stiffness=stiffness)


def sizes(calls: list[list[Chunk]]) -> dict[str, float]:
    """Bytes of the largest call: of its shared value, and of a chunk beside it, sent and received, medians."""
    call = max(calls, key=len)
    return {
        "chunks": len(call),
        "shared": call[0].shared,
        "sent": statistics.median(each.sent - each.shared for each in call),
        "received": statistics.median(each.received for each in call),
    }


def peak(process: int | str) -> float:
    """Largest memory of a process so far [MB]."""
    lines = Path(f"/proc/{process}/status").read_text(encoding="utf-8").splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024.0


def memory(candidates: int) -> dict[str, float]:
    """Peaks of a client and of one of its two workers, for candidates under 50 motions with 20 draws [MB]."""
    study = study_of(motions=1, draws=20, budget=5)
    (device,) = study.devices
    draws = np.random.default_rng(1).uniform(0.9, 1.1, (20, 1)) * device.draws[0]
    device = replace(device, theta=draws)
    law = mr.ControlLaw(
        name="passive", gains={"command": np.linspace(0.0, device.largest_command, candidates)[:, None]}
    )
    motions = [mr.synthetic_motion(rng=seed, duration=1.0, peak=2.0) for seed in range(50)]
    before, began = peak("self"), time.perf_counter()
    with mr.local_workers(2) as pool, mr.working_on(pool):
        runs = mr.simulate_loop(study.building, [device], law, motions, study.hardware)
        assert pool is not None
        workers = [peak(each) for each in pool._processes]
    seconds = time.perf_counter() - began
    return {
        "runs": runs.peak_stroke.shape[0],
        "seconds": seconds,
        "before": before,
        "client": peak("self"),
        "worker": max(workers),
    }


def efficiency(calls: list[list[Chunk]], alone: float, workers: int, *, kept: bool = False) -> float:
    """Share of their time in which workers are busy, where a call begins after the last chunk of the one before.

    A free worker takes the next chunk, once the client has sent it over its link: twice as many as there are workers
    with what they share, unless that is `kept` from call to call. `alone` is the time of the client beside [s].
    """
    total, work = alone, alone
    for number, call in enumerate(calls):
        free, sent = [0.0] * workers, 0.0
        for place, chunk in enumerate(call):
            carries = place < 2 * workers and not (kept and number)
            sent += (chunk.sent - chunk.shared + (call[0].shared if carries else 0)) / LINK
            heapq.heapreplace(free, max(free[0], sent) + chunk.seconds)
            work += chunk.seconds
        total += max(free)
    return work / total / workers


def fit_seconds() -> dict[str, float]:
    """Time of an identification of each model from one test on one thread [s]."""
    test, found = mr.synthetic_test(TESTS[0]), {}
    for spec in mr.damper_models():
        began = time.process_time()
        mr.identify(spec, test, rng=0, threads=1)
        found[spec.name] = time.process_time() - began
    return found


def run(say: Say, *, quick: bool) -> dict[str, Any]:
    """Every figure."""
    study = study_of(motions=8, draws=4, budget=24) if quick else study_of(motions=50, draws=4, budget=48)
    choice = partial(chosen, MODELS[:4] if quick else MODELS, TESTS)
    repeats = 1 if quick else 3
    found: dict[str, Any] = {"processor": processor(), "load": os.getloadavg()[0], "overhead": {}}
    for name, work in (("runs", partial(tuned, study)), ("fits", choice)):
        say(f"overhead of {name}")
        found["overhead"] |= {f"{name}, {kind}": row for kind, row in overhead(work, repeats).items()}
    say("chunks of a tuning, of a study and of a choice, done alone")
    tuning, tuning_client = recorded(partial(tuned, study))
    realisations, study_client = recorded(partial(mr.run_study, study, threads=1))
    fits, fits_client = recorded(choice)
    sample, _ = recorded(partial(tuned, study_of(motions=1, draws=1, budget=96)))
    found["bytes"] = {
        "a tuning, 1 motion": sizes(sample),
        f"a tuning, {len(study.motions) - 1} motions": sizes(tuning),
        f"{N_STOREYS} storeys, 64 candidates": sizes(recorded(tall(draws=1, candidates=64))[0]),
        f"{N_STOREYS} storeys, 20 draws": sizes(recorded(tall(draws=20, candidates=4))[0]),
        "fits": sizes(fits),
    }
    found["memory"] = []
    for candidates in (1, 20 if quick else 1000):
        say(f"memory for {1000 * candidates:,} runs")
        with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as fresh:
            found["memory"].append(fresh.submit(memory, candidates).result())
    say("fits of every model")
    seconds = fit_seconds()
    per_fit = fits_client / sum(map(len, fits))
    like = max(fits, key=len)[0]
    folds = [replace(like, seconds=each) for each in seconds.values() for _ in range(N_FOLDS + 1)]
    found["fit_seconds"] = seconds
    largest = max(tuning, key=len)
    median = statistics.median(each.seconds for each in largest)
    generation = [replace(each, seconds=median) for each in (largest[0], *[largest[-1]] * (GENERATION - 1))]
    generations = [generation] * N_GENERATIONS
    # The client of a tuning of two generations, or in the quick form one.
    per_generation = tuning_client / (1 if quick else 2)
    works = {
        "tuning": (tuning, tuning_client, False),
        "tuning of a million runs": (generations, per_generation * N_GENERATIONS, False),
        "the same, what is shared kept": (generations, per_generation * N_GENERATIONS, True),
        "study of realisations": (realisations, study_client, False),
        "a million realisations in one call": ([[*chain(*generations)]], study_client, False),
        f"choice, {len(seconds)} models x {N_FOLDS} folds": ([folds], per_fit * len(folds), False),
    }
    found["schedules"] = {
        name: {
            "chunks": sum(map(len, calls)),
            "calls": len(calls),
            "most": max(map(len, calls)),
            "work": sum(each.seconds for call in calls for each in call),
            "client": client,
            "efficiency": {workers: efficiency(calls, client, workers, kept=kept) for workers in WORKERS},
        }
        for name, (calls, client, kept) in works.items()
    }
    return found


def tables(found: dict[str, Any]) -> Iterator[Table | str]:
    """The tables of the README."""
    yield f"Processor: {found['processor']}; load {found['load']:.1f} when it began."
    yield table_of(
        "Two workers beside two threads",
        "work",
        found["overhead"],
        {
            "threads [s]": lambda each: ", ".join(f"{value:.1f}" for value in each["threads"]),
            "workers [s]": lambda each: ", ".join(f"{value:.1f}" for value in each["workers"]),
            "threads / workers, median": "{ratio:.2f}",
        },
    )
    columns = {"chunks": "{chunks}", "shared [B]": "{shared:,}", "sent [B]": "{sent:,.0f}"}
    yield table_of(
        "What is sent", "largest call of", found["bytes"], columns | {"received [B]": "{received:,.0f}"}
    )
    yield table_of(
        "Memory",
        "runs",
        [(f"{each['runs']:,}", each) for each in found["memory"]],
        {
            "client before [MB]": "{before:.0f}",
            "client [MB]": "{client:.0f}",
            "worker [MB]": "{worker:.0f}",
            "seconds": "{seconds:.0f}",
        },
    )
    yield table_of(
        "Efficiency in a simulated schedule, by the number of workers",
        "work",
        found["schedules"],
        {
            "calls": "{calls}",
            "chunks": "{chunks}",
            "most in a call": "{most}",
            "work [s]": "{work:.0f}",
            "client [s]": "{client:.1f}",
            **{str(workers): f"{{efficiency[{workers}]:.2f}}" for workers in WORKERS},
        },
    )
    slowest = max(found["fit_seconds"], key=found["fit_seconds"].get)
    yield f"The longest fit is that of {slowest}, {found['fit_seconds'][slowest]:.1f} s of one thread."


def find(options: Namespace, say: Say) -> Findings:
    found = run(say, quick=options.quick)
    return Findings(numbers=found, text=tables(found), judged={}, agreement="")


if __name__ == "__main__":
    command = Command(__file__, __doc__, quick="a minute: fewer motions, draws, models and runs, one repeat")
    sys.exit(command.run(find))
