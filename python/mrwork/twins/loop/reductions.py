"""What is kept of a run while it goes on, and the criteria that follow."""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array


class Extent(NamedTuple):
    """Peak of a signal's magnitude, and the sum of its squares, over the starts of all steps."""

    peak: Array
    squares: Array

    @classmethod
    def none(cls, n: int) -> Extent:
        """Of `n` signals that nothing has been seen of."""
        return cls(jnp.zeros(n), jnp.zeros(n))

    def seen(self, signal: Array) -> Extent:
        """One sample more."""
        return Extent(jnp.maximum(self.peak, jnp.abs(signal)), self.squares + signal * signal)


class Energies(NamedTuple):
    """What has entered since the start, and where it went [J]: into the structure's damping, the devices."""

    entered: Array
    damping: Array
    devices: Array


class Reductions(NamedTuple):
    """Of floors, lowest first: displacement and absolute acceleration; of storeys, drift; of devices, force, stroke.

    `command` is the sum over the steps of what each channel's driver is told, shape (n_channels,).
    """

    displacement: Extent
    drift: Extent
    acceleration: Extent
    force: Extent
    stroke: Extent
    command: Array
    energies: Energies


class LoopResult(NamedTuple):
    """A run, reduced: see `Reductions`; kinetic and strain energy [J] at its end; how many steps it took."""

    reductions: Reductions
    kinetic: Array
    strain: Array
    n_steps: Array

    @property
    def energy_error(self) -> Array:
        """What the balance of energies leaves, against the largest of them."""
        entered, damping, devices = self.reductions.energies
        terms = jnp.stack([entered, self.kinetic, self.strain, damping, devices])
        return jnp.abs(entered - terms[1:].sum()) / jnp.abs(terms).max()

    def criteria(self) -> dict[str, Array]:
        """Criteria by name: of peak and root mean square over the run, the worst floor, storey or device.

        Displacement and drift in metres, acceleration in m/s^2, force in newtons; `mean_command` of all channels.
        """
        r = self.reductions
        signals = {
            "displacement": r.displacement,
            "drift": r.drift,
            "acceleration": r.acceleration,
            "force": r.force,
            "stroke": r.stroke,
        }
        found = {f"peak_{name}": extent.peak.max() for name, extent in signals.items()}
        found |= {
            f"rms_{name}": jnp.sqrt(extent.squares.max() / self.n_steps) for name, extent in signals.items()
        }
        return found | {"mean_command": r.command.mean() / self.n_steps}
