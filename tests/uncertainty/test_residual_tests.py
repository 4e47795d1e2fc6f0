"""Tests of residuals: white noise passes, dependence is detected, the repeating share is measured."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from report_samples import prediction

from mrwork.uncertainty import Prediction
from mrwork.uncertainty.residual_tests import LAGS, ResidualTests, autocorrelation, residual_tests

N_TIME = 2000


def with_residual(residual: NDArray[np.float64]) -> Prediction:
    """An 8 s test at 1 Hz whose model leaves exactly this."""
    made = prediction(n_time=residual.size)
    return replace(made, test=replace(made.test, force=made.model_force + residual))


def outcome_of(made: Prediction) -> ResidualTests:
    return residual_tests(made.test, made.residual)


def white(rng: int, n_time: int = N_TIME) -> NDArray[np.float64]:
    return np.random.default_rng(rng).normal(size=n_time)


def coloured(rng: int, memory: float = 0.9) -> NDArray[np.float64]:
    noise = white(rng)
    residual = np.empty_like(noise)
    residual[0] = noise[0]
    for index in range(1, noise.size):
        residual[index] = memory * residual[index - 1] + noise[index]
    return residual


def test_white_noise_is_accused_as_often_as_the_level_says() -> None:
    # Of 200 at 1 %, more than 7 come about with a probability of 0.1 %.
    found = [outcome_of(with_residual(white(rng))) for rng in range(200)]
    assert sum(not each.is_white for each in found) <= 7
    assert sum(not each.has_constant_variance for each in found) <= 7
    # Probabilities of what is so are even between 0 and 1: the mean of 200 is 0.5 within 4 * 0.29 / sqrt(200).
    assert abs(np.mean([each.ljung_box_p for each in found]) - 0.5) < 0.082


def stepped(residual: NDArray[np.float64], command: NDArray[np.float64]) -> Prediction:
    """The same test at a command that varies."""
    made = with_residual(residual)
    return replace(made, test=replace(made.test, current=command))


def random_steps(rng: int, hold: int = 50) -> NDArray[np.float64]:
    return np.repeat(np.random.default_rng([rng, 1]).uniform(0.0, 1.0, N_TIME // hold), hold)


NOISES: dict[str, Callable[[int], NDArray[np.float64]]] = {
    "normal": white,
    "heavy tails": lambda rng: np.random.default_rng(rng).standard_t(4, size=N_TIME),
    "bounded": lambda rng: np.random.default_rng(rng).uniform(-1.0, 1.0, size=N_TIME),
}


@pytest.mark.parametrize("noise", list(NOISES))
def test_white_noise_is_accused_of_steps_and_reversals_as_seldom_as_the_level_says(noise: str) -> None:
    # Of 300 at 1 %, more than 9 come about with a probability of 0.1 %; the level is that of both together.
    found = [outcome_of(stepped(NOISES[noise](rng), random_steps(rng))) for rng in range(300)]
    assert sum(each.after_steps.is_found or each.at_reversals.is_found for each in found) <= 9
    assert all(each.after_steps.p > 0.0 and each.at_reversals.p > 0.0 for each in found)


def test_spikes_at_steps_of_the_command_that_no_autocorrelation_shows_are_found() -> None:
    """A model whose command acts a sample late: the RMS residual rises from 8 N to about 30 N."""
    found = []
    for rng in range(50):
        command = random_steps(rng)
        residual = 8.0 * white(rng)
        steps = np.arange(50, N_TIME, 50)
        residual[steps] += 400.0 * np.diff(command)[steps - 1]
        found.append(outcome_of(stepped(residual, command)))
    assert all(each.after_steps.is_found and each.after_steps.ratio > 5.0 for each in found)
    assert not any(each.at_reversals.is_found for each in found[:10])
    assert sum(each.is_white for each in found) > 40
    # A rise of the RMS residual by a fiftieth is found as well.
    faint = []
    for rng in range(50):
        residual = white(rng)
        residual[50::50] += 1.5 * np.sign(np.diff(random_steps(rng))[49::50])
        faint.append(outcome_of(stepped(residual, random_steps(rng))))
    assert sum(each.after_steps.is_found for each in faint) > 40


def test_residuals_that_are_large_at_reversals_are_found() -> None:
    reversal = np.abs((8.0 * np.arange(N_TIME) / N_TIME) % 0.5 - 0.25) < 0.01
    found = [outcome_of(with_residual((1.0 + reversal) * white(rng))) for rng in range(50)]
    assert sum(each.at_reversals.is_found for each in found) > 45
    assert all(np.isnan(each.after_steps.p) for each in found)


def test_correlated_residuals_are_not_taken_for_noise_and_count_for_less() -> None:
    found = outcome_of(with_residual(coloured(1)))
    assert not found.is_white
    assert found.lag_one == pytest.approx(0.9, abs=0.03)
    # (1 - 0.9) / (1 + 0.9) of the samples are independent.
    assert found.n_effective == pytest.approx(N_TIME / 19, rel=0.5)


def test_residuals_that_grow_with_speed_are_found_and_measured() -> None:
    made = prediction(n_time=N_TIME)
    speed = np.abs(made.test.velocity) / np.abs(made.test.velocity).max()
    found = outcome_of(with_residual((0.2 + speed) * white(2)))
    assert not found.has_constant_variance
    assert found.fast_to_slow > 1.5
    assert outcome_of(with_residual(white(2))).fast_to_slow == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("share", [0.0, 0.5, 0.9, 1.0])
def test_the_share_that_comes_back_every_cycle_is_recovered(share: float) -> None:
    time = 8.0 * np.arange(N_TIME) / N_TIME
    repeating = np.sqrt(2.0) * np.cos(6.0 * np.pi * time)
    found = outcome_of(with_residual(np.sqrt(share) * repeating + np.sqrt(1.0 - share) * white(3)))
    # Over 7 cycles of 250 samples it scatters by some 0.02.
    assert found.repeating == pytest.approx(share, abs=0.08)


def test_a_model_that_leaves_nothing_is_not_judged() -> None:
    found = outcome_of(with_residual(np.zeros(N_TIME)))
    assert np.isnan([found.ljung_box_p, found.breusch_pagan_p, found.repeating]).all()
    assert found.is_white


def test_autocorrelation_is_one_at_lag_zero_and_that_of_the_definition() -> None:
    residual = coloured(4)
    rho = autocorrelation(residual, LAGS)
    centred = residual - residual.mean()
    assert rho[0] == 1.0
    assert rho[3] == pytest.approx(float(centred[3:] @ centred[:-3] / (centred @ centred)), rel=1e-10)
