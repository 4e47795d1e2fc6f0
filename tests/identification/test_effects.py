"""A mass, lag or delay of the recorded force that tests at several frequencies have in common."""

import warnings
from dataclasses import replace
from typing import Any
from unittest import mock

import numpy as np
import pytest
from scipy import optimize, signal

import mrwork as mr
from mrwork.errors import SettingError
from mrwork.identification import effects
from mrwork.identification.commands import excerpts_at
from mrwork.identification.covariance import Covariance, Slopes
from mrwork.identification.identify import moved_to
from mrwork.identification.problem import Problem
from mrwork.identification.sliders import Sliders
from mrwork.records import DamperTest, Observation
from mrwork.records.observation import EFFECTS
from mrwork.uncertainty import Candidate

SPEC = mr.damper("static_hysteretic")
DAMPING = SPEC.names.index("c")
DT = 4e-3
LAG = 0.012
MOTIONS = ((0.015, 0.5), (0.008, 1.0), (0.003, 3.0))


def recorded(observation: Observation, rng: int, *motions: tuple[float, float]) -> DamperTest:
    """Four cycles of a static hysteresis, the last three through the observation as recorded, with noise of 6 N.

    The motion is a sum of sinusoids, amplitude [m] and frequency [Hz] each; the cycles are of the first.
    """
    amplitude, frequency = motions[0]
    time = DT * np.arange(round(4.0 / (frequency * DT)) + 1)
    sizes, frequencies = np.array(motions).T[..., None]
    omega = 2.0 * np.pi * frequencies
    sine, cosine = sizes * np.sin(omega * time), sizes * np.cos(omega * time)
    displacement, velocity, acceleration = np.sum([sine, omega * cosine, -(omega**2) * sine], axis=1)
    force = mr.simulate_force(
        SPEC, SPEC.nominal, mr.Loading(dt=DT, displacement=displacement, velocity=velocity)
    )
    force = observation.observe(force, DT, acceleration) + 6.0 * np.random.default_rng(rng).standard_normal(
        time.size
    )
    kept = slice(round(1.0 / (frequency * DT)), None)
    return mr.test_from_arrays(
        name=f"{1e3 * amplitude:g} mm {frequency:g} Hz",
        time=time[kept] - time[kept][0],
        displacement=displacement[kept],
        velocity=velocity[kept],
        force=force[kept],
    )


def rig(observation: Observation) -> list[DamperTest]:
    return [recorded(observation, rng, motion) for rng, motion in enumerate(MOTIONS)]


def advice(fit: mr.Fit) -> list[mr.Remark]:
    return [each for each in fit.remarks if each.code == "effects_unfitted"]


def test_a_lag_that_all_tests_have_is_told_with_the_option_that_fits_it_and_gives_the_damping_back() -> None:
    late = rig(Observation(lag_seconds=LAG))
    fit = mr.identify(SPEC, late, threads=1)
    (remark,) = advice(fit)
    assert (size := remark.measured) is not None
    assert abs(size.value - LAG) < 3.0 * (size.standard_error or 0.0) < 0.5 * LAG
    assert "--observe lag=free" in remark.message
    taken = mr.identify(SPEC, late, observe="lag=free", threads=1)
    (lag,) = taken.effects
    assert lag.standard_error is not None
    assert abs(lag.value - LAG) < 3.0 * lag.standard_error < 0.2 * LAG
    assert (taken.fitted[-1], "force_lag" in repr(taken)) == (lag, True)
    true = SPEC.nominal[DAMPING]
    assert abs(taken.theta[DAMPING] - true) < 0.25 * abs(fit.theta[DAMPING] - true)
    assert not advice(taken)


def test_a_fitted_delay_is_the_fit_with_that_delay_given_and_is_predicted_with() -> None:
    late = rig(Observation(delay_seconds=0.007))
    taken = mr.identify(SPEC, late, observe="delay=free", threads=1)
    (delay,) = taken.effects
    assert delay.value == pytest.approx(0.007, abs=3.0 * (delay.standard_error or 0.0))
    given = mr.identify(SPEC, late, observe=[f"delay={delay.value}"], threads=1)
    errors = [estimate.standard_error or np.inf for estimate in given.estimates]
    assert np.all(np.abs(np.subtract(taken.theta, given.theta)) < 0.25 * np.array(errors))
    assert taken.observed(late[0]).observation.delay_seconds == delay.value
    # An error that counts the delay as known is smaller.
    known, fitted = (fit.parameters["k"].standard_error or 0.0 for fit in (given, taken))
    assert 0.0 < known < fitted


@pytest.mark.parametrize("frequencies", [1, 3])
def test_a_channel_that_is_on_time_is_not_doubted(frequencies: int) -> None:
    fit = mr.identify(SPEC, rig(Observation())[:frequencies], threads=1)
    assert not {"effects_unfitted", "delay_unknown"} & {each.code for each in fit.remarks}


def test_damping_at_one_frequency_says_what_an_unknown_delay_would_do() -> None:
    (test,) = rig(Observation())[2:]
    stiff = replace(test, force=test.force + 4e5 * test.displacement)
    fit = mr.identify(SPEC, stiff, threads=1)
    (delay,) = [each.measured for each in fit.remarks if each.code == "delay_unknown"]
    assert delay is not None
    assert delay.value == pytest.approx(6.7e-3, abs=5e-5)


def test_a_moving_mass_is_told_and_fitting_it_gives_the_stiffness_back() -> None:
    loaded = rig(Observation(mass=60.0, delay_seconds=0.006))
    fit = mr.identify(SPEC, loaded, threads=1)
    assert [each.words for each in advice(fit)] == [("mass", "delay")]
    taken = mr.identify(SPEC, loaded, observe=["mass=free", "delay=free"], threads=1)
    mass, delay = taken.effects
    assert abs(mass.value - 60.0) < 3.0 * (mass.standard_error or 0.0) < 12.0
    assert abs(delay.value - 0.006) < 3.0 * (delay.standard_error or 0.0) < 0.002
    stiffness, true = SPEC.names.index("k"), SPEC.nominal[SPEC.names.index("k")]
    assert abs(taken.theta[stiffness] - true) < 0.1 * abs(fit.theta[stiffness] - true)
    assert not advice(taken)
    assert mr.predict(taken, loaded[1:2]).predictions[0].fit_percent > 98.0


def test_a_mass_is_told_where_a_delay_alone_is_not_worth_a_fit() -> None:
    fit = mr.identify(SPEC, rig(Observation(mass=5.7)), threads=1)
    assert [each.words[0] for each in advice(fit)] == ["mass"]


@pytest.mark.parametrize("mass", [0.05, 0.2, 0.5])
def test_a_small_mass_of_a_light_rig_is_a_number_with_its_error_and_on_no_bound(mass: float) -> None:
    motions = ((0.010, 1.0), (0.006, 5.0), (0.004, 15.0))
    loaded = [recorded(Observation(mass=mass), rng, motion) for rng, motion in enumerate(motions)]
    fit = mr.identify(SPEC, loaded, observe="mass=free", threads=1)
    (found,) = fit.effects
    assert found.state == ""
    assert 0.0 < (found.standard_error or 0.0) < 0.1
    assert abs(found.value - mass) < 3.0 * (found.standard_error or 0.0)
    # The stiffness counts the error of the mass, as it would not beside a bound.
    given = mr.identify(SPEC, loaded, observe=f"mass={found.value}", threads=1)
    errors = [each.parameters["k"].standard_error or 0.0 for each in (fit, given)]
    assert errors[0] > 1.1 * errors[1] > 0.0


def test_a_single_record_of_several_frequencies_is_weighed_by_its_parts() -> None:
    loaded, alone = (recorded(Observation(mass=mass), 0, *MOTIONS[:2]) for mass in (60.0, 0.0))
    taken = mr.identify(SPEC, loaded, observe=["detect", "weigh"], threads=1)
    (mass,) = taken.effects
    assert abs(mass.value - 60.0) < 3.0 * (mass.standard_error or 0.0) < 12.0
    assert not advice(mr.identify(SPEC, alone, threads=1))


def test_few_tests_say_that_effects_would_take_most_of_the_misfit_away() -> None:
    fit = mr.identify("bouc_wen", rig(Observation(mass=200.0)), threads=1)
    (hidden,) = [each.measured for each in fit.remarks if each.code == "effects_hidden"]
    assert hidden is not None
    assert hidden.value > fit.fit_percent + 5.0


def sliding(frequency: float, amplitude: float, mass: float = 0.0, delay: float = 0.0) -> DamperTest:
    """Twelve sliders of 400 N in all, 1.5 kN s/m and 2.5 kN/m, which is none of our models, with noise of 3 N."""
    time = np.arange(0.0, 3.0 / frequency, DT)
    omega = 2.0 * np.pi * frequency
    x, v = amplitude * np.sin(omega * time), amplitude * omega * np.cos(omega * time)
    slip, state, force = 2e-4 * 1.35 ** np.arange(12), np.zeros(12), np.zeros(time.size)
    for index, step in enumerate(np.diff(x, prepend=0.0)):
        state = np.clip(state + step / slip, -1.0, 1.0)
        force[index] = 400.0 * state.mean()
    force += 1500.0 * v + (2500.0 - mass * omega**2) * x
    force = np.interp(time - delay, time, force) + 3.0 * np.random.default_rng(0).standard_normal(time.size)
    return mr.test_from_arrays(time, x, force, velocity=v, name=f"{frequency:g} Hz")


def slid(mass: float, delay: float) -> list[DamperTest]:
    motions = ((0.5, 0.012), (1.0, 0.006), (2.0, 0.009), (3.0, 0.005))
    return [sliding(*motion, mass, delay) for motion in motions]


@pytest.mark.parametrize("model", ["normalised_bouc_wen", "static_hysteretic"])
def test_a_mass_beside_a_delay_is_told_whatever_model_is_fitted(model: str) -> None:
    # The second describes 69 % of the force.
    (told,) = advice(mr.identify(model, slid(40.0, 0.006), threads=1))
    assert told.words in (("mass", "lag"), ("mass", "delay"))
    assert (size := told.measured) is not None
    assert abs(size.value - 40.0) < 3.0 * (size.standard_error or 0.0) < 20.0
    assert "--observe weigh" in told.message
    (late,) = advice(mr.identify(model, slid(0.0, 0.006), threads=1))
    assert late.measured is not None
    assert late.words in (("lag",), ("delay",))
    assert abs(late.measured.value - 0.006) < 3.0 * (late.measured.standard_error or 0.0) < 0.006
    assert not advice(mr.identify(model, slid(0.0, 0.0), threads=1))


def test_what_sliders_tell_is_held_with_its_error_in_the_fit_that_weighs() -> None:
    tests = slid(40.0, 0.006)
    (told,) = advice(mr.identify("normalised_bouc_wen", tests, threads=1))
    clean = mr.identify("normalised_bouc_wen", slid(0.0, 0.0), threads=1).parameters["k"]
    weighed = mr.identify("normalised_bouc_wen", tests, observe=["detect", "weigh"], threads=1)
    mass, _ = weighed.effects
    assert told.measured is not None
    assert (mass.value, mass.standard_error) == pytest.approx(
        (told.measured.value, told.measured.standard_error)
    )
    given = [f"{each.name.removeprefix('force_')}={each.value!r}" for each in weighed.effects]
    known = mr.identify("normalised_bouc_wen", tests, observe=["detect", *given], threads=1).parameters["k"]
    k = weighed.parameters["k"]
    assert k.value == pytest.approx(known.value, rel=0.02)
    assert abs(k.value - clean.value) < 3.0 * (k.standard_error or 0.0)
    # A stiffness that counts the error of the mass is known worse.
    assert (k.standard_error or 0.0) > (known.standard_error or 0.0) > 0.0


def test_what_sliders_told_is_given_to_a_likelihood_whose_errors_are_said_to_count_less() -> None:
    tests = slid(40.0, 0.006)
    fit = mr.identify("normalised_bouc_wen", tests, observe=["detect", "weigh"], threads=1)
    assert {effect.state for effect in fit.effects} == {"told by sliders"}
    profiles = mr.profile(fit, tests, parameters=["k", "c"], threads=1)
    # The model by itself would take another mass, which is no better fit.
    assert profiles.better is None
    k, profiled = fit.parameters["k"], profiles.profiles[1].interval
    assert (k.standard_error or 0.0) > 1.5 * profiled.error
    draws = mr.sample(fit, tests, most_steps=60, walkers=24, rng=1, threads=1)
    assert draws.names == fit.spec.names
    plan = mr.plan(fit, tests, [Candidate(amplitude=0.01, frequency=3.0)], band="k", threads=1)
    for result in (profiles, draws, plan):
        codes = [remark.code for remark in result.remarks]
        assert {"residual_is_structure", "errors_of_likelihood"} <= {*codes}
        (less,) = [remark for remark in result.remarks if remark.code == "errors_of_likelihood"]
        assert "k " in less.words[0]


def test_a_verdict_of_the_fit_stays_where_its_error_counts_more_than_an_interval() -> None:
    tests = slid(40.0, 0.006)
    fit = mr.identify("normalised_bouc_wen", tests, observe=["mass=free", "lag=free"], threads=1)
    profiles = mr.profile(fit, tests, parameters=["k"], threads=1)
    (k,) = profiles.profiles
    assert (fit.parameters["k"].verdict, k.verdict) == ("weakly identifiable", "model-dependent")
    after = fit.with_intervals(profiles.profiles).parameters["k"]
    assert (after.interval, after.verdict) == (k.interval, "weakly identifiable")
    # Errors of a fit without effects count no more than the interval does.
    alone = replace(fit, effects=()).with_intervals(profiles.profiles)
    assert alone.parameters["k"].verdict == "model-dependent"


def test_sliders_are_told_the_given_observation_of_a_test() -> None:
    mass, delay = EFFECTS["mass"], EFFECTS["delay"]
    (found,) = Sliders.of(slid(40.0, 0.0)).fit((mass,)).values
    given = [replace(test, observation=Observation(mass=40.0)) for test in slid(40.0, 0.006)]
    left, seconds = Sliders.of(given).fit((mass, delay)).values
    # Four tests with friction of other lengths than that of the sliders tell 3 kg of a mass.
    assert (found, left) == (pytest.approx(40.0, abs=3.0), pytest.approx(0.0, abs=3.0))
    assert seconds == pytest.approx(0.006, abs=1e-3)


def behind_a_spring(stiffness: float, lag: float = 0.0) -> list[DamperTest]:
    """Sines of a dashpot with friction behind a spring, or on a rigid mount with a late force; no mass."""

    def carried(speed: float) -> float:
        return 3000.0 * speed + 150.0 * np.tanh(speed / 0.02)

    rng, tests = np.random.default_rng(3), []
    for amplitude, frequency in (
        (18e-3, 0.5),
        (11e-3, 1.1),
        (7e-3, 2.2),
        (4e-3, 3.6),
        (15e-3, 1.5),
        (5e-3, 1.4),
    ):
        fine = np.linspace(0.0, 4.0 / frequency, 319 * 10 + 1)
        across, step = amplitude * np.sin(2.0 * np.pi * frequency * fine), float(fine[1])
        speeds = 2.0 * np.pi * frequency * amplitude * np.cos(2.0 * np.pi * frequency * fine)
        force = 3000.0 * speeds + 150.0 * np.tanh(speeds / 0.02) + 1e4 * across
        inside = 0.0
        for number, outside in enumerate(across.tolist() if np.isfinite(stiffness) else []):
            force[number] = pull = stiffness * (outside - inside)
            # The speed at which dashpot, friction and the damper's own spring carry the force of the mount.
            pull -= 1e4 * inside
            inside += step * optimize.brentq(
                lambda speed, pull=pull: carried(speed) - pull, -2.0, 2.0, xtol=1e-9
            )
        time, recorded_force = fine[::10], force[::10]
        if lag:
            decay = np.exp(-time[1] / lag)
            recorded_force = signal.lfilter([1.0 - decay], [1.0, -decay], recorded_force)
        noisy = across[::10] + rng.normal(0.0, 3e-4 * amplitude, time.size)
        noisy_force = recorded_force + rng.normal(0.0, 4.0, time.size)
        name = f"{amplitude:g} m {frequency:g} Hz"
        tests.append(mr.test_from_arrays(name=name, time=time, displacement=noisy, force=noisy_force))
    return tests


@pytest.mark.parametrize(
    ("stiffness", "lag", "told"), [(2e5, 0.0, True), (3e5, 0.0, True), (np.inf, 0.008, False)]
)
def test_a_spring_in_series_is_told_in_the_place_of_a_mass_or_a_late_force(
    stiffness: float, lag: float, told: bool
) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fit = mr.identify("normalised_bouc_wen", behind_a_spring(stiffness, lag), threads=1)
    about = {remark.code: remark for remark in fit.remarks}
    assert ("spring_in_series" in about) is told
    assert ("effects_unfitted" in about) is not told
    if told:
        measured = about["spring_in_series"].measured
        assert measured is not None
        assert measured.value == pytest.approx(stiffness, rel=0.05)


def test_a_mass_at_one_frequency_is_noted_beside_the_stiffness_that_it_takes_away() -> None:
    fit = mr.identify("normalised_bouc_wen", [sliding(3.0, 0.012)], threads=1)
    (note,) = [each for each in fit.remarks if each.code == "mass_as_stiffness"]
    assert (note.words, note.severity) == (("k",), "note")
    percent = 100.0 * 20.0 * (6.0 * np.pi) ** 2 / abs(fit.parameters["k"].value)
    assert f"would move k by about {percent:.0f} %" in note.message


def test_a_mass_that_tests_do_not_tell_is_said_with_what_it_would_do_to_the_stiffness() -> None:
    fit = mr.identify("normalised_bouc_wen", [sliding(0.5, 0.006), sliding(1.5, 0.012)], threads=1)
    (unknown,) = [each for each in fit.remarks if each.code == "mass_unknown"]
    assert unknown.words == ("k",)
    # The stiffness is wrong by more than five of its errors, without any mass.
    k = fit.parameters["k"]
    assert abs(k.value - 2500.0) > 2.0 * (k.standard_error or np.inf)


def test_errors_of_parameters_follow_the_larger_errors_of_effects() -> None:
    root = np.random.default_rng(3).normal(size=(5, 5))
    matrix = root @ root.T
    own = effects._with_errors(matrix, np.sqrt(np.diag(matrix)[3:]))
    np.testing.assert_allclose(own, matrix[:3, :3])
    errors = np.array([2.0, 5.0]) * np.sqrt(np.diag(matrix)[3:])
    # A draw of the effects with their larger errors, which the parameters follow, and what is left of these.
    draws = np.random.default_rng(4).normal(size=(200_000, 5)) @ np.linalg.cholesky(matrix).T
    follow = matrix[:3, 3:] @ np.linalg.inv(matrix[3:, 3:])
    left = draws[:, :3] - draws[:, 3:] @ follow.T
    expected = np.cov((left + draws[:, 3:] * [2.0, 5.0] @ follow.T).T)
    np.testing.assert_allclose(effects._with_errors(matrix, errors), expected, rtol=0.03, atol=0.3)


def test_a_loop_too_stiff_for_excerpts_is_examined_on_all_of_their_samples() -> None:
    time = np.arange(0.0, 12.0, 2e-3)
    x, v = 0.02 * np.sin(np.pi * time), 0.02 * np.pi * np.cos(np.pi * time)
    test = mr.test_from_arrays(time, x, 1e3 * v + 300.0 * np.tanh(v / 0.01), velocity=v)
    problem = Problem.of(
        mr.damper("normalised_bouc_wen"), (test,), mr.identification.FitSettings(), threads=1
    )
    theta = problem.spec.nominal.copy()
    theta[problem.spec.names.index("n")] = 1.0
    theta[problem.spec.names.index("sigma")] = 1e4
    for rho, is_whole in ((1e4, False), (2e5, True)):
        theta[problem.spec.names.index("rho")] = rho
        examined = excerpts_at(problem, theta)
        assert np.isfinite(examined(theta[None])[0])
        assert is_whole is (examined.tests[0].dt == test.dt)
        # Three of the six cycles, whatever their samples.
        assert examined.tests[0].n_time * examined.tests[0].dt < 0.6 * test.n_time * test.dt


def test_sliders_that_no_fit_of_the_model_can_beat_decide_without_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tests = slid(40.0, 0.0)
    fit = mr.identify("static_hysteretic", tests, threads=1)
    problem = Problem.of_fit(fit, tuple(tests), threads=1)
    covariance = Covariance.of(Slopes.at(problem.objective, problem.form, problem.inside(fit.theta)))
    fitted = list[Any]()
    monkeypatch.setattr(effects, "_fit_with", lambda *given, **_: fitted.append(given))
    weighed = effects._weigh(problem, covariance)
    assert not fitted
    assert weighed is not None
    assert weighed.best is not None
    assert weighed.by_sliders
    assert abs(weighed.best.values[0] - 40.0) < 3.0 * weighed.best.errors[0] < 20.0


def test_predictions_that_are_worse_than_a_constant_force_show_no_effect() -> None:
    shown, worse = (
        effects.FitWithEffects(
            effects=(EFFECTS["delay"],),
            values=np.array([0.01]),
            errors=np.array([0.001]),
            misfit=0.1,
            predicted=predicted,
        )
        for predicted in (0.2, 150.0)
    )
    assert effects._paying([shown, worse], 250.0) == [shown]


def test_a_model_that_describes_too_little_says_that_it_tells_no_effect() -> None:
    fit = mr.identify("maxwell", rig(Observation(delay_seconds=0.007)), threads=1)
    assert "effects_hidden" in {each.code for each in fit.remarks}


def test_jax_has_the_inertia_of_a_given_mass() -> None:
    from mrwork import jax as in_jax

    loaded = rig(Observation(mass=60.0))
    lanes = mr.objective(SPEC, loaded, observe="mass=60", threads=1)
    assert float(in_jax.misfit(lanes)(lanes.start)) == pytest.approx(float(lanes(lanes.start)), rel=1e-9)


def test_a_mass_is_no_number_of_tests_at_one_frequency() -> None:
    with pytest.raises(SettingError, match="at one frequency a mass cannot be told apart from a stiffness"):
        mr.identify(SPEC, rig(Observation(mass=60.0))[2:], observe="mass=free", threads=1)


@pytest.mark.parametrize("words", [["lag=free", "delay=free"], ["gain=free"], ["mass=free", "mass=3"]])
def test_what_no_fit_can_tell_is_refused(words: list[str]) -> None:
    with pytest.raises(SettingError, match="--observe"):
        mr.identification.FitSettings(observe=words)


def test_what_pays_is_fitted_where_it_is_to_be_weighed_and_told_with_the_fit_without() -> None:
    taken = mr.identify(SPEC, rig(Observation(mass=60.0)), observe=["detect", "weigh"], threads=1)
    (mass,) = taken.effects
    assert abs(mass.value - 60.0) < 3.0 * (mass.standard_error or 0.0)
    (told,) = [each for each in taken.remarks if each.code == "effects_fitted"]
    assert told.words == ("mass",)
    assert "k is" in told.message
    assert taken.settings.observing.words == ["detect", f"mass={mass.value!r}"]
    moved = moved_to(taken, taken.tests, np.array(taken.theta), found_by="a profile", threads=1)
    assert [each for each in moved.remarks if each.code == "effects_fitted"] == [told]
    with mock.patch.object(effects, "_weigh", wraps=effects._weigh) as weigh:
        assert mr.identify(SPEC, rig(Observation()), observe=["detect", "weigh"], threads=1).effects == ()
    weigh.assert_called_once()
