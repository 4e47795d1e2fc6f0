"""A damper identified from one test and held against another, with its numbers as tables."""

import mrwork as mr

test, other = mr.synthetic_test("spencer1997"), mr.synthetic_test("spencer1997_slow")
fit = mr.identify("viscous_dahl", test, rng=1)
parameters = fit.to_pandas()
prediction = mr.predict(fit, other).to_xarray()
error = float(abs(prediction["residual"]).where(prediction["compared"]).max())
print(parameters[["value", "standard_error", "unit", "verdict"]], f"largest error {error:.0f} N")
