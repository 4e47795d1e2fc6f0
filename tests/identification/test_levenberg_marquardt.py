"""All engines of the local minimisation reach the same minimum; what JAX has compiled is reused."""

import json
import os
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import own_dampers
import pytest
from command_line import ran

import mrwork as mr
from mrwork.identification.covariance import Covariance, Slopes, state_of
from mrwork.identification.equivalent import Form, identifiable_form
from mrwork.identification.minimise.by_optimistix import find_minimum_by_optimistix
from mrwork.identification.minimise.levenberg_marquardt import find_minima
from mrwork.identification.problem import Problem

LAWS = mr.damper("static_hysteretic").with_current_laws({"alpha": "linear"}, unit="A")
# Of the static model the switch of side is sharper than the data can tell.
SHARP = {"x_s": (1e-4, 1e-4)}


def record(
    spec: mr.DamperSpec, theta: np.ndarray, *, current: float | None = None, n_time: int = 900
) -> mr.DamperTest:
    """A test in two tones, with noise of 2 % in the force."""
    dt = 2e-3
    phase = 4.0 * np.pi * dt * np.arange(n_time)
    displacement = 0.01 * np.sin(phase) + 0.003 * np.sin(2.7 * phase)
    velocity = 4.0 * np.pi * (0.01 * np.cos(phase) + 0.0081 * np.cos(2.7 * phase))
    force = mr.simulate_force(
        spec,
        theta,
        mr.Loading(dt=dt, displacement=displacement, velocity=velocity, command=current, command_unit="A"),
    )
    noise = 0.02 * force.std() * np.random.default_rng(3).standard_normal(n_time)
    return replace(
        mr.synthetic_test("spencer1997"),
        name=f"at {current} A",
        dt=dt,
        displacement=displacement,
        velocity=velocity,
        force=force + noise,
        n_settle=100,
        current=current,
    )


def near(form: Form, theta: np.ndarray) -> np.ndarray:
    """A start some 10 % away, in the form that is identified."""
    inner = np.asarray(form.from_model(theta))
    away = inner * np.exp(0.1 * np.random.default_rng(1).standard_normal(inner.size))
    return np.asarray(form.box.inside(np.clip(away, form.box.lower, form.box.upper)))


def joint_theta() -> np.ndarray:
    """The nominal set, and half as much again of the hysteretic force per ampere."""
    values = dict(zip(mr.damper(LAWS.name).names, mr.damper(LAWS.name).nominal, strict=True))
    values |= {"alpha.0": values["alpha"], "alpha.1": 0.5 * values["alpha"]}
    return np.array([values[name] for name in LAWS.names])


def joint_tests() -> tuple[mr.DamperTest, ...]:
    """Two currents, one of the two tests shorter."""
    theta = joint_theta()
    return record(LAWS, theta, current=0.2), record(LAWS, theta, current=0.9, n_time=700)


def assert_one_minimum(objective: mr.identification.Objective, form: Form, start: np.ndarray) -> None:
    """All engines end at one misfit, and at parameters that differ by a small share of their standard errors."""
    lanes = find_minima(objective, form.box, start[None], max_iterations=100).best
    other = find_minimum_by_optimistix(objective, form.box, start)
    assert objective(start[None])[0] > 1.2 * lanes.misfit
    assert lanes.converged
    assert other.converged
    assert other.misfit == pytest.approx(lanes.misfit, rel=1e-6)
    errors = Covariance.of(Slopes.at(objective, form, lanes.theta)).standard_errors
    known = np.isfinite(errors)
    assert np.count_nonzero(known) >= len(form.box.free) - 1
    off = np.asarray(form.to_model(other.theta)) - np.asarray(form.to_model(lanes.theta))
    # A misfit larger by 1e-6 of itself leaves sqrt(2 n 1e-6) standard errors open, 0.04 of one for 800 samples.
    assert np.all(np.abs(off[known]) <= 0.05 * errors[known])


@pytest.mark.parametrize(
    "spec", [*map(mr.damper, ["bouc_wen", "static_hysteretic"]), own_dampers.guo], ids=lambda spec: spec.name
)
def test_all_engines_end_in_one_minimum(spec: mr.DamperSpec) -> None:
    form = identifiable_form(spec, SHARP if spec.name == "static_hysteretic" else {})
    objective = mr.identification.Objective.of(form.spec, (record(spec, spec.nominal),))
    assert_one_minimum(objective, form, near(form, spec.nominal))


def test_a_joint_fit_with_a_law_ends_in_one_minimum() -> None:
    form = identifiable_form(LAWS, SHARP)
    assert_one_minimum(mr.identification.Objective.of(LAWS, joint_tests()), form, near(form, joint_theta()))


def test_a_row_keeps_a_held_parameter_and_ends_where_a_fit_with_it_fixed_does() -> None:
    spec = mr.damper("static_hysteretic")
    form = identifiable_form(spec, SHARP)
    objective = mr.identification.Objective.of(spec, (record(spec, spec.nominal),))
    start = near(form, spec.nominal)
    index = form.box.free_names.index("alpha")
    held = np.zeros((2, len(form.box.free)), dtype=np.bool_)
    held[0, index] = True
    rows = find_minima(objective, form.box, np.stack([start, start]), max_iterations=100, held=held)
    value = float(start[form.box.free[index]])
    fixed = find_minima(
        objective, form.box.with_bounds({"alpha": (value, value)}), start[None], max_iterations=100
    )
    assert rows.theta[0, form.box.free[index]] == pytest.approx(value, rel=1e-12)
    assert rows.misfit[0] == pytest.approx(fixed.misfit[0], rel=1e-6)
    assert rows.misfit[1] < 0.9 * rows.misfit[0]


def test_all_engines_say_that_a_parameter_is_at_its_bound() -> None:
    spec = mr.damper("dahl")
    index = spec.names.index("rho")
    form = identifiable_form(spec, {"rho": (10.0, 0.5 * spec.nominal[index])})
    objective = mr.identification.Objective.of(spec, (record(spec, spec.nominal),))
    start = near(form, spec.nominal)
    lanes = find_minima(objective, form.box, start[None], max_iterations=100).best
    other = find_minimum_by_optimistix(objective, form.box, start)
    for theta in (lanes.theta, other.theta):
        states = [state_of(form, each, float(theta[each])) for each in range(len(theta))]
        assert [state for state in states if state] == ["at upper bound"]
        assert states[index] == "at upper bound"
    assert other.misfit == pytest.approx(lanes.misfit, rel=1e-6)


def test_observation_ties_and_exponent_are_those_of_every_engine() -> None:
    spec, observation = mr.damper("static_hysteretic"), mr.records.Observation(average_seconds=0.03)
    first, second = record(spec, spec.nominal), record(spec, 1.1 * spec.nominal, n_time=700)
    averaged = replace(first, force=observation.observe(first.force, first.dt), observation=observation)
    ratio = spec.nominal[spec.names.index("k")] / spec.nominal[spec.names.index("c")]
    settings = mr.identification.FitSettings(ties={"k": f"{ratio}*c"}, bounds=SHARP, force_exponent=0.5)
    problem = Problem.of(spec, (averaged, second), settings)
    assert_one_minimum(problem.objective, problem.form, near(problem.form, spec.nominal))


def test_optimistix_can_be_asked_for_and_finds_the_same() -> None:
    test = record(mr.damper("static_hysteretic"), mr.damper("static_hysteretic").nominal)
    lanes, other = (
        mr.identify("static_hysteretic", test, bounds=SHARP, engine=engine, rng=1)
        for engine in ("lanes", "optimistix")
    )
    assert other.provenance.settings["engine"] == "optimistix"
    assert other.nrmse == pytest.approx(lanes.nrmse, rel=1e-6)
    for ours, theirs in zip(lanes.estimates, other.estimates, strict=True):
        assert ours.standard_error is None or abs(ours.value - theirs.value) < 0.05 * ours.standard_error


# What was compiled, told by JAX itself.
COMPILED = """
import json
from collections import Counter
from dataclasses import replace
import jax
from mrwork.identification.objective import Objective
from mrwork.identification.minimise.by_optimistix import find_minimum_by_optimistix
from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import damper
from mrwork.records.reading import synthetic_test

told = Counter()
jax.monitoring.register_event_listener(lambda name, **_: told.update([name.rpartition("/")[2]]))
jax.monitoring.register_event_duration_secs_listener(lambda name, _, **__: told.update([name.rpartition("/")[2]]))
spec = damper("dahl")
test = synthetic_test("rd1005_1a")
for factor in (1.0, 1.1):
    other = replace(test, dt=factor * test.dt, force=factor * test.force)
    find_minimum_by_optimistix(Objective.of(spec, (other,)), Box.of(spec), factor * spec.nominal)
    print(json.dumps(told))
    told.clear()
"""


@pytest.mark.long
def test_a_model_is_compiled_once_and_found_again_by_the_next_process(tmp_path: Path) -> None:
    own = {name: value for name, value in os.environ.items() if "COMPILATION_CACHE" not in name}
    own |= {"XDG_CACHE_HOME": str(tmp_path), "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}

    def told() -> list[dict[str, int]]:
        result = ran(sys.executable, "-W", "error", "-c", COMPILED, env=own)
        assert (result.returncode, result.stderr) == (0, "")
        return [json.loads(line) for line in result.stdout.splitlines()]

    first, again = told()
    assert first["cache_misses"] > 0
    # Other data, another start and another sampling step: nothing is compiled.
    assert again == {}
    kept = {path.name for path in tmp_path.rglob("*-cache")}
    next_process, _ = told()
    assert next_process["cache_hits"] == next_process["compile_requests_use_cache"]
    assert {path.name for path in tmp_path.rglob("*-cache")} == kept
