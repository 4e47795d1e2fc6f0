"""A fit says what it costs in a building, and which model without states is as good."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import mrwork as mr
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.identification.fit_file import fit_content, fit_from_json
from mrwork.identification.result import BuildingCost
from mrwork.records import DamperTest, build_damper_test

STIFF = (800.0, 500.0, 0.0, 900.0, 7e4, 0.5, 1.1)
"""Of normalised_bouc_wen: a loop that yields within hundredths of a millimetre."""
SOFT = (800.0, 500.0, 0.0, 900.0, 700.0, 0.5, 1.1)
NAMES = ("c", "k", "x0", "k_w", "rho", "sigma", "n")


def a_test(model: str, theta: tuple[float, ...], *, dt: float = 1e-3) -> DamperTest:
    time = dt * np.arange(round(1.0 / dt) + 1)
    angle = 4.0 * np.pi * time
    x, v = 0.02 * np.sin(angle), 0.08 * np.pi * np.cos(angle)
    loading = Loading(dt=dt, displacement=x, velocity=v)
    force = simulate_force(mr.damper(model), theta, loading)
    noise = 0.01 * np.std(force) * np.random.default_rng(0).standard_normal(time.size)
    return build_damper_test(
        name=model, time=time, displacement=x, velocity=v, force=force + noise, synthetic=True
    )


@pytest.mark.parametrize("theta", [STIFF, SOFT])
def test_the_loop_takes_the_steps_that_the_cost_says(theta: tuple[float, ...]) -> None:
    building = mr.building("uts")
    spec = mr.damper("normalised_bouc_wen")
    device = mr.Device(name="one", spec=spec, theta=theta, row=building.storeys[0], largest_command=1.0)
    ground = 3.0 * np.sin(15.0 * np.arange(0.0, 2.0, 0.01))
    motion = mr.GroundMotion(name="sine", dt=0.01, acceleration=ground)
    law = mr.ControlLaw(name="passive", gains={"command": [[0.0]]})
    responses = mr.simulate_loop(building, [device], law, [motion], histories=True)
    assert responses.histories is not None
    (history,) = responses.histories
    # The motion of the damper in the building, as a test of it.
    test = replace(
        a_test("normalised_bouc_wen", SOFT),
        dt=mr.Hardware().sample_time,
        displacement=history.deformation[:, 0],
        velocity=history.rate[:, 0],
        force=history.force[:, 0],
    )
    cost = BuildingCost.of(spec, theta, [test])
    # The building itself may want more steps than the damper.
    fewest = round(mr.Hardware().sample_time / mr.Hardware().step)
    assert cost.steps in (responses.steps[0], 2 * responses.steps[0], fewest)
    assert cost.is_high == (theta is STIFF)


def test_the_cost_does_not_depend_on_the_step_of_the_record() -> None:
    spec = mr.damper("normalised_bouc_wen")
    costs = {
        BuildingCost.of(spec, STIFF, [a_test("normalised_bouc_wen", SOFT, dt=dt)]).steps
        for dt in (2e-3, 1e-3, 5e-4)
    }
    assert len(costs) == 1


def test_a_model_without_states_costs_the_fewest_steps() -> None:
    bingham = mr.damper("bingham")
    assert BuildingCost.of(bingham, bingham.nominal, [a_test("bingham", bingham.nominal)]).steps == 2


def test_a_costly_fit_is_not_only_converged_and_names_the_model_that_is_as_good() -> None:
    test = a_test("hyperbolic_tangent_gavin", (900.0, 0.005, 0.01, 500.0, 800.0, 0.0))
    held = {"rho": (STIFF[4], STIFF[4]), "sigma": (0.5, 0.5), "n": (1.0, 1.2)}
    fit = mr.identify("normalised_bouc_wen", test, bounds=held, threads=1)
    assert fit.status == "converged"
    assert fit.status_in_words.startswith("converged (")
    assert fit.status_in_words.endswith(" integration steps a sample of 1 ms in a building)")
    (warning,) = [each for each in fit.warnings if "integration steps" in each]
    assert "where a model without states takes 2; " in warning
    # Two forms of one equation; the one with fewer parameters is named.
    assert "hyperbolic_tangent_guo, which has no states, fits " in warning
    assert warning.endswith("use it in studies of the tested range")
    again = fit_from_json(fit_content(fit).decode(), origin="here")
    assert again.status_in_words == fit.status_in_words


def test_a_fit_that_costs_little_says_nothing() -> None:
    test = a_test("normalised_bouc_wen", SOFT)
    held = {name: (value, value) for name, value in zip(NAMES, SOFT, strict=True) if name != "k_w"}
    fit = mr.identify("normalised_bouc_wen", test, bounds=held, threads=1)
    assert fit.status_in_words == "converged"
    assert not any("integration steps" in each for each in fit.warnings)
