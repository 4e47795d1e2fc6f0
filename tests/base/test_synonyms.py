"""Words of the field that have another name here lead to a name that exists, wherever names are checked."""

import argparse
import inspect
from collections.abc import Iterator

import pytest

import mrwork as mr
from mrwork.base.keys import keys_of, meant, tables
from mrwork.base.synonyms import SYNONYMS, without_style
from mrwork.cli.door import parser, verbs
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.laws.weights import WeightWishes
from mrwork.dampers.spec import damper_models
from mrwork.study.schema import CONSTANT_LAWS, StudyTable


def options(parser: argparse.ArgumentParser) -> Iterator[str]:
    for action in parser._actions:
        yield from (option.lstrip("-") for option in action.option_strings)
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                yield from options(verb)


def known_names() -> set[str]:
    """Keys of files, settings and names of laws, models, options of commands, and arguments of public functions."""
    kinds = (*(kind for _, kind in tables(StudyTable)), *SETTINGS.values(), WeightWishes)
    names = {entry.name_in_file for kind in kinds for entry in keys_of(kind)}
    names |= {*SETTINGS, *CONSTANT_LAWS, *(spec.name for spec in damper_models()), *options(parser(verbs()))}
    for name in dir(mr):
        if callable(function := getattr(mr, name)):
            try:
                names |= {*inspect.signature(function).parameters}
            except ValueError:  # of a class of C
                continue
    return {without_style(name) for name in names}


def test_every_word_leads_to_a_name_that_exists() -> None:
    known = known_names()
    targets = {target for alike in SYNONYMS for each in alike.split() for target in each.split("|")}
    assert {target for target in targets if without_style(target) not in known} == set()


TABLES = {heading: [entry.name_in_file for entry in keys_of(kind)] for heading, kind in tables(StudyTable)}
WEIGHTS = [entry.name_in_file for entry in keys_of(SETTINGS["clipped_optimal"])]


@pytest.mark.parametrize(
    ("heading", "word", "key"),
    [
        ("", "lqr", "controller"),
        ("", "Ground-Motions", "motion"),
        ("[building]", "M", "masses"),
        ("[building]", "story_stiffnesses", "stiffnesses"),
        ("[building]", "zeta", "rayleigh or modal_damping"),
        ("[building.modal_damping]", "zeta", "ratios"),
        ("[[damper]]", "current", "command or largest_command"),
        ("[[controller]]", "R", "settings"),
        ("[[motion]]", "PGA_g", "pga"),
        ("[hardware]", "sampling_rate", "sample_time"),
        ("settings", "R", "control_weight"),
        ("settings", "q", "state_weight"),
    ],
)
def test_a_word_of_the_field_is_answered_with_the_key(heading: str, word: str, key: str) -> None:
    known = {**TABLES, "settings": WEIGHTS}[heading]
    assert " or ".join(meant(word, known)) == key
    assert all(meant(name, known) == [name] for name in known)
