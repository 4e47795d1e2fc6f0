"""The driver's lag and what the tests tell of it: nothing at constant commands; a lag that was left out otherwise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.spec import DamperSpec, damper
from mrwork.identification.equivalent import Form
from mrwork.identification.objective import Objective
from mrwork.records import DamperTest

# Rates of the lag [1/s] that are tried where it was left out: from a slow coil and driver to that of a fast one.
_TRIED_RATES = (10.0, 20.0, 40.0, 80.0, 160.0, 320.0)
# A lag is missing if one of these rates brings the misfit below this share of that without it, with no other change.
_SHARE = 0.98


def rate_warning(spec: DamperSpec, form: Form, tests: Sequence[DamperTest]) -> tuple[str, ...]:
    """A sentence where the rate of the driver's lag is to be estimated from tests at constant commands."""
    if spec.current is None or not spec.current.lagged:
        return ()
    rate = form.spec.names.index(spec.names[-1])
    if rate not in form.box.free or any(test.has_varying_command for test in tests):
        return ()
    return (
        "the command is constant in every test, so nothing shows the rate eta of the driver's lag; add a test with "
        "a command that varies, fix it with --fix eta=VALUE, or leave the lag out",
    )


def missing_lag_warning(
    spec: DamperSpec, objective: Objective, theta: NDArray[np.float64]
) -> tuple[str, ...]:
    """A sentence where the fit `theta` without a lag describes the tests better once the command is lagged."""
    current = spec.current
    if current is None or current.lagged or not any(test.has_varying_command for test in objective.tests):
        return ()
    laws = dict(zip(damper(spec.name).names, current.laws, strict=True))
    lagged = objective.on(
        damper(spec.name).with_current_laws(laws, unit=current.unit, lagged=True), objective.tests
    )
    tried = lagged(np.array([[*theta, rate] for rate in _TRIED_RATES]))
    before = float(objective(theta[None])[0])
    best = int(np.argmin(tried))
    if not tried[best] < _SHARE * before:
        return ()
    return (
        f"a driver's lag of about {_TRIED_RATES[best]:g} 1/s would lower the misfit from {100.0 * before:.2f} to "
        f"{100.0 * tried[best]:.2f} % with no other change: the command that was recorded reaches the coil later; fit "
        "the lag with --driver-lag, in Python lagged=True",
    )
