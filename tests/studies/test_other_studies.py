"""The quick forms of the smaller studies, and their arithmetic where the answer is known."""

from __future__ import annotations

import runpy
from argparse import Namespace
from functools import partial
from typing import Any

import measured_data
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import mrwork as mr
from studies.boucwen_benchmark.multisine import INTERPOLATIONS, newmark, random_multisine, stage_table
from studies.boucwen_benchmark.oscillator import (
    Parameters,
    Period,
    Scales,
    fitted,
    linear_fit,
    screened_minima,
    steady_period,
)
from studies.fragility import study as fragility
from studies.how_sure import synthetic_calibration
from studies.how_sure.scores import next_test_half_width
from studies.many_workers.study import LINK, Chunk, efficiency, recorded, sizes, study_of
from studies.own_dampers import study as own_dampers
from studies.sets_beyond import study as sets_beyond
from studies.yielding_frame import comparison, frame, study, timing

STUDIES = measured_data.ROOT / "studies"


@pytest.mark.parametrize("censored", [0.0, 0.6])
def test_a_share_of_the_records_lies_above_the_highest_level(censored: float) -> None:
    suites = [fragility.suite(censored, 20, 15, seed)["bare"].crossings for seed in range(6)]
    above = np.mean([crossing.below == np.inf for each in suites for crossing in each])
    assert above == pytest.approx(censored, abs=0.1)


def test_a_replicate_ranks_every_free_number_and_bands_another_motion() -> None:
    found = synthetic_calibration.replicate("viscous_dahl", "iid", np.random.default_rng(3), threads=1)
    assert len(found.ranks) == 4
    assert all(0 <= rank <= 63 for rank in found.ranks)
    assert 0.75 < found.coverage < 1.0
    # Random sizes widen a band beyond the mean size.
    alike = 0.1 * np.exp(0.001 * np.random.default_rng(1).standard_normal(10))
    assert next_test_half_width(alike, 0.9) == pytest.approx(1.645 * 0.1, rel=0.01)
    assert next_test_half_width(0.1 * np.exp(np.tile([0.5, -0.5], 5)), 0.9) > 1.2 * 0.1645


def chunk(seconds: float, *, shared: int = 0) -> Chunk:
    return Chunk(shared=shared, sent=shared, received=0, seconds=seconds)


def test_workers_wait_at_barriers_for_the_client_and_for_its_link() -> None:
    ones = [chunk(1.0), chunk(1.0)]
    assert efficiency([[chunk(1.0), chunk(2.0)], [chunk(3.0)]], 4.0, 1) == 1.0
    assert efficiency([ones], 0.0, 2) == 1.0
    assert efficiency([ones[:1], ones[:1]], 0.0, 2) == 0.5
    assert efficiency([ones], 1.0, 2) == pytest.approx(3.0 / 2.0 / 2.0)
    # The two carry what they share, a second each.
    assert efficiency([[chunk(1.0, shared=int(LINK)), chunk(1.0)]], 0.0, 2) == pytest.approx(2.0 / 3.0 / 2.0)
    calls, alone = recorded(partial(mr.run_study, study_of(motions=1, draws=2, budget=24), threads=1))
    assert alone > 0.0
    assert all(call[0].shared > 1000 and not any(each.shared for each in call[1:]) for call in calls)
    assert sizes(calls)["chunks"] == max(map(len, calls))


def test_every_family_of_one_model_for_a_rig_follows_the_command() -> None:
    families = runpy.run_path(str(STUDIES / "one_model_for_a_rig/study.py"))["families"]()
    assert len(families) > 5
    assert all(set(family.laws) == set(family.spec.following) for family in families.values())


def test_a_model_written_again_has_its_estimates() -> None:
    model = "hyperbolic_tangent_guo"
    row = own_dampers.fit_row("one record", model, [mr.synthetic_test("spencer1997")], {})
    assert row["apart"] < 1e-6
    assert own_dampers.batch_row(model)["forces apart"] < 1e-12


def test_sets_of_laws_widen_the_band() -> None:
    row = sets_beyond.replicate("viscous_dahl", "of the model", 0, commands=(0.0, 1.0), threads=1)
    assert row["tests"] == 6
    assert row["within_any"] > row["band_alone"] - 0.01 > 0.5
    assert row["width"] > 0.999 * row["width_alone"] > 0.05
    assert row["within"] == (row["within_any"] if row["sets"] > 1 else 0.0)


def test_the_limit_of_a_frame_that_yields_has_none_of_the_powers_of_the_step() -> None:
    steps = (0.4, 0.2, 0.1)
    first = [np.array([3.0, -1.0]) + np.array([2.0, 5.0]) * h + 7.0 * h**2 for h in steps]
    np.testing.assert_allclose(comparison.extrapolated(first), [3.0, -1.0], rtol=1e-12)
    second = [np.array([3.0, -1.0]) + 7.0 * h**2 for h in steps[:2]]
    np.testing.assert_allclose(comparison.extrapolated(second, order=2), [3.0, -1.0], rtol=1e-12)
    built = mr.study_of(building=timing.BUILDING, motions=[{"synthetic": "kanai_tajimi"}])
    case = frame.Case(motion=frame.motions()[0], p_delta=True)
    np.testing.assert_allclose(built.building.site_stiffness, frame.building(case).site_stiffness)
    np.testing.assert_allclose(built.building.damping, frame.building(case).damping)


def test_both_programs_have_the_same_limit_of_a_frame_that_yields(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(study, "openseespy", lambda: None)
        assert study.find(Namespace(quick=True, timing=False), print) == 2
    ops = pytest.importorskip("openseespy.opensees", exc_type=(ImportError, RuntimeError))
    whole = frame.at_level(frame.motions()[0], 0.8)
    peak = whole.dt * int(np.abs(whole.acceleration).argmax())
    motion = mr.motions.trimmed(whole, start=peak - 1.0, end=peak + 1.0)
    found = comparison.compared(ops, frame.Case(motion=motion, p_delta=True, damper=True))
    assert found["ductility"] > 2.0
    # Backward Euler of the loops, of the first order; Newmark's steps are of the second.
    np.testing.assert_allclose(found["orders"], 1.0, atol=0.2)
    assert max(found[name] for name in ("drift", "shear", "acceleration", "peaks")) < 1e-4


TRUE = Parameters(m=2.0, c=10.0, k=5e4, alpha=5e4, g=800.0, d=-1100.0, nu=1.0)
DT, N_TIME = 1.0 / 750.0, 1024


def rms(signal: Any) -> float:
    return float(np.sqrt(np.mean(np.square(signal))))


def steady_displacement(force: Any) -> Any:
    """A steady period by an eighth-order method of its own step, the force summed from its Fourier series."""
    omega = 2.0 * np.pi * np.fft.rfftfreq(N_TIME, DT)
    amplitude = 2.0 * np.fft.rfft(force) / N_TIME
    lines = np.abs(amplitude) > 1e-9
    omega, amplitude = omega[lines], amplitude[lines]

    def rate(t: float, state: Any) -> list[float]:
        y, v, z = state
        u = float(np.sum((amplitude * np.exp(1j * omega * t)).real))
        p = TRUE
        hysteretic = p.alpha * v - p.g * abs(v) * z - p.d * v * abs(z)
        return [v, (u - p.c * v - p.k * y - z) / p.m, hysteretic]

    time = DT * np.arange(-N_TIME // 2, N_TIME)
    ends = (time[0], time[-1])
    solved = solve_ivp(rate, ends, np.zeros(3), t_eval=time, method="DOP853", rtol=1e-8, atol=1e-10)
    return solved.y[0, N_TIME // 2 :]


def test_the_bouc_wen_benchmark_is_integrated_and_identified() -> None:
    force = random_multisine(N_TIME, DT, band=(5.0, 150.0), rms=50.0, rng=np.random.default_rng(3))
    displacement = steady_displacement(force)
    error = {
        name: rms(np.asarray(steady_period(TRUE, stage_table(force, 8, name), DT)) - displacement)
        for name in INTERPOLATIONS
    }
    # The kinks of |v| leave an error of the second order in the sub-step, 1e-4 of the displacement here.
    assert error["band-limited"] < 2e-4 * rms(displacement)
    assert error["cubic"] < 4e-4 * rms(displacement)
    assert error["linear"] > 20.0 * error["cubic"]
    coarse, fine = (rms(newmark(TRUE, force, DT, factor=factor) - displacement) for factor in (10, 20))
    assert fine < 4e-4 * rms(displacement)
    assert coarse / fine == pytest.approx(4.0, rel=0.2)
    omega = 2.0 * np.pi * np.fft.rfftfreq(N_TIME, DT)
    response = np.fft.rfft(force) / (-2.0 * omega**2 + 10j * omega + 1e5)
    linear = linear_fit(force, np.fft.irfft(response, N_TIME), DT)
    assert linear == pytest.approx((2.0, 10.0, 1e5), rel=1e-10)

    noise = 1e-6
    scales = Scales(linear=linear_fit(force, displacement, DT), displacement=rms(displacement))
    period = Period(stage_table(force, 4, "band-limited"), displacement, noise, DT)
    minima = screened_minima(period, scales, rng=np.random.default_rng(1), n_screened=16, n_descents=2)
    assert minima[0].misfit == pytest.approx(minima[1].misfit, rel=1e-3)
    # No noise was added: what is left, and the bias of the parameters, is the error of 4 sub-steps.
    assert minima[0].misfit * noise < 1e-3 * rms(displacement)
    fit = fitted(period, scales, minima[0])
    np.testing.assert_allclose(fit.parameters, TRUE, rtol=5e-3)
    assert all(error > 0.0 for error in fit.standard_errors)
