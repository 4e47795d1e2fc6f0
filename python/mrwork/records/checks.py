"""Checks of the signals of a test: constant channels, sampling, rest, breakaway, force sign and offset."""

from __future__ import annotations

from typing import Final

import numpy as np

from mrwork.base.values import Floats
from mrwork.errors import RecordError
from mrwork.records.damper_test import DamperTest, Finding, Measured
from mrwork.records.motion import Smoother, SmoothMotion

_SMALLEST_RANGE: Final = 1e-9
_LARGEST: Final = 1e15
_FEWEST_PER_CYCLE: Final = 20.0
_REST_EXCURSION: Final = 0.01
_REST_CYCLES: Final = 0.25
_OFFSET_SHARE: Final = 0.05
FORCE_OFFSET: Final = "force_offset"
_SIGN_SHARE: Final = 0.05


def check_possible(samples: Floats, quantity: str, *, source: str) -> None:
    """Check that no sample is so large that its powers overflow."""
    peak = float(np.abs(samples).max(initial=0.0))
    if not peak <= _LARGEST:
        raise RecordError(
            f"{source}: the {quantity} reaches {peak:.3g} in SI units, beyond any test; check the channel and its unit"
        )


def check_varies(samples: Floats, quantity: str, unit: str, *, source: str) -> None:
    """Check that a channel is not constant."""
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
    action = f"sample at {_FEWEST_PER_CYCLE * frequency:.3g} Hz or more"
    measured = Measured(value=per_cycle, unit="")
    return (Finding.warning("few_samples_per_cycle", message, action=action, measured=measured),)


def samples_at_rest(displacement: Floats) -> int:
    """Number of samples until 1 % of the stroke; a harmonic motion from its peak takes 0.03 periods."""
    left = np.abs(displacement - np.median(displacement[:3])) > _REST_EXCURSION * np.ptp(displacement)
    return int(np.argmax(left))


def rest_before_motion(displacement: Floats, dt: float, frequency: float) -> tuple[Finding, ...]:
    """Note rest at the start that lasts a quarter of the dominant period or longer."""
    rest = samples_at_rest(displacement) * dt
    if rest < _REST_CYCLES / frequency:
        return ()
    message = f"at rest for the first {rest:.2f} s of {displacement.size * dt:.2f} s"
    measured = Measured(value=rest, unit="s")
    return (Finding.note("rest_before_motion", message, measured=measured),)


# The start ends at this fraction of the peak-to-peak stroke. The overshoot must exceed this fraction of the half range
# of the force, and this number of standard errors.
_BREAKAWAY_STROKE: Final = 0.05
_BREAKAWAY_SHARE: Final = 0.05
_BREAKAWAY_ERRORS: Final = 4.0


def breakaway_overshoot(test: DamperTest, motion: SmoothMotion) -> Measured | None:
    """Excess of the force at the first movement over all later ones [N], about the mean; `None` without rest before."""
    rest = samples_at_rest(test.displacement)
    if rest * test.dt * motion.frequency < _REST_CYCLES:
        return None
    moved = np.abs(test.displacement - test.displacement[0]) > _BREAKAWAY_STROKE * np.ptp(test.displacement)
    started = int(np.argmax(moved))
    if started + 1 >= moved.size:
        return None
    force = np.abs(test.force - mean_over_travel(test.force, motion.velocity))
    smoother = Smoother(window=5, dt=test.dt)
    noise = smoother.noise(test.force - smoother.smooth(test.force))
    first = slice(max(rest - 2, 0), started + 1)
    overshoot = float(force[first].max() - force[started + 1 :].max())
    return Measured(value=overshoot, standard_error=noise * float(np.sqrt(2.0)), unit="N")


def breakaway_finding(test: DamperTest, motion: SmoothMotion) -> tuple[Finding, ...]:
    """Warn of a breakaway force above all later forces by at least 5 % of the half range."""
    overshoot = breakaway_overshoot(test, motion)
    if overshoot is None or overshoot.standard_error is None:
        return ()
    least = max(_BREAKAWAY_SHARE * half_range(test.force), _BREAKAWAY_ERRORS * overshoot.standard_error)
    if overshoot.value < least:
        return ()
    message = (
        f"the damper broke away from rest with {overshoot.value:.3g} N more than any later force: stiction, "
        "which the models do not include"
    )
    return (
        Finding.warning("breakaway", message, action="remove the start by --repair rest", measured=overshoot),
    )


def mean_over_travel(force: Floats, velocity: Floats) -> float:
    """Mean force over the distance travelled, int F |v| dt / int |v| dt [N].

    Hysteresis, viscosity and stiffness about the middle of the stroke cancel, and rest has no weight, so that a static
    offset remains. The mean of the peaks is no substitute, because measured loops are not symmetric there.
    """
    return float(np.average(force, weights=np.abs(velocity)))


def half_range(force: Floats) -> float:
    """Half the range of a force [N] between its percentiles 0.5 and 99.5, which outliers do not affect."""
    return 0.5 * float(np.ptp(np.percentile(force, [0.5, 99.5])))


def force_sign(force: Floats, velocity: Floats) -> tuple[Floats, tuple[Finding, ...]]:
    """The force [N] with the sign that dissipates energy, and a note if it was changed.

    The sign is that of int F v dt / int |F v| dt, with the derivative v of the displacement, and F about its mean over
    the distance travelled.
    """
    power = (force - mean_over_travel(force, velocity)) * velocity
    whole = float(np.abs(power).sum())
    share = float(power.sum()) / whole if whole > 0.0 else 0.0
    if abs(share) < _SIGN_SHARE:
        message = (
            f"the energy int F v dt is only {100 * share:.1f} % of int |F v| dt, too little to "
            "determine the sign of the force, which was not changed"
        )
        action = "check the sign of the channel"
        return force, (Finding.warning("force_sign_unclear", message, action=action),)
    if share > 0.0:
        return force, ()
    message = (
        f"the recorded force has the sign that generates energy (int F v dt is {100 * share:.0f} % of "
        "int |F v| dt); it was multiplied by -1 so that it resists the motion"
    )
    return -force, (Finding.note("force_sign_flipped", message),)


def force_offset(force: Floats, velocity: Floats) -> tuple[Finding, ...]:
    """Note a static offset above 5 % of the half range of the force, which every model has a parameter for."""
    offset = mean_over_travel(force, velocity)
    scale = half_range(force)
    # A force of a few spikes has no range between the percentiles.
    if scale == 0.0 or abs(offset) <= _OFFSET_SHARE * scale:
        return ()
    relative = f"{100 * abs(offset) / scale:.0f} % of its half range of {scale:.4g} N"
    message = (
        f"the force has a static offset of {offset:+.4g} N, {relative}: gas pressure or the zero of the load cell, "
        "which a model describes by f0 or k x0"
    )
    return (Finding.note(FORCE_OFFSET, message, measured=Measured(value=offset, unit="N")),)
