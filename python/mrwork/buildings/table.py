"""Access to a parsed table: values of a requested type, or an error that names the place of the entry."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from difflib import get_close_matches
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import MrworkError
from mrwork.keys import Place, shown

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Entries:
    """A parsed table and its place in a document.

    Every method raises a SettingError if a value is missing or of another type.
    """

    table: Mapping[str, object]
    place: Place

    def __contains__(self, key: str) -> bool:
        return key in self.table

    def refuse(self, sentence: str, *keys: str) -> NoReturn:
        """Raise an error that begins with the place of a key."""
        self.place.within(*keys).refuse(sentence)

    def allow(self, known: Sequence[str]) -> None:
        """Check that all keys are among those known."""
        for key in self.table:
            if key not in known:
                near = get_close_matches(key, known, n=1)
                hint = f"did you mean {near[0]}?" if near else f"there are {', '.join(known)}"
                self.refuse(f"there is no key {key!r}; {hint}", key)

    def number(self, key: str, default: float | None = None) -> float:
        """Return a number."""
        value = self._get(key, "a number", default)
        if isinstance(value, bool) or not isinstance(value, int | float):
            self.refuse(f"{key} is {shown(value)}; give a number", key)
        return float(value)

    def whole(self, key: str, default: int | None = None) -> int:
        """Return a whole number."""
        value = self._get(key, "a whole number", default)
        if isinstance(value, bool) or not isinstance(value, int):
            self.refuse(f"{key} is {shown(value)}; give a whole number", key)
        return value

    def text(self, key: str, default: str | None = None) -> str:
        """Return a text."""
        value = self._get(key, "a text", default)
        if not isinstance(value, str):
            self.refuse(f"{key} is {shown(value)}; give a text in quotes", key)
        return value

    def floor(self, key: str) -> int | str:
        """Return the number or name of a floor or storey."""
        value = self._get(key, "its number from 1 or its name")
        if isinstance(value, bool) or not isinstance(value, int | str):
            self.refuse(f"{key} is {shown(value)}; give its number from 1 or its name", key)
        return value

    def numbers(self, key: str) -> tuple[float, ...]:
        """Return an array of numbers."""
        value = self._get(key, "numbers, as [1.0, 2.0]")
        if not isinstance(value, list) or not all(_is_number(each) for each in value):
            self.refuse(f"{key} is {shown(value)}; give numbers, as [1.0, 2.0]", key)
        return tuple(float(each) for each in value)

    def texts(self, key: str) -> tuple[str, ...]:
        """Return an array of texts."""
        value = self._get(key, 'texts, as ["a", "b"]')
        if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
            self.refuse(f'{key} is {shown(value)}; give texts, as ["a", "b"]', key)
        return tuple(value)

    def rows(self, key: str) -> Floats:
        """Return a matrix, given row by row."""
        value = self._get(key, "rows of numbers")
        example = "give rows of numbers, as [[2.0, -1.0], [-1.0, 1.0]]"
        if not isinstance(value, list) or not value or not all(isinstance(row, list) for row in value):
            self.refuse(f"{key} is {shown(value)}; {example}, or the name of a file", key)
        for number, row in enumerate(value, start=1):
            if len(row) != len(value[0]) or not all(_is_number(each) for each in row):
                self.refuse(f"row {number} of {key} is not {len(value[0])} numbers; {example}", key)
        return np.array(value, dtype=np.float64)

    def inner(self, key: str) -> Entries:
        """Return a nested table."""
        value = self._get(key, "a table")
        if not isinstance(value, dict):
            self.refuse(f"{key} is {shown(value)}; give a table, as [{key}]", key)
        return Entries(value, self.place.within(key))

    def inner_all(self, key: str) -> tuple[Entries, ...]:
        """Return the tables of an array, none if the key is absent; a single table counts as an array of one."""
        value = self.table.get(key, [])
        tables = [value] if isinstance(value, dict) else value
        if not isinstance(tables, list) or not all(isinstance(each, dict) for each in tables):
            self.refuse(f"{key} is {shown(value)}; give one or more tables, as [[{key}]]", key)
        if isinstance(value, dict):
            return (Entries(value, self.place.within(key)),)
        return tuple(Entries(each, self.place.within(key, number)) for number, each in enumerate(tables))

    @contextmanager
    def placed(self) -> Iterator[None]:
        """Context manager that prefixes errors with this place."""
        try:
            yield
        except MrworkError as error:
            raise type(error)(f"{self.place}: {error}") from error

    def _get(self, key: str, wanted: str, default: object = None) -> object:
        value = self.table.get(key, default)
        if value is None:
            self.refuse(f"{key} is missing; give {wanted}")
        return value


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
