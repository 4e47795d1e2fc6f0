"""Score of the Bouc-Wen benchmark: root mean square error of a free run on its multisine and its sine sweep.

Both are noise-free. The model is that of studies/boucwen_benchmark.py, identified from the training record alone. Where
the published test signals are absent, stand-ins of the same kind are integrated at the true parameters.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import jax.numpy as jnp
import numpy as np

from mrwork.errors import RecordError
from studies.former.arrays import Floats
from studies.former.records import data
from studies.leaderboard.benchmark_assessment import (
    COARSE,
    FINE,
    N_PERIOD,
    TRUE,
    Training,
    read_record,
    rms,
    training_of,
)
from studies.leaderboard.benchmark_multisine import newmark, random_multisine, stage_table
from studies.leaderboard.benchmark_oscillator import (
    Parameters,
    descend,
    fitted,
    free_run,
    screened_minima,
    steady_period,
)
from studies.leaderboard.damper_scores import SEED
from studies.leaderboard.measured import BENCHMARK, measured_files

DT = 1.0 / 750.0
# Of the benchmark: band of the multisine [Hz], size of the force [N], noise of the training record [m]; of the sweep
# the band [Hz] and the amplitude [N].
_BAND, _FORCE, _NOISE = (5.0, 150.0), 50.0, 8e-6
_SWEEP_BAND, _SWEEP_FORCE = (20.0, 50.0), 40.0
_QUICK_PERIOD = 512
# Samples of zero force after a sweep, so that its spline does not close on its beginning.
_AFTER = 16


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkSignals:
    """Force [N] and displacement [m] of a steady period and of a sweep from rest; `source` names what they are."""

    multisine: tuple[Floats, Floats]
    sweep: tuple[Floats, Floats]
    source: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BenchmarkScore:
    """Root mean square errors [m] of the free run; what was fitted, and on what it was tested."""

    multisine: float
    sweep: float
    training: str
    test: str


def score_benchmark(*, quick: bool) -> BenchmarkScore:
    """Identify the oscillator from the training record, and run it freely under the test signals."""
    rng = np.random.default_rng(SEED)
    n_period = _QUICK_PERIOD if quick else N_PERIOD
    record = [] if quick else measured_files(BENCHMARK)
    training = read_record(record[0])[0] if record else _simulated_training(n_period, rng)
    test = (None if quick else published_signals(data() / BENCHMARK)) or _simulated_signals(n_period, rng)
    screened, descents = (8, 1) if quick else (64, 3)
    scales = training.scales
    coarse, fine = (training.period(n, "band-limited") for n in (COARSE, FINE))
    minima = screened_minima(coarse, scales, rng=rng, n_screened=screened, n_descents=descents)
    parameters = fitted(fine, scales, descend(fine, scales, minima[0].unknowns)).parameters
    multisine, sweep = errors(parameters, test, training.dt)
    return BenchmarkScore(
        multisine=multisine,
        sweep=sweep,
        training="training record" if record else "simulated stand-in",
        test=test.source,
    )


def errors(parameters: Parameters, test: BenchmarkSignals, dt: float) -> tuple[float, float]:
    """Root mean square errors [m] on the multisine, after its transient, and on the sweep, from rest."""
    force, displacement = test.multisine
    steady = steady_period(parameters, jnp.asarray(stage_table(force, FINE, "band-limited")), dt)
    swept, from_rest = test.sweep
    stages = stage_table(np.append(swept, np.zeros(_AFTER)), FINE, "cubic")
    run = np.asarray(free_run(parameters, jnp.asarray(stages), dt))[: swept.size]
    return rms(np.asarray(steady) - displacement), rms(run - from_rest)


def published_signals(folder: Path) -> BenchmarkSignals | None:
    """The benchmark's own test signals, under the names of its archive; `None` where one of them is absent."""
    names = ("uval_multisine", "yval_multisine", "uval_sinesweep", "yval_sinesweep")
    if not all((folder / f"{name}.mat").is_file() for name in names):
        return None
    u_multisine, y_multisine, u_sweep, y_sweep = (_signal(folder / f"{name}.mat", name) for name in names)
    if u_multisine.shape != y_multisine.shape or u_sweep.shape != y_sweep.shape:
        raise RecordError(
            f"{folder}: force and displacement of a test differ in length; obtain the files again"
        )
    return BenchmarkSignals(
        multisine=(u_multisine, y_multisine), sweep=(u_sweep, y_sweep), source="published test signals"
    )


def _signal(file: Path, name: str) -> Floats:
    from scipy.io import loadmat

    table = loadmat(file)
    if name not in table:
        raise RecordError(f"{file} has no variable {name}; obtain the file again")
    return np.asarray(table[name], dtype=np.float64).ravel()


def _simulated_training(n_period: int, rng: np.random.Generator) -> Training:
    force = random_multisine(n_period, DT, band=_BAND, rms=_FORCE, rng=rng)
    displacement = newmark(TRUE, force, DT)
    return training_of(force, displacement + _NOISE * rng.standard_normal((2, n_period)), DT)


def _simulated_signals(n_period: int, rng: np.random.Generator) -> BenchmarkSignals:
    """Stand-ins: another multisine, and a sweep of the published band and amplitude that is faster and shorter."""
    force = random_multisine(n_period, DT, band=_BAND, rms=_FORCE, rng=rng)
    swept = simulated_sweep(n_period)
    # A period that ends with as many zeros: the half before it, from which the integration starts, is at rest.
    at_rest = np.append(swept, np.zeros(n_period))
    return BenchmarkSignals(
        multisine=(force, newmark(TRUE, force, DT)),
        sweep=(swept, newmark(TRUE, at_rest, DT)[:n_period]),
        source="simulated stand-in",
    )


def simulated_sweep(n_time: int) -> Floats:
    """A linear sine sweep over the band of the benchmark, which begins and ends smoothly."""
    time = DT * np.arange(n_time)
    low, high = _SWEEP_BAND
    phase = 2.0 * np.pi * (low + 0.5 * (high - low) * time / time[-1]) * time
    ramp = np.clip(np.minimum(time, time[-1] - time) / (0.05 * time[-1]), 0.0, 1.0)
    return np.asarray(_SWEEP_FORCE * np.sin(0.5 * np.pi * ramp) ** 2 * np.sin(phase))
