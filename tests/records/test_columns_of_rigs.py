"""Commands that are measured, units that a name says, names that contradict, and channels in volts and counts."""

import shlex
from pathlib import Path

import numpy as np
import pytest
from odd_files import KN, MM, NEWTON, TIME, assert_is_the_test, write_table
from record_files import codes, message
from refusals import refusal

from mrwork.records import read_damper_test
from mrwork.records.columns import parse_column_option

MOTION = {"t_s": TIME, "x_mm": MM, "F_N": NEWTON}
HALF = np.full_like(TIME, 0.5)


@pytest.mark.parametrize(
    ("heading", "unit"),
    [
        *((f"{words} (A)", "A") for words in (
            "Feedback Current", "Actual Current", "Valve Current", "I_act", "CDC 1 Current FB_1", "Iststrom",
            "Ventilstrom", "Sollstrom", "Measured current", "Coil current measured", "Solenoid current",
            "Current readback", "Current Monitor", "MR current", "Driver current actual", "Courant mesuré",
            "Corriente medida", "实测电流", "I_fb", "Magnet current",
        )),
        *((name, "A") for name in ("Amps", "Amperes", "I_meas_A", "current_fb_A", "Current (real) A")),
        ("Feedback voltage (V)", "V"), ("Valve voltage [V]", "V"), ("PWM (%)", "%"), ("PWM duty (%)", "%"),
        ("Pilot pressure (bar)", "bar"),
    ],
)  # fmt: skip
def test_a_measured_command_is_the_command(tmp_path: Path, heading: str, unit: str) -> None:
    test = read_damper_test(write_table(tmp_path / "rig.txt", {**MOTION, heading: HALF}))
    assert test.commands == ((0.5, unit),)
    assert "not_used" not in codes(test)


@pytest.mark.parametrize("sent", ["Command current (A)", "Current (A)", "I_set (A)"])
def test_what_is_sent_goes_before_what_is_measured(tmp_path: Path, sent: str) -> None:
    columns = {**MOTION, "Feedback current (A)": 0.9 * HALF, sent: HALF}
    if sent == "I_set (A)":
        refusal(
            read_damper_test, write_table(tmp_path / "rig.txt", columns), match="both look like the current"
        )
    else:
        assert read_damper_test(write_table(tmp_path / "rig.txt", columns)).current == 0.5


@pytest.mark.parametrize("heading", ["Motor current (A)", "I_supply (A)", "Ch 7 (mA)", "Pump pressure (bar)"])
def test_a_column_in_a_unit_of_commands_is_asked_about_before_all_else(tmp_path: Path, heading: str) -> None:
    path = write_table(tmp_path / "rig.txt", {**MOTION, heading: HALF})
    test = read_damper_test(path)
    assert codes(test)[0] == "command_asked"
    words = shlex.split(message(test, "command_asked").partition("as in ")[2].replace(",", ""))
    assert words[::3] == ["--column", "--column"][: len(words[::3])]
    (name, specification), (left, none) = map(parse_column_option, (words[1], words[4]))
    read = read_damper_test(path, columns={name: specification})
    assert len(read.commands) == 1
    assert "command_asked" not in codes(read)
    assert "command_asked" not in codes(read_damper_test(path, columns={left: none}))


def test_volts_of_sensors_are_not_asked_about(tmp_path: Path) -> None:
    test = read_damper_test(
        write_table(tmp_path / "rig.txt", {**MOTION, "Laser (V)": HALF, "Load cell (V)": HALF})
    )
    assert "command_asked" not in codes(test)


def test_a_unit_after_a_word_is_the_unit(tmp_path: Path) -> None:
    columns = {
        "Time (in ms)": 1e3 * TIME, "Laser (in V)": 3.0 + MM / 13.0, "Force (in V)": NEWTON / 43.0,
        "Laser (in mm)": MM, "Force (in N)": NEWTON,
    }  # fmt: skip
    assert_is_the_test(read_damper_test(write_table(tmp_path / "rig.txt", columns)))


@pytest.mark.parametrize(
    ("scaled", "given"),
    [
        ({"Load (V)": KN / 0.2 + 1.0}, "Load (V):V*200N-200N"),
        ({"Load (V)": KN / 0.2}, "Load (V):V*0.2 kN"),
        ({"Ch 3": 2.0 * NEWTON + 40.0}, "Ch 3:counts*0.5N-20N"),
        ({"Ch 3": 2.0 * NEWTON}, "Ch 3:*5e-1N"),
    ],
)
def test_volts_and_counts_have_a_scale_and_an_offset(
    tmp_path: Path, scaled: dict[str, np.ndarray], given: str
) -> None:
    path = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM, **scaled})
    assert_is_the_test(read_damper_test(path, columns=dict([parse_column_option(f"force={given}")])))


def test_a_force_in_volts_is_asked_for_its_scale(tmp_path: Path) -> None:
    path = write_table(tmp_path / "rig.txt", {"t_s": TIME, "x_mm": MM, "Load (V)": NEWTON})
    said = str(refusal(read_damper_test, path, match=r"is in V; give the force that one V stands for"))
    option = shlex.split(said[said.index("--column") :])[1]
    assert_is_the_test(read_damper_test(path, columns=dict([parse_column_option(option)])))


@pytest.mark.parametrize("scale", ["V*200", "V*N", "V*200V", "V*200N+3", "V*2*3N"])
def test_a_scale_without_a_unit_of_the_quantity_is_refused(scale: str) -> None:
    said = str(refusal(parse_column_option, f"force=Load (V):{scale}", match="N"))
    assert "V*200N" in said or "no unit of force" in said


@pytest.mark.parametrize(
    "columns",
    [
        {"Time (s)": TIME, "Servo motor speed": MM, "Torque": NEWTON},
        {"Time (s)": TIME, "Drehzahl": MM, "Drehmoment": NEWTON},
        {"Time (s)": TIME, "Way (furlong)": MM, "Push (dyn)": NEWTON},
    ],
)
def test_a_name_that_contradicts_is_no_candidate(tmp_path: Path, columns: dict[str, np.ndarray]) -> None:
    path = write_table(tmp_path / "rig.txt", columns)
    refusal(read_damper_test, path, match="displacement=COLUMN:m --column force=COLUMN:N")
    arm = {"displacement": "2:deg*1.5mm", "force": "3:Nm*2N"}
    assert read_damper_test(path, columns=arm).force.size == TIME.size


@pytest.mark.parametrize(
    "heading",
    [
        "Velocity (m/s),Compression (N),Rebound (N)",
        "Peak velocity [mm/s],Zugstufe [N],Druckstufe [N]",
        "v_mps,bump_N,rebound_N",
    ],
)
def test_a_table_of_peak_velocities_is_told_what_it_is(tmp_path: Path, heading: str) -> None:
    path = tmp_path / "dyno.csv"
    path.write_text(f"{heading}\n0.05,180,-310\n0.13,320,-690\n0.26,510,-1250\n0.52,820,-1900\n")
    said = str(refusal(read_damper_test, path, match="forces over peak velocities, as of a dynamometer"))
    assert "export each run with its time" in said
    assert "time=200 Hz" not in said


def test_a_record_of_compression_over_time_is_no_table_of_peaks(tmp_path: Path) -> None:
    path = write_table(
        tmp_path / "rig.txt",
        {"t_s": TIME, "Compression (mm)": MM, "v_mm/s": np.gradient(MM, TIME), "Load (N)": NEWTON},
    )
    options = {"displacement": "Compression (mm):mm"}
    assert read_damper_test(path, columns=options).force.size == TIME.size
