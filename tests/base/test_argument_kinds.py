"""Each form of annotation, with values that it takes and values that it refuses."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NewType, ParamSpec, Protocol, TypeVar

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from sentences import Refused
from typing_extensions import TypeAliasType

from mrwork.base.arguments import AnyArray, May, Positive, Rows, Shape, checked
from mrwork.base.hints import Within
from mrwork.base.keys import closest
from mrwork.errors import ArgumentError, MrworkError


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Something with a number."""

    _made_by = "Part(size=...)"

    size: Annotated[float, Within(above=0.0)] = 1.0
    names: tuple[str, ...] = ()


class Sized(Protocol):
    """What has a size."""

    size: float


@checked
def taken(
    *,
    number: float = 1.0,
    limit: float = np.inf,
    count: Annotated[int, Within(least=0)] = 0,
    choice: Literal["lanes", "twin"] = "lanes",
    switch: bool = False,
    text: str | Path = "",
    loose: ArrayLike | None = None,
    strict: NDArray[np.float64] | None = None,
    signs: NDArray[np.int64] | None = None,
    worst: Annotated[ArrayLike, May.BE_INFINITE, Within(least=0.0)] = 0.0,
    numbers: Sequence[float] = (),
    names: str | Sequence[str] = (),
    pair: tuple[float, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    called: Callable[[int], int] | None = None,
    on_progress: Callable[[int, int], bool | None] | None = None,
    part: Part | None = None,
    parts: Part | Sequence[Part] = (),
    sized: Sized | None = None,
    anything: Any = None,
) -> dict[str, Any]:
    """What it was given."""
    return dict(locals())


@pytest.mark.parametrize(
    ("name", "value", "expected"),
    [
        ("number", 2, 2),
        ("number", np.float32(0.5), 0.5),
        ("number", np.array(3.0), 3.0),
        ("limit", np.inf, np.inf),
        ("count", np.int64(3), 3),
        ("switch", np.True_, True),
        ("text", Path("a"), Path("a")),
        ("loose", None, None),
        ("loose", 3.0, 3.0),
        ("loose", [[1, 2], [3, 4]], [[1, 2], [3, 4]]),
        ("worst", [np.inf, 0.0], [np.inf, 0.0]),
        ("numbers", np.arange(3.0), [0.0, 1.0, 2.0]),
        ("names", "a", "a"),
        ("pair", [1, 2], (1, 2)),
        ("bounds", {"c": [0, 1]}, {"c": (0, 1)}),
        ("called", abs, abs),
        ("called", str, str),
        ("on_progress", print, print),
        ("parts", [], []),
        ("sized", Part(), Part()),
        ("anything", "x", "x"),
    ],
)
def test_a_value_of_the_kind_arrives(name: str, value: object, expected: object) -> None:
    found = taken(**{name: value})[name]
    assert found == expected
    assert type(found) is type(expected)


def test_numbers_arrive_as_the_array_that_is_annotated() -> None:
    found = taken(strict=[1, 2], signs=np.array([1, -1], dtype=np.int8))
    assert found["strict"].dtype == np.float64
    assert found["signs"].dtype == np.int64
    given = np.zeros(3)
    assert taken(strict=given)["strict"] is given
    assert Part(names=["a"]).names == ("a",)  # type: ignore[arg-type] # a list for a tuple, on purpose


FloatT = TypeVar("FloatT", bound=np.generic)
Force = TypeAliasType("Force", NDArray[np.float64])
Row = TypeAliasType("Row", np.ndarray[Any, np.dtype[FloatT]], type_params=(FloatT,))
Listed = TypeAliasType("Listed", Sequence[float] | None)


@pytest.mark.parametrize(
    "form",
    [
        NDArray[np.float64],
        Force,
        Row[np.float64],  # type: ignore[misc] # what a checker says of an alias made at run time
        Annotated[Force, Within(least=0.0)],
        Force | None,
        Force | Part,
    ],
)
def test_an_alias_declares_what_it_stands_for(form: Any) -> None:
    def take(force: Any) -> Any:
        return force

    take.__annotations__["force"] = form
    checking = checked(take)
    assert checking([1, 2]).dtype == np.float64
    with pytest.raises(ArgumentError, match="`force` of take"):
        checking("abc")


def test_unions_and_aliases_within_a_union_are_its_members() -> None:
    def take(numbers: Any, loose: Any = None) -> Any:
        return numbers, loose

    take.__annotations__.update(numbers=Listed | Literal["none"], loose=ArrayLike | None)
    checking = checked(take)
    for given in ("none", None, [1.0, 2.0]):
        assert checking(given) == (given, None)
    assert checking(None, np.arange(2))[1].tolist() == [0, 1]
    for wrong in ({"numbers": "all"}, {"numbers": None, "loose": "x"}):
        with pytest.raises(MrworkError):
            checking(**wrong)


@pytest.mark.parametrize(
    "form", [NewType("Newtons", float), ParamSpec("P"), "Force[", 3, list[NewType("X", int)]]
)
def test_an_annotation_of_an_unknown_form_is_an_error_when_the_function_is_defined(form: Any) -> None:
    def take(force: Any) -> Any:
        return force

    take.__annotations__["force"] = form
    with pytest.raises((TypeError, SyntaxError)):
        checked(take)


def test_a_name_that_is_defined_later_is_known_at_the_first_call_or_is_an_error_then() -> None:
    def take(part: Later) -> Any:  # type: ignore[name-defined] # noqa: F821
        return part

    checking = checked(take)
    with pytest.raises(NameError, match="Later"):
        checking(1.0)


def test_a_value_of_another_kind_is_refused_in_a_sentence(refused: Refused) -> None:
    for name, value in (
        ("number", "1"),
        ("number", True),
        ("number", 1j),
        ("number", None),
        ("count", 1.5),
        ("choice", 3),
        ("switch", 1),
        ("text", b"x"),
        ("loose", "x"),
        ("loose", [[1], [1, 2]]),
        ("loose", ["1"]),
        ("loose", [True]),
        ("loose", np.array(["2020-01-01"], dtype="M8[D]")),
        ("loose", np.ma.masked_array([1.0, 2.0], [False, True])),
        ("loose", {"a": 1}),
        ("strict", [1j]),
        ("signs", [0.5]),
        ("numbers", "12"),
        ("numbers", [1, "x"]),
        ("numbers", np.zeros((2, 2))),
        ("names", [1]),
        ("pair", (1, 2, 3)),
        ("bounds", {"c": 3}),
        ("bounds", [1]),
        ("called", 3),
        ("called", lambda: 3),
        ("on_progress", list),
        ("on_progress", lambda done: None),
        ("part", "a"),
        ("part", Part),
        ("parts", [Part(), 3]),
        ("sized", 3),
    ):
        assert isinstance(refused(taken, **{name: value}), TypeError)


def test_a_number_or_name_out_of_its_range_is_a_setting_error(refused: Refused) -> None:
    for name, value in (
        ("number", np.nan),
        ("number", np.inf),
        ("number", 10**400),
        ("limit", np.nan),
        ("count", -1),
        ("choice", "lane"),
        ("choice", "x\x1b\n"),
        ("loose", [1.0, np.nan]),
        ("loose", [10**30]),
        ("strict", [[0.0, np.inf]]),
        ("worst", [1.0, -1.0]),
        ("worst", [np.nan]),
        ("numbers", [0.0, np.inf]),
    ):
        refused(taken, **{name: value})


def test_dataclasses_are_checked_when_they_are_built_and_replaced(refused: Refused) -> None:
    refused(Part, size=0.0)
    refused(replace, Part(), size="x")


def test_what_is_missing_unknown_or_by_position_is_said_with_what_was_meant(refused: Refused) -> None:
    @checked
    def search(theta: float, span: float = 1.0, *, rng: int = 0, bounds: float = 0.0) -> float:
        return theta

    for arguments, named in (
        ((), {}),
        ((1.0,), {"seed": 2}),
        ((1.0,), {"bound": 2.0}),
        ((1.0,), {"other": 2}),
        ((1.0, 2.0, 3), {}),
        ((1.0,), {"theta": 2.0}),
    ):
        assert isinstance(refused(search, *arguments, **named), ArgumentError)
    refused(Part, 1.0)


@pytest.mark.parametrize("name", ["bouc-wen", "BoucWen", "Bouc Wen", "BOUC_WEN", "bouc_wenn"])
def test_a_name_in_another_style_is_answered_with_the_one_that_was_meant(name: str) -> None:
    assert closest(name, ["bingham", "modified_bouc_wen", "bouc_wen"]) == "bouc_wen"


@checked
def shaped(
    rows: Rows,
    own: Annotated[NDArray[np.float64], Shape(("n_time",))] | None = None,
    either: AnyArray = None,
    paths: str | os.PathLike[str] | Iterable[str | os.PathLike[str]] = (),
) -> Any:
    """What it was given for `either`."""
    return either


def test_axes_of_one_name_have_one_length(refused: Refused) -> None:
    shaped(np.zeros((3, 4)), np.zeros(4))
    refused(shaped, np.zeros(3))
    refused(shaped, np.zeros((3, 4)), own=np.zeros(5))


def test_arrays_of_another_library_pass_as_they_are_and_lists_become_arrays(refused: Refused) -> None:
    class Traced:
        def __array_namespace__(self) -> object:
            return np

    traced = Traced()
    assert shaped(np.zeros((1, 1)), either=traced) is traced
    assert shaped(np.zeros((1, 1)), either=[1, 2]).dtype == np.float64
    refused(shaped, np.zeros((1, 1)), either="x")


def test_items_of_a_container_of_paths_are_checked(refused: Refused) -> None:
    for paths in (b"x", [3], ["a", b"x"], {3}, 3):
        refused(shaped, np.zeros((1, 1)), paths=paths)


@pytest.mark.parametrize("paths", ["a", Path("a"), ["a", Path("b")], {"a": 1}, iter([3])])
def test_paths_may_be_any_iterable(paths: Any) -> None:
    shaped(np.zeros((1, 1)), paths=paths)


def test_a_method_is_named_with_its_class(refused: Refused) -> None:
    class Rig:
        @classmethod
        @checked
        def of(cls, size: Positive) -> Rig:
            return cls()

    refused(Rig.of, 0.0)


def test_whole_numbers_have_64_bits(refused: Refused) -> None:
    assert taken(count=2**63)["count"] == 2**63
    refused(taken, count=2**64)


def test_an_error_is_one_line_of_characters_that_can_be_seen() -> None:
    assert str(ArgumentError("a\nb\x1b")) == r"a\nb\x1b"


def test_arrays_of_any_precision_are_taken() -> None:
    for kind in (np.float16, np.float32, np.longdouble, np.int8, np.uint64):
        np.testing.assert_array_equal(taken(strict=np.array([0, 2], dtype=kind))["strict"], [0.0, 2.0])
        assert taken(number=kind(2))["number"] == 2


def test_no_number_is_read_as_zero() -> None:
    for number in (1e-100, -1e-101, 5e-324):
        assert taken(number=number)["number"] == number
    np.testing.assert_array_equal(taken(strict=[1e-300, 1e-100])["strict"], [1e-300, 1e-100])
    np.testing.assert_array_equal(taken(loose=[5e-324, 1.0])["loose"], [5e-324, 1.0])
    given = np.array([0.0, 1e-200])
    assert taken(strict=given)["strict"] is given


def test_what_must_be_positive_is_refused_where_its_inverse_or_square_is_none(refused: Refused) -> None:
    assert Part(size=1e-100).size == 1e-100
    for number in (1e-101, 5e-324):
        refused(Part, size=number)
    refused(Part, size=0.0)
