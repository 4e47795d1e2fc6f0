"""HDF5 file of a growing chain, from which sampling resumes with the same random stream.

Data sets: `position` (n_steps + 1, n_walkers, n_dim), `log_density` (n_steps + 1, n_walkers), and `place0` and
`place1`, each with a number of steps and the random state after them. The attribute `current` selects the valid one of
the two; it is written last, so that a process that is killed while writing resumes from the previous state. The
attribute `premises` is the fingerprint of the inputs.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from mrwork.errors import JournalError, OutputError
from mrwork.store.fingerprint import differences
from mrwork.uncertainty.posterior.ensemble import Ensemble

Array = NDArray[np.float64]

_KIND = "mrwork posterior, version 1"
_ROWS = 64


@dataclass(slots=True, kw_only=True)
class ChainFile:
    """Chain file at `path`, which holds `written` steps."""

    path: Path
    written: int

    @classmethod
    def begin(cls, path: Path, fingerprint: Mapping[str, Any], ensemble: Ensemble) -> ChainFile:
        """Create the file, replacing an existing one, with the start of the ensemble.

        Raises
        ------
        OutputError
            Where the file cannot be written.
        """
        _, n_walkers, n_dim = ensemble.positions.shape
        try:
            with h5py.File(path, "w") as file:
                file.attrs["kind"] = _KIND
                file.attrs["premises"] = json.dumps(fingerprint)
                file.attrs["current"] = 0
                for name, shape in (("position", (n_walkers, n_dim)), ("log_density", (n_walkers,))):
                    file.create_dataset(
                        name, (0, *shape), "f8", maxshape=(None, *shape), chunks=(_ROWS, *shape)
                    )
                for place in "01":
                    file.create_dataset(f"place{place}", (624,), "u4")
        except OSError as reason:
            raise OutputError(f"cannot write {path}: {reason}; choose another folder") from reason
        chain = cls(path=path, written=-1)
        chain.append(ensemble)
        return chain

    @classmethod
    def resume(
        cls, path: Path, fingerprint: Mapping[str, Any], target: Callable[[Array], Array]
    ) -> tuple[ChainFile, Ensemble]:
        """Open a file and restore the ensemble from it.

        Raises
        ------
        JournalError
            Where the file does not exist, is damaged, or belongs to a sampling with another fingerprint.
        """
        if not path.is_file():
            raise JournalError(f"there is no {path} to go on from; sample without resuming first")
        try:
            with h5py.File(path, "r") as file:
                recorded = json.loads(file.attrs["premises"])
                place = file[f"place{file.attrs['current']}"]
                n_steps = int(place.attrs["n_steps"])
                state = (
                    "MT19937",
                    np.asarray(place[()], dtype=np.uint32),
                    int(place.attrs["position"]),
                    int(place.attrs["has_gauss"]),
                    float(place.attrs["cached"]),
                )
                positions = file["position"][: n_steps + 1]
                densities = file["log_density"][: n_steps + 1]
        except (OSError, KeyError, ValueError) as reason:
            raise JournalError(f"{path} is damaged ({reason}); sample again without resuming") from reason
        different = differences(recorded, json.loads(json.dumps(fingerprint)))
        if different:
            raise JournalError(
                f"{path} is of another sampling: {'; '.join(different[:3])}; "
                "sample as it was begun, or without resuming"
            )
        ensemble = Ensemble(target=target, positions=positions, densities=densities, at=(n_steps, state))
        return cls(path=path, written=n_steps), ensemble

    def append(self, ensemble: Ensemble) -> None:
        """Write the steps that are not in the file yet.

        Raises
        ------
        OutputError
            Where they cannot be written.
        """
        done, state = ensemble.at
        if done <= self.written:
            return
        new = slice(self.written + 1, done + 1)
        try:
            with h5py.File(self.path, "r+") as file:
                for name, rows in (("position", ensemble.positions), ("log_density", ensemble.densities)):
                    file[name].resize(done + 1, axis=0)
                    file[name][new] = rows[new]
                place = 1 - int(file.attrs["current"])
                _, keys, position, has_gauss, cached = state
                entry = file[f"place{place}"]
                entry[...] = keys
                entry.attrs.update(
                    {"n_steps": done, "position": position, "has_gauss": has_gauss, "cached": cached}
                )
                file.flush()
                file.attrs["current"] = place
        except OSError as reason:
            raise OutputError(f"cannot write {self.path}: {reason}; free some space") from reason
        self.written = done
