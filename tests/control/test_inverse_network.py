"""A trained network finds the command for a force that the damper can give, else the end; motions that train it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from refusals import refusal

from mrwork.control import train_inverse_network
from mrwork.control.laws.inverse_network import InverseNetwork, random_loading
from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_force

RD1005 = damper("static_hysteretic").preset("kwok2006")
PROTOTYPE = damper("modified_bouc_wen").preset("dyke1996")


SETTINGS = {"largest_command": 1.88, "amplitude": 0.01, "velocity": 0.2, "sample_time": 1e-3}


def train(n_hidden: int, n_previous: int, rng: int) -> InverseNetwork:
    more = {"n_hidden": n_hidden, "n_previous": n_previous, "rng": rng}
    return train_inverse_network(RD1005.spec, RD1005.theta, **SETTINGS, **more)


@pytest.fixture(scope="module", params=[0, 1])
def network(request) -> InverseNetwork:
    return train(8, request.param, rng=1)


def inputs(network: InverseNetwork, loading: Loading, wanted: np.ndarray) -> np.ndarray:
    now = np.column_stack([loading.displacement, loading.velocity, wanted])
    before = np.vstack([now[:1], now[:-1]])
    return np.hstack([now, before])[:, : len(network.names)]


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
    given = forces(loading, network.command(inputs(network, loading, wanted)))
    assert fit(wanted, given) == pytest.approx(network.fit_percent, abs=4.0)
    best_constant = max(fit(wanted, forces(loading, command)) for command in np.linspace(0.0, 1.88, 20))
    assert 100.0 - fit(wanted, given) < (100.0 - best_constant) / 4.0


def test_what_the_damper_cannot_give_is_answered_by_an_end(network: InverseNetwork) -> None:
    loading = motion(78, n_cycles=20)
    none, whole = forces(loading, 0.0), forces(loading, 1.88)
    far = np.abs(whole - none) > 0.3 * np.abs(whole - none).max()
    for times in (0.5, 3.0, 10.0):
        beyond = times * (whole - none)
        more = network.command(inputs(network, loading, whole + beyond))[far]
        less = network.command(inputs(network, loading, none - beyond))[far]
        # On average within 15 % of the range of the end: the few units of a test leave some corners round.
        assert more.mean() > 0.85 * 1.88
        assert less.mean() < 0.15 * 1.88


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


def test_a_damper_with_a_lag_and_a_memory_is_inverted_at_its_coil() -> None:
    """The prototype of Dyke et al.: a sixth of the force at most is missed, though the damper remembers."""
    steps: list[tuple[int, float]] = []
    network = train_inverse_network(
        PROTOTYPE.spec,
        PROTOTYPE.theta,
        largest_command=2.25,
        amplitude=0.005,
        velocity=0.2,
        sample_time=1e-3,
        n_hidden=8,
        on_step=lambda step, error: steps.append((step, error)),
    )
    assert network.fit_percent > 85.0
    assert network.names[3] == "previous deformation"
    assert [step for step, _ in steps] == list(range(1, len(steps) + 1))
    assert steps[-1][1] < 0.2 * steps[0][1]


def test_a_seed_gives_the_same_network() -> None:
    first, again, other = (train(2, 0, rng=rng).W1 for rng in (5, 5, 6))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_damper_that_follows_no_command_is_refused() -> None:
    idle = damper("bingham").with_current_laws({"c0": "linear"})
    for spec, word in ((damper("bouc_wen"), "follow a command"), (idle, "does not change the force")):
        refusal(train_inverse_network, spec, spec.nominal, **SETTINGS, match=word)


def test_peaks_are_those_asked_for() -> None:
    """The velocity to 1 %, for the stretch of time that meets it is found on another grid."""
    for rng in range(5):
        for velocity in (0.02, 0.2):
            made = motion(rng, velocity)
            np.testing.assert_allclose(np.abs(made.displacement).max(), 0.01, rtol=1e-12)
            np.testing.assert_allclose(np.abs(made.velocity).max(), velocity, rtol=0.01)


def test_velocity_is_the_derivative_of_the_displacement() -> None:
    made = motion(1, velocity=0.02)
    quotient = (made.displacement[2:] - made.displacement[:-2]) / (2.0 * made.dt)
    # Central differences at 1 kHz of tones up to some 3 Hz: (2 pi 3/1000)^2/6 of the size is left.
    np.testing.assert_allclose(quotient, made.velocity[1:-1], atol=1e-3 * 0.02)


def test_commands_rest_at_both_ends_and_wander_between() -> None:
    command = np.asarray(motion(2).command)
    for share in (
        np.mean(command == 0.0),
        np.mean(command == 1.88),
        np.mean((command > 0.2) & (command < 1.7)),
    ):
        assert 0.05 < share < 0.8


def test_a_seed_gives_the_same_bits() -> None:
    np.testing.assert_array_equal(motion(3).displacement, motion(3).displacement)
    assert not np.array_equal(motion(3).displacement, motion(4).displacement)
