"""What a sampling came to: draws of the parameters and the noise, how good they are, and where they came from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.identification.fit import Provenance
from mrwork.summary import Summarised, Summary, rounded
from mrwork.uncertainty.noise import NoiseName
from mrwork.uncertainty.posterior.diagnosis import convergence

if TYPE_CHECKING:
    from xarray import DataTree

Array = NDArray[np.float64]
DrawsStatus = Literal["converged", "not_converged", "interrupted"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawSummary:
    """Draws of one parameter, or noise parameter, in `unit`.

    `mcse` is the Monte-Carlo standard error of the mean, `tau` the autocorrelation time in steps. Diagnostics are not
    numbers where the parameter was held fixed. `remark` says so, or at which bound the draws pile up.
    """

    name: str
    unit: str
    mean: float
    deviation: float
    lower_5: float
    median: float
    upper_95: float
    mcse: float
    ess_bulk: float
    ess_tail: float
    rhat: float
    tau: float
    remark: Literal["", "fixed", "piles up at its lower bound", "piles up at its upper bound"] = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False, repr=False)
class Draws(Summarised):
    """A posterior by its draws, kept apart by the walkers that made them.

    `chains` (n_walkers, n_kept, n_params) are parameters of the model asked for, in spec order;
    `noise_chains` (n_walkers, n_kept, n_noise) those of the noise, in deviations of the test's force; `densities`
    (n_walkers, n_kept) the log posterior in the coordinates that were sampled, up to a constant. `temper` is what the
    log-likelihood was multiplied by. `n_steps` were taken, of which the burn-in and all but every `thinning`-th are
    left out. `measured` has the force of each test [N], by its name.
    """

    model: str
    names: tuple[str, ...]
    noise_model: NoiseName
    noise_names: tuple[str, ...]
    chains: Array
    noise_chains: Array
    densities: Array
    summaries: tuple[DrawSummary, ...]
    status: DrawsStatus
    verdict: str
    temper: float
    n_steps: int
    thinning: int
    seconds: float
    provenance: Provenance
    measured: Mapping[str, Array]

    @property
    def theta(self) -> Array:
        """Parameters of all draws, shape (n_draws, n_params)."""
        return self.chains.reshape(-1, len(self.names))

    @property
    def noise(self) -> Array:
        """Noise parameters of all draws, shape (n_draws, n_noise)."""
        return self.noise_chains.reshape(-1, len(self.noise_names))

    @property
    def log_posterior(self) -> Array:
        """Log posterior of all draws, shape (n_draws,)."""
        return self.densities.reshape(-1)

    def as_datatree(self) -> DataTree:
        """The draws for ArviZ: groups `posterior`, `sample_stats` and `observed_data`, with units and provenance."""
        from arviz_base import from_dict

        named = dict(zip(self.names, np.moveaxis(self.chains, -1, 0), strict=True))
        named |= dict(zip(self.noise_names, np.moveaxis(self.noise_chains, -1, 0), strict=True))
        tree: DataTree = from_dict(
            {"posterior": named, "sample_stats": {"lp": self.densities}, "observed_data": self.measured},
            attrs={
                "/": {
                    "model": self.model,
                    "noise": self.noise_model,
                    "verdict": self.verdict,
                    "temper": self.temper,
                    "steps": self.n_steps,
                    "thinning": self.thinning,
                    "seconds": self.seconds,
                    "inference_library": "emcee",
                }
                | {name: str(value) for name, value in asdict(self.provenance).items()}
            },
        )
        for name in self.measured:
            tree["observed_data"][name].attrs["units"] = "N"
        for summary in self.summaries:
            tree["posterior"][summary.name].attrs["units"] = summary.unit
        return tree

    def _summary(self) -> Summary:
        n_walkers, n_kept, _ = self.chains.shape
        return Summary(
            title=f"Draws of {self.model} with {self.noise_model} noise: {self.status.replace('_', ' ')}",
            facts=(
                (
                    "draws",
                    f"{n_walkers} walkers x {n_kept} draws, {self.n_steps} steps, {self.seconds:.1f} s",
                ),
                ("verdict", self.verdict),
            ),
            columns=("parameter", "median", "5 %", "95 %", "unit", "R-hat", "effective", "remark"),
            rows=[
                (
                    each.name,
                    rounded(each.median, 5),
                    rounded(each.lower_5),
                    rounded(each.upper_95),
                    each.unit,
                    f"{each.rhat:.3f}",
                    f"{each.ess_bulk:.0f}",
                    each.remark,
                )
                for each in self.summaries
            ],
        )


def summary_of(chain: Array, *, name: str, unit: str, bounds: tuple[float, float], tau: float) -> DrawSummary:
    """Summarise the draws of one parameter, shape (n_walkers, n_kept)."""
    lower, median, upper = np.quantile(chain, [0.05, 0.5, 0.95]).tolist()
    fixed = float(np.ptp(chain)) == 0.0
    told = convergence(chain)
    return DrawSummary(
        name=name,
        unit=unit,
        mean=float(chain.mean()),
        deviation=float(chain.std()),
        lower_5=lower,
        median=median,
        upper_95=upper,
        tau=tau,
        remark="fixed" if fixed else _pile(chain, bounds, upper - lower),
        **told._asdict(),
    )


def _pile(
    chain: Array, bounds: tuple[float, float], width: float
) -> Literal["", "piles up at its lower bound", "piles up at its upper bound"]:
    """Where the outermost hundredth of the draws reaches within a fiftieth of their width of a bound.

    That of a half-normal density, cut at its summit, is within 0.7 % of it; that of one cut two deviations from its
    summit is 5 % away.
    """
    first, last = np.quantile(chain, [0.01, 0.99])
    if first - bounds[0] < 0.02 * width:
        return "piles up at its lower bound"
    return "piles up at its upper bound" if bounds[1] - last < 0.02 * width else ""
