"""Printed dampers: the bits of the lanes in C, under any compiler; readings that no sensor gives; names of C."""

import ctypes
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import own_dampers
import pytest
from c_programs import compiled, library, output_of
from own_models import own_model
from refusals import refusal

import mrwork as mr
from mrwork.dampers.parameters import DRIVER_RATES, Lag
from mrwork.dampers.simulation import Loading, simulate_forces
from mrwork.embedded.c_source import CSource, Flavour, c_name, c_names
from mrwork.embedded.damper_c import damper_source

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
MODELS = [each["name"] for each in mr._rust.damper_specs()]
LAWS: dict[str, tuple[str, dict[str, str], float]] = {
    # Model, laws, and the exponent n of its loop, 0 where it has none.
    "polynomials": ("bingham", {"f_c": "linear", "c0": "quadratic"}, 0.0),
    "values": ("normalised_bouc_wen", {"c": "linear:0,2.25", "k_w": "log_quadratic:0,1,2.25"}, 0.0),
    "lines": ("normalised_bouc_wen", {"k_w": "straight:0,1,2.25", "rho": "exponential"}, 1.5),
    "saturating": (
        "normalised_bouc_wen",
        {"c": "exponential:0.5,2.25", "k_w": "tanh:0,2.25", "rho": "monotone:0,0.5,1,2.25"},
        0.0,
    ),
    "general exponent": ("modified_bouc_wen", {"c0": "linear", "alpha": "cubic"}, 1.7),
}
_SHARES = {"exponential": (0.5, 0.3, -0.5), "linear": (0.4, 0.3), "quadratic": (0.4, 0.3, -0.03)}
_SHARES["cubic"] = (0.4, 0.3, -0.03, 0.004)


def ranges_of(spec: mr.DamperSpec) -> mr.records.OperatingRange:
    command = (0.0, 2.25) if spec.follows_command else None
    unit = spec.command_unit
    return mr.records.OperatingRange(
        stroke=0.02, velocity=0.1, frequency=None, command=command, command_unit=unit, force=1e3, power=1.0
    )


def with_laws(case: str, *, lag: Lag) -> tuple[mr.DamperSpec, Floats]:
    model, laws, exponent = LAWS[case]
    plain = mr.damper(model)
    spec = plain.with_current_laws(laws, lag=lag)
    nominal = dict(zip(plain.names, plain.nominal, strict=True)) | ({"n": exponent} if exponent else {})

    def values() -> Iterator[float]:
        for parameter in spec.parameters:
            value, law = nominal.get(parameter.plain_name, 190.0), laws.get(parameter.plain_name, "")
            if law in _SHARES:
                value *= _SHARES[law][int(parameter.name.rpartition(".")[2])]
            elif parameter.coefficient is not None and parameter.coefficient.is_rate:
                value = parameter.nominal
            elif law and parameter.coefficient is not None:
                value *= 0.3 + 0.4 * float(parameter.coefficient.command or 0.0)
            # A falling current is slower.
            yield 0.3 * value if parameter.name == "eta_fall" else value

    return spec, np.array([*values()])


def printed(name: str, spec: mr.DamperSpec, theta: Floats, flavour: Flavour | None = None) -> CSource:
    return damper_source(name, spec, theta, ranges_of(spec), flavour or Flavour(), sample_time=1e-3)


def largest_difference(text: str) -> float:
    found = re.search(r"^0 of 1200 samples differ .* at most by (\S+) N; 0 readings", text)
    assert found, text
    return float(found[1])


@pytest.mark.parametrize("model", MODELS)
def test_a_printed_damper_has_the_bits_of_the_core(model: str, tmp_path: Path) -> None:
    source = printed("damper", mr.damper(model), mr.damper(model).nominal)
    assert largest_difference(output_of(compiled(tmp_path, source.files))) == 0.0


@pytest.mark.parametrize("model", [*MODELS, "three states"])
def test_a_printed_damper_of_the_user_has_the_bits_of_the_core(model: str, tmp_path: Path) -> None:
    spec = own_dampers.branches if model == "three states" else own_model(model)
    source = printed("damper", spec, spec.nominal)
    assert largest_difference(output_of(compiled(tmp_path, source.files))) == 0.0


@pytest.mark.parametrize("lag", DRIVER_RATES)
@pytest.mark.parametrize("case", LAWS)
def test_a_damper_with_laws_has_the_bits_of_one_lane_on_the_stages_of_a_record(
    case: str, lag: Lag, tmp_path: Path
) -> None:
    spec, theta = with_laws(case, lag=lag)
    source = printed("damper", spec, theta)
    time = 1e-3 * np.arange(600)
    displacement = 0.001 * np.sin(40.0 * time) * np.minimum(time / 0.1, 1.0) + 5e-5 * np.sin(231.0 * time)
    command = np.resize(np.repeat([0.0, 2.25, 0.6, 1.5], 70), 600)
    loading = Loading(dt=1e-3, displacement=displacement, command=command, command_unit=spec.command_unit)
    exact = simulate_forces(spec, theta[None], loading.history())
    substeps = int(exact.substeps[0])
    stages = loading.history().stages(source.substeps)
    # A record that is smoother than the motion of the check: its own sub-steps are no more.
    assert substeps <= source.substeps
    exact = simulate_forces(spec, theta[None], loading.history(), substep_factor=source.substeps // substeps)
    driver = (
        '#include "damper.h"\n'
        "void drive(int n, int k, const double *stages, const double *last, const double *u, double *force) {\n"
        "    damper_memory m;\n"
        "    damper_start(&m, &damper_fitted, u[0]);\n"
        "    for (int i = 0; i < n; ++i) {\n"
        "        const double *s = i < n - 1 ? stages + (long)i * (2 * k + 1) * 2 : last;\n"
        "        if (!DAMPER_LAGGED) damper_carry(&m, u[i]);\n"
        "        force[i] = damper_force(&m, s[0], s[1]);\n"
        "        for (int j = 0; i < n - 1 && j < k; ++j) damper_substep(&m, u[i], s + 4 * j);\n"
        "    }\n}\n"
    )
    files = {name: text for name, text in source.files.items() if "check" not in name} | {"drive.c": driver}
    force, last = np.empty(600), np.ascontiguousarray(stages[-1, -1])
    stages = np.ascontiguousarray(stages)
    pointers = (each.ctypes.data_as(ctypes.c_void_p) for each in (stages, last, command, force))
    library(tmp_path, files).drive(600, source.substeps, *pointers)
    np.testing.assert_array_equal(force, exact.force[0])


@pytest.mark.parametrize(("libm", "single", "share"), [(True, False, 1e-14), (False, True, 5e-5)])
def test_other_flavours_differ_by_their_last_bits(
    libm: bool, single: bool, share: float, tmp_path: Path
) -> None:
    spec, theta = with_laws("values", lag="two_rates")
    source = printed("damper", spec, theta, Flavour(libm=libm, single=single))
    largest = float(np.abs(simulate_forces(spec, theta[None], _any_motion(spec)).force).max())
    assert largest_difference(output_of(compiled(tmp_path, source.files))) < share * largest


def _any_motion(spec: mr.DamperSpec) -> mr._rust.LoadingHistory:
    displacement = 0.01 * np.sin(0.01 * np.arange(1000))
    return Loading(dt=1e-3, displacement=displacement, command=2.25, command_unit=spec.command_unit).history()


@pytest.mark.parametrize(
    ("compiler", "before"),
    [("clang", ()), ("aarch64-linux-gnu-gcc", ("qemu-aarch64",))],
    ids=["clang", "arm"],
)
def test_other_compilers_give_the_same_bits(compiler: str, before: tuple[str, ...], tmp_path: Path) -> None:
    spec, theta = with_laws("general exponent", lag="two_rates")
    options = ["-static"] if before else []
    program = compiled(tmp_path, printed("damper", spec, theta).files, *options, compiler=compiler)
    assert largest_difference(output_of(program, *before)) == 0.0


def test_nothing_undefined_is_done(tmp_path: Path) -> None:
    spec, theta = with_laws("lines", lag="two_rates")
    options = "-fsanitize=undefined,address", "-fno-sanitize-recover"
    output_of(compiled(tmp_path, printed("damper", spec, theta).files, *options))


def test_readings_that_no_sensor_gives_are_replaced_and_counted(tmp_path: Path) -> None:
    source = printed("damper", mr.damper("maxwell"), mr.damper("maxwell").nominal)
    driver = (
        '#include "damper.h"\n#include <math.h>\n#include <stdio.h>\n'
        "int main(void) {\n"
        "    const double odd[] = {0.001, NAN, INFINITY, -INFINITY, 1e300, 0.001};\n"
        "    damper_memory m;\n"
        "    damper_start(&m, &damper_fitted, 0.0);\n"
        "    for (int i = 0; i < 6; ++i) {\n"
        "        const damper_input in = {odd[i], 0.0, 0.0};\n"
        '        printf("%.17g ", damper_step(&m, &in));\n'
        "    }\n"
        '    printf("%lu\\n", m.replaced);\n'
        "    return 0;\n}\n"
    )
    files = {name: text for name, text in source.files.items() if "check" not in name} | {"main.c": driver}
    *forces, replaced = output_of(compiled(tmp_path, files)).split()
    assert replaced == "4"
    assert np.isfinite([*map(float, forces)]).all()


def test_the_head_tells_how_far_straight_lines_are_off() -> None:
    # A Maxwell element feels every kink of its motion; a friction that follows the velocity alone none.
    heads = {
        name: printed("damper", mr.damper(name), mr.damper(name).nominal).files["damper.h"] for name in MODELS
    }
    found = {
        name: re.findall(r"differs by\s+(\S+)\s+%\s+rms", text.replace(" *", ""))
        for name, text in heads.items()
    }
    percent = {name: [*map(float, each)] for name, each in found.items()}
    assert percent["bingham"] == pytest.approx([0.0, 0.0], abs=1e-10)
    # The sine of the test first, which has no corners.
    assert all(sine < 0.1 for sine, _ in percent.values())
    assert 0.5 < percent["modified_bouc_wen"][1] < 4.0


def test_names_are_those_of_c() -> None:
    assert c_name("rig damper") == "rig_damper"
    assert c_name("3 kN") == "_3_kN"
    assert c_name("double") == "_double"
    assert c_names(["k@0A", "k_0A"]) == ["k_0A", "k_0A_"]
    refusal(c_name, "***", match="no letter or digit")
