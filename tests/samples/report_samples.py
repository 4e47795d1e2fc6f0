"""Tests, fits and predictions made up for the report: small, seeded, without the compiled module."""

import numpy as np
from numpy.typing import NDArray

import mrwork as mr
from mrwork.identification.fit import (
    ErrorNorms,
    FitQuality,
    FitStatus,
    FittedParameter,
    ParameterState,
    Provenance,
    SearchTrace,
)
from mrwork.identification.interval import Verdict
from mrwork.records.damper_test import range_of_tests
from mrwork.records.likeness import RecordedMotion


def prediction(
    name: str = "10mm1Hz0x5A",
    *,
    n_time: int = 2000,
    duration: float = 8.0,
    amplitude: float = 0.01,
    peak_force: float = 900.0,
    synthetic: bool = False,
    remarks: tuple[mr.Remark, ...] = (),
    rng: int = 0,
) -> mr.Prediction:
    """A 1 Hz test of a smooth hysteretic damper with 2 % noise, and the model without the noise."""
    dt = duration / n_time
    time = dt * np.arange(n_time)
    displacement = amplitude * np.sin(2 * np.pi * time)
    velocity = 2 * np.pi * amplitude * np.cos(2 * np.pi * time)
    phase = 2 * np.pi * time + 0.35
    model = peak_force * (0.8 * np.tanh(4 * np.cos(phase)) + 0.2 * np.cos(2 * np.pi * time))
    noise = 0.02 * peak_force * np.random.default_rng(rng).normal(size=n_time)
    test = mr.DamperTest(
        name=name,
        path=f"rig/{name}.csv",
        sha256="0123456789abcdef" * 4,
        dt=dt,
        start_time=0.0,
        displacement=displacement,
        velocity=velocity,
        force=model + noise,
        velocity_source="derived",
        current=0.5,
        amplitude=amplitude,
        frequency=1.0,
        synthetic=synthetic,
        remarks=remarks,
    )
    return mr.Prediction(test=test, model_force=model)


def quality(test: mr.DamperTest, model_force: NDArray[np.float64]) -> FitQuality:
    """The numbers of a prediction, straight from their definitions."""
    residual = test.force - model_force
    rmse = float(np.sqrt(np.mean(residual**2)))
    nrmse = rmse / float(np.std(test.force))
    centred = residual - residual.mean()
    return FitQuality(
        test=test.name,
        fit_percent=100 * (1 - nrmse),
        nrmse=nrmse,
        rmse_n=rmse,
        error_norms=ErrorNorms(time=nrmse, displacement=0.1 * nrmse, velocity=0.3 * nrmse),
        residual_autocorrelation=float(centred[1:] @ centred[:-1] / (centred @ centred)),
        n_time=test.n_time,
        settle_seconds=0.0,
        substeps=2,
    )


# Name, unit, value, standard error, bounds and state.
PARAMETERS: tuple[tuple[str, str, float, float | None, float, float, ParameterState], ...] = (
    ("c", "N s/m", 1843.7263, 6.2, 0, 1e5, ""),
    ("k", "N/m", -2310.8, 114.0, -1e5, 1e5, ""),
    ("x0", "m", -1.2346e-4, 2.1e-5, -0.02, 0.02, ""),
    ("k_w", "N", 512.839, 1.13, 1, 5e4, ""),
    ("rho", "1/m", 8123.9, 35.2, 10, 1e5, ""),
    ("sigma", "", 0.5, None, 0.5, 10, "at lower bound"),
    ("n", "", 2.0, None, 1, 4, "fixed"),
)


def fit(
    *predictions: mr.Prediction, status: FitStatus = "converged", stop_reason: str = "step below 1e-8"
) -> mr.Fit:
    """A fit of eight parameters with every state."""
    qualities = tuple(quality(entry.test, entry.model_force) for entry in predictions)
    nrmse = float(np.mean([entry.nrmse for entry in qualities]))
    evaluations = np.arange(1, 41) * 64
    best = np.maximum(0.9 * np.exp(-evaluations / 500), 1.1 * nrmse)
    tests = [entry.test for entry in predictions]
    return mr.Fit(
        model="normalised_bouc_wen",
        tested=range_of_tests(tests, None),
        motions=tuple(RecordedMotion.of(test) for test in tests),
        estimates=tuple(
            FittedParameter(
                name=name,
                unit=unit,
                value=value,
                standard_error=error,
                lower=low,
                upper=high,
                state=state,
                verdict=Verdict("fixed") if state == "fixed" else Verdict("", state),
            )
            for name, unit, value, error, low, high, state in PARAMETERS
        ),
        status=status,
        stop_reason=stop_reason,
        nrmse=nrmse,
        fit_percent=100 * (1 - nrmse),
        rmse_n=float(np.mean([entry.rmse_n for entry in qualities])),
        error_norms=ErrorNorms(time=nrmse, displacement=0.1 * nrmse, velocity=0.3 * nrmse),
        quality=qualities,
        trace=SearchTrace(
            evaluations=tuple(evaluations.tolist()),
            best=tuple(best.tolist()),
            median=(float("inf"), *(2 * best[1:]).tolist()),
            stop_reason="hypothesis test",
        ),
        evaluations=int(evaluations[-1]),
        refinement_steps=14,
        seconds=3.42,
        n_time=sum(entry.n_time for entry in qualities),
        provenance=Provenance(
            versions={"mrwork": "0.1.0", "numpy": "2.4.0"},
            instruction_set="avx2",
            inputs={entry.test.path: entry.test.sha256 for entry in predictions},
            settings={"command": "mrwork identify rig/a.csv --seed 1", "population": 64, "confidence": 0.95},
            rng=1,
            created="2025-01-31T12:00:00+00:00",
        ),
    )
