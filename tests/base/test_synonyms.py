"""Words of the field that have another name here lead to a name that exists, wherever names are checked."""

from __future__ import annotations

import argparse
import inspect
from collections.abc import Iterator
from pathlib import Path

import pytest
from command_line import mrwork

import mrwork as mr
from mrwork.base.keys import keys_of, meant, name_in_file, tables
from mrwork.base.synonyms import _WORDS, without_style
from mrwork.cli.door import whole_parser
from mrwork.control import SETTINGS, WeightWishes
from mrwork.dampers.spec import damper_models
from mrwork.errors import ArgumentError, SettingError
from mrwork.study.arrangements import CONSTANT_LAWS
from mrwork.study.schema import StudyTable


def options(parser: argparse.ArgumentParser) -> Iterator[str]:
    for action in parser._actions:
        yield from (option.lstrip("-") for option in action.option_strings)
        if isinstance(action, argparse._SubParsersAction):
            for verb in action.choices.values():
                yield from options(verb)


def known_names() -> set[str]:
    """Keys of files, settings and names of laws, models, options of commands, and arguments of public functions."""
    kinds = (*(kind for _, kind in tables(StudyTable)), *SETTINGS.values(), WeightWishes)
    names = {name_in_file(entry) for kind in kinds for entry in keys_of(kind)}
    names |= {*SETTINGS, *CONSTANT_LAWS, *(spec.name for spec in damper_models()), *options(whole_parser())}
    for name in dir(mr):
        if callable(function := getattr(mr, name)):
            try:
                names |= {*inspect.signature(function).parameters}
            except ValueError:  # of a class of C
                continue
    return {without_style(name) for name in names}


def test_every_word_leads_to_a_name_that_exists() -> None:
    known = known_names()
    targets = {target for alike in _WORDS for each in alike.split() for target in each.split("|")}
    assert {target for target in targets if without_style(target) not in known} == set()


def test_no_word_stands_twice_in_a_row() -> None:
    for targets, words in _WORDS.items():
        plain = [without_style(word).removesuffix("s") for word in words.split()]
        assert len(plain) == len(set(plain)), targets


TABLES = {heading: [name_in_file(entry) for entry in keys_of(kind)] for heading, kind in tables(StudyTable)}
WEIGHTS = [name_in_file(entry) for entry in keys_of(SETTINGS["clipped_optimal"])]


@pytest.mark.parametrize(
    ("heading", "word", "key"),
    [
        *(("", word, "controller") for word in ("law", "controllers", "control", "lqr", "LQG", "algorithm")),
        *(
            ("", word, "motion")
            for word in ("earthquake", "ground_motion", "records", "Ground-Motions", "loadCase")
        ),
        *(("", word, "damper") for word in ("dampers", "mr_damper", "MRDampers", "device", "link")),
        *(("", word, "building") for word in ("structure", "frame", "shear_frame")),
        *(("", word, "hardware") for word in ("loop", "sensors")),
        *(("", word, "tune") for word in ("tuning", "optimisation")),
        *(("[building]", word, "masses") for word in ("m", "M", "floor_mass", "lumped_masses")),
        *(
            ("[building]", word, "stiffnesses")
            for word in ("k", "K", "storey_stiffness", "story_stiffnesses")
        ),
        *(("[building]", word, "rayleigh or modal_damping") for word in ("zeta", "damping_ratio", "xi")),
        *(("[building]", word, "n_storeys") for word in ("stories", "n_floors", "num_stories", "levels")),
        *(("[building]", word, "tuned_mass") for word in ("tmd", "tuned_mass_damper")),
        *(("[building.modal_damping]", word, "ratios") for word in ("zeta", "damping_ratio")),
        *(("[building.isolation]", word, "period") for word in ("T", "T1", "natural_period")),
        *(("[building.isolation]", word, "ratio") for word in ("zeta", "damping_ratio")),
        *(("[[building.tuned_mass]]", word, "frequency") for word in ("f", "omega", "T1")),
        *(("[[damper]]", word, "largest_command") for word in ("current", "voltage", "max_current", "Imax")),
        *(("[[damper]]", word, "model") for word in ("type", "damper_type")),
        *(("[[damper]]", word, "count") for word in ("n", "number")),
        *(("[[damper]]", word, "storey") for word in ("floor", "story", "level")),
        *(("[[controller]]", word, "law") for word in ("algorithm", "type", "control_law", "controller")),
        *(
            ("[[controller]]", word, "settings")
            for word in ("weights", "parameters", "R", "Q", "control_weight")
        ),
        *(("[[controller]]", word, "gain") for word in ("K", "gain_matrix")),
        *(("[[motion]]", word, "file") for word in ("record", "earthquake", "filename", "path")),
        *(("[[motion]]", word, "pga") for word in ("peak", "PGA_g", "peak_ground_acceleration", "amplitude")),
        *(("[[motion]]", word, "factor") for word in ("scale", "scale_factor", "SF")),
        *(("[[motion]]", word, "dt") for word in ("time_step", "deltaT", "delta_t")),
        *(("[hardware]", word, "sample_time") for word in ("sampling_time", "sampling_rate", "ts")),
        *(("[hardware]", word, "step") for word in ("dt", "time_step")),
        *(("[hardware]", word, "delay") for word in ("tau", "latency", "time_delay")),
        *(("[[tune]]", word, "search") for word in ("algorithm", "optimizer")),
        *(("[[tune]]", word, "laws") for word in ("law", "controllers")),
        *(("settings", word, "control_weight") for word in ("r", "R")),
        *(("settings", word, "state_weight") for word in ("q", "Q")),
    ],
)
def test_a_word_of_the_field_is_answered_with_the_key(heading: str, word: str, key: str) -> None:
    known = TABLES["[hardware]"] if heading == "[hardware]" else {**TABLES, "settings": WEIGHTS}[heading]
    assert " or ".join(meant(word, known)) == key


def test_files_options_and_arguments_look_up_the_same_words(tmp_path: Path) -> None:
    (tmp_path / "study.toml").write_text('[[law]]\nlaw = "passive_on"\n')
    with pytest.raises(SettingError, match="no key 'law', did you mean controller"):
        mr.read_study(tmp_path / "study.toml")
    assert "did you mean --out" in mrwork("respond", tmp_path / "study.toml", "--output", "x").stderr
    assert "did you mean --threads" in mrwork("respond", tmp_path / "study.toml", "--n-jobs", "2").stderr
    with pytest.raises(ArgumentError, match="did you mean `threads`"):
        mr.run_study(None, n_jobs=2)  # type: ignore[call-arg,arg-type] # wrong on purpose


def test_a_name_that_is_known_is_never_taken_for_another() -> None:
    for known in TABLES.values():
        assert all(meant(name, known) == [name] for name in known)
