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
    """What has entered since the start, and where it went [J]: the structure's damping; each device, (n_devices,)."""

    entered: Array
    damping: Array
    devices: Array


class Reductions(NamedTuple):
    """Of floors, lowest first: displacement and absolute acceleration; of storeys, drift; of devices, the rest."""

    displacement: Extent
    acceleration: Extent
    drift: Extent
    base_shear: Extent
    force: Extent
    stroke: Extent
    rate: Extent
    current: Extent
    current_sum: Array


class LoopResult(NamedTuple):
    """A run, reduced; its energies [J] at the end; how many steps it took."""

    reductions: Reductions
    energies: Energies
    kinetic: Array
    strain: Array
    n_steps: Array

    @property
    def energy_error(self) -> Array:
        """What the balance of energies leaves at the end, against what entered or what is found again."""
        entered, damping, devices = self.energies
        held = self.kinetic + self.strain
        turnover = jnp.maximum(jnp.abs(entered), held + jnp.abs(damping) + jnp.abs(devices).sum())
        return jnp.abs(entered - held - damping - devices.sum()) / turnover

    def summary(self) -> dict[str, Array]:
        """Quantities by the names of the Rust loop, one number for each floor, storey or device, in SI units."""
        kept = self.reductions

        def both(name: str, extent: Extent) -> dict[str, Array]:
            return {f"peak_{name}": extent.peak, f"rms_{name}": jnp.sqrt(extent.squares / self.n_steps)}

        return (
            both("displacement", kept.displacement)
            | both("acceleration", kept.acceleration)
            | both("drift", kept.drift)
            | both("base_shear", kept.base_shear)
            | both("force", kept.force)
            | {"peak_stroke": kept.stroke.peak, "peak_rate": kept.rate.peak}
            | both("current", kept.current)
            | {
                "mean_current": kept.current_sum / self.n_steps,
                "device_energy": self.energies.devices,
                "input_energy": self.energies.entered[None],
                "kinetic_energy": self.kinetic[None],
                "strain_energy": self.strain[None],
                "damping_energy": self.energies.damping[None],
                "energy_error": self.energy_error[None],
            }
        )

    def worst(self, name: str) -> Array:
        """The largest of a quantity of `summary`: of the worst floor, storey or device."""
        return self.summary()[name].max()
