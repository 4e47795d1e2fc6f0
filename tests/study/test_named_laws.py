"""A law named alone runs, the best constant command is beside it, and the size of the dampers is told."""

import json
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from command_line import printed
from refusals import refusal

import mrwork as mr
from mrwork.base.keys import keys_of
from mrwork.control import control_laws
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.study import StudyResults
from mrwork.study.comparison import results_in_words
from mrwork.study.study import Study, study_fingerprint

FRAME = """\
[building]
n_storeys = {storeys}
masses = [300e3]
stiffnesses = [3e8]
modal_damping = {{ ratios = [0.03] }}

[[damper]]
storey = 1
{damper}
count = {count}

[[motion]]
synthetic = "kanai_tajimi"
duration = 3
pga = "0.3 g"
"""
PLAIN = 'preset = "kwok2006"'


def read(folder: Path, more: str = "", *, top: str = "", **changes: object) -> Study:
    path = folder / "study.toml"
    path.write_text(top + FRAME.format(**{"storeys": 2, "damper": PLAIN, "count": 300, **changes}) + more)
    return mr.study.designed(mr.read_study(path))


def named(law: str, settings: str = "") -> str:
    return f'\n[[controller]]\nlaw = "{law}"\n{settings}'


def ran(folder: Path, more: str = "", **changes: object) -> StudyResults:
    return mr.run_study(read(folder, more, **changes), threads=1)


@pytest.mark.parametrize("law", [spec.name for spec in control_laws() if spec.name != "inverse_network"])
def test_every_law_named_alone_runs_and_what_it_lacked_is_told(law: str, tmp_path: Path) -> None:
    study = read(tmp_path, named(law))
    lacking = [entry.name for entry in keys_of(SETTINGS[law]) if entry.is_required]
    lacking += ["control_weight"] if SETTINGS[law].is_regulator else []
    (taken,) = [each for _, each in study.taken_settings] or [None]
    assert (taken is not None) == bool(lacking)
    if taken is not None:
        assert set(lacking) <= taken.settings.keys()
        notes = dict(study.design_notes)[f"Settings of {study.arrangements[-1].row.label}"]
        assert "`settings = {" in notes[1]
        # The line to type gives the same law, and nothing is left to be taken.
        again = read(tmp_path, named(law, notes[1].split("`")[1] + "\n"))
        assert again.taken_settings == ()
        assert study_fingerprint(again) == study_fingerprint(study)
    results = mr.run_study(study, threads=1)
    assert results.quantities.finished.all()
    assert np.isfinite(results.score(len(results.rows) - 1).mean)


def test_a_network_that_is_trained_elsewhere_must_be_given(tmp_path: Path) -> None:
    refusal(read, tmp_path, named("inverse_network"), match="has no layer; give a row for each hidden unit")


def test_a_law_is_only_named_until_it_is_designed_and_a_journal_keeps_what_it_took(tmp_path: Path) -> None:
    expected = read(tmp_path, named("clipped_optimal"))
    study = mr.read_study(tmp_path / "study.toml")
    assert study.taken_settings == ()
    assert study_fingerprint(study) != study_fingerprint(expected)
    with closing(mr.Journal(tmp_path / "journal")) as journal:
        assert study_fingerprint(mr.study.designed(study, journal=journal)) == study_fingerprint(expected)
    kept = (tmp_path / "journal").read_text()
    assert kept.count('"settings of clipped_optimal"') == 1
    with closing(mr.Journal(tmp_path / "journal", resume=True)) as journal:
        again = mr.study.designed(
            study, journal=journal, on_progress=lambda progress: pytest.fail(progress.in_words)
        )
    assert study_fingerprint(again) == study_fingerprint(expected)
    assert again.taken_settings == expected.taken_settings
    assert mr.study.designed(expected) is expected


@pytest.mark.parametrize("law", [spec.name for spec in control_laws() if spec.needs_curve])
def test_a_law_of_a_static_model_takes_the_motion_of_its_damper(law: str, tmp_path: Path) -> None:
    study = read(tmp_path, named(law), damper='preset = "leva2002"')
    notes = dict(study.design_notes)[f"Settings of {study.arrangements[-1].row.label}"]
    assert "amplitude = [" in " ".join(notes)


def test_weights_are_the_best_of_the_training_motions(tmp_path: Path) -> None:
    training = (
        '[[motion]]\nsynthetic = "kanai_tajimi"\nname = "t"\nseed = 4\nduration = 3\nuse = "training"\n'
    )
    study = read(tmp_path, training + named("clipped_optimal"))
    ((label, taken),) = study.taken_settings
    assert label == "Clipped-optimal"
    assert taken.settings["drifts"] == 1.0
    assert "on 1 training motion" in taken.origin[1]
    best = float(taken.settings["control_weight"])
    scores = {}
    for factor in (1e-4, 1.0, 1e4):
        table = named("clipped_optimal", f"settings = {{ drifts = 1, control_weight = {factor * best!r} }}\n")
        results = mr.run_study(read(tmp_path, training + table).of_use("training"), threads=1)
        scores[factor] = results.score(len(results.rows) - 1).mean
    assert min(scores, key=lambda factor: scores[factor]) == 1.0


def test_only_what_is_missing_is_taken(tmp_path: Path) -> None:
    settings = "settings = { accelerations = 1, full_force = '100 kN' }\n"
    ((_, taken),) = read(tmp_path, named("modified_clipped_optimal", settings)).taken_settings
    assert taken.settings.keys() == {"control_weight"}
    assert "accelerations = 1.0, full_force = 100000.0, control_weight = " in taken.remedy
    designed = "settings = { designed = { rms_drift = '2 mm' } }\n"
    ((_, taken),) = read(tmp_path, named("clipped_optimal", designed)).taken_settings
    assert taken.settings == {"control_weight": 1.0}


def test_an_active_law_takes_no_more_force_than_the_dampers(tmp_path: Path) -> None:
    results = ran(tmp_path, named("passive_on") + named("active"))
    on, active = (results.quantities.peak_force[row, 0, 0][0] for row in (3, 4))
    assert 0.0 < active <= on


@pytest.mark.usefixtures("pages")
def test_json_tells_what_was_taken(tmp_path: Path) -> None:
    read(tmp_path, named("clipped_optimal"))
    document = json.loads(printed("respond", tmp_path / "study.toml", "--out", tmp_path / "run", "--json"))
    ((stated),) = document["settings"]
    assert stated["controller"] == "Clipped-optimal"
    assert stated["settings"]["drifts"] == 1.0
    assert document["best_passive"].startswith("Optimal passive, ")
    assert "Settings of Clipped-optimal" in (tmp_path / "run" / "report.html").read_text(encoding="utf-8")


def test_the_best_constant_command_is_in_every_study(tmp_path: Path) -> None:
    alone, listed = ran(tmp_path), ran(tmp_path, named("best_passive"))
    none = ran(tmp_path, top='references = "none"\n')
    kinds = [[row.kind for row in results.rows] for results in (alone, listed, none)]
    assert kinds[0] == kinds[1] == ["uncontrolled", "passive_off", "best_passive"]
    assert kinds[2] == ["uncontrolled", "passive_off"]
    # Of the rows that were there before, not a bit changes.
    for row in (0, 1):
        for name, value in none.quantities.at(row, 0).items():
            np.testing.assert_array_equal(value, alone.quantities.at(row, 0)[name])
    assert alone.rows[2].label == listed.rows[2].label
    (choice,) = alone.choices
    assert "from Passive-off, 0 A, 1.000, to Passive-on, 1.88 A, " in choice
    assert "21 runs in one batch" in choice
    assert none.choices == ()


def test_a_passive_damper_has_no_command_to_choose(tmp_path: Path) -> None:
    spec = mr.damper("maxwell")
    given = ", ".join(f"{name} = {1e6 if name != spec.names[0] else 1e5}" for name in spec.names)
    fixed = f'model = "maxwell"\nparameters = {{ {given} }}\npassive = true'
    results = ran(tmp_path, damper=fixed, count=1)
    assert [row.kind for row in results.rows] == ["uncontrolled", "passive_off"]
    assert results.choices == ()
    assert any("of the peak base shear" in each for each in results_in_words(results))


@pytest.mark.parametrize("count", [10, 300])
def test_the_share_of_the_base_shear_is_told_and_the_count_for_a_tenth(count: int, tmp_path: Path) -> None:
    results = ran(tmp_path, count=count)
    (share,) = [each for each in results_in_words(results) if "of the peak base shear" in each]
    force = max(float(results.quantities.peak_force[row, 0, 0].sum()) for row in (1, 2))
    shear = float(results.quantities.peak_base_shear[0, 0, 0])
    assert f"{100 * force / shear:.2g} % of the peak base shear" in share
    weak = [each.words[0] for each in results.remarks if each.code == "dampers_weak"]
    assert bool(weak) == (force / shear < 0.02)
    if weak:
        advised = int(weak[0].partition("count = ")[2].split()[0])
        again = ran(tmp_path, count=advised)
        reached = max(float(again.quantities.peak_force[row, 0, 0].sum()) for row in (1, 2)) / shear
        assert reached == pytest.approx(0.1, rel=0.2)


def test_dampers_are_small_where_the_largest_command_is_best_and_more_of_them_reduce_more(
    tmp_path: Path,
) -> None:
    def found(count: int) -> tuple[float, float, bool]:
        """Score over that without dampers, share of the largest command, and whether the dampers are called small."""
        results = ran(tmp_path, count=count)
        best = results.row_of("best_passive")
        assert best is not None
        command = float(results.rows[best].label.split()[-2])
        told = "largest_command_best" in [each.code for each in results.remarks]
        return results.score(best).mean / results.score(0).mean, command / 1.88, told

    few, of_few, told = found(300)
    more, *_ = found(600)
    _, of_many, told_of_many = found(10_000)
    assert told
    assert not told_of_many
    assert of_few == 1.0
    assert of_many < 1.0
    assert more < 0.95 * few


@pytest.mark.long
def test_a_damper_that_locks_its_storey_is_told_with_a_smaller_count(tmp_path: Path) -> None:
    pair = f"{PLAIN}\ndifferential = true"
    locked = ran(tmp_path, count=1_000_000, damper=pair)
    (found,) = [each for each in locked.remarks if each.code == "storey_locked"]
    assert "already at i = 0" in found.message
    assert locked.quantities.peak_drift[1, 0, 0][0] < 0.05 * locked.quantities.peak_drift[0, 0, 0][0]
    advised = int(found.words[1].partition("count = ")[2].split()[0])
    freed = ran(tmp_path, count=advised, damper=pair)
    assert not {"storey_locked", "dampers_weak"} & {each.code for each in freed.remarks}


def test_a_damper_of_a_storey_that_the_bare_building_lacks_may_lock_it(tmp_path: Path) -> None:
    text = Path("studies/chapter_2/mass_driver.toml").read_text()
    (tmp_path / "study.toml").write_text(text.replace("actuator = true", 'preset = "kwok2006"'))
    results = mr.run_study(mr.read_study(tmp_path / "study.toml"), threads=1)
    assert "storey_locked" in [each.code for each in results.remarks]
