"""Choice of model: the true family is chosen, also after an interrupt and where another family fails or collapses."""

import json
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from refusals import command_refusal, refusal
from resumed_steps import stopped_and_resumed
from sinusoidal_tests import MOTIONS, sinusoidal_test

from mrwork import Progress, identify
from mrwork.dampers import damper
from mrwork.errors import MrworkWarning
from mrwork.identification import Fit, FitSettings, Race
from mrwork.records import DamperTest
from mrwork.uncertainty import Choice, choose_model
from mrwork.uncertainty.bands.prediction import halves
from mrwork.uncertainty.choice.collapse import with_collapses
from mrwork.uncertainty.choice.ranking import Standing, rank

VISCOUS_DAHL = (800.0, 900.0, 2000.0, 20.0)
FEW = FitSettings(search=Race(samples=6, starts=4, population=12, generations=5, most_rounds=1))
TESTED = MOTIONS[:3]
MODELS = ("dahl", "viscous_dahl", "normalised_bouc_wen")


@pytest.fixture(scope="module")
def tests() -> tuple[DamperTest, ...]:
    return tuple(
        sinusoidal_test("viscous_dahl", VISCOUS_DAHL, motion, noise=0.02, rng=seed)
        for seed, motion in enumerate(TESTED)
    )


@pytest.fixture(scope="module")
def choice(tests: tuple[DamperTest, ...]) -> Choice:
    return choose_model(tests, MODELS, settings=FEW, threads=1)


@pytest.fixture(scope="module")
def whole(tests: tuple[DamperTest, ...]) -> Choice:
    return choose_model(tests[:2], ["dahl", "viscous_dahl"], settings=FEW, threads=1)


def standings(choice: Choice) -> list[dict[str, Any]]:
    """All but the clock."""
    return [asdict(each) | {"seconds": 0.0} for each in choice.ranking.standings]


def test_data_go_to_the_family_that_made_them_not_to_a_larger_one_that_contains_it(choice: Choice) -> None:
    found = {each.model: each for each in choice.ranking.standings}
    assert choice.ranking.chosen == "viscous_dahl"
    # Its knee is that of Dahl: n is on its bound.
    assert found["normalised_bouc_wen"].verdict == "collapsed"
    assert found["normalised_bouc_wen"].same_as == "viscous_dahl"
    assert found["dahl"].verdict == "behind"
    # Noise of 2 % is all that is left.
    assert found["viscous_dahl"].left_out_percent == pytest.approx(98.0, abs=0.4)
    assert "Viscous and Dahl with 4 parameters is chosen" in choice.ranking.sentence


def test_fits_are_those_of_all_tests_in_the_order_of_the_ranking(choice: Choice) -> None:
    assert [fit.model for fit in choice.fits] == [each.model for each in choice.ranking.standings]
    assert choice.best.model == choice.ranking.chosen
    assert all(len(fit.quality) == len(TESTED) for fit in choice.fits)
    assert choice.ranking.n_folds == len(TESTED)


def test_a_family_that_fails_is_a_row(tests: tuple[DamperTest, ...]) -> None:
    # A bound that one family does not admit, and the other keeps.
    with pytest.warns(MrworkWarning, match=r"not compared, as it failed: lugre"):
        choice = choose_model(
            tests[:2], ["dahl", "lugre"], settings=replace(FEW, bounds={"sigma_0": (1e20, 1e21)}), threads=1
        )
    last = choice.ranking.standings[-1]
    assert (last.model, last.verdict, last.status) == ("lugre", "failed", "failed")
    assert "sigma_0" in last.reason
    assert choice.ranking.chosen == "dahl"
    assert "not_compared" in {each.code for each in choice.ranking.remarks}


@pytest.mark.parametrize(("model", "task"), [("viscous_dahl", "left out"), ("dahl", "left out")])
def test_interrupted_and_resumed_is_as_if_nothing_had_happened(
    tests: tuple[DamperTest, ...], whole: Choice, tmp_path: Path, model: str, task: str
) -> None:
    told: list[Progress] = []
    so_far, resumed = stopped_and_resumed(
        tmp_path,
        partial(choose_model, tests[:2], ["dahl", "viscous_dahl"], settings=FEW, threads=1),
        lambda progress: progress.said[0].startswith(model) and progress.said[1].startswith(task),
        told,
    )
    if (model, task) == ("dahl", "left out"):
        # Nothing was judged yet.
        assert so_far is None
    else:
        assert so_far.ranking.missing == (("viscous_dahl",) if model == "viscous_dahl" else ())
    shares = [each.share or 0.0 for each in told]
    assert shares == sorted(shares)
    assert 0.1 < next(each for each in shares if each) < 0.9
    assert standings(resumed) == standings(whole)
    assert resumed.ranking.sentence == whole.ranking.sentence
    assert [fit.theta for fit in resumed.fits] == [fit.theta for fit in whole.fits]


def test_of_one_test_the_later_cycles_are_predicted_and_that_proves_little() -> None:
    one = sinusoidal_test("viscous_dahl", VISCOUS_DAHL, (0.01, 1.0), noise=0.02, cycles=6)
    first, second = halves(one)
    assert first.n_time == second.n_settle
    assert first.n_settle == one.n_settle
    choice = choose_model(one, ["dahl", "viscous_dahl"], settings=FEW, threads=1)
    assert choice.ranking.chosen == "viscous_dahl"
    assert choice.ranking.n_folds >= 2
    assert "one_test" in {each.code for each in choice.ranking.remarks}


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"leave_out": "test", "laws": {"k_w": "cubic"}}, "laws need 4"),
        ({"leave_out": "command", "laws": {"k_w": "quadratic"}}, "only 2 of 3 remain"),
        ({"settings": FitSettings(bounds={"k_q": (0.0, 1.0)})}, "bound was given for 'k_q'"),
        ({"laws": {"k_q": "linear"}}, "law was given for 'k_q'"),
    ],
)
def test_what_no_fold_can_be_fitted_with_is_refused_before_anything_is_fitted(
    tests: tuple[DamperTest, ...], settings: dict[str, Any], word: str
) -> None:
    commands = zip(tests, (0.0, 0.5, 1.0), strict=True)
    given = [replace(test, name=f"{test.name} {level:g} A", current=level) for test, level in commands]
    settings = {"settings": FEW, "on_progress": lambda progress: pytest.fail("fitted"), **settings}
    refusal(choose_model, given, ["bingham", "viscous_dahl"], **settings, match=word)


def test_the_command_line_writes_the_best_run_and_all_that_was_compared(tmp_path: Path) -> None:
    place = tmp_path / "run"
    models = ("--every", "10", "--model", "bingham,dahl")
    document = json.loads(printed("identify", "synthetic:rd1005_1a", *models, "--out", place, "--json"))
    written = json.loads((place / "ranking.json").read_text())
    assert written.items() <= document.items()
    assert document["chosen"] == json.loads((place / "fit.json").read_text())["model"]
    for name in ("bingham", "dahl"):
        assert json.loads((place / "models" / name / "fit.json").read_text())["model"] == name
    command_refusal(
        "identify", "synthetic:rd1005_1a", "--model", "dahl", "--leave-out", "motion", match="comparison"
    )


SIMPLE, RICH = "normalised_bouc_wen", "non_symmetric_bouc_wen"
N_FREE = {SIMPLE: 7, RICH: 10}


def fits_of(test: DamperTest) -> dict[str, Fit]:
    return {model: identify(model, test, search=FEW.search, threads=1) for model in (SIMPLE, RICH)}


def collapsed(fits: dict[str, Fit], test: DamperTest) -> list[Standing]:
    rows = [
        Standing(
            model=model,
            title=fit.spec.title,
            n_params=N_FREE[model],
            status=fit.status,
            fit_percent=fit.fit_percent,
            left_out=(left_out,),
        )
        for (model, fit), left_out in zip(fits.items(), (0.06, 0.05), strict=True)
    ]
    return with_collapses(rows, fits, (test,))


@pytest.fixture(scope="module")
def test() -> DamperTest:
    """A record of the Bouc-Wen model, with noise that a richer model can follow a little."""
    return sinusoidal_test(SIMPLE, damper(SIMPLE).nominal, (0.01, 1.0), noise=0.05, rng=1)


@pytest.fixture(scope="module")
def fits(test: DamperTest) -> dict[str, Fit]:
    return fits_of(test)


def test_a_fit_with_the_force_of_a_simpler_family_and_doubtful_parameters_has_collapsed(
    fits: dict[str, Fit], test: DamperTest
) -> None:
    simple, rich = collapsed(fits, test)
    assert (simple.same_as, simple.reason, rich.same_as) == ("", "", SIMPLE)
    assert rich.reason.startswith("its force is that of")
    # Another force, though the parameters are as doubtful, is no collapse.
    away = fits[RICH].forces[0] + 0.1 * np.std(test.force) * np.sin(np.arange(test.n_time))
    moved = fits | {RICH: replace(fits[RICH], forces=(away,))}
    assert [each.same_as for each in collapsed(moved, test)] == ["", ""]


def test_it_is_not_chosen_though_it_would_be_without_the_rule(fits: dict[str, Fit], test: DamperTest) -> None:
    rows = collapsed(fits, test)
    without = rank([replace(each, same_as="") for each in rows])
    assert [(each.model, each.verdict) for each in without] == [(RICH, "chosen"), (SIMPLE, "behind")]
    assert [(each.model, each.verdict, each.same_as) for each in rank(rows)] == [
        (SIMPLE, "chosen", ""),
        (RICH, "collapsed", SIMPLE),
    ]


def test_a_richer_family_that_the_data_need_has_not_collapsed() -> None:
    spec = damper(RICH)
    values = dict(zip(spec.names, spec.nominal, strict=True))
    needed = sinusoidal_test(RICH, tuple(values.values()), (0.01, 1.0), noise=0.005, rng=2)
    fits = fits_of(needed)
    assert fits[SIMPLE].nrmse > 2.0 * fits[RICH].nrmse
    assert [each.same_as for each in collapsed(fits, needed)] == ["", ""]
