"""The file of a posterior's draws: netCDF for ArviZ, read back by parameter."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.identification.fit import Fit
from mrwork.store.run_folder import DRAWS, replacing
from mrwork.uncertainty.noise import noise_model
from mrwork.uncertainty.posterior.draws import Draws, DrawSummary, summary_of
from mrwork.uncertainty.posterior.space import NOISE

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StoredDraws:
    """Draws by parameter, each of shape (n_walkers, n_kept), those of the noise last, with their summaries."""

    chains: dict[str, Array]
    summaries: tuple[DrawSummary, ...]
    noise: str
    verdict: str
    temper: float
    n_steps: int
    thinning: int

    @property
    def varied(self) -> tuple[DrawSummary, ...]:
        """Summaries of the parameters that were not held fixed."""
        return tuple(each for each in self.summaries if each.remark != "fixed")

    @property
    def n_kept(self) -> int:
        """Number of draws."""
        return next(iter(self.chains.values())).size

    def theta(self, names: tuple[str, ...]) -> Array:
        """All draws of the parameters called so, shape (n_draws, n_params)."""
        return np.stack([self.chains[name].reshape(-1) for name in names], axis=1)


def write_draws(place: Path, draws: Draws) -> None:
    """Write `posterior.nc` into the run folder at `place`.

    Raises
    ------
    OutputError
        Where it cannot be written.
    """
    with replacing(place / DRAWS) as temporary:
        draws.as_datatree().to_netcdf(temporary, engine="h5netcdf")


def read_draws(place: Path, fit: Fit) -> StoredDraws | None:
    """The draws of the run folder at `place`, `None` where there are none.

    Raises
    ------
    RecordError
        Where they are damaged, or of another model.
    """
    path = place / DRAWS
    if not path.is_file():
        return None
    # A second to load.
    import xarray

    try:
        with xarray.open_datatree(path, engine="h5netcdf") as tree:
            posterior = tree["posterior"].to_dataset()
            names = [str(name) for name in posterior.data_vars]
            chains = {name: np.asarray(posterior[name].values, dtype=np.float64) for name in names}
            units = {name: str(posterior[name].attrs["units"]) for name in names}
            attributes = dict(tree.attrs)
    except (OSError, KeyError, ValueError) as reason:
        raise RecordError(f"{path} cannot be read ({reason}); run `mrwork sample {place}` again") from None
    missing = [estimate.name for estimate in fit.estimates if estimate.name not in chains]
    if missing:
        raise RecordError(
            f"{path} lacks {', '.join(missing)}, so it is of another fit; run `mrwork sample {place}` again"
        )
    bounds = {each.name: (each.lower, each.upper) for each in fit.estimates} | {
        NOISE + each.name: (each.lower, each.upper)
        for each in noise_model(str(attributes["noise"])).parameters
    }
    return StoredDraws(
        chains=chains,
        summaries=tuple(
            summary_of(chain, name=name, unit=units[name], bounds=bounds[name], tau=np.nan)
            for name, chain in chains.items()
        ),
        noise=str(attributes["noise"]),
        verdict=str(attributes["verdict"]),
        temper=float(attributes["temper"]),
        n_steps=int(attributes["steps"]),
        thinning=int(attributes["thinning"]),
    )
