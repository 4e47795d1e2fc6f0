"""Models that are special cases of others give equal forces; smoothed models converge to the others."""

import numpy as np
import pytest

from mrwork.dampers import damper
from mrwork.dampers.simulation import Loading, simulate_force

DT = 1e-3
TIME = DT * np.arange(1001)
AMPLITUDE, OMEGA = 0.01, 2.0 * np.pi * 2.0
HARMONIC = Loading(
    dt=DT, displacement=AMPLITUDE * np.sin(OMEGA * TIME), velocity=AMPLITUDE * OMEGA * np.cos(OMEGA * TIME)
)
# A second, slower wave, so that reversals occur at different strokes.
VARIED = Loading(
    dt=DT,
    displacement=HARMONIC.displacement + 0.007 * np.sin(0.31 * OMEGA * TIME),
    velocity=HARMONIC.velocity + 0.007 * 0.31 * OMEGA * np.cos(0.31 * OMEGA * TIME),
)
# tanh(y) is +-1 to the last bit from here on.
SATURATED = 20.0


def force(name, loading=VARIED, **changes):
    """Force of a model with nominal parameters, some of them changed."""
    spec = damper(name)
    values = dict(zip(spec.names, spec.nominal, strict=True)) | changes
    assert len(values) == len(spec.names), "a changed parameter is not one of the model's"
    return simulate_force(spec, np.array(list(values.values())), loading)


def nominal(name):
    spec = damper(name)
    return dict(zip(spec.names, spec.nominal, strict=True))


def assert_same_force(left, right):
    # The same equation with another order of operations: differences by rounding only, over a thousand steps.
    np.testing.assert_allclose(left, right, rtol=0.0, atol=1e-11 * np.max(np.abs(right)))


def test_viscous_dahl_is_dahl_and_a_dashpot():
    k_x = 1700.0
    assert_same_force(force("viscous_dahl", k_x=k_x), force("dahl") + k_x * VARIED.velocity)


def test_viscous_dahl_is_a_normalised_bouc_wen():
    p = nominal("viscous_dahl")
    parent = force("normalised_bouc_wen", c=p["k_x"], k=0.0, k_w=p["k_w"], rho=p["rho"], sigma=1.0, n=1.0)
    assert_same_force(force("viscous_dahl", f0=0.0), parent)


def test_lugre_without_bristle_damping_is_viscous_dahl():
    p = nominal("lugre")
    parent = force("viscous_dahl", k_x=p["sigma_2"], k_w=p["sigma_0"] / p["a0"], rho=p["a0"], f0=p["f0"])
    assert_same_force(force("lugre", sigma_1=0.0), parent)


def test_bristle_damping_opposes_the_motion():
    # z' has the sign of v as long as |a0 z| <= 1, as it is from rest.
    difference = force("lugre") - force("lugre", sigma_1=0.0)
    assert np.all(difference * VARIED.velocity >= 0.0)
    assert np.max(np.abs(difference)) > 1.0


def test_the_model_of_guo_is_one_of_gavin():
    p = nominal("hyperbolic_tangent_guo")
    parent = force(
        "hyperbolic_tangent_gavin",
        f_o=p["A1"],
        V_r=1.0 / p["A3"],
        d_r=1.0 / (p["A3"] * p["omega"]),
        k0=p["A2"] * p["omega"],
        c0=p["A2"],
        f0=p["f0"],
    )
    assert_same_force(force("hyperbolic_tangent_guo"), parent)


def test_bingham_is_static_hysteretic_without_hysteresis():
    p = nominal("bingham")
    parent = force(
        "static_hysteretic", c=p["c0"], k=0.0, alpha=p["f_c"], beta=1.0 / p["v_s"], delta=0.0, f0=p["f0"]
    )
    assert_same_force(force("bingham"), parent)


@pytest.mark.parametrize("v_s", [1e-3, 1e-4, 1e-5])
def test_bingham_tends_to_the_published_sign(v_s):
    p = nominal("bingham")
    published = p["f_c"] * np.sign(VARIED.velocity) + p["c0"] * VARIED.velocity + p["f0"]
    apart = np.abs(force("bingham", v_s=v_s) - published)
    # 1 - tanh(y) = 2/(1 + exp(2 y)) <= 2 exp(-2 y)
    bound = 2.0 * p["f_c"] * np.exp(-2.0 * np.abs(VARIED.velocity) / v_s)
    assert np.all(apart <= bound + 1e-12 * np.max(np.abs(published)))


def test_polynomial_fitting_has_the_branch_of_the_acceleration_in_a_harmonic_test():
    p = nominal("polynomial_fitting")
    x_s = 1e-5
    x, v = HARMONIC.displacement, HARMONIC.velocity
    acceleration = -(OMEGA**2) * x
    mean = p["a"] * (2.0 / (1.0 + np.exp(-p["b"] * (v - p["v0"]))) - 1.0) + p["c"] * v + p["f0"]
    thickness = p["h"] * np.exp(-((v - p["v1"]) ** 2) / (2.0 * p["w"] ** 2))
    published = mean - np.sign(acceleration) * thickness / 2.0
    away = np.abs(x) > SATURATED * x_s
    assert np.mean(away) > 0.95
    assert_same_force(force("polynomial_fitting", HARMONIC, x_s=x_s)[away], published[away])


@pytest.mark.parametrize("name", ["dahl", "viscous_dahl", "lugre"])
def test_friction_with_a_state_is_passive_under_any_motion(name):
    # From rest, the input energy is the sum of stored and dissipated energy, both non-negative at all times, not only
    # over whole cycles. The amplitude grows from far within the knee, where most energy is stored, to beyond it. The
    # error of the trapezoidal rule is about (10 Hz 2 pi 0.1 ms)^2/12 of the exchanged energy.
    dt, omega = 1e-4, 2.0 * np.pi * 10.0
    time = dt * np.arange(5001)
    size = 4e-3 * time**2
    velocity = size * omega * np.cos(omega * time) + 8e-3 * time * np.sin(omega * time)
    loading = Loading(dt=dt, displacement=size * np.sin(omega * time), velocity=velocity)
    power = force(name, loading, f0=0.0) * velocity
    energy = np.concatenate([[0.0], np.cumsum(0.5 * dt * (power[1:] + power[:-1]))])
    assert np.any(power < 0.0), "no energy ever comes back, so the claim was not tried"
    assert np.all(energy >= -1e-5 * np.maximum.accumulate(energy))
