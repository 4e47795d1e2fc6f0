"""Control laws of a study: from settings or a finished gain to numbers, dead zone and slope of their commands."""

from pathlib import Path

import numpy as np
import pytest
import scipy
import tuning_samples
from refusals import refusal
from study_texts import study_text

import mrwork as mr
from mrwork.base.documents import read_table
from mrwork.base.places import Place
from mrwork.control.laws.law_problem import Design, LawSettings
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.linear.lqr import PUBLISHED_REGULATORS
from mrwork.dampers import damper
from mrwork.study.reading import parse
from mrwork.study.schema import laws_text
from mrwork.study.study import study_fingerprint

# What each law is told here; those that need nothing are told nothing.
TOLD = {
    "passive": "command = 0.5",
    "clipped_optimal": "control_weight = 1e-12",
    "modified_clipped_optimal": "control_weight = 1e-12\nfull_force = '1 kN'",
    "proportional_clipped_optimal": "control_weight = 1e-12\nfull_force = 1000",
    "modulated_homogeneous_friction": "slope = '100 kN/m'",
    "sliding_mode": "peak_acceleration = '0.3 g'\nlargest_force = 2000",
    "adaptive_sliding_mode": "peak_acceleration = 3\nlargest_force = 2000",
    "super_twisting": "peak_acceleration = 3\nlargest_force = 2000",
    "fuzzy": "deformation = '5 mm'\nrate = 0.1",
    "proportional_direct": "slope = 1e-3",
    "inverse_direct": "control_weight = 1e-12\ndrifts = 1e4",
    "inverse_parabola": "control_weight = 1e-12\ndrifts = 1e4",
    "inverse_network": "control_weight = 1e-12\nlayer = [[0.1, 100, 5, 5e-4, 1]]\noutput = 0.8\n"
    "reach = [5e-3, 0.1, 2000]",
    "signal_network": "control_weight = 1e-12\ndeformation = 0.005\nrate = 0.1\nforce = 2000\nnetwork = ["
    + ", ".join(["0.1"] * 25)
    + "]",
    "active": "control_weight = 1e-12",
    "predictive_rollout": "base = 0.5\ndrift = '2 mm'\nacceleration = '0.28 g'",
}


def design_problem(
    name: str = "uts", preset: str = "kwok2006", model: str = "static_hysteretic"
) -> mr.control.DesignProblem:
    frame, published = mr.building(name), damper(model).preset(preset)
    device = mr.Device(
        name="damper in storey 1",
        spec=published.spec,
        theta=np.array(published.theta),
        row=frame.storeys[0],
        differential=preset == "kwok2006",
        largest_command=published.largest_command or 0.0,
    )
    return mr.control.DesignProblem(building=frame, devices=(device,), sample_time=1e-3)


def design(law: str, text: str, on: mr.control.DesignProblem | None = None) -> Design:
    document, lines = parse(text, "study.toml")
    place = Place(origin="study.toml", lines=lines)
    settings: LawSettings = read_table(SETTINGS[law], document, place)
    with place.prefix_errors(mr.errors.SettingError):
        return settings.design(on or design_problem())


@pytest.mark.parametrize("law", list(SETTINGS))
def test_a_design_has_the_finite_numbers_that_its_law_takes(law: str) -> None:
    on = design_problem()
    found = design(law, TOLD.get(law, ""), on)
    assert all(np.isfinite(each).all() for each in (*found.gains.values(), *found.tables.values()))
    curve = on.curve if mr.control.control_law(law).needs_curve else None
    model = (
        mr.control.LoopModel(building=on.building, devices=on.devices)
        if mr.control.control_law(law).needs_model
        else None
    )
    made = mr.ControlLaw(name=law, gains=found.gains, tables=found.tables, curve=curve, model=model)
    n_gains = sum(
        {"device": 1, "state": 10, "loop": 1}.get(gain.shape, gain.numbers) for gain in made.spec.gains
    )
    assert made.gain_rows(1, 10).shape == (1, n_gains)
    assert len(made.table_rows()) == len(made.spec.tables)


def test_the_weights_of_dyke_are_stated_in_a_table() -> None:
    on = design_problem("dyke1996", "dyke1996", "modified_bouc_wen")
    found = design("clipped_optimal", "accelerations = [0, 0, 1]\ncontrol_weight = 1e-17", on)
    (dyke,) = (each for each in PUBLISHED_REGULATORS if each.name == "dyke1996")
    published = mr.control.regulator_of_outputs(
        on.plant, mr.control.accelerations(on.plant), dyke.weights, dyke.control_weight
    )
    assert found.gains["gain"] == pytest.approx(published.gain, rel=1e-9)


def test_one_weight_stands_for_all_floors() -> None:
    on = design_problem()
    one = design("clipped_optimal", "accelerations = 2\ncontrol_weight = 1e-9", on)
    each = mr.control.regulator_of_outputs(on.plant, mr.control.accelerations(on.plant), [2.0] * 5, 1e-9)
    assert one.gains["gain"] == pytest.approx(each.gain, rel=1e-12)


def test_the_force_of_a_sliding_law_pushes_its_surface_down() -> None:
    on = design_problem()
    found = design("sliding_mode", TOLD["sliding_mode"], on).gains
    # (S s)' = S B f + ..., and the law adds +rho sat(S s/phi) to f.
    assert (found["surface"] @ on.plant.B).item() == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("law", "text", "word"),
    [
        ("clipped_optimal", "drifts = [1, 2]\ncontrol_weight = 1", "2 weights.* 5 storeys"),
        ("clipped_optimal", "drifts = 1\nenergy = 1\ncontrol_weight = 1", "line 2: .*keep one"),
        ("passive", "command = 3", "1.88 at most"),
    ],
)
def test_a_setting_that_does_not_fit_is_refused_with_its_line(law: str, text: str, word: str) -> None:
    refusal(design, law, text, match=word)


def test_every_law_of_the_registry_has_settings_and_is_printed() -> None:
    names = {spec.name for spec in mr.control.control_laws()}
    # Laws of users that other tests have made have settings, too.
    assert names <= set(SETTINGS)
    assert all(f"{name}: " in laws_text() for name in names)


# Finished gains


FRAME = mr.building("uts")
PLANT = mr.control.plant_of(FRAME, FRAME.storeys[:1])
GAIN = mr.control.regulator_of_outputs(PLANT, mr.control.drifts(PLANT), 1.0, 1e-11).gain


def with_gain(folder: Path, law: str) -> mr.Study:
    file = folder / "study.toml"
    text = study_text("drifts = 1\ncontrol_weight = 1e-11", damper="differential = true\nlag = 190")
    file.write_text(f"{text}\n[[controller]]\nlabel = 'given'\n{law}")
    return mr.read_study(file)


def gain_of(read: mr.Study) -> object:
    law = read.arrangements[-1].law
    assert law is not None
    return law.gains["gain"]


@pytest.mark.parametrize(
    "name", ["gain.csv", "gain.txt", "gain.npy", "gain.mat", "all.mat:law.K", "array", "settings"]
)
def test_a_gain_from_anywhere_is_the_gain_of_the_law(tmp_path: Path, name: str) -> None:
    rows = GAIN.tolist()
    if name.endswith((".csv", ".txt")):
        np.savetxt(tmp_path / name, GAIN, fmt="%.17g", delimiter="," if name.endswith("csv") else " ")
    if name.endswith(".npy"):
        np.save(tmp_path / name, GAIN)
    if name.endswith(".mat"):
        scipy.io.savemat(tmp_path / name, {"K": GAIN})
    if ":" in name:
        scipy.io.savemat(tmp_path / "all.mat", {"law": {"K": GAIN, "note": "lqr"}, "A": np.eye(10)})
    law = f"law = 'clipped_optimal'\ngain = {name!r}"
    if name == "array":
        law = f"law = 'clipped_optimal'\ngain = {rows}"
    if name == "settings":
        law = f"law = 'modified_clipped_optimal'\ngain = {rows}\nsettings = {{ full_force = 500 }}"
    np.testing.assert_array_equal(np.asarray(gain_of(with_gain(tmp_path, law))), GAIN)


def test_a_gain_that_cannot_be_is_told_its_shape_and_units(tmp_path: Path) -> None:
    np.save(tmp_path / "cube.npy", np.zeros((2, 2, 2)))
    scipy.io.savemat(tmp_path / "two.mat", {"K": GAIN, "L": GAIN})
    for law, word in (
        (f"law = 'clipped_optimal'\ngain = {GAIN.T.tolist()}", "10 x 1, and the law takes 1 x 10"),
        ("law = 'clipped_optimal'\ngain = [[1, 2], [3]]", "different lengths"),
        ("law = 'clipped_optimal'\ngain = 'absent.csv'", "no such file"),
        ("law = 'clipped_optimal'\ngain = 'cube.npy'", r"shape \(2, 2, 2\)"),
        ("law = 'clipped_optimal'\ngain = 'two.mat'", r"'K' \(1 x 10\), 'L' .* as in \"two.mat:K\""),
        ("law = 'clipped_optimal'\ngain = 'two.mat:J'", "a matrix 'J' was expected"),
        (f"law = 'clipped_optimal'\ngain = {GAIN.tolist()}\nsettings = {{ drifts = 1 }}", "drifts; keep one"),
        (f"law = 'lyapunov'\ngain = {GAIN.tolist()}", "no gain of a desired force"),
        (f"law = 'best_passive'\ngain = {GAIN.tolist()}", "no gain; leave it out"),
    ):
        refusal(with_gain, tmp_path, law, match=word)


def test_a_given_gain_is_designed_in_a_batch_and_certified() -> None:
    damper = mr.damper("static_hysteretic").preset("kwok2006")
    device = mr.Device(
        name="1", spec=damper.spec, theta=damper.theta, row=FRAME.storeys[0], largest_command=1.88
    )
    problem = mr.control.DesignProblem(building=FRAME, devices=[device], sample_time=1e-3)
    given = mr.control.RegulatorSettings(gain=GAIN.tolist())
    many = [given, mr.control.RegulatorSettings(drifts=1.0, control_weight=1e-11)]
    for found in mr.control.RegulatorSettings.designs(problem, many):
        assert isinstance(found, Design)
        np.testing.assert_allclose(found.gains["gain"], GAIN, rtol=1e-9)
    assert "is stable" in given.certificate(problem)


# Dead zone, slope and accelerometers


LAW = '\n[[controller]]\nlaw = "clipped_optimal"\nsettings = {{ control_weight = 1e-12 }}\n{}\n'
MOTION = tuning_samples.motion("A", 1)


def read(folder: Path, more: str) -> mr.Study:
    return mr.read_study(tuning_samples.study_file(folder, tune="", motions=MOTION, more=more))


def ran(folder: Path, more: str) -> mr.StudyResults:
    return mr.run_study(read(folder, more), threads=1)


def test_dead_zone_and_slope_of_a_controller_quiet_its_command(tmp_path: Path) -> None:
    found = ran(
        tmp_path,
        LAW.format('label = "plain"')
        + LAW.format('label = "shaped"\ndead_zone = "5 mm/s"\ncommand_slope = "20 A/s"'),
    )
    plain, shaped = (
        found.quantities.of_row(row)
        for row, each in enumerate(found.rows)
        if each.label in ("plain", "shaped")
    )
    assert shaped.command_travel.max() <= 20.0
    assert plain.command_travel.max() > 20.0
    assert shaped.switching_rate.max() < plain.switching_rate.max()


def test_a_dead_zone_is_an_input_of_a_run(tmp_path: Path) -> None:
    """A journal without it is of another study."""
    plain = read(tmp_path, LAW.format(""))
    shaped = read(tmp_path, LAW.format('dead_zone = "5 mm/s"'))
    off = read(tmp_path, LAW.format('dead_zone = "0 m/s"'))
    assert study_fingerprint(plain) != study_fingerprint(shaped)
    assert study_fingerprint(plain)["arrangement"] == study_fingerprint(off)["arrangement"]


@pytest.mark.parametrize("law", ["acceleration_driven", "mixed_skyhook"])
def test_laws_of_accelerations_take_no_settings_and_have_noise(law: str, tmp_path: Path) -> None:
    controller = f'\n[[controller]]\nlaw = "{law}"\n'
    noise = 'acceleration_noise = "0.05 m/s2"\n'
    quiet, noisy = ran(tmp_path, controller), ran(tmp_path, noise + controller)
    assert quiet.quantities.finished[3, 0, 0]
    assert quiet.quantities.switching_rate[3, 0, 0].max() > 0.0
    assert np.any(noisy.quantities.rms_drift[3, 0, 0] != quiet.quantities.rms_drift[3, 0, 0])
    # The others read no accelerations.
    np.testing.assert_array_equal(noisy.quantities.rms_drift[1, 0, 0], quiet.quantities.rms_drift[1, 0, 0])


@pytest.mark.parametrize(
    ("more", "word"),
    [
        ('\n[[controller]]\nlaw = "best_passive"\ndead_zone = "1 mm/s"\n', "best_passive has no dead_zone"),
        ('acceleration_noise = "0.05 m/s2"\n' + LAW.format(""), "acceleration_noise.*no effect.*observer"),
        ('ground_preview = "50 ms"\n' + LAW.format(""), "ground_preview.*no effect.*predictive_rollout"),
    ],
)
def test_what_a_study_cannot_shape_or_read_is_refused(tmp_path: Path, more: str, word: str) -> None:
    refusal(read, tmp_path, more, match=word)
