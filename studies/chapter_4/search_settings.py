"""Settings of the study, read from a TOML file and checked."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mrwork as mr
from mrwork.dampers import Box
from mrwork.identification import search_box
from mrwork.records import DamperTest
from mrwork.search import EfficientGA, EliteRule, Optimiser, ParticleSwarm, StandardGA, StopRules

STANDARD, COARSE = "standard GA", "coarse standard GA"
EFFICIENT, SWARM = "efficient GA", "particle swarm"
SEARCHES = (STANDARD, COARSE, EFFICIENT, SWARM)
# Those that the efficient algorithm is compared with.
BASELINES = (STANDARD, COARSE)

# Standard deviation of a uniform population, by which the efficient algorithm mutates.
_COARSE_DEVIATION = 12.0**-0.5

_BEST_ALONE = EliteRule(count=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A model of the chapter, and what of it is held."""

    label: str
    damper: str
    held: dict[str, float]

    @property
    def spec(self) -> mr.DamperSpec:
        return mr.damper(self.damper)

    def box(self, test: DamperTest) -> Box:
        """Where `identify` would search too."""
        bounds = Box.of(self.spec).with_bounds({name: (value, value) for name, value in self.held.items()})
        return search_box(self.spec, bounds, (test,))


@dataclass(frozen=True, slots=True, kw_only=True)
class SyntheticChoice:
    """Amperes, and how long each test is [s]."""

    currents: tuple[float, ...]
    seconds: float


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredChoice:
    """Which records, from when [s] on, every how-manieth sample, and how many of these."""

    records: str
    start: float
    every: int
    samples: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ComparisonSettings:
    """All of study.toml."""

    seed: int
    replicates: int
    population: int
    generations: int
    confidence: float
    models: tuple[Model, ...]
    synthetic: SyntheticChoice
    measured: MeasuredChoice

    @classmethod
    def read(cls, path: Path) -> ComparisonSettings:
        """Read a TOML file; a key that is unknown or absent is an error that names it."""
        table = tomllib.loads(path.read_text(encoding="utf-8"))
        try:
            models = tuple(
                Model(**({"label": label, "held": {}} | entry))
                for label, entry in table.pop("models").items()
            )
            synthetic = table.pop("synthetic")
            return cls(
                models=models,
                synthetic=SyntheticChoice(**synthetic | {"currents": tuple(synthetic["currents"])}),
                measured=MeasuredChoice(**table.pop("measured")),
                **table,
            )
        except (TypeError, KeyError) as error:
            raise mr.MrworkError(f"{path}: {error}; see study.toml for what is expected") from error

    def optimisers(self) -> dict[str, Optimiser[Any]]:
        """The searches that are compared, by label.

        The coarse standard algorithm has the mutation step of the efficient one, which separates the effect of the step
        from that of the algorithm.

        All run to the last generation; other stopping rules are evaluated afterwards on the traces.
        """
        stop = StopRules(
            max_generations=self.generations,
            spread_tolerance=None,
            confidence=None,
            stall_generations=None,
        )
        return {
            STANDARD: StandardGA(population=self.population, stop=stop, elite=_BEST_ALONE),
            COARSE: StandardGA(
                population=self.population, mutation_deviation=_COARSE_DEVIATION, stop=stop, elite=_BEST_ALONE
            ),
            EFFICIENT: EfficientGA(population=self.population, stop=stop, elite=_BEST_ALONE),
            SWARM: ParticleSwarm(population=self.population, stop=stop, elite=_BEST_ALONE),
        }
