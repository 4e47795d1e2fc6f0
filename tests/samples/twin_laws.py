"""Laws of the twin that only tests run: constant commands, bang-bang laws with a switch that can be softened.

`width` = 0 gives the switch of the paper, whose derivative is zero.
"""

from __future__ import annotations

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import Array

from mrwork.twins.loop_stepping import Measurement


def switch(x: Array, width: Array | float) -> Array:
    """H(x), or 1 / (1 + exp(-x / width)) where `width` is positive."""
    soft = jnp.asarray(width) > 0.0
    smooth = jax.nn.sigmoid(x / jnp.where(soft, width, 1.0))
    return jnp.where(soft, smooth, jnp.where(x > 0.0, 1.0, 0.0))


class Passive(NamedTuple):
    """A constant command, shape (n_devices,)."""

    constant: Array

    def command(self, measured: Measurement) -> Array:
        """The constant command."""
        return self.constant


class ClippedOptimal(NamedTuple):
    """`V_max H((f_c - f) f)`, f_c = -K s (Dyke et al. 1996), softened over `width` [N]: (f_c - f) f / width^2.

    `gain` is K, shape (n_devices, 2n).
    """

    gain: Array
    width: Array | float = 0.0

    def command(self, measured: Measurement) -> Array:
        """The largest command or zero, or a value between if softened."""
        wanted = -self.gain @ measured.state
        return measured.largest * switch((wanted - measured.force) * measured.force, jnp.square(self.width))


class ModifiedClippedOptimal(NamedTuple):
    """`V_c H((f_c - f) f)`, V_c = V_max |f_c| / f_max, at most V_max (Yoshida and Dyke 2004), softened in the same way.

    `largest_force` is f_max [N], shape (n_devices,).
    """

    gain: Array
    largest_force: Array
    width: Array | float = 0.0

    def command(self, measured: Measurement) -> Array:
        """In proportion to the desired force."""
        wanted = -self.gain @ measured.state
        share = jnp.minimum(jnp.abs(wanted) / self.largest_force, 1.0)
        on = switch((wanted - measured.force) * measured.force, jnp.square(self.width))
        return measured.largest * share * on


class LyapunovBangBang(NamedTuple):
    """`V_max H(-(s'P B) f)` (Jansen and Dyke 2000), softened over `width` [that of s'P B f].

    `weight` is P B, shape (2n, n_devices).
    """

    weight: Array
    width: Array | float = 0.0

    def command(self, measured: Measurement) -> Array:
        """On if the damper reduces s'P s."""
        return measured.largest * switch(-(measured.state @ self.weight) * measured.force, self.width)


class LqrDirect(NamedTuple):
    """`i = sat(-R^-1 G(s) B'P s)`, the thesis' second controller; `gain` is R^-1 B'P, shape (n_devices, 2n)."""

    gain: Array

    def command(self, measured: Measurement) -> Array:
        """The desired force times the slope of the force in the current."""
        return -measured.slope() * (self.gain @ measured.state)
