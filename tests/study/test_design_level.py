"""The level at which the laws of a study are designed, and the target spectrum to which its motions are scaled."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr
from mrwork.study import Study

LEVELS = ("0.1 g", "0.3 g", "0.5 g")


def at_levels(levels: tuple[str | float, ...] = LEVELS, *, key: str = "pga", **others: Any) -> Study:
    uses = [("training", 0), ("training", 1), ("test", 2)] if others.pop("trained", False) else [("test", 0)]
    study = mr.study_of(
        building={
            "n_storeys": 2,
            "masses": ["20 t"],
            "stiffnesses": ["12 kN/mm"],
            "modal_damping": {"ratios": ["2 %"]},
        },
        dampers=[{"storey": 1, "preset": "kwok2006", "count": 40}],
        laws=["clipped_optimal"],
        motions=[
            {"synthetic": "kanai_tajimi", "duration": 4.0, "name": f"record {seed}", "seed": seed, "use": use}
            | {key: list(levels)}
            for use, seed in uses
        ],
        **others,
    )
    return mr.study.designed(study)


def test_laws_and_command_at_every_level_are_those_of_a_study_of_the_design_level() -> None:
    whole, alone = at_levels(design_level="0.3 g"), at_levels(("0.3 g",))
    for level in ("0.3 g", "0.1 g"):
        own, of_level = alone.laws[-1][1].gains, at_levels(design_level=level).laws[-1][1].gains
        assert all(np.array_equal(own[name], each) for name, each in of_level.items()) == (level == "0.3 g")
    found, one = mr.run_study(whole), mr.run_study(alone)
    assert [row.label for row in found.rows] == [row.label for row in one.rows]
    assert [found.criteria(row, 1) for row in range(4)] == [one.criteria(row, 0) for row in range(4)]
    assert ", at 0.3 g" in found.motions.chosen_in_words
    # Scores are of that level, so that a collapse at the highest does not hide them; the others stay with the record.
    assert found.judged_motions == (1,)
    assert found.motions.in_words == "1 motion at 0.3 g"
    assert [found.score(row).mean for row in range(4)] == [one.score(row).mean for row in range(4)]
    assert found.motions.by_record.places.tolist() == [[0, 1, 2]]
    assert {each.code for each in found.remarks} <= {"demand_beyond_rating", "motions_few"}


def test_a_study_of_several_levels_says_that_its_laws_are_of_all() -> None:
    several = at_levels()
    assert several.design_levels == LEVELS
    first = mr.run_study(several).remarks[0]
    assert (first.code, first.words) == ("design_levels_several", ("0.1 g", "0.5 g"))
    assert not at_levels(("0.3 g",)).design_levels
    refusal(at_levels, design_level="0.2 g", match="give one of 0.1 g")


def test_with_training_motions_it_is_theirs_also_in_tune() -> None:
    trained = at_levels(trained=True, design_level="0.5 g")
    assert [each.name for each in trained.chosen_on] == ["record 0, 0.5 g", "record 1, 0.5 g"]
    assert tuple(trained.problem.motions) == trained.chosen_on
    tuned = mr.tune(trained, laws=["clipped_optimal"], budget=24, rng=0)
    judged = mr.tuning.judge(trained, tuned)
    assert (len(tuned.training), judged.motions.design_levels) == (2, ("0.5 g",))
    assert [judged.motions[each].level for each in judged.judged_motions] == ["0.5 g"]


def test_a_level_may_be_a_factor() -> None:
    scaled = at_levels((1.0, 2.0), key="factor")
    assert scaled.design_levels == ("factor 1", "factor 2")


def test_a_design_level_is_written_with_the_study(tmp_path: Any) -> None:
    path = at_levels(design_level="0.3 g").to_toml(tmp_path / "study.toml")
    assert mr.read_study(path).design_levels == ("0.3 g",)


BUILDING = {"n_storeys": 2, "masses": [300.0], "stiffnesses": [4e5]}
EN_1998 = {"code": "en_1998", "a_g": "0.2 g", "ground": "C", "type": 2}
# Two equal storeys: the first circular frequency is (sqrt(5) - 1) / 2 sqrt(k / m).
T1 = 2.0 * math.pi / (0.5 * (math.sqrt(5.0) - 1.0) * math.sqrt(4e5 / 300.0))


def to_target(target: dict[str, Any] | None = EN_1998, n: int = 3, **keys: Any) -> mr.study.Study:
    motions = [
        {"synthetic": "kanai_tajimi", "duration": 4.0, "seed": seed, "name": f"motion {seed}", **keys}
        for seed in range(n)
    ]
    return mr.study_of(building=BUILDING, motions=motions, target=target)


def test_motions_are_scaled_at_the_first_period_of_the_bare_building() -> None:
    made = to_target(scale_to="sa")
    # The plateau of ground C of type 2 ends at 0.25 s.
    assert made.suite is not None
    assert made.suite.period == pytest.approx(T1)
    for motion in made.motions:
        found = mr.response_spectrum(motion.ground, T1).pseudo_acceleration
        assert found == pytest.approx(made.suite.target.acceleration([T1]))


def test_a_study_says_how_its_suite_lies_beside_the_target(tmp_path: Path) -> None:
    made = to_target(scale_to="least_squares")
    assert made.suite is not None
    (heading, sentences) = made.design_notes[0]
    assert heading == "Motions beside EN 1998-1 type 2, ground C, a_g 0.2 g"
    assert sentences == made.suite.in_words
    results = mr.run_study(made)
    assert "suite_below_target" in {each.code for each in made.suite.shortcomings}
    assert results.page.facts[-1] == (heading, " ".join(sentences))
    factor = made.suite.factor * (1.0 + 1e-9)
    raised = to_target(scale_to="least_squares", factor=factor)
    assert raised.suite is not None
    assert raised.suite.shortcomings == ()
    raised.to_toml(tmp_path / "study.toml")
    again = mr.read_study(tmp_path / "study.toml")
    assert [each.facts.intensity for each in again.motions] == [
        each.facts.intensity for each in raised.motions
    ]
    for one, other in zip(raised.motions, again.motions, strict=True):
        assert np.array_equal(one.ground.acceleration, other.ground.acceleration)


def test_training_motions_and_records_at_several_levels_are_no_suite() -> None:
    assert to_target(scale_to="pga", factor=[0.5, 1.0]).suite is None
    training = [{"synthetic": "kanai_tajimi", "duration": 4.0, "seed": 9, "use": "training", "name": "other"}]
    made = mr.study_of(
        building=BUILDING, motions=[*training, mr.synthetic_motion(rng=1, duration=4.0)], target=EN_1998
    )
    assert made.suite is not None
    assert made.suite.names == ("synthetic",)


def test_the_period_of_the_target_is_that_of_the_suite() -> None:
    made = to_target({**EN_1998, "period": 0.5}, scale_to="sa")
    assert made.suite is not None
    assert made.suite.period == 0.5
    assert made.motions[0].facts.intensity is not None
    assert made.motions[0].facts.intensity.period == 0.5


@pytest.mark.parametrize(
    ("target", "word"),
    [
        (None, "give `target`"),
        ({"code": "en_1998"}, "has no a_g"),
        ({"code": "en_1998", "a_g": 1, "s_ds": 1}, "target.s_ds"),
        ({"code": "asce_7", "s_ds": 10, "s_d1": 6, "t_l": 0.1}, "plateau ends at .* 0.6 s"),
        ({"a_g": 1}, "or give the code"),
        ({"periods": [0.0, 0.2, 0.1], "accelerations": [1, 2, 2]}, "increasing periods"),
        ({"periods": [0.0, 0.1], "accelerations": [1, 2]}, "asked for at 0.278 s"),
    ],
)
def test_a_target_that_is_wrong_is_refused(target: dict[str, Any] | None, word: str) -> None:
    refusal(to_target, target, n=1, scale_to="sa", match=word)


def test_a_mode_without_stiffness_has_no_period_to_scale_at() -> None:
    frame = mr.building("uts")
    stiffness = frame.stiffness - frame.storey_stiffnesses[0] * np.diag([1.0, 0.0, 0.0, 0.0, 0.0])
    free = replace(frame, stiffness=stiffness)
    motion = {"synthetic": "kanai_tajimi", "duration": 4.0, "sa": 1.0}
    refusal(mr.study_of, building=free, motions=[motion], match="`periods` is inf")
    made = mr.study_of(building=free, motions=[{**motion, "sa_period": 0.5}])
    assert made.motions[0].facts.intensity is not None
