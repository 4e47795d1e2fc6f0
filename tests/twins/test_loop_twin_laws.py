"""Laws of the twin: the commands that they send."""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from twin_laws import ClippedOptimal, LyapunovBangBang, ModifiedClippedOptimal, switch

from mrwork.twins.loop_laws import LyapunovDirect
from mrwork.twins.loop_stepping import Measurement


def measured(state: Any, force: float) -> Measurement:
    return Measurement(
        state=jnp.asarray(state, dtype=jnp.float64),
        deformation=jnp.zeros(1),
        rate=jnp.zeros(1),
        force=jnp.array([force]),
        force_at=lambda i: 3.0 + 2.0 * i - 0.25 * i**2,
        largest=jnp.array([2.0]),
    )


def test_the_slope_is_that_of_the_parabola() -> None:
    np.testing.assert_allclose(measured([0.0, 1.0], 0.0).slope(), [2.0], rtol=1e-14)


@pytest.mark.parametrize(
    ("wanted", "force", "on"), [(5.0, 3.0, 1), (2.0, 3.0, 0), (-5.0, -3.0, 1), (5.0, -3.0, 0)]
)
def test_clipped_optimal_is_on_where_more_is_wanted_of_what_it_gives(
    wanted: float, force: float, on: int
) -> None:
    gain = jnp.array([[0.0, -wanted]])
    at = measured([0.0, 1.0], force)
    assert float(ClippedOptimal(gain).command(at)[0]) == 2.0 * on
    share = min(abs(wanted) / 4.0, 1.0)
    assert float(ModifiedClippedOptimal(gain, jnp.array([4.0])).command(at)[0]) == 2.0 * share * on


@pytest.mark.parametrize("velocity", [-0.3, 0.3])
def test_lyapunov_laws_command_where_the_damper_takes_from_the_measure(velocity: float) -> None:
    # B has the sign of a resisting force, so sigma = s'P B opposes the velocity, and a force along it dissipates.
    weight = jnp.array([[0.0], [-1.0]])
    for force in (-3.0, 3.0):
        command = LyapunovBangBang(weight).command(measured([0.0, velocity], force))
        assert float(command[0]) == (2.0 if velocity * force > 0.0 else 0.0)
    direct = LyapunovDirect(jnp.array(0.5), weight).command(measured([0.0, velocity], 0.0))
    np.testing.assert_allclose(direct, [0.5 * velocity * 2.0], rtol=1e-14)


def test_a_narrow_switch_is_the_one_of_the_paper() -> None:
    x = jnp.array([-1.0, -0.1, 0.1, 1.0])
    np.testing.assert_allclose(switch(x, 1e-3), switch(x, 0.0), atol=1e-12)
    assert float(switch(jnp.array(0.0), 0.0)) == 0.0
