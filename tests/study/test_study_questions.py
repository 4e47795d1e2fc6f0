"""What is asked about a study when it is read: coordinates, damping, units, keys without effect; or nothing."""

import json
from pathlib import Path

import numpy as np
import pytest
import tuning_samples
from command_line import mrwork
from refusals import refusal

import mrwork as mr
from mrwork import buildings
from mrwork.base.remark import Measured
from mrwork.study.reading import read_bare_building
from tools.faults.planted import sweep
from tools.faults.planted_studies import FAULTS, honest

ROOT = Path(__file__).parents[2]
MASS = "mass = [[1e5, 0, 0, 0], [0, 0.02, 0, 0], [0, 0, 1e5, 0], [0, 0, 0, 0.02]]"
BEAM = f"""{MASS}
stiffness = [[2.4e8, 0, -1.2e8, 1.8e8], [0, 7.2e8, -1.8e8, 1.8e8], [-1.2e8, -1.8e8, 1.2e8, -1.8e8],
  [1.8e8, 1.8e8, -1.8e8, 3.6e8]]
modal_damping = {{ ratios = [0.02] }}
"""
NAMED = "influence = [1, 0, 1, 0]\nfloors = [[1,0,0,0],[0,0,1,0]]\nstoreys = [[1,0,0,0],[-1,0,1,0]]\n"
FRAME = (
    "n_storeys = 2\nmasses = [5e4]\nstiffnesses = [6e7]\nheight = 3.2\nmodal_damping = { ratios = [0.02] }\n"
)
MOTION = '[[motion]]\nsynthetic = "kanai_tajimi"\nduration = 4.0\n'


def study(tmp_path: Path, building: str, more: str = "") -> mr.Study:
    """The study of a building, under a short motion."""
    path = tmp_path / "study.toml"
    path.write_text(f"[building]\n{building}\n{MOTION}{more}")
    return mr.read_study(path)


def test_rotations_with_their_influence_are_condensed_and_else_silent(tmp_path: Path) -> None:
    read = study(tmp_path, BEAM + NAMED)
    assert [remark.code for remark in read.remarks] == ["coordinates_condensed"]
    assert read.building.n_coordinates == 2
    assert study(tmp_path, BEAM + NAMED + "condense = false\n").remarks == ()


def condensed(n: int) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Stiffness of a cantilever that bends and shears, condensed to its floors."""
    i, j = np.meshgrid(np.arange(1.0, n + 1.0), np.arange(1.0, n + 1.0))
    low, high = np.minimum(i, j), np.maximum(i, j)
    return 1e7 * np.linalg.inv(low**2 * (3.0 * high - low) / 6.0 + 0.2 * low)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_a_condensed_frame_with_negative_forces_of_the_ground_is_silent(tmp_path: Path, n: int) -> None:
    """K r of a frame that bends is negative at some floors, which the sign of K r alone would take for rotations."""
    stiffness = condensed(n)
    assert (stiffness @ np.ones(n)).min() < 0.0
    given = f"mass = {(2e4 * np.eye(n)).tolist()}\nstiffness = {((stiffness + stiffness.T) / 2).tolist()}\n"
    assert study(tmp_path, f"{given}modal_damping = {{ ratios = [0.02] }}").remarks == ()


PULSE = "[[motion]]\nacceleration = [0, 0, 3, -3, 2, -2, 1]\ndt = 0.1\n"
DAMPED = "modal_damping = { ratios = [0.05] }\n"


def in_matrices(mass: np.ndarray, stiffness: np.ndarray, **rows: np.ndarray) -> str:
    given = {"mass": mass, "stiffness": stiffness, **rows}
    return "".join(f"{name} = {array.tolist()}\n" for name, array in given.items()) + DAMPED


def of_drifts(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Mass and stiffness of a chain in the coordinates of its drifts, and its floors, sums of drifts."""
    floors = np.tril(np.ones((n, n)))
    return floors.T @ np.diag(np.full(n, 25e3)) @ floors, np.diag(np.linspace(37.5e6, 25e6, n)), floors


@pytest.mark.parametrize("n", [2, 3, 5])
def test_coordinates_that_are_drifts_are_asked_about_by_their_masses(tmp_path: Path, n: int) -> None:
    mass, stiffness, floors = of_drifts(n)
    (said,) = study(tmp_path, in_matrices(mass, stiffness)).remarks
    assert (said.code, said.measured) == ("coordinates_relative", Measured(float(mass[0, 1]), "kg"))
    rows = {"floors": floors, "storeys": np.eye(n), "influence": np.eye(n)[0]}
    told = study(tmp_path, in_matrices(mass, stiffness, **rows))
    assert told.remarks == ()
    chain = f"masses = {[25e3] * n}\nstiffnesses = {np.diag(stiffness).tolist()}\n{DAMPED}"
    peaks = []
    for building in (in_matrices(mass, stiffness, **rows), chain):
        (tmp_path / "pulse.toml").write_text(f"[building]\n{building}\n{PULSE}")
        runs = mr.run_study(mr.read_study(tmp_path / "pulse.toml")).to_xarray()["criteria"].to_dataset()
        peaks.append([runs[name].values.max() for name in ("peak_drift", "peak_base_shear")])
    np.testing.assert_allclose(peaks[0], peaks[1], rtol=1e-9)
    if n == 2:
        # By an own program: 7.47 mm and 257 kN.
        np.testing.assert_allclose(peaks[0], (7.47e-3, 257e3), rtol=2e-3)


def test_a_part_relative_to_its_floor_is_asked_about_and_distributed_mass_is_not(tmp_path: Path) -> None:
    absorber = np.array([[1e5, 0.0, 0.0], [0.0, 1.01e5, 1e3], [0.0, 1e3, 1e3]])
    springs = np.array([[4e7, -2e7, 0.0], [-2e7, 2e7, 0.0], [0.0, 0.0, 5e4]])
    assert "coordinates_relative" in {
        said.code for said in study(tmp_path, in_matrices(absorber, springs)).remarks
    }
    # A shear beam of three elements whose mass is distributed.
    element = np.array([[2.0, 1.0], [1.0, 2.0]])
    beam = sum(np.pad(element, ((n, 2 - n), (n, 2 - n))) for n in range(3))
    spring = sum(np.pad(np.array([[1.0, -1.0], [-1.0, 1.0]]), ((n, 2 - n), (n, 2 - n))) for n in range(3))
    assert study(tmp_path, in_matrices(2e4 * beam[1:, 1:], 6e7 * spring[1:, 1:])).remarks == ()


def test_coordinates_of_a_baseline_are_asked_about_where_those_of_the_building_are_not(
    tmp_path: Path,
) -> None:
    mass, stiffness, _ = of_drifts(2)
    given = f"mass = {mass.tolist()}, stiffness = {stiffness.tolist()}"
    chain = in_matrices(np.diag(np.diag(mass)), np.array([[6e7, -2.5e7], [-2.5e7, 2.5e7]]))
    baseline = f'[[baseline]]\nlabel = "drifts"\nbuilding = {{ {given} }}\n'
    assert [said.code for said in study(tmp_path, chain, baseline).remarks] == ["coordinates_relative"]
    isolated = (
        '[[baseline]]\nlabel = "isolated"\nbuilding.isolation = { mass = 2e4, period = 2.0, ratio = 0.1 }\n'
    )
    assert study(tmp_path, chain, isolated).remarks == ()


def test_ordinary_isolation_is_silent(tmp_path: Path) -> None:
    one = "n_storeys = 1\nmasses = [2e5]\nstiffnesses = [1.5e8]\nmodal_damping = { ratios = [0.02] }\n"
    for period in (1.5, 3.0, 5.0):
        isolated = f'{one}isolation = {{ mass = "150 t", period = {period}, ratio = "15 %" }}\n'
        assert study(tmp_path, isolated).remarks == ()


@pytest.mark.parametrize("key", ["viscous", "yielding", "friction", "tuned_mass"])
def test_an_empty_list_of_a_baseline_takes_the_devices_of_the_building_out(tmp_path: Path, key: str) -> None:
    built = {
        "viscous": "storey = 1, damping = 4e5",
        "yielding": "storey = 1, yield_force = 1e5, yield_displacement = 0.004",
        "friction": "storey = 1, slip_load = 6e4, stiffness = 6e7",
        "tuned_mass": "floor = 2, mass_ratio = 0.02",
    }[key]
    baseline = f'[[baseline]]\nlabel = "bare"\nbuilding = {{ {key} = [] }}\n'
    plain = study(tmp_path, FRAME).building
    if key in ("viscous", "yielding", "friction"):
        made = study(tmp_path, f"{FRAME}{key} = [{{ {built} }}]\n", baseline)
        bare = next(each.building for each in made.arrangements if each.row.kind == "baseline")
        np.testing.assert_array_equal(bare.damping, plain.damping)
        np.testing.assert_array_equal(bare.stiffness, plain.stiffness)
        assert bare.elements == ()
        assert made.building.elements != ()
    else:
        refusal(study, tmp_path, f"{FRAME}{key} = [{{ {built} }}]\n", baseline, match="not remove them")


@pytest.mark.parametrize(
    "other", ["rayleigh = { ratios = [0.02, 0.02] }", "modal_damping = { ratios = [0.02] }"]
)
def test_damping_that_another_key_would_replace_is_refused(tmp_path: Path, other: str) -> None:
    chain = "masses = [5e4, 5e4]\nstiffnesses = [6e7, 6e7]\nstorey_damping = [1e4, 1e4]\n"
    matrix = "mass = [[5e4]]\nstiffness = [[6e7]]\ndamping = [[1e4]]\n"
    for given in (chain, matrix):
        refusal(study, tmp_path, given + other, match="both give the damping")


def test_a_baseline_without_p_delta_has_none(tmp_path: Path) -> None:
    baseline = '[[baseline]]\nlabel = "bare"\nbuilding = { p_delta = false }\n'
    made = study(tmp_path, f"{FRAME}p_delta = true\n", baseline)
    bare = next(each.building for each in made.arrangements if each.row.kind == "baseline")
    assert made.building.loads.any()
    assert not bare.loads.any()


def test_a_baseline_that_changes_nothing_is_told(tmp_path: Path) -> None:
    (said,) = study(tmp_path, FRAME, '[[baseline]]\nlabel = "same"\nbuilding = { viscous = [] }\n').remarks
    assert (said.code, said.words) == ("baseline_same", ("same",))


def test_a_stated_unit_is_trusted_ten_times_more(tmp_path: Path) -> None:
    (said,) = study(tmp_path, FRAME, "pga = 0.3\n").remarks
    assert (said.code, said.words[1], said.measured) == ("number_unusual", "pga", Measured(0.3, "m/s2"))
    assert 'write "0.3 g" if that is meant' in said.message
    assert study(tmp_path, FRAME, 'pga = "0.3 m/s2"\n').remarks == ()
    assert study(tmp_path, FRAME, 'pga = ["0.01 g", "0.3 g"]\n').remarks == ()


@pytest.mark.parametrize(
    ("target", "asked"),
    [
        ('code = "asce_7"\ns_ds = 0.75\ns_d1 = 0.45\nt_l = 8\n', {"s_ds": 0.75, "s_d1": 0.45}),
        ('code = "en_1998"\na_g = 0.3\nground = "B"\n', {"a_g": 0.3}),
        ("periods = [0, 0.1, 0.5, 2]\naccelerations = [0.3, 0.75, 0.7, 0.2]\n", {"accelerations": 0.75}),
        ('code = "asce_7"\ns_ds = "0.75 g"\ns_d1 = "0.45 g"\nt_l = 8\n', {}),
        ('code = "en_1998"\na_g = 3.0\nground = "B"\n', {}),
    ],
)
def test_numbers_of_codes_that_are_of_g_are_asked_about(
    tmp_path: Path, target: str, asked: dict[str, float]
) -> None:
    made = study(tmp_path, FRAME, f'scale_to = "least_squares"\n[target]\n{target}')
    said = [remark for remark in made.remarks if remark.code == "number_unusual"]
    assert {remark.words[1]: remark.measured for remark in said} == {
        name: Measured(value, "m/s2") for name, value in asked.items()
    }
    assert all(
        f'write "{value:g} g"' in remark.message for remark, value in zip(said, asked.values(), strict=True)
    )
    level = study(tmp_path, FRAME, "sa = 0.5\n").remarks
    assert [(each.code, each.words[1]) for each in level] == [("number_unusual", "sa")]


def test_two_dozen_planted_faults_are_told_and_honest_studies_are_silent() -> None:
    shares, asked = sweep(FAULTS, honest, 2 * len(FAULTS) + 2, 3)
    assert asked == []
    assert {kind: share for kind, share in shares.items() if share < 1.0} == {}


@pytest.mark.parametrize(
    "path",
    [each for each in sorted(ROOT.glob("studies/**/*.toml")) if "[building]" in each.read_text()],
    ids=str,
)
def test_buildings_of_every_study_are_silent(path: Path) -> None:
    assert read_bare_building(path).remarks == ()


@pytest.mark.parametrize("name", [each.name for each in buildings.buildings()])
def test_published_buildings_are_silent(name: str) -> None:
    assert mr.building(name).remarks == ()


# Damping


UNDAMPED = "frame: 2 of 2 modes have no damping; every damper looks better on a frame without damping"
BARE = 'name = "frame"\nmasses = [300.0, 300.0]\nstiffnesses = [4e5, 4e5]'


def undamped(tmp_path: Path) -> Path:
    """A study of a bare frame with one training motion, to be simulated or tuned."""
    return tuning_samples.study_file(tmp_path, building=BARE, tune=tuning_samples.TUNE.replace("16", "8"))


def test_respond_says_it_once_on_the_terminal_in_json_and_in_python(tmp_path: Path) -> None:
    path, out = undamped(tmp_path), tmp_path / "run"
    ended = mrwork("respond", path, "--out", out, "--quiet")
    assert " ".join((ended.stdout + ended.stderr).split()).count(UNDAMPED) == 1
    told = [remark.code for remark in mr.study.read_results(out).remarks]
    assert told.count("modes_undamped") == 1
    ended = mrwork("respond", path, "--out", out, "--quiet", "--json")
    assert [remark["code"] for remark in json.loads(ended.stdout)["remarks"]] == told


def test_an_undamped_baseline_is_said_where_the_building_is_damped(tmp_path: Path) -> None:
    other = '[[baseline]]\nlabel = "b"\nbuilding = { modal_damping = { ratios = [0.0] }, name = "another" }\n'
    for damping, name in (("modal_damping = { ratios = [0.01] }", "another"), ("", "frame")):
        said = study(tmp_path, f"{BARE}\n{damping}", other).remarks[0]
        assert (said.code, said.words) == ("modes_undamped", (name,))


def test_a_study_whose_building_has_negative_damping_ends_with_its_line(tmp_path: Path) -> None:
    flipped = "published = 'utfpr'\ndamping = [[-1.2, 0.3], [0.3, -0.3]]"
    refusal(study, tmp_path, flipped, match="line 1: .*2 of 2 modes have negative damping")
