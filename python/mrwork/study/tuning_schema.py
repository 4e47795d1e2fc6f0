"""Declarations of the tables [uncertainty] and [[tune]] of a study file and their keys."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from mrwork.arguments import checked
from mrwork.keys import LARGEST_SEED, Place, check_keys, key
from mrwork.search.rules import LARGEST_POPULATION

Risk = Literal["mean", "max", "cvar"]
Baseline = Literal["passive_off", "best_passive"]
# A factor must stay positive.
_WIDEST = 0.999

Combination = Literal["mean", "largest"]


@dataclass(frozen=True, slots=True, kw_only=True)
class UncertaintyTable:
    """What is not known exactly, as realisations: each law is simulated with all of them, beside the nominal study.

    The laws are designed for the nominal study. All laws and candidates are simulated with the same realisations.
    """

    realisations: int = key("number of realisations", default=16, least=1, most=10_000)
    damper: bool = key(
        "whether the parameters of identified dampers are drawn from the posterior of their run, of mrwork sample",
        default=True,
    )
    stiffness: float = key(
        "half the range of a factor of the stiffness of the building, as 0.1 for +-10 %",
        default=0.0,
        least=0.0,
        most=_WIDEST,
    )
    damping: float = key(
        "half the range of a factor of the damping of the building", default=0.0, least=0.0, most=_WIDEST
    )
    delay: float = key("largest additional delay of the command", unit="s", default=0.0, least=0.0)
    seed: int = key("seed of the realisations", default=0, least=0, most=LARGEST_SEED)
    place: Place | None = None


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class TuneTable:
    """Laws whose settings `mrwork tune` searches, each for itself, on the training motions of the study.

    A candidate is scored by the mean of its criteria over those at i = 0, under each motion and realisation; the risk
    takes one number of all these. With `relative_to = "best_passive"` and `combine = "largest"` a score below 1 says
    that the law is better than the best constant command in every criterion. Without `free`, each law has its own free
    settings with their ranges, see `mrwork respond --laws`, and the largest command of the law is one of them.
    """

    _made_by: ClassVar[str] = "mr.study.TuneTable(laws=...)"

    laws: tuple[str, ...] = key("names of the laws")
    label: str = key("appended to the titles of the laws in tables, by default tuned", default="", label=True)
    settings: Mapping[str, Any] | None = key("settings that are held", default=None)
    free: Mapping[str, tuple[float, ...]] | None = key(
        "settings to be searched, with the ends of their ranges, as { control_weight = [1e-15, 1e-9] }; an empty array "
        "for the range of the law",
        default=None,
    )
    criteria: tuple[str, ...] | Mapping[str, float] = key(
        "criteria of the score, an array or a table with their weights; by default peak and rms of drift and "
        "acceleration",
        default=(),
    )
    relative_to: Baseline = key(
        "what the criteria are divided by: those at i = 0, or under the best constant command",
        default="passive_off",
    )
    combine: Combination = key(
        "number of the weighted criteria of a run: their mean, or the largest", default="mean"
    )
    objectives: tuple[str, ...] = key(
        "criteria of a Pareto front beside the best of the score, by NSGA-II, which takes pymoo", default=()
    )
    risk: Risk = key(
        "number of all motions and realisations: their mean, the largest, or the mean of the worst share `tail`",
        default="mean",
    )
    tail: float | None = key(
        "share of the worst for cvar, up to 1, by default 0.2", default=None, above=0.0, most=1.0
    )
    constraints: Mapping[str, float | str] | None = key(
        'upper limits of criteria under every motion, as { peak_stroke = "20 mm", rms_current = 0.5 }',
        default=None,
    )
    robust: bool = key("whether the realisations of [uncertainty] belong to the score", default=False)
    search: str = key(
        "search algorithm; cma (extra peers) for laws of many numbers, as signal_network",
        default="differential_evolution",
    )
    population: int = key("candidates of a generation", default=24, least=5, most=LARGEST_POPULATION)
    budget: int = key(
        "candidates of each law, apart from the first ones", default=384, least=5, most=LARGEST_POPULATION
    )
    gradient_steps: int = key(
        "steps of L-BFGS-B on the twin after the search, for laws that are smooth: proportional_direct, signal_network",
        default=0,
        least=0,
        most=10_000,
    )
    seed: int = key(
        "seed of the search, added to that of the command line", default=0, least=0, most=LARGEST_SEED
    )
    place: Place | None = None

    def __post_init__(self) -> None:
        check_keys(self)
