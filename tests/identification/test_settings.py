"""Settings of an identification are one value, which a fit gives back as it was."""

import json
from dataclasses import fields, replace

import pytest
from refusals import refusal

import mrwork as mr
from mrwork.dampers import damper
from mrwork.identification import FitSettings, Race
from mrwork.identification.problem import Problem, problem_fingerprint
from mrwork.identification.settings import resize_search, search_named, searches
from mrwork.search import EfficientGA, StopRules
from mrwork.store.codec import differences

TEST = mr.synthetic_test("rd1005_1a")
SPEC = damper("static_hysteretic")

# Every field at a value that is not its default.
OTHER = FitSettings(
    search=EfficientGA(population=8, stop=StopRules(max_generations=2, target=None)),
    bounds={"alpha": (10.0, 500.0)},
    starts=({"alpha": 100.0},),
    ties={"f0": "0.1*alpha"},
    force_exponent=0.5,
    engine="optimistix",
    observe=("average=0.1T", "gain=each", "lag=free"),
    rng=3,
)


def test_each_setting_survives_its_record() -> None:
    for each in fields(FitSettings):
        assert getattr(OTHER, each.name) != getattr(FitSettings(), each.name), each.name
    assert FitSettings.of_record(json.loads(json.dumps(OTHER.as_record()))) == OTHER


def test_a_setting_that_has_ended_is_left_out_of_an_older_record() -> None:
    assert FitSettings.of_record(OTHER.as_record() | {"power": 4.0}) == OTHER


@pytest.mark.parametrize("name", searches())
def test_each_search_survives_its_record(name: str) -> None:
    settings = FitSettings(search=search_named(name))
    assert FitSettings.of_record(json.loads(json.dumps(settings.as_record()))) == settings


def test_each_setting_is_part_of_the_fingerprint() -> None:
    settings = FitSettings(search=Race())
    facts = problem_fingerprint(Problem.of(SPEC, (TEST,), settings))
    for each in fields(FitSettings):
        changed = replace(settings, **{each.name: getattr(OTHER, each.name)})
        assert differences(facts, problem_fingerprint(Problem.of(SPEC, (TEST,), changed))), each.name


# The gain of each test leaves the size of the force open.
@pytest.mark.filterwarnings("ignore:the gain of the force")
def test_a_fit_has_the_settings_it_was_made_with() -> None:
    settings = replace(OTHER, engine="lanes")
    fit = mr.identify(SPEC, TEST, **{each.name: getattr(settings, each.name) for each in fields(FitSettings)})
    # What was fitted is given to fits that follow.
    (lag,) = fit.effects
    observe = (*settings.observing.words[:-1], f"lag={lag.value}")
    assert fit.settings == replace(settings, observe=observe)


@pytest.mark.parametrize("name", ["particle_swarm_constriction", "differential_evolution_random", "genetic"])
def test_a_search_keeps_its_name_where_its_size_is_another(name: str) -> None:
    search = resize_search(search_named(name), population=12, generations=3)
    assert FitSettings(search=search).as_record()["search"]["name"] == name


def test_a_search_of_another_name_is_refused() -> None:
    refusal(mr.identify, SPEC, TEST, search=EfficientGA(name="mine", population=8), match="'mine'")
