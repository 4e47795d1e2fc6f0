"""Draws of a posterior: convergence of their chain, a summary of each parameter with its verdict, and their file.

The file is netCDF for ArviZ, with checksums of its numbers; it is read back by parameter.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import partial
from importlib import import_module
from math import ceil
from operator import attrgetter
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np

from mrwork.base.arguments import Shape, checked
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes
from mrwork.base.numbers import with_decimals
from mrwork.base.plotted import Plotted
from mrwork.base.remark import Remark
from mrwork.base.summary import Summarised, Summary, named
from mrwork.base.table import Column, Table, as_json
from mrwork.base.values import Floats, array_dataclass
from mrwork.identification.fit import Fit, Provenance
from mrwork.identification.interval import NOT_JUDGED, Interval, Verdict, end_in_words
from mrwork.store.codec import built, json_document
from mrwork.store.members import Member, members_of
from mrwork.store.run_folder import DRAWS, RunFolder
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.target import NOISE

if TYPE_CHECKING:
    from xarray import DataTree


# Limits on R-hat and effective sizes: Vehtari et al. (2021); on the length in autocorrelation times: emcee.
LARGEST_RHAT = 1.01
LEAST_ESS = 400.0
_LEAST_LENGTH = 50.0
# Share of the chain that is discarded.
_BURN_IN = 0.25
# Largest number of evenly spaced steps from which R-hat and effective sizes are computed.
_MOST_DRAWS = 1000


@array_dataclass()
class Diagnosis:
    """Convergence diagnostics after the burn-in, shape (n_params,), NaN for fixed parameters; `tau` in steps."""

    names: tuple[str, ...]
    n_steps: int
    tau: Floats
    rhat: Floats
    ess_bulk: Floats
    ess_tail: Floats

    @property
    def length(self) -> float:
        """Chain length in autocorrelation times, of the slowest parameter; 0 where a walker never moved."""
        longest = float(np.max(self.tau))
        return self.n_steps / longest if longest > 0.0 else 0.0

    @property
    def least_steps(self) -> float:
        """Least number of steps, with the burn-in, at these autocorrelation times."""
        return _LEAST_LENGTH * float(np.max(self.tau)) / (1.0 - _BURN_IN)

    @property
    def shortcomings(self) -> tuple[str, ...]:
        """Unmet convergence criteria, in words; empty where the chain has converged."""
        criteria = []
        if not self.length >= _LEAST_LENGTH:
            criteria.append(
                f"the chain is {self.length:.0f} autocorrelation times long where {_LEAST_LENGTH:.0f} are required"
            )
        worst = int(np.argmax(np.where(np.isnan(self.rhat), np.inf, self.rhat)))
        if not self.rhat[worst] < LARGEST_RHAT:
            criteria.append(
                f"walkers disagree most on {self.names[worst]} (R-hat {self.rhat[worst]:.3f}, below {LARGEST_RHAT} "
                "is required)"
            )
        ess = np.minimum(self.ess_bulk, self.ess_tail)
        least = int(np.argmin(np.where(np.isnan(ess), -np.inf, ess)))
        if not ess[least] >= LEAST_ESS:
            criteria.append(
                f"{self.names[least]} has an effective sample size of {ess[least]:.0f}, and {LEAST_ESS:.0f} is required"
            )
        return tuple(criteria)


def diagnose(values: Floats, names: tuple[str, ...]) -> Diagnosis:
    """Convergence of a chain without burn-in, shape (n_steps, n_walkers, n_params); walkers count as chains."""
    n_steps = len(values)
    by_chain = np.moveaxis(values[:: max(1, ceil(n_steps / _MOST_DRAWS))], 0, 1)
    columns = [np.ascontiguousarray(by_chain[:, :, index]) for index in range(values.shape[2])]
    rhat, bulk, tail, _ = np.array([convergence(column) for column in columns]).T
    tau = autocorrelation_times(values)
    return Diagnosis(names=names, n_steps=n_steps, tau=tau, rhat=rhat, ess_bulk=bulk, ess_tail=tail)


class Convergence(NamedTuple):
    """Convergence of one parameter; `mcse` is the Monte-Carlo standard error of its mean."""

    rhat: float
    ess_bulk: float
    ess_tail: float
    mcse: float


@checked
def convergence(chains: Annotated[Floats, Shape(("n_chains", "n_draws"))]) -> Convergence:
    """Rank-normalised R-hat, effective sizes and Monte-Carlo error of draws, shape (n_chains, n_draws)."""
    # ArviZ takes a second to load, and has no type annotations.
    statistics: Any = import_module("arviz_stats.base").array_stats
    # A constant chain has zero variance.
    with np.errstate(all="ignore"):
        return Convergence(
            rhat=float(statistics.rhat(chains, method="rank")),
            ess_bulk=float(statistics.ess(chains, method="bulk")),
            ess_tail=float(statistics.ess(chains, method="tail", prob=(0.05, 0.95))),
            mcse=float(statistics.mcse(chains, method="mean")),
        )


def autocorrelation_times(values: Floats) -> Floats:
    """Integrated autocorrelation time in steps, shape (n_params,), of a chain, (n_steps, n_walkers, n_params)."""
    from emcee.autocorr import integrated_time

    with np.errstate(all="ignore"):
        return np.asarray(integrated_time(values, tol=0, has_walkers=True))


def select_kept_rows(n_steps: int) -> slice:
    """Rows of a chain after the burn-in; its first row is the start."""
    return slice(1 + int(_BURN_IN * n_steps), n_steps + 1)


def next_check(n_steps: int) -> int:
    """Step of the next convergence check, a function of the step alone: a resumed run ends at the same step."""
    check = 200
    while check <= n_steps:
        check = ceil(1.25 * check)
    return check


DrawsStatus = Literal["converged", "not_converged", "interrupted"]
# Probability of the intervals.
LEVEL = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class DrawSummary:
    """Summary of the draws of one parameter or noise parameter, in `unit`; `tau` is in steps.

    The `interval` is open at an end where the draws pile up. A parameter that was held fixed has none, and its
    diagnostics are NaN. Noise and fixed parameters have no verdict.
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
    interval: Interval | None
    verdict: Verdict = NOT_JUDGED

    @property
    def fixed(self) -> bool:
        """Whether the parameter was held fixed."""
        return self.interval is None

    @property
    def state(self) -> str:
        """Whether the parameter was held fixed, and at which bounds its draws pile up; empty for neither."""
        if self.interval is None:
            return "fixed"
        open_ends = [end for end in ("lower", "upper") if getattr(self.interval, end) is None]
        if len(open_ends) > 1:
            return "piles up at both bounds"
        return f"piles up at its {open_ends[0]} bound" if open_ends else ""


def _end_of(summary: DrawSummary, *, end: str) -> float | None:
    return summary.median if summary.interval is None else getattr(summary.interval, end)


# What the parameters have in the table of the draws, in JSON and in the attributes of the file.
_COLUMNS = (
    Column("name", "parameter"),
    *map(Column, ("mean", "deviation", "lower_5", "upper_95", "mcse", "ess_tail", "tau", "state")),
    Column("median", "median", shown=5),
    Column("lower", "2.5 %", shown=end_in_words, of=partial(_end_of, end="lower")),
    Column("upper", "97.5 %", shown=end_in_words, of=partial(_end_of, end="upper")),
    Column("unit", "unit"),
    Column("rhat", "R-hat", shown=lambda rhat: with_decimals(rhat, 3)),
    Column("ess_bulk", "ESS", shown=lambda ess: with_decimals(ess, 0)),
    Column("verdict", of=attrgetter("verdict.word")),
    Column("", "verdict", of=lambda summary: summary.verdict.word or summary.state),
    Column("reason", "reason", of=attrgetter("verdict.reason")),
)


@array_dataclass(repr=False)
class Draws(Plotted, WithAxes, Summarised):
    """Draws from a posterior, by walker.

    `chains` (n_walkers, n_kept, n_names) are the `n_params` parameters of the model of the fit, in spec order, then its
    free effects on the recorded force; `noise_chains` (n_walkers, n_kept, n_noise) are of the noise, in
    deviations of the test's force; `densities` (n_walkers, n_kept) the log posterior in the coordinates that were
    sampled, up to a constant. `temper` is the factor of the log-likelihood. Of `n_steps` steps the burn-in is left out,
    and every `thinning`-th of the others is kept. `measured` has the force of each test [N] by its name. Draws that
    were read from a file have no `provenance`; the file has it as text. `remarks` say what the draws do not count.
    """

    _made_by: ClassVar[str] = "mr.sample(fit, tests)"

    model: str
    names: tuple[str, ...]
    n_params: int
    noise_model: str
    noise_names: tuple[str, ...]
    chains: Floats
    noise_chains: Floats
    densities: Floats
    summaries: tuple[DrawSummary, ...]
    status: DrawsStatus
    sentence: str
    temper: float
    n_steps: int
    thinning: int
    seconds: float
    provenance: Provenance | None
    measured: Mapping[str, Floats]
    remarks: tuple[Remark, ...] = ()

    @property
    def theta(self) -> Floats:
        """Parameters of the model in all draws, shape (n_draws, n_params)."""
        return self.with_effects[:, : self.n_params]

    @property
    def with_effects(self) -> Floats:
        """Parameters and free effects of all draws, shape (n_draws, n_names)."""
        return self.chains.reshape(-1, len(self.names))

    @property
    def noise(self) -> Floats:
        """Noise parameters of all draws, shape (n_draws, n_noise)."""
        return self.noise_chains.reshape(-1, len(self.noise_names))

    @property
    def varied(self) -> tuple[DrawSummary, ...]:
        """Summaries of the parameters that were not held fixed."""
        return tuple(summary for summary in self.summaries if not summary.fixed)

    @checked
    def chain(self, name: str) -> Floats:
        """Draws of one parameter or noise parameter, shape (n_walkers, n_kept)."""
        if name in self.noise_names:
            return self.noise_chains[..., self.noise_names.index(name)]
        return self.chains[..., self.names.index(name)]

    def as_datatree(self) -> DataTree:
        """Draws for ArviZ: groups `posterior`, `sample_stats` and `observed_data`, with units and provenance."""
        from arviz_base import from_dict

        named = dict(zip(self.names, np.moveaxis(self.chains, -1, 0), strict=True))
        named |= dict(zip(self.noise_names, np.moveaxis(self.noise_chains, -1, 0), strict=True))
        # ArviZ's conventions would have more draws than chains; here the chains are walkers, of which there are many.
        provenance = {} if self.provenance is None else asdict(self.provenance)
        tree: DataTree = from_dict(
            {"posterior": named, "sample_stats": {"lp": self.densities}, "observed_data": self.measured},
            check_conventions=False,
            attrs={
                "/": {
                    "model": self.model,
                    "noise": self.noise_model,
                    "status": self.status,
                    "sentence": self.sentence,
                    "temper": self.temper,
                    "steps": self.n_steps,
                    "thinning": self.thinning,
                    "seconds": self.seconds,
                    "remarks": json.dumps([asdict(remark) for remark in self.remarks]),
                    "inference_library": "emcee",
                }
                | {name: str(value) for name, value in provenance.items()}
            },
        )
        for name in self.measured:
            tree["observed_data"][name].attrs["units"] = "N"
        for summary in self.summaries:
            # The draws kept are thinned, so what follows from them differs a little.
            facts = {
                name: value for name, value in as_json(_COLUMNS, summary).items() if value not in (None, "")
            }
            whole = {"units": summary.unit, "summary": json_document(summary)}
            tree["posterior"][summary.name].attrs |= facts | whole
        return tree

    def _named_arrays(self) -> NamedArrays:
        n_walkers, n_kept, _ = self.chains.shape
        axes = ("walker", "draw")
        posterior = {
            summary.name: NamedArray.of(
                self.chain(summary.name),
                *axes,
                unit=summary.unit,
                long_name="parameter of the noise" if summary.name in self.noise_names else "parameter",
            )
            for summary in self.summaries
        }
        density = NamedArray.of(self.densities, *axes, long_name="log posterior, up to a constant")
        return NamedArrays(
            title=f"Draws of {self.model} with {self.noise_model} noise",
            rows=axes,
            labels={"walker": NamedArray.of(range(n_walkers)), "draw": NamedArray.of(range(n_kept))},
            arrays=posterior | {"log_posterior": density},
        )

    def document(self) -> dict[str, Any]:
        """What `mrwork intervals --posterior --json` prints."""
        return {
            "model": self.model,
            "noise": self.noise_model,
            **named(self, "status", "sentence", "temper"),
            "parameters": {summary.name: as_json(_COLUMNS, summary) for summary in self.summaries},
            "remarks": [asdict(remark) for remark in self.remarks],
            "n_draws": len(self.theta),
            "steps": self.n_steps,
            "seconds": self.seconds,
            "rng": None if self.provenance is None else self.provenance.rng,
        }

    def _summary(self) -> Summary:
        made = "{} walkers x {} draws".format(*self.chains.shape)
        return Summary(
            title=f"Draws of {self.model} with {self.noise_model} noise: {self.status.replace('_', ' ')}",
            facts=(("draws", f"{made}, {self.n_steps} steps, {self.seconds:.1f} s"),),
            remarks=self.remarks,
            notes=(self.sentence,),
            tables=[Table.of(_COLUMNS, self.summaries)],
        )


def summary_of(
    chain: Floats, *, name: str, unit: str, bounds: tuple[float, float], tau: float
) -> DrawSummary:
    """Summarise the draws of one parameter, shape (n_walkers, n_kept)."""
    tail = 0.5 * (1.0 - LEVEL)
    first, lower, median, upper, last = np.quantile(chain, [tail, 0.05, 0.5, 0.95, 1.0 - tail]).tolist()
    interval = None
    if np.ptp(chain) > 0.0:
        at_lower, at_upper = _pile_up(chain, bounds, upper - lower)
        interval = Interval(
            kind="posterior",
            level=LEVEL,
            lower=None if at_lower else first,
            upper=None if at_upper else last,
            lower_end="bound" if at_lower else "closed",
            upper_end="bound" if at_upper else "closed",
        )
    return DrawSummary(
        name=name,
        unit=unit,
        mean=float(chain.mean()),
        deviation=float(chain.std()),
        lower_5=lower,
        median=median,
        upper_95=upper,
        tau=tau,
        interval=interval,
        **convergence(chain)._asdict(),
    )


def _pile_up(chain: Floats, bounds: tuple[float, float], width: float) -> tuple[bool, bool]:
    """Whether draws pile up at the lower and the upper bound: their outermost 1 % is within 2 % of their width of it.

    A half-normal density, truncated at its mode, comes within 0.7 %, a normal one cut at two deviations within 5 %.
    """
    first, last = np.quantile(chain, [0.01, 0.99])
    return bool(first - bounds[0] < 0.02 * width), bool(bounds[1] - last < 0.02 * width)


_VERB = "intervals --posterior"


def draws_content(draws: Draws) -> bytes:
    """The file `posterior.nc` in the run folder of a fit."""
    # In memory first: the library ends the process where a disk is full.
    tree = draws.as_datatree()
    encoding = {
        group.path: {name: {"fletcher32": True} for name in group.data_vars}
        for group in tree.subtree
        if group.data_vars
    }
    return bytes(tree.to_netcdf(engine="h5netcdf", encoding=encoding))


def read_draws(run: RunFolder, fit: Fit) -> Draws | None:
    """The draws in a run folder; `None` where there are none."""
    content = run.content(DRAWS, verb=_VERB)
    if content is None:
        return None
    with run.explained(DRAWS, verb=_VERB):
        path = run.path / DRAWS
        return _draws(members_of(content, path, remedy=f"run `mrwork {_VERB} {run.path}` again"), fit)


def _draws(members: Mapping[str, Member], fit: Fit) -> Draws:
    posterior = _variables(members, "posterior")
    columns = {name: _numbers(member) for name, member in posterior.items()}
    facts = members[""].attributes
    noise = noise_model(facts["noise"])
    noise_names = tuple(NOISE + parameter.name for parameter in noise.parameters)
    names = tuple(estimate.name for estimate in fit.varied)
    return Draws(
        model=fit.model,
        names=names,
        n_params=len(fit.theta),
        noise_model=noise.name,
        noise_names=noise_names,
        chains=np.stack([columns[name] for name in names], axis=-1),
        noise_chains=np.stack([columns[name] for name in noise_names], axis=-1),
        densities=_numbers(members["sample_stats/lp"]),
        summaries=tuple(
            built(DrawSummary, json.loads(posterior[name].attributes["summary"]))
            for name in names + noise_names
        ),
        status=facts["status"],
        sentence=facts["sentence"],
        temper=float(facts["temper"]),
        n_steps=int(facts["steps"]),
        thinning=int(facts["thinning"]),
        seconds=float(facts["seconds"]),
        provenance=None,
        measured={name: _numbers(member) for name, member in _variables(members, "observed_data").items()},
        remarks=tuple(built(Remark, remark) for remark in json.loads(facts.get("remarks", "[]"))),
    )


def _variables(members: Mapping[str, Member], group: str) -> dict[str, Member]:
    """Variables of a group by name, without its coordinates."""
    return {
        path.removeprefix(f"{group}/"): member
        for path, member in members.items()
        if path.startswith(f"{group}/") and member.attributes.get("CLASS") != "DIMENSION_SCALE"
    }


def _numbers(member: Member) -> Floats:
    if member.array is None:
        raise ValueError("one of its variables has no numbers")
    return member.array.astype(np.float64)
