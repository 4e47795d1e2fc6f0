"""Which parameters the force depends on most: exact derivatives, labelled, as a table."""

import numpy as np

import mrwork as mr

test = mr.records.cut(mr.synthetic_test("spencer1997"), every=4)
spec = mr.damper("normalised_bouc_wen")
found = mr.sensitivities(spec, spec.nominal, test)
data = found.to_xarray()
change = (data["jacobian"] ** 2).mean("time") ** 0.5 * np.abs(spec.nominal)
table = change.to_series().sort_values(ascending=False)
print(table, found.by("rho").shape)
