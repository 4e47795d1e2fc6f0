"""A fit, its residuals and a spectrum in axes of one's own, and the numbers behind them."""

import numpy as np
from matplotlib import pyplot as plt

import mrwork as mr

test = mr.synthetic_test("spencer1997")
fit = mr.identify("viscous_dahl", test, rng=1)
motion = mr.synthetic_motion(rng=1, duration=5.0)

figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12.0, 3.5), layout="constrained")
fit.plot.loops(left, over="velocity")
mr.plots.residuals(fit, middle)
motion.plot.spectra(right, periods=np.linspace(0.1, 2.0, 50))
left.set_title(f"{fit.fit_percent:.1f} %")
figure.savefig("figures.png", dpi=50)
plt.close(figure)

table = mr.plots.drawn_data(right)
shown = [axes.get_ylabel() for axes in (left, middle, right)]
