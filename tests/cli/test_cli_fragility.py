"""The verb `fragility`: its table, sentences and files."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from command_line import printed
from refusals import command_refusal

import mrwork as mr

STUDY = """design_level = "0.3 g"
[building]
n_storeys = 1
masses = ["20 t"]
stiffnesses = ["12 kN/mm"]
height = "3 m"
[[damper]]
storey = 1
preset = "kwok2006"
count = 10
[report]
limit = { peak_drift_ratio = "0.4 %" }
""" + "".join(
    f"""[[motion]]
synthetic = "kanai_tajimi"
name = "record {seed}"
seed = {seed}
duration = 3
sa = ["0.1 g", "0.3 g", "0.6 g", "1.2 g"]
"""
    for seed in range(3)
)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("fragility")
    (place / "study.toml").write_text(STUDY)
    printed("respond", place / "study.toml", "--out", place / "out", "--quiet")
    return place / "out"


def test_it_has_the_numbers_of_the_function_and_the_limit_of_the_page(run: Path) -> None:
    own = mr.fragility(mr.load(run, mr.StudyResults), {"peak_drift_ratio": 0.004}, level=0.8)
    document = json.loads(printed("fragility", run, "--level", "0.8", "--json"))
    assert (document["criterion"], document["limit"]) == ("peak_drift_ratio", 0.004)
    assert [each["median"] for each in document["arrangements"]] == [
        each.median for each in own.rows.values()
    ]
    assert document["sentences"] == list(own.in_words())
    text = printed("fragility", run, "--limit", "peak_drift_ratio = 0.4 %", "--against", "uncontrolled")
    assert "the median Sa(0.257 s, 5 %) at which the peak drift ratio reaches 0.4 %" in " ".join(text.split())


def test_it_writes_its_table_and_figures_beside_it(run: Path, tmp_path: Path) -> None:
    table = tmp_path / "new" / "limit.csv"
    document = json.loads(printed("fragility", run, "--output", table, "--json"))
    names = ["limit-fragility.svg", "limit-ida.svg", "limit.csv"]
    assert sorted(Path(each).name for each in document["files"]) == names
    assert sorted(each.name for each in table.parent.iterdir()) == names
    head, *lines = table.read_text().splitlines()
    assert head == 'arrangement,"Sa(0.257 s, 5 %) [m/s2]",probability,reached,beyond tests'
    assert len(lines) == 3 * 4
    command_refusal("fragility", run, "--output", table, match="--replace")
    printed("fragility", run, "--output", table, "--replace")
