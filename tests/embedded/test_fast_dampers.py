"""A printed damper beyond its test: right up to what is believed, held and counted beyond; healed, retuned, bridged."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fmu_instances import Instance, Unpacked
from printed_dampers import Floats, PrintedDamper, integrated, noise, sine

import mrwork as mr
from mrwork.dampers.tested_range import OperatingRange
from mrwork.embedded.c_source import Flavour
from mrwork.embedded.damper_c import damper_source
from mrwork.embedded.fmu import FMIVersion, c_compiler, fmu_of

TESTED = OperatingRange(
    stroke=0.01, velocity=0.08, frequency=None, command=(0.0, 1.2), command_unit="A", force=1e3, power=1.0
)
WITH_STATES = [each["name"] for each in mr._rust.damper_specs() if each["n_states"]]
# Bits of a word of status, as the head lists them.
LIMITED, OUTSIDE, HEALED, MISSED, REFUSED = 1, 4, 8, 16, 32
DISPLACEMENT, VELOCITY, COMMAND = 256, 512, 1024


def printed(
    model: str, folder: Path, sample_time: float = 1e-3, theta: Floats | None = None
) -> PrintedDamper:
    spec = mr.damper(model)
    values = np.array(spec.nominal) if theta is None else theta
    source = damper_source("damper", spec, values, TESTED, Flavour(), sample_time=sample_time)
    return PrintedDamper(source, folder)


def of_bouc_wen(theta: Floats) -> tuple[Callable[..., Floats], Callable[..., float]]:
    c, k, x0, k_w, rho, sigma, n = theta.tolist()

    def rate(state: Floats, _: float, v: float) -> Floats:
        w = state[0]
        return rho * np.array([v - sigma * abs(v) * abs(w) ** (n - 1) * w + (sigma - 1) * v * abs(w) ** n])

    return rate, lambda state, x, v: c * v + k * (x - x0) + k_w * float(state[0])


def of_lugre(theta: Floats) -> tuple[Callable[..., Floats], Callable[..., float]]:
    named = dict(zip(mr.damper("lugre").names, theta.tolist(), strict=True))

    def rate(state: Floats, _: float, v: float) -> Floats:
        return np.array([v - named["a0"] * abs(v) * state[0]])

    def force(state: Floats, x: float, v: float) -> float:
        bristles = named["sigma_0"] * state[0] + named["sigma_1"] * rate(state, x, v)[0]
        return float(bristles + named["sigma_2"] * v + named["f0"])

    return rate, force


def of_elasto_visco_plastic(theta: Floats) -> tuple[Callable[..., Floats], Callable[..., float]]:
    f_y, v_r, c, rho, r, k, f0 = theta.tolist()

    def flow(u: float) -> float:
        return float(f_y * np.tanh(u / v_r) + c * u)

    def rate(state: Floats, _: float, v: float) -> Floats:
        u = state[0]
        # 1/cosh^2, which overflows far from yield.
        slope = 4.0 * f_y / v_r * np.exp(-2.0 * abs(u) / v_r) / (1.0 + np.exp(-2.0 * abs(u) / v_r)) ** 2 + c
        return np.array([(rho * f_y * (v - u) - r * flow(u)) / slope])

    return rate, lambda state, x, v: flow(float(state[0])) + k * x + f0


OWN = {
    "normalised_bouc_wen": of_bouc_wen,
    "lugre": of_lugre,
    "elasto_visco_plastic": of_elasto_visco_plastic,
}


@pytest.mark.parametrize("model", OWN)
def test_a_force_is_right_up_to_the_velocity_that_is_believed(model: str, tmp_path: Path) -> None:
    damper = printed(model, tmp_path)
    rate, force = OWN[model](np.array(mr.damper(model).nominal))
    most = damper.limits[1]
    for multiple in (1.0, 2.0, 2.6, 5.2, 9.8):
        speed = min(multiple * TESTED.velocity, 0.999 * most)
        motion = sine(speed, 5.0, 1e-3, 240)
        exact = integrated(rate, force, 1, motion, 1e-3, finer=100)
        found = damper.run(motion)
        off = np.abs(found.force - exact).max() / np.abs(exact).max()
        assert off < 5e-3, (multiple, off)
        assert found.replaced == 0


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_co_simulation_is_right_up_to_the_velocity_that_is_believed(
    version: FMIVersion, tmp_path: Path
) -> None:
    """Steps of a millisecond at the mean velocity, against small steps of our own along the same motion."""
    if (compiler := c_compiler()) is None:
        pytest.skip("this machine has no C compiler")
    spec = mr.damper("normalised_bouc_wen")
    theta = np.array(spec.nominal)
    source = damper_source("damper", spec, theta, TESTED, Flavour(), sample_time=1e-3)
    unpacked = Unpacked(fmu_of(source, version, compiler), tmp_path)
    rate, force = of_bouc_wen(theta)
    for multiple in (1.0, 2.6, 5.2, 9.8):
        x, v, _ = sine(multiple * TESTED.velocity, 5.0, 1e-3, 240)
        fmu, state = Instance(unpacked, velocity=0.0), np.zeros(1)
        found, exact = [], []
        for sample in range(239):
            mean = 0.5 * (v[sample] + v[sample + 1])
            assert fmu.set({"displacement": x[sample], "velocity": mean}) == 0
            assert fmu.step(1e-3 * sample, 1e-3) == 0
            found.append(fmu.get("force")[0])
            # Implicit steps, which no speed makes unstable.
            for _ in range(40):
                after = state
                for _ in range(6):
                    after = state + 2.5e-5 * rate(0.5 * (state + after), 0.0, mean)
                state = after
            exact.append(force(state, x[sample] + 1e-3 * mean, mean))
        off = np.abs(np.subtract(found, exact)).max() / np.abs(exact).max()
        assert off < 5e-3, (multiple, off)


@pytest.mark.parametrize("sample_time", [1e-3, 2e-3, 5e-3])
@pytest.mark.parametrize("model", WITH_STATES)
def test_every_model_is_right_or_says_that_it_is_not(model: str, sample_time: float, tmp_path: Path) -> None:
    damper = printed(model, tmp_path, sample_time)
    spec, most = mr.damper(model), damper.limits[1]
    theta = np.array(spec.nominal)
    for multiple in (1.0, 3.0, 6.0, 9.5):
        speed = multiple * TESTED.velocity
        for motion in (
            sine(speed, 4.0 / sample_time * 1e-3, sample_time, 200, 0.6),
            noise(speed, sample_time, 200, 0.6),
        ):
            found = damper.run(motion)
            if speed > most or found.replaced:
                assert found.replaced > 0
                assert np.any(found.status & (VELOCITY | DISPLACEMENT))
                assert np.isfinite(found.force).all()
                continue
            laws = [*map(str, spec.laws)], spec.n_rates
            exact = mr._rust.straight_forces(spec.core_name, theta, *motion, sample_time, 4096, *laws)
            off = np.abs(found.force - exact).max() / np.abs(exact).max()
            assert off < 5e-3, (multiple, off)


def test_beyond_what_is_believed_a_velocity_is_held_and_counted(tmp_path: Path) -> None:
    damper = printed("bouc_wen", tmp_path)
    most = damper.limits[1]
    within, beyond = (damper.run(sine(times * most, 2.0, 1e-3, 300)) for times in (0.999, 30.0))
    assert within.replaced == 0
    assert beyond.replaced > 200
    assert np.count_nonzero(beyond.status & OUTSIDE) > 280
    assert np.abs(beyond.force).max() < 1.1 * np.abs(within.force).max() + 2500.0 * damper.limits[0]


@pytest.mark.parametrize("model", ["normalised_bouc_wen", "modified_bouc_wen", "dahl", "lugre", "maxwell"])
@pytest.mark.parametrize("row", [0, 1])
def test_one_wild_sample_gives_no_wild_force(model: str, row: int, tmp_path: Path) -> None:
    damper = printed(model, tmp_path)
    motion = sine(0.06, 2.0, 1e-3, 300)
    right = damper.run(motion)
    for wild in (-0.2, -0.4, -0.6, -0.7, -0.76, 0.3, 0.76, 5.0, 1e300, np.nan, np.inf):
        spoiled = motion.copy()
        spoiled[row, 100] = wild
        found = damper.run(spoiled)
        assert found.replaced == 1
        assert found.status[100] & (VELOCITY if row else DISPLACEMENT)
        off = np.abs(found.force - right.force).max() / np.abs(right.force).max()
        assert off < 0.05, (wild, off)


def test_a_velocity_that_jumps_and_stays_is_believed_at_its_second_sample(tmp_path: Path) -> None:
    damper = printed("normalised_bouc_wen", tmp_path)
    motion = np.zeros((3, 40))
    motion[1, 10:] = 0.5
    motion[0, 10:] = 0.5e-3 * np.arange(30)
    found = damper.run(motion)
    assert found.replaced == 1
    assert found.force[9:11].max() < 100.0 < found.force[11]


def test_a_state_that_is_no_number_is_healed_and_counted(tmp_path: Path) -> None:
    damper = printed("normalised_modified_bouc_wen", tmp_path)
    motion = sine(0.06, 2.0, 1e-3, 400)
    right = damper.run(motion).force
    for entry, value in ((0, np.nan), (1, np.inf), (-1, np.nan)):
        damper.begin()
        damper.drive(motion[:, :100])
        damper.library.spoil(entry, value)
        found = damper.drive(motion[:, 100:])
        assert np.isfinite(found.force).all()
        assert found.status[0] & HEALED
        assert not np.any(found.status[1:] & HEALED)
        assert damper.library.healed() == 1
        # It has forgotten where it was, and is right again when the loop has been passed.
        assert np.abs(found.force[200:] - right[300:]).max() < 0.02 * np.abs(right).max()


def test_missed_samples_are_bridged(tmp_path: Path) -> None:
    damper = printed("normalised_bouc_wen", tmp_path)
    motion = sine(0.076, 5.0, 1e-3, 2000)
    right = damper.run(motion).force
    largest, rng = np.abs(right).max(), np.random.default_rng(1)
    for count in (1, 2, 5, 20):
        kept = np.ones(2000, dtype=bool)
        for first in rng.integers(50, 1900, 10):
            kept[first : first + count] = False
        missed = np.diff(np.flatnonzero(kept), prepend=-1) - 1
        damper.begin()
        found = damper.drive(motion[:, kept], missed)
        assert np.all((found.status & MISSED != 0) == (missed > 0))
        damper.begin()
        silent = damper.drive(motion[:, kept]).force
        off, unsaid = (np.abs(each - right[kept]).max() / largest for each in (found.force, silent))
        # A straight line over 20 ms of a sine of 5 Hz cuts a twentieth of its size.
        assert off < (0.02 if count < 20 else 0.15)
        assert off < unsaid or count < 5


def test_parameters_change_while_it_runs_and_its_state_stays(tmp_path: Path) -> None:
    damper, spec = printed("normalised_bouc_wen", tmp_path), mr.damper("normalised_bouc_wen")
    motion = sine(0.06, 2.0, 1e-3, 300)
    right = damper.run(motion).force
    damper.begin()
    damper.drive(motion[:, :200])
    place = spec.names.index("k_w")
    assert damper.library.retune(place, 1.5 * spec.nominal[place]) == 0
    changed = damper.drive(motion[:, 200:])
    # The state does not depend on k_w, and the force by what it adds.
    k_w = spec.nominal[place]
    named = dict(zip(spec.names, spec.nominal, strict=True))
    loop = right[200:] - named["c"] * motion[1, 200:] - named["k"] * (motion[0, 200:] - named["x0"])
    np.testing.assert_allclose(changed.force, right[200:] + 0.5 * loop, rtol=1e-9)
    assert np.abs(loop).max() > 0.9 * k_w
    # Three times as stiff a loop wants other sub-steps.
    stiff = spec.names.index("rho")
    assert damper.library.retune(stiff, 3.0 * spec.nominal[stiff]) == 1
    assert damper.library.retune(stiff, 0.7 * spec.nominal[stiff]) == 0
    for wrong in (np.nan, np.inf):
        assert damper.library.retune(place, wrong) == 1
    again = damper.drive(motion[:, -1:])
    assert np.isfinite(again.force).all()


def test_a_command_beyond_the_tests_is_held_and_said(tmp_path: Path) -> None:
    spec = mr.damper("normalised_bouc_wen").with_current_laws({"k_w": "linear"})
    theta = np.array([parameter.nominal for parameter in spec.parameters])
    source = damper_source("damper", spec, theta, TESTED, Flavour(), sample_time=1e-3)
    damper = PrintedDamper(source, tmp_path)
    motion = sine(0.06, 2.0, 1e-3, 100, 1.2)
    right = damper.run(motion)
    motion[2, 50:] = 1e9
    found = damper.run(motion)
    np.testing.assert_array_equal(found.force, right.force)
    assert np.all(found.status[50:] & (LIMITED | COMMAND) == LIMITED | COMMAND)
    assert not np.any(found.status[:50])


def test_the_age_of_a_reading_counts_its_samples(tmp_path: Path) -> None:
    damper = printed("dahl", tmp_path)
    motion = sine(0.06, 2.0, 1e-3, 100)
    motion[0, 60:90] = np.nan
    damper.begin()
    damper.drive(motion[:, :90])
    assert [damper.library.age(which) for which in range(3)] == [30.0, 0.0, 0.0]
    damper.drive(motion[:, 90:])
    assert damper.library.age(0) == 0.0
