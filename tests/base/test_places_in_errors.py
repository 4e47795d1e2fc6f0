"""Mistakes of a document, listed below its name."""

from __future__ import annotations

import pickle

import pytest

from mrwork.base.places import Place, read_each
from mrwork.errors import MistakesError, SettingError


def refused_keys(place: Place, *keys: str) -> MistakesError:
    """The refusal of several keys of one place."""

    def read(key: str) -> None:
        place.within(key).refuse("is negative; give a positive number")

    with pytest.raises(MistakesError) as told:
        read_each(read, keys)
    return told.value


def test_a_key_with_the_name_of_its_document_is_listed() -> None:
    error = refused_keys(Place(origin="frame", arguments={"frame": "frame", "mass": "mass"}), "frame", "mass")
    head, *listed = str(error).split("\n")
    assert head == "frame has 2 mistakes:"
    assert [entry.split(":")[0].strip() for entry in listed] == ["frame", "mass"]
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_a_mistake_of_another_document_keeps_its_name() -> None:
    mistakes = [
        Place(origin="study.toml", lines={(): 1}).error(SettingError, "one"),
        Place(origin="frame.toml", path=("mass",), lines={("mass",): 7}).error(SettingError, "two"),
    ]
    listed = str(MistakesError("study.toml", mistakes)).split("\n")[1:]
    assert [entry.strip() for entry in listed] == ["one", "frame.toml, line 7: two"]


def test_a_sentence_that_begins_with_the_document_is_listed_whole() -> None:
    mistakes = [SettingError("study.toml: in two folders"), SettingError("absent")]
    assert "\n  study.toml: in two folders\n" in str(MistakesError("study.toml", mistakes))
