"""Strong-motion files in the layout of each format, written from a list of accelerations."""

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

N_TIME = 203
DT = 0.01


def accelerations() -> NDArray[np.float64]:
    """A decaying 3 Hz sine of 2 m/s^2, in m/s^2."""
    time = DT * np.arange(N_TIME)
    return 2.0 * np.exp(-0.7 * time) * np.sin(2.0 * np.pi * 3.0 * time)


def rows(numbers: Sequence[float] | NDArray[np.float64], form: str, per_line: int) -> list[str]:
    cells = [format(number, form) for number in numbers]
    return ["".join(cells[start : start + per_line]) for start in range(0, len(cells), per_line)]


def at2_lines(in_g: NDArray[np.float64], size: str) -> list[str]:
    return [
        "PEER STRONG MOTION DATABASE RECORD. PROCESSING BY PACIFIC ENGINEERING.",
        "IMPERIAL VALLEY 10/15/79 2316, EL CENTRO ARRAY #1, 140 (USGS STATION 5056)",
        "ACCELERATION TIME HISTORY IN UNITS OF G. FILTER POINTS: HP=0.1 Hz LP=40.0 Hz",
        size,
        *rows(in_g, "15.7E", 5),
    ]


def knet_lines(counts: NDArray[np.int64], duration: str) -> list[str]:
    """The published example's header: 3920 gal are 6182761 counts."""
    return [
        "Origin Time       2006/01/18 23:25:00",
        "Lat.              37.798",
        "Long.             142.200",
        "Depth. (km)       36",
        "Mag.              5.7",
        "Station Code      MYG002",
        "Station Lat.      38.7262",
        "Station Long.     141.5109",
        "Station Height(m) 79",
        "Record Time       2006/01/18 23:25:46",
        "Sampling Freq(Hz) 100Hz",
        f"Duration Time(s)  {duration}",
        "Dir.              N-S",
        "Scale Factor      3920(gal)/6182761",
        "Max. Acc. (gal)   48.060",
        "Last Correction   2006/01/18 23:25:31",
        "Memo.             ",
        *(
            " ".join(f"{count:8d}" for count in counts[start : start + 8])
            for start in range(0, counts.size, 8)
        ),
    ]


def esm_lines(in_gal: NDArray[np.float64], kind: str = "ACCELERATION") -> list[str]:
    """Header DYNA 1.2, shortened by entries that no reader of motions uses."""
    return [
        "EVENT_NAME: CENTRAL_ITALY",
        "EVENT_DATE_YYYYMMDD: 20160824",
        "STATION_CODE: AMT",
        f"SAMPLING_INTERVAL_S: {DT:.6f}",
        f"NDATA: {in_gal.size}",
        f"DURATION_S: {DT * in_gal.size:.3f}",
        "STREAM: HGE",
        "UNITS: cm/s^2",
        "PGA_CM/S^2: 850.803",
        "HEADER_FORMAT: DYNA 1.2",
        f"DATA_TYPE: {kind}",
        *(f"{value:.6f}" for value in in_gal),
    ]


def cosmos_lines(
    numbers: NDArray[np.float64],
    *,
    title: str = "Corrected acceleration",
    unit: str = "cm/s^2",
    series_format: str = "(8F10.5)",
    step_ms: float = 1e3 * DT,
    recorder_step: float = -999.0,
) -> list[str]:
    real = np.full(100, -999.0)
    # A large number beside another leaves no blank between the columns of 6F13.6, as files in the wild have it.
    real[33], real[41], real[61] = recorder_step, 426212.0, step_ms
    layout = re.fullmatch(r"\((\d+)([EF])(\d+\.\d+)\)", series_format)
    assert layout is not None
    per_line, form = int(layout[1]), layout[3] + layout[2]
    return [
        f"{title}    (Format v01.20 with 13 text lines) Src: 921az039.evt",
        "Rcrd of Wed Jan 15, 2014 01:35:00.0 PST",
        "Hypocenter: 38.215   -122.312   H= 11km(NCSN) M=6.0",
        "Origin: 08/24/2014, 10:20:44.0 UTC (NCSN)",
        "Statn No: 02-    0  Code:NP-1743   USGS CA:Petaluma;FS 2",
        "Coords: 38.2667 -122.6576  Site geology:Unknown",
        "Recorder: Etna  s/n 1614 (  3 Chns of  3 at Sta) Sensor:K2 Epise   s/n",
        "Rcrd start time:08/24/2014, 10:20:47.695 UTC (Q=0) RcrdId:NP.1743.HNE.",
        "Sta Chan   1: 90 deg (Rcrdr Chan  1) Location:",
        "Raw record length =  63.620 sec, Uncor max =    0.000        at    0.000 sec",
        "Processed:                               Max =    34.163 cm/s^2   at  10.045 sec",
        "Record filtered below  0.01 Hz (periods over  68.3 secs)  and above 75.0 Hz",
        "Values used when parameter or data value is unknown/unspecified:   -999 -999.0",
        " 100  Integer-header values follow on 10 lines, Format= (10I8)",
        *rows(np.full(100, -999.0), "8.0f", 10),
        "100 Real-header values follow on 17 lines , Format = (6F13.6)",
        *rows(real, "13.6f", 6),
        '2 Comment line(s) follow, each starting with a "|":',
        " | converted",
        "| 17 lines, Format = (6F13.6) is no block",
        f"{numbers.size} acceleration pts, approx 2 secs, units={unit},Format={series_format}",
        *rows(numbers, form, per_line),
        "End-of-data for Chan  1 acceleration",
    ]


def volume_lines(first: str, points: str, unit: str, series: Sequence[str]) -> list[str]:
    text = [first, "AN EARTHQUAKE", "", "", "STATION", "", "COMP N00E", "", "", "INSTR PERIOD = .04 SEC"]
    text += [points, unit, ""]
    return [*text, *["    0" * 16] * 7, *["      .000" * 8] * 7, *series, "/&"]


def csmip_lines(
    in_gal: NDArray[np.float64], unit: str = "(UNITS: CM/SEC/SEC)", width: str = "8.1f"
) -> list[str]:
    size = in_gal.size
    return [
        "CORRECTED ACCELEROGRAM   00000-X0000       CHAN  1:  90 DEG",
        "UNCORRECTED ACCELEROGRAM DATA",
        "SOME EARTHQUAKE",
        "HYPOCENTER(XXX): 36.0N,120.0W, H=9KM.   ML=6.0(XXX)",
        f"   {size} POINTS OF ACCEL DATA EQUALLY SPACED AT  .010 SEC.  {unit}",
        *rows(in_gal, width, 8),
        f"   {size} POINTS OF VELOC DATA EQUALLY SPACED AT  .010 SEC.  (UNITS: CM/SEC)",
        *rows(0.1 * in_gal, width, 8),
    ]


def smc_lines(in_gal: NDArray[np.float64], kind: str = "2 CORRECTED ACCELEROGRAM") -> list[str]:
    integers, reals = np.full(48, -32768.0), np.full(50, 1.7e38)
    integers[15:17], reals[1] = (1, in_gal.size), 100.0
    head = [kind, *["*"] * 10, *rows(integers, "10.0f", 8), *rows(reals, "15.7E", 5), "| a comment"]
    return [*head, *rows(in_gal, "10.3E", 8)]


def geonet_lines(in_gal: NDArray[np.float64], volume: str) -> list[str]:
    header = np.zeros(100)
    header[[30, 33, 34, 35]], header[65] = in_gal.size, 0.01
    text = [f"{volume} accelerogram 2016_WTMC GNS Science", *["-"] * 10]
    text += ["Raw readings in units of 1.00 mm/s/s", "Component N28W", *["-"] * 3]
    behind = rows(in_gal, "8.1f", 10) * (2 if volume == "Corrected" else 0)
    return [*text, *rows(header, "8.3f", 10), *rows(10.0 * in_gal, "8.0f", 10), *behind]


def pair_rows(in_gal: NDArray[np.float64], width: int) -> list[str]:
    numbers = np.stack([0.01 * np.arange(in_gal.size), in_gal / 98.0665], axis=1).ravel()
    return [" " * (width - 70) + row for row in rows(numbers, "7.3f", 10)]


def write_lines(path: Path, lines: Sequence[str], end: str = "\n") -> Path:
    path.write_bytes((end.join(lines) + end).encode())
    return path
