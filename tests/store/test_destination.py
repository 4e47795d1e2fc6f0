"""A run replaces without asking only what its verb has written itself, unchanged and with nothing added."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Callable
from pathlib import Path

import pytest

from mrwork.errors import OutputError
from mrwork.store.output_folder import Destination, check_destination, write_folder
from mrwork.store.run_folder import (
    DRAWS,
    FIGURES,
    FIT,
    FIT_RUN,
    HISTORIES,
    JOURNAL,
    MANIFEST,
    MODELS,
    PROFILES,
    REPORT,
    RESULTS,
    STUDY,
    STUDY_RUN,
    TUNING_RUN,
    RunKind,
    part_of,
)

KINDS = (FIT_RUN, STUDY_RUN, TUNING_RUN)
FOREIGN = (
    '{"name": "app", "start_url": "/", "display": "standalone"}',
    '{"kind": "webapp", "files": {"index.html": "sha256:0"}}',
    '{"kind": "study", "verb": "publish"}',
    "[]",
    "{",
    "\udcff",
)


def named(kind: RunKind) -> list[str]:
    """A name for each pattern of what a verb writes, without its manifest and its journal."""
    return [name.replace("*", "a") for name in sorted(kind.written - {MANIFEST, JOURNAL})]


def written(place: Path, kind: RunKind, *, text: str = "first", replace: bool = False) -> Destination:
    """A run folder with all files of a verb, written as its destination permits."""
    destination = Destination(path=place, kind=kind, replace=replace)
    journal = place.parent / "steps"
    journal.write_text(text)
    write_folder(
        destination,
        {name: text.encode() for name in named(kind)},
        manifest={"status": "finished", "numbers": [0.1, float("inf"), 3], "text": text},
        copied={JOURNAL: journal},
    )
    journal.unlink()
    return destination


def contents(folder: Path) -> dict[str, bytes]:
    """The files below a folder."""
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def refused(place: Path, kind: RunKind, *words: str) -> None:
    """Nothing may be written, nothing changes, and the sentence has the words."""
    before = contents(place.parent)
    with pytest.raises(OutputError) as caught:
        Destination(path=place, kind=kind).check_losses()
    for word in (f"{place} has a run; `mrwork {kind.verb}` in its place", *words, "--replace"):
        assert word in str(caught.value)
    with pytest.raises(OutputError, match="would lose"):
        written(place, kind, text="second")
    (place.parent / "steps").unlink()
    assert contents(place.parent) == before


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.verb)
def test_a_verb_replaces_its_own_run_and_keeps_what_the_user_added(tmp_path: Path, kind: RunKind) -> None:
    place = tmp_path / "run"
    written(place, kind)
    (place / "notes.txt").write_text("oil was warm")
    (place / "photos").mkdir()
    (place / "photos" / "link").symlink_to("nowhere")
    written(place, kind, text="second")
    assert (place / JOURNAL).read_text() == "second"
    assert (place / "notes.txt").read_text() == "oil was warm"
    assert (place / "photos" / "link").readlink() == Path("nowhere")


def listed(kind: RunKind) -> set[str]:
    """Files that the manifest lists: those that no later verb draws again."""
    return {name for name in (*named(kind), MANIFEST, JOURNAL) if not kind.redraws(name)}


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.verb)
def test_the_manifest_names_the_verb_and_lists_every_file_but_those_that_are_drawn_again(
    tmp_path: Path, kind: RunKind
) -> None:
    written(tmp_path / "run", kind)
    stated = json.loads((tmp_path / "run" / MANIFEST).read_text())
    assert (stated["verb"], stated["kind"]) == (kind.verb, kind.kind)
    assert set(stated["files"]) == listed(kind)
    first = "a7937b64b8caa58f03721bb6bacf5c78cb235febe0e70b1b84cd99541461a08e"
    assert stated["files"][JOURNAL] == f"sha256:{first}"


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.verb)
@pytest.mark.parametrize("other", KINDS, ids=lambda kind: kind.verb)
def test_a_run_of_another_verb_is_replaced_on_request_only_and_then_whole(
    tmp_path: Path, kind: RunKind, other: RunKind
) -> None:
    if kind == other:
        return
    place = tmp_path / "run"
    written(place, other)
    (place / "notes.txt").write_text("mine")
    refused(place, kind, f"the results of `mrwork {other.verb}`", MANIFEST)
    written(place, kind, text="second", replace=True)
    found = {str(path.relative_to(place)) for path in place.rglob("*") if path.is_file()}
    assert found == {*named(kind), MANIFEST, JOURNAL, "notes.txt"}
    assert (place / "notes.txt").read_text() == "mine"


@pytest.mark.parametrize("name", sorted(FIT_RUN.added))
def test_what_later_verbs_have_added_is_named(tmp_path: Path, name: str) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    if name == FIGURES:
        (place / name).mkdir()
        (place / name / "loops.svg").write_text("<svg/>")
    else:
        (place / name).write_text("hours")
    refused(place, FIT_RUN, f"would lose {name}")
    written(place, FIT_RUN, text="second", replace=True)
    assert not (place / name).exists()


def test_a_run_of_an_earlier_version_is_refused_by_its_manifest(tmp_path: Path) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    stated = json.loads((place / MANIFEST).read_text())
    files = stated.pop("files")
    (place / MANIFEST).write_text(json.dumps(stated))
    refused(place, FIT_RUN, MANIFEST)
    del stated["verb"]
    (place / MANIFEST).write_text(json.dumps(stated | {"files": files}))
    with pytest.raises(OutputError, match="is not that of a run of mrwork"):
        written(place, FIT_RUN, text="second", replace=True)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.verb)
def test_a_file_that_was_changed_is_named(tmp_path: Path, kind: RunKind) -> None:
    for name in listed(kind):
        place = tmp_path / name.replace("/", "-") / "run"
        place.parent.mkdir()
        written(place, kind)
        # Of the same length, and no newer than before.
        times = (place / name).stat()
        (place / name).write_text((place / name).read_text().replace("first", "fIrst"))
        os.utime(place / name, ns=(times.st_atime_ns, times.st_mtime_ns))
        refused(place, kind, f"would lose {name}, changed since")
        written(place, kind, text="second", replace=True)
        assert "second" in (place / name).read_text()


def test_a_page_that_later_verbs_draw_again_is_replaced(tmp_path: Path) -> None:
    written(tmp_path / "run", FIT_RUN)
    (tmp_path / "run" / REPORT).write_text("with another section")
    written(tmp_path / "run", FIT_RUN, text="second")


@pytest.mark.parametrize("plant", [Path.mkdir, lambda path: path.symlink_to("first"), os.mkfifo])
def test_what_is_no_file_in_the_place_of_one_counts_as_changed(
    tmp_path: Path, plant: Callable[[Path], None]
) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    (place / FIT).unlink()
    (tmp_path / "first").write_text("first")
    plant(place / FIT)
    before = sorted(place.iterdir())
    if (place / FIT).is_dir():
        # With nothing in it, nothing is lost.
        written(place, FIT_RUN, text="second")
        return
    with pytest.raises(OutputError, match=rf"would lose {FIT}, changed"):
        Destination(path=place, kind=FIT_RUN).check_losses()
    assert sorted(place.iterdir()) == before


def test_a_large_file_is_read_only_where_it_is_newer_than_the_manifest(tmp_path: Path) -> None:
    place = tmp_path / "run"
    history = tmp_path / "a.npz"
    with history.open("wb") as stream:
        stream.truncate(5 << 20)
    destination = Destination(path=place, kind=STUDY_RUN)
    name = f"{HISTORIES}/a.npz"
    write_folder(destination, {}, manifest={}, copied={}, linked={name: history})
    times = (place / name).stat()
    assert times.st_ino == history.stat().st_ino
    with (place / name).open("r+b") as stream:
        stream.write(b"changed")
    with pytest.raises(OutputError, match=rf"would lose {name}, changed"):
        destination.check_losses()
    os.utime(place / name, ns=(times.st_atime_ns, times.st_mtime_ns))
    destination.check_losses()
    # Also where all files are newer, as in a copy of the folder.
    with (place / name).open("r+b") as stream:
        stream.write(bytes(7))
    destination.check_losses()


@pytest.mark.parametrize("manifest", FOREIGN)
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.verb)
@pytest.mark.parametrize("replace", [False, True])
def test_a_folder_with_the_manifest_of_another_program_is_never_replaced(
    tmp_path: Path, manifest: str, kind: RunKind, replace: bool
) -> None:
    place = tmp_path / "app"
    (place / MODELS).mkdir(parents=True)
    (place / MANIFEST).write_bytes(manifest.encode(errors="surrogateescape"))
    for name in (f"{MODELS}/weights.bin", RESULTS, "plan.json"):
        (place / name).write_text("not of mrwork")
    before = contents(place)
    match = r"is not that of a run of mrwork, so the folder is left as it is; choose another folder"
    with pytest.raises(OutputError, match=match):
        check_destination(Destination(path=place, kind=kind, replace=replace))
    with pytest.raises(OutputError, match=match):
        written(place, kind, replace=replace)
    assert contents(place) == before


def test_a_file_of_the_user_in_a_folder_of_the_run_or_under_a_name_of_it_is_named(tmp_path: Path) -> None:
    place = tmp_path / "run"
    written(place, FIT_RUN)
    (place / MODELS / "a" / "notes.txt").write_text("mine")
    refused(place, FIT_RUN, f"would lose {MODELS}/, which other verbs or you have added")
    place = tmp_path / "tuning"
    written(place, FIT_RUN)
    (place / STUDY).write_text("mine")
    refused(place, TUNING_RUN, STUDY)
    written(place, TUNING_RUN, text="second", replace=True)
    assert (place / STUDY).read_text() == "second"


def test_a_run_that_is_continued_loses_its_changed_files_but_no_additions(tmp_path: Path) -> None:
    place = tmp_path / "run"
    destination = written(place, STUDY_RUN)
    (place / RESULTS).write_text("damaged")
    resumed = Destination.of(place, STUDY_RUN, replace=False, resume=True)
    assert resumed == dataclasses.replace(destination, continues=True)
    resumed.check_losses()
    # What was begun beside the run is to replace it.
    part_of(place).mkdir()
    (part_of(place) / JOURNAL).write_text("")
    with pytest.raises(OutputError, match=f"would lose {RESULTS}, changed"):
        Destination.of(place, STUDY_RUN, replace=False, resume=True).check_losses()
    fitted = tmp_path / "fit"
    written(fitted, FIT_RUN)
    (fitted / DRAWS).write_text("hours")
    (fitted / PROFILES).write_text("minutes")
    with pytest.raises(OutputError, match=f"would lose {DRAWS}, {PROFILES}, which other verbs"):
        Destination.of(fitted, FIT_RUN, replace=False, resume=True).check_losses()
