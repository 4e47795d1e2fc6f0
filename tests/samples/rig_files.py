"""The clean test as programs of rigs write it: LabVIEW, MATLAB 7.3 and TDMS."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray
from record_files import DT, N_TIME, clean_columns

CHANNELS = ("Stroke", "Load cell")
HEAD = (
    "LabVIEW Measurement\t\nWriter_Version\t2\nReader_Version\t2\nSeparator\tTab\nDecimal_Separator\t{point}\n"
    "Multi_Headings\tYes\nX_Columns\t{columns}\nTime_Pref\tAbsolute\nOperator\tme\nDate\t2020/01/02\n"
    "Time\t12:00:00,1234\n***End_of_Header***\t\n\t\n"
)


def lvm(x_columns: str, *, cuts: Sequence[int] = (), comma: bool = False, steps: str = "{dt}\t{dt}") -> str:
    """A .lvm file of the clean test in mm and kN; a new block begins at each cut."""
    columns = clean_columns()
    text = HEAD.format(point="," if comma else ".", columns=x_columns)
    edges = [0, *cuts, N_TIME]
    for first, last in pairwise(edges):
        start = repr(first * DT)
        text += (
            f"Channels\t2\t\t\t\nSamples\t{last - first}\t{last - first}\t\nDate\t2020/01/02\t2020/01/02\t\n"
            f"Time\t12:00:00\t12:00:00\t\nY_Unit_Label\tmm\tKilonewtons\t\nX_Dimension\tTime\tTime\t\n"
            f"X0\t{start}\t{start}\t\nDelta_X\t{steps.format(dt=DT)}\t\n***End_of_Header***\t\t\t\n"
        )
        names = "\t".join(f"X_Value\t{name}" if x_columns == "Multi" else name for name in CHANNELS)
        text += f"{names if x_columns == 'Multi' else f'X_Value{chr(9)}{names}'}\tComment\n"
        for k in range(first, last):
            t = "" if x_columns == "No" else f"{columns['t_s'][k]:.9g}"
            x, f = f"{1e3 * columns['displacement_m'][k]:.9g}", f"{1e-3 * columns['force_n'][k]:.9g}"
            text += "\t".join([t, x, t, f] if x_columns == "Multi" else [t, x, f])
            text += "\tstarted\n" if k == first else "\n"
    head, end, body = text.partition("***End_of_Header***")
    return head + end + (body.replace(".", ",") if comma else body)


def write_matlab_73(path: Path, variables: dict[str, Any], *, struct: str = "") -> None:
    """Variables as MATLAB stores them: HDF5 behind 512 bytes of text, transposed, with their class."""
    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group(struct) if struct else file
        for name, value in variables.items():
            array = np.atleast_2d(np.asarray(value))
            dataset = group.create_dataset(name, data=array.T, compression="gzip" if array.size > 9 else None)
            dataset.attrs["MATLAB_class"] = np.bytes_("double" if array.dtype.kind == "f" else "int32")
        file.create_group("#refs#")
        note = group.create_dataset("note", data=np.frombuffer(b"r\0i\0g\0", dtype=np.uint16))
        note.attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")


def write_tdms(path: Path, channels: Mapping[str, tuple[NDArray[Any], dict[str, Any]]]) -> None:
    import nptdms

    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [
                nptdms.ChannelObject("Rig", name, samples, properties=properties)
                for name, (samples, properties) in channels.items()
            ]
        )


def tdms_channels(**common: Any) -> dict[str, tuple[NDArray[Any], dict[str, Any]]]:
    columns = clean_columns()
    return {
        "Stroke": (1e3 * columns["displacement_m"], {"unit_string": "mm", **common}),
        "Axial Force": (1e-3 * columns["force_n"], {"unit_string": "kN", **common}),
    }
