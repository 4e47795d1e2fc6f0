"""Results of chunks in files beside a journal, until the step of which they are a part is recorded there.

A journal has a step when it is complete. What was finished of an incomplete one would be lost with the client.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mrwork.store.journal import Journal
from mrwork.store.output_file import write_file
from mrwork.store.run_folder import chunks_beside


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptChunks:
    """Files of the chunks of one call, by its fingerprint and the number of steps that a journal had before."""

    folder: Path
    n_steps: int
    fingerprint: str

    @classmethod
    def beside(cls, journal: Journal, fingerprint: str) -> KeptChunks:
        """The chunks of the next call of the journal, in the folder beside it."""
        return cls(folder=chunks_beside(journal.path), n_steps=journal.n_asked, fingerprint=fingerprint)

    def recall(self, count: int) -> dict[int, list[NDArray[Any]]]:
        """Arrays of the chunks that are kept, by number, and remove files of earlier steps; a damaged file is none."""
        for path in self.folder.glob("*.npz"):
            if path.name < f"{self.n_steps:09d}":
                path.unlink()
        chunks: dict[int, list[NDArray[Any]]] = {}
        for number in range(count):
            # A damaged file raises whatever it leads NumPy to.
            with (
                suppress(Exception),
                self._path(number).open("rb") as stream,
                np.load(stream, allow_pickle=False) as arrays,
            ):
                chunks[number] = [*arrays.values()]
        return chunks

    def keep(self, number: int, arrays: Sequence[NDArray[Any]]) -> None:
        """Write the arrays of a chunk, whole or not at all; each member of the file has a checksum."""
        content = io.BytesIO()
        np.savez(content, *arrays)
        write_file(self._path(number), content.getvalue())

    def _path(self, number: int) -> Path:
        return self.folder / f"{self.n_steps:09d}-{self.fingerprint}-{number}.npz"
