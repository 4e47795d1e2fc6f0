"""Checks of the signals of a test: dead channels, sampling, rest before the motion, sign and offset of the force."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import RecordError
from mrwork.records.damper_test import Finding, Measured

_SMALLEST_RANGE: Final = 1e-9
_FEWEST_PER_CYCLE: Final = 20.0
_REST_EXCURSION: Final = 0.01
_REST_CYCLES: Final = 0.25
_OFFSET_SHARE: Final = 0.05
_SIGN_SHARE: Final = 0.05


def check_varies(samples: NDArray[np.float64], quantity: str, unit: str, *, source: str) -> None:
    """Check that a channel is not constant.

    Raises
    ------
    RecordError
        The range of the samples is below a nanometre or a nanonewton.
    """
    if np.ptp(samples) < _SMALLEST_RANGE:
        value = "zero" if abs(samples[0]) < _SMALLEST_RANGE else f"constant at {samples[0]:g} {unit}"
        raise RecordError(f"{source}: the {quantity} is {value} throughout; check the channel and its wiring")


def samples_per_cycle(frequency: float, dt: float) -> tuple[Finding, ...]:
    """Warn if the dominant cycle has fewer than 20 samples."""
    per_cycle = 1.0 / (frequency * dt)
    if per_cycle >= _FEWEST_PER_CYCLE:
        return ()
    message = (
        f"only {per_cycle:.1f} samples per cycle of {frequency:.3g} Hz (at least {_FEWEST_PER_CYCLE:.0f} "
        "are advised): reversals of the motion, where the force changes most, are poorly resolved"
    )
    measured = Measured(value=per_cycle, unit="")
    return (Finding(code="few_samples_per_cycle", severity="warning", message=message, measured=measured),)


def samples_at_rest(displacement: NDArray[np.float64]) -> int:
    """Number of samples before the displacement has moved by 1 % of its peak-to-peak value.

    A harmonic motion that starts at its peak takes 0.03 periods for this.
    """
    left = np.abs(displacement - np.median(displacement[:3])) > _REST_EXCURSION * np.ptp(displacement)
    return int(np.argmax(left))


def rest_before_motion(displacement: NDArray[np.float64], dt: float, frequency: float) -> tuple[Finding, ...]:
    """Note rest at the start that lasts a quarter of the dominant period or longer."""
    rest = samples_at_rest(displacement) * dt
    if rest < _REST_CYCLES / frequency:
        return ()
    message = f"at rest for the first {rest:.2f} s of {displacement.size * dt:.2f} s"
    measured = Measured(value=rest, unit="s")
    return (Finding(code="rest_before_motion", severity="note", message=message, measured=measured),)


def mean_over_travel(force: NDArray[np.float64], velocity: NDArray[np.float64]) -> float:
    """Mean force over the distance travelled, int F |v| dt / int |v| dt [N].

    Hysteresis, viscosity and stiffness about the middle of the stroke cancel, and rest has no weight, so that a static
    offset remains. The mean of the peaks is no substitute, because measured loops are not symmetric there.
    """
    return float(np.average(force, weights=np.abs(velocity)))


def force_sign(
    force: NDArray[np.float64], velocity: NDArray[np.float64]
) -> tuple[NDArray[np.float64], tuple[Finding, ...]]:
    """Return the force with the sign that dissipates energy, and a note if the sign was changed.

    The sign is that of int F v dt / int |F v| dt over the whole record. F is relative to its mean over the distance
    travelled, so that a static offset has no effect.

    Parameters
    ----------
    force, velocity
        Shape (n_time,) [N, m/s]; the velocity is the derivative of the displacement.
    """
    power = (force - mean_over_travel(force, velocity)) * velocity
    share = float(power.sum() / np.abs(power).sum())
    if abs(share) < _SIGN_SHARE:
        message = (
            f"the energy int F v dt is only {100 * share:.1f} % of int |F v| dt, too little to "
            "determine the sign of the force; it was not changed"
        )
        return force, (Finding(code="force_sign_unclear", severity="warning", message=message),)
    if share > 0.0:
        return force, ()
    message = (
        f"the recorded force has the sign that generates energy (int F v dt is {100 * share:.0f} % of "
        "int |F v| dt); it was multiplied by -1 so that it resists the motion"
    )
    return -force, (Finding(code="force_sign_flipped", severity="note", message=message),)


def force_offset(force: NDArray[np.float64], velocity: NDArray[np.float64]) -> tuple[Finding, ...]:
    """Warn of a static offset above 5 % of the half range of the force (percentiles 0.5 and 99.5)."""
    offset = mean_over_travel(force, velocity)
    lower, upper = np.percentile(force, [0.5, 99.5])
    half_range = 0.5 * float(upper - lower)
    if abs(offset) <= _OFFSET_SHARE * half_range:
        return ()
    relative = f"{100 * abs(offset) / half_range:.0f} % of its half range of {half_range:.4g} N"
    message = (
        f"the force has a static offset of {offset:+.4g} N, {relative}: gas pressure or load-cell zero; "
        "it stays in the record unless --repair offset subtracts it"
    )
    measured = Measured(value=offset, unit="N")
    return (Finding(code="force_offset", severity="warning", message=message, measured=measured),)
