"""Baseline correction: the slow drift that an accelerograph adds, taken out as a polynomial."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Legendre

from mrwork.errors import SettingError
from mrwork.motions.ground_motion import GroundMotion, changed

_HIGHEST_ORDER = 10


def baseline_corrected(motion: GroundMotion, *, order: int) -> GroundMotion:
    """Motion less the polynomial of that order that fits its acceleration best.

    Parameters
    ----------
    order
        Order of the polynomial fitted to the acceleration by least squares: 0 takes out the mean, 1 a straight
        line. The drift of velocity is then of one order more.

    Raises
    ------
    SettingError
        The order is negative, above 10, or too high for so short a record.
    """
    highest = min(_HIGHEST_ORDER, motion.n_time - 2)
    if not 0 <= order <= highest:
        raise SettingError(f"ground motion {motion.name}: baseline of order {order}; give 0 to {highest}")
    # Legendre polynomials on [-1, 1] keep the fit well conditioned where powers of seconds do not.
    place = np.linspace(-1.0, 1.0, motion.n_time)
    drift = np.asarray(Legendre.fit(place, motion.acceleration, order)(place), dtype=np.float64)
    change = f"baseline of order {order} taken from the acceleration, up to {np.abs(drift).max():.3g} m/s2"
    return changed(motion, motion.acceleration - drift, motion.dt, change)
