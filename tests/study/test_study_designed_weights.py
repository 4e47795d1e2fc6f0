"""A study file asks for designed weights, and says what they reach wherever it shows itself."""

import json
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import scipy
from command_line import printed
from refusals import refusal
from study_texts import study_text

import mrwork as mr
from mrwork.base.values import Floats
from mrwork.control import design_weights
from mrwork.control.laws.design_ground import damper_forces
from mrwork.control.laws.law_problem import Magnitudes
from mrwork.control.laws.weights import WeightWishes
from mrwork.dampers.spec import with_other_dependences
from mrwork.motions.spectral_density import mean_square_of, strong_part
from mrwork.study.comparison import results_in_words
from mrwork.tuning.space import space_of

FIRM = "ground_frequency = 15, ground_damping = 0.6, intensity = 0.01"
WISHES = f"designed = {{ rms_drift = '4 mm', rms_acceleration = '0.5 g', budget = '0.9 kN', {FIRM} }}"


def read(folder: Path, settings: str, damper: str = "differential = true") -> mr.Study:
    file = folder / "study.toml"
    file.write_text(study_text(settings, damper=damper))
    return mr.read_study(file)


def law_of(study: mr.Study) -> mr.ControlLaw:
    law = study.arrangements[-1].law
    assert law is not None
    return law


def gain_of(study: mr.Study) -> Floats:
    return np.asarray(law_of(study).gains["gain"])


FRAME = mr.building("uts")
LIMITS = {"rms_drift": 4e-3, "rms_acceleration": 0.5 * 9.80665}


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_the_law_has_the_gain_of_the_design_with_r_scaled(tmp_path: Path, scale: float) -> None:
    designed = design_weights(FRAME, FRAME.storeys[:1], limits=LIMITS, budget="0.9 kN")
    expected = designed.gain_with(scale)
    difference = gain_of(read(tmp_path, f"{WISHES}\ncontrol_weight = {scale}")) - expected
    size = np.linalg.norm(expected @ designed.plant.scaling)
    assert np.linalg.norm(difference @ designed.plant.scaling) <= 1e-7 * size


def test_what_the_design_reaches_is_said_with_the_law_and_in_json(tmp_path: Path) -> None:
    study = read(tmp_path, f"{WISHES}\ncontrol_weight = 1e-2")
    (heading, notes), (_, loop) = study.design_notes
    assert heading == "Weights of Clipped-optimal"
    assert any("All limits can be met" in each for each in notes)
    assert "Margins of the linear loop" in loop[0]
    assert notes[0] in repr(study.arrangements[-1].law)
    document = json.loads(printed("respond", tmp_path / "study.toml", "--out", tmp_path / "run", "--json"))
    (weights,), (own,) = document["weights"], document["loops"]
    assert (weights["controllers"], weights["notes"]) == (["Clipped-optimal"], list(notes))
    assert (own["controller"], own["notes"]) == ("Clipped-optimal", list(loop))
    assert own["margins"]["devices"][0]["phase"] > 0.0


def test_the_spectrum_of_a_record_is_a_key(tmp_path: Path) -> None:
    motion = mr.synthetic_motion(rng=4, duration=20.0)
    lines = [f"{time:.3f},{each:.6f}" for time, each in zip(motion.time, motion.acceleration, strict=True)]
    (tmp_path / "record.csv").write_text("\n".join(["time [s],acceleration [m/s2]", *lines]))
    wishes = "designed = { rms_drift = 0.004, budget = 900, record = 'record.csv' }"
    found = gain_of(read(tmp_path, f"{wishes}\ncontrol_weight = 1"))
    spectrum = mr.motions.fitted_spectrum(mr.read_motion(tmp_path / "record.csv"))
    limits = {"rms_drift": 4e-3}
    expected = design_weights(FRAME, FRAME.storeys[:1], limits=limits, budget=900.0, spectrum=spectrum).gain
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4 * np.abs(expected).max())


def test_one_number_of_r_keeps_the_ratio_of_two_devices() -> None:
    problem = problem_with_lags(190.0, 190.0)
    wishes = WeightWishes(rms_drift=4e-3, budget=(600.0, 200.0))
    settings = mr.control.RegulatorSettings(designed=wishes, control_weight=0.1)
    limits = {"rms_drift": 4e-3}
    designed = design_weights(FRAME, problem.devices, limits=limits, budget=[600.0, 200.0])
    expected = designed.gain_with(0.1) @ problem.plant.scaling
    found = settings.regulator(problem).gain @ problem.plant.scaling
    np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-6 * np.linalg.norm(expected))


def problem_with_lags(*lags: float | None, delay: float = 0.0) -> mr.control.DesignProblem:
    """The frame with a damper in each of the first storeys, whose drivers lag at these rates."""
    rd1005 = mr.damper("static_hysteretic").preset("kwok2006")
    numbers = np.asarray(rd1005.theta)[: len(rd1005.theta) - rd1005.spec.n_rates]
    devices = [
        mr.Device(
            name=f"{k}",
            spec=with_other_dependences(rd1005.spec, lag="none" if lag is None else "one_rate"),
            theta=numbers if lag is None else [*numbers, lag],
            row=FRAME.storeys[k],
            largest_command=1.88,
        )
        for k, lag in enumerate(lags)
    ]
    return mr.control.DesignProblem(building=FRAME, devices=devices, sample_time=1e-3, delay=delay)


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ("designed = { rms_drift = [1, 2], budget = 1 }\ncontrol_weight = 1", "2 numbers for 5 storeys"),
        ("designed = { rms_drift = 0.004, budget = '1e9 kN' }\ncontrol_weight = 1", r"1e\+12 N.*give less"),
        ("designed = { budget = 100 }\ncontrol_weight = 1", "no response is limited"),
    ],
)
def test_what_cannot_be_designed_is_refused_with_its_line(tmp_path: Path, settings: str, word: str) -> None:
    refusal(read, tmp_path, settings, match=word)


def motions_of(pga: str) -> str:
    """Two synthetic training motions and a test motion of this peak."""
    lines = [
        f'[[motion]]\nsynthetic = "kanai_tajimi"\nduration = 15\nseed = {seed}\npga = "{pga}"\nname = "{seed}"'
        for seed in (1, 2)
    ]
    return "\n".join(f'{each}\nuse = "training"' for each in lines)


@pytest.mark.parametrize("pga", ["0.05 g", "0.5 g"])
def test_limits_are_judged_under_the_ground_of_the_training_motions(tmp_path: Path, pga: str) -> None:
    """The rms drift that is stated is that of a Lyapunov equation of SciPy under the stated filtered noise."""
    file = tmp_path / "study.toml"
    study = read(tmp_path, f"designed = {{ rms_drift = '1 mm' }}\ncontrol_weight = 1\n{motions_of(pga)}")
    assert any("2 training motions" in each for each in study.design_notes[0][1])
    (stated,) = json.loads(printed("respond", file, "--out", tmp_path / "run", "--json"))["weights"]
    (ground,) = stated["ground"]
    mean_squares = [np.mean(strong_part(each) ** 2) for each in study.chosen_on]
    assert ground["mean_square"] == pytest.approx(np.mean(mean_squares), rel=1e-9)
    A, B, E = FRAME.state_matrices(FRAME.storeys[:1])
    w, z, n = ground["frequency"], ground["damping"], len(A)
    output = np.array([-(w**2), -2.0 * z * w])
    soil = np.array([[0.0, 1.0], output])
    noise = np.zeros((n + 2, n + 2))
    noise[-1, -1] = 2.0 * np.pi * ground["intensity"]
    for name, gain in (("rms_without_control", np.zeros((1, n))), ("rms", np.array(stated["gain"]))):
        loop = np.block([[A - B @ gain, np.outer(E, output)], [np.zeros((2, n)), soil]])
        X = scipy.linalg.solve_continuous_lyapunov(loop, -noise)
        for storey, row in enumerate(FRAME.storeys):
            expected = row @ X[: n // 2, : n // 2] @ row
            assert stated["outputs"][storey][name] ** 2 == pytest.approx(expected, rel=1e-6)


def test_the_ground_is_the_only_difference_between_strong_and_weak_motions(tmp_path: Path) -> None:
    """Ten times the motions and ten times limits and budget give the same gain."""
    gains = []
    for pga, limit, budget in (("0.05 g", "0.5 mm", 60), ("0.5 g", "5 mm", 600)):
        wishes = f"designed = {{ rms_drift = '{limit}', budget = {budget} }}\ncontrol_weight = 1"
        gains.append(gain_of(read(tmp_path, f"{wishes}\n{motions_of(pga)}")))
    np.testing.assert_allclose(gains[0], gains[1], rtol=1e-4, atol=1e-4 * np.abs(gains[0]).max())


def test_given_numbers_of_the_ground_hold_and_the_others_are_those_of_the_motions(tmp_path: Path) -> None:
    def ground(keys: str) -> mr.motions.KanaiTajimi:
        text = f"designed = {{ rms_drift = '4 mm', budget = 100{keys} }}\ncontrol_weight = 1"
        (_, weights), *_ = read(tmp_path, text).designs
        found = weights.spectrum
        assert isinstance(found, mr.motions.KanaiTajimi)
        return found

    free, stiff = ground(""), ground(", ground_frequency = 40")
    strong = ground(", intensity = 0.5")
    assert (stiff.frequency, strong.intensity, strong.frequency) == (40.0, 0.5, free.frequency)
    rms = [mean_square_of(each) for each in (free, stiff)]
    assert rms[0] == pytest.approx(rms[1], rel=1e-9)


@pytest.mark.parametrize("budget", ["", ", budget = 400"])
def test_the_budget_is_that_of_the_dampers_unless_given(tmp_path: Path, budget: str) -> None:
    study = read(
        tmp_path,
        f"designed = {{ rms_drift = '4 mm', {FIRM}{budget} }}\ncontrol_weight = 1\nbudget_scale = 0.5",
    )
    (_, weights), *_ = study.designs
    forces = damper_forces(study.problem, weights.spectrum).largest / 3.0
    expected = 200.0 if budget else 0.5 * forces[0]
    assert weights.certificate.budgets == pytest.approx([expected])


def test_a_law_that_asks_for_no_force_is_told_how_much_r_is_too_large(tmp_path: Path) -> None:
    """R over the stated factor asks for force, and a larger R is too large by as much more."""

    def notes(weight: float) -> str:
        return " ".join(law_of(read(tmp_path, f"drifts = 1\ncontrol_weight = {weight}")).notes)

    excess = float(notes(1e-8).split("R is about ")[1].split(" too large")[0])
    assert "asks for no force" not in notes(1e-8 / excess).lower()
    assert f"R is about 1e{round(np.log10(excess * 1e6))} too large" in notes(1e-2)


def test_a_tuned_law_with_a_semi_active_condition_scans_its_budget() -> None:
    wishes = {"designed": {"rms_drift": 4e-3, "semi_active": 0.1}}
    table = mr.study.TuneTable(laws=("clipped_optimal",), settings=wishes)
    magnitudes = Magnitudes(**{each.name: 1.0 for each in fields(Magnitudes)})
    space = space_of(table, "clipped_optimal", magnitudes)
    assert [each.name for each in space.free] == ["budget_scale", "largest_command"]
    assert space.held["control_weight"] == 1.0


def test_a_law_that_is_a_passive_damper_in_effect_is_said_to_be_one(tmp_path: Path) -> None:
    """Without a command, with the largest one throughout by a law in Python that knows no sensor, or neither."""
    (tmp_path / "law.py").write_text("def on(sample, memory):\n    return [1.88]\n")
    on = "[[controller]]\nuser = { file = 'law.py', function = 'on' }"
    found = results_in_words(mr.run_study(read(tmp_path, f"drifts = 1\ncontrol_weight = 1\n{on}"), threads=1))
    assert any("Clipped-optimal under every motion: idle: sends no command" in each for each in found)
    assert any(each.startswith("on under every motion: coincides with passive-on") for each in found)
    found = results_in_words(
        mr.run_study(read(tmp_path, "gain = [[0, 0, 0, 0, 0, 1e12, 0, 0, 0, 0]]"), threads=1)
    )
    assert not any("in effect" in each for each in found)


def test_the_force_of_a_damper_is_that_over_its_tested_range() -> None:
    """Otherwise over the motion that is expected, or over that of the ground."""
    (device,) = problem_with_lags(None).devices
    tested = mr.records.OperatingRange(
        stroke=0.01, velocity=0.15, frequency=None, command=None, command_unit=None, force=1e3, power=1.0
    )
    problem = problem_with_lags(None)
    expected = replace(problem, amplitude=(1e-4, 0.01), velocity=(1e-3, 0.15))
    ranged = replace(problem, devices=[replace(device, tested=tested)])
    soft, stiff = mr.motions.KanaiTajimi(intensity=1e-6), mr.motions.KanaiTajimi()
    found = [damper_forces(each, soil) for each in (expected, ranged) for soil in (soft, stiff)]
    assert len({float(each.largest[0]) for each in found}) == 1
    time = np.linspace(0.0, 6.0 * np.pi, 2001)
    loading = mr.Loading(
        dt=float(time[1]) / 15.0,
        displacement=0.01 * np.sin(time),
        velocity=0.15 * np.cos(time),
        command=1.88,
        command_unit="A",
    )
    force = mr.simulate_force(device.spec, device.theta, loading)
    assert found[0].largest[0] == pytest.approx(np.abs(force[700:]).max(), rel=1e-3)
    free = [float(damper_forces(problem, each).largest[0]) for each in (soft, stiff)]
    assert free[0] < free[1]
