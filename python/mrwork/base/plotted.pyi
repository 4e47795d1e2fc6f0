"""The attribute `plot` of results as editors and checkers of types see it."""

from typing import TYPE_CHECKING, Self

if TYPE_CHECKING:
    # So that mypy sees the figures of `Plots` first.
    from mrwork.plots.accessor import Plots as Plots

class Plotted:
    """A result with figures."""

    __slots__ = ()

    @property
    def plot(self) -> Plots[Self]:
        """Figures of the result, the functions of `mr.plots` that take it."""
