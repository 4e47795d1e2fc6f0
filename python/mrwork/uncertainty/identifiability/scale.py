"""How large a change of a parameter is: measured by its value, or by its range where the value may be zero."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import DamperSpec
from mrwork.identification.search_ranges import search_box
from mrwork.records import DamperTest

# A value smaller than this share of a typical one is taken for zero.
_NOTHING = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """The size of a change that matters, per parameter, shape (n_params,): its value, or `of_range` half of its range.

    A parameter with a logarithmic scale is measured by its value. Another may be zero, so it is measured by half the
    range that a record's own scales give it, where they do.
    """

    size: NDArray[np.float64]
    of_range: NDArray[np.bool_]

    @classmethod
    def of(cls, box: Box, ranges: Box, theta: NDArray[np.float64]) -> Scale:
        """Scales at `theta`, shape (n_params,), with the `ranges` of `scaled_ranges`."""
        half = 0.5 * (np.array(ranges.upper) - np.array(ranges.lower))
        size = np.abs(theta)
        of_range = ~np.array(box.log) & (half > size)
        return cls(size=np.where(of_range, half, size), of_range=of_range)


def scaled_ranges(
    spec: DamperSpec, box: Box, tests: tuple[DamperTest, ...], theta: NDArray[np.float64]
) -> Box:
    """The box narrowed to the scales of the records; where these say nothing, to the size of the value.

    That of a typical value where it is next to nothing beside one: a share at its bound of zero has no size of its own.
    """
    searched = search_box(spec, box, tests)
    own = {}
    for index, name in enumerate(box.names):
        as_wide = searched.lower[index] == box.lower[index] and searched.upper[index] == box.upper[index]
        size, typical = abs(float(theta[index])), abs(spec.parameters[index].nominal)
        size = size if size > _NOTHING * typical else typical
        if as_wide and not box.log[index] and size > 0.0:
            own[name] = (max(box.lower[index], -size), min(box.upper[index], size))
    return searched.with_bounds({name: pair for name, pair in own.items() if pair[0] < pair[1]})
