"""Arrays whose numbers are cells of a recording: what NumPy does with them is written down.

A `Traced` array takes the place of an array in a call of a function (`__array_ufunc__`, `__array_function__`).
Functions that move numbers run on the cells as they are; those that compute are written out by the operations of the
core. What asks for a value is refused, with what to write instead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import reduce
from typing import Any, Final, Literal

import numpy as np
from numpy.lib.mixins import NDArrayOperatorsMixin

from mrwork.base import recording as rec
from mrwork.base.elementwise import ARITHMETIC, CONDITIONS, IN_WORDS, OF_TRUTHS, SCALARS
from mrwork.base.recording import Cell, NotRecordedError, Recording, put

Kind = Literal["truth", "whole", "number"]

_BRANCH = (
    "`if`, `and`, `or`, `min()` or `max()` of Python looks at a value that is known only in the loop; write "
    "np.where(condition, a, b), np.minimum or np.maximum"
)
_FILLED = (
    "np.asarray, np.array or an array of NumPy that is filled asks for values that are known only in the loop; fill "
    "np.zeros_like of an argument, as of sample.rate, or write np.stack([...])"
)
_INDEX = (
    "a table of NumPy is indexed by a value that is known only in the loop; write np.choose(place, table), np.select "
    "or np.interp"
)


def bare(value: Any) -> Any:
    """The cells of an array, of rows of arrays or of a number, as an array of NumPy."""
    if isinstance(value, Traced):
        return value.cells
    if isinstance(value, (list, tuple)) and _has_traced(value):
        parts = [bare(each) for each in value]
        stacked = np.empty((len(parts), *np.shape(parts[0])), dtype=object)
        for place, part in enumerate(parts):
            stacked[place] = part[()]
        return stacked
    return np.asarray(value)


def _has_traced(values: Sequence[Any]) -> bool:
    return any(
        isinstance(each, Traced) or (isinstance(each, (list, tuple)) and _has_traced(each)) for each in values
    )


def _kind_of(value: Any) -> Kind:
    if isinstance(value, Traced):
        return value.kind
    kind = np.asarray(value).dtype.kind
    return "truth" if kind == "b" else "whole" if kind in "iu" else "number"


def wrap(cells: Any, kind: Kind = "number") -> Traced:
    """An array of cells."""
    return Traced(np.asarray(cells, dtype=object), kind)


def inputs(recording: Recording, name: str, shape: tuple[int, ...]) -> Traced:
    """An array of inputs of a recording, with places in its order."""
    cells = np.empty(shape, dtype=object)
    for place, at in enumerate(np.ndindex(*shape)):
        cells[at] = recording.input(name, place)
    return Traced(cells)


def _each(scalar: Callable[..., Any], *of: Any) -> Any:
    """What a function of numbers makes of each number of arrays."""
    return np.asarray(np.frompyfunc(scalar, len(of), 1)(*map(bare, of)), dtype=object)


def _refuse(name: str) -> NotRecordedError:
    return NotRecordedError(f"np.{name} is none of the operations of the core, which are {IN_WORDS}")


class Traced(NDArrayOperatorsMixin):
    """An array of cells; its kind says whether they are truths, whole numbers or any."""

    __slots__ = ("cells", "kind")

    def __init__(self, cells: Any, kind: Kind = "number") -> None:
        self.cells, self.kind = cells, kind

    shape = property(lambda self: self.cells.shape)
    ndim = property(lambda self: self.cells.ndim)
    size = property(lambda self: self.cells.size)
    T = property(lambda self: Traced(self.cells.T, self.kind))

    @property
    def dtype(self) -> np.dtype[Any]:
        """As NumPy has it."""
        return np.dtype({"truth": bool, "whole": int, "number": float}[self.kind])

    def __array_ufunc__(self, function: Any, method: str, *of: Any, **more: Any) -> Any:
        kinds = [_kind_of(each) for each in of]
        out = more.pop("out", None)
        if more.pop("where", True) is not True or more.keys() - {
            "axis",
            "keepdims",
            "dtype",
            "casting",
            "initial",
        }:
            raise NotRecordedError(
                f"np.{function.__name__} with `where` is not recorded; write np.where(condition, a, b)"
            )
        if out is not None and not all(isinstance(each, Traced) for each in out):
            raise NotRecordedError(_FILLED)
        if function is np.matmul:
            found = Traced(_product(*of))
        elif method == "__call__":
            found = _called(function, of, kinds)
        elif method in ("reduce", "accumulate", "outer") and function in SCALARS:
            of = (wrap(_each(rec.truth, of[0]), "truth"), *of[1:]) if function in _OF_TRUTH else of
            cells = _folded(
                function, method, *map(bare, of), axis=more.get("axis", 0), keepdims=more.get("keepdims")
            )
            found = wrap(cells, _result(function, kinds))
        else:
            raise _refuse(function.__name__)
        if out is None:
            return found
        # x += y changes the array that the caller has.
        out[0].cells[...] = found.cells
        return out[0]

    def __array_function__(self, function: Any, types: Any, of: Any, more: Any) -> Any:
        if function in _WRITTEN_OUT:
            return _WRITTEN_OUT[function](*of, **more)
        if function in _MOVES:
            kinds = {_kind_of(each) for each in _arrays_in(of)}
            made = function(*map(_bare_all, of), **{name: _bare_all(value) for name, value in more.items()})
            kind: Kind = kinds.pop() if len(kinds) == 1 else "number"
            return (
                [wrap(part, kind) for part in made] if isinstance(made, (list, tuple)) else wrap(made, kind)
            )
        try:
            return function.__wrapped__(*of, **more)
        except (AttributeError, NotRecordedError):
            raise _refuse(function.__name__) from None

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise NotRecordedError(_INDEX if self.kind == "whole" else _FILLED)

    def __getitem__(self, at: Any) -> Traced:
        if isinstance(at, Traced):
            return self._masked(at) if at.kind == "truth" else _taken(self.cells, at, self.kind)
        if isinstance(at, tuple) and any(isinstance(each, Traced) for each in at):
            raise NotRecordedError(_INDEX)
        return wrap(self.cells[at], self.kind)

    def _masked(self, _: Traced) -> Traced:
        raise NotRecordedError(
            "x[condition] has a size that is known only in the loop; write np.where(condition, x, other)"
        )

    def __setitem__(self, at: Any, value: Any) -> None:
        if isinstance(at, Traced) and at.kind == "truth":
            condition = at.cells.reshape(at.shape + (1,) * (self.ndim - at.ndim))
            self.cells[...] = _each(rec.choose, condition, value, self)
        elif isinstance(at, Traced) or (
            isinstance(at, tuple) and any(isinstance(each, Traced) for each in at)
        ):
            raise NotRecordedError(_INDEX)
        else:
            self.cells[at] = bare(value)[()]

    def __len__(self) -> int:
        return len(self.cells)

    def __iter__(self) -> Iterator[Traced]:
        return (wrap(each, self.kind) for each in self.cells)

    def __bool__(self) -> bool:
        return bool(self._known(_BRANCH))

    def __float__(self) -> float:
        return float(
            self._known(
                "float(), a function of math or a cell of an array of NumPy asks for a value that is known only in the "
                "loop; write the function of np, and fill np.zeros_like of an argument, as of sample.rate"
            )
        )

    def __int__(self) -> int:
        return int(
            self._known("int() asks for a value that is known only in the loop; write np.trunc or np.floor")
        )

    def __index__(self) -> int:
        return int(self._known(_INDEX))

    def __round__(self, digits: int | None = None) -> Any:
        if digits:
            raise NotRecordedError("round() to digits is not recorded; write np.rint(100.0 * x) / 100.0")
        return (
            np.rint(self)
            if digits is not None
            else int(self._known("round() asks for a value that is known only in the loop; write np.rint"))
        )

    def _known(self, otherwise: str) -> Any:
        """Its one number, if that does not depend on inputs."""
        cells = self.cells.ravel()
        if len(cells) == 1 and not isinstance(cells[0], Cell):
            return cells[0]
        raise NotRecordedError(otherwise)

    __hash__ = None  # type: ignore[assignment]

    def sum(self, axis: Any = None, keepdims: bool = False) -> Any:
        """As NumPy."""
        return _reduced(np.add, self, axis=axis, keepdims=keepdims)

    def prod(self, axis: Any = None) -> Any:
        """As NumPy."""
        return _reduced(np.multiply, self, axis=axis)

    def mean(self, axis: Any = None, keepdims: bool = False) -> Any:
        """As NumPy."""
        return _mean(self, axis=axis, keepdims=keepdims)

    def min(self, axis: Any = None) -> Any:
        """As NumPy."""
        return _reduced(np.minimum, self, axis=axis)

    def max(self, axis: Any = None) -> Any:
        """As NumPy."""
        return _reduced(np.maximum, self, axis=axis)

    def any(self, axis: Any = None) -> Any:
        """As NumPy."""
        return _reduced(np.logical_or, self, axis=axis)

    def all(self, axis: Any = None) -> Any:
        """As NumPy."""
        return _reduced(np.logical_and, self, axis=axis)

    def reshape(self, *shape: Any) -> Traced:
        """As NumPy."""
        return Traced(self.cells.reshape(*shape), self.kind)

    def ravel(self) -> Traced:
        """As NumPy."""
        return Traced(self.cells.ravel(), self.kind)

    def copy(self) -> Traced:
        """As NumPy."""
        return Traced(self.cells.copy(), self.kind)

    def squeeze(self, axis: Any = None) -> Traced:
        """As NumPy."""
        return Traced(self.cells.squeeze(axis), self.kind)

    def transpose(self, *axes: Any) -> Traced:
        """As NumPy."""
        return Traced(self.cells.transpose(*axes), self.kind)

    def astype(self, dtype: Any, **_: Any) -> Traced:
        """As NumPy: truths where a number is not zero, whole numbers towards zero."""
        kind = np.dtype(dtype).kind
        if kind == "b":
            return wrap(_each(rec.truth, self), "truth")
        if kind in "iu":
            return self if self.kind == "whole" else wrap(_each(rec.trunc, self), "whole")
        return Traced(self.cells.copy())

    def dot(self, other: Any) -> Any:
        """As NumPy."""
        return np.dot(self, other)

    def clip(self, lower: Any = None, upper: Any = None) -> Any:
        """As NumPy."""
        return _clip(self, lower, upper)

    def argmin(self, axis: Any = None) -> Any:
        """As NumPy."""
        return _place_of_best(self, axis)

    def argmax(self, axis: Any = None) -> Any:
        """As NumPy."""
        return _place_of_best(self, axis, rec.larger)


def _called(function: Any, of: Sequence[Any], kinds: Sequence[Kind]) -> Traced:
    if all(kind == "truth" for kind in kinds):
        function = OF_TRUTHS.get(function, function)
        if function in (np.subtract, np.negative):
            raise NotRecordedError(f"np.{function.__name__} takes no conditions; write np.logical_not or ~")
    if function not in SCALARS:
        raise _refuse(function.__name__)
    return wrap(_each(SCALARS[function], *of), _result(function, kinds))


def _result(function: Any, kinds: Sequence[Kind]) -> Kind:
    if function in CONDITIONS or (function in (np.minimum, np.maximum) and {*kinds} == {"truth"}):
        return "truth"
    return "whole" if function in ARITHMETIC and "number" not in kinds else "number"


def _reduced(function: Any, a: Any, axis: Any = None, keepdims: Any = False) -> Any:
    return function.reduce(a, axis=axis, keepdims=bool(keepdims))


_EMPTY: Final = {np.add: 0.0, np.multiply: 1.0}
_OF_TRUTH: Final = (np.logical_and, np.logical_or)


def _folded(function: Any, method: str, *of: Any, axis: Any, keepdims: Any) -> Any:
    """Numbers along an axis in one, or all in one without an axis."""
    general = np.frompyfunc(SCALARS[function], function.nin, 1)
    if method == "outer":
        return general.outer(*of)
    cells = of[0]
    if method == "accumulate":
        return general.accumulate(cells, axis=axis)
    axes = tuple(range(cells.ndim)) if axis is None else tuple(np.atleast_1d(axis))
    shape = [
        1 if each in axes or each - cells.ndim in axes else size for each, size in enumerate(cells.shape)
    ]
    cells = np.moveaxis(cells, axes, range(len(axes)))
    cells = cells.reshape(-1, *cells.shape[len(axes) :])
    start = {"initial": _EMPTY[function]} if len(cells) == 0 and function in _EMPTY else {}
    folded = np.asarray(general.reduce(cells, axis=0, **start), dtype=object)
    return folded.reshape(shape) if keepdims else folded


def _product(a: Any, b: Any) -> Any:
    """a @ b of vectors and matrices, and of stacks of them without the fused order."""
    a, b = bare(a), bare(b)
    if not (1 <= a.ndim <= 2 and 1 <= b.ndim <= 2) or a.shape[-1] != b.shape[0]:
        return np.matmul(a.astype(object), b.astype(object))
    rows, columns = np.atleast_2d(a), b[:, None] if b.ndim == 1 else b
    found = np.empty((len(rows), columns.shape[1]), dtype=object)
    for i, j in np.ndindex(*found.shape):
        found[i, j] = rec.dot(rows[i], columns[:, j])
    return found.reshape(a.shape[:-1] + b.shape[1:])


def _taken(rows: Any, place: Traced, kind: Kind, axis: int | None = 0) -> Traced:
    """Rows at places that are known only in the loop; one that is not there is no number."""
    if place.kind == "number":
        raise NotRecordedError("an index is no whole number; write np.floor(x).astype(int)")
    rows = np.ravel(rows) if axis is None else np.moveaxis(rows, axis, 0)

    def row_at(at: Any) -> Any:
        at = rec.choose(rec.less(at, 0.0), put("add", at, float(len(rows))), at)
        found: Any = np.full(rows.shape[1:], math.nan, dtype=object)
        for k in range(len(rows)):
            found = _each(rec.choose, wrap(put("equal", at, float(k))), rows[k], found)
        return found

    found = np.empty(place.shape + rows.shape[1:], dtype=object)
    for at in np.ndindex(*place.shape):
        found[at] = row_at(place.cells[at])[()]
    return wrap(found, kind)


def _arrays_in(values: Any) -> Iterator[Any]:
    for each in values:
        if isinstance(each, (list, tuple)):
            yield from _arrays_in(each)
        elif isinstance(each, (Traced, np.ndarray)):
            yield each


def _bare_all(value: Any) -> Any:
    if isinstance(value, Traced):
        return value.cells
    if isinstance(value, (list, tuple)):
        return type(value)(_bare_all(each) for each in value)
    return value


def _mean(a: Any, axis: Any = None, keepdims: Any = False, **_: Any) -> Any:
    count = bare(a).size if axis is None else np.prod([bare(a).shape[each] for each in np.atleast_1d(axis)])
    return _reduced(np.add, a, axis=axis, keepdims=bool(keepdims)) / float(count)


def _clip(a: Any, a_min: Any = None, a_max: Any = None, *, min: Any = None, max: Any = None, **_: Any) -> Any:
    lower, upper = (a_min if min is None else min), (a_max if max is None else max)
    found = a if lower is None else np.maximum(a, lower)
    return found if upper is None else np.minimum(found, upper)


def _place_of_best(x: Any, axis: Any = None, better: Any = rec.smaller) -> Traced:
    cells = bare(x)
    rows = (
        cells.ravel()[:, None] if axis is None else np.moveaxis(cells, axis, 0).reshape(cells.shape[axis], -1)
    )

    def best(row: Any) -> Any:
        at, least = 0.0, row[0]
        for k, value in enumerate(row[1:], 1):
            is_better = rec.less(value, least) if better is rec.smaller else rec.less(least, value)
            at, least = rec.choose(is_better, float(k), at), rec.choose(is_better, value, least)
        return at

    found = np.empty(rows.shape[1], dtype=object)
    for column in range(rows.shape[1]):
        found[column] = best(rows[:, column])
    shape = () if axis is None else tuple(np.delete(cells.shape, axis))
    return wrap(found.reshape(shape), "whole")


def _interp(x: Any, xp: Any, fp: Any, left: Any = None, right: Any = None, period: Any = None) -> Traced:
    if period is not None or isinstance(xp, Traced):
        raise NotRecordedError(
            "np.interp is recorded without a period, at places that are known before the loop"
        )
    places, values = np.asarray(xp, dtype=float), bare(fp).ravel()
    left, right = (values[0] if left is None else left), (values[-1] if right is None else right)
    return wrap(_each(lambda at: rec.interpolated(at, places, values, left, right), x))


def _select(conditions: Sequence[Any], choices: Sequence[Any], default: Any = 0.0) -> Any:
    pairs = list(zip(conditions, choices, strict=True))[::-1]
    return reduce(lambda otherwise, pair: np.where(pair[0], pair[1], otherwise), pairs, default)


def _where(condition: Any, x: Any = None, y: Any = None) -> Traced:
    if x is None or y is None:
        raise NotRecordedError(
            "np.where(condition) has a size that is known only in the loop; write np.where(condition, a, b)"
        )
    kinds = {_kind_of(x), _kind_of(y)}
    return wrap(_each(rec.choose, condition, x, y), kinds.pop() if len(kinds) == 1 else "number")


def _bins(x: Any, bins: Any, *, right: bool) -> Traced:
    """Number of rising bins that a value has reached."""
    edges = np.asarray(bins, dtype=float)
    if (np.diff(edges) < 0.0).any():
        raise NotRecordedError("np.digitize is recorded with rising bins")

    def number(a: Any) -> Any:
        reached = (rec.less(float(edge), a) if right else rec.at_most(float(edge), a) for edge in edges)
        counted = reduce(lambda sum_, each: put("add", sum_, each), reached, 0.0)
        # What is not a number is sorted last.
        return rec.choose(rec.is_none(a), float(len(edges)), counted)

    return wrap(_each(number, x), "whole")


def _nan_to_num(
    x: Any, _copy: bool = True, nan: float = 0.0, posinf: Any = None, neginf: Any = None
) -> Traced:
    most = float(np.finfo(float).max)
    above, below = most if posinf is None else posinf, -most if neginf is None else neginf

    def known(a: Any) -> Any:
        infinite = rec.choose(
            put("equal", a, math.inf), above, rec.choose(put("equal", a, -math.inf), below, a)
        )
        return rec.choose(rec.is_none(a), nan, infinite)

    return wrap(_each(known, x))


def _norm(x: Any, ord: Any = None, axis: Any = None, keepdims: bool = False) -> Any:
    if ord not in (None, 2):
        raise NotRecordedError(
            "np.linalg.norm is recorded as the root of a sum of squares; write out another one"
        )
    return np.sqrt(_reduced(np.add, np.square(x), axis=axis, keepdims=keepdims))


def _choose(a: Any, choices: Any, **_: Any) -> Traced:
    found: Any = np.asarray(math.nan, dtype=object)
    for k, choice in enumerate(choices):
        is_this = _each(lambda at, number=float(k): put("equal", at, number), a)
        found = _each(rec.choose, is_this, choice, found)
    return wrap(found)


def _differences(a: Any, n: int = 1, axis: int = -1) -> Any:
    for _ in range(n):
        rows = np.moveaxis(bare(a), axis, 0)
        a = np.moveaxis(wrap(rows[1:]) - wrap(rows[:-1]), 0, axis)
    return a


def _polynomial(p: Any, x: Any) -> Any:
    found: Any = np.zeros_like(x)
    for coefficient in p:
        found = found * x + coefficient
    return found


def _take(a: Any, indices: Any, axis: int | None = None, **_: Any) -> Traced:
    if not isinstance(indices, Traced):
        return wrap(np.take(bare(a), indices, axis=axis), _kind_of(a))
    return _taken(bare(a), indices, _kind_of(a), axis)


def _like(fill: float) -> Callable[..., Traced]:
    def like(a: Any, dtype: Any = None, **_: Any) -> Traced:
        made = np.full(bare(a).shape, fill, dtype=object)
        return wrap(made, _kind_of(np.empty(0, dtype or (a.dtype if isinstance(a, Traced) else float))))

    return like


def _full_like(a: Any, value: Any, **_: Any) -> Traced:
    return wrap(np.broadcast_to(bare(value), bare(a).shape).copy(), _kind_of(a))


def _is_close(a: Any, b: Any, rtol: float = 1e-5, atol: float = 1e-8, **_: Any) -> Any:
    return np.abs(a - b) <= atol + rtol * np.abs(b)


_WRITTEN_OUT: Final[dict[Any, Callable[..., Any]]] = {
    np.where: _where,
    np.select: _select,
    np.clip: _clip,
    np.interp: _interp,
    np.argmin: _place_of_best,
    np.argmax: lambda a, axis=None: _place_of_best(a, axis, rec.larger),
    np.linalg.norm: _norm,
    np.sum: lambda a, axis=None, keepdims=False, **_: _reduced(np.add, a, axis=axis, keepdims=keepdims),
    np.prod: lambda a, axis=None, **_: _reduced(np.multiply, a, axis=axis),
    np.min: lambda a, axis=None, **_: _reduced(np.minimum, a, axis=axis),
    np.max: lambda a, axis=None, **_: _reduced(np.maximum, a, axis=axis),
    np.mean: _mean,
    np.average: lambda a, axis=None, weights=None: (
        _mean(a, axis) if weights is None else np.sum(a * weights, axis=axis) / np.sum(weights)
    ),
    np.any: lambda a, axis=None, **_: _reduced(np.logical_or, a, axis=axis),
    np.all: lambda a, axis=None, **_: _reduced(np.logical_and, a, axis=axis),
    np.cumsum: lambda a, axis=None, **_: np.add.accumulate(
        a.ravel() if axis is None else a, axis=0 if axis is None else axis
    ),
    np.shape: lambda a: bare(a).shape,
    np.ndim: lambda a: bare(a).ndim,
    np.size: lambda a, axis=None: bare(a).size if axis is None else bare(a).shape[axis],
    np.zeros_like: _like(0.0),
    np.empty_like: _like(math.nan),
    np.ones_like: _like(1.0),
    np.full_like: _full_like,
    np.digitize: lambda x, bins, right=False: _bins(x, bins, right=right),
    np.searchsorted: lambda a, v, side="left", sorter=None: _bins(v, a, right=side == "left"),
    np.nan_to_num: _nan_to_num,
    np.take: _take,
    np.choose: _choose,
    np.diff: _differences,
    np.polyval: _polynomial,
    np.isclose: _is_close,
    np.dot: lambda a, b: a * b if bare(a).ndim == 0 or bare(b).ndim == 0 else Traced(_product(a, b)),
    np.inner: lambda a, b: Traced(_product(a, bare(b).T)),
    np.vdot: lambda a, b: wrap(rec.dot(bare(a).ravel(), bare(b).ravel())),
    np.outer: lambda a, b: np.multiply(wrap(bare(a).ravel()[:, None]), bare(b).ravel()),
    np.einsum: lambda how, *of, **_: wrap(np.einsum(how, *(bare(each).astype(object) for each in of))),
    np.copyto: lambda dst, src, **_: dst.__setitem__(..., src),
}
_MOVES: Final = {
    np.concatenate, np.stack, np.hstack, np.vstack, np.column_stack, np.append, np.insert, np.delete, np.reshape,
    np.ravel, np.copy, np.transpose, np.swapaxes, np.moveaxis, np.squeeze, np.expand_dims, np.broadcast_to,
    np.atleast_1d, np.atleast_2d, np.flip, np.roll, np.tile, np.repeat, np.split, np.array_split, np.diagonal,
    np.trace,
}  # fmt: skip
"""Functions that leave numbers as they are."""
