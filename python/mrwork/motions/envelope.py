"""How the strength of a synthetic earthquake rises, stays and dies away."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError


@dataclass(frozen=True, slots=True, kw_only=True)
class Envelope:
    """Rises as `(t / rise)^2`, is 1 until `plateau_end`, then falls as `exp(-decay (t - plateau_end))`.

    The defaults are type B of Jennings, Housner and Tsai (Simulated Earthquake Motions, California Institute of
    Technology, 1968), for magnitudes about 7; their parabola behind 30 s is left out, the exponential goes on.

    Parameters
    ----------
    rise, plateau_end
        Times [s].
    decay
        Rate [1/s].
    """

    rise: float = 4.0
    plateau_end: float = 15.0
    decay: float = 0.0992

    def __post_init__(self) -> None:
        if not 0.0 <= self.rise <= self.plateau_end < np.inf:
            raise SettingError(
                f"envelope rises until {self.rise} s and stays until {self.plateau_end} s; give times in that order"
            )
        if not 0.0 <= self.decay < np.inf:
            raise SettingError(f"envelope decays at {self.decay} 1/s; give a rate of 0 or more")

    def at(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values from 0 to 1 at times [s], in their shape."""
        rising = np.minimum(time / self.rise, 1.0) ** 2 if self.rise > 0.0 else np.ones_like(time)
        return rising * np.exp(-self.decay * np.maximum(time - self.plateau_end, 0.0))
