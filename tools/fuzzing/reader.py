"""What is fuzzed: a reader, the whole files that its damaged ones are made from, and what surrounds them."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from tools.fuzzing.mutants import Structure, mutant


@dataclass(frozen=True, slots=True, kw_only=True)
class Seed:
    """A whole file: its path in the folder that is read, its content, and what its mutants are aware of."""

    file: str
    content: bytes
    structure: Structure


@dataclass(frozen=True, slots=True, kw_only=True)
class Reader:
    """A function that reads a file, given its path.

    `beside` are further files of the folder. `share` is its part of all mutants, relative to others. Where the file is
    read in a child process, `in_child` is whether the mutants are too; otherwise the program of the child runs in the
    process of the harness, which may then end by a signal as the child may.
    """

    name: str
    read: Callable[[Path], object]
    seeds: tuple[Seed, ...]
    beside: Mapping[str, bytes] = field(default_factory=dict)
    share: float = 1.0
    in_child: bool | None = None

    def check(self) -> None:
        """Read every seed as it is, which also loads what the reader needs.

        Raises
        ------
        MrworkError
            A seed is no such file, so that its mutants would all be refused for the same reason.
        """
        for seed in self.seeds:
            with tempfile.TemporaryDirectory() as name:
                for file, content in {**self.beside, seed.file: seed.content}.items():
                    path = Path(name) / file
                    path.parent.mkdir(parents=True, exist_ok=True)
                    path.write_bytes(content)
                repr(self.read(Path(name) / seed.file))

    def mutant(self, number: int) -> tuple[Seed, bytes]:
        """Mutant of that number and the seed that it is of."""
        seed = self.seeds[number % len(self.seeds)]
        others = [each.content for each in self.seeds]
        return seed, mutant(f"{self.name}/{seed.file}", seed.structure, seed.content, others, number)
