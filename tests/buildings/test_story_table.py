"""A table of storeys is the shear building of its masses, stiffnesses and heights, in either order."""

import importlib.util
from pathlib import Path

import numpy as np
import odd_files
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.buildings import read_building

MASSES, STIFFNESSES, HEIGHTS = [210e3, 200e3, 180e3], [120e6, 110e6, 90e6], [4.0, 3.2, 3.2]


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "text",
    [
        "storey,height (m),mass (t),stiffness (kN/m)\n1,4,210,120000\n2,3.2,200,110000\n3,3.2,180,90000\n",
        "Story,Height_mm,MassX_kg,StiffX_kN/mm\nStory3,3200,180000,90\nStory2,3200,200000,110\nStory1,4000,210000,120\n",
        "Name;Elevation;Mass;Stiffness\n;m;t;kN/m\nRoof;10,4;180;90000\nMid;7,2;200;110000\nLow;4;210;120000\n",
        "Story,Elevation (m),Mass (t),k (kN/m)\n3F,11.4,180,90000\n2F,8.2,200,110000\n1F,5,210,120000\nBase,1,0,0\n",
        # As exported: a title, units below the headings, two directions, mass in kN s2/m, a mass for the base.
        "TABLE:  Story Data\nStory,Elevation,Mass X,Mass Y,Stiffness X,Stiffness Y\n,m,kg,kg,kN/m,kN/m\n"
        "Story3,10.4,180000,180000,90000,90000\nStory2,7.2,200000,200000,110000,110000\n"
        "Story1,4,210000,210000,120000,120000\nBase,0,5000,5000,0,0\n",
        '"Story","Elevation","UX","Stiff X"\n"","m","kN-s²/m","kN/m"\n"Story13","10.4","180","90000"\n'
        '"Story11","7.2","200","110000"\n"Story10","4","210","120000"\n',
        "Level,Weight (kN),Stiffness (MN/m),Height (m)\n"
        "1,2059.3965,120,4\n2,1961.33,110,3.2\n3,1765.197,90,3.2\n",
    ],
)  # fmt: skip
def test_each_form_is_the_same_building(tmp_path: Path, text: str) -> None:
    found = read_building(written(tmp_path / "story.csv", text))
    storeys = np.eye(3) - np.eye(3, k=-1)
    np.testing.assert_allclose(found.mass, np.diag(MASSES), rtol=1e-9)
    np.testing.assert_allclose(found.stiffness, storeys.T @ np.diag(STIFFNESSES) @ storeys, rtol=1e-9)
    np.testing.assert_allclose(found.heights, HEIGHTS, rtol=1e-9)


def test_a_study_takes_a_table_with_its_own_additions(tmp_path: Path) -> None:
    rows = "1,210,120000\n2,200,110000\n"
    written(tmp_path / "story.csv", f"storey,mass (t),stiffness (kN/m)\n{rows}")
    motion = '[[motion]]\nsynthetic = "kanai_tajimi"\nduration = "2 s"\n'
    head = '[building]\nfile = "story.csv"\nmodal_damping = { ratios = ["2 %"] }\nheight = "3 m"\n'
    made = mr.read_study(written(tmp_path / "study.toml", head + motion))
    assert made.arrangements[0].building.floor_names == ("floor 1", "floor 2")
    np.testing.assert_allclose(made.arrangements[0].building.heights, [3.0, 3.0])


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("storey,mass (t),k (kN/m)\n1,2,3\n3,2,3\n", "storey 2 is missing; give each of 1 to 3 a row"),
        ("storey,mass (t),k (kN/m)\n1,2,3\n1,2,3\n", "a storey is there twice"),
        ("storey,mass (t),k (kN/m)\n1,2,3\n2,0,3\n", "line 3: the mass of 2 is 0; give one above zero"),
        ("storey,mass,k (kN/m)\n1,2,3\n2,2,3\n", r"as 'mass \(t\)'"),
        ("storey,mass (t)\n1,2\n2,2\n", r"no column is the stiffness .*; call it 'stiffness \(kN/m\)'"),
        ("storey,k (kN/m)\n1,2\n2,2\n", r"no column is the mass .*; call it 'mass \(t\)'"),
        ("storey,mass (kN),k (kN/m)\n1,2,3\n2,2,3\n", "'kN' is a unit of force, no unit of mass"),
        (
            "Story,Elevation,Mass X,Stiffness X\n,m,t,kN/m\nStory4,12.8,2,3\nStory2,6.4,2,3\nStory1,3.2,2,3\n",
            "storey 3 is missing, and a storey is 6.4 m high; give each of 1 to 4 a row",
        ),
        (
            "Story,Case,Mass (t),Stiff X (kN/m)\nStory1,EX,2,3\nStory1,EY,2,4\n",
            "a storey is there twice, Story1; keep one row of each, of one load case",
        ),
        ("storey,mass (t),k (kN/m)\nlow,2,3\nhigh,2,3\n", "line 2: 'low' has no number, .* elevation"),
    ],
)
def test_a_table_that_does_not_say_a_building_is_refused(tmp_path: Path, text: str, match: str) -> None:
    refusal(read_building, written(tmp_path / "story.csv", text), match=match)


def test_sheets_and_files_of_a_quantity_each_are_joined_by_their_storeys(tmp_path: Path) -> None:
    written(tmp_path / "stories.csv", "Story,Height (m)\nStory3,3.2\nStory2,3.2\nStory1,4\n")
    written(
        tmp_path / "mass.csv", "Story,UX,UY\n,t,t\nBase,9,9\nStory1,210,210\nStory2,200,200\nStory3,180,180\n"
    )
    written(
        tmp_path / "k.csv",
        "Story,Stiff X,Stiff Y\n,kN/m,kN/m\nStory3,90000,9\nStory2,110000,9\nStory1,120000,9\n",
    )
    with pytest.warns(mr.errors.MrworkWarning, match="the stiffness is read of the direction X"):
        found = read_building(f"{tmp_path / 'stories.csv'}+mass.csv+k.csv")
    np.testing.assert_allclose(np.diag(found.mass), MASSES)
    np.testing.assert_allclose(found.storey_stiffnesses, STIFFNESSES)
    np.testing.assert_allclose(found.heights, HEIGHTS)
    assert found.floor_names == ("Story1", "Story2", "Story3")
    written(tmp_path / "mass.csv", "Story,UX (t)\nStory1,210\nStory3,180\n")
    match = "the mass of Story2 is missing; add its row"
    with pytest.warns(mr.errors.MrworkWarning):
        refusal(read_building, f"{tmp_path / 'stories.csv'}+mass.csv+k.csv", match=match)


@pytest.mark.skipif(
    importlib.util.find_spec("python_calamine") is None, reason="reading .xlsx needs python-calamine"
)
def test_a_workbook_as_exported_has_a_sheet_for_each_quantity(tmp_path: Path) -> None:
    sheets: dict[str, list[list[object]]] = {
        "Story Definitions": [
            ["TABLE:  Story Definitions"], ["Story", "Height", "Master Story"], ["", "m", ""],
            ["Story3", 3.2, "Yes"], ["Story2", 3.2, "No"], ["Story1", 4.0, "No"],
        ],
        "Mass Summary by Story": [
            ["TABLE:  Mass Summary by Story"], ["Story", "UX", "UY", "UZ"], ["", "kg", "kg", "kg"],
            ["Story3", 180e3, 180e3, 0], ["Story2", 200e3, 200e3, 0], ["Story1", 210e3, 210e3, 0],
        ],
        "Story Stiffness": [
            ["TABLE:  Story Stiffness"], ["Story", "Output Case", "Shear X", "Drift X", "Stiff X"],
            ["", "", "kN", "mm", "kN/m"],
            ["Story3", "EX", 90.0, 1.0, 90e3], ["Story2", "EX", 220.0, 2.0, 110e3], ["Story1", "EX", 360.0, 3.0, 120e3],
        ],
    }  # fmt: skip
    path = tmp_path / "tower.xlsx"
    path.write_bytes(odd_files.workbook(sheets))
    found = read_building(path)
    np.testing.assert_allclose(np.diag(found.mass), MASSES)
    np.testing.assert_allclose(found.storey_stiffnesses, STIFFNESSES)
    np.testing.assert_allclose(found.heights, HEIGHTS)
