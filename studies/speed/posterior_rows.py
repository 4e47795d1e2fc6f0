"""Messages to and from a process of `study.py posterior`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class PosteriorSettings:
    """How much is measured; `choose_variant` looks for the fastest way to compile the peers."""

    steps: int
    walkers: int
    nuts_warmup: int
    nuts_draws: int
    choose_variant: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """Values measured before the turns began; `missing` libraries are left out."""

    test: str
    synthetic: bool
    n_time: int
    n_dim: int
    fit_percent: float
    temper: float
    threads: int
    missing: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SamplerRow:
    """One sampler: `seconds` without `compile_seconds`; the least bulk ESS of all parameters, after the burn-in.

    `simulating_share` is the part of the seconds spent in densities; those of NUTS have no such part.
    """

    sampler: str
    threads: int
    seconds: float
    compile_seconds: float
    ess_min: float
    ess_per_second: float
    rhat: float
    evaluations: int
    simulating_share: float | None
    settings: str
