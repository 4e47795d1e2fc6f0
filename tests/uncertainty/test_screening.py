"""Screening of families: which ones go on, on rigs of forms that no family has."""

import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import printed
from record_files import write_test
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.dampers.spec import DEFAULT_MODELS
from mrwork.identification.settings import FitSettings
from mrwork.store.journal import Journal
from mrwork.uncertainty.choice.screening import Screening, better_family, compared_models, screen_families

MOTIONS = ((0.010, 1.0), (0.006, 2.0), (0.014, 0.5))
SETTINGS = FitSettings()


def thinning_test(motion, command=None, rng=0):
    """Friction with a shoulder before it slips, 20 % larger one way, and a viscous force that grows as v^0.5."""
    amplitude, frequency = motion
    time = np.arange(0.0, 5.0 / frequency, 0.004 / frequency)
    angle = 2.0 * np.pi * frequency * time
    x, v = amplitude * np.sin(angle), 2.0 * np.pi * frequency * amplitude * np.cos(angle)
    friction = (150.0 + 500.0 * (command or 0.0)) * np.tanh((v + 6.0 * x) / 0.008)
    force = friction * np.where(v > 0.0, 1.2, 1.0) + 1200.0 * np.sign(v) * np.sqrt(np.abs(v))
    return mr.test_from_arrays(
        name=f"{1e3 * amplitude:g} mm {frequency:g} Hz {command} A",
        time=time,
        displacement=x,
        velocity=v,
        force=force + 4.0 * np.random.default_rng(rng).standard_normal(time.size),
        synthetic=True,
        **({} if command is None else {"current": command}),
    )


@pytest.fixture(scope="module")
def rig():
    """Three motions at four commands."""
    return tuple(
        thinning_test(motion, command, rng=number)
        for number, command in enumerate((0.0, 0.4, 0.8, 1.2))
        for motion in MOTIONS
    )


@pytest.fixture(scope="module")
def journal(tmp_path_factory):
    return tmp_path_factory.mktemp("screening") / "screening.jsonl"


@pytest.fixture(scope="module")
def rows(rig, journal):
    return screen_families(rig, settings=SETTINGS, threads=1, journal_of=lambda step: Journal(journal))


def test_every_family_is_screened(rows):
    others = {"bouc_wen", "modified_bouc_wen"}  # identified in the parameters of another one
    assert {row.model for row in rows} == {spec.name for spec in mr.damper_models()} - others


def test_commands_are_the_lowest_a_middle_and_the_highest(rig):
    excerpts = Screening.of(rig, SETTINGS, 1).excerpts
    assert [float(np.mean(test.command_in("A"))) for test in excerpts] == [0.0] * 3 + [0.8] * 3 + [1.2] * 3


def test_families_that_go_on_are_as_good_as_the_best_and_few(rows):
    kept = [row for row in rows if row.verdict == "goes on"]
    assert 1 <= len(kept) <= 4
    for row in kept:
        assert row.left_out_behind <= max(row.left_out_behind_error or 0.0, 0.1)


def test_a_family_that_cannot_follow_the_rig_does_not_go_on(rows):
    found = {row.model: row for row in rows}
    assert found["maxwell"].verdict == found["orifice"].verdict == "behind"
    kept = max(row.left_out_percent for row in rows if row.verdict == "goes on")
    assert kept > found["normalised_bouc_wen"].left_out_percent


def test_of_families_with_the_same_loop_the_simplest_goes_on():
    tests = tuple(
        sinusoidal_test(
            "viscous_dahl",
            (800.0, 300.0 + 400.0 * command, 2000.0, 20.0),
            motion,
            noise=0.02,
            command=command,
        )
        for command in (0.0, 1.0)
        for motion in MOTIONS
    )
    rows = screen_families(tests, settings=SETTINGS, threads=1)
    assert [row.model for row in rows if row.verdict == "goes on"] == ["viscous_dahl"]


def test_threads_change_nothing(rig, rows):
    screening = Screening.of(rig, SETTINGS, 2)
    again = screening.standing(mr.damper("viscous_dahl"))
    assert again.left_out == next(row.left_out for row in rows if row.model == "viscous_dahl")


def test_a_resumed_screening_computes_nothing(rig, rows, journal):
    written = journal.read_bytes()
    resumed = screen_families(
        rig, settings=SETTINGS, threads=1, journal_of=lambda step: Journal(journal, resume=True)
    )
    assert (resumed, journal.read_bytes()) == (rows, written)


def test_screened_models_are_those_that_go_on(rig, rows, journal):
    recalled = {"threads": 1, "on_progress": None, "journal_of": lambda step: Journal(journal, resume=True)}
    specs, remarks, screened = compared_models("screened", rig, SETTINGS, **recalled)
    assert {spec.name for spec in specs} == {row.model for row in rows if row.verdict == "goes on"}
    assert (remarks, screened) == ((), rows)


def test_single_test_is_screened_by_its_halves():
    rows = screen_families((thinning_test(MOTIONS[0]),), settings=SETTINGS, threads=1)
    own = next(row for row in rows if row.model == "bingham")
    (remark,) = better_family(rows, "bingham")
    assert rows[0].left_out_percent - own.left_out_percent > 2.0
    assert remark.words[2] == rows[0].model
    assert not [*better_family(rows, rows[0].model)]


def test_identify_of_a_test_names_a_family_that_predicts_it_better(tmp_path):
    file = write_test(tmp_path / "one.csv", thinning_test(MOTIONS[0]))
    fit = json.loads(printed("identify", file, "--threads", "1", "--out", tmp_path / "run", "--json"))
    assert fit["model"] == "normalised_bouc_wen"
    better = {each["words"][2] for each in fit["remarks"] if each["code"] == "family_predicts_better"}
    assert better == {"non_symmetric_bouc_wen"}


@pytest.mark.long
def test_shell_and_python_choose_the_same_where_no_model_is_named(rig, rows, tmp_path):
    files = [write_test(tmp_path / f"{number}.csv", test) for number, test in enumerate(rig)]
    out = tmp_path / "run"
    shown = json.loads(printed("identify", *files, "--law", "auto", "--threads", "1", "--out", out, "--json"))
    screened = mr.load(out).ranking.screened
    assert len(screened) == len(shown["choice_of_laws"]["screened"]) == len(rows)
    assert shown["model"] in {row.model for row in screened if row.verdict == "goes on"}
    # With the settings of the shell, which has read the tests from their files.
    tests = mr.read_damper_tests(files)
    found = mr.choose_laws("screened", tests, settings=mr.load(out).fit.settings.again, threads=1)
    assert [row.model for row in found.ranking.screened] == [row.model for row in screened]
    assert (found.best.model, found.best.theta) == (shown["model"], mr.load(out).fit.theta)


def test_nothing_is_screened_where_the_command_varies():
    test = thinning_test(MOTIONS[0], 0.5)
    varying = replace(test, current=np.linspace(0.0, 1.0, test.n_time))
    assert screen_families((varying,), settings=SETTINGS, threads=1) == ()
    specs, _, screened = compared_models(
        "screened", (varying,), SETTINGS, threads=1, on_progress=None, journal_of=None
    )
    assert (tuple(spec.name for spec in specs), screened) == (DEFAULT_MODELS, ())
