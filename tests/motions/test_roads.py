"""Roads under a vehicle: splines through heights, classes of ISO 8608, files, and what is doubtful of them."""

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from quarter_car import BODY, CAR, DASHPOT, ROAD, SPRING, TYRE, TYRE_DASHPOT, WHEEL, quarter_car
from refusals import refusal
from scipy.integrate import solve_ivp

import mrwork as mr
from mrwork.base.values import Floats
from mrwork.errors import MistakesError
from mrwork.motions import iso_8608_road, read_road, road_motion

DT = 1e-3
TIME = DT * np.arange(1501)


def bump(time: Floats) -> Floats:
    """A cosine of 50 mm and 0.3 s, from 0.2 s on."""
    inside = (time > 0.2) & (time < 0.5)
    return np.where(inside, 0.025 * (1.0 - np.cos(2.0 * np.pi * (time - 0.2) / 0.3)), 0.0)


def test_displacement_of_a_road_is_its_heights_less_the_first() -> None:
    heights = 0.3 + 0.02 * np.sin(7.0 * TIME**2)
    np.testing.assert_allclose(road_motion(heights, DT).displacement, heights - heights[0], atol=1e-10)


def test_a_quarter_car_on_a_bump_is_as_in_absolute_coordinates() -> None:
    f_c, v_s, c0 = 400.0, 0.01, 800.0

    def slopes(t: float, y: Floats) -> list[float]:
        wheel, body, v_wheel, v_body = y
        phase = 2.0 * np.pi * (t - 0.2) / 0.3
        inside = 0.2 < t < 0.5
        road = 0.025 * (1.0 - np.cos(phase)) if inside else 0.0
        rise = 0.025 * 2.0 * np.pi / 0.3 * np.sin(phase) if inside else 0.0
        rate = v_body - v_wheel
        strut = SPRING * (body - wheel) + DASHPOT * rate + f_c * np.tanh(rate / v_s) + c0 * rate
        tyre = TYRE * (road - wheel) + TYRE_DASHPOT * (rise - v_wheel)
        return [v_wheel, v_body, (tyre + strut) / WHEEL, -strut / BODY]

    own = solve_ivp(
        slopes, (0.0, 1.5), np.zeros(4), method="DOP853", rtol=1e-9, atol=1e-12, max_step=DT, t_eval=TIME
    )
    wheel, body = own.y[:2]
    acceleration = np.array([slopes(t, y)[3] for t, y in zip(TIME, own.y.T, strict=True)])
    building = quarter_car()
    damper = mr.Device(
        name="strut", spec=mr.damper("bingham"), theta=[f_c, v_s, c0, 0.0], row=building.storeys[1]
    )
    runs = mr.simulate_loop(
        building,
        [damper],
        mr.ControlLaw(name="passive", gains={"command": [0.0]}),
        [road_motion(bump(TIME), DT)],
        mr.Hardware(sample_time=DT),
        histories=True,
    )
    # The spline of a bump whose curvature jumps at its ends is off by 1e-4 of it.
    drift = runs.histories[0].drift
    np.testing.assert_allclose(drift[:, 0], wheel - bump(TIME), atol=3e-4 * np.abs(wheel - bump(TIME)).max())
    np.testing.assert_allclose(drift[:, 1], body - wheel, atol=3e-4 * np.abs(body - wheel).max())
    assert runs.peak_acceleration.ravel()[1] == pytest.approx(np.abs(acceleration).max(), rel=3e-4)
    # The force of a tyre on the road is the sum of mass times absolute acceleration.
    inertia = runs.histories[0].acceleration @ np.array([WHEEL, BODY])
    assert runs.peak_base_shear.ravel()[0] == pytest.approx(np.abs(inertia).max(), rel=3e-4)


def test_the_mean_periodogram_of_a_class_is_its_density() -> None:
    speed, dt, density = 20.0, 0.005, 0.0
    for seed in range(20):
        road = iso_8608_road("C", speed=speed, rng=seed, duration=61.0, dt=dt).displacement[200:]
        window = np.hanning(road.size)
        spectrum = np.fft.rfft((road - road.mean()) * window)
        density = density + 2.0 * np.abs(spectrum) ** 2 / (window @ window) * speed * dt / 20
    n = np.fft.rfftfreq(road.size, speed * dt)
    of_class = 256e-6 * (np.maximum(n, 1e-3) / 0.1) ** -2
    edges = np.geomspace(0.015, 2.7, 11)
    for least, most in pairwise(edges):
        inside = (n >= least) & (n < most)
        assert np.mean(density[inside] / of_class[inside]) == pytest.approx(1.0, abs=0.1)


def test_a_class_is_twice_as_high_as_the_one_before() -> None:
    one, other = (iso_8608_road(name, speed=10.0, rng=3, duration=2.0) for name in ("B", "C"))
    np.testing.assert_allclose(other.acceleration, 2.0 * one.acceleration, rtol=1e-9, atol=1e-9)
    refusal(iso_8608_road, "C", speed=20.0, rng=1, dt=0.01, match="give a `dt` below 0.0088 s")


def written(path: Path, heading: str, *columns: Floats) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=heading, comments="")
    return path


def test_distances_at_a_speed_are_times(tmp_path: Path) -> None:
    heights = bump(TIME)
    distances = written(tmp_path / "a.csv", "distance (m),height (mm)", 20.0 * TIME, 1e3 * heights)
    times = written(tmp_path / "b.csv", "t_s,road", TIME, heights)
    nameless = written(tmp_path / "c.csv", "", 20.0 * TIME, heights)
    alone = written(tmp_path / "d.csv", "z_mm", 1e3 * heights)
    roads = [
        read_road(distances, speed=20.0),
        read_road(times, unit="m"),
        read_road(nameless, speed="72 km/h", unit="m"),  # type: ignore[arg-type]
        read_road(alone, dt=DT),
    ]
    for road in roads:
        assert road.is_road
        assert road.dt == pytest.approx(DT)
        np.testing.assert_allclose(road.displacement, heights, atol=1e-9)


@pytest.mark.parametrize(
    ("heading", "options", "match"),
    [
        ("distance_m,height_mm", {}, "give it, as speed"),
        ("distance_m,height_mm", {"dt": 0.01}, "give it, as speed"),
        (
            "t_s,height_mm",
            {"speed": 20.0},
            "holds times, and `speed` is for heights over distances; leave it out",
        ),
        ("t_s,height_mm", {"dt": 0.01}, "leave out `dt`"),
        ("t_s,height", {}, 'give it as here: unit="mm"'),
        ("t_s,height_mm", {"unit": "m"}, "states mm; leave it out"),
        ("t_s,left,right", {}, "which column is the height"),
        ("t_s,a_g", {}, "is an acceleration"),
        ("left_mm,height_mm", {}, "no column is time"),
        ("left_mm,height_mm", {"speed": 20.0}, "no column of distances"),
        ("", {"unit": "mm"}, "distances or times"),
    ],
)
def test_a_road_whose_meaning_is_open_is_asked_about(
    tmp_path: Path, heading: str, options: dict[str, Any], match: str
) -> None:
    columns = [TIME] * max(heading.count(",") + 1, 2)
    refusal(read_road, written(tmp_path / "road.csv", heading, *columns), match=match, **options)


def test_uneven_distances_are_refused_with_their_line(tmp_path: Path) -> None:
    along = np.arange(20.0)
    along[7] += 0.4
    path = written(tmp_path / "road.csv", "distance_m,height_m", along, np.zeros(20))
    refusal(read_road, path, speed=10.0, match=r"road\.csv.*line 9: a step of 1\.4 where others are 1;")
    along[7] = 3.0
    written(path, "distance_m,height_m", along, np.zeros(20))
    refusal(read_road, path, speed=10.0, match=r"line 9: distance goes from 6 to 3 m; sort")
    written(path, "distance_m,height_m", np.arange(20.0), np.where(np.arange(20) == 4, np.nan, 0.0))
    refusal(read_road, path, speed=10.0, match=r"line 6: the height is no finite number")


def test_a_displacement_is_pointed_to_the_road(tmp_path: Path) -> None:
    path = written(tmp_path / "road.csv", "t_s,height_mm", TIME, bump(TIME))
    refusal(mr.read_motion, path, match="'height_mm' is a displacement.*read_road")
    refusal(mr.read_motion, path, unit="g", column="2", match="'height_mm' is a displacement.*read_road")


def codes(road: mr.GroundMotion) -> list[str]:
    return [remark.code for remark in road.remarks]


def test_what_is_doubtful_of_a_road_is_told_and_its_size_is_not() -> None:
    rough = iso_8608_road("E", speed=20.0, rng=1, duration=3.0)
    assert rough.peak > 200.0
    assert codes(rough) == []
    assert codes(road_motion(bump(TIME), DT)) == []
    assert codes(road_motion(np.where(TIME > 0.5, 0.05, 0.0), DT)) == ["road_kerb"]
    assert codes(road_motion(0.02 * 20.0 * TIME, DT)) == ["road_slope"]
    assert codes(road_motion(np.where(TIME > 0.5, 0.0, bump(TIME))[::10], 0.01)) == ["road_coarse"]
    assert codes(road_motion(1e3 * bump(TIME), DT)) == ["road_steep"]


def test_a_study_of_a_road_is_written_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    written(tmp_path / "bump.csv", "distance_m,height_mm", 20.0 * TIME, 1e3 * bump(TIME))
    own = '[[motion]]\nroad = "bump.csv"\nspeed = "72 km/h"\nfactor = 0.5\nrest = 0.5\nname = "half a bump"\n'
    path.write_text(f"{CAR}{ROAD}{own}")
    study = mr.read_study(path)
    assert [motion.is_road for motion in study.grounds] == [True, True]
    assert [motion.name for motion in study.grounds] == ["ISO 8608 class C, 20 m/s", "half a bump"]
    assert study.grounds[0].peak > 200.0
    assert study.grounds[1].displacement.max() == pytest.approx(0.025, rel=1e-6)
    # As a value, its samples are written.
    given = mr.study_of(building=quarter_car(), motions=[study.grounds[0]])
    again = mr.read_study(given.to_toml(tmp_path / "again.toml"))
    assert again.grounds[0].is_road
    np.testing.assert_array_equal(again.grounds[0].acceleration, study.grounds[0].acceleration)


@pytest.mark.parametrize(
    ("line", "match"),
    [
        ("pga = 3.0", "pga is a level of earthquakes, and a road has none"),
        ("baseline = 1", "baseline is of records"),
        ("start = 1.0", "start would tilt the road"),
        ("time_scale = 2.0", "give another speed"),
        ("soil = { frequency = 10.0, damping = 0.4 }", "soil is of filtered noise"),
    ],
)
def test_keys_of_earthquakes_are_refused_on_roads(tmp_path: Path, line: str, match: str) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f"{CAR}{ROAD}{line}\n")
    refusal(mr.read_study, path, match=match)


def test_a_target_of_earthquakes_is_refused_beside_a_road(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f'{CAR}{ROAD}\n[target]\ncode = "en_1998"\na_g = "0.2 g"\nground = "B"\n')
    refusal(mr.read_study, path, match="target.*is a road")


@pytest.mark.parametrize(
    ("motion", "match"),
    [
        ('synthetic = "iso_8608"\nspeed = 20.0', "has no road_class"),
        ('synthetic = "iso_8608"\nroad_class = "C"', "has no speed"),
        ('synthetic = "kanai_tajimi"\nspeed = 20.0', "speed is of roads"),
        ('synthetic = "kanai_tajimi"\nroad_class = "C"', "is of a synthetic road"),
        ('synthetic = "iso_8608"\nroad_class = "J"\nspeed = 20.0', "road_class"),
        ('synthetic = "iso_8608"\nroad_class = "C"\nspeed = 0.0', "speed"),
        ('road = "none.csv"\nspeed = 20.0', "none.csv"),
    ],
)
def test_a_road_without_its_keys_is_refused(tmp_path: Path, motion: str, match: str) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f"{CAR}[[motion]]\n{motion}\n")
    refusal(mr.read_study, path, match=match)


@pytest.mark.parametrize(
    ("motion", "match"),
    [
        ('road_class = "C"\nspeed = 20.0\nduration = 9', "a random road has no synthetic; give all three"),
        ('road_class = "C"', "a random road has no synthetic and no speed"),
        ("speed = 20.0\nseed = 1", 'needs a file.*its speed is of a road, or of synthetic = "iso_8608"'),
        ("duration = 9\nseed = 1", "needs a file.*beside one of the others$"),
    ],
)
def test_where_nothing_says_what_moves_no_key_is_to_be_left_out(
    tmp_path: Path, motion: str, match: str
) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f"{CAR}[[motion]]\n{motion}\n")
    told = refusal(mr.read_study, path, match=match)
    assert not isinstance(told, MistakesError)


def test_the_class_and_the_speed_of_a_road_that_is_none_have_one_remedy(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f'{CAR}[[motion]]\nsynthetic = "kanai_tajimi"\nroad_class = "C"\nspeed = 20.0\n')
    told = refusal(mr.read_study, path, match="road_class is of a synthetic road")
    assert isinstance(told, MistakesError)
    assert all('or give synthetic = "iso_8608"' in str(each) for each in told.mistakes)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda road: mr.motions.trimmed(road, start=0.5), "begins level, and the part from a later start"),
        (lambda road: mr.motions.time_scaled(road, 0.5), "another time axis changes the heights"),
        (lambda road: mr.motions.baseline_corrected(road, order=1), "no drift of a baseline"),
    ],
)
def test_a_road_is_not_made_another_by_what_is_done_to_accelerograms(
    change: Callable[[mr.motions.GroundMotion], object], says: str
) -> None:
    road = road_motion(bump(TIME), DT)
    refusal(change, road, match=says)
    # Its end may be cut.
    assert mr.motions.trimmed(road, end=0.5).is_road


def test_forces_alone_have_no_response_spectrum() -> None:
    wind = mr.motions.force_motion(np.ones((2, 100)), 0.01)
    refusal(mr.motions.response_spectrum, wind, [0.5], match="a response spectrum is of ground accelerations")
