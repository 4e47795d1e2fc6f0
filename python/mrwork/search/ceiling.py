"""From which misfit on a chromosome counts as failed: what lets an early abort save work in a genetic algorithm.

There every misfit has a rank, so a simulation could never stop early without changing what follows. A ceiling
changes what follows on purpose, by a stated rule; then nothing depends on whether a simulation went on above it.

On 2000 samples of a measured test (10 mm, 1 Hz, 0.5 A), the non-symmetric Bouc-Wen model with 8 free parameters and
24 replicates of 120 generations of the efficient algorithm; the share of steps done is estimated, as if the squared
error grew evenly in time:

=========================  ===========  ==================  ============  ==========
ceiling                    simulations  median best misfit  below 0.1     steps done
=========================  ===========  ==================  ============  ==========
none                       4252         0.0785              0.79          1.00
1                          4539         0.0742              0.88          0.92
1 and 3 times the median   5248         0.0666              0.96          0.75
1 and 2 times              5272         0.0678              0.92          0.73
1 and 1.5 times            5319         0.0673              0.88          0.71
1 and 1 times              5427         0.0673              0.88          0.66
=========================  ===========  ==================  ============  ==========

None of them cost quality (0.79 and 0.96 of 24 differ by little more than chance). Failures mutate, so more chromosomes
change and are simulated; in steps even that is less than without.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.search.course import Course
from mrwork.search.ranges import check_ranges


@dataclass(frozen=True, slots=True, kw_only=True)
class Ceiling:
    """A chromosome with a misfit at or above it counts as failed; the lower of the two holds, `None` is none.

    Parameters
    ----------
    absolute
        A misfit. For one that is an NRMSE, 1 is natural: at 1 a constant force does as well.
    over_median
        A multiple, at least 1, of the median misfit of the generation before.
    """

    absolute: float | None = None
    over_median: float | None = None

    def __post_init__(self) -> None:
        check_ranges(
            {"absolute": (self.absolute, 0.0, math.inf), "over_median": (self.over_median, 1.0, math.inf)}
        )

    def limit(self, course: Course) -> NDArray[np.float64]:
        """The ceiling of each replicate that runs, shape (n_running, 1); `inf` where there is none."""
        rows = course.running
        limit = np.full((rows.size, 1), math.inf if self.absolute is None else self.absolute)
        if self.over_median is None or course.is_first:
            return limit
        return np.asarray(np.minimum(limit, self.over_median * course.trace.median[rows, -1:]))
