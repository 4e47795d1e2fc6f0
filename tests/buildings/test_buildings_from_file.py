"""Buildings are read correctly from TOML, .mat and text files; invalid ones are refused with their place."""

import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from matlab_files import append, object_of
from numpy.typing import NDArray
from refusals import refusal
from scipy.io import savemat

import mrwork as mr
from mrwork.base.documents import read_table
from mrwork.base.places import Place
from mrwork.buildings.from_file import BuildingTable

WORKSPACE = {
    "M": np.diag([2.0, 1.0]), "K": np.array([[5.0, -2.0], [-2.0, 2.0]]), "C": np.array([[0.5, -0.2], [-0.2, 0.2]]),
}  # fmt: skip
FIELDS = ("mass", "damping", "stiffness", "influence", "floors", "storeys")
MATRICES = """
mass = [[2.0, 0.0], [0.0, 1.0]]
stiffness = [[5.0, -2.0], [-2.0, 2.0]]
damping = [[0.5, -0.2], [-0.2, 0.2]]
"""
SHEAR = """
masses = [2.0, 1.0]
stiffnesses = [3.0, 2.0]
storey_damping = [0.3, 0.2]
"""


def stated(text: str, folder: Path = Path()) -> mr.Building:
    place = Place(origin="study.toml", path=("building",))
    with place.prefix_errors():
        return read_table(BuildingTable, tomllib.loads(text), place).build(folder)


def assert_same(ours: mr.Building, theirs: mr.Building) -> None:
    for field in FIELDS:
        np.testing.assert_allclose(getattr(ours, field), getattr(theirs, field), rtol=1e-14)
    assert (ours.floor_names, ours.storey_names) == (theirs.floor_names, theirs.storey_names)
    assert ours.n_strokes == theirs.n_strokes
    assert ours.elements == theirs.elements


def frame() -> mr.Building:
    return mr.buildings.shear_building(
        name="frame", masses=[2.0, 1.0], stiffnesses=[3.0, 2.0], storey_damping=[0.3, 0.2]
    )


def test_every_way_to_write_a_building_gives_the_same(tmp_path: Path) -> None:
    matrices = {"M": frame().mass, "C": frame().damping, "K": frame().stiffness}
    savemat(tmp_path / "v5.mat", matrices)
    savemat(tmp_path / "v4.mat", matrices, format="4")
    savemat(tmp_path / "struct.mat", {"frame": matrices})
    (tmp_path / "folder").mkdir()
    for name, matrix in matrices.items():
        np.savetxt(tmp_path / "folder" / f"{name}.csv", matrix, delimiter=",", header="two floors")
    (tmp_path / "matrices.toml").write_text(MATRICES)
    (tmp_path / "shear.toml").write_text(SHEAR)
    (tmp_path / "other.toml").write_text('file = "shear.toml"')
    (tmp_path / "files.toml").write_text(
        'mass = "folder/M.csv"\nstiffness = "folder/K.csv"\ndamping = "folder/C.csv"'
    )
    mat, toml = ("v5", "v4", "struct"), ("matrices", "shear", "other", "files")
    for name in ("folder", *(f"{name}.mat" for name in mat), *(f"{name}.toml" for name in toml)):
        assert_same(mr.buildings.read_building(tmp_path / name), frame())


def test_equal_storeys_are_said_once() -> None:
    short = stated("n_storeys = 3\nmasses = [2.0]\nstiffnesses = [5.0, 4.0, 3.0]\nstorey_damping = [0.1]")
    long = mr.buildings.shear_building(
        name="frame", masses=[2.0] * 3, stiffnesses=[5.0, 4.0, 3.0], storey_damping=[0.1] * 3
    )
    assert_same(short, long)


def test_a_building_is_named_by_its_file_unless_it_says_otherwise(tmp_path: Path) -> None:
    (tmp_path / "tower.toml").write_text(SHEAR)
    assert mr.buildings.read_building(tmp_path / "tower.toml").name == "tower"
    (tmp_path / "tower.toml").write_text(SHEAR + 'name = "north tower"')
    assert mr.buildings.read_building(tmp_path / "tower.toml").name == "north tower"


@pytest.mark.parametrize("known", mr.buildings.buildings(), ids=lambda known: known.name)
def test_a_published_building_can_be_stated_by_its_matrices_to_the_bit(
    known: mr.Building, tmp_path: Path
) -> None:
    rows = {key: getattr(known, key).tolist() for key in ("mass", "damping", "stiffness")}
    path = tmp_path / "known.toml"
    path.write_text(
        "\n".join(f"{key} = {value}" for key, value in rows.items())
        + f"\nfloor_names = {list(known.floor_names)}"
    )
    again = mr.buildings.read_building(path)
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(again, field), getattr(known, field))
    assert again.floor_names == known.floor_names
    assert_same(stated(f'published = "{known.name}"'), known)


def test_a_file_is_no_name_of_a_published_building() -> None:
    refusal(mr.building, "frame.mat", match=r"mr.buildings.read_building\('frame.mat'\)")


def test_a_published_building_can_be_changed() -> None:
    changed = stated('published = "dyke1996"\nname = "ours"\nstorey_names = ["a", "b", "c"]')
    assert (changed.name, changed.storey_names, changed.status) == ("ours", ("a", "b", "c"), "verified")
    heavier = stated('published = "dyke1996"\nmass = [[100.0, 0, 0], [0, 100.0, 0], [0, 0, 100.0]]')
    np.testing.assert_array_equal(heavier.mass, 100.0 * np.eye(3))
    np.testing.assert_array_equal(heavier.stiffness, mr.building("dyke1996").stiffness)
    assert heavier.status == "ours"
    assert heavier.source.endswith("mass replaced")
    own = 'source = "a book"\nmass = [[100.0, 0, 0], [0, 100.0, 0], [0, 0, 100.0]]'
    assert stated(f'published = "dyke1996"\n{own}').source == "a book"


@pytest.mark.parametrize(
    ("text", "function"),
    [
        ("[rayleigh]\nratios = [0.02, 0.03]\nmodes = [1, 3]", mr.buildings.with_rayleigh_damping),
        ("[rayleigh]\na0 = 0.309478\na1 = 1.89972e-4", mr.buildings.with_rayleigh_coefficients),
        ("[modal_damping]\nratios = [0.02]", mr.buildings.with_modal_damping),
        ("[isolation]\nmass = 400.0\nperiod = 2.0\nratio = 0.1", mr.buildings.with_base_isolation_of_period),
        (
            '[[viscous]]\nstorey = 1\ndamping = 1e3\n[[viscous]]\nstorey = "storey 2"\ndamping = 5e2',
            mr.buildings.with_viscous_damper,
        ),
        ("[brace]\nstorey = 1\nstiffness = 5e6\nmass = 0.3", mr.buildings.with_brace),
        (
            '[tuned_mass]\nfloor = "floor 5"\nmass_ratio = 0.02\ntuning = "sadek"',
            mr.buildings.with_optimal_tuned_mass,
        ),
        (
            "[yielding]\nstorey = 1\nyield_force = 1e3\nyield_displacement = 2e-3\nsharpness = 6",
            mr.buildings.with_yielding_damper,
        ),
        (
            "[[friction]]\nstorey = 1\nslip_load = 500\nstiffness = 1e6\n"
            '[[friction]]\nstorey = 2\nslip_load = 400\nstiffness = 1e6\nname = "upper"',
            mr.buildings.with_friction_damper,
        ),
        (
            "[lead_rubber]\nmass = 330\nperiod = 2.0\nyield_force = 800\nratio = 0.02",
            mr.buildings.with_lead_rubber_bearings,
        ),
        (
            "[liquid_column]\nfloor = 5\nmass = 20\nfrequency = 2.9\nwidth_ratio = 0.7\nhead_loss = 3",
            mr.buildings.with_liquid_column,
        ),
        (
            "[liquid_column]\nfloor = 5\nmass_ratio = 0.02\nwidth_ratio = 0.7\nrms_velocity = 0.1",
            mr.buildings.with_optimal_liquid_column,
        ),
    ],
)
def test_a_table_puts_in_what_its_function_puts_in(text: str, function: Callable[..., mr.Building]) -> None:
    (table,) = tomllib.loads(text).values()
    expected = mr.building("uts")
    for arguments in table if isinstance(table, list) else [table]:
        expected = function(expected, **arguments)
    assert_same(stated(f'published = "uts"\n{text}'), expected)


def test_additions_come_in_the_order_that_is_documented_not_in_that_of_the_table() -> None:
    brace = '[brace]\nstorey = "storey 1"\nstiffness = 5e6\nmass = 0.3'
    isolation = "[isolation]\nmass = 400.0\nperiod = 2.0\nratio = 0.1"
    both = stated(f'published = "uts"\n{brace}\n{isolation}')
    assert both.storey_names[0] == "isolation"
    assert both.storey_names[-1] == "damper in storey 1"
    np.testing.assert_array_equal(both.storeys[-1], [-1.0, 1.0, 0.0, 0.0, 0.0, 0.0, -1.0])


UTS_WITH = 'published = "uts"\n'


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "none of them"),
        (f"{SHEAR}{UTS_WITH}", "by published and masses"),
        (f"{UTS_WITH}storey_damping = [1.0]", "storey_damping goes with masses"),
        (f"{SHEAR}n_storeys = 3", "2 numbers for 3 storeys"),
        (f"{UTS_WITH}[rayleigh]\na0 = 1.0\nratios = [0.1, 0.1]", "a0 and a1 or by ratios and modes"),
        (
            f"{UTS_WITH}[rayleigh]\na0 = 1.0\na1 = 0.0\n[modal_damping]\nratios = [0.1]",
            "both give the damping",
        ),
        (
            f"{UTS_WITH}[isolation]\nmass = 1.0\nperiod = 2.0\nratio = 0.1\n"
            "[lead_rubber]\nmass = 1.0\nperiod = 2.0\nyield_force = 1.0",
            "keep one of isolation and lead_rubber",
        ),
        (
            f"{UTS_WITH}[tuned_mass]\nfloor = 5\nmass_ratio = 0.1\nmass = 3.0",
            "mass_ratio, tuning and mode or",
        ),
    ],
)
def test_a_mistake_is_told_with_its_key(text: str, word: str) -> None:
    refusal(stated, text, match=word)


@pytest.mark.parametrize(
    ("name", "content", "word"),
    [
        ("M.csv", "1,2\n3\n", "line 2 has 1 numbers"),
        ("M.csv", "# mass\n1,2\n3,x\n", "line 3 holds 'x'"),
        ("M.xlsx", "1", ".npy or .mat"),
    ],
)
def test_a_text_file_that_is_no_matrix_is_refused_with_its_line(
    tmp_path: Path, name: str, content: str, word: str
) -> None:
    (tmp_path / name).write_text(content)
    refusal(stated, f'mass = "{name}"\nstiffness = [[1.0]]', tmp_path, match=word)


def test_separators_and_comments_of_a_text_matrix_are_understood(tmp_path: Path) -> None:
    for text in ("2,0\n0,1\n", "2;0;\n0;1;\n", "2\t0\n0\t1", "  2  0 # heavy\n\n  0  1\n"):
        (tmp_path / "M.csv").write_text(text)
        known = stated('mass = "M.csv"\nstiffness = [[5, -2], [-2, 2]]', tmp_path)
        np.testing.assert_array_equal(known.mass, [[2.0, 0.0], [0.0, 1.0]])


def test_a_mat_file_without_matrices_of_a_building_says_what_it_has(tmp_path: Path) -> None:
    savemat(tmp_path / "plant.mat", {"A": np.eye(2), "B": np.ones((2, 1))})
    refusal(
        mr.buildings.read_building,
        tmp_path / "plant.mat",
        match=r"found nothing in .*plant.mat; not used: 'A' \(2 x 2\), 'B'",
    )
    savemat(tmp_path / "plant.mat", {"M": np.eye(2), "k": np.eye(2)})
    refusal(
        mr.buildings.read_building, tmp_path / "plant.mat", match=r"found mass in .*; not used: 'k' \(2 x 2\)"
    )


def test_what_a_workspace_has_beside_the_matrices_is_listed(tmp_path: Path) -> None:
    numbers = {"m": 1.0, "masses": [2.0, 1.0], "stiffness": [3.0, 2.0], "r": 0.3, "storeys": 2.0}
    savemat(tmp_path / "all.mat", {**WORKSPACE, **numbers})
    read = mr.buildings.read_building(append(tmp_path / "all.mat", object_of("sys")))
    assert_same(read, frame())
    beside = ("'m' (1 x 1)", "'stiffness' (1 x 2)", "'r' (1 x 1)", "'sys' (an object of class ss)")
    assert all(name in read.source for name in beside)


def test_units_are_of_the_numbers_in_the_matrices(tmp_path: Path) -> None:
    tonnes = {"M": WORKSPACE["M"] / 1e3, "K": WORKSPACE["K"] / 1e3, "C": WORKSPACE["C"] / 1e3}
    savemat(tmp_path / "t.mat", tonnes)
    written = "".join(
        f"{name} = {tonnes[letter].tolist()}\n"
        for name, letter in (("mass", "M"), ("stiffness", "K"), ("damping", "C"))
    )
    for text in (
        'file = "t.mat"\n',
        written,
        'mass = "t.mat:M"\nstiffness = "t.mat:K"\ndamping = "t.mat:C"\n',
    ):
        for units in ("t, kN", "kN,t", "Mg, kN, m"):
            assert_same(stated(f'{text}units = "{units}"', tmp_path), frame())
    in_mm = {name: matrix / 1e3 for name, matrix in WORKSPACE.items()}
    savemat(tmp_path / "mm.mat", in_mm)
    assert_same(stated('file = "mm.mat"\nunits = "t, N, mm"', tmp_path), frame())
    for units in ("t", "kN", "t, s", "t, kN, kN", "ton, kN", "t, kN, m, m"):
        refusal(stated, f'{written}units = "{units}"', match="as in 't, kN' or 't, N, mm'")
    refusal(stated, f'{SHEAR}units = "t, kN"', match="units goes with matrices")
    (tmp_path / "frame.toml").write_text(MATRICES)
    refusal(
        stated, 'file = "frame.toml"\nunits = "t, kN"', tmp_path, match="state them where the matrices stand"
    )
    table = BuildingTable(file=frame(), units="t, kN")
    refusal(table.build, match="state them where the matrices stand")


def test_of_two_matrices_that_differ_one_is_named_by_a_key(tmp_path: Path) -> None:
    savemat(tmp_path / "two.mat", {**WORKSPACE, "mass": np.eye(2), "model": {"M": WORKSPACE["M"]}})
    refusal(
        mr.buildings.read_building,
        tmp_path / "two.mat",
        match=r"mass may be 'M' or 'mass'.* mass = \"two.mat:M\"",
    )
    for name in ("M", "model.M"):
        assert_same(stated(f'file = "two.mat"\nmass = "two.mat:{name}"', tmp_path), frame())
    matrices = 'mass = "two.mat:M"\nstiffness = "two.mat:K"\ndamping = "two.mat:C"'
    assert_same(stated(matrices, tmp_path), frame())
    savemat(tmp_path / "equal.mat", {**WORKSPACE, "mass": WORKSPACE["M"]})
    assert_same(mr.buildings.read_building(tmp_path / "equal.mat"), frame())
    (tmp_path / "folder").mkdir()
    for name, matrix in {**WORKSPACE, "mass": np.eye(2)}.items():
        np.savetxt(tmp_path / "folder" / f"{name}.csv", matrix, delimiter=",")
    refusal(mr.buildings.read_building, tmp_path / "folder", match='mass = "folder/M.csv"')
    (tmp_path / "folder" / "mass.csv").rename(tmp_path / "folder" / "notes.csv")
    assert "not used: 'notes.csv' (not read)" in mr.buildings.read_building(tmp_path / "folder").source
    (tmp_path / "folder" / "notes.csv").rename(tmp_path / "folder" / "M.txt")
    refusal(
        mr.buildings.read_building, tmp_path / "folder", match=r"has M\.(csv|txt) and M\.(csv|txt); keep one"
    )
    savemat(tmp_path / "space.mat", {"A": A, "B": B, "M": np.eye(2), "mass": 2.0 * np.eye(2)})
    refusal(stated, 'system = "space.mat"', tmp_path, match="mass may be 'M' or 'mass'")


def test_heights_are_those_of_storeys_and_of_no_addition() -> None:
    one = stated(SHEAR + 'height = "3.5 m"')
    assert one.heights.tolist() == one.of_drifts(one.heights).tolist() == [3.5, 3.5]
    isolation = "[isolation]\nmass = 1.0\nperiod = 2.0\nratio = 0.1\n"
    brace = "[[brace]]\nstorey = 1\nstiffness = 9.0\nmass = 1e-3\n"
    built = stated(f"{SHEAR}heights = [4.0, 3.0]\n{isolation}{brace}")
    assert built.storey_names == ("isolation", "storey 1", "storey 2", "damper in isolation")
    assert built.heights.tolist() == [0.0, 4.0, 3.0, 0.0]
    assert built.of_drifts(built.heights).tolist() == [4.0, 3.0]
    refusal(stated, f"{SHEAR}height = 3500", match="3500 m, which is beyond any storey")
    refusal(stated, f"{SHEAR}heights = [3.0]", match="1 number for 2 storeys")


FRAME = mr.building("uts")
A, B, E = FRAME.state_matrices()
ORDERS = {
    "displacements first": np.arange(10),
    "velocities first": np.roll(np.arange(10), 5),
    "by floors": np.arange(10).reshape(2, 5).T.ravel(),
    "any": np.random.default_rng(0).permutation(10),
}


@pytest.mark.parametrize("order", ORDERS.values(), ids=ORDERS)
def test_a_state_space_is_the_building_that_it_was_made_of_whatever_the_order_of_its_states(
    order: NDArray[np.intp], tmp_path: Path
) -> None:
    coordinates = order[order < 5]
    mass = FRAME.mass[np.ix_(coordinates, coordinates)]
    space = {"A": A[np.ix_(order, order)], "B": np.column_stack([E, B[:, 2]])[order]}
    floors, storeys = (np.array(rows)[:, coordinates].tolist() for rows in (FRAME.floors, FRAME.storeys))
    rows = f"floors = {floors}\nstoreys = {storeys}\n"
    savemat(tmp_path / "with_mass.mat", {**space, "M": mass})
    savemat(tmp_path / "by_forces.mat", space)
    # A force that pushes in place of one that resists.
    savemat(tmp_path / "pushed.mat", {**space, "B": space["B"] * [1.0, -1.0]})
    inputs = 'inputs = ["ground", "storey 3"]'
    for text in ('"with_mass.mat"', f'"by_forces.mat"\n{inputs}', f'"pushed.mat"\n{inputs}'):
        again = stated(f"{rows}system = {text}", tmp_path)
        np.testing.assert_allclose(again.frequencies, FRAME.frequencies, rtol=1e-9)
        np.testing.assert_allclose(again.damping_ratios, FRAME.damping_ratios, rtol=1e-9)
        np.testing.assert_allclose(again.mass, mass, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(again.influence, FRAME.influence, rtol=1e-12)
        np.testing.assert_array_equal(again.storeys, storeys)


@pytest.mark.filterwarnings("ignore:.*there is no M")
def test_a_state_space_without_masses_moves_right_and_takes_no_forces(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"A": A})
    with pytest.warns(mr.errors.MrworkWarning, match="there is no M"):
        known = stated('system = "a.mat"\n[rayleigh]\na0 = 0.1\na1 = 0.0', tmp_path)
    np.testing.assert_allclose(known.frequencies, FRAME.frequencies, rtol=1e-9)
    text = 'system = "a.mat"\n[[viscous]]\nstorey = 1\ndamping = 1.0'
    refusal(stated, text, tmp_path, match="A alone does not say what a force does")


# A force that moves only the first mode.
BLIND = np.concatenate([B[:5, 2], np.linalg.eig(-A[5:, :5])[1][:, 0].real])
SCALED = np.diag([1.0] * 5 + [1e3] * 5)
OF_FORCES = {"A": A, "B": np.column_stack([E, B[:, 2]])}


@pytest.mark.parametrize(
    ("matrices", "inputs", "word"),
    [
        ({"M": FRAME.mass, "B": E}, None, "found 'M' .*, 'B'"),
        ({"A": A[:5], "M": FRAME.mass}, None, r"A has shape \(5, 10\); give \(5, 5\)"),
        ({"A": SCALED @ A @ np.linalg.inv(SCALED), "M": FRAME.mass}, None, "0 of the 10 rows"),
        ({"A": A, "M": np.diag([1.0, 2.0, 3.0, 4.0, 5.0])}, None, "not symmetric"),
        (OF_FORCES, '["ground", 2]', "no masses give these columns"),
        ({"A": A, "B": BLIND[:, None]}, "[1]", "move 1 of 5 modes"),
    ],
)
def test_a_state_space_that_is_no_building_is_refused_with_what_is_missing(
    tmp_path: Path, matrices: dict[str, NDArray[np.float64]], inputs: str | None, word: str
) -> None:
    savemat(tmp_path / "a.mat", matrices)
    text = 'system = "a.mat"' + (f"\ninputs = {inputs}" if inputs else "")
    refusal(stated, text, tmp_path, match=word)
