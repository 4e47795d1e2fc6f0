"""Mistakes of a study: one refusal names all of them, each in its line, and nothing that follows from another."""

from __future__ import annotations

from pathlib import Path

import pytest
from command_line import mrwork
from sentences import Refused
from tuning_samples import motion

import mrwork as mr
from mrwork.base.keys import read_table
from mrwork.base.places import Place
from mrwork.buildings import read_building
from mrwork.errors import MistakesError, SettingError
from mrwork.study.schema import StudyTable
from tools.faults.mistakes import measured, whole_studies

# A mistake of each kind, in every table.
FIVE = """[building]
masses = ["12t", 2000.0]
stiffnesses = [1e6, "1e3 kg"]
damping_ratio = 0.02

[[damper]]
storey = 1
preset = "kwok2007"
lagg = 3

[[law]]
law = "lqr"
label = 3

[[motion]]
synthetic = "kanai_tajimi"
pga = "0.3g"
duration = -3

[[motion]]
synthetic = "kanai"
name = "B"

[[motion]]
file = "absent.AT2"

[hardware]
sample_time = "1 kg"
delay = true
fault = [{ signal = "force", start = 2 }]

[report]
histories = "some"

[uncertainty]
realisations = 0.5

[[tune]]
law = ["clipped_optimal"]
budgets = 9

[clairvoyant]
interval = []

[[baseline]]
building = { rayleigh = { alpha = 0.1 } }
"""
LINES = [3, 4, 8, 9, 11, 12, 13, 18, 21, 25, 28, 29, 33, 36, 39, 40, 43, 45, 46]


def study_in(folder: Path, text: str) -> Path:
    path = folder / "study.toml"
    path.write_text(text)
    return path


def mistakes_of(path: Path) -> list[tuple[int, str]]:
    """Line and sentence of each mistake of a study."""
    with pytest.raises(SettingError) as refusal:
        mr.read_study(path)
    error = refusal.value
    return [(each.line, str(each)) for each in getattr(error, "mistakes", [error])]


def test_one_refusal_has_every_mistake_in_its_line(tmp_path: Path, refused: Refused) -> None:
    path = study_in(tmp_path, FIVE)
    refused(mr.read_study, path)
    assert [line for line, _ in mistakes_of(path)] == LINES


def test_the_command_lists_them_below_each_other(tmp_path: Path) -> None:
    path = study_in(tmp_path, FIVE)
    ended = mrwork("respond", path)
    head, *lines = ended.stderr.splitlines()
    assert (ended.returncode, ended.stdout) == (2, "")
    assert head == f"mrwork: {path} has {len(LINES)} mistakes:"
    assert [line.partition(": ")[0] for line in lines] == [f"  line {line}" for line in LINES]
    assert len(mrwork("tune", path).stderr.splitlines()) == 1 + len(LINES)


@pytest.mark.parametrize(
    ("old", "new", "n_mistakes"),
    [
        # What depends on it is not read; it is no mistake of its own.
        ("storey = 1", "store = 1", 1),
        ("storey = 1", "qzx = 1", 1),
        ("storey = 1", "", 1),
        ("[[damper]]", "[[dampr]]", 1),
        ("[[damper]]", "[[mr_damper]]", 1),
        ("[[damper]]", "[[surplus]]", 1),
        ("[building]", "[buildin]", 1),
        ("[building]", "[structure]", 1),
        ("published", "pub", 1),
        ('"uts"', '"utz"', 1),
        ("[hardware]", "[hardwear]", 1),
        ("[[controller]]", "[[law]]", 1),
        ("law =", "algorithm =", 1),
        ("[[motion]]", "[[earthquake]]", 1),
        ("drifts = 1.0", "drifts = nan", 1),
        ("control_weight = 1e-9", "controlweigth = 1e-9", 1),
        ("kwok2006", "kwok", 1),
        ("kwok2006", "kwok2007", 1),
        ("storey = 1", 'storey = "roof"', 1),
        ("peak_drift = 1", "peak_drft = 1", 1),
        ('laws = ["lyapunov"]', 'laws = ["liapunov", "mpc"]\nobjectives = ["peak"]', 3),
        # Two in one table, and two that a third hides no longer.
        ('storey = 1\npreset = "kwok2006"', 'storey = 99\npreset = "kwok"', 2),
        ('law = "clipped_optimal"', 'law = "clipped"\nlabel = 3', 2),
        ("storey = 1", "storey = 1\nsurplus = 2\nlag = -1", 2),
    ],
)
def test_what_follows_from_a_mistake_is_not_told(old: str, new: str, n_mistakes: int, tmp_path: Path) -> None:
    text = f"""[building]
published = "uts"
[[damper]]
storey = 1
preset = "kwok2006"
[[controller]]
law = "clipped_optimal"
settings = {{ drifts = 1.0, control_weight = 1e-9 }}
[hardware]
delay = "1 ms"
[report]
controllers = ["Clipped-optimal"]
[[tune]]
laws = ["lyapunov"]
criteria = {{ peak_drift = 1 }}
{motion("A", 1)}"""
    assert old in text
    mr.read_study(study_in(tmp_path, text))
    found = mistakes_of(study_in(tmp_path, text.replace(old, new, 1)))
    assert len(found) == n_mistakes, found
    here = 1 + text[: text.index(old)].count("\n")
    assert all(here - 1 <= line <= here + 2 for line, _ in found), found


def test_a_building_of_another_file_has_its_lines_behind_that_of_the_study(
    tmp_path: Path, refused: Refused
) -> None:
    (tmp_path / "frame.toml").write_text("masses = [1.0]\nstifnesses = [-1.0]\nzeta = 0.02\n")
    refused(read_building, tmp_path / "frame.toml")
    refused(mr.read_study, study_in(tmp_path, '[building]\nfile = "frame.toml"\n[[motion]]\npga = true\n'))


def test_a_document_is_read_to_its_hundredth_mistake_and_the_first_are_listed(tmp_path: Path) -> None:
    unknown = "".join(f"key_{number} = 1\n" for number in range(5000))
    text = f"[building]\n{unknown}[[motion]]\nx = 1\n" + 5000 * "[[dampr]]\nstoery = 1\n"
    with pytest.raises(MistakesError) as refusal:
        mr.read_study(study_in(tmp_path, text))
    lines = str(refusal.value).splitlines()
    assert len(lines) == 22
    assert lines[0] == f"{tmp_path / 'study.toml'} has 100 mistakes or more:"
    assert lines[-1] == "  and 80 more"
    assert max(map(len, lines)) <= 510


def test_hidden_characters_and_long_values_stay_in_the_lines_of_their_mistakes(tmp_path: Path) -> None:
    text = '[building]\n"a\\nb\\u001b[31m" = 1\npublished = "' + "x" * 3000 + '"\n[[motion]]\npga = "1\\n2"\n'
    with pytest.raises(MistakesError) as refusal:
        mr.read_study(study_in(tmp_path, text))
    lines = str(refusal.value).splitlines()
    assert len(lines) == 1 + len(refusal.value.mistakes)
    assert all(line.isprintable() and len(line) <= 510 for line in lines)


def test_mistakes_are_kept_only_while_their_document_is_read() -> None:
    place = Place(origin="study.toml")
    with pytest.raises(SettingError):
        read_table(StudyTable, {"building": {"published": "uts"}, "report": {}}, place)
    with place.collecting() as open_place:
        with open_place.keeping():
            pass
        table = read_table(StudyTable, {"building": {"published": "uts"}, "motion": []}, open_place)
    with pytest.raises(SettingError):
        table.building.place.refuse("after its document was read")
    with pytest.raises(SettingError):
        table.building.place.attempt(table.building.place.refuse, "after its document was read")


def test_random_mistakes_are_named_and_no_others_are(tmp_path: Path) -> None:
    rates = measured(whole_studies(), 40, tmp_path, seed=1)
    assert not rates.tracebacks
    assert not rates.false
    assert rates.named > 0.9 * rates.together
