"""The driver's lag and what the tests tell of it: nothing at constant commands; a lag that was left out otherwise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

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


def with_lag(spec: DamperSpec, *, lagged: bool) -> DamperSpec:
    """The model with its current laws, with the driver's lag or without; `spec` has current laws."""
    assert spec.current is not None
    laws = dict(zip(damper(spec.name).names, spec.current.laws, strict=True))
    return damper(spec.name).with_current_laws(laws, unit=spec.current.unit, lagged=lagged)


def rate_is_shown(spec: DamperSpec, form: Form, tests: Sequence[DamperTest]) -> bool | None:
    """Whether a command that varies shows the rate of the driver's lag; `None` where no rate is estimated."""
    if spec.current is None or not spec.current.lagged:
        return None
    if form.spec.names.index(spec.names[-1]) not in form.box.free:
        return None
    return any(test.has_varying_command for test in tests)


def rate_warning(spec: DamperSpec, form: Form, tests: Sequence[DamperTest]) -> tuple[str, ...]:
    """A sentence where the rate of the driver's lag is to be estimated from tests at constant commands."""
    if rate_is_shown(spec, form, tests) is not False:
        return ()
    return (
        "the command is constant in every test, so nothing shows the rate eta of the driver's lag; add a test with "
        "a command that varies, fix it with --fix eta=VALUE, or leave the lag out",
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingLag:
    """A rate of the driver's lag [1/s] with which the misfit of a fit without a lag is lower, all else as it is."""

    rate: float
    misfit_without: float
    misfit_with: float

    @property
    def in_words(self) -> str:
        """A sentence that says what to do."""
        return (
            f"a driver's lag of about {self.rate:g} 1/s would lower the misfit from {100.0 * self.misfit_without:.2f} "
            f"to {100.0 * self.misfit_with:.2f} % with no other change: the command that was recorded reaches the coil "
            "later; fit the lag with --driver-lag, in Python lagged=True"
        )


def missing_lag(spec: DamperSpec, objective: Objective, theta: NDArray[np.float64]) -> MissingLag | None:
    """The lag with which the fit `theta` without one describes the tests better; `None` where there is none."""
    current = spec.current
    if current is None or current.lagged or not any(test.has_varying_command for test in objective.tests):
        return None
    lagged = objective.on(with_lag(spec, lagged=True), objective.tests)
    tried = lagged(np.array([[*theta, rate] for rate in _TRIED_RATES]))
    before = float(objective(theta[None])[0])
    best = int(np.argmin(tried))
    if not tried[best] < _SHARE * before:
        return None
    return MissingLag(rate=_TRIED_RATES[best], misfit_without=before, misfit_with=float(tried[best]))
