"""An objective of one's own, searched by ask and tell, and the same within a budget of time and to a target."""

import numpy as np
from numpy.typing import NDArray

import mrwork as mr

test = mr.synthetic_test("spencer1997")
objective = mr.objective("bingham", test, coordinates="unit", bounds={"f0": (0.0, 0.0)})


def energy_and_misfit(unit: NDArray[np.float64]) -> NDArray[np.float64]:
    """Misfit of the force plus the relative error of the dissipated energy."""
    forces = mr.simulate("bingham", objective.theta(unit), test)
    dissipated = forces @ test.velocity
    measured = test.force @ test.velocity
    total: NDArray[np.float64] = objective(unit) + np.abs(dissipated / measured - 1.0)
    return total


search = mr.search.EfficientGA(population=12, stop=mr.search.StopRules(max_generations=15))
state = search.start(n_params=len(objective.names), rng=0)
while state.course.running:
    proposal = search.ask(state)
    state = search.tell(state, proposal, energy_and_misfit(proposal.unit))
theta = objective.theta(state.course.best_unit)

budgeted = mr.search.run_search(
    search, energy_and_misfit, rng=0, n_params=len(objective.names), seconds=10.0, until=0.5
)
print(theta, budgeted.stop_reason)
