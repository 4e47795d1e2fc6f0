"""Noise models: how the measured force scatters about the model's.

Residuals and noise are in units of the standard deviation of a test's measured force, so that tests of different
strength share one set of noise parameters. On real tests most of the "noise" is model error, which repeats from cycle
to cycle: what such a model says of another excitation has to be measured, never taken from its formula.
"""

from __future__ import annotations

from typing import get_args

from mrwork.errors import UnknownNameError
from mrwork.uncertainty.noise.correlated import Ar1, Arma11
from mrwork.uncertainty.noise.independent import Amplitude, Iid, StudentT
from mrwork.uncertainty.noise.model import Noise, NoiseName, NoiseParameter

__all__ = ["NOISES", "Iid", "Noise", "NoiseName", "NoiseParameter", "noise_model"]

NOISES: dict[NoiseName, Noise] = {
    each.name: each for each in (Iid(), StudentT(), Ar1(), Arma11(), Amplitude())
}


def noise_model(name: str) -> Noise:
    """The noise model of that name.

    Raises
    ------
    UnknownNameError
        Where there is none.
    """
    for known in get_args(NoiseName):
        if known == name:
            return NOISES[known]
    raise UnknownNameError(f"there is no noise model {name!r}; known: {', '.join(NOISES)}")
