"""The run of a verb read back: by the type that is expected, or told apart by the type that comes."""

import subprocess
import sys

import mrwork as mr

subprocess.run(
    [sys.executable, "-m", "mrwork", "identify", "synthetic:spencer1997", "--quiet", "--out", "demo"],
    check=True,
)
fit = mr.load("demo", mr.StoredRun).fit
forces = mr.simulate(fit.spec, fit.theta, mr.synthetic_test("spencer1997"))

run = mr.load("demo")
if isinstance(run, mr.StoredRun):
    found = f"a fit of {run.fit.fit_percent:.1f} %"
elif isinstance(run, mr.tuning.TunedStudy):
    found = f"a study with {len(run.tuned.laws)} tuned laws"
else:
    found = f"a study with {len(run.rows)} rows"
print(found, forces.shape)
