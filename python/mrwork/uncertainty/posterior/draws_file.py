"""The file of a posterior's draws: netCDF for ArviZ, read back by parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.identification.fit import Fit
from mrwork.store.input_file import is_there, stored
from mrwork.store.run_folder import DRAWS, replacing
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws import Draws, DrawSummary, summary_of
from mrwork.uncertainty.posterior.space import NOISE

if TYPE_CHECKING:
    from xarray import DataArray

Array = NDArray[np.float64]


def write_draws(place: Path, draws: Draws) -> None:
    """Write `posterior.nc` into the run folder at `place`.

    Raises
    ------
    OutputError
        Where it cannot be written.
    """
    with replacing(place / DRAWS) as temporary:
        draws.as_datatree().to_netcdf(temporary, engine="h5netcdf")


def read_draws(place: Path, fit: Fit) -> Draws | None:
    """The draws of the run folder at `place`, `None` where there are none.

    Diagnostics are computed from the draws kept; autocorrelation times are NaN.

    Raises
    ------
    RecordError
        Where they are damaged, or of another model.
    """
    path = place / DRAWS
    if not is_there(path, stored("sample", name="the draws")):
        return None
    # A second to load.
    import xarray

    try:
        with xarray.open_datatree(path, engine="h5netcdf") as tree:
            posterior = tree["posterior"].to_dataset()
            columns = {str(name): _numbers(values) for name, values in posterior.data_vars.items()}
            units = {name: str(posterior[name].attrs["units"]) for name in columns}
            densities = _numbers(tree["sample_stats"].to_dataset()["lp"])
            observed = tree["observed_data"].to_dataset()
            measured = {str(name): _numbers(values) for name, values in observed.data_vars.items()}
            attributes = dict(tree.attrs)
            noise = noise_model(str(attributes["noise"]))
            names = fit.spec.names
            missing = [name for name in names if name not in columns]
            if missing:
                raise RecordError(
                    f"{path} lacks {', '.join(missing)}, so it is of another fit; run `mrwork sample {place}` again"
                )
            noise_names = tuple(NOISE + each.name for each in noise.parameters)
            bounds = {each.name: (each.lower, each.upper) for each in fit.estimates} | {
                NOISE + each.name: (each.lower, each.upper) for each in noise.parameters
            }
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
                            columns[name], name=name, unit=units[name], bounds=bounds[name], tau=np.nan
                        ),
                        posterior[name].attrs,
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
                measured=measured,
            )
    except RecordError:
        raise
    except (OSError, KeyError, ValueError) as reason:
        raise RecordError(f"{path} cannot be read ({reason}); run `mrwork sample {place}` again") from None


def _numbers(values: DataArray) -> Array:
    return np.asarray(values.values, dtype=np.float64)


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
