"""Build a checked damper test from channels in SI, for files and for arrays alike."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mrwork.arguments import AnyArrayLike, NotNegative, checked
from mrwork.command_signal import Command, ringing_samples, without_ringing
from mrwork.errors import RecordError
from mrwork.records import checks
from mrwork.records.command import command_of, motion_matches_name
from mrwork.records.damper_test import DamperTest, Finding, VelocitySource
from mrwork.records.detectors.cycles import drift_finding, mass_finding
from mrwork.records.detectors.delay import delay_finding
from mrwork.records.detectors.smoothing import smoothing_finding, smoothing_of
from mrwork.records.detectors.spikes import without_spikes
from mrwork.records.detectors.velocity import velocity_agrees
from mrwork.records.motion import Smoother, SmoothMotion, motion_of
from mrwork.records.sampling import Signals, check_time, complete_rows, uniform_step
from mrwork.records.window import settling_samples, spans_with, uncompared_spans
from mrwork.units import CommandUnit
from mrwork.values import frozen

_DETECTORS: Final[tuple[Callable[[DamperTest, SmoothMotion], tuple[Finding, ...]], ...]] = (
    smoothing_finding,
    delay_finding,
    mass_finding,
    checks.breakaway_finding,
    checks.clipping_findings,
    drift_finding,
)

_DERIVED: Final[VelocitySource] = "derived"


@checked
def build_damper_test(
    *,
    name: str,
    time: AnyArrayLike,
    displacement: AnyArrayLike,
    force: AnyArrayLike,
    velocity: AnyArrayLike | None = None,
    current: AnyArrayLike | None = None,
    voltage: AnyArrayLike | None = None,
    command: AnyArrayLike | None = None,
    command_unit: CommandUnit | None = None,
    amplitude: NotNegative | None = None,
    frequency: NotNegative | None = None,
    synthetic: bool = False,
    path: str = "",
    sha256: str | None = None,
    locate: Callable[[int], str] | None = None,
) -> DamperTest:
    """Check the channels of one test, put them on a uniform step, and run all detectors.

    Parameters
    ----------
    name
        Name of the test in reports and messages.
    time, displacement, force
        Shape (n_time,) [s, m, N]; at least 10 samples, time increasing.
    velocity
        Shape (n_time,) [m/s]; derived from the displacement when absent.
    current, voltage
        Command [A, V], one number or shape (n_time,). The test has its median if it is constant within noise; else
        each sample is held until the next.
    command, command_unit
        Likewise the command of a damper that follows another scalar, in its own unit, such as "mm" or "%".
    amplitude, frequency
        Nominal values [m, Hz], compared with half the peak to peak of the motion and its dominant frequency.
    synthetic
        Whether the test was simulated.
    path, sha256
        File and its hash; without a hash, that of the bytes of the arrays.
    locate
        Describes a row of the file in messages; by default its sample number.

    Raises
    ------
    RecordError
        The channels are not a valid test; the message names the first invalid row.

    Examples
    --------
    >>> import numpy as np
    >>> time = np.linspace(0.0, 2.0, 401)
    >>> test = build_damper_test(name="sine", time=time, displacement=0.01 * np.sin(6.28 * time),
    ...                          force=-500.0 * np.cos(6.28 * time))
    >>> [finding.code for finding in test.findings]
    ['velocity_derived', 'force_sign_flipped']
    """
    source = path or name
    where = locate or (lambda row: f"sample {row + 1}")
    raw = Signals(
        time=_channel(time, "time", source),
        displacement=_channel(displacement, "displacement", source),
        force=_channel(force, "force", source),
        velocity=None if velocity is None else _channel(velocity, "velocity", source),
    )
    amperes, about_current = _command(current, "current", "A", source, raw.time.size)
    volts, about_voltage = _command(voltage, "voltage", "V", source, raw.time.size)
    scalar, about_scalar = _command(command, "command", command_unit or "A", source, raw.time.size)
    given = replace(
        raw, current=_if_varying(amperes), voltage=_if_varying(volts), command=_if_varying(scalar)
    )
    for channel_name, channel in given.channels():
        if channel.size != raw.time.size:
            raise RecordError(
                f"{source}: the {channel_name} has {channel.size} samples where the time has "
                f"{raw.time.size}; give one value per sample"
            )
    findings: list[Finding] = []
    complete, first_row, dropped = complete_rows(given, source=source, locate=where)
    check_time(complete.time, source=source, locate=lambda row: where(row + first_row))
    for channel_name, channel in complete.channels():
        checks.check_possible(channel, channel_name, source=source)
    checks.check_varies(complete.displacement, "displacement", "m", source=source)
    checks.check_varies(complete.force, "force", "N", source=source)
    smooth, spiky, about_spikes = without_spikes(complete)
    uniform = uniform_step(smooth, spiky, source=source)
    signals, dt = uniform.signals, uniform.dt
    findings += [*dropped, *about_spikes, *uniform.findings]

    displaced = signals.displacement
    motion = motion_of(displaced, dt)
    uncompared = uncompared_spans(displaced, motion.velocity, uniform.spiky, uniform.missing, dt)
    about_velocity: tuple[Finding, ...] = (_velocity_derived(motion.smoother),)
    moving, velocity_source = motion.velocity, _DERIVED
    if signals.velocity is not None:
        moving, velocity_source, about_velocity = velocity_agrees(
            signals.velocity, displaced, motion, uncompared
        )
    rings = np.zeros(displaced.size, dtype=np.bool_)
    commands: dict[str, Command | None] = {"current": amperes, "voltage": volts, "command": scalar}
    for channel_name, unit in (("current", "A"), ("voltage", "V"), ("command", command_unit)):
        sent = getattr(signals, channel_name)
        if sent is not None and unit is not None:
            rings |= ringing_samples(sent, unit)
            commands[channel_name] = frozen(without_ringing(sent, unit))
    resisting, about_sign = checks.force_sign(signals.force, motion.velocity)
    findings += [
        *about_velocity,
        *about_sign,
        # A varying command weighs the directions of motion differently, so that the mean force is no static one.
        *(() if given.has_commands else checks.force_offset(resisting, motion.velocity)),
        *checks.stroke_finding(displaced),
        *checks.rest_before_motion(displaced, dt, motion.frequency),
        *checks.samples_per_cycle(motion.frequency, dt),
        *about_current,
        *about_voltage,
        *about_scalar,
        *motion_matches_name(displaced, motion.frequency, dt * displaced.size, amplitude, frequency),
    ]
    test = DamperTest(
        name=name,
        path=path,
        sha256=_digest(raw, current, voltage, command) if sha256 is None else sha256,
        dt=dt,
        start_time=float(signals.time[0]),
        displacement=frozen(displaced),
        velocity=frozen(moving),
        force=frozen(resisting),
        velocity_source=velocity_source,
        n_settle=settling_samples(displaced),
        uncompared=spans_with(uncompared, rings),
        current=commands["current"],
        voltage=commands["voltage"],
        command=commands["command"],
        command_unit=command_unit,
        amplitude=amplitude,
        frequency=frequency,
        synthetic=synthetic,
    )
    test = replace(test, smoothing=smoothing_of(test, motion.frequency))
    return replace(test, findings=(*findings, *examine(test, motion)))


def examine(test: DamperTest, motion: SmoothMotion) -> tuple[Finding, ...]:
    """Run all detectors on a test, whose smoothed motion is given."""
    return tuple(finding for detector in _DETECTORS for finding in detector(test, motion))


def _channel(samples: ArrayLike, name: str, source: str) -> NDArray[np.float64]:
    channel = np.asarray(samples, dtype=np.float64)
    if channel.ndim != 1:
        raise RecordError(
            f"{source}: the {name} must have shape (n_time,), got {channel.shape}; give one channel"
        )
    return channel


def _command(
    samples: ArrayLike | None, quantity: str, unit: CommandUnit, source: str, n_time: int
) -> tuple[Command | None, tuple[Finding, ...]]:
    if samples is None:
        return None, ()
    channel = _channel(np.atleast_1d(samples), quantity, source)
    # A constant one is not compared with the other channels later; a number of a MATLAB file is an array of one.
    if channel.size not in (1, n_time):
        raise RecordError(
            f"{source}: the {quantity} has {channel.size} samples where the time has {n_time}; give one value per "
            "sample, or a number"
        )
    return command_of(channel, quantity, unit, source=source)


def _if_varying(command: Command | None) -> NDArray[np.float64] | None:
    return command if isinstance(command, np.ndarray) else None


def _velocity_derived(smoother: Smoother) -> Finding:
    return Finding(
        code="velocity_derived",
        severity="note",
        message="no velocity given; derived from the displacement by a cubic Savitzky-Golay filter over "
        f"{smoother.window} samples ({1e3 * smoother.window * smoother.dt:.3g} ms)",
    )


def _digest(raw: Signals, *commands: ArrayLike | None) -> str:
    named = [*raw.channels(), *zip(("current", "voltage", "command"), commands, strict=True)]
    digest = hashlib.sha256()
    for name, samples in named:
        if samples is not None:
            digest.update(name.encode())
            # Little-endian on every machine, so that the hash depends on the values only.
            digest.update(np.ascontiguousarray(samples, dtype="<f8").tobytes())
    return digest.hexdigest()
