"""What a choice of laws calls left out is left out: its numbers are those of refits, or there are none."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from sinusoidal_tests import MOTIONS, sinusoidal_test

import mrwork as mr
from mrwork.dampers.dependence import dependence_of
from mrwork.identification import FitSettings
from mrwork.identification.commands import with_dependences_at
from mrwork.records import DamperTest
from mrwork.records.damper_test import command_groups, levels_among
from mrwork.uncertainty import Choice, choose_laws
from mrwork.uncertainty.bands.prediction import fold_groups
from mrwork.uncertainty.choice.splits import splits_of

COMMANDS = (0.0, 0.5, 1.0, 1.5)
# Parameters with bounds remain constant: fewer laws are tried.
SETTINGS = FitSettings(bounds={"f0": (0.0, 100.0), "rho": (100.0, 1e4)})


def yield_force(command: float) -> float:
    """Saturates, as no polynomial of three values does: 48, 672, 914 and 972 N."""
    return 48.0 + 940.0 * float(np.tanh(1.6 * command))


@pytest.fixture(scope="module")
def tests() -> tuple[DamperTest, ...]:
    """Of viscous_dahl, with a measured current that is never twice the same."""
    noise = np.random.default_rng(3)
    return tuple(
        sinusoidal_test(
            "viscous_dahl",
            (800.0, yield_force(command), 2000.0, 20.0),
            motion,
            noise=0.01,
            rng=seed,
            command=command + 1e-4 * noise.uniform(),
        )
        for seed, (motion, command) in enumerate(product(MOTIONS[:3], COMMANDS))
    )


@pytest.fixture(scope="module")
def choice(tests: tuple[DamperTest, ...]) -> Choice:
    return choose_laws("viscous_dahl", tests, settings=SETTINGS, threads=1)


@pytest.fixture(scope="module")
def without_commands(tests: tuple[DamperTest, ...]) -> Choice:
    return choose_laws("viscous_dahl", tests, leave_out="command", settings=SETTINGS, threads=1)


def test_measured_commands_of_one_set_point_are_left_out_together(tests: tuple[DamperTest, ...]) -> None:
    assert fold_groups(tests, "command") == [[0, 4, 8], [1, 5, 9], [2, 6, 10], [3, 7, 11]]
    assert command_groups(tests) == [0, 1, 2, 3] * 3
    assert levels_among([0.5, 1.0, 0.504, 0.497, 0.0]).tolist() == [0.5, 1.0, 0.5, 0.5, 0.0]
    # A rig with many commands keeps them apart.
    many = np.arange(0.0, 5.01, 0.25)
    assert levels_among(many).tolist() == many.tolist()


def test_no_set_has_as_many_values_as_there_are_commands_where_commands_are_left_out(
    without_commands: Choice,
) -> None:
    laws = [law for each in without_commands.ranking.standings for law in each.laws.values()]
    assert laws
    assert max(dependence_of(law).n_coefficients for law in laws) == 3


@pytest.mark.parametrize("place", ["chosen", "best"])
@pytest.mark.parametrize("which", ["choice", "without_commands"])
def test_left_out_numbers_are_those_of_a_refit_from_scratch(
    which: str, place: str, tests: tuple[DamperTest, ...], request: pytest.FixtureRequest
) -> None:
    ranking = request.getfixturevalue(which).ranking
    rows = [ranking.chosen_standing] if place == "chosen" else ranking.standings
    row = next(row for row in rows if not row.of_excerpts)
    plain = mr.damper(row.model).with_current_laws({}, unit="A")
    spec = with_dependences_at(plain, row.laws, tests)
    held = {name: (value, value) for name, value in row.held.items()}
    settings = replace(SETTINGS, bounds={**SETTINGS.bounds, **held})
    assert ranking.tests == tuple(test.name for test in tests)
    for split, predicted in zip(ranking.splits, row.predicted, strict=True):
        if None in predicted:
            continue
        rest = [test for index, test in enumerate(tests) if index not in split.members]
        fit = mr.identify(spec, rest, bounds=settings.bounds, rng=7, threads=1)
        for index, error in zip(split.members, predicted, strict=True):
            # A test that is predicted worse than by its mean is not predicted.
            assert error == pytest.approx(min(mr.predict(fit, tests[index]).nrmse, 1.0), abs=5e-4)


def test_a_set_that_the_other_commands_leave_open_has_no_number_between_them(choice: Choice) -> None:
    open_sets = 0
    for each in choice.ranking.standings:
        through_all = any(dependence_of(law).n_coefficients == len(COMMANDS) for law in each.laws.values())
        of_between = [
            errors
            for split, errors in zip(choice.ranking.splits, each.predicted, strict=True)
            if split.between
        ]
        assert (each.between_percent is None) is through_all
        assert all((error is None) is through_all for errors in of_between for error in errors)
        open_sets += through_all
    assert open_sets


def test_between_commands_the_tests_decide_the_form(choice: Choice) -> None:
    chosen = choice.ranking.chosen_standing
    assert chosen.laws == {"k_w": "tanh:0,1.5"}
    values = choice.best.spec.laws_by_name["k_w"].values(
        np.array([each.value for each in choice.best.estimates if each.name.startswith("k_w")]),
        np.array([0.1, 0.25, 0.75, 1.25]),
    )
    assert values == pytest.approx([*map(yield_force, (0.1, 0.25, 0.75, 1.25))], rel=0.05)


def test_each_command_between_others_is_a_split_of_its_own(tests: tuple[DamperTest, ...]) -> None:
    splits = splits_of(tests, "motion", between_commands=True)
    assert [each.members for each in splits.splits if each.between] == [(1, 5, 9), (2, 6, 10)]
    # They do not count where sets are compared that others leave open.
    errors = [np.full(len(split.members), 0.5 if split.between else 0.1) for split in splits.splits]
    assert splits.errors(errors).mean() == pytest.approx(0.1)
    assert splits.between(errors) == pytest.approx(np.full(3, 0.5))
    assert splits.between([np.full_like(each, np.nan) for each in errors]).size == 0


@pytest.fixture(scope="module")
def with_a_switched_record() -> list[DamperTest]:
    """Four tests at constant commands, and last one that shows the lag of the driver, of 30 1/s."""
    spec = mr.damper("dahl").with_current_laws({"k_w": "linear"}, unit="A", lag="one_rate")
    theta = np.array([200.0, 400.0, 2000.0, 20.0, 30.0])
    time = np.arange(0.0, 6.0, 0.005)
    phase = 2.0 * np.pi * (time + 0.05 * time**2)
    velocity = 0.02 * np.pi * (1.0 + 0.1 * time) * np.cos(phase)
    command = np.where(np.sin(9.0 * time) + 0.4 * np.sin(23.0 * time) > 0.0, 1.0, 0.0)
    loading = mr.Loading(
        dt=0.005, displacement=0.01 * np.sin(phase), velocity=velocity, command=command, command_unit="A"
    )
    force = mr.simulate(spec, theta, loading)
    switched = mr.test_from_arrays(
        name="switched",
        time=time,
        displacement=loading.displacement,
        velocity=velocity,
        force=force + np.random.default_rng(1).normal(0.0, 2.0, time.size),
        command=command,
        command_unit="A",
    )
    held = [
        sinusoidal_test("dahl", (200.0 + 400.0 * level, 2000.0, 20.0), motion, noise=0.01, command=level)
        for motion, level in product(MOTIONS[:2], (0.0, 1.0))
    ]
    return [*held, switched]


def test_a_fold_without_the_record_that_shows_the_lag_predicts_nothing(
    with_a_switched_record: list[DamperTest],
) -> None:
    """Without it the rate ends anywhere, and the record was predicted to 63 or 80 % by the seed."""
    spec = mr.damper("dahl").with_current_laws({"k_w": "linear"}, unit="A", lag="one_rate")
    seen = list[int]()

    def identify_rest(rest: tuple[DamperTest, ...]) -> mr.Fit:
        seen.append(len(rest))
        return mr.identify(spec, rest, bounds={"f0": (0.0, 100.0)}, rng=1, threads=1)

    with (
        pytest.warns(mr.errors.MrworkWarning, match="nothing shows the rate eta"),
        pytest.warns(mr.errors.MrworkWarning, match="1 of the tests left out are not predicted.*switched"),
    ):
        found = mr.uncertainty.predict_left_out(with_a_switched_record, "test", identify_rest)
    assert [each.test.name for each in found] == [each.name for each in with_a_switched_record[:-1]]
    assert seen == [4] * 5


def test_a_split_without_the_record_that_shows_the_lag_predicts_nothing_of_it(
    with_a_switched_record: list[DamperTest],
) -> None:
    settings = FitSettings(bounds={"f0": (0.0, 100.0)})
    choice = choose_laws("dahl", with_a_switched_record, lagged=True, settings=settings, threads=1)
    chosen = choice.ranking.chosen_standing
    assert chosen.laws == {"k_w": "linear"}
    assert choice.best.parameters["eta"].value == pytest.approx(30.0, rel=0.05)
    for split, errors in zip(choice.ranking.splits, chosen.predicted, strict=True):
        assert all((error is None) is (4 in split.members) for error in errors)
