"""LQR weights by convex design: the worst ratio of rms responses to their limits, under a budget of force."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from numpy.typing import ArrayLike

from mrwork.arguments import checked
from mrwork.buildings.devices import Device
from mrwork.buildings.matrices import Building
from mrwork.control.design.cases import DesignCase
from mrwork.control.design.designed import DesignedWeights
from mrwork.control.design.designer import WeightDesigner
from mrwork.control.design.limits import Limit, LoopTiming, RmsLimits, SemiActiveCondition
from mrwork.motions.spectral_density import SpectralDensity


@checked
def design_weights(
    building: Building,
    devices: Sequence[Device] | ArrayLike,
    *,
    limits: RmsLimits | Mapping[str, Limit | str | Sequence[float | str]],
    budget: float | str | Sequence[float | str],
    spectrum: SpectralDensity | None = None,
    cases: Sequence[DesignCase] = (),
    timing: LoopTiming | None = None,
    semi_active: SemiActiveCondition | None = None,
) -> DesignedWeights:
    """Weights of a regulator such that rms responses keep to limits with a budget of force.

    Minimises t with `E y_i^2 <= t^2 l_i^2` for all limited outputs and `E f_j^2 <= budget_j^2`, over all linear laws,
    under white noise filtered by a spectrum. The multipliers of the limits and budgets are the weights (S. Boyd et al.,
    Linear Matrix Inequalities in System and Control Theory, 1994). Only ratios of limits matter, and only the budget
    over the intensity of the ground.

    Parameters
    ----------
    devices
        Devices, or their rows of elongation, shape (n_devices, n).
    limits
        Limits on rms drift [m], absolute acceleration [m/s^2], displacement [m] and force [N], or as "2 mm"; see
        `RmsLimits`.
    budget
        Largest rms wanted force of each device, of all its dampers together: one for all [N], or as "1.5 kN", or one
        for each.
    spectrum
        `KanaiTajimi` or `CloughPenzien`, as given or by `mr.motions.fitted_spectrum` of a record; Kanai-Tajimi on firm
        soil by default.
    cases
        Plants that share the weights, each with a spectrum of its own instead of `spectrum`: mean squares are averaged
        over them; the gain is that of `building` under the spectrum of the first. Without any, `building` under
        `spectrum`.
    timing
        Sample time, delay and driver for a design in discrete time.
    semi_active
        Condition that the wanted force be mostly that of a damper.

    Raises
    ------
    SettingError
        If a limit, budget or case cannot be, or the building has a mode without damping.

    Examples
    --------
    >>> import mrwork as mr
    >>> frame = mr.building("uts")
    >>> designed = mr.control.design_weights(
    ...     frame, frame.storeys[:1], limits={"rms_drift": 2e-3, "rms_acceleration": 1.0}, budget=500.0
    ... )
    >>> round(designed.reachable_ratio, 3)
    4.659
    """
    return WeightDesigner(
        building,
        devices,
        limits=limits,
        budget=budget,
        spectrum=spectrum,
        cases=cases,
        timing=timing,
        semi_active=semi_active,
    ).design()
