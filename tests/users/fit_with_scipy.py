"""A robust fit by SciPy with exact derivatives, beside the fit of the package."""

from scipy.optimize import least_squares, minimize

import mrwork as mr

test = mr.synthetic_test("rd1005_1a")
objective = mr.objective("bingham", test, coordinates="unit", loss="soft_l1", loss_scale=30.0)
ends = (objective.lower, objective.upper)
robust = least_squares(objective.residuals, objective.start, jac=objective.jacobian, bounds=ends)
for name, value, unit in zip(objective.names, objective.theta(robust.x), objective.units, strict=True):
    print(f"{name} = {value:.4g} {unit}")

plain = mr.objective("bingham", test, coordinates="unit")
found = minimize(plain, plain.start, jac=plain.gradient, bounds=plain.bounds)
fit = mr.identify("bingham", test)
print(f"SciPy {found.fun:.6f}, identify {fit.nrmse:.6f}")
