"""Histories of the runs of a study: for the floors and storeys of the bare building, and as files of its folder."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from mrwork.base.labelled import NamedArray, NamedArrays
from mrwork.base.values import Floats, array_dataclass
from mrwork.closed_loop.responses import History, Labelled, Quantity, history_signals
from mrwork.motions import GroundMotion
from mrwork.store.netcdf import netcdf_of, read_netcdf
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import HISTORIES, RunFolder
from mrwork.store.run_writer import RunAtWork
from mrwork.study.study import Arrangement, Study

# Signals of no use to pages, and energies, which a history has in one array.
_LEFT_OUT = {"input_energy", "damping_energy", "device_energy"}
_PUSH = Quantity(name="floor_force", axis="run", unit="N", description="sum of the forces on the floors")
_ENERGY = ("input", "kinetic", "strain", "damping", "devices")


@array_dataclass()
class RunHistory(Labelled):
    """The history of a run, each signal an attribute: shapes (n_time,), for floors, storeys and devices (n_time, n).

    They are the `history_signals` that pages draw, and `floor_force`, the sum of the forces on the floors [N], where
    some act. `energy` has the columns input, kinetic, strain, damping and devices [J], cumulative from the start;
    passive devices count among them. The rest of the input is in storeys that yield.
    """

    time: Floats
    numbers: Mapping[str, Floats]


def _kept_signals() -> list[Quantity]:
    named = (signal for signal in history_signals() if signal.name not in _LEFT_OUT)
    return [signal for signal in named if signal.axis not in ("state", "element")]


def history_of(history: History, arrangement: Arrangement, motion: GroundMotion) -> RunHistory:
    """The history of a run under a motion, for the floors and storeys of the bare building."""
    devices = range(len(arrangement.devices))
    places = {**arrangement.places, "device": [*devices]}
    energies = (
        history.input_energy,
        history.kinetic_energy(arrangement.building),
        history.strain_energy(arrangement.building),
        history.damping_energy,
        history.device_energy[:, : len(devices)].sum(axis=1)
        + history.element_energy[:, arrangement.passive_devices].sum(axis=1),
    )
    numbers = {
        signal.name: history.numbers[signal.name][:, places[signal.axis]]
        if signal.own_axes
        else history.numbers[signal.name]
        for signal in _kept_signals()
    }
    numbers["energy"] = np.stack(energies, axis=1)
    if motion.forces.size:
        numbers[_PUSH.name] = np.interp(history.time, motion.time, motion.forces.sum(axis=0), right=0.0)
    return RunHistory(time=history.time, numbers=numbers)


class Histories:
    """Histories of the study that is made in a run folder, in single precision except for time."""

    def __init__(self, work: RunAtWork, study: Study) -> None:
        self._work, self._study = work, study

    def is_stored(self, row: int, motion: int) -> bool:
        """Whether the history of a run is stored and whole; a damaged one will be written again."""
        path = self._work.grown(_name_of(row, motion))
        # What reading a damaged file leads to.
        with suppress(LookupError, OSError, RuntimeError, TypeError, ValueError):
            return path.is_file() and _read_history(path) is not None
        return False

    def keep(self, row: int, motion: int, history: RunHistory) -> None:
        """Store the history of a run, whole or not at all."""
        study = self._study
        labels = {
            "time": NamedArray.of(history.time, unit="s", long_name="time"),
            "floor": NamedArray.of(study.building.frame_floors),
            "storey": NamedArray.of(study.building.drift_names),
            "device": NamedArray.of(study.device_names[: history.force.shape[1]]),
            "energy_part": NamedArray.of(_ENERGY),
        }
        numbers = {name: signal.astype(np.float32) for name, signal in history.numbers.items()}
        arrays = {
            signal.name: signal.array(numbers[signal.name], "time", command_unit=study.command_unit)
            for signal in (*_kept_signals(), _PUSH)
            if signal.name in numbers
        }
        words = {"unit": "J", "long_name": "energy since the start"}
        arrays["energy"] = NamedArray.of(numbers["energy"], "time", "energy_part", **words)
        title = f"{study.rows[row].label} under {study.grounds[motion].name}"
        content = NamedArrays(title=title, rows=("time",), labels=labels, arrays=arrays)
        write_file(self._work.growing(_name_of(row, motion)), netcdf_of({"": content}, checksums=True))


def read_history(place: Path, row: int, motion: int) -> RunHistory | None:
    """The history of a run in the folder of a study, if it is stored."""
    run, name = RunFolder.open(place), _name_of(row, motion)
    with run.explained(name):
        return _read_history(run.file(name)) if name in run.files and run.file(name).is_file() else None


def _read_history(path: Path) -> RunHistory:
    """The history in a file; one without devices has them with an empty axis."""
    stored = read_netcdf(path, path)[""]
    time = stored.labels["time"].values
    numbers = {name: array.values.astype(np.float64) for name, array in stored.arrays.items()}
    empty = np.empty((time.size, 0))
    return RunHistory(time=time, numbers={signal.name: empty for signal in _kept_signals()} | numbers)


def history_names(n_rows: int, n_motions: int) -> list[str]:
    """Paths in the run folder of the histories of a study, also of those that are not stored."""
    return [_name_of(row, motion) for row in range(n_rows) for motion in range(n_motions)]


def _name_of(row: int, motion: int) -> str:
    return f"{HISTORIES}/{row + 1:02d}-{motion + 1:02d}.nc"
