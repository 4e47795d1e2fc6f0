"""A run for MATLAB, OpenSees and a supplier: what is written reads back as the source, and what cannot is refused."""

import csv
import io
import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import printed
from opensees_bouc_wen import force_in_opensees
from quarter_car import CAR, ROAD
from record_files import clean_columns, write_text
from refusals import refusal
from scipy.io import loadmat
from sinusoidal_tests import driven_test, harmonic
from study_samples import results

import mrwork as mr
from mrwork import Fit
from mrwork.runs.exported import matlab_names

MODEL = "normalised_bouc_wen"
LAWFUL = mr.damper(MODEL).with_current_laws({"k_w": "linear", "c": "linear"}, unit="A")
KNOWN = {"k": 2500.0, "x0": 0.03, "rho": 8000.0, "sigma": 0.6, "n": 2.0}
GROWING = {"k_w.0": 200.0, "k_w.1": 600.0, "c.0": 1000.0, "c.1": 2000.0}
MODEL_NAMES = mr.damper(MODEL).names
HELD = {name: (value, value) for name, value in KNOWN.items()}


def measured(command: float) -> mr.DamperTest:
    """A harmonic test of the known damper; its force grows with the command."""
    theta = [(KNOWN | GROWING)[name] for name in LAWFUL.names]
    shape = {"dt": 2e-3, "n_time": 1000, "noise_n": 1.0, "rng": 1}
    return driven_test(LAWFUL, theta, (0.01, 1.0), **shape, command=command)


@pytest.fixture(scope="module")
def fit() -> Fit:
    return mr.identify(LAWFUL, [measured(0.0), measured(0.5), measured(1.0)], bounds=HELD, threads=1)


@pytest.fixture(scope="module")
def plain(fit: Fit) -> Fit:
    """A fit without laws."""
    return mr.identify(mr.damper(MODEL), measured(0.5), bounds=HELD, threads=1)


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run folder beside the record of its test."""
    place = tmp_path_factory.mktemp("export")
    record = write_text(place / "10mm2Hz.csv", clean_columns())
    words = ("--model", "static_hysteretic", "--every", 4, "--threads", 1, "--quiet", "--out", place / "run")
    printed("identify", record, *words)
    return place / "run"


def read_back(path: Path) -> Any:
    return loadmat(path, simplify_cells=True)


def table_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(path.read_text())))


# MATLAB


def test_the_matlab_file_of_a_fit_has_its_parameters_with_their_units(fit: Fit, tmp_path: Path) -> None:
    found = read_back(mr.export(fit, "mat", tmp_path / "fit.mat"))
    names = matlab_names(fit.parameters)
    assert names["k_w.0"] == "k_w_0"
    for name, expected in fit.parameters.items():
        struct = found["parameters"][names[name]]
        assert (struct["name"], struct["value"], struct["unit"]) == (name, expected.value, expected.unit)
        assert (struct["lower"], struct["upper"]) == (expected.lower, expected.upper)
    np.testing.assert_array_equal(found["theta"], fit.theta)
    assert list(found["theta_names"]) == list(fit.spec.names)
    assert list(found["theta_units"]) == [each.unit for each in fit.spec.parameters]
    assert found["laws"]["k_w"]["law"] == "linear"
    assert list(found["laws"]["k_w"]["parameters"]) == ["k_w.0", "k_w.1"]
    assert found["command_unit"] == "A"


def test_the_matlab_file_of_a_folder_has_measured_and_simulated_forces(run: Path, tmp_path: Path) -> None:
    found = read_back(mr.export(run, "mat", tmp_path / "run.mat"))
    opened = mr.load(run)
    (test,) = opened.fit.reading().tests()
    prediction = mr.predict(opened.fit, test)
    for name, expected in (("force", test.force), ("model_force", prediction.model_force)):
        array = found["tests"][name]
        np.testing.assert_array_equal(array["values"], expected)
        assert array["unit"] == "N"
    np.testing.assert_array_equal(found["tests"]["labels"]["time"]["values"], test.time)


def test_a_folder_whose_tests_have_gone_is_exported_without_them(run: Path, tmp_path: Path) -> None:
    record = run.parent / "10mm2Hz.csv"
    record.rename(tmp_path / record.name)
    try:
        with pytest.warns(mr.errors.MrworkWarning, match=r"no tests.*10mm2Hz\.csv"):
            found = read_back(mr.export(run, "mat", tmp_path / "run.mat"))
    finally:
        (tmp_path / record.name).rename(record)
    assert np.size(found["tests"]) == 0
    assert found["model"] == "static_hysteretic"


def test_the_matlab_file_of_a_study_has_every_array_with_unit_and_labels(tmp_path: Path) -> None:
    study = results()
    found = read_back(mr.export(study, "mat", tmp_path / "study.mat"))
    for group, expected in study._named_groups().items():
        names = matlab_names(expected.arrays)
        for name, array in expected.arrays.items():
            struct = found[group][names[name]]
            values = np.asarray(struct["values"])
            if array.values.dtype.kind == "U":
                assert values.tolist() == np.squeeze(array.values).tolist()
            else:
                np.testing.assert_array_equal(values, np.squeeze(array.values))
            # An empty text comes back as an empty array.
            assert (struct["unit"] if np.size(struct["unit"]) else "") == array.unit
            assert list(np.atleast_1d(struct["axes"])) == list(array.axes)
        assert list(found[group]["labels"]["row"]["values"]) == [row.label for row in study.rows]


def test_names_for_matlab_are_valid_distinct_and_short() -> None:
    names = ["k_w.0", "k_w@0", "end", "1st", "_x", "", "ünder", "k" * 90, "k" * 91, "k_w_0"]
    valid = matlab_names(names)
    assert list(valid) == names
    assert len(set(valid.values())) == len(names)
    assert all(re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,62}", each) for each in valid.values())
    assert "end" not in valid.values()


# Tables


def test_the_force_table_is_the_force_of_the_model_in_the_middle_of_the_stroke(
    fit: Fit, tmp_path: Path
) -> None:
    rows = table_of(mr.export(fit, "csv", tmp_path / "force.csv"))
    assert list(rows[0]) == ["command [A]", "velocity [m/s]", "force [N]", "amplitude [m]", "frequency [Hz]"]
    assert sorted({float(row["command [A]"]) for row in rows}) == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert fit.tested is not None
    for row in (rows[0], rows[-1], rows[len(rows) // 2 + 3]):
        command, velocity, force, amplitude, frequency = map(float, row.values())
        assert abs(velocity) == pytest.approx(2.0 * np.pi * frequency * amplitude)
        assert abs(velocity) <= fit.tested.velocity * (1.0 + 1e-12)
        time = np.arange(0.0, 2.75 / frequency, 1e-3 / frequency)
        motion = harmonic(time, (amplitude, frequency), command)
        history = mr.simulate_force(fit.spec, fit.theta, motion)
        assert force == pytest.approx(history[2000 if velocity > 0.0 else 2500], rel=1e-4)


def test_a_force_table_at_one_command_has_no_other(fit: Fit, tmp_path: Path) -> None:
    rows = table_of(mr.export(fit, "csv", tmp_path / "force.csv", command="500 mA"))
    assert {row["command [A]"] for row in rows} == {"0.5"}


def test_the_table_of_a_study_reads_back_as_its_criteria(tmp_path: Path) -> None:
    study = results()
    rows = table_of(mr.export(study, "csv", tmp_path / "criteria.csv"))
    table = study.to_pandas().reset_index()
    assert len(rows) == len(table)
    for name, unit in ((each.name, each.unit) for each in study.criteria_of_runs.declared):
        column = [float(row[f"{name} [{unit}]" if unit else name] or "nan") for row in rows]
        np.testing.assert_array_equal(column, table[name].to_numpy())


# OpenSees


def arguments_in(text: str, material: str) -> list[list[float]]:
    """Numbers behind the tag of a material in a text of Tcl or Python."""
    lines = [line for line in text.splitlines() if re.search(rf"uniaxialMaterial\W+{material}\b", line)]
    plain = [re.sub(r"\[expr \{[^}]*\}\]|\$?tag \+ \d+", " ", line) for line in lines]
    number = r"(?<![\w.])-?\d+\.?\d*(?:e[-+]?\d+)?"
    return [[float(each) for each in re.findall(number, line)] for line in plain]


def opensees_text(fit: Fit, tmp_path: Path, name: str = "damper.tcl", **options: Any) -> str:
    return mr.export(fit, "opensees", tmp_path / name, replace=True, **options).read_text()


def stated_step(text: str) -> float:
    found = re.search(r"at most (\S+) m", text)
    assert found is not None
    return float(found[1])


@pytest.mark.parametrize("error", [0.05, 0.01])
def test_the_exported_damper_keeps_the_stated_error_in_opensees(
    error: float, fit: Fit, tmp_path: Path
) -> None:
    text = opensees_text(fit, tmp_path, command="0.5 A", error=error)
    step = stated_step(text)
    ((*numbers,),) = arguments_in(text, "BoucWen")
    ((c, _),), ((k,),), ((offset,),) = (
        arguments_in(text, name) for name in ("Viscous", "Elastic", "InitStrainMaterial")
    )
    # A triangle whose samples are the largest steps; ours is sampled more finely, so that its spline has sharp corners.
    n, finer = round(0.003 / step), 16
    corners = np.array([0, n, 3 * n, 5 * n])
    x, fine = (
        np.interp(np.arange(0.0, 5 * n, every), corners, [0.0, 0.003, -0.003, 0.003])
        for every in (1.0, 1.0 / finer)
    )
    dt = 1e-3
    v = np.gradient(x, dt)
    loading = mr.Loading(
        dt=dt / finer,
        displacement=fine,
        velocity=np.gradient(fine, dt / finer),
        command=0.5,
        command_unit="A",
    )
    ours = mr.simulate_force(fit.spec, fit.theta, loading)[::finer]
    theirs = force_in_opensees(mr.dampers.OpenSeesBoucWen(**dict(zip(NAMES, numbers, strict=True))), x)
    theirs += c * v + k * (x + offset)
    assert numbers[1] == pytest.approx(500.0, rel=0.01)
    # Where the velocity jumps, the dashpot has two forces.
    smooth = ~np.isin(np.arange(x.size), corners)
    assert 0.3 * error < np.abs(theirs - ours)[smooth].max() / numbers[1] < error


NAMES = ("alpha", "ko", "n", "gamma", "beta", "Ao", "deltaA", "deltaNu", "deltaEta")


def test_tcl_and_python_make_the_same_materials(fit: Fit, tmp_path: Path) -> None:
    tcl, python = (
        opensees_text(fit, tmp_path, name, command="0.5 A", error=0.01) for name in ("d.tcl", "d.py")
    )
    compile(python, "damper.py", "exec")
    for material in ("BoucWen", "Viscous", "Elastic", "InitStrainMaterial", "Parallel"):
        assert arguments_in(tcl, material) == arguments_in(python, material) != []


def test_openseespy_reproduces_the_exported_damper_to_the_stated_error(fit: Fit, tmp_path: Path) -> None:
    # A library of the system may be missing, beside the package.
    ops = pytest.importorskip("openseespy.opensees", exc_type=(ImportError, RuntimeError))
    error = 0.01
    text = opensees_text(fit, tmp_path, "damper.py", command="0.5 A", error=error)
    assert fit.tested is not None
    time = np.arange(0.0, 1.0, 0.9 * stated_step(text) / fit.tested.velocity)
    omega = fit.tested.velocity / fit.tested.stroke
    x, v = fit.tested.stroke * np.sin(omega * time), fit.tested.velocity * np.cos(omega * time)
    loading = mr.Loading(dt=time[1], displacement=x, velocity=v, command=0.5, command_unit="A")
    ours = mr.simulate_force(fit.spec, fit.theta, loading)
    namespace: dict[str, Any] = {}
    exec(text, namespace)
    ops.wipe()
    ops.model("basic", "-ndm", 1, "-ndf", 1)
    namespace["damper"](1)
    ops.testUniaxialMaterial(1)
    theirs = np.empty(x.size)
    for index, (strain, rate) in enumerate(zip(x.tolist(), v.tolist(), strict=True)):
        ops.setStrain(strain, rate)
        theirs[index] = ops.getStress()
    assert np.abs(theirs - ours).max() < error * 500.0


# Refusals


def on_bound(fit: Fit, name: str, value: float, **bounds: float) -> Fit:
    """The fit with a parameter on its upper bound."""
    estimates = [
        replace(each, state="at upper bound", value=value, **bounds) if each.name == name else each
        for each in fit.estimates
    ]
    return replace(fit, estimates=tuple(estimates))


def test_a_bound_of_the_model_is_exported_as_it_is(plain: Fit, tmp_path: Path) -> None:
    steep = mr.damper(MODEL).parameters[MODEL_NAMES.index("n")].upper
    at_bound = on_bound(plain, "n", steep, upper=steep, lower=1.0)
    text = mr.export(at_bound, "opensees", tmp_path / "damper.tcl", error=0.05).read_text()
    assert f"# n is on the upper bound of the model, {steep:g}\n" in text
    assert mr.export(at_bound, "csv", tmp_path / "damper.csv").read_text().startswith("velocity")


def test_what_cannot_be_exported_is_refused(fit: Fit, plain: Fit, tmp_path: Path) -> None:
    out = tmp_path / "out"
    at_bound = on_bound(plain, "c", 2000.0, upper=2000.0)
    # A coefficient has a range of search where none was given.
    at_end = on_bound(fit, "c.1", 5e4)
    stiff = [replace(each, value=1e4) if each.name == "sigma" else each for each in plain.estimates]
    for source, to, options, word in (
        (at_bound, "opensees", {}, "--bound c=LOWER:UPPER"),
        (at_end, "opensees", {"command": "0.5 A"}, "--bound c.1=LOWER:UPPER"),
        (replace(plain, estimates=tuple(stiff)), "opensees", {}, "sub-steps.*--fix sigma=0.5"),
        (fit, "opensees", {}, "as in 0.5A"),
        (fit, "opensees", {"command": "0.5 V"}, "take the command in A"),
        (fit, "opensees", {"command": "3 A"}, "outside the tested commands, 0 to 1 A"),
        (fit, "opensees", {"command": "0.5 A", "error": 1e-5, "time_step": 0.01}, "122045 sub-steps"),
        (fit, "mat", {"command": "0.5 A"}, "the command is only for"),
        (results(), "opensees", {}, "no single damper"),
        (replace(plain, tested=None), "csv", {}, "tested ranges of this fit are not known"),
        (replace(plain, model="bingham"), "opensees", {}, "no material that equals bingham"),
    ):
        refusal(mr.export, source, to, out, **options, match=word)
    assert not out.exists()


def test_a_file_that_is_there_is_replaced_only_where_that_is_said(fit: Fit, tmp_path: Path) -> None:
    place = tmp_path / "fit.mat"
    place.write_text("mine")
    refusal(mr.export, fit, "mat", place, match="replace=True")
    assert place.read_text() == "mine"
    mr.export(fit, "mat", place, replace=True)
    assert read_back(place)["model"] == MODEL
    assert [each.name for each in tmp_path.iterdir()] == ["fit.mat"]


def test_an_export_says_what_the_record_adds_to_the_force_of_the_damper(tmp_path: Path) -> None:
    lag, tests = 0.005, []
    for command in (0.0, 0.5, 1.0):
        test = measured(command)
        observed = mr.records.Observation(lag_seconds=lag).observe(test.force, test.dt)
        tests.append(replace(test, force=observed))
    spec = mr.damper(MODEL).with_current_laws({"k_w": "linear", "c": "linear"}, unit="A")
    fit = mr.identify(spec, tests, bounds=HELD, observe=f"lag={lag}", threads=1)
    assert "lagging by 0.005 s" in fit.observation_in_words
    found = read_back(mr.export(fit, "mat", tmp_path / "fit.mat"))
    assert found["observation"] == fit.observation_in_words
    for own, force, test in zip(found["tests"], fit.forces, tests, strict=True):
        assert (own["observation"]["lag_seconds"], own["words"]) == (lag, "lagging by 0.005 s")
        # The law, the parameters and the lag of the file give the force of the model.
        loading = mr.Loading(
            dt=test.dt, displacement=test.displacement, velocity=test.velocity, command=test.current,
            command_unit="A",
        )  # fmt: skip
        damper = mr.simulate_force(fit.spec, found["theta"], loading)
        again = mr.records.Observation(**own["observation"]).observe(damper, test.dt)
        np.testing.assert_allclose(again, force, atol=0.05)
    text = mr.export(fit, "opensees", tmp_path / "damper.tcl", command="0.5 A").read_text()
    assert f"# {fit.observation_in_words}" in text
    rows = table_of(mr.export(fit, "csv", tmp_path / "fit.csv", command="0.5 A"))
    assert {row["remark"] for row in rows} == {fit.observation_in_words}


def test_a_damper_is_printed_in_a_folder_that_names_it(fit: Fit, tmp_path: Path) -> None:
    folder = mr.export(fit, "c", tmp_path / "rig damper")
    assert {each.name for each in folder.iterdir()} == {"rig_damper.h", "rig_damper.c", "rig_damper_check.c"}
    head = (folder / "rig_damper.h").read_text()
    assert f"{fit.fit_percent:.2f} % of 3 tests" in head
    refusal(mr.export, fit, "c", folder, match="is there already")
    mr.export(fit, "c", folder, single=True, replace=True)
    assert "float c_0;" in (folder / "rig_damper.h").read_text()


def test_the_command_tells_what_printed_code_does_between_samples(run: Path, tmp_path: Path) -> None:
    said = json.loads(printed("export", run, "--target", "c", "--out", tmp_path / "rig", "--json"))
    assert [Path(each).name for each in said["files"]] == ["rig.h", "rig.c", "rig_check.c"]
    assert said["substeps"] >= 1
    assert said["notes"][0].startswith("Between samples the motion is straight")


def test_a_law_of_actuators_is_printed_with_its_forces(tmp_path: Path) -> None:
    path = tmp_path / "active.toml"
    path.write_text(
        """
building = { n_storeys = 2, masses = ["20 t"], stiffnesses = ["20 MN/m"], storey_damping = ["50 kN s/m"] }
damper = [{ storey = 1, actuator = true, largest_force = "5 kN" }]
motion = [{ synthetic = "kanai_tajimi" }]
controller = [{ law = "active", settings = { drifts = 1, control_weight = 1e-12 } }]
"""
    )
    folder = mr.export(path, "c", tmp_path / "force")
    assert "/* Commands [N]" in (folder / "force.h").read_text()
    assert "mr_min(5000.0, mr_max((-5000.0)" in (folder / "force.c").read_text()


def test_a_law_that_reads_the_road_says_so(tmp_path: Path) -> None:
    path = tmp_path / "car.toml"
    path.write_text(f'{CAR}sprung = "body"\n{ROAD}[[controller]]\nlaw = "mixed_skyhook"\n')
    text = (mr.export(path, "c", tmp_path / "sky") / "sky.h").read_text()
    assert "reads the velocity of the ground" in text


def test_what_is_not_printed_is_refused(fit: Fit, tmp_path: Path) -> None:
    refusal(mr.export, fit, "c", tmp_path / "a", law="passive", match="a fit has no control law")
    refusal(mr.export, fit, "csv", tmp_path / "a.csv", single=True, match="only for an export to c")
    refusal(mr.export, fit, "c", tmp_path / "***", match="no letter or digit")
    refusal(
        mr.export,
        fit,
        "c",
        tmp_path / "a",
        time_step=0.2,
        match="has 5 samples a cycle .* shorter --time-step",
    )
    refusal(mr.export, results(), "c", tmp_path / "a", match="the study file for a controller")
