"""Mistakes of a study: one refusal names all of them, each in its line, and nothing that follows from another."""

from __future__ import annotations

from pathlib import Path

import pytest
from refusals import command_refusal, refusal
from tuning_samples import motion

import mrwork as mr
from mrwork.errors import MistakesError, SettingError

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
duration = -3
[[motion]]
file = "absent.AT2"
[hardware]
sample_time = "1 kg"
delay = true
[report]
histories = "some"
[[tune]]
law = ["clipped_optimal"]
[[baseline]]
building = { rayleigh = { alpha = 0.1 } }
"""
LINES = [3, 4, 7, 8, 9, 10, 11, 14, 16, 18, 19, 21, 23, 24, 25]


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


def test_the_command_lists_them_below_each_other(tmp_path: Path) -> None:
    path = study_in(tmp_path, FIVE)
    for verb in ("respond", "tune"):
        head, *lines = command_refusal(verb, path, match="mistakes").splitlines()
        assert head == f"mrwork: {path} has {len(LINES)} mistakes:"
        assert [line.partition(": ")[0] for line in lines] == [f"  line {line}" for line in LINES]


@pytest.mark.parametrize(
    ("old", "new", "n_mistakes"),
    [
        # What depends on it is not read; it is no mistake of its own.
        ("storey = 1", "store = 1", 1),
        ("storey = 1", "", 1),
        ("[[damper]]", "[[dampr]]", 1),
        ("[[damper]]", "[[surplus]]", 1),
        ("[building]", "[buildin]", 1),
        ("published", "pub", 1),
        ('"uts"', '"utz"', 1),
        ("[[controller]]", "[[law]]", 1),
        ("[[motion]]", "[[earthquake]]", 1),
        ("drifts = 1.0", "drifts = nan", 1),
        ("control_weight = 1e-9", "controlweigth = 1e-9", 1),
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


def test_a_building_of_another_file_has_its_lines_behind_that_of_the_study(tmp_path: Path) -> None:
    (tmp_path / "frame.toml").write_text("masses = [1.0]\nstifnesses = [-1.0]\nzeta = 0.02\n")
    path = study_in(tmp_path, '[building]\nfile = "frame.toml"\n[[motion]]\npga = true\n')
    error = refusal(
        mr.read_study, path, match=r"line 2: \S*frame.toml, line 3: the building has no key 'zeta'"
    )
    assert isinstance(error, MistakesError)
    assert [each.line for each in error.mistakes] == [2, 2, 2, 3, 4]
