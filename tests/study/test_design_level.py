"""The level at which the laws of a study are designed, which keep their settings at all others."""

from __future__ import annotations

from typing import Any

import numpy as np
from refusals import refusal

import mrwork as mr
from mrwork.study import Study
from mrwork.study.comparison import chosen_in_words, judged_in_words

LEVELS = ("0.1 g", "0.3 g", "0.5 g")


def study(levels: tuple[str | float, ...] = LEVELS, *, key: str = "pga", **others: Any) -> Study:
    uses = [("training", 0), ("training", 1), ("test", 2)] if others.pop("trained", False) else [("test", 0)]
    return mr.study_of(
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


def test_laws_and_command_at_every_level_are_those_of_a_study_of_the_design_level() -> None:
    whole, alone = study(design_level="0.3 g"), study(("0.3 g",))
    for level in ("0.3 g", "0.1 g"):
        own, of_level = alone.laws[-1][1].gains, study(design_level=level).laws[-1][1].gains
        assert all(np.array_equal(own[name], each) for name, each in of_level.items()) == (level == "0.3 g")
    found, one = mr.run_study(whole), mr.run_study(alone)
    assert [row.label for row in found.rows] == [row.label for row in one.rows]
    assert [found.criteria(row, 1) for row in range(4)] == [one.criteria(row, 0) for row in range(4)]
    assert "those at 0.3 g" in chosen_in_words(found)
    # Scores are of that level, so that a collapse at the highest does not hide them; the others stay with the record.
    assert found.judged_motions == (1,)
    assert judged_in_words(found) == "1 motion at 0.3 g"
    assert [found.score(row) for row in range(4)] == [one.score(row) for row in range(4)]
    assert found.record_levels.places.tolist() == [[0, 1, 2]]
    assert not found.warnings()


def test_a_study_of_several_levels_says_that_its_laws_are_of_all() -> None:
    several = study()
    assert several.design_levels == LEVELS
    assert "over 3 levels at once (0.1 g to 0.5 g)" in mr.run_study(several).warnings()[0]
    assert not study(("0.3 g",)).design_levels
    refusal(study, design_level="0.2 g", match="give one of 0.1 g")


def test_with_training_motions_it_is_theirs_also_in_tune() -> None:
    trained = study(trained=True, design_level="0.5 g")
    assert [each.name for each in trained.chosen_on] == ["record 0, 0.5 g", "record 1, 0.5 g"]
    assert trained.problem is not None
    assert tuple(trained.problem.motions) == trained.chosen_on
    tuned = mr.tune(trained, laws=["clipped_optimal"], budget=24, rng=0)
    assert (len(tuned.training), len(tuned.testing), tuned.design_levels) == (2, 3, ("0.5 g",))


def test_a_level_may_be_a_factor() -> None:
    scaled = study((1.0, 2.0), key="factor")
    assert scaled.design_levels == ("factor 1", "factor 2")


def test_a_design_level_is_written_with_the_study(tmp_path: Any) -> None:
    path = study(design_level="0.3 g").to_toml(tmp_path / "study.toml")
    assert mr.read_study(path).design_levels == ("0.3 g",)
