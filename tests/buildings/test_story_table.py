"""A table of storeys is the shear building of its masses, stiffnesses and heights, in either order."""

from pathlib import Path

import numpy as np
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
        ("storey,mass (t),k (kN/m)\nlow,2,3\nhigh,2,3\n", "line 2: 'low' has no number, .* elevation"),
    ],
)
def test_a_table_that_does_not_say_a_building_is_refused(tmp_path: Path, text: str, match: str) -> None:
    refusal(read_building, written(tmp_path / "story.csv", text), match=match)
