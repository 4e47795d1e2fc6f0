"""Starting points of the final fit, which a search has found."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrwork.base.values import Floats, array_dataclass
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SimulationError
from mrwork.identification.equivalent import Form
from mrwork.identification.fit import SearchTrace
from mrwork.identification.objective import Objective, up_to
from mrwork.identification.settings import Start


@array_dataclass()
class StartingPoints:
    """Starting points, shape (n_starts, n_params), best first, and the trace of the search that found them.

    `objective` compares them, and they are fitted inside the box of `form`. Where they are `minima` already, no
    screening is needed to select the best; `warnings` say what makes the best suspicious, and `is_suspected` that it is
    taken for a false minimum.
    """

    objective: Objective
    form: Form
    theta: Floats
    trace: SearchTrace
    minima: bool = False
    warnings: tuple[str, ...] = ()
    is_suspected: bool = False

    def with_given(self, spec: DamperSpec, given: Sequence[Start]) -> StartingPoints:
        """The starting points, and the user's starts, in parameters of the requested model, moved inside the box.

        Parameters that a start does not name are taken from the best point. A start above the limit of stiffness lifts
        the limit.
        """
        box = self.form.box
        best = np.asarray(self.form.to_model(self.theta[0]))
        whole = [
            np.array([start.get(name, value) for name, value in zip(spec.names, best, strict=True)])
            for start in given
        ]
        inside = [box.inside(np.clip(self.form.from_model(theta), box.lower, box.upper)) for theta in whole]
        objective = self.objective
        if inside and any(np.any(test.stiffness(np.array(inside)) > 1.0) for test in objective.compared):
            objective = up_to(objective, np.inf)
        return replace(self, objective=objective, theta=np.array([*self.theta, *inside]))


def no_simulation(spec: DamperSpec, evaluations: int) -> SimulationError:
    """The error of a search in which every simulation failed."""
    return SimulationError(
        f"none of {evaluations} candidates of {spec.name} could be simulated on these tests; "
        "check the units of the record, or narrow the bounds"
    )
