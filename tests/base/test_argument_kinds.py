"""Each form of annotation, with values that it takes and values that it refuses."""

# Annotations that are text, as those of the package: what `checked` reads at the first call if need be.
from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NewType, ParamSpec, Protocol, TypeVar, runtime_checkable

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray
from refusals import refusal
from typing_extensions import TypeAliasType

from mrwork.base.arguments import AnyArray, May, Positive, Rows, Shape, checked
from mrwork.base.hints import Says, Within
from mrwork.base.keys import closest
from mrwork.errors import ArgumentError, MrworkError, SettingError


@checked
@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """Something with a number."""

    _made_by = "Part(size=...)"

    size: Annotated[float, Within(above=0.0)] = 1.0
    names: tuple[str, ...] = ()


@runtime_checkable
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
        ("count", np.int64(3), 3),
        ("switch", np.True_, True),
        ("loose", 3.0, 3.0),
        ("loose", [[1, 2], [3, 4]], [[1, 2], [3, 4]]),
        ("worst", [np.inf, 0.0], [np.inf, 0.0]),
        ("numbers", np.arange(3.0), [0.0, 1.0, 2.0]),
        ("names", "a", "a"),
        ("pair", [1, 2], (1, 2)),
        ("bounds", {"c": [0, 1]}, {"c": (0, 1)}),
        ("called", abs, abs),
        ("on_progress", print, print),
        ("sized", Part(), Part()),
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


def test_what_an_argument_means_is_in_the_docstring() -> None:
    @checked
    def squeezed(
        gap: Annotated[Positive, Says("gap of the duct", unit="m")], *, law: str = "", turns: int = 1
    ) -> None:
        """A duct that is squeezed.

        Parameters
        ----------
        turns
            Of the coil.

        Raises
        ------
        SettingError
            Never.
        """

    assert squeezed.__doc__ is not None
    before, _, after = squeezed.__doc__.partition("----------\n")
    assert before == "A duct that is squeezed.\n\nParameters\n"
    assert after.startswith("gap\n    Gap of the duct [m], above 0.\nturns\n    Of the coil.\n\nRaises\n---")


FloatT = TypeVar("FloatT", bound=np.generic)
Force = TypeAliasType("Force", NDArray[np.float64])
Row = TypeAliasType("Row", np.ndarray[Any, np.dtype[FloatT]], type_params=(FloatT,))
Listed = TypeAliasType("Listed", Sequence[float] | None)


def taking(form: Any) -> Any:
    """A function whose one argument has this annotation."""

    def take(force: Any) -> Any:
        return force

    take.__annotations__["force"] = form
    return checked(take)


def test_an_alias_declares_what_it_stands_for_and_a_union_its_members() -> None:
    row = Row[np.float64]  # type: ignore[misc] # what a checker says of an alias made at run time
    for form in (Force, row, Annotated[Force, Within(least=0.0)], Force | Part):
        assert taking(form)([1, 2]).dtype == np.float64
        refusal(taking(form), "abc", match="`force` of take")
    checking = taking(Listed | Literal["none"])
    for given in ("none", None, [1.0, 2.0]):
        assert checking(given) == given
    refusal(checking, "all", match="force")


@pytest.mark.parametrize("form", [NewType("Newtons", float), ParamSpec("P"), "Force[", 3])
def test_an_annotation_of_an_unknown_form_is_an_error_when_the_function_is_defined(form: Any) -> None:
    with pytest.raises((TypeError, SyntaxError)):
        taking(form)


@pytest.mark.parametrize(
    ("name", "value", "kind", "word"),
    [
        ("number", "1", ArgumentError, "a number"),
        ("number", True, ArgumentError, "a number"),
        ("count", 1.5, ArgumentError, "a whole number"),
        ("text", b"x", ArgumentError, "a Path"),
        ("loose", [[1], [1, 2]], ArgumentError, "of one length"),
        ("loose", np.array(["2020-01-01"], dtype="M8[D]"), ArgumentError, "datetime64"),
        ("loose", np.ma.masked_array([1.0, 2.0], [False, True]), ArgumentError, "masked"),
        ("strict", [1j], ArgumentError, "complex128"),
        ("signs", [0.5], ArgumentError, "int64"),
        ("numbers", [1, "x"], ArgumentError, r"numbers\[1\]"),
        ("pair", (1, 2, 3), ArgumentError, "2 values"),
        ("bounds", {"c": 3}, ArgumentError, r"bounds\['c'\]"),
        ("called", lambda: 3, ArgumentError, "of 1 argument"),
        ("on_progress", lambda: 3, ArgumentError, "of 2 arguments"),
        ("parts", [Part(), 3], ArgumentError, r"parts\[1\]"),
        ("sized", 3, ArgumentError, "a Sized"),
        ("number", np.nan, SettingError, "finite"),
        ("number", 10**400, SettingError, "finite"),
        ("count", -1, SettingError, "at least 0"),
        ("count", 2**63, SettingError, "from -9223"),
        ("choice", "lane", SettingError, "did you mean lanes"),
        ("loose", [1.0, np.nan], SettingError, "nan at 1"),
        ("strict", [[0.0, np.inf]], SettingError, r"\(0, 1\)"),
        ("worst", [1.0, -1.0], SettingError, "-1 at 1"),
    ],
)
def test_a_value_of_another_kind_or_out_of_its_range_is_refused(
    name: str, value: object, kind: type[MrworkError], word: str
) -> None:
    error = refusal(taken, **{name: value}, match=word)
    assert isinstance(error, kind)
    assert getattr(error, "key", "").partition("[")[0] == name


def test_dataclasses_are_checked_when_they_are_built_and_replaced() -> None:
    refusal(Part, size=0.0, match="above 0")
    refusal(replace, Part(), size="x", match="a number")
    refusal(Part, 1.0, match="by name")
    # What must be positive is refused where its inverse or square is none.
    assert Part(size=1e-100).size == 1e-100
    refusal(Part, size=1e-101, match="at least 1e-100")


def test_what_is_missing_unknown_or_by_position_is_said_with_what_was_meant() -> None:
    @checked
    def search(theta: float, span: float = 1.0, *, rng: int = 0, bounds: float = 0.0) -> float:
        return theta

    class Rig:
        @classmethod
        @checked
        def of(cls, size: Positive) -> Rig:
            return cls()

    refusal(search, match="lacks `theta`")
    refusal(search, 1.0, seed=2, match="did you mean rng")
    refusal(search, 1.0, bound=2.0, match="did you mean bounds")
    refusal(search, 1.0, 2.0, 3, match="too many positional")
    refusal(search, 1.0, theta=2.0, match="once")
    # A method is named with its class.
    refusal(Rig.of, 0.0, match=r"Rig\.of")


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


def test_axes_of_one_name_have_one_length() -> None:
    shaped(np.zeros((3, 4)), np.zeros(4))
    refusal(shaped, np.zeros(3), match=r"\(n_batch, n_time\)")
    refusal(shaped, np.zeros((3, 4)), own=np.zeros(5), match="n_time = 4")


def test_arrays_of_another_library_pass_as_they_are_and_lists_become_arrays() -> None:
    class Traced:
        def __array_namespace__(self) -> object:
            return np

    traced = Traced()
    assert shaped(np.zeros((1, 1)), either=traced) is traced
    assert shaped(np.zeros((1, 1)), either=[1, 2]).dtype == np.float64
    refusal(shaped, np.zeros((1, 1)), either="x", match="an array")


def test_paths_may_be_any_iterable_whose_items_are_checked() -> None:
    for paths in ("a", Path("a"), ["a", Path("b")], {"a": 1}, iter([3])):
        shaped(np.zeros((1, 1)), paths=paths)  # type: ignore[arg-type] # an iterator is not looked into
    for wrong, word in ((b"x", "a path"), (["a", b"x"], r"paths\[1\]"), (3, "a path")):
        refusal(shaped, np.zeros((1, 1)), paths=wrong, match=word)


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
