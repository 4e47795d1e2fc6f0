"""A study file, read whole: what it comes to, and that its mistakes are sentences with a line."""

from pathlib import Path

import measured_data
import numpy as np
import pytest
from refusals import refusal
from sentences import Refused

import mrwork as mr
from mrwork.base.remark import warnings_of

STUDY = """\
[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"
differential = true

[[controller]]
law = "passive"
label = "0.6 A"
settings = { command = 0.6 }

[[baseline]]
label = "isolated"
[baseline.building.isolation]
mass = 300
period = 2.0
ratio = 0.1

[[motion]]
synthetic = "kanai_tajimi"
duration = 3
pga = [1.0, 2.0]

[hardware]
sample_time = "1 ms"
"""


def unknown_run(run: Path) -> tuple[mr.DamperSpec, tuple[float, ...]]:
    raise mr.errors.RecordError(f"{run} does not exist")


def study_of(text: str, folder: Path) -> mr.Study:
    path = folder / "study.toml"
    path.write_text(text)
    return mr.read_study(path, unknown_run)


def test_a_study_begins_with_its_references(tmp_path: Path) -> None:
    study = study_of(STUDY, tmp_path)
    assert [each.row.kind for each in study.arrangements] == [
        "uncontrolled",
        "passive_off",
        "best_passive",
        "baseline",
        "passive",
    ]
    assert study.arrangements[0].devices == ()
    assert [ground.peak for ground in study.grounds] == pytest.approx([1.0, 2.0])
    assert study.detailed == 1
    assert study.command_unit == "A"


def test_a_differential_pair_is_one_device_with_one_command(tmp_path: Path) -> None:
    (pair,) = study_of(STUDY, tmp_path).arrangements[1].devices
    assert pair.differential
    assert pair.largest_command == 1.88
    (single,) = study_of(STUDY.replace("differential = true\n", ""), tmp_path).arrangements[1].devices
    assert not single.differential


def test_a_damper_behind_a_brace_takes_the_drift_less_the_brace(tmp_path: Path) -> None:
    text = STUDY.replace("differential = true", "differential = true\nbrace = { stiffness = 1e7 }")
    study = study_of(text, tmp_path)
    equipped = study.arrangements[1]
    assert equipped.building.n_coordinates == study.building.n_coordinates + 1
    assert equipped.devices[0].row == pytest.approx(np.append(study.building.storeys[0], -1.0))
    # The brace moves with its own deformation alone: the building is the same without dampers, its drifts too.
    assert study.arrangements[0].building.n_coordinates == 5
    assert len(equipped.places["storey"]) == 5


def test_a_mistake_is_one_sentence_with_its_line(tmp_path: Path, refused: Refused) -> None:
    for old, new in (
        ('"uts"', '"utz"'),
        ("storey = 1", "story = 1"),
        ("storey = 1\n", ""),
        ("storey = 1", "storey = 9"),
        ("differential = true", 'differential = "yes"'),
        ('"passive"', '"pasive"'),
        ("command = 0.6", "comand = 0.6"),
        ('"isolated"', '"0.6 A"'),
        ("command = 0.6", "command = 2"),
        ("settings = { command = 0.6 }", "command = 0.6"),
        ("mass = 300", "mass = -1"),
        ('"kanai_tajimi"', '"kanai"'),
        ("[1.0, 2.0]", '"0.1 furlong"'),
        ("[1.0, 2.0]", '[0.1, "3 mm"]'),
        ("pga", 'use = "training"\npga'),
        ('"1 ms"', '"2"'),
        ('"1 ms"', "0"),
        ('"1 ms"', '"1 ms"\ndelay = "0.3 ms"'),
        ("[hardware]", "[hardwear]"),
        ("[[motion]]", "[motion]"),
        ("[hardware]\n", '[report]\nmotion = "x"\n[hardware]\n'),
        ("[[damper]]", '[[damper]]\nstorey = 2\npreset = "dyke1996"\n[[damper]]'),
    ):
        assert old in STUDY
        refused(study_of, STUDY.replace(old, new, 1), tmp_path)
    start, end = STUDY.index("[[damper]]"), STUDY.index("[[controller]]")
    refused(study_of, STUDY[:start] + STUDY[end:], tmp_path)
    refused(mr.read_study, tmp_path / "gone.toml", unknown_run)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("differential = true", "amplitude = [3]", "line 7: amplitude takes the smallest and the largest"),
        (
            "[hardware]\n",
            '[[hardware.fault]]\nsignal = "force"\nstart = 2\nend = 1\n[hardware]\n',
            "after its start",
        ),
        ("[hardware]\n", "[report]\ncontrollers = []\n[hardware]\n", "controllers is empty"),
    ],
)
def test_what_no_range_tells_is_refused_with_its_line(old: str, new: str, word: str, tmp_path: Path) -> None:
    assert old in STUDY
    refusal(study_of, STUDY.replace(old, new, 1), tmp_path, match=word)


TRAINING = """
[[motion]]
synthetic = "kanai_tajimi"
name = "other noise"
duration = 3
seed = 5
use = "training"
"""


def test_a_motion_is_for_testing_unless_it_is_for_training(tmp_path: Path) -> None:
    study = study_of(STUDY + TRAINING, tmp_path)
    assert [motion.facts.use for motion in study.motions] == ["test", "test", "training"]
    assert [motion.facts.name for motion in study.of_use("training").motions] == ["other noise"]
    assert study.of_use("test").chosen_on == (study.grounds[2],)
    whole = study_of(STUDY, tmp_path)
    assert whole.chosen_on == whole.grounds


def test_a_study_shows_the_test_motion_of_the_largest_peak(tmp_path: Path) -> None:
    study = study_of(STUDY + TRAINING.replace("duration = 3", "duration = 3\npga = 9"), tmp_path)
    assert (study.detailed, study.histories) == (1, (1,))
    assert (study.of_use("test").detailed, study.of_use("test").histories) == (1, (1,))
    assert (study.of_use("training").detailed, study.of_use("training").histories) == (0, (0,))


ROOT = measured_data.ROOT
QUICK_START = ROOT / "studies" / "respond" / "quick_start.toml"


def test_the_first_study_runs_without_a_warning_and_its_law_is_worth_it(tmp_path: Path) -> None:
    journal = mr.Journal(tmp_path / "journal")
    results = mr.run_study(
        mr.read_study(QUICK_START, lambda run: pytest.fail(f"{run} is not asked for")), journal=journal
    )
    journal.close()
    assert results.complete
    assert warnings_of(results.remarks) == ()
    # The law named alone, the best constant command, i = 0, no dampers.
    law, constant, off, none = (results.score(row).mean for row in (4, 2, 1, 0))
    assert law < constant < off < none
