"""A static model that stands for another damper, for laws that want force as a function of current."""

import numpy as np
import pytest

from mrwork.control.laws.counterpart import StaticCounterpart, static_counterpart
from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_force

RD1005 = damper("static_hysteretic").preset("kwok2006")
PROTOTYPE = damper("modified_bouc_wen").preset("dyke1996")
AMPLITUDE, VELOCITY = (5e-4, 5e-3), (0.01, 0.2)


@pytest.fixture(scope="module")
def prototype() -> StaticCounterpart:
    return static_counterpart(
        PROTOTYPE.spec, PROTOTYPE.theta, largest_command=2.25, amplitude=AMPLITUDE, velocity=VELOCITY
    )


def sinusoid(size: float, speed: float, command: float, unit: str) -> Loading:
    angle = 2.0 * np.pi * np.arange(1001) / 500
    return Loading(
        dt=2.0 * np.pi * size / speed / 500,
        displacement=size * np.sin(angle),
        velocity=speed * np.cos(angle),
        command=command,
        command_unit=unit,
    )


def test_a_static_damper_is_its_own_counterpart() -> None:
    own = static_counterpart(
        RD1005.spec, RD1005.theta, largest_command=1.88, amplitude=AMPLITUDE, velocity=VELOCITY
    )
    assert (own.spec, own.theta, own.fit_percent) == (RD1005.spec, RD1005.theta, 100.0)


def test_the_prototype_of_dyke_is_stood_for(prototype: StaticCounterpart) -> None:
    """The least misfit of 30 random starts is 85.17 %, so this is the best that the static model can do."""
    assert prototype.fit_percent == pytest.approx(85.17, abs=0.01)
    assert prototype.spec.name == "static_hysteretic"
    assert prototype.spec.command_unit == "V"


def test_fit_is_that_of_the_motions_it_stands_for(prototype: StaticCounterpart) -> None:
    """Simulated anew, at motions between those of the fit: within a few points of it."""
    squares = np.zeros(2)
    for size, speed in ((8e-4, 0.02), (3e-3, 0.03), (3e-3, 0.12)):
        for command in (0.3, 1.3, 2.2):
            loading = sinusoid(size, speed, command, "V")
            wanted = simulate_force(PROTOTYPE.spec, PROTOTYPE.theta, loading)[-500:]
            given = simulate_force(prototype.spec, prototype.theta, loading)[-500:]
            squares += np.sum((given - wanted) ** 2), np.sum((wanted - wanted.mean()) ** 2)
    fit = 100.0 * (1.0 - np.sqrt(squares[0] / squares[1]))
    assert fit == pytest.approx(prototype.fit_percent, abs=5.0)


def test_force_grows_with_the_command(prototype: StaticCounterpart) -> None:
    """What the direct-current laws rely on: dF/di > 0 where the damper moves on."""
    forces = [
        simulate_force(prototype.spec, prototype.theta, sinusoid(3e-3, 0.1, command, "V"))[500]
        for command in np.linspace(0.0, 2.25, 7)
    ]
    assert np.all(np.diff(forces) > 0.0)
