"""Tables and figure of the study."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from mrwork.report import Table
from studies.boucwen_benchmark.assessment import TRUE, BenchmarkResult, InterpolationResult
from studies.boucwen_benchmark.oscillator import Parameters

PUBLISHED = 7.5e-6
_UNITS = {"m": "kg", "c": "N s/m", "k": "N/m", "alpha": "N/m", "g": "1/m", "d": "1/m", "nu": "1"}
_COLOURS = {"band-limited": "#0072b2", "cubic": "#009e73", "linear": "#d55e00"}


def write_report(study: BenchmarkResult, out: Path) -> str:
    """Write report.md and errors.png to a folder; returns the report."""
    out.mkdir(parents=True, exist_ok=True)
    text = "\n".join([_errors(study).markdown(), _parameters(study).markdown(), _starts(study)])
    figure = "![Spectra of the displacement, the noise and the errors of the models](errors.png)\n"
    (out / "report.md").write_text(f"# Bouc-Wen benchmark, grey box\n\n{text}\n{figure}")
    _figure(study, out / "errors.png")
    return text


def _errors(study: BenchmarkResult) -> Table:
    rows = [
        (name, kind, f"{error.held_out:.2e}", f"{error.beyond_noise:.1e}", f"{error.unseen:.2e}", seconds)
        for name, outcome in study.outcomes.items()
        for kind, error, seconds in (
            ("fitted", outcome.error, f"{outcome.seconds:.0f}"),
            ("true", outcome.true_error, ""),
        )
    ]
    # The product of independent noises of n samples has the standard deviation noise^2/sqrt(n).
    resolution = study.noise / study.held_out.shape[1] ** 0.25
    return Table(
        title="Root mean square errors of free runs [m]",
        columns=("force between samples", "parameters", "record", "beyond noise", "unseen", "seconds"),
        rows=(*rows, ("best black box published", "", "", "", f"{PUBLISHED:.2e}", "")),
        note="*Record* is a period that was not fitted, with its noise of "
        f"{study.noise:.2e}; *beyond noise* is what two such periods share of their residuals; *unseen* is another "
        "multisine, simulated without noise at the true parameters by Newmark's method at 15 kHz. Errors beyond noise "
        f"smaller than about {resolution:.0e} cannot be distinguished from zero.",
    )


def _parameters(study: BenchmarkResult) -> Table:
    def cell(outcome: InterpolationResult, index: int) -> str:
        value, error = outcome.fit.parameters[index], outcome.fit.standard_errors[index]
        return f"{value:.5g} +- {error:.1g} ({100.0 * (value / TRUE[index] - 1.0):+.2f} %)"

    return Table(
        title="Fitted parameters, standard error, deviation from the true value",
        columns=("parameter", "true", *study.outcomes),
        rows=tuple(
            (
                f"{name} [{_UNITS[name]}]",
                f"{TRUE[index]:g}",
                *(cell(outcome, index) for outcome in study.outcomes.values()),
            )
            for index, name in enumerate(Parameters._fields)
        ),
        note="g and d stand for the products beta gamma and beta delta.",
    )


def _starts(study: BenchmarkResult) -> str:
    m, c, K = study.linear
    minima = ", ".join(f"{minimum:.4f}" for minimum in study.minima)
    return (
        f"Start: linear fit with m {m:.3g} kg, c {c:.3g} N s/m, stiffness {K:.4g} N/m; hysteresis drawn at random. "
        f"Descents ended at {minima} times the noise; {study.seconds:.0f} s.\n"
    )


def _figure(study: BenchmarkResult, path: Path) -> None:
    n_time = study.held_out.shape[1]
    frequency = np.fft.rfftfreq(n_time, study.dt)

    def spectrum(signal: np.ndarray) -> np.ndarray:
        """Root mean square per line [m], smoothed over 33 lines."""
        power = 2.0 * np.abs(np.fft.rfft(signal) / n_time) ** 2
        return np.sqrt(np.convolve(power, np.full(33, 1.0 / 33.0), mode="same"))

    figure, axes = plt.subplots(figsize=(7.0, 4.2), layout="constrained")
    axes.semilogy(frequency, spectrum(study.held_out[0]), color="black", label="displacement of the record")
    noise = (study.held_out[0] - study.held_out[1]) / np.sqrt(2.0)
    axes.semilogy(frequency, spectrum(noise), color="0.55", label="noise between periods")
    for name, outcome in study.outcomes.items():
        style = "--" if name == "cubic" else "-"
        axes.semilogy(
            frequency,
            spectrum(outcome.unseen_residual),
            style,
            color=_COLOURS[name],
            label=f"error, {name} force ({outcome.error.unseen:.1e} m rms)",
        )
    axes.set(
        xlim=(0.0, 0.5 / study.dt),
        xlabel="frequency [Hz]",
        ylabel="rms per line [m]",
        title="Fitted free run against the true system, multisine not seen",
    )
    axes.legend(loc="upper right", fontsize="small")
    figure.savefig(path, dpi=150)
    plt.close(figure)
