"""A varying command is a channel of the test: it is cut, decimated and resampled with the others, and stays held."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from record_files import AMPLITUDE, FREQUENCY, clean_columns, codes, write_text
from refusals import refusal

import mrwork as mr
from mrwork.dampers.command import Command, is_stepped, levels_of_command
from mrwork.identification.excerpts import excerpt, varied_excerpt
from mrwork.records import DamperTest, cut, read_damper_test, repair
from mrwork.records.remarks import find_mislabelled

DT = 1e-3
N_TIME = 4000
TIME = DT * np.arange(N_TIME)
SWITCHING = np.where(TIME % 0.5 < 0.25, 0.0, 1.0)
SMOOTH = 0.5 + 0.4 * np.sin(2.0 * np.pi * 0.7 * TIME)


def built(
    current: NDArray[np.float64] | float, time: NDArray[np.float64] = TIME, voltage: float | None = None
) -> DamperTest:
    omega = 2.0 * np.pi * 2.0
    return mr.test_from_arrays(
        name="rig",
        time=time,
        displacement=0.01 * np.sin(omega * time),
        force=(200.0 + 800.0 * np.nanmean(current)) * np.tanh(30.0 * np.cos(omega * time))
        + 2e3 * np.cos(omega * time),
        current=current,
        voltage=voltage,
    )


@pytest.mark.parametrize("current", [SWITCHING, SMOOTH], ids=["switching", "smooth"])
def test_a_varying_command_is_kept_sample_by_sample(current: NDArray[np.float64]) -> None:
    test = built(current)
    assert isinstance(test.current, np.ndarray)
    np.testing.assert_array_equal(test.current, current)
    assert not test.current.flags.writeable
    (remark,) = [each for each in test.remarks if each.code == "command_varies"]
    assert remark.severity == "note"
    assert "--law" in remark.message


def test_a_negative_command_is_a_warning_and_one_beyond_any_driver_refused() -> None:
    for current in (-1.0, SMOOTH - 0.5):
        (remark,) = [each for each in built(current).remarks if each.code == "command_negative"]
        assert remark.severity == "warning"
        assert "give its magnitude" in remark.message
    # Noise about zero.
    noise = 0.004 * np.random.default_rng(3).standard_normal(N_TIME)
    assert "command_negative" not in codes(built(noise))
    refusal(built, 1e9, match="no driver gives more than 1000 A or V")


def ringing(
    damping: float, hold: float = 0.5, levels: tuple[float, ...] = (1.8, 0.6, 1.2, 0.0)
) -> NDArray[np.float64]:
    """A driver of second order, 14 Hz, that follows steps, with noise."""
    omega = 2.0 * np.pi * 14.0
    sent = np.array(levels)[(TIME / hold).astype(int) % len(levels)]
    command, position, rate = np.empty(N_TIME), sent[0], 0.0
    for index, wanted in enumerate(sent):
        command[index] = position
        rate += DT * (omega**2 * (wanted - position) - 2.0 * damping * omega * rate)
        position += DT * rate
    return command + 0.004 * np.random.default_rng(19).standard_normal(N_TIME)


@pytest.mark.parametrize("damping", [0.15, 0.25, 0.4])
def test_a_driver_that_rings_below_zero_is_zero_there_for_check_and_fit_alike(damping: float) -> None:
    measured = ringing(damping, levels=(1.8, 0.0))
    assert measured.min() < -0.4
    test = built(measured)
    assert {"command_rings", "command_varies"} <= set(codes(test))
    assert "command_negative" not in codes(test)
    np.testing.assert_array_equal(test.current, np.maximum(measured, 0.0))
    below = np.flatnonzero(measured < -0.2)
    assert np.intersect1d(below, np.arange(test.n_time)[test.counted]).size == 0
    assert test.n_counted > 0.6 * test.n_time
    # Nor is it refused where it is simulated, also as arrays of one's own.
    spec = mr.damper("bingham").with_current_laws({"f_c": "linear"})
    theta = np.where(spec.nominal == 0.0, 1.0, spec.nominal)
    motion = mr.Loading(dt=DT, displacement=test.displacement, command=measured, command_unit="A")
    whole = mr.simulate_force(spec, theta, motion)
    np.testing.assert_array_equal(
        whole, mr.simulate_force(spec, theta, replace(motion, command=test.current))
    )


def test_levels_of_a_driver_that_rings_are_those_at_which_it_stays() -> None:
    assert levels_of_command(ringing(0.2)) == pytest.approx((0.0, 0.6, 1.2, 1.8), abs=0.02)


@pytest.mark.parametrize(
    "current",
    [
        np.where(TIME % 0.5 < 0.25, -1.0, 1.0),
        # Held, if only once.
        np.where(TIME > 3.8, -1.0, SWITCHING),
        0.4 * np.sin(2.0 * np.pi * 0.7 * TIME),
        -ringing(0.4),
    ],
    ids=["both sides", "once", "sine", "ringing"],
)
def test_a_negative_command_is_no_ringing(current: NDArray[np.float64]) -> None:
    assert "command_negative" in codes(built(current))
    loading = mr.Loading(dt=DT, displacement=np.sin(TIME), command=current, command_unit="A")
    refusal(loading.history, match=f"down to {current.min():.6g}:")


def test_a_glitch_of_a_command_is_no_ringing_beyond_it() -> None:
    measured = ringing(0.4)
    measured[2000] = -5.0
    test = built(measured)
    assert "command_rings" in codes(test)
    assert np.min(np.asarray(test.current)) == 0.0


def test_a_pulse_shorter_than_a_hundredth_of_the_record_is_a_varying_command() -> None:
    pulse = np.where((TIME > 2.0) & (TIME < 2.03), 1.0, 0.0)
    assert built(pulse).has_varying_command
    spike = np.where(np.arange(N_TIME) == 2000, 1.0, 0.0)
    assert built(spike).current == 0.0


def test_steps_are_told_from_a_smooth_course() -> None:
    rng = np.random.default_rng(5)
    random_steps = np.repeat(rng.uniform(0.0, 1.0, 40), 100)
    assert is_stepped(SWITCHING)
    assert is_stepped(random_steps)
    assert is_stepped(random_steps + 0.004 * rng.standard_normal(N_TIME))
    assert not is_stepped(SMOOTH)


def test_decimation_makes_no_ramps_and_does_not_delay_the_switching() -> None:
    rng = np.random.default_rng(7)
    switches = np.sort(rng.choice(np.arange(20, N_TIME - 20), 200, replace=False))
    command = np.cumsum(np.isin(np.arange(N_TIME), switches)) % 2 * 1.0
    for every in (2, 5, 8):
        coarse = cut(built(command), every=every).current
        assert isinstance(coarse, np.ndarray)
        assert set(np.unique(coarse)) == {0.0, 1.0}
        # Held: integral of the command, with the standard error of switching times rounded to `every` samples.
        error = np.sqrt(switches.size / 12.0) * every
        assert every * coarse.sum() == pytest.approx(command.sum(), abs=4.0 * error + every)


def test_a_window_of_one_level_has_a_constant_command() -> None:
    test = built(SWITCHING)
    assert cut(test, start=1.25, end=1.5).current == 1.0
    both = cut(test, start=1.0, end=1.6)
    np.testing.assert_array_equal(both.current, SWITCHING[1000:1600])


def test_jitter_leaves_a_stepped_command_at_its_levels() -> None:
    rng = np.random.default_rng(11)
    time = TIME + 0.2 * DT * rng.uniform(-1.0, 1.0, N_TIME)
    stepped, smooth = built(SWITCHING, time), built(SMOOTH, time)
    assert "resampled" in codes(stepped)
    assert set(np.unique(stepped.current)) == {0.0, 1.0}
    expected = 0.5 + 0.4 * np.sin(2.0 * np.pi * 0.7 * smooth.time)
    # Linear interpolation: h^2/8 of the second derivative, and the samples moved by the jitter.
    np.testing.assert_allclose(smooth.current, expected, atol=0.4 * 0.3 * DT * 4.4)


def test_rows_without_a_command_are_dropped_at_the_ends_and_refused_between() -> None:
    late = SWITCHING.copy()
    late[:3] = np.nan
    assert built(late).n_time == N_TIME - 3
    hole = SWITCHING.copy()
    hole[100] = np.nan
    refusal(built, hole, match="sample 101 has no value for current")


def test_repairs_and_excerpts_keep_the_command_beside_the_motion() -> None:
    test = built(SWITCHING)
    shifted, _ = repair(test, [], amounts={"offset": 20.0})
    np.testing.assert_array_equal(shifted.current, SWITCHING)
    np.testing.assert_array_equal(shifted.displacement, test.displacement)
    whole = excerpt(test)
    assert whole.dt * whole.n_time == pytest.approx(test.dt * test.n_time)


def test_a_varying_command_gives_no_remark_on_cycles_that_differ_by_it() -> None:
    rising = built(np.where(TIME < 2.0, 0.0, 1.0))
    assert {"loop_drift", "force_delay", "moving_mass"}.isdisjoint(codes(rising))
    assert [*find_mislabelled([built(SWITCHING), *(built(0.5) for _ in range(3))])] == []


def test_a_command_in_time_with_the_motion_is_no_static_force() -> None:
    """Switched on in one direction of motion only, as control laws do."""
    outwards = built(np.where(np.cos(2.0 * np.pi * 2.0 * TIME) > 0.0, 1.0, 0.0))
    assert "force_offset" not in codes(outwards)
    unchanged, log = repair(outwards, ["offset"])
    np.testing.assert_array_equal(unchanged.force, outwards.force)
    assert log[0].code == "no_offset"
    assert repair(outwards, [], amounts={"offset": 50.0})[0].force[0] == outwards.force[0] - 50.0


def test_the_part_for_a_search_shows_every_level_in_less_than_half_of_the_record() -> None:
    time = 0.005 * np.arange(12_000)
    phases = np.random.default_rng(23).uniform(0.0, 2.0 * np.pi, 9)
    waves = np.array([np.sin(2.0 * np.pi * (0.5 + 0.2 * n) * time + phase) for n, phase in enumerate(phases)])
    displacement = 0.01 * waves.sum(axis=0)
    current = np.random.default_rng(24).permutation(np.resize((0.0, 0.6, 1.2, 1.8), 60))[time.astype(int)]
    force = (1.0 + current) * np.tanh(30.0 * np.gradient(displacement, time))
    long = mr.test_from_arrays(
        name="long", time=time, displacement=displacement, force=force, current=current
    )
    part = varied_excerpt(long)
    assert part.n_time * part.dt < 0.5 * long.n_time * long.dt
    assert levels_of_command(np.asarray(part.current)) == (0.0, 0.6, 1.2, 1.8)
    assert np.ptp(part.displacement) > 0.8 * np.ptp(long.displacement)
    # A level that the command has only once, at the end, is in it too, or the record is whole.
    once = replace(long, current=np.where(time > 50.0, 2.4, current))
    assert 2.4 in levels_of_command(np.asarray(varied_excerpt(once).current))
    # A test at a constant command is cut as any other.
    assert varied_excerpt(built(0.5)).n_time == excerpt(built(0.5)).n_time


def test_levels_of_a_stepped_command_are_those_without_noise() -> None:
    noisy = SWITCHING + 0.004 * np.random.default_rng(17).standard_normal(N_TIME)
    assert levels_of_command(noisy) == pytest.approx((0.0, 1.0), abs=1e-3)
    assert levels_of_command(0.5) == (0.5,)
    smooth = levels_of_command(SMOOTH)
    assert len(smooth) > 10
    assert (smooth[0], smooth[-1]) == pytest.approx((0.1, 0.9), abs=0.05)


def test_commands_are_the_same_sample_by_sample() -> None:
    half, switching = Command(0.5, "A"), Command(SWITCHING, "A")
    assert half.equals(Command(0.5, "A"))
    assert not half.equals(Command(0.5, "V"))
    assert not switching.equals(half)
    assert switching.equals(Command(SWITCHING.copy(), "A"))
    assert not switching.equals(Command(1.0 - SWITCHING, "A"))


@pytest.mark.parametrize("heading", ["current_A", "command [A]", "setpoint_a", "i_cmd"])
def test_a_file_with_a_column_of_the_command_is_read(tmp_path: Path, heading: str) -> None:
    columns = clean_columns()
    columns[heading] = np.where(np.sin(0.6 * np.pi * FREQUENCY * columns["t_s"]) > 0.0, 1.0, 0.2)
    path = write_text(tmp_path / "rig.csv", columns)
    extra = {"current": "i_cmd:A"} if heading == "i_cmd" else None
    test = read_damper_test(path, columns=extra)
    np.testing.assert_array_equal(test.current, columns[heading])
    assert test.displacement.max() == pytest.approx(AMPLITUDE, rel=1e-3)
    assert "0.2 to 1 A, stepped" in repr(test)
