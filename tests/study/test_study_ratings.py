"""Ratings of dampers, forces by storey, and passive devices of the building, of a study that is run."""

from dataclasses import replace

import numpy as np
import pytest

import mrwork as mr
from mrwork.dampers.tested_range import OperatingRange, beyond_rating
from mrwork.drawing.of_studies import energy_parts
from mrwork.study import StudyResults
from mrwork.study.folder import study_document
from mrwork.study.results import shares_in_words

RATED = 20.0


@pytest.fixture(scope="module")
def results() -> StudyResults:
    """Two storeys with a damper in each, that of storey 1 rated for a small force, and a viscous damper."""
    study = mr.study_of(
        building={
            "n_storeys": 2,
            "masses": [500.0],
            "stiffnesses": [2e5],
            "modal_damping": {"ratios": [0.02]},
            "viscous": [{"storey": 2, "damping": 500.0}],
        },
        dampers=[
            {"storey": 1, "preset": "kwok2006", "rated_force": RATED, "rated_stroke": "10 m"},
            {"storey": 2, "preset": "kwok2006"},
        ],
        motions=[mr.synthetic_motion(rng=0, duration=4.0, peak=2.0)],
        references="none",
    )
    return mr.run_study(study)


def test_a_run_beyond_a_rating_is_told_and_stored(results: StudyResults) -> None:
    said = [each for each in results.warnings() if "rated" in each]
    assert len(said) == 1
    assert f"rated to {RATED:g} N" in said[0]
    assert "beyond the rating in 1 of 1 runs" in said[0]
    row = results.row_of("passive_off")
    assert row is not None
    (first, second) = results.demands(row, 0)
    assert first.outside.names == ("force",)
    assert first.outside.exceedances[0].rated
    assert second.outside.names == ()
    (run,) = (each for each in study_document(results)["results"] if each["kind"] == "passive_off")
    assert list(run["outside_tested_range"]) == ["force"]


def test_a_rating_is_exceeded_only_above_it() -> None:
    demand = OperatingRange(
        stroke=0.02, velocity=0.1, frequency=None, command=None, command_unit=None, force=100.0, power=1.0
    )
    assert beyond_rating(demand, force=100.0, stroke=None) == ()
    (one,) = beyond_rating(demand, force=100.0, stroke=0.01)
    assert (one.quantity, one.times) == ("stroke", 2.0)


def test_forces_are_said_by_storey_and_the_base_has_those_of_the_first(results: StudyResults) -> None:
    (said,) = shares_in_words(results)
    row = results.row_of("passive_off")
    assert row is not None
    forces, bare = results.runs[row, 0].peak_force / 1e3, results.runs[0, 0].peak_base_shear / 1e3
    assert f"{forces[0]:.3g} kN in storey 1" in said
    assert f"{forces[1]:.3g} kN in storey 2; on the base {forces[0]:.3g} kN, " in said
    assert f"{100.0 * forces[0] / bare:.2g} % of the peak base shear" in said


def test_dampers_that_stand_in_one_storey_add_there(results: StudyResults) -> None:
    """Beside each other they share the drift, so that their forces add."""
    first, second = results.dampers
    beside = replace(results, dampers=(first, replace(second, storey=0)))
    row = results.row_of("passive_off")
    assert row is not None
    together = float(np.sum(results.runs[row, 0].peak_force[:2])) / 1e3
    assert f"reach {together:.3g} kN in storey 1, " in shares_in_words(beside)[0]


def test_viscous_dampers_of_the_building_are_listed_with_the_other_devices(results: StudyResults) -> None:
    facts = results.building
    assert facts is not None
    assert facts.passive == ("viscous damper in storey 2",)
    assert facts.passive_storeys == (1,)
    # Forces and strokes of passive devices stand behind those of the dampers.
    assert len(results.runs[0, 0].peak_force) == 1
    assert results.runs[0, 0].peak_force[0] > 0.0


def test_energy_of_viscous_dampers_is_that_of_the_dampers(results: StudyResults) -> None:
    """It is the integral of c v^2 of their storey, and the energies still balance."""
    uts = mr.buildings.with_viscous_damper(mr.building("uts"), storey=1, damping=1e4)
    motion = mr.synthetic_motion(rng=0, duration=4.0, peak=2.0)
    study = mr.study_of(building=uts, motions=[motion])
    kept = {}
    run = mr.run_study(study, keep=lambda row, motion, history: kept.update({row: history})).runs[0, 0]
    history = kept[0]
    # Trapezoids over the samples of the hardware, 1 ms of a first period of 0.35 s.
    rate = np.gradient(history.drift[:, 0], history.time)
    expected = np.trapezoid(1e4 * rate**2, history.time)
    dampers, structure, moving = energy_parts(run.numbers)
    assert dampers == pytest.approx(float(expected), rel=2e-3)
    assert history.energy[-1, 4] == pytest.approx(dampers, rel=1e-3)
    assert structure == pytest.approx(float(run.damping_energy), rel=1e-3)
    assert dampers + structure + moving == pytest.approx(float(run.input_energy), rel=1e-9)


def test_a_linear_damper_leaves_a_linear_building() -> None:
    damped = mr.buildings.with_viscous_damper(mr.building("uts"), storey=1, damping=1e4)
    assert damped.nonlinear == ""
    assert mr.buildings.system_of(damped).n_states == 10
