"""FMUs of stand-ins: valid, compiled without a warning, with the numbers of the C within them."""

import ctypes
import os
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from ctypes import byref, c_double, c_size_t, c_void_p
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import c_sources
import numpy as np
import own_dampers
import pytest
from c_sources import SUBSTEP
from fmu_instances import Instance, Unpacked
from loop_samples import devices, five_storeys, rd1005
from own_laws import LAWS
from printed_laws import printed as printed_law
from scipy.integrate import solve_ivp

import mrwork as mr
from mrwork.closed_loop.printed_loop import PrintedLoop
from mrwork.embedded.c_source import CSource, Flavour
from mrwork.embedded.damper_c import damper_source
from mrwork.embedded.fmu import FMIVersion, c_compiler, fmu_of
from mrwork.errors import LibraryError

ROOT = Path(__file__).parents[2]
SOURCES: dict[str, Callable[[], CSource]] = {
    "hysteretic": c_sources.hysteretic,
    "stateless": c_sources.stateless,
    "controller": c_sources.controller,
    "law of the user": lambda: own_law()[1],
    "damper of the user": lambda: own_damper(),
}


def own_law() -> tuple[PrintedLoop, CSource]:
    """A law of the user with memory, settings and sines."""
    return printed_law(five_storeys(), devices(rd1005()), mr.Hardware(), LAWS["phase"]())


def own_damper() -> CSource:
    """A loop of the user, whose sub-steps follow from its derivatives."""
    tested = mr.records.OperatingRange(
        stroke=0.02,
        velocity=0.1,
        frequency=None,
        command=None,
        command_unit=own_dampers.loop.command_unit,
        force=1e3,
        power=1.0,
    )
    spec = own_dampers.loop
    return damper_source("mine", spec, spec.nominal, tested, Flavour(), sample_time=1e-3)


VERSIONS: tuple[FMIVersion, ...] = ("2.0", "3.0")
STRICT = ("-std=c99", "-O2", "-Wall", "-Wextra", "-Werror", "-pedantic")
# Largest amplitudes of displacement [m] and velocity [m/s], and the largest command [A].
MOTION = (0.02, 0.3, 2.0)


def compiler_of(name: str) -> str:
    """The compiler, or a skip that names it."""
    found = shutil.which(name)
    if found is None:
        pytest.skip(f"this machine has no {name}")
    return found


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str, FMIVersion], Unpacked]:
    """FMUs with a binary, each compiled once."""
    if (compiler := c_compiler()) is None:
        pytest.skip("this machine has no C compiler")
    made: dict[tuple[str, FMIVersion], Unpacked] = {}

    def unpacked(kind: str, version: FMIVersion) -> Unpacked:
        if (kind, version) not in made:
            folder = tmp_path_factory.mktemp(f"{kind}_{version[0]}")
            made[kind, version] = Unpacked(fmu_of(SOURCES[kind](), version, compiler), folder)
        return made[kind, version]

    return unpacked


@pytest.fixture(scope="module")
def printed(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The C of the hysteretic damper without a frame."""
    compiler, folder = compiler_of("cc"), tmp_path_factory.mktemp("printed")
    for name, text in c_sources.hysteretic().files.items():
        (folder / name).write_text(text)
    command = [compiler, "-std=c99", "-O2", "-fPIC", "-shared", "rig_damper.c", "-o", "damper.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    return ctypes.CDLL(str(folder / "damper.so"))


class Memory(ctypes.Structure):
    """`rig_damper_memory`."""

    _fields_ = (("state", c_double * 1), ("current", c_double), ("more", c_double * 10))


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("kind", SOURCES)
def test_an_fmu_is_valid(kind: str, version: FMIVersion, tmp_path: Path) -> None:
    fmpy, validation = pytest.importorskip("fmpy"), pytest.importorskip("fmpy.validation")
    path = tmp_path / "it.fmu"
    path.write_bytes(fmu_of(SOURCES[kind](), version))
    assert validation.validate_fmu(str(path)) == []
    about = fmpy.read_model_description(str(path))
    assert len(about.buildConfigurations[0].sourceFileSets[0].sourceFiles) == 2
    assert (about.modelExchange is not None) == (version == "2.0" and SOURCES[kind]().kind == "damper")


def compile_strictly(
    source: CSource, version: FMIVersion, folder: Path, compiler: str, *options: str
) -> Path:
    """Compile the sources of an FMU, of which every warning is an error; their folder."""
    place = Unpacked(fmu_of(source, version), folder).folder / "sources"
    command = [compiler_of(compiler), *STRICT, *options, "-c", f"{source.name}.c", f"{source.name}_fmu.c"]
    ran = subprocess.run(command, cwd=place, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return place


@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
@pytest.mark.parametrize("kind", SOURCES)
def test_sources_compile_alone(kind: str, compiler: str, version: FMIVersion, tmp_path: Path) -> None:
    compile_strictly(SOURCES[kind](), version, tmp_path, compiler)


@pytest.mark.parametrize("version", VERSIONS)
def test_sources_compile_behind_the_official_headers(version: FMIVersion, tmp_path: Path) -> None:
    headers = Path(pytest.importorskip("fmpy").__file__).parent / "c-code"
    first = ("-include", f"{headers}/fmi{version[0]}Functions.h")
    compile_strictly(c_sources.hysteretic(), version, tmp_path, "gcc", *first)


@pytest.mark.parametrize("version", VERSIONS)
def test_functions_take_the_prefix_of_a_static_library(version: FMIVersion, tmp_path: Path) -> None:
    prefix = f"-DFMI{version[0]}_FUNCTION_PREFIX=its_"
    place = compile_strictly(c_sources.controller(), version, tmp_path, "gcc", prefix)
    listed = subprocess.run(
        [compiler_of("nm"), "-g", "--defined-only", "frame_controller_fmu.o"],
        cwd=place, capture_output=True, text=True, check=True,
    )  # fmt: skip
    names = [line.split()[-1] for line in listed.stdout.splitlines()]
    assert f"its_fmi{version[0]}DoStep" in names
    assert all(name.startswith(f"its_fmi{version[0]}") for name in names)


LINKED = """
int rig_damper_fmi2DoStep(void *, double, double, int);
int frame_controller_fmi3Terminate(void *);
int friction_fmi2Terminate(void *);
int main(void) { return rig_damper_fmi2DoStep == 0 || frame_controller_fmi3Terminate(0) || friction_fmi2Terminate(0); }
"""


def test_sources_of_several_fmus_link_into_one_program(tmp_path: Path) -> None:
    compiler, objects = compiler_of("cc"), []
    for kind, version in (("hysteretic", "2.0"), ("stateless", "2.0"), ("controller", "3.0")):
        place = compile_strictly(SOURCES[kind](), version, tmp_path / kind, "gcc")
        objects += [str(each) for each in place.glob("*.o")]
    (tmp_path / "main.c").write_text(LINKED)
    command = [compiler, "main.c", *objects, "-lm", "-o", "linked"]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert subprocess.run([tmp_path / "linked"]).returncode == 0


@pytest.mark.parametrize("version", VERSIONS)
def test_a_motion_that_is_not_believed_is_discarded(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    damper = Instance(compiled("hysteretic", version), velocity=0.1, command=1.0)
    assert damper.step(0.0, 1e-3) == 0
    before = damper.get("force", "state[0]")
    for name, value in (("velocity", 1e6), ("velocity", -3.1), ("displacement", 0.3)):
        inside = 0.1 if name == "velocity" else 0.0
        assert damper.set({name: value}) == 0
        assert damper.step(1e-3, 1e-3) == 2
        assert "beyond what this damper is believed for" in damper.said.pop()
        assert damper.set({name: inside}) == 0
    assert damper.get("state[0]")[0] == before[1]
    assert damper.step(1e-3, 1e-3) == 0
    assert np.isfinite(damper.get("force")).all()


@pytest.mark.parametrize("version", VERSIONS)
def test_the_word_of_status_is_an_output(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    damper = Instance(compiled("hysteretic", version), velocity=0.1, command=1.0)
    for values, status in (
        ({"velocity": 0.2}, 0.0),
        ({"velocity": 0.5}, 4.0),
        ({"command": 1e9}, 5.0),
        ({"command": 1.0, "velocity": 0.1}, 0.0),
    ):
        assert damper.set(values) == 0
        assert damper.step(0.0, 1e-3) == 0
        assert damper.get("status").tolist() == [status]


@pytest.mark.parametrize("version", VERSIONS)
def test_parameters_of_a_damper_are_tunable(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    damper = Instance(compiled("hysteretic", version), velocity=0.1, command=1.0)
    assert damper.step(0.0, 0.02) == 0
    force, state = damper.get("force", "state[0]")
    assert damper.set({"f_0": 450.0, "displacement": 0.1 * 0.02}) == 0
    assert damper.get("force", "state[0]").tolist() == pytest.approx(
        [force + 300.0 * state, state], rel=1e-12
    )
    tunable = [
        each.attrib["name"] for each in damper.unpacked.root.iter() if each.get("variability") == "tunable"
    ]
    assert len(tunable) == 8


def test_names_of_users_are_escaped_in_a_description(tmp_path: Path) -> None:
    name = 'un\a fug, <b> & "x"'
    source = replace(c_sources.hysteretic(), description=name)
    for version in VERSIONS:
        root = Unpacked(fmu_of(source, version), tmp_path / version).root
        assert root.attrib["description"] == name.replace("\a", r"\x07")


@pytest.mark.filterwarnings("default")
def test_model_exchange_agrees_with_another_integrator(
    compiled: Callable[[str, FMIVersion], Unpacked], monkeypatch: pytest.MonkeyPatch
) -> None:
    fmpy = pytest.importorskip("fmpy")
    solver = pytest.importorskip("fmpy.sundials").CVodeSolver
    held = solver.f

    # fmpy holds inputs between its outputs, 1 ms here: CVode would integrate another motion.
    def following(self: Any, time: float, *args: Any) -> Any:
        self.input.apply(time)
        return held(self, time, *args)

    monkeypatch.setattr(solver, "f", following)

    def motion(time: Any) -> tuple[Any, Any, Any]:
        fast, slow = 4.0 * np.pi, 1.4 * np.pi
        envelope = 1.0 + 0.3 * np.sin(slow * time)
        displacement = 0.01 * np.sin(fast * time) * envelope
        velocity = 0.01 * (
            fast * np.cos(fast * time) * envelope + 0.3 * slow * np.cos(slow * time) * np.sin(fast * time)
        )
        return displacement, velocity, 0.5 + 0.5 * np.sin(8.0 * time)

    def rate(time: float, states: np.ndarray) -> list[float]:
        (z, current), (displacement, velocity, command) = states, motion(time)
        turned = velocity - 0.9 * abs(velocity) * abs(z) * z - 0.1 * velocity * z**2
        return [2000.0 * (1.0 + 10.0 * displacement) * turned, -190.0 * (current - command)]

    duration = 1.0
    grid = np.linspace(0.0, duration, 20001)
    signals = np.rec.fromarrays((grid, *motion(grid)), names="time,displacement,velocity,command")
    found = fmpy.simulate_fmu(
        str(compiled("hysteretic", "2.0").folder), fmi_type="ModelExchange", solver="CVode", input=signals,
        stop_time=duration, output_interval=1e-3, relative_tolerance=1e-5, output=["force"],
    )  # fmt: skip
    times = found["time"]
    exact = solve_ivp(
        rate, (0.0, duration), [0.0, motion(0.0)[2]], "LSODA", times, rtol=1e-9, atol=1e-11, max_step=1e-3
    )
    displacement, velocity, _ = motion(times)
    z, current = exact.y
    force = (600.0 + 400.0 * current) * velocity + 900.0 * displacement + (150.0 + 900.0 * current) * z
    errors = np.abs(found["force"] - force) / np.abs(force).max()
    # 6e-6 and 1.5e-4 at the kinks where the velocity changes its sign; the tolerance of CVode is 1e-5.
    assert np.median(errors) < 2e-5
    assert errors.max() < 1e-3


def test_rates_and_force_follow_continuous_states(compiled: Callable[[str, FMIVersion], Unpacked]) -> None:
    damper = Instance(compiled("hysteretic", "2.0"), model_exchange=True, velocity=0.1, command=1.0)
    states, rates = (c_double * 2)(), (c_double * 2)()
    assert damper.call("GetContinuousStates", states, c_size_t(2)) == 0
    assert list(states) == [0.0, 1.0]
    assert damper.call("SetContinuousStates", (c_double * 2)(-0.5, 0.25), c_size_t(2)) == 0
    assert damper.call("GetDerivatives", rates, c_size_t(2)) == 0
    turned = 0.1 + 0.9 * 0.1 * 0.25 - 0.1 * 0.1 * 0.25
    assert list(rates) == pytest.approx([2000.0 * turned, 190.0 * 0.75], rel=1e-14)
    assert damper.get("der(state[0])", "der(current)").tolist() == list(rates)
    force = (600.0 + 400.0 * 0.25) * 0.1 - (150.0 + 900.0 * 0.25) * 0.5
    assert damper.get("force")[0] == pytest.approx(force, rel=1e-14)
    assert damper.call("GetDerivatives", rates, c_size_t(3)) == 3
    assert "number of continuous states" in damper.said.pop()


def test_nominal_values_are_sizes_of_states(compiled: Callable[[str, FMIVersion], Unpacked]) -> None:
    nominals = (c_double * 2)()
    stiff = Instance(compiled("hysteretic", "2.0"), model_exchange=True)
    # So soft that the element does not yield within the tested stroke of 0.02 m: the state follows it.
    soft = Instance(compiled("hysteretic", "2.0"), model_exchange=True, rho=5.0)
    assert stiff.call("GetNominalsOfContinuousStates", nominals, c_size_t(2)) == 0
    assert list(nominals) == pytest.approx([1.0, 2.0], rel=0.05)
    assert soft.call("GetNominalsOfContinuousStates", nominals, c_size_t(2)) == 0
    assert list(nominals) == pytest.approx([0.1, 2.0], rel=0.2)


def test_a_controller_has_no_model_exchange_and_a_binary_no_other_names(
    compiled: Callable[[str, FMIVersion], Unpacked],
) -> None:
    controller = Instance(compiled("controller", "2.0"), model_exchange=True)
    assert controller.instance is None
    assert "co-simulation alone" in controller.said.pop()
    assert not hasattr(controller.library, "frame_controller_step")


@pytest.mark.parametrize("version", VERSIONS)
def test_co_simulation_has_the_bits_of_sub_steps(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked], printed: ctypes.CDLL
) -> None:
    rng = np.random.default_rng(1)
    inputs = rng.uniform(-1.0, 1.0, (300, 3)) * MOTION
    sizes = rng.integers(1, 9, 300)
    fitted = c_double.in_dll(printed, "rig_damper_fitted")
    force, memory = printed.rig_damper_force, Memory()
    force.restype = c_double
    damper = Instance(compiled("hysteretic", version), command=0.7)
    printed.rig_damper_start(byref(memory), byref(fitted), c_double(0.7))
    time = 0.0
    for (displacement, velocity, command), size in zip(inputs.tolist(), sizes.tolist(), strict=True):
        assert damper.set({"displacement": displacement, "velocity": velocity, "command": command}) == 0
        at = (c_double(displacement), c_double(velocity))
        if size % 2:
            expected = force(byref(memory), *at)
            assert damper.get("force")[0] == expected
        assert damper.step(time, size * SUBSTEP) == 0
        for _ in range(size):
            middle, end = displacement + 0.5 * SUBSTEP * velocity, displacement + SUBSTEP * velocity
            motion = (c_double * 6)(displacement, velocity, middle, velocity, end, velocity)
            printed.rig_damper_substep(byref(memory), c_double(command), motion)
            displacement = end
        time += size * SUBSTEP
        expected = force(byref(memory), c_double(displacement), at[1])
        assert damper.get("force", "state[0]", "current").tolist() == [
            expected,
            memory.state[0],
            memory.current,
        ]


@pytest.mark.parametrize("version", VERSIONS)
def test_a_stateless_damper_follows_its_command_at_once(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    damper = Instance(compiled("stateless", version), velocity=0.1, command=0.4)
    assert damper.get("force")[0] == pytest.approx(700.0 * 0.4 * np.tanh(5.0), rel=1e-15)
    assert damper.set({"command": 1.5}) == 0
    assert damper.get("force")[0] == pytest.approx(700.0 * 1.5 * np.tanh(5.0), rel=1e-15)
    assert damper.set({"command": 0.8}) == 0
    assert damper.step(0.0, 1e-3) == 0
    assert damper.get("force")[0] == pytest.approx(700.0 * 0.8 * np.tanh(5.0), rel=1e-15)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_controller_sends_its_commands(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    readings = np.random.default_rng(2).normal(0.0, 3.0, (200, 3))
    readings[50:60, 0] = np.nan
    names = ("acceleration[0]", "acceleration[1]", "force[0]")
    controller = Instance(compiled("controller", version))
    sent = []
    for number, row in enumerate(readings):
        assert controller.set(dict(zip(names, row.tolist(), strict=True))) == 0
        promised = controller.get("command[0]", "command[1]")
        assert controller.step(number * 5e-3, 5e-3) == 0
        sent.append(controller.get("command[0]", "command[1]"))
        assert promised.tolist() == sent[-1].tolist()
    assert np.array(sent).tolist() == c_sources.commands_of(readings).tolist()
    # Gains may be tuned between two steps.
    assert controller.set({"parameters.command[0]": -1.0}) == 0
    assert controller.get("command[0]", "command[1]").tolist() == [-1.0, -1.0]
    assert controller.set({"parameters.command[0]": 2.0}) == 0
    # Two sample times in one step are two samples of the same readings.
    assert controller.step(1.0, 0.01) == 0
    again = np.vstack([readings, readings[-1:], readings[-1:]])
    assert controller.get("command[0]", "command[1]").tolist() == c_sources.commands_of(again)[-1].tolist()


@pytest.mark.parametrize("version", VERSIONS)
def test_a_law_of_the_user_sends_the_commands_of_the_core(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    core, source = own_law()
    columns = [f"{name}[{entry}]" for name, count in mr._rust.law_readings(core) for entry in range(count)]
    readings = np.random.default_rng(5).normal(0.0, 0.1, (200, len(columns)))
    controller, sent = Instance(compiled("law of the user", version)), []
    names = {each.name for each in source.inputs}
    assert 0 < len(names) < len(columns)
    for number, row in enumerate(readings):
        given = {name: value for name, value in zip(columns, row.tolist(), strict=True) if name in names}
        assert controller.set(given) == 0
        assert controller.step(number * 1e-3, 1e-3) == 0
        sent.append(controller.get("command[0]", "command[1]"))
    expected = mr._rust.law_commands(core, readings)[:, : core.n_commanded]
    np.testing.assert_array_equal(sent, expected[:, : len(sent[0])])
    assert np.unique(expected).size > 100


@pytest.mark.parametrize("version", VERSIONS)
def test_a_damper_of_the_user_has_the_forces_of_the_core(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    spec, source = own_dampers.loop, SOURCES["damper of the user"]()
    theta, state, forces = np.array(spec.nominal), np.zeros(1), []
    damper, h = Instance(compiled("damper of the user", version)), 1e-3 / source.substeps

    def rate(at: np.ndarray, x: float) -> np.ndarray:
        return mr._rust.rate(spec.core_name, theta, at, x, v)

    for number in range(200):
        x, v = (
            0.01 * np.sin(0.05 * number),
            0.1 * np.cos(0.05 * number),
        )  # as tested: faster ones have more sub-steps
        assert damper.set({"displacement": x, "velocity": v}) == 0
        assert damper.step(number * 1e-3, 1e-3) == 0
        for _ in range(source.substeps):
            one = rate(state, x)
            two = rate(state + 0.5 * h * one, x + 0.5 * h * v)
            three = rate(state + 0.5 * h * two, x + 0.5 * h * v)
            four = rate(state + h * three, x + h * v)
            state, x = state + h / 6.0 * (one + 2.0 * two + 2.0 * three + four), x + h * v
        forces.append(mr._rust.force(spec.core_name, theta, state, x, v))
        np.testing.assert_allclose(damper.get("force")[0], forces[-1], rtol=1e-12, atol=1e-9)
    assert np.ptp(forces) > 100.0


@pytest.mark.parametrize("version", VERSIONS)
def test_a_step_off_the_grid_is_refused_with_a_sentence(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    damper = Instance(compiled("hysteretic", version))
    for step in (0.9 * SUBSTEP, 1.0001 * SUBSTEP, 0.0, -SUBSTEP, float("nan"), float("inf")):
        assert damper.step(0.0, step) == 3
        assert "whole number of sub-steps of 0.00025 s" in damper.said.pop()
    # A step computed from times late in a simulation is off by their rounding.
    time = 1e9 + 0.1
    assert damper.step(time, (time + 4 * SUBSTEP) - time) == 0
    controller = Instance(compiled("controller", version))
    assert controller.step(0.0, 1e-3) == 3
    assert "whole number of sample times of 0.005 s" in controller.said.pop()


@pytest.mark.parametrize("version", VERSIONS)
def test_wrong_calls_are_refused_with_a_sentence(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    unpacked = compiled("hysteretic", version)
    other = Instance(unpacked, token="{another}")
    assert other.instance is None
    assert "description and its binary differ" in other.said.pop()
    damper = Instance(unpacked)
    for name, value in (("velocity", np.nan), ("command", np.inf), ("eta", np.nan)):
        assert damper.set({name: value}) == 3
        assert "finite number" in damper.said.pop()
    for name in ("force", "current", 0, 99):
        assert damper.set({name: 1.0}) == 3
        assert "only inputs and parameters" in damper.said.pop()
    assert np.isfinite(damper.get("velocity", "command", "eta", "force")).all()
    size = c_size_t()
    state = c_void_p()
    name = "FMUstate" if version == "2.0" else "FMUState"
    assert damper.call(f"Get{name}", byref(state)) == 0
    assert damper.call(f"Serialized{name}Size", state, byref(size)) == 0
    short = (ctypes.c_char * (size.value - 1))()
    assert damper.call(f"Serialize{name}", state, short, c_size_t(len(short))) == 3
    begun = "DeSerialize" if version == "2.0" else "Deserialize"
    assert damper.call(f"{begun}{name}", short, c_size_t(len(short)), byref(c_void_p())) == 3
    assert damper.call(f"Free{name}", byref(state)) == 0
    assert state.value is None


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_is_restored_to_the_bit_in_another_instance(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    name, begun = ("FMUstate", "DeSerialize") if version == "2.0" else ("FMUState", "Deserialize")
    unpacked = compiled("hysteretic", version)
    rows = (np.random.default_rng(3).uniform(-1.0, 1.0, (40, 3)) * MOTION).tolist()

    def follow(damper: Instance, part: list[list[float]]) -> list[float]:
        forces = []
        for row in part:
            damper.set(dict(zip(("displacement", "velocity", "command"), row, strict=True)))
            assert damper.step(0.0, 1e-3) == 0
            forces.append(float(damper.get("force")[0]))
        return forces

    damper, other = Instance(unpacked, eta=100.0), Instance(unpacked, command=1.0)
    follow(damper, rows[:20])
    state, copy, size = c_void_p(), c_void_p(), c_size_t()
    assert damper.call(f"Get{name}", byref(state)) == 0
    assert damper.call(f"Serialized{name}Size", state, byref(size)) == 0
    kept = (ctypes.c_char * size.value)()
    assert damper.call(f"Serialize{name}", state, kept, size) == 0
    expected = follow(damper, rows[20:])
    assert follow(damper, rows[20:]) != expected
    assert damper.call(f"Set{name}", state) == 0
    assert follow(damper, rows[20:]) == expected
    # Instances share nothing: the other one has its own parameters until it is given the state.
    assert other.get("eta")[0] == 190.0
    assert other.call(f"{begun}{name}", kept, size, byref(copy)) == 0
    assert other.call(f"Set{name}", copy) == 0
    assert other.get("eta")[0] == 100.0
    assert follow(other, rows[20:]) == expected
    for each in (state, copy):
        assert damper.call(f"Free{name}", byref(each)) == 0


@pytest.mark.parametrize("version", VERSIONS)
def test_a_reset_instance_repeats_a_new_one(
    version: FMIVersion, compiled: Callable[[str, FMIVersion], Unpacked]
) -> None:
    start = {"displacement": 0.01, "velocity": 0.2, "command": 1.0}
    damper = Instance(compiled("hysteretic", version), **start, k=0.0)
    first = [damper.step(0.0, 1e-2), *damper.get("force", "current", "k")]
    assert damper.call("Reset") == 0
    assert damper.step(0.0, 1e-2) == 3
    assert "before the initialisation" in damper.said.pop()
    assert damper.get("k", "command").tolist() == [900.0, 0.0]
    damper.initialise(**start, k=0.0)
    assert [damper.step(0.0, 1e-2), *damper.get("force", "current", "k")] == first


DRIVER = """#include "{source}_fmu.c"
#include <stdio.h>
static void say(void *environment, fmi3Status status, const char *category, const char *message)
{{
    (void)environment; (void)status; (void)category;
    puts(message);
}}
int main(void)
{{
    const fmi3ValueReference numbers[] = {{1, 2, 3}}, wrong[] = {{77}};
    double values[] = {{0.01, -0.2, 1.5}}, read[1];
    bool flags[3];
    double last;
    fmi3FMUState state = NULL, copy = NULL;
    fmi3Byte bytes[sizeof(model)];
    fmi3Instance one = fmi3InstantiateCoSimulation(
        "one", TOKEN, "", false, false, false, false, NULL, 0, NULL, say, NULL);
    fmi3InstantiateModelExchange("no", TOKEN, "", false, false, NULL, say);
    fmi3InstantiateCoSimulation("no", NULL, "", false, false, false, false, NULL, 0, NULL, say, NULL);
    fmi3EnterInitializationMode(one, false, 0.0, 0.0, false, 0.0);
    fmi3SetFloat64(one, numbers, 3, values, 3);
    fmi3ExitInitializationMode(one);
    for (int i = 0; i < 100; ++i) {{
        fmi3DoStep(one, 0.001 * i, 0.005, true, &flags[0], &flags[1], &flags[2], &last);
    }}
    fmi3DoStep(one, 0.0, 1e300, true, &flags[0], &flags[1], &flags[2], &last);
    fmi3GetFMUState(one, &state);
    fmi3SerializeFMUState(one, state, bytes, sizeof bytes);
    fmi3DeserializeFMUState(one, bytes, sizeof bytes, &copy);
    fmi3SetFMUState(one, copy);
    fmi3FreeFMUState(one, &state);
    fmi3FreeFMUState(one, &copy);
    fmi3GetFloat64(one, wrong, 1, read, 1);
    fmi3GetFloat64(one, numbers, 1, read, 1);
    fmi3Reset(one);
    fmi3FreeInstance(one);
    return 0;
}}
"""


@pytest.mark.parametrize("kind", SOURCES)
def test_sanitizers_find_nothing(kind: str, tmp_path: Path) -> None:
    compiler, source = compiler_of("gcc"), SOURCES[kind]()
    folder = Unpacked(fmu_of(source, "3.0"), tmp_path).folder / "sources"
    (folder / "driver.c").write_text(DRIVER.format(source=source.name))
    checks = [
        "-std=c99",
        "-g",
        "-DFMI3_OVERRIDE_FUNCTION_PREFIX",
        "-fsanitize=undefined,address",
        "-fno-sanitize-recover=all",
    ]
    command = [compiler, *checks, "driver.c", f"{source.name}.c", "-o", "driver", "-lm"]
    if subprocess.run(command, cwd=folder, capture_output=True).returncode:
        pytest.skip("this compiler has no sanitizers")
    ran = subprocess.run(
        [folder / "driver"], capture_output=True, text=True, env={**os.environ, "LD_PRELOAD": ""}
    )
    assert ran.returncode == 0, ran.stderr
    assert len(ran.stdout.splitlines()) == 4


def test_equal_sources_give_equal_bytes_and_others_another_token(tmp_path: Path) -> None:
    source = c_sources.hysteretic()
    assert fmu_of(source, "2.0") == fmu_of(c_sources.hysteretic(), "2.0")
    if (compiler := c_compiler()) is not None:
        assert fmu_of(source, "3.0", compiler) == fmu_of(source, "3.0", compiler)
    changed = replace(source, files={**source.files, "rig_damper.c": source.files["rig_damper.c"] + "\n"})
    tokens = {
        Unpacked(fmu_of(each, version), tmp_path / f"{number}{version}").token
        for number, each in enumerate((source, changed, replace(source, description="another")))
        for version in VERSIONS
    }
    assert len(tokens) == 6


def test_without_a_compiler_an_fmu_has_sources_and_no_binary(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    assert c_compiler() is None
    with zipfile.ZipFile(BytesIO(fmu_of(c_sources.controller(), "3.0", c_compiler()))) as fmu:
        assert fmu.namelist() == [
            "modelDescription.xml",
            "sources/frame_controller.h",
            "sources/frame_controller.c",
            "sources/frame_controller_fmu.c",
            "documentation/index.html",
            "documentation/licenses/license.txt",
            "sources/buildDescription.xml",
        ]
        assert fmu.read("documentation/licenses/license.txt") == (ROOT / "LICENSE").read_bytes()


def test_a_compiler_that_refuses_the_sources_is_told() -> None:
    source = c_sources.stateless()
    broken = replace(source, files={**source.files, "friction.c": "int broken(void)\n{ return nothing; }\n"})
    compiler = compiler_of("cc")
    with pytest.raises(
        LibraryError, match=r"does not compile the sources of the FMU: friction\.c:2.*error.*nothing"
    ):
        fmu_of(broken, "2.0", compiler)


def test_units_have_their_powers_of_base_units(tmp_path: Path) -> None:
    root = Unpacked(fmu_of(c_sources.hysteretic(), "2.0"), tmp_path / "hysteretic").root
    powers = {
        unit.attrib["name"]: dict(base.attrib) if (base := unit.find("BaseUnit")) is not None else None
        for unit in root.iter("Unit")
    }
    assert powers["N"] == {"kg": "1", "m": "1", "s": "-2"}
    assert powers["N s/(m A)"] == {"kg": "1", "s": "-1", "A": "-1"}
    assert powers["1"] == {}
    assert powers["A/s"] == {"A": "1", "s": "-1"}
    friction = Unpacked(fmu_of(c_sources.stateless(), "3.0"), tmp_path / "stateless").root
    units = {unit.attrib["name"]: unit.find("BaseUnit") for unit in friction.iter("Unit")}
    assert units["m^-n"] is None
    assert units["N/V"] is not None
    assert units["N/V"].attrib == {"m": "-1", "s": "1", "A": "1"}


def test_a_force_depends_on_no_command_that_a_driver_lags(tmp_path: Path) -> None:
    for kind, version, names in (
        ("hysteretic", "2.0", ["displacement", "velocity", "state[0]", "current"]),
        ("hysteretic", "3.0", ["displacement", "velocity"]),
        ("stateless", "2.0", ["displacement", "velocity", "command"]),
        ("controller", "3.0", ["acceleration[0]", "acceleration[1]", "force[0]"]),
    ):
        unpacked = Unpacked(fmu_of(SOURCES[kind](), version), tmp_path / f"{kind}{version}")
        known = next(
            each.attrib["dependencies"] for each in unpacked.root.iter() if "dependencies" in each.attrib
        )
        assert known == " ".join(str(unpacked.references[name]) for name in names)


def test_a_description_and_its_page_say_how_long_steps_are(tmp_path: Path) -> None:
    for kind, grid, step in (("hysteretic", "0.00025", "0.001"), ("controller", "0.005", "0.005")):
        unpacked = Unpacked(fmu_of(SOURCES[kind](), "3.0"), tmp_path / kind)
        elements = {element.tag: element.attrib for element in unpacked.root}
        assert elements["CoSimulation"]["fixedInternalStepSize"] == grid
        assert elements["DefaultExperiment"]["stepSize"] == step
        page = (unpacked.folder / "documentation/index.html").read_text()
        assert f"of {grid} s" in page
    assert "with &lt;marks&gt; &amp; " in (tmp_path / "hysteretic/documentation/index.html").read_text()
