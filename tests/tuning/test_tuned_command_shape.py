"""Dead zone and slope of the command are searched where a table frees them, and stand in the chosen study."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import tuning_samples
from refusals import refusal

import mrwork as mr
from mrwork.study import TuneTable
from mrwork.study.loop_case import training_case
from mrwork.tuning import tune
from mrwork.tuning.law_plan import Bench
from mrwork.tuning.space import LawCandidate
from mrwork.tuning.tuned_laws import settings_in_words
from mrwork.tuning.tuning_folder import chosen_study
from mrwork.tuning.tuning_run import plan_of

TUNE = """
[[tune]]
laws = ["clipped_optimal"]
free = { control_weight = [], dead_zone = [1e-3, 0.05], command_slope = [], largest_command = [] }
budget = 16
population = 8
"""


def test_a_free_dead_zone_and_slope_stand_in_the_chosen_study_with_its_score(tmp_path: Path) -> None:
    tuned = tuning_samples.tuned_law_with_its_score(tmp_path, TUNE)
    assert {"control_weight", "dead_zone", "command_slope", "largest_command"} == {
        each.name for each in tuned.free
    }


def test_a_candidate_states_its_dead_zone_and_slope(tmp_path: Path) -> None:
    """Where the search has chosen them: the controller of the chosen study, the words of pages, the law of the row."""
    study = tuning_samples.small_study(TUNE)
    results = tune(tuning_samples.small_study(), study.tunes, threads=1)
    settings = {"drifts": 1.0, "control_weight": 1e-12, "largest_command": 1.5}
    shaped = {**settings, "dead_zone": 0.004, "command_slope": 25.0}
    law = replace(results.laws[0], settings=shaped)
    text = chosen_study(replace(results, laws=(law,)), study.origin.file)
    assert "\ndead_zone = 0.004\ncommand_slope = 25.0\n" in text
    (tmp_path / "chosen.toml").write_text(text, encoding="utf-8")
    chosen = mr.read_study(tmp_path / "chosen.toml")
    made = next(each.law for each in chosen.arrangements if each.row.label == law.label)
    assert isinstance(made, mr.ControlLaw)
    assert (made.dead_zone, made.command_slope) == (0.004, 25.0)
    assert settings_in_words(shaped, "A").endswith("at most 1.5 A, dead zone 0.004 m/s, slope at most 25 A/s")
    assert law.candidate.shape == (0.004, 25.0)
    assert replace(law, settings=settings).candidate.shape == (0.0, np.inf)


def test_candidates_of_different_shapes_are_simulated_together_as_alone() -> None:
    study = tuning_samples.small_study()
    bench = Bench(study=study, case=training_case(study, threads=1))
    shapes = [(0.0, np.inf), (0.002, np.inf), (0.01, 40.0), (0.0, 40.0), (0.05, np.inf)]
    for name, settings in (
        ("clipped_optimal", {"drifts": 1.0, "control_weight": 1e-12}),
        ("maximum_energy_dissipation", {}),
    ):
        candidates = [
            LawCandidate({**settings, "largest_command": 1.5, "dead_zone": zone, "command_slope": slope})
            for zone, slope in shapes
        ]
        together = bench.run(name, candidates)
        for place, candidate in enumerate(candidates):
            alone = bench.run(name, [candidate])
            for criterion, numbers in alone.numbers.items():
                np.testing.assert_array_equal(
                    together.numbers[criterion][place], numbers[0], err_msg=f"{criterion} of {candidate}"
                )
        assert np.unique(together.numbers["command_travel"][:, 0, 0]).size == len(shapes)


def test_they_are_searched_only_where_asked() -> None:
    study = tuning_samples.small_study()

    def names(table: TuneTable) -> list[str]:
        return [each.name for each in plan_of(study, table, 1).space.free]

    plain = TuneTable(laws=("clipped_optimal",))
    assert not {"dead_zone", "command_slope"} & {*names(plain)}
    asked = TuneTable(laws=("mixed_skyhook",), free={"crossover": (), "dead_zone": (), "command_slope": ()})
    assert names(asked) == ["crossover", "dead_zone", "command_slope"]
    space = plan_of(study, asked, 1).space
    # A law that is sent as it is begins where its command is shaped least.
    candidate = space.candidate(space.start)
    unshaped = LawCandidate({**candidate.of_law, "largest_command": space.largest_command})
    place = space.unit(unshaped)
    assert place is not None
    np.testing.assert_array_equal(place[1:], [0.0, 1.0])
    refusal(names, TuneTable(laws=("passive",), free={"dead_zone": ()}), match="'dead_zone'")
    refusal(names, TuneTable(laws=("active",), free={"command_slope": ()}), match="'command_slope'")
