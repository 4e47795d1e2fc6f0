"""How much of a faster test lies within near sets of laws and the band, and within the band alone.

python studies/sets_beyond/study.py [--quick] [--model NAME ...] [--replicates N] [--seed N] [--threads N] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import json
import time
from argparse import Namespace
from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np

from mrwork import calibrate, identify, predict
from mrwork.dampers import Loading, damper, simulate_force
from mrwork.errors import SimulationError
from mrwork.identification import Fit, FitSettings
from mrwork.records import DamperTest, build_damper_test
from mrwork.report import Table
from mrwork.search import EfficientGA, StopRules
from mrwork.uncertainty import choose_laws, predict_left_out
from studies.former.command import Command, Findings, Say
from studies.former.table import alike, table_of

# Ranges at the smallest command; parameters that follow it grow by a factor drawn from the second range, saturating.
MODELS: dict[str, dict[str, tuple[float, float]]] = {
    "viscous_dahl": {"k_x": (500.0, 2000.0), "k_w": (150.0, 400.0), "rho": (1000.0, 3000.0)},
    "static_hysteretic": {"c": (500.0, 2000.0), "alpha": (150.0, 400.0), "beta": (40.0, 100.0)},
    "normalised_bouc_wen": {"c": (500.0, 2000.0), "k_w": (150.0, 400.0), "rho": (500.0, 2000.0)},
}
_GROWTH = (1.0, 4.0)
# Dampers of the model itself, and those whose viscous force thins above the velocity [m/s], which the model lacks.
TRUTHS = {"of the model": np.inf, "thinning": 0.08}
_THICKNESS = 2500.0
# Stroke [m] and frequency [Hz]: tested, and 1.4 times as fast as the fastest of these, or as large as the largest.
TESTED = ((0.012, 0.5), (0.008, 1.0), (0.004, 3.0), (0.006, 2.0))
UNSEEN = ((0.0084, 2.0), (0.0056, 3.0), (0.017, 0.9))
COMMANDS = (0.0, 0.33, 0.67, 1.0)
LEVEL = 0.9
_NOISE, _PER_CYCLE, _CYCLES = 0.02, 60, 3
_SEARCH = EfficientGA(stop=StopRules(max_generations=15))


def measured(
    model: str, truth: str, seed: int, motion: tuple[float, float], command: float, number: int
) -> DamperTest:
    """A noisy test of the damper that a seed draws."""
    spec, drawn = damper(model), np.random.default_rng([seed, len(model)])
    values = dict(zip(spec.names, spec.nominal, strict=True))
    for name, ends in MODELS[model].items():
        start, growth, bend = drawn.uniform(*ends), drawn.uniform(*_GROWTH), drawn.uniform(0.5, 2.0)
        values[name] = start * (1.0 + (growth - 1.0) * np.tanh(bend * command) / np.tanh(bend))
    amplitude, frequency = motion
    dt = 1.0 / (_PER_CYCLE * frequency)
    angle = 2.0 * np.pi * frequency * dt * np.arange(_CYCLES * _PER_CYCLE + 1)
    x, v = amplitude * np.sin(angle), 2.0 * np.pi * frequency * amplitude * np.cos(angle)
    force = simulate_force(spec, list(values.values()), Loading(dt=dt, displacement=x, velocity=v))
    if np.isfinite(TRUTHS[truth]):
        force += _THICKNESS * (0.5 + command) * v / (1.0 + np.abs(v) / TRUTHS[truth])
    noise = np.random.default_rng([seed, number]).standard_normal(force.size)
    return build_damper_test(
        name=f"{1e3 * amplitude:g} mm, {frequency:g} Hz, {command:g} A",
        time=dt * np.arange(force.size),
        displacement=x,
        velocity=v,
        force=force + _NOISE * np.std(force) * noise,
        current=command,
        synthetic=True,
    )


def replicate(
    model: str, truth: str, seed: int, *, commands: tuple[float, ...], threads: int
) -> dict[str, Any]:
    """One damper: its laws are chosen, a band is calibrated on motions left out, and faster tests are predicted."""
    began = time.perf_counter()
    pairs = list(enumerate(product((*TESTED, *UNSEEN), commands)))
    every = [measured(model, truth, seed, *pair, number) for number, pair in pairs]
    tests, unseen = every[: len(TESTED) * len(commands)], every[len(TESTED) * len(commands) :]
    choice = choose_laws(model, tests, settings=FitSettings(search=_SEARCH, rng=seed), threads=threads)

    def identify_rest(rest: tuple[DamperTest, ...]) -> Fit:
        return identify(choice.fit.spec, rest, search=_SEARCH, rng=seed, threads=threads)

    left = predict_left_out(tests, "motion", identify_rest)
    bands = calibrate(left.predictions, held_out="predicted without the tests of its motion")
    rows, tested = [], choice.fit.tested
    for test in unseen:
        try:
            found = predict(choice.fit, test, others=choice.others)
        except SimulationError:
            continue
        band, force = bands.band(found, LEVEL), found.measured
        forces = np.concatenate([found.model_force[None], found.other_forces])[:, test.counted]
        lower = forces.min(axis=0) + band.lower - found.force
        upper = forces.max(axis=0) + band.upper - found.force
        beyond = np.abs(test.velocity[test.counted]) > tested.velocity
        beyond |= np.abs(test.displacement[test.counted]) > tested.stroke
        inside = (force >= lower) & (force <= upper)
        alone = (force >= band.lower) & (force <= band.upper)
        # One set says nothing of what the laws leave open: a miss.
        share = float(inside[beyond].mean()) if len(forces) > 1 else 0.0
        scale = found.deviation
        rows.append(
            (
                share,
                float(inside[beyond].mean()),
                float(alone[beyond].mean()),
                float((upper - lower)[beyond].mean() / scale),
                float((band.upper - band.lower)[beyond].mean() / scale),
                np.nan if found.sets_apart is None else found.sets_apart.percent,
            )
        )
    names = ("within", "within_any", "band_alone", "width", "width_alone", "apart_percent")
    means = dict(zip(names, np.mean(rows, axis=0).tolist() if rows else [np.nan] * len(names), strict=True))
    case = {"model": model, "truth": truth, "seed": seed, "sets": 1 + len(choice.others), "tests": len(rows)}
    return case | means | {"seconds": time.perf_counter() - began}


def table(rows: list[dict[str, Any]]) -> Table:
    """A row for each model and damper, means over the replicates."""

    def groups() -> Iterable[tuple[str, dict[str, Any]]]:
        for model, truth in dict.fromkeys((row["model"], row["truth"]) for row in rows):
            own = [row for row in rows if (row["model"], row["truth"]) == (model, truth)]
            numbers = [name for name, value in own[0].items() if isinstance(value, float | int)]
            means = {
                name: float(np.nanmean([row[name] for row in own]))
                if any(np.isfinite(row[name]) for row in own)
                else np.nan
                for name in numbers
            }
            percent = {name: 100.0 * means[name] for name in ("within", "within_any", "band_alone")}
            single = 100.0 * np.mean([row["sets"] == 1 for row in own])
            yield f"{model}, {truth}", means | percent | {"n": len(own), "single": single}

    columns = {
        "sets": "sets",
        "one set %": "single",
        "within sets and band %": "within",
        "one set no miss %": "within_any",
        "band alone %": "band_alone",
        "apart %": "apart_percent",
    }
    widths = alike(".2f", {"width": "width", "alone": "width_alone", "s": "seconds"})
    return table_of(
        "Faster tests, 90 % bands", "model, damper", groups(), {"n": "{n}", **alike(".1f", columns), **widths}
    )


def find(options: Namespace, say: Say) -> Findings:
    rows = []
    models = options.model or (["viscous_dahl"] if options.quick else [*MODELS])
    commands = (0.0, 0.5, 1.0) if options.quick else COMMANDS
    for seed, model, truth in product(range(1 if options.quick else options.replicates), models, TRUTHS):
        say(f"{model}, {truth}, replicate {seed}")
        row = replicate(model, truth, options.seed + seed, commands=commands, threads=options.threads)
        rows.append(row)
        if options.rows is not None:
            options.rows.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    return Findings(numbers={"rows": rows}, text=[table(rows)], judged={}, agreement="")


if __name__ == "__main__":
    command = Command(
        __file__,
        __doc__,
        quick="one replicate of one model",
        threads=True,
        seed=(0, "of the first replicate"),
    )
    command.parser.add_argument("--model", action="append", choices=[*MODELS], help="default: all")
    command.parser.add_argument("--replicates", type=int, default=20, help="of each model and damper")
    command.parser.add_argument("--rows", type=Path, help="file that has the rows after each replicate, JSON")
    sys.exit(command.run(find))
