"""Files of networks and tables with headers: what they state is taken, what they lack is asked at once."""

from pathlib import Path

import numpy as np
import pytest
from motion_files import csmip_lines, geonet_lines, pair_rows, rows, smc_lines, volume_lines, write_lines
from numpy.testing import assert_allclose
from numpy.typing import NDArray
from refusals import refusal
from scipy.io import savemat

from mrwork.motions import read_motion

# In gal; four digits before the point, so that numbers of width 8 touch.
SAMPLES = np.round(900.0 * np.sin(np.arange(16.0)), 1)
CWB = ["#AmplitudeUnit:  gal", "#DataSequence: Time U(+); N(+); E(+)", "#Data: 4F10.3"]
CWB += [f"{0.02 * k:10.3f}{0.1 * value:10.3f}{value:10.3f}{-value:10.3f}" for k, value in enumerate(SAMPLES)]
AFAD = ["STRONG GROUND MOTION RECORDS", "NUMBER OF DATA          : 16", "SAMPLING INTERVAL (sec) : 0.01"]
AFAD += ["RAW PGA VALUES (gal)    : (N-S) 900 (E-W) 90", "       N-S          E-W          U-D"]
AFAD += [f"{value:13.6f}{0.1 * value:13.6f}{-value:13.6f}" for value in SAMPLES]
UNAM = ["ARCHIVO ESTANDAR DE ACELERACION:", "INTERVALO DE MUESTREO, C1-C6 (s)       : /0.005/0.005"]
UNAM += ["INTERVALO DE MUESTREO, C7-C12 (s)      : ", "UNIDADES DE LOS DATOS                  : Gal (cm/s/s)"]
UNAM += ["---------+---------+", "   CANAL-1   CANAL-2", "         V      N00E", "---------+---------+"]
UNAM += [f"{0.1 * value:10.4f}{value:10.4f}" for value in SAMPLES]


POINTS = "NO. OF POINTS =     16  RECORD LENGTH =   .150 SEC"
VOLUMES = {
    "CSMIP V2": csmip_lines(SAMPLES),
    "CSMIP V2, new": csmip_lines(SAMPLES, "in cm/sec2. (8f12.5)", "12.5f"),
    "CSMIP V1": volume_lines(
        "UNCORRECTED ACCELEROGRAM DATA",
        POINTS,
        "UNITS OF UNCOR ACCEL ARE SEC AND G/10.",
        pair_rows(SAMPLES, 70),
    ),
    "CSMIP V1, new": volume_lines(
        "Uncorrected Accelerogram Data",
        "No. of Points = 16  Record Length = .150 sec",
        "Units of uncor data are sec and g .",
        [
            " 16 Accelerogram points at 100 pts/sec in units of g .      Format: (8f9.6)",
            *rows(SAMPLES / 980.665, "9.6f", 8),
        ],
    ),
    "USC V1": volume_lines(
        "FILE     0 OF UNCORRECTED ACCELEROGRAM DATA OF VOLUME I:",
        "NO. OF POINTS =     16      DURATION =    .150 SEC",
        "UNITS ARE SEC AND G/10",
        pair_rows(SAMPLES, 71),
    ),
    "BHRC": volume_lines(
        "* VOL1DS FILE:  5520/01",
        "NO. OF POINTS =  16      DURATION =   .150",
        "UNITS ARE SECONDS AND G/10",
        rows(SAMPLES / 98.0665, "13.6E", 10),
    ),
    "SMC": smc_lines(SAMPLES),
    "V1A": geonet_lines(SAMPLES, "Uncorrected"),
    "V2A": geonet_lines(SAMPLES, "Corrected"),
}


def assert_is(path: Path, channel: int | None, samples: NDArray[np.float64]) -> None:
    motion = read_motion(path, channel=channel)
    assert motion.dt == pytest.approx(0.01, rel=1e-6)
    # Times and tenths of g are written with three decimals.
    assert_allclose(motion.acceleration, 0.01 * samples, atol=5e-4)


@pytest.mark.parametrize("lines", VOLUMES.values(), ids=list(VOLUMES))
def test_a_volume_is_read_in_its_unit_and_step_though_numbers_touch(tmp_path: Path, lines: list[str]) -> None:
    path = write_lines(tmp_path / "record.v", lines)
    assert_is(path, None, SAMPLES)
    for option in ({"unit": "gal"}, {"dt": 0.01}, {"column": "1"}):
        refusal(read_motion, path, **option, match="leave it out")
    # Velocity and displacement follow the acceleration of a volume 2.
    kept = lines.index("/&") - 1 if "/&" in lines else len(lines) - (5 if "Corrected" in lines[0] else 4)
    refusal(read_motion, write_lines(path, lines[:kept]), match="cut off or damaged")


@pytest.mark.parametrize("kind", ["CSMIP V2", "CSMIP V1", "BHRC", "V2A"])
def test_a_channel_of_a_volume_is_chosen_by_its_number(tmp_path: Path, kind: str) -> None:
    path = write_lines(tmp_path / "record.v", [*VOLUMES[kind], *VOLUMES[kind]])
    assert_is(path, 2, SAMPLES)
    refusal(read_motion, path, match="holds 2 channels")


@pytest.mark.parametrize(
    "lines",
    [
        smc_lines(SAMPLES, "3 VELOCITY"),
        ["RESPONSE AND FOURIER AMPLITUDE SPECTRA", "1 2"],
        ["CORRECTED ACCELEROGRAM  IIBB127", "1 2"],
    ],
)
def test_a_known_format_that_is_not_read_is_named(tmp_path: Path, lines: list[str]) -> None:
    refusal(
        read_motion,
        write_lines(tmp_path / "record.v2", lines),
        match=r"SMC file is of the kind|read are volumes 1 and 2 of CSMIP",
    )


@pytest.mark.parametrize(
    ("lines", "dt", "columns"),
    [(CWB, 0.02, ("3", "N(+)", "n(+)")), (AFAD, 0.01, ("1", "N-S")), (UNAM, 0.005, ("2", "N00E"))],
)
def test_unit_step_and_names_of_a_header_are_taken(
    tmp_path: Path, lines: list[str], dt: float, columns: tuple[str, ...]
) -> None:
    path = write_lines(tmp_path / "record.txt", lines)
    for column in columns:
        motion = read_motion(path, column=column, unit="gal")
        assert motion.dt == pytest.approx(dt, rel=1e-9)
        assert_allclose(motion.acceleration, 0.01 * SAMPLES, atol=1e-9)
    refusal(read_motion, path, match=r'which column .* as here: column="\d"$')
    refusal(read_motion, path, column=columns[0], unit="g", match="header states gal")
    refusal(read_motion, path, column="nonsense", unit="gal", match="there is no column 'nonsense'")
    refusal(read_motion, path, column=columns[0], dt=0.03, match=r"holds the times|header states")


def test_what_is_missing_is_asked_at_once(tmp_path: Path) -> None:
    body = [f"{value:.4f} {0.1 * value:.4f} {-value:.4f}" for value in 1e-3 * SAMPLES]
    path = write_lines(tmp_path / "three.txt", ["N-S E-W U-D", *body])
    refusal(read_motion, path, match=r'column="1", unit="g", dt=0.01$')
    assert_allclose(
        read_motion(path, column="3", unit="m/s2", dt=0.01).acceleration, -1e-3 * SAMPLES, atol=1e-4
    )


def test_columns_without_names_are_taken_by_number(tmp_path: Path) -> None:
    table = np.stack([0.01 * np.arange(16), SAMPLES, -SAMPLES], axis=1)
    text = write_lines(tmp_path / "three.txt", [" ".join(map(repr, row)) for row in table.tolist()])
    matrix = tmp_path / "three.mat"
    savemat(matrix, {"data": table})
    for path in (text, matrix):
        motion = read_motion(path, column="3", unit="gal")
        assert motion.dt == pytest.approx(0.01, rel=1e-9)
        assert_allclose(motion.acceleration, -0.01 * SAMPLES)
        for options in (
            {"unit": "gal", "dt": 0.01},
            {"unit": "gal", "column": "1"},
            {"unit": "gal", "column": "4"},
        ):
            # The first column runs in equal steps: the rows are no series, and it is no acceleration.
            refusal(read_motion, path, **options, match=r"which column|holds the times|no column")


def test_components_without_times_are_no_series_in_rows(tmp_path: Path) -> None:
    time = 0.01 * np.arange(400)
    parts = np.stack([np.sin(9.0 * time), np.cos(7.0 * time), 0.5 * np.sin(8.0 * time + 1.0)], axis=1)
    path = write_lines(tmp_path / "three.txt", [" ".join(f"{value:.5f}" for value in row) for row in parts])
    refusal(read_motion, path, unit="m/s2", dt=0.01, match='column="1"')
    assert_allclose(read_motion(path, unit="m/s2", dt=0.01, column="2").acceleration, parts[:, 1], atol=1e-5)
    series = write_lines(tmp_path / "rows.txt", rows(parts[:, 0], "10.5f", 8))
    assert read_motion(series, unit="m/s2", dt=0.01).n_time == 400


def test_prose_above_the_numbers_is_no_name(tmp_path: Path) -> None:
    numbers = [f"{value:.6f}" for value in 1e-3 * SAMPLES]
    path = write_lines(tmp_path / "step.txt", ["Time Step: 0.005", *numbers])
    for options in ({}, {"dt": 0.005}):
        assert read_motion(path, unit="m/s2", **options).dt == 0.005
    refusal(read_motion, path, unit="m/s2", dt=0.01, match=r"header states 0.005 s")
    refusal(read_motion, path, match='unit="g"')
