"""Printed controllers: the commands of the core to the bit, also from readings that no sensor gives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from c_programs import compiled, output_of
from loop_samples import devices, five_storeys, law_with_gains, rd1005
from printed_laws import SANITIZED, assert_a_process_is_the_law, driven, hostile, printed
from refusals import refusal

import mrwork as mr
from mrwork.closed_loop.printed_loop import printed_loop
from mrwork.embedded.c_source import CSource, Flavour
from mrwork.embedded.controller_c import controller_source

LAWS = [law.name for law in mr.control.control_laws()]
OBSERVED = mr.Hardware(feedback="observer", known_ground=True, command_rate=200.0)


def law_of(name: str) -> mr.ControlLaw:
    return law_with_gains(name, mr.control.plant_of(five_storeys(), [each.row for each in devices(rd1005())]))


def source_of(law: mr.ControlLaw, flavour: Flavour | None = None) -> CSource:
    return printed(five_storeys(), devices(rd1005()), OBSERVED, law, flavour)[1]


@pytest.mark.parametrize("feedback", ["observer", "state"])
@pytest.mark.parametrize("name", LAWS)
def test_a_printed_law_sends_the_commands_of_the_core_whatever_sensors_give(
    name: str, feedback: str, tmp_path: Path
) -> None:
    law = law_of(name)
    hardware = OBSERVED if feedback == "observer" else mr.Hardware(command_rate=200.0)
    core, source = printed(five_storeys(), devices(rd1005()), hardware, law)
    readings = hostile(core)
    read, commands = driven(tmp_path, core, source, readings)
    command, _ = commands(True)
    np.testing.assert_array_equal(command, mr._rust.law_commands(core, readings)[:, : core.n_commanded])
    most = np.inf if law.spec.commands_force else devices(rd1005())[0].largest_command
    assert np.isfinite(command).all()
    assert np.abs(command).max() <= most
    # With limits, what no sensor gives is replaced, and counted.
    command, replaced = commands(False)
    assert replaced == np.count_nonzero(~(np.abs(read) < 1e200)) or not read.size
    assert np.isfinite(command).all()


@pytest.mark.parametrize("single", [False, True])
def test_its_program_checks_it(single: bool, tmp_path: Path) -> None:
    law = law_of("proportional_direct" if single else "inverse_direct")
    files = source_of(law, Flavour(single=single)).files
    checked = {name: text for name, text in files.items() if "process" not in name}
    differ = output_of(compiled(tmp_path, checked, *SANITIZED)).split()[0]
    assert (differ == "0") is not single


@pytest.mark.parametrize("name", ["modified_clipped_optimal", "inverse_direct"])
def test_as_a_process_it_sends_the_commands_of_the_law_in_the_loop(name: str, tmp_path: Path) -> None:
    hardware = replace(OBSERVED, acceleration_noise=0.01, force_noise=1.0, delay=2e-3)
    command = assert_a_process_is_the_law(tmp_path, five_storeys(), devices(rd1005()), hardware, law_of(name))
    assert np.ptp(command) > 0.5


def test_a_name_of_the_user_ends_no_comment(tmp_path: Path) -> None:
    law, names = law_of("inverse_direct"), ["roof */ int x; /*\nground"] * 5
    places = {"floor": names, "storey": names, "device": names}
    loop = printed_loop(five_storeys(), devices(rd1005()), law, OBSERVED)
    source = controller_source("law", loop, law, places, Flavour(), unit="A", origin=("a */ title",))
    files = {each: text for each, text in source.files.items() if "process" not in each}
    assert output_of(compiled(tmp_path, files)).startswith("0 of 2000")


def test_what_no_rig_has_is_refused() -> None:
    stuck = mr.closed_loop.Fault(channel="force", index=0, start=1.0, end=2.0, value=0.0)
    of = five_storeys(), devices(rd1005()), law_of("passive")
    refusal(printed_loop, *of, mr.Hardware(faults=(stuck,)), match="faults are of a simulation")
    refusal(printed_loop, *of, mr.Hardware(ground_preview=0.1), match="no sensor tells the ground ahead")
