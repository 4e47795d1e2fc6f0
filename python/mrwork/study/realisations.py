"""Realisations of what is not known exactly: damper parameters, stiffness and damping of the building, delay, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from mrwork.buildings.devices import Device
from mrwork.search.unit_cube import Streams, latin_hypercube
from mrwork.store import digest_of
from mrwork.summary import Summarised
from mrwork.values import holds_arrays

if TYPE_CHECKING:
    # The tables of a study file stand above the study that they are read into.
    from mrwork.study.schema import DamperTable
    from mrwork.study.tuning_schema import UncertaintyTable

Floats = NDArray[np.float64]


@holds_arrays
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Realisations(Summarised):
    """Realisations of the uncertain quantities of a study, each array of shape (n,).

    Factors of stiffness and damping of the building, additional delay [s], seed that is added to that of the sensor
    noise. `theta` are the parameters of each device, shape (n, n_params), or (1, n_params) where they are known.
    """

    stiffness: Floats
    damping: Floats
    delay: Floats
    seed: NDArray[np.int64]
    theta: tuple[Floats, ...]

    def __len__(self) -> int:
        """Number of realisations."""
        return len(self.stiffness)

    @property
    def digest(self) -> str:
        """Digest of all numbers."""
        return digest_of(self.stiffness, self.damping, self.delay, self.seed, *self.theta)


def nominal(devices: Sequence[Device]) -> Realisations:
    """The one realisation of a study as it is given."""
    one = np.ones(1)
    return Realisations(
        stiffness=one,
        damping=one,
        delay=np.zeros(1),
        seed=np.zeros(1, dtype=np.int64),
        theta=tuple(device.draws[:1] for device in devices),
    )


def realisations_of(
    table: UncertaintyTable, devices: Sequence[Device], posterior: Sequence[Floats | None]
) -> Realisations:
    """Draw the realisations of a table: a Latin hypercube of factors and delay, and draws of the dampers in turn.

    Parameters
    ----------
    posterior
        Draws of the parameters of each device, shape (n_draws, n_params), `None` where there are none.

    """
    n = table.realisations
    streams = Streams(rng=table.seed, replicate=np.zeros(1, np.int64), generation=np.zeros(1, np.int64))
    unit = latin_hypercube(streams, n, 4)[0]
    theta = []
    for device, rows in zip(devices, posterior, strict=True):
        if rows is None:
            theta.append(device.draws[:1])
            continue
        # The same row for all devices of one run, equally spread over the draws in a random order.
        order = np.argsort(unit[:, 3], kind="stable")
        theta.append(rows[np.linspace(0, len(rows) - 1, n).round().astype(np.int64)[np.argsort(order)]])
    return Realisations(
        stiffness=1.0 + table.stiffness * (2.0 * unit[:, 0] - 1.0),
        damping=1.0 + table.damping * (2.0 * unit[:, 1] - 1.0),
        delay=table.delay * unit[:, 2],
        seed=np.arange(n, dtype=np.int64),
        theta=tuple(theta),
    )


def posterior_draws(table: DamperTable, folder: Path) -> Floats | None:
    """Posterior draws of the fit of an identified damper, shape (n_draws, n_params); `None` for another damper.

    Raises
    ------
    SettingError
        If the run has no draws; the message has the line.
    """
    if table.run is None:
        return None
    # Loads xarray.
    from mrwork.identification.fit_file import read_fit
    from mrwork.uncertainty.posterior.draws import read_draws

    run = folder / table.run
    draws = read_draws(run, read_fit(run))
    if draws is None:
        table.place.within("run").refuse(
            f"{table.run} has no posterior draws, and [uncertainty] asks for them; run mrwork sample {table.run} "
            "first, or set damper = false there"
        )
    return np.asarray(draws.chains.reshape(-1, draws.chains.shape[-1]))
