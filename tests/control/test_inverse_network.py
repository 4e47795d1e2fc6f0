"""A trained network finds the command for a force that the damper can give, and says what its formula says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mrwork.control import train_inverse_network
from mrwork.control.laws.inverse_network import InverseNetwork, random_loading
from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_force

RD1005 = damper("static_hysteretic").preset("kwok2006")


SETTINGS = {"largest_command": 1.88, "amplitude": 0.01, "velocity": 0.2, "sample_time": 1e-3}


@pytest.fixture(scope="module")
def network() -> InverseNetwork:
    return train_inverse_network(RD1005.spec, RD1005.theta, **SETTINGS, n_hidden=8, n_previous=0, rng=1)


def inputs(loading: Loading, wanted: np.ndarray) -> np.ndarray:
    return np.column_stack([loading.displacement, loading.velocity, wanted])


def motion(rng: int, velocity: float = 0.2, n_cycles: int = 30) -> Loading:
    return random_loading(
        amplitude=0.01,
        velocity=velocity,
        largest_command=1.88,
        command_unit="A",
        dt=1e-3,
        n_cycles=n_cycles,
        rng=np.random.default_rng(rng),
    )


def fit(wanted: np.ndarray, given: np.ndarray) -> float:
    return float(100.0 * (1.0 - np.linalg.norm(given - wanted) / np.linalg.norm(wanted - wanted.mean())))


def forces(loading: Loading, command: np.ndarray | float) -> np.ndarray:
    return simulate_force(RD1005.spec, RD1005.theta, replace(loading, command=command))


def test_the_damper_gives_what_is_wanted_at_its_command(network: InverseNetwork) -> None:
    """On another motion than those of training and judgement, and four times nearer than any constant command."""
    loading = motion(77, n_cycles=20)
    wanted = forces(loading, loading.command)
    given = forces(loading, network.command(inputs(loading, wanted)))
    assert fit(wanted, given) == pytest.approx(network.fit_percent, abs=4.0)
    best_constant = max(fit(wanted, forces(loading, command)) for command in np.linspace(0.0, 1.88, 20))
    assert 100.0 - fit(wanted, given) < (100.0 - best_constant) / 4.0


def test_beyond_what_it_knows_it_answers_as_at_the_edge(network: InverseNetwork) -> None:
    edge = network.input_scale * np.where(np.arange(len(network.names)) % 2, 1.0, -1.0)
    np.testing.assert_array_equal(network.command(7.0 * edge), network.command(edge))


def test_weights_say_what_the_formula_says(network: InverseNetwork) -> None:
    row = 0.3 * network.input_scale
    total = network.b2
    for hidden in range(len(network.w2)):
        inner = network.b1[hidden]
        for index in range(len(row)):
            inner += network.W1[hidden, index] * 0.3
        total += network.w2[hidden] * np.tanh(inner)
    expected = 1.88 * min(max(total, 0.0), 1.0)
    np.testing.assert_allclose(network.command(row), expected, atol=1e-9)
