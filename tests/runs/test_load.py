"""`mr.load` opens the folder of every verb that writes one, and says of all else what it is."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray
from command_line import mrwork
from sentences import Refused
from verb_folders import verbs_with

import mrwork as mr
from mrwork.store.run_folder import FIT, JOURNAL, MANIFEST, MODELS, RESULTS, RUN_KINDS, RunKind

TYPES: dict[str, type] = {"identify": mr.StoredRun, "respond": mr.StudyResults, "tune": mr.TuningResults}
SLOW = ("synthetic:spencer1997_slow", "synthetic:spencer1997_fast", "--every", 40)


def additions(verb: str) -> list[object]:
    """What a verb takes behind the folder of a fit; a new verb with RUN needs its line."""
    given: dict[str, list[object]] = {
        "profile": [],
        "sample": ["--steps", 2, "--walkers", 16],
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
    assert after.fit.estimates == before.estimates
    held = {"profile": after.profiles, "sample": after.draws, "calibrate": after.bands, "plan": after.plan}
    assert held.get(verb, after) is not None


def test_a_comparison_of_models_is_the_run_of_the_chosen_one(runs: Path) -> None:
    found = mr.load(runs / "compared", mr.StoredRun)
    assert found.ranking is not None
    assert found.ranking.chosen == found.fit.model


def test_a_study_is_read_back_with_the_numbers_and_figures_that_it_had(runs: Path, inputs: Path) -> None:
    found, results = (
        mr.load(runs / "respond", mr.StudyResults),
        mr.run_study(mr.read_study(inputs / "small.toml")),
    )
    kept, computed = found.to_xarray(), results.to_xarray()
    for group in ("criteria", "quantities"):
        xarray.testing.assert_identical(kept[group].to_dataset(), computed[group].to_dataset())
    for figure in ("storey_profiles", "energies"):
        drawn, expected = (getattr(each.plot, figure)(data=True) for each in (found, results))
        assert np.array_equal(drawn.to_numpy(), expected.to_numpy())
    assert found.warnings() == results.warnings()


@pytest.mark.parametrize("copied", ["respond"], indirect=True)
def test_quantities_that_do_not_fit_are_refused(copied: Path, refused: Refused) -> None:
    whole = (copied / RESULTS).read_text()
    for forge in (
        lambda run: run["quantities"]["peak_drift"].pop(),
        lambda run: run["quantities"].pop("peak_force"),
        lambda run: run["quantities"].update(input_energy=[1.0]),
        lambda run: run["quantities"].update(peak_force=1.0),
    ):
        document = json.loads(whole)
        forge(document["results"][1])
        (copied / RESULTS).write_text(json.dumps(document))
        refused(mr.load, copied)


@pytest.mark.parametrize("copied", TYPES, indirect=True)
@pytest.mark.parametrize("name", [MANIFEST, FIT, RESULTS])
@pytest.mark.parametrize("content", [b"", b"\xff", b"[]", b"{", b'{"kind": "app", "verb": "publish"}', None])
def test_a_damaged_file_is_refused_with_the_verb_that_writes_it(
    copied: Path, name: str, content: bytes | None
) -> None:
    if not (copied / name).exists():
        pytest.skip("no file of this verb")
    verb = verb_of(copied)
    (copied / name).unlink()
    if content is not None:
        (copied / name).write_bytes(content)
    with pytest.raises(mr.errors.RecordError) as caught:
        mr.load(copied)
    said = str(caught.value)
    assert said.isprintable()
    assert name in said
    assert f"`mrwork {verb}`" in said


def test_a_reader_of_one_kind_names_the_kind_that_came(runs: Path, refused: Refused) -> None:
    for kind in (mr.StoredRun, mr.StudyResults, mr.TuningResults):
        for verb, own in TYPES.items():
            if own is not kind:
                refused(mr.load, runs / verb, kind)
    refused(mr.load, runs / "identify", int)
    for verb in ("identify", "tune"):
        refused(mr.study.read_results, runs / verb)
    for verb in ("identify", "respond"):
        refused(mr.tuning.read_tuning, runs / verb)


@pytest.mark.parametrize("verb", sorted({*verbs_with("run_folder")} - {"export", "report"}))
def test_a_verb_that_takes_a_fit_refuses_other_runs_by_their_verb(verb: str, runs: Path) -> None:
    for other in ("respond", "tune"):
        ended = mrwork(verb, runs / other, *additions(verb))
        assert ended.returncode == 2
        assert f"is a run of `mrwork {other}`, where one of `mrwork identify` was expected" in ended.stderr
        assert ended.stderr.count("\n") == 1


def test_what_is_no_run_is_refused_by_what_it_is(runs: Path, tmp_path: Path, refused: Refused) -> None:
    def loaded(name: str) -> None:
        refused(mr.load, tmp_path / name)

    loaded("missing")
    (tmp_path / "file").write_text("x")
    loaded("file")
    (tmp_path / "empty").mkdir()
    loaded("empty")
    assert mrwork("init", "rig", tmp_path / "rig").returncode == 0
    loaded("rig")
    # A web application has a file of this name, too.
    (tmp_path / "app").mkdir()
    (tmp_path / "app" / MANIFEST).write_text('{"name": "app", "display": "standalone", "kind": "webapp"}')
    loaded("app")
    (tmp_path / "app" / "icons").mkdir()
    loaded("app/icons")
    refused(mr.load, "a\0b")


def test_the_folder_around_runs_and_what_is_within_one_name_the_runs(
    runs: Path, tmp_path: Path, refused: Refused
) -> None:
    for verb in TYPES:
        shutil.copytree(runs / verb, tmp_path / "out" / verb)
    shutil.copytree(runs / "compared", tmp_path / "out" / "compared")
    refused(mr.load, tmp_path / "out")
    refused(mr.load, tmp_path / "out" / "identify" / FIT)
    refused(mr.load, tmp_path / "out" / "respond" / "histories")
    refused(mr.load, tmp_path / "out" / "compared" / MODELS / "bingham")


def test_an_unfinished_run_is_to_be_resumed(tmp_path: Path, refused: Refused) -> None:
    (tmp_path / "run.part").mkdir()
    (tmp_path / "run.part" / JOURNAL).write_text("")
    refused(mr.load, tmp_path / "run.part")
    refused(mr.load, tmp_path / "run")


@pytest.mark.parametrize("copied", TYPES, indirect=True)
def test_an_interrupted_run_is_read_back_as_one(copied: Path) -> None:
    name = FIT if (copied / FIT).exists() else RESULTS
    document, stated = (json.loads((copied / each).read_text()) for each in (name, MANIFEST))
    if "complete" in document:
        document["complete"], document["results"] = False, document["results"][:-1]
    else:
        document["status"] = "interrupted"
    stated["status"] = "interrupted"
    (copied / name).write_text(json.dumps(document))
    (copied / MANIFEST).write_text(json.dumps(stated))
    found = mr.load(copied)
    held = found.fit if isinstance(found, mr.StoredRun) else found
    assert held.status == "interrupted"


@pytest.mark.parametrize("kind", RUN_KINDS, ids=lambda kind: kind.verb)
def test_a_run_whose_name_ends_as_that_of_a_journal_is_a_run(
    kind: RunKind, runs: Path, tmp_path: Path
) -> None:
    place = Path(shutil.copytree(runs / kind.verb, tmp_path / "run.part"))
    assert type(mr.load(place)) is TYPES[kind.verb]


def test_a_manifest_that_states_neither_kind_nor_verb_is_of_what_lies_beside_it(
    runs: Path, tmp_path: Path
) -> None:
    for kind in RUN_KINDS:
        place = Path(shutil.copytree(runs / kind.verb, tmp_path / kind.verb))
        (place / MANIFEST).write_text("{}")
        assert type(mr.load(place)) is TYPES[kind.verb]
