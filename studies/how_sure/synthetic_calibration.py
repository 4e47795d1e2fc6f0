"""Simulation-based calibration: truths drawn from the prior, their ranks among the draws, and bands on another motion.

If prior, likelihood and sampler are those the data come from, the rank of the truth among independent draws of the
posterior is uniform (Talts et al. 2018), and a 90 % prediction band holds 90 % of another test of the same damper.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.stats import chisquare

from mrwork import identify
from mrwork.dampers import Box, DamperSpec, Loading, damper, simulate_force
from mrwork.records import DamperTest, build_damper_test
from mrwork.report import Table
from mrwork.uncertainty import (
    Lognormal,
    Noise,
    Normal,
    noise_band,
    noise_model,
    sample,
    score,
    simulate_draws,
)
from studies.former.command import Say
from studies.former.table import table_of
from studies.how_sure.scores import LEVEL

# Ranges of the parameters that are free, the others held at their nominal values. Loops as wide as these are resolved
# by few steps: a replicate takes seconds.
MODELS = {
    "static_hysteretic": {
        "c": (2000.0, 4500.0),
        "alpha": (400.0, 900.0),
        "beta": (50.0, 150.0),
        "delta": (0.5, 1.5),
    },
    "normalised_bouc_wen": {
        "c": (500.0, 2000.0),
        "k_w": (400.0, 900.0),
        "rho": (500.0, 2000.0),
        "n": (1.2, 3.0),
    },
    "viscous_dahl": {"k_x": (500.0, 2000.0), "k_w": (400.0, 900.0), "rho": (500.0, 2000.0)},
}
# Priors of the noise, in shares of the force's deviation: smooth, so that no estimate lies where nothing is possible.
NOISES: dict[str, dict[str, Normal | Lognormal]] = {
    "iid": {"sigma": Lognormal(median=0.05, deviation=0.4)},
    "student_t": {"sigma": Lognormal(median=0.05, deviation=0.4), "nu": Lognormal(median=8.0, deviation=0.4)},
    "ar1": {"sigma": Lognormal(median=0.05, deviation=0.4), "phi": Normal(mean=0.6, deviation=0.1)},
}
# Draws that a rank is taken among, and bins of their histogram.
_RANKED = 63
_BINS = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One model under one noise: coverage of another motion, and the histogram of all ranks, shape (n_bins,).

    `p_uniform` is the probability of ranks at least so uneven if they are uniform (chi-squared).
    """

    model: str
    noise: str
    replicates: int
    coverage: float
    ranks: tuple[int, ...]
    p_uniform: float
    unfinished: int


def cases(replicates: int, *, rng: int, threads: int, say: Say) -> Iterator[Case]:
    """Every model under every noise."""
    for model, noise in product(MODELS, NOISES):
        say(f"{model}, {noise}: {replicates} replicates")
        yield case(model, noise, replicates, rng=rng, threads=threads)


def case(model: str, noise: str, replicates: int, *, rng: int, threads: int) -> Case:
    ranks, coverage, unfinished = [], [], 0
    for number in range(replicates):
        found = replicate(model, noise, np.random.default_rng([rng, number]), threads=threads)
        ranks += found.ranks
        coverage.append(found.coverage)
        unfinished += not found.converged
    counts = np.histogram(ranks, bins=_BINS, range=(-0.5, _RANKED + 0.5))[0]
    return Case(
        model=model,
        noise=noise,
        replicates=replicates,
        coverage=float(np.mean(coverage)),
        ranks=tuple(int(count) for count in counts),
        p_uniform=float(chisquare(counts).pvalue),
        unfinished=unfinished,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Replicate:
    """Ranks of the truths among the draws, and the share of another motion in its band."""

    ranks: list[int]
    coverage: float
    converged: bool


def replicate(model: str, noise_name: str, stream: np.random.Generator, *, threads: int) -> Replicate:
    spec, noise = damper(model), noise_model(noise_name)
    box = prior_box(spec)
    truth = np.asarray(box.theta_from_unit(stream.uniform(size=len(box.free))))
    noise_truth = np.array([drawn(NOISES[noise_name][each.name], stream) for each in noise.parameters])
    test = noisy_test(spec, truth, noise, noise_truth, amplitude=0.01, frequency=1.5, stream=stream)
    other = noisy_test(spec, truth, noise, noise_truth, amplitude=0.006, frequency=3.0, stream=stream)
    bounds = {name: (box.lower[index], box.upper[index]) for index, name in enumerate(box.names)}
    fit = identify(spec, test, bounds=bounds, rng=0, threads=threads)
    draws = sample(
        fit,
        test,
        noise=noise_name,
        priors={f"noise.{name}": prior for name, prior in NOISES[noise_name].items()},
        tempering=1.0,
        rng=int(stream.integers(2**31)),
        threads=threads,
    )
    # The walkers forget one another within an autocorrelation time; draws far apart count as independent.
    chosen = np.linspace(0, len(draws.theta) - 1, _RANKED).astype(int)
    values = np.concatenate([draws.theta[:, list(box.free)], draws.noise], axis=1)[chosen]
    true = np.concatenate([truth[list(box.free)], noise_truth])
    forces = simulate_draws(spec, draws.theta[chosen], other, threads=threads)
    band = noise_band(
        np.repeat(forces, 8, axis=0),
        np.repeat(draws.noise[chosen][: len(forces)], 8, axis=0),
        noise,
        LEVEL,
        deviation=float(np.std(other.force)),
        mean=float(np.mean(other.force)),
        rng=stream,
    )
    return Replicate(
        ranks=[int(rank) for rank in np.sum(values < true, axis=0)],
        coverage=score(band, other.force).coverage,
        converged=draws.status == "converged",
    )


def drawn(prior: Normal | Lognormal, stream: np.random.Generator) -> float:
    if isinstance(prior, Normal):
        return float(stream.normal(prior.mean, prior.deviation))
    return float(stream.lognormal(np.log(prior.median), prior.deviation))


def prior_box(spec: DamperSpec) -> Box:
    """The ranges of the free parameters."""
    ranges = MODELS[spec.name]
    pairs = [
        ranges.get(name, (nominal, nominal)) for name, nominal in zip(spec.names, spec.nominal, strict=True)
    ]
    lower, upper = zip(*pairs, strict=True)
    return Box(
        names=spec.names,
        lower=lower,
        upper=upper,
        log=tuple(each.scale == "log" for each in spec.parameters),
    )


def noisy_test(
    spec: DamperSpec,
    theta: np.ndarray,
    noise: Noise,
    noise_theta: np.ndarray,
    *,
    amplitude: float,
    frequency: float,
    stream: np.random.Generator,
) -> DamperTest:
    """Four cycles of a sinusoid, 60 samples each."""
    dt = 1.0 / (60.0 * frequency)
    time = dt * np.arange(241)
    omega = 2.0 * np.pi * frequency
    x, v = amplitude * np.sin(omega * time), amplitude * omega * np.cos(omega * time)
    force = simulate_force(spec, theta, Loading(dt=dt, displacement=x, velocity=v))
    deviation = float(np.std(force))
    added = noise.draw((force - force.mean())[None] / deviation, noise_theta[None], stream)[0]
    return build_damper_test(
        name=f"{amplitude} m, {frequency} Hz",
        time=time,
        displacement=x,
        velocity=v,
        force=force + deviation * added,
    )


def table(cases: Iterable[Case]) -> Table:
    """A row for each case."""
    return table_of(
        "Synthetic tests, noise as assumed",
        "model",
        ((case.model, case) for case in cases),
        {
            "noise": "{0.noise}",
            "runs": "{0.replicates}",
            "in 90 %": lambda case: f"{100.0 * case.coverage:.1f} %",
            "p uniform": "{0.p_uniform:.3f}",
            "ranks": lambda case: " ".join(map(str, case.ranks)),
        },
    )
