"""Files that users bring: records of tests, ground motions, buildings, studies, tables; whole ones in every format."""

from __future__ import annotations

import importlib.util
import tempfile
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import motion_files
import numpy as np
import odd_files
import record_files
import rig_files
from numpy.typing import NDArray
from scipy.io import savemat
from scipy.sparse import csc_matrix
from study_texts import study_text

from mrwork.buildings import read_building, read_system
from mrwork.closed_loop import STANDARD_GRAVITY
from mrwork.dampers import damper
from mrwork.motions import read_motion
from mrwork.records import guess_tests, read_damper_test, read_test_table
from mrwork.study import read_study
from mrwork.uncertainty.candidate_tests import read_candidates
from studies.common.expected import departures
from tools.fuzzing.mutants import Structure
from tools.fuzzing.reader import Reader, Seed

# Few samples: a fast reader is tried more often.
N_TIME = 60

SHEAR = """name = "frame"
masses = [2.0, 1.0]
stiffnesses = [3.0, 2.0]
floor_names = ["first", "roof"]

[rayleigh]
ratios = [0.02, 0.02]
modes = [1, 2]

[[viscous]]
storey = 1
damping = 0.4

[[brace]]
storey = 2
stiffness = 9.0
mass = 0.01
damping = 0.1

[[tuned_mass]]
floor = 2
mass_ratio = 0.02
tuning = "den_hartog"

[[yielding]]
storey = 1
yield_force = 0.1
yield_displacement = 1e-3
post_yield_ratio = 0.1

[[friction]]
storey = "storey 2"
slip_load = 0.1
stiffness = 5.0
sharpness = 20.0
name = "brace that slips"

[[liquid_column]]
floor = "roof"
mass_ratio = 0.02
width_ratio = 0.7
rms_velocity = 0.1
"""
STATED = """mass = [[2.0, 0.0], [0.0, 1.0]]
stiffness = [[5.0, -2.0], [-2.0, 2.0]]
damping = "C.csv"
influence = [1.0, 1.0]
source = "by hand"

[lead_rubber]
mass = 1.0
period = 2.0
ratio = 0.1
yield_force = 0.3
yield_displacement = 0.01
"""
STUDY = """title = "All tables"

[building]
published = "uts"

[[damper]]
storey = 1
preset = "kwok2006"
lag = 190
differential = true

[[baseline]]
label = "viscous"
building = { viscous = [{ storey = 1, damping = 1e4 }], isolation = { mass = 330, period = 2.0, ratio = 0.1 } }

[[controller]]
law = "clipped_optimal"
settings = { drifts = 1, control_weight = 1e-13 }

[[controller]]
law = "passive_on"
label = "on"

[[controller]]
law = "fuzzy"
settings = { deformation = "5 mm", rate = 0.1 }

[[controller]]
law = "sliding_mode"
settings = { peak_acceleration = "0.3 g", largest_force = "2 kN" }

[[motion]]
synthetic = "kanai_tajimi"
name = "A"
duration = 3
seed = 9
pga = ["0.1 g", "0.3 g"]

[[motion]]
file = "motion.csv"
name = "B"
time_scale = 0.5
end = 0.25

[hardware]
sample_time = "2 ms"
step = "1 ms"
delay = "2 ms"
feedback = "state"

[[hardware.fault]]
signal = "deformation"
number = 1
start = 0.1
end = 0.25

[report]
histories = "none"

[uncertainty]
realisations = 2
stiffness = 0.1

[[tune]]
laws = ["clipped_optimal"]
budget = 16
population = 8
"""
TABLE = """file,use,time,displacement,force,velocity,command,doubt
rig.csv,fit,,,,,0.5 A,
"a, b.csv",test,t_s:s,displacement_m:m,force_n:N,velocity_mps:m/s,i:A,the force
c.mat,unused,?,?,,,,
"""
EXPECTED = """[fit]
fit_percent = { least = 99.0, most = 100.0 }
nrmse = { value = 0.01, tolerance = 0.001 }
model = "bingham"
[fit.parts]
count = 3
"""
CANDIDATES = "amplitude,frequency,current\n0.005,1.0,0.5\n0.01,2.0,0\n0.02,0.5,1.0\n"


def of_text(file: str, text: str, structure: Structure = "text") -> Seed:
    return Seed(file=file, content=text.encode(), structure=structure)


def written(file: str, structure: Structure, write: Callable[[Path], object]) -> Seed:
    """The seed of what `write` writes to a path."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / file
        write(path)
        return Seed(file=file, content=path.read_bytes(), structure=structure)


def user_readers() -> list[Reader]:
    """Readers of what users bring."""
    return [
        *_record_readers(),
        *_motion_readers(),
        *_building_readers(),
        Reader(
            name="table of tests",
            read=read_test_table,
            seeds=(of_text("tests.csv", TABLE), of_text("semi.csv", TABLE.replace(",", ";"))),
            share=6.0,
        ),
        Reader(
            name="guess of a table",
            read=lambda path: guess_tests([path]),
            seeds=(of_text("10mm1Hz0x5A.csv", _table(",").replace("_n", "")),),
            share=2.0,
        ),
        Reader(
            name="candidates",
            read=lambda path: read_candidates(path, damper("bingham")),
            seeds=(of_text("candidates.csv", CANDIDATES),),
            share=6.0,
        ),
        Reader(
            name="candidates with commands",
            read=lambda path: read_candidates(path, _with_laws()),
            seeds=(of_text("candidates.csv", CANDIDATES),),
            share=4.0,
        ),
        Reader(
            name="study",
            read=read_study,
            seeds=(
                of_text("quick.toml", study_text("control_weight = 1e-13"), "toml"),
                of_text("study.toml", STUDY, "toml"),
            ),
            beside={"motion.csv": _motion_table().encode()},
            share=3.0,
        ),
        Reader(
            name="expected figures",
            read=lambda path: departures({"fit": {"fit_percent": 99.5, "nrmse": 0.0105, "model": "a"}}, path),
            seeds=(of_text("expected.toml", EXPECTED, "toml"),),
            share=2.0,
        ),
    ]


@cache
def _with_laws() -> Any:
    return damper("bingham").with_current_laws({"c0": "linear", "f_c": "linear"}, unit="A")


def _columns() -> dict[str, NDArray[np.float64]]:
    return {name: column[:N_TIME] for name, column in record_files.clean_columns().items()}


def _table(delimiter: str, *, head: str = "", comma: bool = False, after: str = "", digits: int = 6) -> str:
    columns = _columns()
    rows = [
        delimiter.join(f"{cell:.{digits}f}" for cell in row) for row in zip(*columns.values(), strict=True)
    ]
    text = "\n".join([delimiter.join(columns) + after, *rows])
    return head + (text.replace(".", ",") if comma else text) + "\n"


def _record_readers() -> list[Reader]:
    lvm = rig_files.lvm
    short = {kind: _short(lvm(kind)) for kind in ("One", "Multi", "No")}
    text = [
        of_text("rig.csv", _table(",")),
        of_text("10mm2Hz0x5A.tsv", _table("\t")),
        of_text("rig.dat", _table(";", comma=True)),
        of_text("rig.txt", _table(" ", head="# a comment\n")),
        of_text("units.csv", _table(",", head="Rig 3\nRate,200\n\n", after="\ns,m,m/s,N")),
        of_text("rig.asc", _table("\t", head="\ufeff")),
    ]
    labview = [of_text(f"{kind}.lvm", text) for kind, text in short.items()]
    labview.append(of_text("comma.lvm", _short(lvm("One", comma=True))))
    columns = {**_columns(), "current_a": 0.5}
    matlab = [
        written("four.mat", "binary", lambda path: savemat(path, columns, format="4")),
        written("five.mat", "binary", lambda path: savemat(path, columns)),
        written("packed.mat", "matlab", lambda path: savemat(path, columns, do_compression=True)),
        written("struct.mat", "matlab", lambda path: savemat(path, {"rig": columns}, do_compression=True)),
        written(
            "other.mat",
            "binary",
            lambda path: savemat(path, {"K": csc_matrix(np.eye(3)), "text": "a", **columns}),
        ),
    ]
    hdf5 = [
        written("rig.mat", "binary", lambda path: rig_files.write_matlab_73(path, columns)),
        written("struct.mat", "binary", lambda path: rig_files.write_matlab_73(path, columns, struct="rig")),
    ]
    readers = [
        Reader(name="records of text", read=read_damper_test, seeds=tuple(text), share=16.0),
        Reader(name="records of LabVIEW", read=read_damper_test, seeds=tuple(labview), share=6.0),
        Reader(name="records of MATLAB 4 and 5", read=read_damper_test, seeds=tuple(matlab), share=12.0),
    ]
    readers += in_child("records of MATLAB 7.3", read_damper_test, hdf5, 2.0)
    if importlib.util.find_spec("pyarrow"):
        readers += in_child("records of Parquet", read_damper_test, _parquet(columns), 2.0)
    if importlib.util.find_spec("python_calamine"):
        readers += in_child("records of .xlsx", read_damper_test, _workbooks(), 2.0)
    if importlib.util.find_spec("nptdms"):
        readers.append(Reader(name="records of TDMS", read=read_damper_test, seeds=_tdms(), share=6.0))
    return readers


def in_child(
    name: str,
    read: Callable[[Path], object],
    seeds: Sequence[Seed],
    share: float,
    beside: Mapping[str, bytes] | None = None,
) -> list[Reader]:
    """A reader in a child process, and with the program of the child in the process of the harness."""
    names = {False: (f"{name}, library here", share), True: (name, share / 50.0)}
    return [
        Reader(name=each, read=read, seeds=tuple(seeds), share=part, beside=beside or {}, in_child=child)
        for child, (each, part) in names.items()
    ]


def _workbooks() -> tuple[Seed, ...]:
    head = ["Time (s)", "Stroke (m)", "Force (N)"]
    columns = _columns()
    rows = list(zip(columns["t_s"], columns["displacement_m"], columns["force_n"], strict=True))
    stamps = [datetime(2024, 5, 1, 12) + timedelta(seconds=float(row[0])) for row in rows]
    dated = [(stamp, *row[1:]) for stamp, row in zip(stamps, rows, strict=True)]
    sheets = {
        "one": {"Run": [head, *rows]},
        "several": {"Info": [["rig", "3"]], "Run": [["Date", *head[1:]], *dated]},
    }
    return tuple(
        Seed(file=f"{name}.xlsx", content=odd_files.workbook(each), structure="zip")
        for name, each in sheets.items()
    )


def _short(text: str) -> str:
    """A file of LabVIEW with fewer rows."""
    head, end, body = text.rpartition("***End_of_Header***")
    return head + end + "\n".join(body.split("\n")[: N_TIME + 2]) + "\n"


def _parquet(columns: Mapping[str, Any]) -> list[Seed]:
    import pyarrow
    from pyarrow import parquet

    table = pyarrow.table({**columns, "current_a": np.full(N_TIME, 0.5), "note": ["a"] * N_TIME})
    return [
        written(
            f"{compression}.parquet",
            "binary",
            lambda path, c=compression: parquet.write_table(table, path, compression=c, row_group_size=40),
        )
        for compression in ("none", "snappy", "zstd", "gzip")
    ]


def _tdms() -> tuple[Seed, ...]:
    short = {name: (samples[:N_TIME], facts) for name, (samples, facts) in rig_files.tdms_channels().items()}
    even = {name: (samples, {**facts, "wf_increment": 0.005}) for name, (samples, facts) in short.items()}
    stamps = np.datetime64("2020-01-02T12:00") + (5000 * np.arange(N_TIME)).astype("timedelta64[us]")
    return (
        written("even.tdms", "binary", lambda path: rig_files.write_tdms(path, even)),
        written(
            "stamps.tdms", "binary", lambda path: rig_files.write_tdms(path, {"Time": (stamps, {}), **short})
        ),
    )


def _motion_table() -> str:
    time = motion_files.DT * np.arange(N_TIME)
    rows = [f"{t:.4f},{a:.6f}" for t, a in zip(time, motion_files.accelerations(), strict=False)]
    return "\n".join(["t_s,a_mps2", *rows]) + "\n"


def _motion_readers() -> list[Reader]:
    short = motion_files.accelerations()[:N_TIME]
    in_g, in_gal = short / STANDARD_GRAVITY, 100.0 * short
    counts = np.round(1e4 * short).astype(np.int64)
    time = motion_files.DT * np.arange(N_TIME)
    lines = {
        "PEER AT2": {
            "a.AT2": motion_files.at2_lines(in_g, f"NPTS=  {N_TIME}, DT= .01000 SEC"),
            "b.AT2": motion_files.at2_lines(in_g, f"{N_TIME}    0.0100    NPTS, DT"),
        },
        "K-NET": {"a.NS": motion_files.knet_lines(counts, "0.6")},
        "COSMOS": {
            "a.v2": motion_files.cosmos_lines(in_gal),
            "b.v1": motion_files.cosmos_lines(in_gal, step_ms=-999.0, recorder_step=motion_files.DT),
        },
        "ESM": {"a.ASC": motion_files.esm_lines(in_gal)},
        "volumes": {"a.v2": motion_files.csmip_lines(in_gal)},
        "SMC": {"a.smc": motion_files.smc_lines(in_gal)},
        "GeoNet": {"a.V2A": motion_files.geonet_lines(in_gal, "Corrected")},
        "tables": {
            "a.csv": _motion_table().split("\n"),
            "a.txt": _motion_table().replace(",", " ").split("\n"),
        },
    }
    readers = [
        Reader(
            name=f"motions: {name}",
            read=read_motion,
            seeds=tuple(of_text(file, "\n".join(each) + "\n") for file, each in files.items()),
            share=5.0,
        )
        for name, files in lines.items()
    ]
    return [
        *readers,
        Reader(
            name="motions: COSMOS, a channel of several",
            read=lambda path: read_motion(path, channel=2),
            seeds=(of_text("a.v2", "\n".join(2 * motion_files.cosmos_lines(in_gal))),),
            share=2.0,
        ),
        Reader(
            name="motions: numbers alone",
            read=lambda path: read_motion(path, unit="g", dt=0.01),
            seeds=(of_text("a.txt", "\n".join(motion_files.rows(in_g, "15.7E", 8))),),
            share=3.0,
        ),
        Reader(
            name="motions: MATLAB",
            read=read_motion,
            seeds=(
                written(
                    "a.mat",
                    "matlab",
                    lambda path: savemat(path, {"t_s": time, "a_mps2": short}, do_compression=True),
                ),
            ),
            share=3.0,
        ),
    ]


def _building_readers() -> list[Reader]:
    matrices = {
        "M": np.diag([2.0, 1.0]),
        "C": np.array([[0.5, -0.2], [-0.2, 0.2]]),
        "K": np.array([[5.0, -2.0], [-2.0, 2.0]]),
    }
    sparse = {name: csc_matrix(matrix) for name, matrix in matrices.items()}
    rows = {
        name: "\n".join(",".join(map(repr, row)) for row in matrix.tolist()) + "\n"
        for name, matrix in matrices.items()
    }
    files = {f"frame/{name}.csv": text.encode() for name, text in rows.items()}
    system = {"A": -np.eye(2), "B": np.ones((2, 1)), "C": np.ones((1, 2)), "D": np.zeros((1, 1))}
    published = 'published = "dyke1996"\nname = "three"\n[modal_damping]\nratios = [0.01]\n'
    return [
        Reader(
            name="buildings: TOML",
            read=read_building,
            seeds=(
                of_text("shear.toml", SHEAR, "toml"),
                of_text("stated.toml", STATED, "toml"),
                of_text("published.toml", published, "toml"),
            ),
            beside={"C.csv": rows["C"].encode()},
            share=5.0,
        ),
        Reader(
            name="buildings: matrices of text",
            read=lambda path: read_building(path.parent),
            seeds=tuple(
                Seed(file=file, content=content, structure="text") for file, content in files.items()
            ),
            beside=files,
            share=5.0,
        ),
        Reader(
            name="buildings: MATLAB",
            read=read_building,
            seeds=(
                written("four.mat", "binary", lambda path: savemat(path, matrices, format="4")),
                written("five.mat", "matlab", lambda path: savemat(path, matrices, do_compression=True)),
                written("sparse4.mat", "binary", lambda path: savemat(path, sparse, format="4")),
                written(
                    "sparse5.mat",
                    "matlab",
                    lambda path: savemat(path, {"frame": sparse}, do_compression=True),
                ),
            ),
            share=5.0,
        ),
        Reader(
            name="linear systems: MATLAB",
            read=read_system,
            seeds=(written("plant.mat", "matlab", lambda path: savemat(path, system, do_compression=True)),),
            share=2.0,
        ),
    ]
