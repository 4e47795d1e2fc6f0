"""Chunks of runs on executors: the same bits, lost workers, errors, what is prepared."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

import mrwork as mr
from mrwork.closed_loop.simulate import LoopVariation, simulate_loop
from mrwork.errors import SettingError, WorkerError
from mrwork.workers.engine import Workers, cut_into_chunks, working_on
from mrwork.workers.local import local_workers


@pytest.fixture(scope="module")
def pool() -> Iterator[Executor]:
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn")) as executor:
        yield executor


# Steps of a chunk, of which a call has several.
CHUNK_STEPS = 1e5


class Counting(Executor):
    """Does each chunk at once, and keeps what it was sent."""

    def __init__(self) -> None:
        self.sent: list[tuple[Any, ...]] = []

    def submit(self, function: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.sent.append(args)
        future: Future[Any] = Future()
        try:
            future.set_result(function(*args, **kwargs))
        except BaseException as error:
            future.set_exception(error)
        return future


PREPARED: list[float] = []


def _prepare(shared: float) -> float:
    PREPARED.append(shared)
    return shared


def _scaled(shared: float, number: float) -> float:
    if number < 0.0:
        raise SettingError(f"{number:g} is below 0; give one above")
    return shared * number


def _die(shared: object) -> None:
    os._exit(3)


def _sleep(shared: object, seconds: float) -> None:
    threading.Event().wait(seconds)


def loop_of_many_runs(**changes: Any) -> Callable[..., Any]:
    frame = mr.building("uts")
    preset = mr.damper("static_hysteretic").preset("kwok2006")
    device = mr.Device(
        name="pair", spec=preset.spec, theta=preset.theta, row=frame.storeys[0], largest_command=1.88
    )
    law = mr.ControlLaw(name="passive", gains={"command": np.linspace(0.0, 1.88, 40)[:, None]})
    motions = [mr.synthetic_motion(rng=seed, peak=3.0, duration=2.0) for seed in range(3)]
    return lambda: simulate_loop(
        frame, [device], law, motions, mr.Hardware(sample_time=1e-3, **changes.pop("hardware", {})), **changes
    )


def test_runs_have_the_same_bits_in_other_processes_and_are_counted(
    pool: Executor, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mrwork.closed_loop.simulate._CHUNK_STEPS", CHUNK_STEPS)
    here = loop_of_many_runs()()
    with working_on(pool):
        assert loop_of_many_runs()() == here
    counting, told = Counting(), list[tuple[int, int]]()
    with working_on(counting):
        assert loop_of_many_runs(on_progress=lambda *progress: told.append(progress))() == here
    assert len(counting.sent) > 5
    assert told[-1] == (120, 120)
    assert [done for done, _ in told] == sorted(done for done, _ in told)


def test_observers_and_realisations_are_sent_and_histories_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("mrwork.closed_loop.simulate._CHUNK_STEPS", CHUNK_STEPS)
    frame = mr.building("uts")
    variation = LoopVariation(buildings=(frame,) * 2, delay=np.array([0.0, 0.002]), seed=np.array([0, 5]))
    run = loop_of_many_runs(hardware={"feedback": "observer"}, variation=variation)
    here = run()
    executor = Counting()
    with working_on(executor):
        assert run() == here
        sent = len(executor.sent)
        assert loop_of_many_runs(histories=True)().histories is not None
    assert len(executor.sent) == sent > 0


def test_results_are_in_order_and_errors_of_the_package_are_those_of_their_chunk(pool: Executor) -> None:
    first, second, third = Workers(pool).futures(float, _scaled, 2.0, [(1.0,), (-1.0,), (3.0,)])
    assert first.result() == 2.0
    assert third.result() == 6.0
    with pytest.raises(SettingError, match="-1 is below 0; give one above"):
        second.result()


def test_what_chunks_share_is_prepared_once_in_a_worker() -> None:
    numbers = [(float(number),) for number in range(9)]
    found = [*Workers(Counting()).futures(_prepare, _scaled, 7.25, numbers)]
    assert [each.result() for each in found] == [7.25 * number for (number,) in numbers]
    assert PREPARED == [7.25]


def test_a_lost_worker_is_a_sentence_and_a_new_pool_goes_on() -> None:
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as broken, pytest.raises(WorkerError) as lost:
        next(Workers(broken).futures(bool, _die, None, [()]))
    assert "ProcessPoolExecutor lost a part of the work (BrokenProcessPool: " in str(lost.value)
    assert "run again with --resume" in str(lost.value)


def test_an_interrupt_cancels_what_has_not_begun() -> None:
    with ThreadPoolExecutor(1) as executor:
        workers = Workers(executor=executor, in_flight=3)

        def stop(number: int, future: Future[None]) -> None:
            raise KeyboardInterrupt

        with pytest.raises(KeyboardInterrupt):
            next(workers.futures(bool, _sleep, None, [(0.01,), (0.05,), (30.0,), (30.0,)], on_done=stop))


def test_chunks_depend_on_costs_alone() -> None:
    assert cut_into_chunks([1.0, 1.0, 3.0, 1.0, 1.0], 2.0) == [slice(0, 2), slice(2, 3), slice(3, 5)]
    assert cut_into_chunks([5.0], 2.0) == [slice(0, 1)]
    assert cut_into_chunks([], 2.0) == []
    assert cut_into_chunks([1.0], 2.0) == [slice(0, 1)]


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="no signal masks on this system")
def test_processes_leave_interrupts_to_the_parent_from_their_start() -> None:
    with local_workers(1) as executor:
        assert signal.SIGINT in executor.submit(signal.pthread_sigmask, signal.SIG_BLOCK, ()).result()
    assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
