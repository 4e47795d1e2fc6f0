"""Doubts of a fit that has converged: noise of the motion, laws through logarithms, offsets of the force."""

from __future__ import annotations

import json
import warnings
from functools import cache

import numpy as np
import pytest
from command_line import mrwork, printed
from examples import examples
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import mrwork as mr
from mrwork.dampers import LawName, damper
from mrwork.identification import Fit
from mrwork.records import DamperTest, build_damper_test

MODEL = "viscous_dahl"
SPEC = damper(MODEL)
STEP = 5e-6


def recorded(
    rng: int, *, force: float, displacement: float, velocity: float | str, dt: float = 1e-3
) -> DamperTest:
    """Two cycles of 10 mm at 1 Hz with noise [N, m, m/s]; a velocity by differences of readings in steps of 5 um."""
    time = dt * np.arange(round(2.0 / dt) + 1)
    phase = 2.0 * np.pi * time
    motion = {"displacement": 0.01 * np.sin(phase), "velocity": 0.02 * np.pi * np.cos(phase)}
    exact = mr.simulate_force(SPEC, SPEC.nominal, mr.Loading(dt=dt, **motion))
    noise = np.random.default_rng(rng).standard_normal((3, time.size))
    read = motion["displacement"] + displacement * noise[1]
    if isinstance(velocity, str):
        read = STEP * np.round(read / STEP)
        moving = np.gradient(read, dt)
    else:
        moving = motion["velocity"] + velocity * noise[2]
    return build_damper_test(
        name="rig", time=time, displacement=read, velocity=moving, force=exact + force * noise[0]
    )


def fitted(test: DamperTest) -> mr.Fit:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mr.identify(MODEL, test, threads=1)


def says_so(fit: mr.Fit) -> bool:
    return any("noise of the motion dominates" in each for each in fit.warnings)


def held(fit: mr.Fit) -> list[bool]:
    """Whether the 95 % interval of each parameter has the one of the record."""
    return [
        each.standard_error is not None and abs(each.value - true) < 1.96 * each.standard_error
        for each, true in zip(fit.estimates, SPEC.nominal, strict=True)
    ]


@pytest.mark.parametrize("times", [1.0, 3.0])
@pytest.mark.parametrize("velocity", ["differenced", 5e-4])
def test_intervals_hold_or_the_fit_says_that_the_noise_of_the_motion_dominates(
    velocity: float | str, times: float
) -> None:
    own = velocity if isinstance(velocity, str) else times * velocity
    fits = [
        fitted(recorded(rng, force=8.0 * times, displacement=5e-6 * times, velocity=own)) for rng in range(8)
    ]
    silent = [each for fit in fits if not says_so(fit) for each in held(fit)]
    # 90 % of them, less two standard deviations of so few.
    assert not silent or np.mean(silent) > 0.9 - 2.0 * np.sqrt(0.09 / len(silent))
    # Differences are not used, which left f0 alone in its interval.
    if isinstance(velocity, str):
        assert np.mean([each for fit in fits for each in held(fit)]) > 0.7


@examples(3)
@given(rng=st.integers(0, 1000))
def test_a_motion_with_far_more_noise_than_the_force_is_told_and_an_exact_one_is_not(rng: int) -> None:
    assert says_so(fitted(recorded(rng, force=0.5, displacement=5e-6, velocity=5e-4, dt=4e-3)))
    assert not says_so(fitted(recorded(rng, force=20.0, displacement=1e-8, velocity=1e-6, dt=4e-3)))


def test_the_remedy_of_a_measured_velocity_is_its_derivation_and_of_a_derived_one_is_not() -> None:
    test = recorded(3, force=0.5, displacement=5e-6, velocity=5e-4, dt=4e-3)
    derived, _ = mr.records.repair(test, ["velocity"])
    for each, named in ((test, True), (derived, False)):
        (sentence,) = [warning for warning in fitted(each).warnings if "noise of the motion" in warning]
        assert ("--repair velocity" in sentence) == named
        assert "measure the motion with less noise" in sentence


def test_the_check_of_the_motion_counts_no_simulation_and_repeats_itself() -> None:
    test = recorded(5, force=0.5, displacement=5e-6, velocity=5e-4, dt=4e-3)
    one, other = fitted(test), fitted(test)
    assert one.warnings == other.warnings
    assert one.evaluations == other.evaluations


TEST = "synthetic:spencer1997_fast"


@pytest.mark.parametrize(
    ("arguments", "warned"),
    [
        (("--model", "dahl"), False),
        (("--model", "dahl", "--fix", "f0=0"), True),
        (("--model", "dahl", "--fix", "f0=-90"), False),
        (("--model", "dahl", "--nuisance", "offset"), False),
        (("--model", "dahl", "--fix", "f0=0", "--repair", "offset"), False),
    ],
)
def test_only_an_offset_that_the_model_cannot_describe_is_a_warning(
    arguments: tuple[str, ...], warned: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    place = tmp_path_factory.mktemp("offset") / "run"
    document = json.loads(printed("identify", TEST, "--every", "8", *arguments, "--json", "--out", place))
    about = [each for each in document["warnings"] if "static offset" in each]
    assert bool(about) == warned
    if warned:
        assert "f0 is fixed at 0" in about[0]
        assert "--repair offset" in about[0]
    severities = {each["code"]: each["severity"] for each in document["findings"]}
    assert severities.get("force_offset") == (None if "--repair" in arguments else "note")


def test_the_first_demo_has_no_warning(tmp_path_factory: pytest.TempPathFactory) -> None:
    place = tmp_path_factory.mktemp("demo") / "run"
    model = ("--model", "normalised_bouc_wen", "--seed", "1")
    ended = mrwork("identify", "synthetic:spencer1997", *model, "--quiet", "--out", place)
    assert ended.returncode == 0, ended.stderr
    assert "warning" not in ended.stdout + ended.stderr
    assert "note: the force has a static offset" in ended.stdout


DT = 4e-3
NOISE_N = 8.0
PLAIN = mr.damper("static_hysteretic")
# The yield force of the RD-1005-3 of Kwok et al. 2006: 32 N at 0 A, and 28 times as much at 1.5 A.
POLYNOMIAL = (32.0, 583.25, 860.0)
# Any curve through logarithms.
CURVED = (150.0, 450.0, 800.0)
FIXED = {"x_s": (1e-4, 1e-4)}
LEVELS = np.array([0.0, 0.75, 1.5])


def record(
    alpha: tuple[float, float, float], command: NDArray[np.float64] | float, law: LawName, rng: int = 0
) -> DamperTest:
    time = DT * np.arange(800)
    omega = 4.0 * np.pi
    displacement, velocity = 0.01 * np.sin(omega * time), 0.01 * omega * np.cos(omega * time)
    values = {"c": 1500.0, "k": 4000.0, "beta": 100.0, "delta": 0.6, "x_s": 1e-4, "f0": 50.0}
    spec = PLAIN.with_current_laws({"alpha": law})
    theta = [
        alpha[LEVELS.tolist().index(each.coefficient.command)]
        if each.coefficient is not None and each.coefficient.command is not None
        else values[each.plain_name]
        for each in spec.parameters
    ]
    loading = mr.Loading(
        dt=DT, displacement=displacement, velocity=velocity, command=command, command_unit="A"
    )
    force = mr.simulate_force(spec, np.array(theta), loading)
    return build_damper_test(
        name=f"record {rng}",
        time=time,
        displacement=displacement,
        velocity=velocity,
        force=force + NOISE_N * np.random.default_rng(rng).standard_normal(time.size),
        current=command,
    )


def steps() -> NDArray[np.float64]:
    """A command that stays for 0.2 s at one of the levels or between them."""
    return np.random.default_rng(4).uniform(0.0, 1.5, 100)[(DT * np.arange(800) / 0.2).astype(int)]


@cache
def fit_of(alpha: tuple[float, float, float], law: LawName, true_law: LawName, *, varying: bool) -> Fit:
    commands = [steps()] if varying else [0.0, 0.4, 0.75, 1.1, 1.5]
    tests = [record(alpha, command, true_law, rng) for rng, command in enumerate(commands)]
    return mr.identify(PLAIN.with_current_laws({"alpha": law}), tests, bounds=FIXED, threads=1)


def advice(fit: Fit) -> list[str]:
    return [each for each in fit.warnings if "laws through the values themselves" in each]


@pytest.mark.parametrize("varying", [False, True])
def test_a_yield_force_that_is_a_polynomial_is_advised_the_law_through_its_values(varying: bool) -> None:
    through, logarithms = "quadratic:0,0.75,1.5", "values:0,0.75,1.5"
    fit = fit_of(POLYNOMIAL, logarithms, through, varying=varying)
    (sentence,) = advice(fit)
    assert sentence.endswith(f"give alpha={through} as laws")
    advised = fit_of(POLYNOMIAL, through, through, varying=varying)
    assert advised.rmse_n == pytest.approx(NOISE_N, rel=0.1)
    assert fit.rmse_n > 1.25 * advised.rmse_n
    promised = float(sentence.partition("better: ")[2].split()[0])
    # The promise is of the cycles that the search compares.
    assert promised == pytest.approx(advised.fit_percent, abs=0.1)
    assert not advice(advised)


@pytest.mark.parametrize("varying", [False, True])
def test_laws_through_logarithms_that_describe_the_tests_are_not_doubted(varying: bool) -> None:
    logarithms = "values:0,0.75,1.5"
    fit = fit_of(CURVED, logarithms, logarithms, varying=varying)
    assert fit.rmse_n == pytest.approx(NOISE_N, rel=0.1)
    assert not advice(fit)
