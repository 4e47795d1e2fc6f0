"""A device takes what the table of a damper in a study takes."""

from dataclasses import replace

import numpy as np
import pytest

import mrwork as mr
from mrwork.dampers.spec import with_other_dependences
from mrwork.errors import SettingError

FRAME = mr.buildings.shear_building(masses=[120.0, 120.0], stiffnesses=[250e3, 250e3])
ROW = FRAME.storeys[0]


def test_a_passive_damper_needs_no_largest_command() -> None:
    spec = mr.damper("bingham")
    device = mr.Device(name="dashpot", spec=spec, theta=spec.nominal, row=ROW)
    law = mr.ControlLaw(name="passive", gains={"command": [0.0]})
    run = mr.simulate_loop(FRAME, [device], law, [mr.synthetic_motion(duration=1.0)], threads=1)
    assert np.isfinite(run.peak_drift).all()
    with pytest.raises(SettingError, match="takes no command; leave `lag` out"):
        mr.Device(name="dashpot", spec=spec, theta=spec.nominal, row=ROW, lag=190.0)
    preset = mr.damper("bouc_wen").with_current_laws({"alpha": "linear"})
    with pytest.raises(SettingError, match="positive number"):
        mr.Device(name="mr", spec=preset, theta=preset.nominal, row=ROW)


def test_a_lag_is_that_of_the_table_of_a_study() -> None:
    table = {"storey": 1, "preset": "kwok2006", "lag": 190.0}
    motion = mr.synthetic_motion(duration=1.0)
    (wanted,) = mr.study_of(building=FRAME, dampers=[table], motions=[motion]).devices
    spec = with_other_dependences(wanted.spec, lag="none")
    plain = np.asarray(wanted.theta)[..., :-1]
    facts = {"name": "a", "row": ROW, "largest_command": 1.0}
    made = mr.Device(spec=spec, theta=plain, lag=190.0, **facts)
    assert made.spec == wanted.spec
    assert np.array_equal(made.draws, wanted.draws)
    # A rate of a rising and one of a falling current; a linear loop takes the slower.
    both = mr.Device(spec=spec, theta=plain, lag=(190.0, 60.0), **facts)
    assert both.spec.names[-2:] == ("eta_rise", "eta_fall")
    assert both.draws[0, -2:].tolist() == [190.0, 60.0]
    problem = mr.control.DesignProblem(
        building=FRAME, devices=[replace(both, row=FRAME.storeys[0])], sample_time=1e-3
    )
    assert problem.driver_rates == (60.0,)
    # Instead of one that the parameters have.
    other = mr.Device(spec=wanted.spec, theta=wanted.theta, lag=50.0, **facts)
    assert other.draws[0, -1] == 50.0
    assert np.array_equal(other.draws[:, :-1], wanted.draws[:, :-1])


def test_the_coil_current_of_a_simulated_test_begins_at_the_first_command() -> None:
    """With a constant command the lag changes nothing: the current is there from the start."""
    plain = mr.damper("bingham").with_current_laws({"f_c": "linear"})
    lagged = mr.damper("bingham").with_current_laws({"f_c": "linear"}, lag="one_rate")
    time = np.linspace(0.0, 1.0, 1001)
    motion = mr.Loading(
        dt=1e-3,
        displacement=0.01 * np.sin(6.0 * time),
        velocity=0.06 * np.cos(6.0 * time),
        command=1.0,
        command_unit="A",
    )
    theta = np.array([100.0, 500.0, *plain.nominal[2:]])
    assert np.allclose(mr.simulate(lagged, [*theta, 10.0], motion), mr.simulate(plain, theta, motion))
