"""Two thousand dampers under one measured motion, and their peak forces as a table."""

import numpy as np

import mrwork as mr

# In place of three columns of a file of yours.
time = np.linspace(0.0, 2.0, 1001)
displacement = 0.01 * np.sin(2.0 * np.pi * time)
force = 800.0 * np.tanh(40.0 * np.cos(2.0 * np.pi * time)) + 60.0 * np.cos(2.0 * np.pi * time)
test = mr.test_from_arrays(time, displacement, force, name="mine", command=1.0, command_unit="A")

spec = mr.damper("bingham")
rng = np.random.default_rng(1)
theta = spec.nominal * rng.uniform(0.5, 1.5, (2000, len(spec.names)))
forces = mr.simulate(spec, theta, test)
misfit = mr.objective(spec, test)(theta)
peak = np.abs(forces).max(axis=1)
best = dict(zip(spec.names, theta[np.argmin(misfit)], strict=True))
print(f"{len(test.remarks)} remarks; peak force from {peak.min():.0f} to {peak.max():.0f} N; best {best}")
