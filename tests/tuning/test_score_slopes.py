"""The derivatives of a score in the settings of a law are those of the loop: compared with differences of the loop."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import tuning_samples
from refusals import refusal

import mrwork as mr
from mrwork.control import control_laws
from mrwork.errors import Interrupted
from mrwork.study import TuneTable
from mrwork.tuning import law_tuning
from mrwork.tuning.law_plan import LawPlan, without_gradient
from mrwork.tuning.space import LARGEST
from mrwork.tuning.tuning_run import plan_of

SMOOTH = [law.name for law in control_laws() if not law.switches]
MOTIONS = tuning_samples.motion("A", 1) + tuning_samples.motion("B", 2).replace("3\n", "1.5\n", 1)
SHORT = MOTIONS.replace("duration = 3", "duration = 1")
HELD: dict[str, dict[str, Any]] = {
    "inverse_network": {
        "layer": [[0.1, 100.0, 5.0, 5e-4, 1.0], [-0.3, 40.0, -8.0, 8e-4, 0.7]],
        "output": 0.8,
        "reach": [5e-3, 0.1, 2000.0],
    }
}


def plan_for(study: mr.Study, table: TuneTable, threads: int = 1) -> LawPlan:
    return plan_of(study, table, threads)


def inside(plan: LawPlan) -> np.ndarray[Any, Any]:
    """A point off the middle, at the largest command."""
    free = plan.space.free
    places = 0.35 + 0.04 * (np.arange(len(free)) % 7)
    return np.where([each.name == LARGEST for each in free], 0.99, places)


def score(plan: LawPlan, unit: Any) -> float:
    return float(plan.values(np.atleast_2d(unit), exact=True)[0])


def agree_with_differences(plan: LawPlan, unit: Any, *, settings: int = 3) -> None:
    """Value to the bit, derivatives in the first settings to 1e-6 of the largest."""
    value, found = plan.slopes(unit)
    assert value == score(plan, unit)
    largest = np.abs(found).max()
    assert largest > 0.0
    moved = [place for place, each in enumerate(plan.space.free) if each.name != LARGEST]
    for place in moved[:settings]:
        ends = [unit + sign * 1e-6 * np.eye(len(unit))[place] for sign in (1.0, -1.0)]
        difference = (score(plan, ends[0]) - score(plan, ends[1])) / 2e-6
        assert found[place] == pytest.approx(difference, abs=1e-6 * largest)


@pytest.mark.parametrize("law", SMOOTH)
def test_every_law_that_does_not_switch_has_the_derivatives_of_its_score(law: str) -> None:
    study = tuning_samples.study_with(motions=SHORT, tune="")
    plan = plan_for(study, TuneTable(laws=(law,), settings=HELD.get(law)))
    agree_with_differences(plan, inside(plan))


SECOND = '\n[[damper]]\nstorey = 3\npreset = "kwok2006"\nlag = 100\n'
VARIED = '\n[uncertainty]\nrealisations = 3\nstiffness = 0.1\ndelay = "2 ms"\n'
# Parts of the study file, and keys of the table.
CASES: dict[str, tuple[dict[str, str], dict[str, Any]]] = {
    "two dampers": ({"more": SECOND}, {}),
    "storeys that yield": (
        {
            "building": 'published = "uts"\n[building.storeys_that_yield]\nyield_drift = "1 mm"\nsharpness = 2\n'
        },
        {},
    ),
    "draws": ({"more": VARIED}, {"robust": True}),
    "tail": (
        {},
        {"risk": "cvar", "tail": 0.7, "combine": "largest", "criteria": ("rms_drift", "peak_base_shear")},
    ),
    "worst within limits": (
        {},
        {
            "risk": "max",
            "relative_to": "best_passive",
            "constraints": {"rms_current": 1e-3, "peak_stroke": 1e-4},
        },
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_loop_and_score_may_be_whatever_a_study_and_a_table_make_of_them(case: str) -> None:
    parts, table = CASES[case]
    study = tuning_samples.study_with(motions=SHORT, tune="", **parts)
    plan = plan_for(study, TuneTable(laws=("proportional_direct",), **table))
    agree_with_differences(plan, inside(plan))


def test_passive_devices_are_part_of_the_loop() -> None:
    building = mr.buildings.with_friction_damper(mr.building("uts"), storey=2, slip_load=20.0, stiffness=1e5)
    motion = {"synthetic": "kanai_tajimi", "duration": 1.0, "pga": "0.1 g"}
    damper = {"storey": 1, "preset": "kwok2006", "lag": 190.0, "differential": True}
    study = mr.study_of(building={"file": building}, dampers=[damper], motions=[motion])
    plan = plan_for(study, TuneTable(laws=("proportional_direct",)))
    agree_with_differences(plan, inside(plan))


def test_observer_noise_delay_and_a_rate_limit_are_part_of_the_loop() -> None:
    study = tuning_samples.study_with(motions=SHORT, tune="")
    hardware = replace(
        study.hardware, feedback="observer", acceleration_noise=0.01, delay=4e-3, command_rate=30.0
    )
    plan = plan_for(replace(study, hardware=hardware), TuneTable(laws=("proportional_direct",)))
    agree_with_differences(plan, inside(plan))


def test_derivatives_at_the_ends_of_a_range_are_as_good_as_inside() -> None:
    study = tuning_samples.study_with(motions=SHORT, tune="")
    plan = plan_for(study, TuneTable(laws=("proportional_direct",), free={"slope": ()}))
    for end, inward in ((0.0, 1e-6), (1.0, -1e-6)):
        _, found = plan.slopes(np.array([end]))
        difference = (score(plan, [end + inward]) - score(plan, [end])) / inward
        assert found[0] == pytest.approx(difference, rel=1e-4)


def test_threads_and_instruction_sets_change_no_bit(
    of_instruction_sets: Callable[[Callable[[], Any]], list[Any]],
) -> None:
    study = tuning_samples.study_with(motions=SHORT, tune="", more=SECOND)
    one, two = (plan_for(study, TuneTable(laws=("proportional_direct",)), threads) for threads in (1, 2))
    first, *others = [
        (value, slopes.tobytes())
        for each in (one, two)
        for value, slopes in of_instruction_sets(lambda each=each: each.slopes(inside(each)))
    ]
    assert all(other == first for other in others)


def test_settings_that_make_no_law_have_an_infinite_score_without_derivatives() -> None:
    study = tuning_samples.study_with(motions=SHORT, tune="")
    for weights in ((1e-30, 1e-26), (1e-22, 1e-18)):
        plan = plan_for(study, TuneTable(laws=("active",), free={"control_weight": weights}))
        value, found = plan.slopes(np.array([0.5]))
        assert value == math.inf
        assert not found.any()


def test_every_law_that_switches_is_named() -> None:
    for law in (law.name for law in control_laws() if law.switches):
        assert f"{law} switches" in without_gradient(tuning_samples.small_study(), TuneTable(laws=(law,)))


LAW = "proportional_direct"


def test_scores_without_gradients_are_refused() -> None:
    study = tuning_samples.study_with()
    learned = TuneTable(laws=("signal_network",), gradient_steps=5)
    for table, changed, word in (
        (replace(learned, laws=("clipped_optimal",)), study, "clipped_optimal switches"),
        (replace(learned, free={"network": (), "dead_zone": ()}), study, "dead_zone"),
        (replace(learned, constraints={"switching_rate": 1.0}), study, "switching_rate is a count"),
        (learned, replace(study, hardware=replace(study.hardware, force_resolution=10.0)), "resolution"),
    ):
        assert word in without_gradient(changed, table)
    refusal(
        mr.tune, study, [replace(learned, laws=("clipped_optimal",))], match="or leave gradient_steps out"
    )


@pytest.mark.long
def test_gradients_that_are_interrupted_keep_what_the_search_found(monkeypatch: pytest.MonkeyPatch) -> None:
    followed = []

    def interrupted(plan: LawPlan, *_: object) -> None:
        followed.append(plan.bench.n_realisations)
        raise KeyboardInterrupt

    monkeypatch.setattr(law_tuning, "follow_gradients", interrupted)
    study = tuning_samples.study_with(
        building=tuning_samples.TWO_STOREYS,
        more="\n[uncertainty]\nrealisations = 2\nstiffness = 0.1\n",
        tune=f"[[tune]]\nlaws = ['{LAW}']\nbudget = 8\npopulation = 5\ngradient_steps = 2\nrobust = true\n",
    )
    with pytest.raises(Interrupted) as stopped:
        mr.tune(study, threads=1)
    assert [law.law for law in stopped.value.result.laws] == [LAW]
    # The score that is searched, with its realisations, is the one that is followed.
    assert followed == [2]
