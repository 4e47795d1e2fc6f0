"""`mr.load` opens the folder of every verb that writes one, and says of all else what it is."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import study_samples
import xarray
from command_line import mrwork, printed
from matplotlib.figure import Figure
from refusals import command_refusal, refusal
from verb_folders import verbs_with

import mrwork as mr
from mrwork.store.run_folder import FIT, JOURNAL, MANIFEST, MODELS, RESULTS, RUN_KINDS, RUNS
from mrwork.study.runs import NOT_RUN
from mrwork.study.study_folder import runs_content

TYPES: dict[str, type] = {"identify": mr.StoredRun, "respond": mr.StudyResults, "tune": mr.tuning.TunedStudy}
SLOW = ("synthetic:spencer1997_slow", "synthetic:spencer1997_fast", "--every", 40)


def additions(verb: str) -> list[object]:
    """What a verb takes behind the folder of a fit; a new verb with RUN needs its line."""
    given: dict[str, list[object]] = {
        "intervals": [],
        "calibrate": [*SLOW],
        "predict": [*SLOW],
        "plan": [],
        "report": ["--figures"],
        "export": ["--to", "csv"],
    }
    return given[verb]


@pytest.fixture
def copied(request: pytest.FixtureRequest, runs: Path, tmp_path: Path) -> Path:
    """A copy of the folder of a verb."""
    return Path(shutil.copytree(runs / request.param, tmp_path / "run"))


def verb_of(place: Path) -> str:
    stated: str = json.loads((place / MANIFEST).read_text())["verb"]
    return stated


@pytest.mark.parametrize("verb", verbs_with("out"))
def test_the_folder_of_every_verb_is_read_back(verb: str, runs: Path) -> None:
    found = mr.load(runs / verb)
    assert type(found) is TYPES[verb_of(runs / verb)]
    assert mr.load(runs / verb, type(found)) == found
    assert found._repr_html_().startswith("<div")
    assert repr(found) != ""
    assert found.plot is not None


def test_every_kind_of_folder_is_written_by_a_verb_and_has_a_type(runs: Path) -> None:
    written = {verb_of(runs / verb) for verb in verbs_with("out")}
    assert written == {each.verb for each in RUN_KINDS} == set(TYPES)


@pytest.mark.parametrize("verb", verbs_with("run_folder"))
@pytest.mark.parametrize("copied", ["identify"], indirect=True)
def test_the_folder_of_a_fit_is_read_back_after_every_verb_that_takes_it(verb: str, copied: Path) -> None:
    before = mr.load(copied, mr.StoredRun).fit
    ended = mrwork(verb, copied, *additions(verb))
    assert ended.returncode == 0, ended
    after = mr.load(copied, mr.StoredRun)
    assert after.fit.theta == before.theta
    held = {"intervals": after.profiles, "calibrate": after.bands, "plan": after.plan}
    assert held.get(verb, after) is not None


@pytest.mark.parametrize("copied", ["identify"], indirect=True)
def test_the_folder_of_a_fit_is_read_back_with_draws(copied: Path) -> None:
    printed("intervals", copied, "--posterior", "--steps", 2, "--walkers", 16)
    assert mr.load(copied, mr.StoredRun).draws is not None


def test_a_comparison_of_models_is_the_run_of_the_chosen_one(runs: Path) -> None:
    found = mr.load(runs / "compared", mr.StoredRun)
    assert found.ranking is not None
    assert found.ranking.chosen == found.fit.model


def test_a_study_is_read_back_with_the_numbers_and_figures_that_it_had(runs: Path, inputs: Path) -> None:
    found = mr.load(runs / "respond", mr.StudyResults)
    results = mr.run_study(mr.read_study(inputs / "small.toml"))
    kept, computed = found.to_xarray(), results.to_xarray()
    for group in ("criteria", "quantities"):
        xarray.testing.assert_identical(kept[group].to_dataset(), computed[group].to_dataset())
    for figure in ("storey_profiles", "energies"):
        shown, expected = (getattr(each.plot, figure)(Figure().subplots()) for each in (found, results))
        assert mr.plots.drawn_data(shown).equals(mr.plots.drawn_data(expected))
    assert found.remarks == results.remarks
    fields = "building dampers choices damper_remarks page motions rows"
    for name in fields.split():
        assert getattr(found, name) == getattr(results, name), name
    assert found.demanded == {run: demands for run, demands in results.demanded.items() if demands}


@pytest.mark.parametrize(
    ("copied", "name"),
    [("identify", FIT), ("respond", RESULTS), ("respond", RUNS), ("tune", RESULTS)],
    indirect=["copied"],
)
@pytest.mark.parametrize("content", [b"[]", None])
def test_a_damaged_file_is_refused_with_the_verb_that_writes_it(
    copied: Path, name: str, content: bytes | None
) -> None:
    verb = verb_of(copied)
    (copied / name).unlink()
    if content is not None:
        (copied / name).write_bytes(content)
    refusal(mr.load, copied, match=f"{name}.*`mrwork {verb}`")


def test_a_reader_of_one_kind_names_the_kind_that_came(runs: Path) -> None:
    refusal(mr.load, runs / "respond", mr.StoredRun, match="`StudyResults`, and `StoredRun` was expected")
    refusal(mr.study.read_results, runs / "tune", match="`mrwork tune`, where one of `mrwork respond`")
    refusal(mr.tuning.read_tuning, runs / "identify", match="`mrwork identify`, where one of `mrwork tune`")


@pytest.mark.parametrize("verb", sorted({*verbs_with("run_folder")} - {"export", "report"}))
def test_a_verb_that_takes_a_fit_refuses_other_runs_by_their_verb(verb: str, runs: Path) -> None:
    command_refusal(verb, runs / "respond", *additions(verb), match="is a run of `mrwork respond`")


def test_what_is_no_run_is_refused_by_what_it_is(tmp_path: Path) -> None:
    refusal(mr.load, tmp_path / "missing", match="does not exist")
    (tmp_path / "file").write_text("x")
    refusal(mr.load, tmp_path / "file", match="is a file")
    (tmp_path / "empty").mkdir()
    refusal(mr.load, tmp_path / "empty", match="no manifest.json")
    # A web application has a file of this name, too.
    (tmp_path / "empty" / MANIFEST).write_text('{"name": "app", "display": "standalone", "kind": "webapp"}')
    refusal(mr.load, tmp_path / "empty", match="is not that of a run of mrwork")


def test_the_folder_around_runs_and_what_is_within_one_name_the_runs(runs: Path) -> None:
    refusal(mr.load, runs, match="give one of characterise, compared, identify")
    refusal(mr.load, runs / "identify" / FIT, match="part of the run .*identify")
    refusal(mr.load, runs / "compared" / MODELS / "bingham", match="part of the run .*compared")


def test_an_unfinished_run_is_to_be_resumed(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / JOURNAL).write_text("")
    refusal(mr.load, tmp_path / "run", match="--resume")


@pytest.mark.parametrize("copied", TYPES, indirect=True)
def test_an_interrupted_run_is_read_back_as_one(copied: Path) -> None:
    name = FIT if (copied / FIT).exists() else RESULTS
    document, stated = (json.loads((copied / each).read_text()) for each in (name, MANIFEST))
    if (copied / RUNS).exists():
        results = mr.load(copied, mr.StudyResults)
        runs = study_samples.with_numbers(results.quantities, 0, 0, outcome=NOT_RUN)
        (copied / RUNS).write_bytes(runs_content(replace(results, quantities=runs)))
    else:
        document["status"] = "interrupted"
    stated["status"] = "interrupted"
    (copied / name).write_text(json.dumps(document))
    (copied / MANIFEST).write_text(json.dumps(stated))
    found = mr.load(copied, changed=True)
    held = found.fit if isinstance(found, mr.StoredRun) else found
    assert held.status == "interrupted"
