"""A study with a target spectrum: its motions are scaled to it, and it says how their suite lies beside it."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refusals import refusal

import mrwork as mr

BUILDING = {"n_storeys": 2, "masses": [300.0], "stiffnesses": [4e5]}
EN_1998 = {"code": "en_1998", "a_g": "0.2 g", "ground": "C", "type": 2}
# Two equal storeys: the first circular frequency is (sqrt(5) - 1) / 2 sqrt(k / m).
T1 = 2.0 * math.pi / (0.5 * (math.sqrt(5.0) - 1.0) * math.sqrt(4e5 / 300.0))


def study(target: dict[str, Any] | None = EN_1998, n: int = 3, **keys: Any) -> mr.study.Study:
    motions = [
        {"synthetic": "kanai_tajimi", "duration": 4.0, "seed": seed, "name": f"motion {seed}", **keys}
        for seed in range(n)
    ]
    return mr.study_of(building=BUILDING, motions=motions, target=target)


def test_motions_are_scaled_at_the_first_period_of_the_bare_building() -> None:
    made = study(scale_to="sa")
    # The plateau of ground C of type 2 ends at 0.25 s.
    assert made.suite is not None
    assert made.suite.period == pytest.approx(T1)
    for motion in made.motions:
        found = mr.response_spectrum(motion.ground, T1).pseudo_acceleration
        assert found == pytest.approx(made.suite.target.acceleration([T1]))


def test_a_study_says_how_its_suite_lies_beside_the_target(tmp_path: Path) -> None:
    made = study(scale_to="least_squares")
    assert made.suite is not None
    (heading, sentences) = made.design_notes[0]
    assert heading == "Motions beside EN 1998-1 type 2, ground C, a_g 0.2 g"
    assert sentences == made.suite.in_words
    results = mr.run_study(made)
    assert results.facts[-1] == (heading, " ".join(sentences))
    factor = made.suite.factor * (1.0 + 1e-9)
    raised = study(scale_to="least_squares", factor=factor)
    assert raised.suite is not None
    assert raised.suite.shortcomings == ()
    raised.to_toml(tmp_path / "study.toml")
    again = mr.read_study(tmp_path / "study.toml")
    assert [each.intensity for each in again.motions] == [each.intensity for each in raised.motions]
    for one, other in zip(raised.motions, again.motions, strict=True):
        assert np.array_equal(one.ground.acceleration, other.ground.acceleration)


def test_training_motions_and_records_at_several_levels_are_no_suite() -> None:
    assert study(scale_to="pga", factor=[0.5, 1.0]).suite is None
    training = [{"synthetic": "kanai_tajimi", "duration": 4.0, "seed": 9, "use": "training", "name": "other"}]
    made = mr.study_of(
        building=BUILDING, motions=[*training, mr.synthetic_motion(rng=1, duration=4.0)], target=EN_1998
    )
    assert made.suite is not None
    assert made.suite.names == ("synthetic",)


def test_the_period_of_the_target_is_that_of_the_suite() -> None:
    made = study({**EN_1998, "period": 0.5}, scale_to="sa")
    assert made.suite is not None
    assert made.suite.period == 0.5
    assert made.motions[0].intensity is not None
    assert made.motions[0].intensity.period == 0.5


@pytest.mark.parametrize(
    ("target", "word"),
    [
        (None, "give `target`"),
        ({"code": "en_1998"}, "needs a_g"),
        ({"code": "en_1998", "a_g": 1, "s_ds": 1}, "target.s_ds"),
        ({"code": "asce_7", "s_ds": 10, "s_d1": 6, "t_l": 0.1}, "plateau ends at .* 0.6 s"),
        ({"a_g": 1}, "or give the code"),
        ({"periods": [0.0, 0.2, 0.1], "accelerations": [1, 2, 2]}, "increasing periods"),
        ({"periods": [0.0, 0.1], "accelerations": [1, 2]}, "asked for at 0.278 s"),
    ],
)
def test_a_target_that_is_wrong_is_refused(target: dict[str, Any] | None, word: str) -> None:
    refusal(study, target, n=1, scale_to="sa", match=word)


def test_a_mode_without_stiffness_has_no_period_to_scale_at() -> None:
    frame = mr.building("uts")
    stiffness = frame.stiffness - frame.storey_stiffnesses[0] * np.diag([1.0, 0.0, 0.0, 0.0, 0.0])
    free = replace(frame, stiffness=stiffness)
    motion = {"synthetic": "kanai_tajimi", "duration": 4.0, "sa": 1.0}
    refusal(mr.study_of, building=free, motions=[motion], match="no stiffness.*sa_period")
    made = mr.study_of(building=free, motions=[{**motion, "sa_period": 0.5}])
    assert made.motions[0].intensity is not None
