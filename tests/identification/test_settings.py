"""Settings of an identification are one value, which a fit gives back as it was."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from typing import Any

import pytest

import mrwork as mr
from mrwork.dampers.spec import damper
from mrwork.errors import RecordError, SettingError
from mrwork.identification.multistart import Multistart
from mrwork.identification.problem import Problem, fingerprint_of
from mrwork.identification.settings import FitSettings, search_named, searches
from mrwork.search import EfficientGA, StopRules
from mrwork.store.fingerprint import differences

TEST = mr.synthetic_test("rd1005_1a")
SPEC = damper("static_hysteretic")

# Every field at a value that is not its default.
OTHER = FitSettings(
    search=EfficientGA(population=8, stop=StopRules(max_generations=2, target=None)),
    bounds={"alpha": (10.0, 500.0)},
    starts=({"alpha": 100.0},),
    power=4.0,
    engine="twin",
    nuisances=("level",),
    rng=3,
)


def test_each_setting_survives_its_record() -> None:
    for each in fields(FitSettings):
        assert getattr(OTHER, each.name) != getattr(FitSettings(), each.name), each.name
    assert FitSettings.of_record(json.loads(json.dumps(OTHER.as_record()))) == OTHER


@pytest.mark.parametrize("name", searches())
def test_each_search_survives_its_record(name: str) -> None:
    settings = FitSettings(search=search_named(name))
    assert FitSettings.of_record(json.loads(json.dumps(settings.as_record()))) == settings


def test_each_setting_is_part_of_the_fingerprint() -> None:
    settings = FitSettings(search=Multistart())
    facts = fingerprint_of(Problem.of(SPEC, (TEST,), settings))
    for each in fields(FitSettings):
        changed = replace(settings, **{each.name: getattr(OTHER, each.name)})
        assert differences(facts, fingerprint_of(Problem.of(SPEC, (TEST,), changed))), each.name


def test_a_fit_has_the_settings_it_was_made_with() -> None:
    settings = replace(OTHER, engine="lanes")
    fit = mr.identify(
        SPEC,
        TEST,
        **{each.name: getattr(settings, each.name) for each in fields(FitSettings)},  # type: ignore[arg-type]
    )
    assert fit.settings == settings


@pytest.mark.parametrize(
    ("search", "kind"),
    [({"samples": 5, "closeness": 0.01}, Multistart), ({"population": 9, "stop": {}}, EfficientGA)],
)
def test_a_record_of_the_first_version_still_tells_its_search(search: dict[str, Any], kind: type) -> None:
    settings = FitSettings.of_record({"search": search, "bounds": {"alpha": [1, 2]}, "windows": {}})
    assert type(settings.search) is kind
    assert settings.bounds == {"alpha": (1, 2)}
    assert settings.power == 2.0


@pytest.mark.parametrize("record", [{"search": {"kind": "none"}}, {"search": 3}, {"power": "two"}])
def test_a_damaged_record_is_refused(record: dict[str, Any]) -> None:
    with pytest.raises(RecordError, match="run `mrwork identify` again"):
        FitSettings.of_record(record)


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ({"power": 1.0}, "give 2"),
        ({"engine": "gpu"}, "lanes, twin"),
        ({"nuisances": ("gain",)}, "offset, level"),
    ],
)
def test_an_impossible_setting_is_refused(setting: dict[str, Any], words: str) -> None:
    with pytest.raises(SettingError, match=words):
        FitSettings(**setting)
