"""Choice of model: the true family is chosen, also after an interrupt and where another family fails or collapses."""

from __future__ import annotations

import json
from contextlib import closing
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from sentences import Refused
from sinusoidal_tests import MOTIONS, PER_CYCLE, sinusoidal_test

from mrwork import Journal, identify
from mrwork.cli.door import parser
from mrwork.dampers import damper
from mrwork.errors import Interrupted, MrworkWarning
from mrwork.identification import Fit, FitSettings, Multistart
from mrwork.records import DamperTest
from mrwork.store.output_folder import Destination
from mrwork.store.run_folder import FIT_RUN
from mrwork.store.unfinished import StepJournals
from mrwork.uncertainty import Choice, choose_model
from mrwork.uncertainty.bands.prediction import halves
from mrwork.uncertainty.choice.choose import ChoiceProgress
from mrwork.uncertainty.choice.leave_one_out import free_parameters, residuals_of, variance_of
from mrwork.uncertainty.choice.ranking import Collapse, Evidence, find_collapses, rank

VISCOUS_DAHL = (800.0, 900.0, 2000.0, 20.0)
FEW = FitSettings(search=Multistart(samples=10, starts=4, most_rounds=2, found=2))
MODELS = ("dahl", "viscous_dahl", "normalised_bouc_wen")


@pytest.fixture(scope="module")
def tests() -> tuple[DamperTest, ...]:
    return tuple(
        sinusoidal_test("viscous_dahl", VISCOUS_DAHL, motion, noise=0.02, rng=seed)
        for seed, motion in enumerate(MOTIONS)
    )


@pytest.fixture(scope="module")
def choice(tests: tuple[DamperTest, ...]) -> Choice:
    return choose_model(tests, MODELS, settings=FEW, threads=1)


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
    assert choice.ranking.sentence.startswith("Of 3 families, Viscous and Dahl with 4 parameters is chosen")


def test_all_criteria_reject_the_family_that_lacks_a_part(choice: Choice) -> None:
    found = {each.model: each for each in choice.ranking.standings}
    own, smaller, larger = found["viscous_dahl"], found["dahl"], found["normalised_bouc_wen"]
    for each in (own, larger):
        assert smaller.elpd is not None
        assert each.elpd is not None
        assert each.elpd > smaller.elpd + 10.0
    assert own.bic_behind == 0.0
    assert larger.bic_behind is not None
    assert 0.0 < larger.bic_behind < 3.5 * np.log(sum(PER_CYCLE * 3 for _ in MOTIONS))
    assert smaller.bic_behind is not None
    assert smaller.bic_behind > 10.0


def test_fits_are_those_of_all_tests_in_the_order_of_the_ranking(choice: Choice) -> None:
    assert [fit.model for fit in choice.fits] == [each.model for each in choice.ranking.standings]
    assert choice.best.model == choice.ranking.chosen
    assert all(len(fit.quality) == len(MOTIONS) for fit in choice.fits)
    assert choice.ranking.n_folds == len(MOTIONS)


def test_a_family_that_fails_is_a_row(tests: tuple[DamperTest, ...]) -> None:
    # A bound that one family does not admit, and the other keeps.
    with pytest.warns(MrworkWarning, match=r"not compared, as its predictions failed: lugre"):
        choice = choose_model(
            tests[:2], ["dahl", "lugre"], settings=replace(FEW, bounds={"sigma_0": (1e20, 1e21)}), threads=1
        )
    last = choice.ranking.standings[-1]
    assert (last.model, last.verdict, last.status) == ("lugre", "failed", "failed")
    assert "sigma_0" in last.reason
    assert choice.ranking.chosen == "dahl"
    assert "Failed, and so not compared: " in choice.ranking.sentence


@pytest.mark.parametrize(
    ("model", "task"), [("viscous_dahl", "left out 1"), ("dahl", "leave-one-out"), ("dahl", "left out 1")]
)
def test_interrupted_and_resumed_is_as_if_nothing_had_happened(
    tests: tuple[DamperTest, ...], tmp_path: Path, model: str, task: str
) -> None:
    two = tests[:2]
    compared = ["dahl", "viscous_dahl"]
    whole = choose_model(two, compared, settings=FEW, threads=1)

    def interrupt(progress: ChoiceProgress) -> None:
        if progress.model == model and progress.task.startswith(task):
            raise KeyboardInterrupt

    place = tmp_path / "run"
    with (
        pytest.raises(Interrupted) as interrupted,
        closing(StepJournals(Destination(path=place, kind=FIT_RUN), resume=False)) as journals,
    ):
        choose_model(two, compared, settings=FEW, threads=1, journal_of=journals, on_progress=interrupt)
    if (model, task) == ("dahl", "left out 1"):
        # Nothing was judged yet.
        assert interrupted.value.result is None
    else:
        missing = interrupted.value.result.ranking.missing
        assert missing == (("viscous_dahl",) if model == "viscous_dahl" else ())
        assert all(each.elpd is None for each in interrupted.value.result.ranking.standings)
    told: list[ChoiceProgress] = []
    with closing(StepJournals(Destination(path=place, kind=FIT_RUN), resume=True)) as journals:
        resumed = choose_model(
            two, compared, settings=FEW, threads=1, journal_of=journals, on_progress=told.append
        )
    shares = [each.share or 0.0 for each in told if each.task != "leave-one-out"]
    assert shares == sorted(shares)
    # Of three fits to each model, those to all tests and without the first were done.
    assert task != "left out 1" or 0.1 < next(each for each in shares if each) < 0.9
    assert standings(resumed) == standings(whole)
    assert resumed.ranking.sentence == whole.ranking.sentence
    assert [fit.theta for fit in resumed.fits] == [fit.theta for fit in whole.fits]


def test_a_journal_of_every_step_is_asked_for_and_closed(
    tests: tuple[DamperTest, ...], tmp_path: Path, refused: Refused
) -> None:
    steps: list[str] = []
    opened: list[Journal] = []

    def journal_of(step: str) -> Journal:
        steps.append(step)
        opened.append(Journal(tmp_path / step.replace("/", "-")))
        return opened[-1]

    choose_model(tests[:2], ["dahl"], settings=FEW, threads=1, journal_of=journal_of)
    assert steps == ["dahl/fit", "dahl/left_out_1", "dahl/left_out_2", "dahl/leave_one_out"]
    for journal in opened:
        assert journal.path.stat().st_size > 0
        refused(journal.record, "late", "", {})


def test_progress_tells_which_model_how_many_and_the_time_left(tests: tuple[DamperTest, ...]) -> None:
    seen: list[ChoiceProgress] = []
    choose_model(tests[:2], ["dahl", "bingham"], settings=FEW, threads=1, on_progress=seen.append)
    assert {(each.model, each.number, each.n_models) for each in seen} == {("dahl", 1, 2), ("bingham", 2, 2)}
    assert [each.seconds for each in seen] == sorted(each.seconds for each in seen)
    assert seen[0].seconds_left is None
    assert seen[-1].seconds_left == 0.0
    assert any(each.within is not None for each in seen)


def test_of_one_test_the_later_cycles_are_predicted_and_that_proves_little() -> None:
    one = sinusoidal_test("viscous_dahl", VISCOUS_DAHL, (0.01, 1.0), noise=0.02, cycles=6)
    first, second = halves(one)
    assert first.n_time == second.n_settle
    assert first.n_settle == one.n_settle
    choice = choose_model(one, ["dahl", "viscous_dahl"], settings=FEW, threads=1)
    assert choice.ranking.chosen == "viscous_dahl"
    assert choice.ranking.n_folds >= 2
    assert any("this is little evidence" in remark for remark in choice.ranking.remarks)


def test_an_ellipsoid_about_the_fit_tells_what_the_chain_tells() -> None:
    # Cycles enough that leaving one out moves the posterior but little.
    longer = [
        sinusoidal_test("viscous_dahl", VISCOUS_DAHL, motion, noise=0.02, cycles=5) for motion in MOTIONS[:2]
    ]
    (drawn,), (sampled,) = (
        choose_model(longer, ["viscous_dahl"], settings=FEW, sampled=sampled, threads=1).ranking.standings
        for sampled in (False, True)
    )
    assert drawn.elpd is not None
    assert drawn.unreliable_blocks == sampled.unreliable_blocks == 0
    # Both have 2000 draws; a block's log density is known to some hundredths from these.
    assert drawn.elpd == pytest.approx(sampled.elpd, abs=0.2)


def test_impossible_requests_are_refused_before_anything_is_fitted(
    tests: tuple[DamperTest, ...], refused: Refused
) -> None:
    refused(choose_model, tests, ["dahl", "dahl"])
    refused(choose_model, tests, ["dahl"], leave_out="command")
    refused(choose_model, tests, ["dahl"], settings=FitSettings(bounds={"k_q": (0.0, 1.0)}))
    refused(choose_model, tests, ["dahl"], laws={"k_q": "linear"})
    refused(choose_model, tests, ["dull"])


def test_laws_that_the_rest_of_a_fold_is_too_few_commands_for_are_refused_before_anything_is_fitted(
    tests: tuple[DamperTest, ...], refused: Refused
) -> None:
    started: list[ChoiceProgress] = []

    def choose(**laws: str) -> Choice:
        each = zip(tests * 2, (0.0, 0.5, 1.0, 0.0, 0.5, 1.0), strict=False)
        given = [replace(test, name=f"{test.name} {level:g} A", current=level) for test, level in each]
        return choose_model(
            *(given, ["bingham", "viscous_dahl"]),
            **{
                "leave_out": "command",
                "laws": laws,
                "settings": FEW,
                "threads": 1,
                "on_progress": started.append,
            },
        )

    refused(choose, k_w="quadratic")
    refused(choose, k_w="cubic")
    assert started == []


def test_the_command_line_writes_the_best_run_and_all_that_was_compared(tmp_path: Path) -> None:
    place = tmp_path / "run"
    models = ("--every", "10", "--model", "bingham,dahl")
    document = json.loads(printed("identify", "synthetic:rd1005_1a", *models, "--out", place, "--json"))
    written = json.loads((place / "ranking.json").read_text())
    assert {key: document[key] for key in written} == written
    assert document["chosen"] == json.loads((place / "fit.json").read_text())["model"]
    for name in ("bingham", "dahl"):
        assert json.loads((place / "models" / name / "fit.json").read_text())["model"] == name
    assert "Left-out fit of the models" in (place / "report.html").read_text()
    assert not (place / "figures").exists()
    assert (place / "journal.jsonl").stat().st_size > 0
    assert [path.name for path in tmp_path.iterdir()] == ["run"]


def test_the_command_line_refuses_in_a_sentence(tmp_path: Path, refused: Refused) -> None:
    for arguments in (
        ("--model", "dahl", "--leave-out", "motion"),
        ("--model", "dahl,bingham", "--start", "somewhere"),
        ("--model", "dahl,bingham", "--resume"),
        ("--model", "dahl,dull"),
    ):
        words = ["identify", "synthetic:rd1005_1a", *arguments, "--out", str(tmp_path / "run")]
        options = parser(words).parse_args(words)
        refused(options.run, options)
        assert list(tmp_path.iterdir()) == []


FEW_STARTS = Multistart(samples=10, starts=4, most_rounds=2, found=2)
SIMPLE, RICH = "normalised_bouc_wen", "non_symmetric_bouc_wen"
N_EFFECTIVE = 100.0


def fits_of(test: DamperTest) -> dict[str, Fit]:
    return {model: identify(model, test, search=FEW_STARTS, threads=1) for model in (SIMPLE, RICH)}


def collapses(fits: dict[str, Fit], test: DamperTest) -> dict[str, Collapse]:
    return find_collapses(
        fits,
        {model: residuals_of(fit, (test,)) for model, fit in fits.items()},
        {model: free_parameters(fit) for model, fit in fits.items()},
        (test,),
        N_EFFECTIVE,
    )


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
    found = collapses(fits, test)
    assert {model: each.model for model, each in found.items()} == {RICH: SIMPLE}
    assert "Bouc-Wen to " in found[RICH].reason
    assert "share" in found[RICH].reason
    assert found[RICH].reason.endswith(("undetermined", "on a bound"))


def test_it_is_not_chosen_though_it_would_be_without_the_rule(fits: dict[str, Fit], test: DamperTest) -> None:
    same = collapses(fits, test)
    evidence = [
        Evidence(
            model=model,
            title=fit.spec.title,
            n_params=free_parameters(fit),
            status=fit.status,
            seconds=1.0,
            fit_percent=fit.fit_percent,
            left_out=(left_out,),
            variance=variance_of(fit, (test,)),
        )
        for (model, fit), left_out in zip(fits.items(), (0.06, 0.05), strict=True)
    ]
    without = rank(evidence, N_EFFECTIVE)
    assert [(each.model, each.verdict) for each in without] == [(RICH, "chosen"), (SIMPLE, "behind")]
    # BIC prefers the simpler family.
    assert without[0].bic_behind > 8.0
    ranked = rank([replace(each, collapse=same.get(each.model)) for each in evidence], N_EFFECTIVE)
    assert [(each.model, each.verdict, each.same_as) for each in ranked] == [
        (SIMPLE, "chosen", ""),
        (RICH, "collapsed", SIMPLE),
    ]


def test_a_richer_family_that_the_data_need_has_not_collapsed() -> None:
    spec = damper(RICH)
    values = dict(zip(spec.names, spec.nominal, strict=True))
    needed = sinusoidal_test(RICH, tuple(values.values()), (0.01, 1.0), noise=0.005, rng=2)
    fits = fits_of(needed)
    assert np.sqrt(variance_of(fits[SIMPLE], (needed,))) > 2.0 * np.sqrt(variance_of(fits[RICH], (needed,)))
    assert collapses(fits, needed) == {}


def test_a_worse_fit_of_doubtful_parameters_to_another_force_is_no_collapse(
    fits: dict[str, Fit], test: DamperTest
) -> None:
    residuals = {model: residuals_of(fit, (test,)) for model, fit in fits.items()}
    away = tuple(each + 0.1 * np.sin(np.arange(each.size)) for each in residuals[RICH])
    found = find_collapses(
        fits,
        {SIMPLE: residuals[SIMPLE], RICH: away},
        {SIMPLE: 7, RICH: 10},
        (test,),
        N_EFFECTIVE,
    )
    assert found == {}
