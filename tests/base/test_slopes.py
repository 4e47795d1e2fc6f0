"""Derivatives of recordings: those of every operation by differences, and the spectral radius of a matrix."""

from typing import Any

import numpy as np
import pytest

from mrwork import _rust
from mrwork.base.recording import NUMBERS, Recording, put
from mrwork.base.slopes import radius_of, slopes_of
from mrwork.twins.tape_twin import _OPERATIONS, _WITH_NUMBER

ARITY = dict(_rust.tape_operations())


@pytest.mark.parametrize("op", NUMBERS)
@pytest.mark.parametrize("at", [(0.7, 1.3, -0.4), (1.3, 0.7, 0.4), (0.2, -2.1, 1.1)])
def test_slopes_of_every_operation_are_those_of_differences(op: str, at: tuple[float, ...]) -> None:
    """Of a product of what it gives with its first operand, so that a chain of two is followed."""
    recording = Recording()
    inputs = [recording.input("x", place) for place in range(ARITY[op])]
    end = put("multiply", put(op, *inputs), inputs[0])
    names = [each.at for each in inputs]
    ((*slopes,),) = slopes_of(recording, [end.at], names)
    ends = [recording.cell(slope).at for slope in slopes]

    def value(point: Any, nodes: list[int]) -> Any:
        return np.array(
            recording.values({("x", place): number for place, number in enumerate(point)}, nodes), float
        )

    point, step = np.array(at[: len(inputs)]), 1e-6
    found = value(point, ends)
    for place, slope in enumerate(found):
        reach = step * np.eye(len(point))[place]
        difference = (value(point + reach, [end.at]) - value(point - reach, [end.at]))[0] / (2.0 * step)
        assert slope == pytest.approx(difference, rel=1e-6, abs=1e-7)


def test_the_radius_bounds_the_largest_eigenvalue_and_is_near_it() -> None:
    rng = np.random.default_rng(1)
    for n in (1, 2, 3, 5):
        matrix = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(-3.0, 3.0, n)[:, None]
        recording = Recording()
        cells = [[recording.input("m", n * i + j) for j in range(n)] for i in range(n)]
        given = {("m", place): value for place, value in enumerate(matrix.ravel())}
        (radius,) = recording.values(given, [recording.cell(radius_of(cells)).at])
        largest = np.abs(np.linalg.eigvals(matrix)).max()
        assert largest * (1.0 - 1e-12) <= radius <= 2.5 * largest


def test_the_twin_in_jax_has_every_operation() -> None:
    assert {*_OPERATIONS, *_WITH_NUMBER} == {*ARITY}
