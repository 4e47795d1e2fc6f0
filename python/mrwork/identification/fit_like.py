"""A model of the package fitted to the force of another damper over its tested range: what runs in lanes everywhere."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mrwork.base.arguments import Seed, Threads, checked
from mrwork.base.remark import Measured, RemarkKind
from mrwork.base.values import Floats
from mrwork.dampers.laws import MOST_DEGREE, CommandLaw
from mrwork.dampers.parameters import RATE_NAMES
from mrwork.dampers.simulation import Loading, simulate_force
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.dampers.tested_range import OperatingRange
from mrwork.errors import SettingError
from mrwork.identification.commands import CommandedTests
from mrwork.identification.fit import Fit
from mrwork.identification.identify import identify
from mrwork.records import DamperTest
from mrwork.records.read import test_from_arrays

# Shares of the tested stroke and velocity of the sinusoids that are fitted, and of a sum of two that is not.
_SINES = ((1.0, 1.0), (0.5, 1.0), (1.0, 0.3), (0.25, 0.3))
_UNSEEN = ((0.5, 0.5), (0.3, 0.4))
_CYCLES, _PER_CYCLE = 3, 200
_LEVELS = 4
_LIKE = RemarkKind(
    "fitted_to_model",
    "it is fitted to the force of {0}, not to tests, and differs from it by {value:.2g} % of the force over its tested "
    "range, at most {most:.2g} % ({1}), and by {unseen:.2g} % under a motion that was not fitted",
)


@checked
def fit_like(
    fit: Fit, model: str | DamperSpec = "normalised_bouc_wen", *, rng: Seed = 0, threads: Threads = 0
) -> Fit:
    """Fit a model of the package to the simulated force of an identified damper, such as one in Python.

    The motions are four sinusoids that reach the tested stroke and velocity of `fit`, at four commands over the tested
    ones where it follows one.

    Parameters
    ----------
    fit
        The damper whose force is fitted.
    model
        Name of a model, or a model with current laws. Without laws, each positive parameter that scales with the
        force follows the command by its values at up to four levels.
    rng, threads
        As of `identify`.

    Returns
    -------
    Fit
        With the tested ranges of `fit`. Its one remark says how close the forces are, in per cent of the root mean
        square of the force: over these motions, and under one between them that was not fitted.

    Raises
    ------
    SettingError
        If the damper follows a command, and the tested ones are not known.

    Examples
    --------
    >>> import mrwork as mr
    >>> fit = mr.identify("hyperbolic_tangent_guo", mr.synthetic_test("spencer1997"))
    >>> near = mr.fit_like(fit, "bingham")
    >>> near.model, near.tested == fit.tested
    ('bingham', True)
    """
    spec, tested = fit.spec, fit.tested
    plain = damper(model) if isinstance(model, str) else model
    commands = _commands(spec, tested)
    loaded = [_loading(tested, [share], command) for share in _SINES for command in commands]
    tests = tuple(_test(fit, loading, number) for number, loading in enumerate(loaded, start=1))
    like = _with_laws(plain, spec, tests)
    # Constant commands do not show the lag of the driver.
    held = {name: (fit.parameters[name].value,) * 2 for name in RATE_NAMES & {*spec.names} & {*like.names}}
    near = identify(like, tests, rng=rng, threads=threads, bounds=held)
    theta = np.array(near.theta)
    apart = [
        _percent(near.spec, theta, loading, test.force) for loading, test in zip(loaded, tests, strict=True)
    ]
    worst = tests[int(np.argmax(apart))].name
    between = _loading(tested, _UNSEEN, commands[len(commands) // 2])
    unseen = _percent(near.spec, theta, between, _test(fit, between, 0).force)
    mean = Measured(float(np.mean(apart)), "%")
    remark = _LIKE.remark(fit.model, worst, measured=mean, most=max(apart), unseen=unseen)
    # The data are simulated: doubts about measurements do not apply.
    return replace(near, tested=tested, remarks=(remark,))


def _commands(spec: DamperSpec, tested: OperatingRange) -> list[float | None]:
    if not spec.follows_command:
        return [None]
    if tested.command is None:
        raise SettingError(f"the commands of {spec.name} are not known; identify it from tests with theirs")
    return [float(level) for level in np.linspace(*tested.command, _LEVELS)]


def _loading(tested: OperatingRange, shares: Sequence[tuple[float, float]], command: float | None) -> Loading:
    """A sum of sinusoids, each of these shares of the tested stroke and velocity."""
    sines = [
        (of_stroke * tested.stroke, of_velocity * tested.velocity / (of_stroke * tested.stroke))
        for of_stroke, of_velocity in shares
    ]
    fastest, slowest = max(omega for _, omega in sines), min(omega for _, omega in sines)
    dt = 2.0 * np.pi / (_PER_CYCLE * fastest)
    time = dt * np.arange(round(_CYCLES * 2.0 * np.pi / slowest / dt) + 1)
    return Loading(
        dt=dt,
        displacement=sum(stroke * np.sin(omega * time) for stroke, omega in sines),
        velocity=sum(stroke * omega * np.cos(omega * time) for stroke, omega in sines),
        command=command,
        command_unit=None if command is None else tested.command_unit,
    )


def _test(fit: Fit, loading: Loading, number: int) -> DamperTest:
    """The force of the fitted damper under a loading, as a test."""
    stroke = 500.0 * float(np.ptp(loading.displacement))
    at = f", {loading.command:g} {loading.command_unit}" if isinstance(loading.command, float) else ""
    return test_from_arrays(
        name=f"motion {number}, {stroke:.3g} mm{at}",
        time=loading.dt * np.arange(len(loading.displacement)),
        displacement=loading.displacement,
        velocity=loading.velocity,
        force=simulate_force(fit.spec, fit.theta, loading),
        command=loading.command,
        command_unit=loading.command_unit,
        synthetic=True,
        keep_velocity=True,
    )


def _with_laws(model: DamperSpec, like: DamperSpec, tests: tuple[DamperTest, ...]) -> DamperSpec:
    if like.command_unit is None or not like.follows_command or model.command_unit is not None:
        return model
    # As many values as there are commands, since the force to be fitted has no noise.
    commands = CommandedTests.of(like, tests).commands
    degree = min(len(commands) - 1, MOST_DEGREE)
    law = CommandLaw(degree, form="log_polynomial" if degree else "polynomial").at_commands(commands.tolist())
    following = {
        parameter.name: law
        for parameter in model.plain
        if parameter.scales_with_force and parameter.lower > 0.0
    }
    return model.with_current_laws(following, unit=like.command_unit, lag=like.lag)


def _percent(spec: DamperSpec, theta: Floats, loading: Loading, force: Floats) -> float:
    difference = simulate_force(spec, theta, loading) - force
    return 100.0 * float(np.linalg.norm(difference) / np.linalg.norm(force))
