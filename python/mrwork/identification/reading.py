"""How tests were read from their files, so that they can be read again in the same way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from mrwork.errors import RecordError
from mrwork.records import DamperTest, read_damper_test, repair
from mrwork.records.repairs import RepairKind
from mrwork.records.window import counted_from, cut
from mrwork.synthetic import synthetic_test

_SYNTHETIC = "synthetic:"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """Files of one run, and what was done to each: cut, then repaired, then told from when it counts.

    `columns` and `repairs` are as in `read_damper_test` and `repair`, a repair without an amount `None`; `start`, `end`
    and `settle` in seconds. Relative `files` are relative to the `folder` they were read in.
    """

    files: tuple[str, ...]
    folder: str = ""
    columns: Mapping[str, str] = field(default_factory=dict)
    start: float | None = None
    end: float | None = None
    every: int = 1
    repairs: Mapping[RepairKind, float | None] = field(default_factory=dict)
    settle: float | None = None

    def as_record(self) -> dict[str, Any]:
        """Plain values, for `fit.json`."""
        return asdict(self)

    @classmethod
    def of_record(cls, record: object, *, origin: str) -> Reading:
        """Undo `as_record`; `origin` names the place in messages.

        Raises
        ------
        RecordError
            Where the record is not one of a reading.
        """
        try:
            fields = dict(record)  # type: ignore[call-overload] # whatever it is, the next lines find out
            return cls(**(fields | {"files": tuple(fields["files"])}))
        except (TypeError, ValueError, KeyError):
            raise RecordError(
                f"{origin} does not say how its tests were read; run `mrwork identify` again"
            ) from None

    def tests(self) -> tuple[DamperTest, ...]:
        """Read them.

        Raises
        ------
        RecordError
            Where a file cannot be read as a test.
        SettingError
            Where a window or a repair leaves too little of it.
        """
        return tuple(self._read(file) for file in self.files)

    def _read(self, file: str) -> DamperTest:
        if file.startswith(_SYNTHETIC):
            test = synthetic_test(file.removeprefix(_SYNTHETIC))
        else:
            test = read_damper_test(self._place(file), columns=self.columns or None)
        if (self.start, self.end, self.every) != (None, None, 1):
            test = cut(test, start=self.start, end=self.end, every=self.every)
        amounts = {kind: amount for kind, amount in self.repairs.items() if amount is not None}
        test, _ = repair(test, self.repairs, amounts=amounts)
        return test if self.settle is None else counted_from(test, self.settle)

    def _place(self, file: str) -> str:
        """The file from here, or else from where it was read."""
        return file if Path(file).exists() or not self.folder else str(Path(self.folder) / file)
