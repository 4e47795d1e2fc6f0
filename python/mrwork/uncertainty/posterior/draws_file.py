"""The file of a posterior's draws: netCDF for ArviZ, with checksums of its numbers; read back by parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.identification.fit import Fit
from mrwork.store.child_reader import Member, UnreadableError, read_members
from mrwork.store.input_file import bytes_of, is_there, stored
from mrwork.store.run_folder import DRAWS
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws import Draws, DrawSummary, summary_of
from mrwork.uncertainty.posterior.space import NOISE

Array = NDArray[np.float64]
_KIND = stored("sample", name="the draws")


def draws_content(draws: Draws) -> bytes:
    """The file `posterior.nc` of a run folder."""
    # In memory first: the library ends the process where a disk is full.
    tree = draws.as_datatree()
    encoding = {
        group.path: {name: {"fletcher32": True} for name in group.data_vars}
        for group in tree.subtree
        if group.data_vars
    }
    return bytes(tree.to_netcdf(engine="h5netcdf", encoding=encoding))


def read_draws(place: Path, fit: Fit) -> Draws | None:
    """The draws of the run folder at `place`, `None` where there are none.

    Diagnostics are computed from the draws kept; autocorrelation times are NaN.

    Raises
    ------
    RecordError
        Where they are damaged, or of another model.
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
    posterior = _variables(members, "posterior")
    columns = {name: _numbers(member) for name, member in posterior.items()}
    densities = _numbers(members["sample_stats/lp"])
    attributes = members[""].attributes
    noise = noise_model(str(attributes["noise"]))
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
    if densities.ndim != 2 or any(columns[name].shape != densities.shape for name in names + noise_names):
        raise ValueError("its variables differ in shape")
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
            )
            for name in names + noise_names
        ),
        status=attributes.get("status", "unknown"),
        verdict=str(attributes["verdict"]),
        temper=float(attributes["temper"]),
        n_steps=int(attributes["steps"]),
        thinning=int(attributes["thinning"]),
        seconds=float(attributes["seconds"]),
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


def _with_stored(summary: DrawSummary, attributes: Mapping[str, Any]) -> DrawSummary:
    """The summary with the verdict and the quantiles of all draws, which files of earlier versions do not have."""
    return replace(
        summary,
        verdict=attributes.get("verdict"),
        reason=str(attributes.get("reason", "")),
        median=float(attributes.get("median", summary.median)),
        lower=float(attributes.get("lower", summary.lower)),
        upper=float(attributes.get("upper", summary.upper)),
    )
