"""Equations of a damper of the user: Python text that stands for them wherever they go, and the gate before it runs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import cache, partial
from typing import Any

from mrwork.errors import SettingError
from mrwork.store.codec import digest_of
from mrwork.store.user_python import run_text

OwnFunctions = tuple[Callable[..., Any], Callable[..., Any] | None, Callable[..., Any] | None]
"""Force, rate and relaxation."""

# Equations that may run in this process, by their digest, and what is called before others run, if they may.
_TRUSTED: dict[str, OwnEquations] = {}
_announce: Callable[[str], None] | None = None


def trust_others(announce: Callable[[str], None]) -> None:
    """Let all equations run in this process from now on; each is announced in a sentence before it does."""
    global _announce  # one answer for a process
    _announce = announce


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnEquations:
    """A text in Python that is complete in itself, and the names of the functions in it, see `mrwork.own_damper`.

    It runs only where it is trusted: because it was written in this process, or came from one that trusts it by an
    executor, or because the user says so.
    """

    source: str
    force: str
    rate: str | None = None
    relaxation: str | None = None

    @property
    def digest(self) -> str:
        """Digest of text and function names, which tells the equations from others of the same name."""
        return digest_of(self.source, self.force, self.rate, self.relaxation)

    def trust(self) -> None:
        """Let the text run in this process."""
        _TRUSTED[self.digest] = self

    @property
    def is_trusted(self) -> bool:
        """Whether the text may run in this process."""
        if self.digest not in _TRUSTED and _announce is not None:
            _announce(
                f"running the equations of a damper of its user as Python: {self.force}, {self.digest[:8]}"
            )
            self.trust()
        return self.digest in _TRUSTED

    def functions(self) -> OwnFunctions:
        """Force, rate and relaxation; the text runs once in a process.

        Raises
        ------
        SettingError
            If it is not trusted.
        """
        if not self.is_trusted:
            namesake = any(equations.force == self.force for equations in _TRUSTED.values())
            changed = (
                "; those of that name that run here are others: they were changed since" if namesake else ""
            )
            raise SettingError(
                f"the equations of this damper are Python of its user ({self.force}, {self.digest[:8]}), which runs "
                f"with your rights{changed}; read them, and let them run by --trust, by --model FILE.py:NAME of the "
                "same file, or in Python by mr.load(run, trust=True)"
            )
        return _run(self)

    def __reduce__(self) -> tuple[Any, ...]:
        """What a process that is trusted sends to another is trusted there: a pickle runs code as it is."""
        return _received, (asdict(self), self.is_trusted)


def _received(fields: dict[str, Any], trusted: bool) -> OwnEquations:
    equations = OwnEquations(**fields)
    if trusted:
        equations.trust()
    return equations


@cache
def _run(equations: OwnEquations) -> OwnFunctions:
    names = vars(run_text(equations.source, f"<equations of {equations.force}>"))
    # What is printed while they are traced does not belong to the output of a command.
    names["print"] = partial(print, file=sys.stderr)
    return names[equations.force], names.get(equations.rate or ""), names.get(equations.relaxation or "")
