"""Designs over several plants, in discrete time, and with the semi-active condition."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from loop_samples import design_problem
from refusals import refusal

import mrwork as mr
from mrwork.control import DesignedWeights, SemiActiveCondition, design_weights
from mrwork.control.laws.weights import WeightWishes
from mrwork.control.weights.limits import DesignCase, LoopTiming, stiffness_cases
from mrwork.motions import KanaiTajimi

LIMITS = {"rms_drift": 4e-3, "rms_acceleration": 5.2}
BUDGET = 900.0
FRAME = mr.building("uts")


def design(**given: Any) -> DesignedWeights:
    return design_weights(FRAME, FRAME.storeys[:1], **{"limits": LIMITS, "budget": BUDGET, **given})


def test_cases_share_their_weights_and_means_keep_to_the_ratio() -> None:
    found = design(cases=stiffness_cases(FRAME))
    check = found.certificate
    assert check.violation <= 1e-8
    assert check.program_ratio == pytest.approx(check.ratio, rel=1e-5)
    forces = np.array([case.forces[0] for case in check.cases])
    assert np.sqrt(np.mean(forces**2)) == pytest.approx(BUDGET, rel=1e-7)
    assert forces.std() > 1.0
    # Each limit is met in the mean square over the cases; which one is largest may differ from case to case.
    assert check.ratio <= np.sqrt(np.mean([case.ratio**2 for case in check.cases]))
    assert all(np.isfinite(case.law_ratio) for case in check.cases)


def test_cases_that_do_not_go_together_are_refused() -> None:
    soil = KanaiTajimi(frequency=25.0)
    refusal(design, cases=stiffness_cases(FRAME), spectrum=soil, match="a spectrum of its own")
    other = DesignCase(name="other", building=mr.building("dyke1996"))
    refusal(design, cases=[other], match="other coordinates, floors or storeys")


def test_a_short_sample_without_driver_is_the_continuous_design() -> None:
    found = design(timing=LoopTiming(sample_time=1e-4))
    assert found.reachable_ratio == pytest.approx(design().reachable_ratio, rel=1e-4)


def test_driver_and_delay_cost_and_are_designed_for() -> None:
    ratios = [
        design(timing=timing).reachable_ratio
        for timing in (
            LoopTiming(),
            LoopTiming(driver_rate=190.0),
            LoopTiming(driver_rate=190.0, delay=5e-3),
            LoopTiming(driver_rate=190.0, delay=0.02, sample_time=5e-3),
        )
    ]
    assert ratios == sorted(ratios)
    found = design(timing=LoopTiming(driver_rate=190.0, delay=5e-3))
    assert found.certificate.violation <= 1e-8
    assert found.certificate.program_ratio == pytest.approx(found.certificate.ratio, rel=1e-4)
    # Fed back without regard to the delay, the gain of the continuous design does worse than the one designed for it.
    case = found.certificate.cases[0]
    assert case.law_ratio < 1.1 * found.reachable_ratio
    refusal(found.settings, match="the key designed")


def test_a_sampled_design_is_a_discrete_riccati_equation() -> None:
    found = design(timing=LoopTiming(sample_time=2e-3, driver_rate=190.0, delay=4e-3))
    system, rows, h = found.system, found.rows, 2e-3
    weights = found.multipliers @ rows.forms
    Q, N, R = ((a.T * weights) @ b for a, b in ((rows.C, rows.C), (rows.C, rows.D), (rows.D, rows.D)))
    transition, entry = np.eye(system.n_states) + h * system.A, h * system.B
    P = scipy.linalg.solve_discrete_are(transition, entry, h * Q, h * R, s=h * N)
    gain = np.linalg.solve(h * R + entry.T @ P @ entry, entry.T @ P @ transition + h * N.T)
    X = scipy.linalg.solve_discrete_lyapunov(transition - entry @ gain, h * system.noise)
    squares = np.einsum("ij,jk,ik->i", rows.C - rows.D @ gain, X, rows.C - rows.D @ gain)
    n = len(found.outputs.limits)
    assert np.sqrt(squares[:n].max()) == pytest.approx(found.reachable_ratio, rel=1e-4)
    assert np.sqrt(squares[n]) == pytest.approx(1.0, rel=1e-4)


def test_the_semi_active_condition_is_met() -> None:
    for share in (0.2, 0.1):
        free = design()
        found = design(semi_active=SemiActiveCondition(share=share))
        assert found.reachable_ratio >= free.reachable_ratio
        assert found.certificate.violation <= 1e-8
        for each, binds in ((found, True), (free, False)):
            correlation = force_and_rate(each)
            assert (correlation >= np.sqrt(1.0 - share**2) - 1e-4) == binds
        refusal(found.settings, match="the key designed")
        P = scipy.linalg.solve_continuous_are(found.plant.A, found.plant.B, found.Q, found.R, s=found.N)
        gain = np.linalg.solve(found.R, found.plant.B.T @ P + found.N.T)
        np.testing.assert_allclose(
            (gain - found.gain) @ found.plant.scaling,
            0.0,
            atol=1e-4 * np.linalg.norm(found.gain @ found.plant.scaling),
        )


def force_and_rate(found: DesignedWeights) -> float:
    """Correlation of desired force and rate of elongation under the Riccati gain on all states."""
    # The covariance of all states is no public number.
    from mrwork.control.weights.riccati_dual import regulate

    at = regulate(found.system, found.rows, found.multipliers)
    force, rate = -at.gain[0], found.system.rates[0]
    X = at.covariance
    return float(force @ X @ rate / np.sqrt((force @ X @ force) * (rate @ X @ rate)))


def test_an_extension_that_cannot_be_is_refused() -> None:
    two = SemiActiveCondition(share=0.2, damping=(1e3, 1e3))
    refusal(lambda: design(semi_active=two), match="2 dampings")
    refusal(LoopTiming, delay=1.5e-3, match="whole number of samples")
    refusal(LoopTiming, delay=0.1, match="100 samples")
    refusal(stiffness_cases, FRAME, [0.0], match="above 0")


def test_a_sampled_design_leaves_a_budget_unused_that_accelerations_have_no_use_for() -> None:
    """Its program has noise on the forces, which does not grow with the budget."""
    timing = LoopTiming(delay=1e-3, driver_rate=190.0)
    enough, plenty = design(budget=5e3, timing=timing), design(budget=1e9, timing=timing)
    assert plenty.reachable_ratio == pytest.approx(enough.reachable_ratio, rel=1e-7)
    np.testing.assert_allclose(plenty.certificate.forces, enough.certificate.forces, rtol=1e-6)


def test_the_weights_of_a_record_follow_its_content(tmp_path: Path) -> None:
    record, found = tmp_path / "record.csv", []
    wishes = WeightWishes(rms_drift=2e-3, budget=500.0, record=str(record))
    for frequency in (2.0, 6.0):
        time = 0.01 * np.arange(2001)
        swing = np.sin(2.0 * np.pi * frequency * time) + 0.3 * np.sin(7.0 * time)
        rows = [f"{t:.2f},{a:.6f}" for t, a in zip(time, swing, strict=True)]
        record.write_text("\n".join(["time [s],acceleration [m/s2]", *rows]), encoding="utf-8")
        found.append(wishes.of_problem(design_problem()).reachable_ratio)
    assert abs(found[0] / found[1] - 1.0) > 0.1
