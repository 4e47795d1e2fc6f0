"""Results as arrays with names, axes, units and words: what `to_xarray` and `to_pandas` of every result return.

A class inherits `WithAxes` and declares its arrays in `_named_arrays`. xarray and pandas are imported here, when one of
the two is called, and nowhere else but for the files of a posterior and the points of a figure.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.base.table import Column
from mrwork.base.values import array_dataclass

if TYPE_CHECKING:
    from pandas import DataFrame as DataFrame
    from xarray import Dataset as Dataset
    from xarray import DataTree as DataTree


@array_dataclass()
class NamedArray:
    """Values over named axes, in a unit; `long_name` says in words what they are. Labels along an axis name no axes."""

    values: NDArray[Any]
    axes: tuple[str, ...]
    unit: str = ""
    long_name: str = ""

    @classmethod
    def of(
        cls, values: ArrayLike | Sequence[float | str | None], *axes: str, unit: str = "", long_name: str = ""
    ) -> NamedArray:
        """Values as they come; numbers that are `None` become NaN."""
        listed: Any = values
        if isinstance(listed, list | tuple) and any(entry is None for entry in listed):
            listed = [np.nan if entry is None else entry for entry in listed]
        return cls(values=np.asarray(listed), axes=axes, unit=unit, long_name=long_name)

    @property
    def attributes(self) -> dict[str, str]:
        """Unit and words by the names that xarray and CF use, where they are not empty."""
        named = {"units": self.unit, "long_name": self.long_name}
        return {name: text for name, text in named.items() if text}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class NamedArrays:
    """Arrays by name, with the labels along each axis.

    `rows` are the axes of the rows of a table, which has the arrays over these; a further axis of an array becomes
    columns. `along` are further labels, such as the unit of each parameter, which belong to the rows, too.
    """

    title: str
    rows: tuple[str, ...]
    labels: Mapping[str, NamedArray]
    arrays: Mapping[str, NamedArray]
    along: Mapping[str, NamedArray] = field(default_factory=dict)

    def to_xarray(self) -> Dataset:
        """A variable for each array, with its unit and words as attributes."""
        from xarray import Dataset

        labels = {axis: ((axis,), label.values, label.attributes) for axis, label in self.labels.items()}
        arrays, along = (
            {name: (array.axes, array.values, array.attributes) for name, array in group.items()}
            for group in (self.arrays, self.along)
        )
        return Dataset(arrays, coords=labels | along, attrs={"title": self.title})

    def to_pandas(self) -> DataFrame:
        """A table with a row for each place along `rows`; units and words are in its `attrs`, by column."""
        from pandas import DataFrame, Index, MultiIndex

        shape = tuple(self.labels[axis].values.size for axis in self.rows)
        shown = {
            name: array
            for name, array in {**self.along, **self.arrays}.items()
            if set(self.rows) <= set(array.axes) or (name in self.along and set(array.axes) <= set(self.rows))
        }
        depth = max((len(array.axes) - len(self.rows) for array in shown.values()), default=0)
        columns: dict[Any, NDArray[Any]] = {}
        for name, array in shown.items():
            further = [axis for axis in array.axes if axis not in self.rows]
            row_axes = [axis for axis in self.rows if axis in array.axes]
            values = np.transpose(array.values, [array.axes.index(axis) for axis in (*row_axes, *further)])
            # A label along some axes of the rows is repeated along the others.
            wide = np.expand_dims(values, [n for n, axis in enumerate(self.rows) if axis not in row_axes])
            flat = np.broadcast_to(wide, (*shape, *wide.shape[len(shape) :])).reshape(math.prod(shape), -1)
            labels = product(*(self.labels[axis].values.tolist() for axis in further))
            for number, label in enumerate(labels):
                filled = (name, *label, *[""] * (depth - len(further)))
                columns[filled if depth else name] = flat[:, number]
        rows = [Index(self.labels[axis].values, name=axis) for axis in self.rows]
        table = DataFrame(columns, index=rows[0] if len(rows) == 1 else MultiIndex.from_product(rows))
        if depth:
            table.columns = MultiIndex.from_tuples(list(columns), names=["", *[""] * depth])
        table.attrs = {
            "title": self.title,
            "units": {name: array.unit for name, array in shown.items() if array.unit},
            "long_name": {name: array.long_name for name, array in shown.items() if array.long_name},
        }
        return table


class WithAxes:
    """A result that xarray and pandas can have, with the names, axes and units that its class declares."""

    __slots__ = ()

    def _named_arrays(self) -> NamedArrays:
        raise NotImplementedError

    def to_xarray(self) -> Dataset:
        """The numbers over named axes as a `Dataset`, with unit and words of each as attributes."""
        return self._named_arrays().to_xarray()

    def to_pandas(self) -> DataFrame:
        """The numbers as a `DataFrame`: a row for each place along the main axes, further axes as columns.

        Units and words are in `attrs["units"]` and `attrs["long_name"]` by column.
        """
        return self._named_arrays().to_pandas()


def columns_of(rows: Sequence[object], axis: str, columns: Iterable[Column]) -> dict[str, NamedArray]:
    """The columns that say in words what they are, each an array over the axis of the rows."""
    return {
        column.key: NamedArray.of(
            [column.value(row) for row in rows], axis, unit=column.unit, long_name=column.words
        )
        for column in columns
        if column.words
    }


def tree_of(title: str, groups: Mapping[str, Dataset]) -> DataTree:
    """Several data sets, each with axes of its own."""
    from xarray import DataTree

    return DataTree.from_dict(groups, name=title)
