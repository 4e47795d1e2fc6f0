"""Roads, ground motions and forces have one rule for headings, axes, units and matrices."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from refusals import refusal
from scipy.io import savemat

from mrwork.motions import GroundMotion, read_motion, read_road
from mrwork.motions.forces import read_forces

DT = 0.02
TIME = DT * np.arange(300)
DECAY = 0.7 * np.cos(6.0 * TIME) * np.exp(-0.3 * TIME)
READERS = {
    "road": (partial(read_road, unit="mm", dt=DT), lambda road: 1e3 * (road.displacement + 7e-4)),
    "ground": (partial(read_motion, unit="m/s2", dt=DT), lambda motion: motion.acceleration),
    "force": (
        partial(read_forces, floors=["deck"], shares=np.eye(1), unit="N", dt=DT),
        lambda motion: motion.forces[0],
    ),
}


@pytest.mark.filterwarnings("ignore:road:mrwork.errors.MrworkWarning")
@pytest.mark.parametrize(("read", "samples"), READERS.values(), ids=READERS)
@pytest.mark.parametrize("heading", ["", "# a hammer\n", "\n", "# a\n\n"])
@pytest.mark.parametrize("form", ["{:.4f}", "  {:.4f}", "{:.5e}", "{:+.4f}"])
def test_the_first_of_a_column_of_numbers_is_a_sample(
    tmp_path: Path,
    read: Callable[[Path], GroundMotion],
    samples: Callable[[GroundMotion], np.ndarray],
    heading: str,
    form: str,
) -> None:
    path = tmp_path / "a.txt"
    path.write_text(heading + "\n".join(form.format(value) for value in DECAY) + "\n")
    motion = read(path)
    assert (motion.n_time, motion.dt) == (TIME.size, DT)
    assert_allclose(samples(motion), DECAY, atol=1e-4)


@pytest.mark.parametrize("above", ["force (kN)\n", "Hammer test 3\nforce (kN)\n", "# of 2024\nforce (kN)\n"])
def test_the_heading_of_a_column_is_the_line_above_it(tmp_path: Path, above: str) -> None:
    path = tmp_path / "a.csv"
    path.write_text(above + "9.0\n4.0\n-1.0\n")
    motion = read_forces(path, ["deck"], shares=np.eye(1), unit=None, dt=DT)
    assert_allclose(motion.forces, [[9e3, 4e3, -1e3]])


def matlab(path: Path, **variables: object) -> Path:
    savemat(path, variables)
    return path


PUSH = np.array([[3.0], [5.0]]) * np.sin(4.0 * TIME)
FLOORS = ["first", "roof"]


@pytest.mark.parametrize("turned", [False, True])
def test_a_matrix_of_as_many_columns_as_floors_has_their_forces(tmp_path: Path, turned: bool) -> None:
    """Beside a vector of the same workspace, which is listed."""
    path = matlab(tmp_path / "wind.mat", t=TIME, Fwind=PUSH.T if turned else PUSH, U=TIME + 9.0)
    motion = read_forces(path, FLOORS, shares=None, unit="N")
    assert_allclose(motion.forces, PUSH, atol=1e-12)
    assert motion.dt == pytest.approx(DT)
    assert motion.source == "wind.mat; not used: 'U'"
    refusal(read_forces, path, FLOORS, shares=np.eye(2)[:, :1], unit="N", match="U, Fwind 1, Fwind 2")


def test_a_speed_of_the_wind_is_no_force(tmp_path: Path) -> None:
    path = matlab(tmp_path / "wind.mat", t=TIME, force=PUSH[0], wind_speed=TIME + 9.0)
    motion = read_forces(path, FLOORS, shares=np.eye(2)[:, :1], unit="N")
    assert_allclose(motion.forces[0], PUSH[0])
    assert motion.source == "wind.mat; not used: 'wind_speed'"
    table = tmp_path / "wind.csv"
    columns = np.column_stack([TIME, TIME + 9.0, PUSH[1]])
    np.savetxt(table, columns, delimiter=",", header="t_s,U (m/s),drag (N)", comments="")
    motion = read_forces(table, FLOORS, shares=np.eye(2)[:, 1:])
    assert_allclose(motion.forces[1], PUSH[1])
    assert motion.source == "wind.csv; not used: 'U (m/s)'"


def test_columns_of_a_matrix_are_listed_and_chosen_by_what_is_to_be_typed(tmp_path: Path) -> None:
    along = 0.05 * np.arange(400)
    rise = 0.01 * np.sin(along) * (1.0 - np.exp(-along))
    road = matlab(tmp_path / "road.mat", x=along, profile=np.column_stack([rise, rise + 0.001]))
    refusal(read_road, road, speed=20.0, unit="m", match=r"2 'profile 1', 3 'profile 2'.*: column=\"2\"$")
    heights = read_road(road, speed=20.0, unit="m", column="2").displacement
    assert_allclose(heights, rise - rise[0], atol=1e-9)
    quake = matlab(tmp_path / "quake.mat", t=along, acc=np.array([rise, 2.0 * rise]), note=1.0)
    refusal(read_motion, quake, unit="m/s2", match=r"3 'acc 1', 4 'acc 2'.*: column=\"3\"$")
    assert_allclose(read_motion(quake, unit="m/s2", column="acc 2").acceleration, 2.0 * rise)


@pytest.mark.parametrize(
    ("heading", "options", "match"),
    [
        ("t_s,a_mps2,acc_mps2", {}, 'column="2"$'),
        (
            "t_s,acceleration",
            {},
            r"unit=\"g\"; the unit may stand in the heading, as 'acceleration \(g\)', too$",
        ),
        ("acc_g,vertical_g", {"column": "1"}, r"the step, for no column is time.*: dt=0.01$"),
    ],
)
def test_what_is_open_is_asked_with_what_is_typed(
    tmp_path: Path, heading: str, options: dict[str, str], match: str
) -> None:
    path = tmp_path / "a.csv"
    columns = [TIME, DECAY, DECAY] if heading.startswith("t_s") else [DECAY, DECAY]
    columns = columns[: heading.count(",") + 1]
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=heading, comments="")
    refusal(read_motion, path, match=match, **options)


def test_a_step_beside_times_has_to_agree_with_them(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    rows = np.column_stack([TIME, DECAY])
    np.savetxt(path, rows, delimiter=",", header="t_s,roof (N)", comments="")
    assert read_forces(path, FLOORS, shares=None, dt=DT).n_time == TIME.size
    refusal(read_forces, path, FLOORS, shares=None, dt=2 * DT, match="step of 0.02 s where `dt` is 0.04 s")


def test_accelerations_of_floors_are_not_those_of_the_ground(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    columns = np.column_stack([TIME, DECAY, 2.0 * DECAY, 3.0 * DECAY])
    heading = "t_s,ground_accel_mps2,a1_mps2,a2_mps2"
    np.savetxt(path, columns, delimiter=",", header=heading, comments="")
    assert_allclose(read_motion(path).acceleration, DECAY)
