"""Realisations of what is not known exactly: damper parameters, stiffness and damping of the building, delay, noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from mrwork.base.summary import Summarised, named
from mrwork.base.values import Floats, array_dataclass
from mrwork.buildings.device import Device
from mrwork.errors import InvalidSettingError
from mrwork.search.unit_cube import Streams, latin_hypercube
from mrwork.store.codec import digest_of
from mrwork.study.dampers import Identified, chosen_damper, fitted_of
from mrwork.study.schema import StudyTable


@array_dataclass(repr=False)
class Realisations(Summarised):
    """Realisations of the uncertain quantities of a study, each array of shape (n,).

    Factors of stiffness and damping of the building, additional delay [s], seed that is added to the seed of the
    sensor noise. `theta` are the parameters of each device, shape (n, n_params), or (1, n_params) where they are known.
    """

    stiffness: Floats
    damping: Floats
    delay: Floats
    seed: NDArray[np.int64]
    theta: tuple[Floats, ...]

    def __len__(self) -> int:
        """Number of realisations."""
        return len(self.stiffness)

    def alone(self, place: int) -> Realisations:
        """The realisation of an index as realisations of length 1; parameters that are known stay."""
        here, factors = slice(place, place + 1), named(self, "stiffness", "damping", "delay", "seed")
        return Realisations(
            **{name: array[here] for name, array in factors.items()},
            theta=tuple(draws[here] if len(draws) > 1 else draws for draws in self.theta),
        )

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
    table: StudyTable, devices: Sequence[Device], folder: Path, identified: Identified
) -> Realisations | None:
    """The realisations of what a study does not know exactly: a Latin hypercube, and posterior draws."""
    spread = table.uncertainty
    if spread is None:
        return None
    n, theta, parts = spread.realisations, list[Floats](), [spread.stiffness, spread.damping, spread.delay]
    unit = latin_hypercube(Streams(rng=spread.seed), n, 4)
    order = np.argsort(np.argsort(unit[:, 3], kind="stable"))
    for number, (damper, device) in enumerate(zip(table.damper, devices, strict=True)):
        if not spread.damper or damper.run is None:
            theta.append(device.draws[:1])
            continue
        fit = fitted_of(damper, folder, identified)
        draws = fit.draws()
        if draws is None:
            run, remedy = (
                "a fit",
                "give the folder of its run with the draws that mrwork intervals --posterior adds",
            )
            if isinstance(damper.run, str):
                run, remedy = damper.run, f"run mrwork intervals {damper.run} --posterior first"
            raise InvalidSettingError(
                ("damper", number, "run"),
                f"{run} has no posterior draws, and [uncertainty] asks for them; {remedy}, or set damper = false there",
            )
        # Equally spread over the chains, in a random order, which is the same for all devices of one run.
        chosen = draws[np.linspace(0, len(draws) - 1, n).round().astype(np.int64)[order]]
        drawn = (replace(damper, run=replace(fit, theta=tuple(draw.tolist()))) for draw in chosen)
        theta.append(np.concatenate([chosen_damper(table, folder, identified)[0].draws for table in drawn]))
        parts.append(1.0)
    if not any(parts):
        raise InvalidSettingError(
            "uncertainty",
            "nothing in [uncertainty] is uncertain; give it a stiffness, a damping or a delay, or a [[damper]] with a "
            "run that has posterior draws",
        )
    return Realisations(
        stiffness=1.0 + spread.stiffness * (2.0 * unit[:, 0] - 1.0),
        damping=1.0 + spread.damping * (2.0 * unit[:, 1] - 1.0),
        delay=spread.delay * unit[:, 2],
        seed=np.arange(n, dtype=np.int64),
        theta=tuple(theta),
    )
