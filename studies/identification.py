"""How does a folder of damper tests become a model with bands that hold what they say?

Fit the tests marked `fit` in the folder's table, calibrate a band on those marked `calibration` and judge both on those
marked `test`: the model of the sample rig has fits of 99.2 and 99.5 % there, and its 90 % band holds 87 and 89 % of
both forces. Five seconds.
"""

import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

import mrwork as mr
from common import Script

script = Script(
    __file__,
    __doc__,
    quick="every fourth sample",
    folder={"type": Path, "help": "of tests, with tests.csv; default: a sample"},
)

# %% The folder: records, and a table `tests.csv` that says what each is for.
folder = script.options.folder or script.out / "rig"
if not folder.exists():
    subprocess.run(
        [sys.executable, "-m", "mrwork", "init", "rig", folder], check=True, stdout=subprocess.DEVNULL
    )
use = {Path(row.file).stem: row.use for row in mr.records.read_test_table(folder / "tests.csv")}
tests = mr.read_damper_tests(folder)
if script.quick:
    tests = [mr.records.cut(test, every=4) for test in tests]
fitted, kept, held_out = (
    [test for test in tests if use[test.name] == name] for name in ("fit", "calibration", "test")
)

# %% A model whose friction and damping follow the current, by several starts; what the tests leave open is told.
spec = mr.damper("normalised_bouc_wen").with_current_laws({"k_w": "quadratic", "c": "linear"}, unit="A")
fit = mr.identify(spec, fitted, rng=script.seed, threads=script.threads)
parameters = {
    name: {"value": row.value, "standard error": row.standard_error, "unit": row.unit, "verdict": row.verdict}
    for name, row in fit.to_pandas().iterrows()
}
script.table(
    "parameters", parameters, title=f"{fit.spec.name}, {len(fitted)} tests, fit {fit.fit_percent:.1f} %"
)

# %% Bands, calibrated on tests that the fit has not seen, and their coverage on tests that neither has seen.
bands = mr.calibrate([mr.predict(fit, test) for test in kept], held_out="marked calibration")
predictions = [mr.predict(fit, test) for test in held_out]
rows = {}
for prediction in predictions:
    band = bands.band(prediction, 0.9)
    inside = (prediction.measured >= band.lower) & (prediction.measured <= band.upper)
    rows[prediction.test.name] = {
        "fit %": prediction.fit_percent,
        "RMSE N": float(np.sqrt(np.mean((prediction.measured - prediction.force) ** 2))),
        "inside the 90 % band %": 100.0 * float(inside.mean()),
        "mean width N": float((band.upper - band.lower).mean()),
    }
script.table("held_out", rows, title="Tests that neither fit nor bands have seen", digits=3)

# %% The first of them beside its band.
figure = Figure(figsize=(6.0, 3.5), layout="constrained")
mr.plots.bands(predictions[0], ax=figure.subplots(), calibration=bands, level=0.9)
script.figure(figure, "held_out")
script.check()
