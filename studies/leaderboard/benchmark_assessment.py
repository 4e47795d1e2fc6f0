"""The fit to two periods of the record, and its errors beside those of the true parameters."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from studies.former.arrays import Floats
from studies.leaderboard.benchmark_multisine import (
    INTERPOLATIONS,
    Interpolation,
    newmark,
    random_multisine,
    stage_table,
)
from studies.leaderboard.benchmark_oscillator import (
    Fitted,
    Parameters,
    Period,
    Scales,
    descend,
    fitted,
    linear_fit,
    screened_minima,
    steady_period,
)

N_PERIOD = 8192
FITTED = slice(1, 3)
HELD_OUT = slice(3, 5)
# The descents from random starts need less than the final one: coarse steps find the same valley.
COARSE, FINE = 2, 8

# Noel, Schoukens 2016: beta gamma and beta delta are 1e3 x 0.8 and 1e3 x -1.1. Used for assessment, never for fitting.
TRUE = Parameters(m=2.0, c=10.0, k=5e4, alpha=5e4, g=800.0, d=-1100.0, nu=1.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Error:
    """Root mean square errors [m] of a model's free run.

    held_out
        Against a period of the record that was not fitted; it holds the record's noise.
    beyond_noise
        The part that two held-out periods share, the root of the mean product of their residuals.
    unseen
        Against a noise-free simulation of the true system under another multisine.
    """

    held_out: float
    beyond_noise: float
    unseen: float


@dataclass(frozen=True, slots=True, kw_only=True)
class InterpolationResult:
    """Results with one interpolation of the force: the fit, its errors, those of the true parameters, seconds."""

    fit: Fitted
    error: Error
    true_error: Error
    seconds: float
    unseen_residual: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkResult:
    """All results; displacement [m] of the held-out periods, shape (2, n_time), seconds spent on the starts."""

    noise: float
    minima: tuple[float, ...]
    linear: tuple[float, float, float]
    outcomes: dict[Interpolation, InterpolationResult]
    held_out: Floats
    dt: float
    seconds: float


def rms(signal: Floats) -> float:
    return float(np.sqrt(np.mean(signal**2)))


def errors(residuals: Floats, unseen: Floats) -> Error:
    """From residuals on two held-out periods, shape (2, n_time), and on the unseen multisine, shape (n_time,)."""
    product = float(np.mean(residuals[0] * residuals[1]))
    return Error(held_out=rms(residuals), beyond_noise=max(product, 0.0) ** 0.5, unseen=rms(unseen))


@dataclass(frozen=True, slots=True, kw_only=True)
class Training:
    """What is fitted: a period of the force [N], the mean displacement [m], shape (n_time,), and its noise [m]."""

    force: Floats
    mean: Floats
    noise_of_mean: float
    dt: float

    @property
    def scales(self) -> Scales:
        return Scales(linear=linear_fit(self.force, self.mean, self.dt), displacement=rms(self.mean))

    def period(self, n_substeps: int, interpolation: Interpolation) -> Period:
        stages = jnp.asarray(stage_table(self.force, n_substeps, interpolation))
        return Period(stages, jnp.asarray(self.mean), self.noise_of_mean, self.dt)


def training_of(force: Floats, pair: Floats, dt: float) -> Training:
    """Two steady periods of the displacement, shape (2, n_time), as one; their difference is noise."""
    return Training(force=force, mean=pair.mean(axis=0), noise_of_mean=rms(pair[0] - pair[1]) / 2.0, dt=dt)


def read_record(record: Path) -> tuple[Training, Floats]:
    """The two periods that are fitted, and the next two, shape (2, n_time)."""
    table = np.loadtxt(record, delimiter=",", skiprows=1)
    dt = float(table[-1, 0] / (len(table) - 1))
    periods = table[:, 2].reshape(-1, N_PERIOD)
    return training_of(table[:N_PERIOD, 1], periods[FITTED], dt), periods[HELD_OUT]


def run(record: Path, seed: int) -> BenchmarkResult:
    """Fit two periods of the record and assess on the next two; the first period contains the transient from rest."""
    begun = time.perf_counter()
    rng = np.random.default_rng(seed)
    training, held_out = read_record(record)
    force, dt, scales = training.force, training.dt, training.scales
    minima = screened_minima(training.period(COARSE, "band-limited"), scales, rng=rng)
    searched = time.perf_counter() - begun

    other = random_multisine(N_PERIOD, dt, band=(5.0, 150.0), rms=rms(force), rng=rng)
    reference = newmark(TRUE, other, dt)
    outcomes = {}
    for interpolation in INTERPOLATIONS:
        begun = time.perf_counter()
        data = training.period(FINE, interpolation)
        fit = fitted(data, scales, descend(data, scales, minima[0].unknowns))
        seconds = time.perf_counter() - begun
        unseen = jnp.asarray(stage_table(other, FINE, interpolation))
        judged = []
        for parameters in (fit.parameters, TRUE):
            residuals = held_out - np.asarray(steady_period(parameters, data.stages, dt))
            judged.append((residuals, np.asarray(steady_period(parameters, unseen, dt)) - reference))
        outcomes[interpolation] = InterpolationResult(
            fit=fit,
            error=errors(*judged[0]),
            true_error=errors(*judged[1]),
            seconds=seconds,
            unseen_residual=judged[0][1],
        )
    return BenchmarkResult(
        noise=training.noise_of_mean * 2.0**0.5,
        minima=tuple(minimum.misfit for minimum in minima),
        linear=scales.linear,
        outcomes=outcomes,
        held_out=held_out,
        dt=dt,
        seconds=searched,
    )


def summary(study: BenchmarkResult) -> dict[str, dict[str, float]]:
    """The figures by interpolation: errors [m], parameters, and how far these lie from the true ones."""
    figures = {}
    for interpolation, outcome in study.outcomes.items():
        parameters = outcome.fit.parameters
        deviation = max(abs(value / true - 1.0) for value, true in zip(parameters, TRUE, strict=True))
        figures[interpolation] = {
            **asdict(outcome.error),
            **{f"true_{name}": value for name, value in asdict(outcome.true_error).items()},
            **parameters._asdict(),
            "largest_deviation": deviation,
            "seconds": outcome.seconds,
        }
    return figures
