"""Several tests at once: results in their order and to the bit, the first error, an interrupt that does not wait."""

from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest
from sentences import Refused

from mrwork.dampers import damper
from mrwork.errors import SettingError
from mrwork.identification import FitSettings, Objective
from mrwork.identification.progress import on_every_test
from mrwork.identification.residual import NuisanceName
from mrwork.records import DamperTest, cut
from mrwork.records.reading import synthetic_test

SPEC = damper("normalised_bouc_wen")


def given_tests(count: int) -> tuple[DamperTest, ...]:
    whole = synthetic_test("spencer1997")
    return tuple(
        replace(
            cut(whole, end=0.3 + 0.1 * number),
            name=f"test {number}",
            force=(1.0 + number) * cut(whole, end=0.3 + 0.1 * number).force,
        )
        for number in range(count)
    )


def rows() -> np.ndarray:
    theta = SPEC.nominal * np.exp(0.1 * np.random.default_rng(3).standard_normal((5, len(SPEC.names))))
    # One that no simulation resolves.
    theta[2, SPEC.names.index("rho")] = 0.9 * SPEC.parameters[SPEC.names.index("rho")].upper
    return theta


@pytest.mark.parametrize("nuisances", [(), ("offset",)])
@pytest.mark.parametrize("n_tests", [1, 2, 5])
def test_threads_change_no_bit_of_an_objective(n_tests: int, nuisances: tuple[NuisanceName, ...]) -> None:
    tests, theta = given_tests(n_tests), rows()
    alone, *several = (
        Objective.of(SPEC, tests, FitSettings(nuisances=nuisances, power=4.0), threads=threads)
        for threads in (1, 0, 2, 3, 8)
    )
    for objective in several:
        np.testing.assert_array_equal(objective(theta), alone(theta))
        np.testing.assert_array_equal(
            objective(theta, 1.01 * alone(theta)), alone(theta, 1.01 * alone(theta))
        )
        np.testing.assert_array_equal(objective.residuals(theta), alone.residuals(theta))
        for run, expected in zip(objective.misfits(theta), alone.misfits(theta), strict=True):
            np.testing.assert_array_equal(run.squared_error, expected.squared_error)
    assert len({(each.tally.simulations, each.tally.steps) for each in several}) == 1


@pytest.mark.parametrize("n_tests", [1, 2, 3, 7])
@pytest.mark.parametrize("threads", [1, 2, 4])
def test_results_are_in_the_order_of_the_tests_and_no_thread_is_idle(n_tests: int, threads: int) -> None:
    given = on_every_test(n_tests, threads, lambda index, own: (index, own))
    assert [index for index, _ in given] == list(range(n_tests))
    # Tests that are left over share the threads.
    for index, own in given:
        left_over = n_tests % threads
        is_left_over = threads > 1 and index >= n_tests - left_over
        assert own == (threads // left_over if is_left_over else 1 if n_tests > 1 else threads)


def test_the_error_of_the_first_test_that_fails_is_raised(refused: Refused) -> None:
    def work(index: int, threads: int) -> int:
        if index in (1, 2):
            raise SettingError(f"test {index}")
        return threads

    for _ in range(20):
        refused(on_every_test, 6, 3, work)


def test_an_interrupt_starts_no_further_test_and_waits_for_none() -> None:
    caller = threading.get_ident()
    running, released, started = threading.Event(), threading.Event(), []

    def work(index: int, threads: int) -> int:
        started.append(index)
        if threading.get_ident() == caller:
            running.wait()
            raise KeyboardInterrupt
        running.set()
        released.wait()
        return threads

    with pytest.raises(KeyboardInterrupt):
        on_every_test(8, 2, work)
    # The other thread is still in its test: nobody has waited for it.
    assert len(started) == 2
    released.set()
    for thread in threading.enumerate():
        if thread.name == "mrwork-test":
            thread.join()
    assert len(started) == 2
