"""Vector instructions of the compiled module and of this processor."""

from __future__ import annotations

from dataclasses import dataclass

from mrwork import _rust
from mrwork.base.summary import Summarised, Summary
from mrwork.errors import SettingError


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class InstructionSets(Summarised):
    """Vector instructions of the compiled module and of this processor; results have the same bits with each.

    Attributes
    ----------
    used : name of the set that simulations run on, `"avx512"`, `"avx2"` or `"plain"`.
    built : names of those in the compiled module, fastest first.
    machine : names of those that this processor has, fastest first.
    """

    used: str
    built: tuple[str, ...]
    machine: tuple[str, ...]

    @property
    def left_out(self) -> tuple[str, ...]:
        """Those of this processor that a build for another machine left out, fastest first."""
        return tuple(name for name in self.machine if name not in self.built)

    def __str__(self) -> str:
        """In one line."""
        told = f"simulates with {self.used}; this build has {', '.join(self.built)}"
        if not self.left_out:
            return told
        return f"{told}; this machine has {', '.join(self.left_out)}, too: build with MRWORK_BUILD_SETS=all"

    def _summary(self) -> Summary:
        facts = {"used": self.used, "built": ", ".join(self.built), "machine": ", ".join(self.machine)}
        notes = (
            [f"build from source with MRWORK_BUILD_SETS=all for {', '.join(self.left_out)}"]
            if self.left_out
            else []
        )
        return Summary(title="Instruction sets", facts=list(facts.items()), notes=notes)


def instruction_set() -> InstructionSets:
    """Tell with which vector instructions simulations run, and which this build and this machine have.

    Returns
    -------
    InstructionSets
        `MRWORK_INSTRUCTION_SET` chooses another one that is built; a build from source with `MRWORK_BUILD_SETS=all` has
        every set of the architecture.
    """
    built, machine = _rust.instruction_sets()
    try:
        used = _rust.instruction_set()
    except ValueError as error:
        raise SettingError(str(error)) from None
    return InstructionSets(used=used, built=tuple(built), machine=tuple(machine))
