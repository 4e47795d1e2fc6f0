"""A process that is forked after mrwork has computed: simulations go on, JAX, which would hang, is refused."""

import multiprocessing
from collections.abc import Callable

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.dampers.simulation import simulate_forces
from mrwork.twins.model_twins import begin

PATIENCE = 60.0
# The warning is that of JAX, where another test has loaded it.
pytestmark = [pytest.mark.contract, pytest.mark.filterwarnings("ignore:os.fork")]


def simulated(threads: int) -> float:
    model = mr.damper("bouc_wen")
    time = 1e-3 * np.arange(500)
    loading = mr.Loading(dt=1e-3, displacement=0.01 * np.sin(time), velocity=0.01 * np.cos(time))
    many = np.tile(model.nominal, (64, 1))
    return float(np.abs(simulate_forces(model, many, loading.history(), threads=threads).force).sum())


def in_child(work: Callable[[], object]) -> object:
    """What `work` returns in a forked process, or a failure where it does not end."""
    context = multiprocessing.get_context("fork")
    ours, theirs = context.Pipe(duplex=False)
    child = context.Process(target=lambda: theirs.send(work()))
    child.start()
    try:
        assert ours.poll(PATIENCE), "the forked process does not end"
        return ours.recv()
    finally:
        child.kill()
        child.join()


@pytest.mark.parametrize("threads", [1, 3])
def test_a_forked_process_simulates_on_threads_of_its_own(threads: int) -> None:
    assert in_child(lambda: simulated(threads)) == simulated(threads) == in_child(lambda: simulated(threads))


def test_jax_is_refused_in_a_forked_process() -> None:
    begin()
    assert "spawn" in str(in_child(lambda: str(refusal(begin, match="spawn"))))
