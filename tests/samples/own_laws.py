"""Laws of users that tests share, each as a user would write it for one run."""

from collections.abc import Callable
from typing import Any

import numpy as np

import mrwork as mr

_RNG = np.random.default_rng(3)
_W1, _B1 = _RNG.normal(0.0, 0.5, (16, 4)), _RNG.normal(0.0, 0.1, 16)
_W2, _B2 = _RNG.normal(0.0, 0.3, (16, 16)), _RNG.normal(0.0, 0.1, 16)
_W3 = _RNG.normal(0.0, 0.3, 16)
_SPEEDS = np.array([0.0, 0.02, 0.05, 0.1, 0.2, 0.4])
_SLOPES = np.array([0.0, 4.0, 7.0, 9.0, 9.5, 9.8])
_A = np.eye(10) + 0.01 * _RNG.normal(size=(10, 10))
_B, _C = _RNG.normal(0.0, 1e-4, (10, 2)), _RNG.normal(size=(5, 10))
_L, _K = 0.01 * _RNG.normal(size=(10, 5)), _RNG.normal(0.0, 1e3, (2, 10))
_SHARES = np.linspace(0.0, 1.0, 11)


def skyhook(sample: Any, memory: Any, settings: Any) -> Any:
    """i = gain |v|, v of the body from its accelerometer by a high-pass filter"""
    w = 2.0 * np.pi * settings.corner
    v = memory.v + sample.sample_time * (sample.acceleration[0] - 1.4 * w * memory.v - w * w * memory.x)
    memory.v, memory.x = v, memory.x + sample.sample_time * v
    return np.where(v * sample.rate > 0.0, settings.gain * np.abs(v), 0.0)


def pid(sample: Any, memory: Any, settings: Any) -> Any:
    """PID of a drift with anti-windup by back-calculation."""
    e = -sample.drift[0]
    de = (e - memory.e) / sample.sample_time
    d = memory.d + settings.filter * (de - memory.d)
    wanted = settings.kp * e + memory.i + settings.kd * d
    sent = np.clip(wanted, -sample.largest[0], sample.largest[0])
    memory.e, memory.d = e, d
    memory.i = memory.i + sample.sample_time * (settings.ki * e + settings.back * (sent - wanted))
    return sent * np.ones(2)


def hysteresis(sample: Any, memory: Any, settings: Any) -> Any:
    """On above an upper drift, off below a lower one."""
    size = np.abs(sample.drift[0])
    memory.on = (size > settings.upper) | (memory.on & (size > settings.lower))
    return np.where(memory.on, sample.largest, 0.0)


def network(sample: Any, memory: Any, settings: Any) -> Any:
    """A network 4-16-16-1."""
    signals = np.stack(
        [sample.drift[0] / 0.01, sample.rate[0] / 0.1, sample.acceleration[0] / 3.0, sample.force[0] / 1e3]
    )
    hidden = np.tanh(_W1 @ signals + _B1)
    hidden = np.maximum(_W2 @ hidden + _B2, 0.0)
    return settings.scale * sample.largest / (1.0 + np.exp(-(_W3 @ hidden + 0.1)))


_PAIRS = ((4, 16), (16, 16), (16, 1))
_LEARNED = np.concatenate([_RNG.normal(0.0, (a + 1) ** -0.5, (a + 1) * b) for a, b in _PAIRS])


def _learned(sample: Any, memory: Any, settings: Any) -> Any:
    """A network 4-16-16-1 whose numbers are a setting."""
    x: Any = np.stack(
        [
            sample.deformation[0] / 5e-3,
            sample.rate[0] / 0.1,
            sample.force[0] / 1e3,
            sample.acceleration[0] / 3.0,
        ]
    )
    at = 0
    for a, b in _PAIRS:
        w = settings.numbers[at : at + (a + 1) * b].reshape(a + 1, b)
        x, at = x @ w[:-1] + w[-1], at + (a + 1) * b
        x = np.tanh(x) if b > 1 else x
    return sample.largest / (1.0 + np.exp(-x))


def learned_network() -> mr.ControlLaw:
    """The network with an array as its setting."""
    return mr.own_law(_learned, settings={"numbers": ("1", -20.0, _LEARNED, 20.0)})


def schedule(sample: Any, memory: Any, settings: Any) -> Any:
    """A gain by a table of speeds."""
    speed = np.abs(sample.rate)
    return np.clip(settings.share * np.interp(speed, _SPEEDS, _SLOPES) * speed, 0.0, sample.largest)


def kalman(sample: Any, memory: Any, settings: Any) -> Any:
    """Clipped optimal by a Kalman filter of ten states."""
    innovation = sample.acceleration - _C @ memory.x
    memory.x = _A @ memory.x + _B @ sample.force + _L @ innovation
    wanted = -settings.scale * (_K @ memory.x)
    return sample.largest * np.where((wanted - sample.force) * sample.force > 0.0, 1.0, 0.0)


def one_step(sample: Any, memory: Any, settings: Any) -> Any:
    """The best of eleven currents by a force one step ahead."""
    force = (200.0 + 900.0 * _SHARES) * np.tanh(sample.rate[0] / 0.02) + (
        50.0 + 300.0 * _SHARES
    ) * sample.rate[0]
    cost = (sample.velocity[0] - 5e-5 * force) ** 2 + settings.effort * _SHARES**2
    return np.choose(np.argmin(cost), _SHARES) * sample.largest


def energy(sample: Any, memory: Any, settings: Any) -> Any:
    """A share of the largest command by the mean of the last fifty powers."""
    power = sample.force[0] * sample.rate[0]
    memory.last = np.concatenate([memory.last[1:], np.reshape(power, (1,))])
    return sample.largest * np.clip(1.0 - np.mean(memory.last) / settings.power, 0.0, 1.0)


def phase(sample: Any, memory: Any, settings: Any) -> Any:
    """A command by where each damper is in its cycle, of frequency w."""
    angle = np.arctan2(sample.rate, settings.w * sample.deformation)
    memory.turned = memory.turned + settings.w * sample.sample_time
    return sample.largest * np.sin(angle - settings.shift) ** 2 * (1.0 + np.cos(memory.turned)) / 2.0


def skyhook_law(**options: Any) -> mr.ControlLaw:
    """The skyhook with a high-pass filter."""
    settings = {"corner": ("Hz", 0.05, 0.3, 2.0), "gain": ("A s/m", 0.1, 6.0, 100.0)}
    return mr.own_law(skyhook, memory={"v": 0.0, "x": 0.0}, settings=settings, **options)


LAWS: dict[str, Callable[..., mr.ControlLaw]] = {
    "skyhook": skyhook_law,
    "pid": lambda **options: mr.own_law(
        pid,
        memory={"e": 0.0, "d": 0.0, "i": 0.0},
        settings={
            "kp": ("A/m", 1.0, 100.0, 1e5),
            "ki": ("A/(m s)", 0.0, 50.0, 1e5),
            "kd": ("A s/m", 0.0, 5.0, 1e3),
            "filter": ("1", 0.01, 0.2, 1.0),
            "back": ("1/s", 0.0, 20.0, 100.0),
        },
        **options,
    ),
    "hysteresis": lambda **options: mr.own_law(
        hysteresis,
        memory={"on": False},
        settings={"upper": ("m", 1e-4, 2e-3, 0.1), "lower": ("m", 1e-5, 1e-3, 0.1)},
        **options,
    ),
    "network": lambda **options: mr.own_law(network, settings={"scale": ("1", 0.0, 1.0, 2.0)}, **options),
    "schedule": lambda **options: mr.own_law(schedule, settings={"share": ("1", 0.0, 1.0, 2.0)}, **options),
    "kalman": lambda **options: mr.own_law(
        kalman, memory={"x": np.zeros(10)}, settings={"scale": ("1", 0.1, 1.0, 10.0)}, **options
    ),
    "one step": lambda **options: mr.own_law(one_step, settings={"effort": ("1", 0.0, 1e-6, 1.0)}, **options),
    "energy": lambda **options: mr.own_law(
        energy, memory={"last": np.zeros(50)}, settings={"power": ("W", 1.0, 200.0, 1e4)}, **options
    ),
    "phase": lambda **options: mr.own_law(
        phase,
        memory={"turned": 0.0},
        settings={"w": ("rad/s", 1.0, 20.0, 200.0), "shift": ("rad", -3.2, 0.3, 3.2)},
        **options,
    ),
}
"""The laws by name, with their nominal settings."""
