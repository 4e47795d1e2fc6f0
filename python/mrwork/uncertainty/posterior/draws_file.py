"""The file of a posterior's draws: netCDF for ArviZ, with checksums of its numbers; read back by parameter."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import Count, NotNegative, Positive
from mrwork.errors import RecordError
from mrwork.identification.fit import Fit, VerdictName
from mrwork.store.child_reader import Member, UnreadableError, read_members
from mrwork.store.input_file import bytes_of, is_there, stored
from mrwork.store.record import Related, record_of
from mrwork.store.run_folder import DRAWS
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws import Draws, DrawsStatus, DrawSummary, summary_of
from mrwork.uncertainty.posterior.target import NOISE

Array = NDArray[np.float64]
_OF_FIT = "of_fit"
# Share by which a draw may exceed a bound after a conversion between forms of a model.
_ROUNDING = 1e-6
_KIND = stored("sample", name="the draws")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Stated:
    """What the file says of the sampling."""

    noise: str
    verdict: str
    temper: Positive
    steps: Count
    thinning: Count
    seconds: NotNegative
    status: DrawsStatus = "unknown"


@dataclass(frozen=True, slots=True, kw_only=True)
class _OfVariable(Related):
    """What the file says of a parameter."""

    verdict: VerdictName | None = None
    reason: str = ""
    median: float = 0.0
    lower: float = -math.inf
    upper: float = math.inf

    def disagreement(self) -> str:
        """Whether the ends of the interval are in order."""
        return "" if self.lower <= self.upper else f"its interval is from {self.lower:g} to {self.upper:g}"


def draws_content(draws: Draws, fit: Fit) -> bytes:
    """The file `posterior.nc` in the run folder of a fit."""
    # In memory first: the library ends the process where a disk is full.
    tree = draws.as_datatree()
    tree.attrs[_OF_FIT] = fit.fingerprint
    encoding = {
        group.path: {name: {"fletcher32": True} for name in group.data_vars}
        for group in tree.subtree
        if group.data_vars
    }
    return bytes(tree.to_netcdf(engine="h5netcdf", encoding=encoding))


def read_draws(place: Path, fit: Fit) -> Draws | None:
    """The draws of the run folder at `place`, `None` where there are none.

    Diagnostics are computed from the draws kept; autocorrelation times are NaN.
    """
    path = place / DRAWS
    if not is_there(path, _KIND):
        return None
    try:
        return _draws(read_members(bytes_of(path, _KIND), "hdf5"), path, fit)
    except (OSError, KeyError, TypeError, ValueError, UnreadableError) as reason:
        if isinstance(reason, RecordError):
            raise
        raise RecordError(f"{path} cannot be read ({reason}); run `mrwork sample {place}` again") from None


def _draws(members: Mapping[str, Member], path: Path, fit: Fit) -> Draws:
    if members[""].attributes.get(_OF_FIT, fit.fingerprint) != fit.fingerprint:
        raise RecordError(
            f"{path} is of another fit than that beside it; run `mrwork sample {path.parent}` again"
        )
    posterior = _variables(members, "posterior")
    columns = {name: _numbers(member) for name, member in posterior.items()}
    densities = _numbers(members["sample_stats/lp"])
    attributes = members[""].attributes
    stated: _Stated = record_of(
        _Stated, dict(attributes), origin=str(path), name="posterior", verb=f"sample {path.parent}"
    )
    noise = noise_model(stated.noise)
    names = fit.spec.names
    missing = [name for name in names if name not in columns]
    if missing:
        raise RecordError(
            f"{path} lacks {', '.join(missing)}, so it is of another fit; run `mrwork sample {path.parent}` again"
        )
    noise_names = tuple(NOISE + each.name for each in noise.parameters)
    bounds = {each.name: (each.lower, each.upper) for each in fit.estimates} | {
        NOISE + each.name: (each.lower, each.upper) for each in noise.parameters
    }
    if densities.ndim != 2 or not densities.size:
        raise ValueError("it has no draws")
    for name in names + noise_names:
        lower, upper = bounds[name]
        if columns[name].shape != densities.shape:
            raise ValueError("its variables differ in shape")
        slack = _ROUNDING * np.abs(columns[name])
        if not np.all((columns[name] >= lower - slack) & (columns[name] <= upper + slack)):
            raise ValueError(f"draws of {name} are outside its bounds {lower:g} to {upper:g}")
    if not np.isfinite(densities).all():
        raise ValueError("a density is not a number")
    return Draws(
        model=fit.model,
        names=names,
        noise_model=noise.name,
        noise_names=noise_names,
        chains=np.stack([columns[name] for name in names], axis=-1),
        noise_chains=np.stack([columns[name] for name in noise_names], axis=-1),
        densities=densities,
        summaries=tuple(
            _with_stored(
                summary_of(
                    columns[name],
                    name=name,
                    unit=str(posterior[name].attributes["units"]),
                    bounds=bounds[name],
                    tau=np.nan,
                ),
                posterior[name].attributes,
                path,
            )
            for name in names + noise_names
        ),
        status=stated.status,
        verdict=stated.verdict,
        temper=stated.temper,
        n_steps=stated.steps,
        thinning=stated.thinning,
        seconds=stated.seconds,
        provenance=None,
        measured={name: _numbers(member) for name, member in _variables(members, "observed_data").items()},
    )


def _variables(members: Mapping[str, Member], group: str) -> dict[str, Member]:
    """Variables of a group by name, without its coordinates."""
    return {
        path.removeprefix(f"{group}/"): member
        for path, member in members.items()
        if path.startswith(f"{group}/") and member.attributes.get("CLASS") != "DIMENSION_SCALE"
    }


def _numbers(member: Member) -> Array:
    if member.array is None:
        raise ValueError("one of its variables has no numbers")
    return member.array.astype(np.float64)


def _with_stored(summary: DrawSummary, attributes: Mapping[str, Any], path: Path) -> DrawSummary:
    """The summary with the verdict and the quantiles of all draws, which files of earlier versions do not have."""
    known = {each.name for each in fields(_OfVariable)}
    given = {name: value for name, value in attributes.items() if name in known}
    stated = record_of(
        _OfVariable,
        given,
        origin=str(path),
        name=f"posterior of {summary.name}",
        verb=f"sample {path.parent}",
    )
    return replace(summary, **{name: getattr(stated, name) for name in given})
