"""What a law of the user computes: its function for rows of runs, its memory, and its settings by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mrwork.base.values import Floats, array_dataclass

RowsCommand = Callable[[Any, Any, Any], Any]
"""Takes a `LoopSample`, the memory and the settings of each run, shapes (n_runs, ...), and returns the commands."""


@array_dataclass()
class OwnFormula:
    """A law of the user.

    Attributes
    ----------
    name
        Name in messages.
    function
        What the user has written: its text is looked at, and its file and line are told.
    rows
        Makes of the function, or of a copy of it, one for rows of runs.
    start
        Memory at the start, shape (n_memory,).
    names
        Entries of the settings in the order of the columns that it takes, as "gain[0]".
    rms_time
        Time constant of the running root mean squares of the readings [s], `None` for none.
    given
        The other arguments of `own_law`, as Python has them.
    record
        Whether it must be recorded, or must not be; `None` where it can be.
    """

    name: str
    function: Callable[..., Any]
    rows: Callable[[Callable[..., Any]], RowsCommand]
    start: Floats
    names: tuple[str, ...] = ()
    rms_time: float | None = None
    given: str = ""
    record: bool | None = None

    @property
    def command(self) -> RowsCommand:
        """The function for rows of runs."""
        return self.rows(self.function)
