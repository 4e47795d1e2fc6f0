"""Printed dampers, driven by samples, and the force of their straight motions by an integration of our own."""

import ctypes
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from c_programs import library

from mrwork.embedded.c_source import CSource

Floats = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

_DRIVER = """
#include "damper.h"
static damper_memory m;
void begin(double command) { damper_start(&m, &damper_fitted, command); }
void spoil(int entry, double value) { if (entry < 0) m.current = value; else m.state[entry] = value; }
void drive(int n, const double *x, const double *v, const double *u, const unsigned *missed, double *force,
           unsigned *status) {
    for (int i = 0; i < n; ++i) {
        const damper_input in = {x[i], v[i], u[i]};
        damper_miss(&m, missed[i]);
        force[i] = damper_step(&m, &in);
        status[i] = m.status;
    }
}
int retune(int parameter, double value) {
    damper_parameters p = damper_fitted;
    ((double *)&p)[parameter] = value;
    return damper_retune(&m, &p);
}
unsigned long replaced(void) { return m.replaced; }
unsigned long healed(void) { return m.healed; }
double age(int which) { return (double)m.age[which]; }
void limits(double *out) { for (int i = 0; i < 5; ++i) out[i] = ((const double *)&damper_believed)[i]; }
"""


@dataclass(frozen=True)
class Driven:
    """Force [N] and word of status of each sample, shape (n_time,), and how many readings were replaced."""

    force: Floats
    status: np.ndarray[tuple[int], np.dtype[np.uint32]]
    replaced: int


class PrintedDamper:
    """A damper of the name `damper`, compiled."""

    def __init__(self, source: CSource, folder: Path) -> None:
        folder.mkdir(exist_ok=True)
        files = {name: text for name, text in source.files.items() if "check" not in name}
        self.library = library(folder, files | {"drive.c": _DRIVER})
        self.library.begin.argtypes = [ctypes.c_double]
        self.library.spoil.argtypes = [ctypes.c_int, ctypes.c_double]
        self.library.retune.argtypes = [ctypes.c_int, ctypes.c_double]
        self.library.age.restype = ctypes.c_double

    @property
    def limits(self) -> list[float]:
        """What is believed: displacement, velocity, acceleration, lowest and highest command."""
        values = (ctypes.c_double * 5)()
        self.library.limits(values)
        return [*values]

    def begin(self, command: float = 0.0) -> None:
        """Start at rest."""
        self.library.begin(command)

    def drive(self, motion: Floats, missed: Floats | None = None) -> Driven:
        """Go on through samples of displacement, velocity and command, shape (3, n_time)."""
        x, v, u = np.ascontiguousarray(motion, dtype=np.float64)
        before = np.zeros(len(x)) if missed is None else missed
        force, status = np.empty(len(x)), np.empty(len(x), dtype=np.uint32)
        arrays = x, v, u, np.ascontiguousarray(before, dtype=np.uint32), force, status
        self.library.drive(len(x), *(each.ctypes.data_as(ctypes.c_void_p) for each in arrays))
        return Driven(force=force, status=status, replaced=self.library.replaced())

    def run(self, motion: Floats) -> Driven:
        """The samples from rest."""
        self.begin(float(motion[2, 0]))
        return self.drive(motion)


def sine(speed: float, hertz: float, dt: float, count: int, command: float = 0.0) -> Floats:
    """Displacement, velocity and command of a sine, shape (3, n_time)."""
    phase = 2.0 * np.pi * hertz * dt * np.arange(count)
    amplitude = speed / (2.0 * np.pi * hertz)
    return np.stack([amplitude * np.sin(phase), speed * np.cos(phase), np.full(count, command)])


def noise(speed: float, dt: float, count: int, command: float = 0.0) -> Floats:
    """The same of a velocity that is another at every sample."""
    velocity = speed * np.random.default_rng(3).uniform(-1.0, 1.0, count)
    displacement = dt * np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]))])
    return np.stack([displacement, velocity, np.full(count, command)])


def integrated(
    rate: Callable[[Floats, float, float], Floats],
    force: Callable[[Floats, float, float], float],
    n_states: int,
    motion: Floats,
    dt: float,
    finer: int = 400,
) -> Floats:
    """Force along straight lines by Runge-Kutta with equal steps, shape (n_time,), written apart from the package."""
    state, forces, h = np.zeros(n_states), [], dt / finer
    x, v, _ = motion.tolist()
    for sample in range(len(x)):
        forces.append(force(state, x[sample], v[sample]))
        if sample + 1 == len(x):
            break
        slope, step = (v[sample + 1] - v[sample]) / dt, (x[sample + 1] - x[sample]) / dt
        for part in range(finer):
            at = [
                (x[sample] + step * t, v[sample] + slope * t)
                for t in (part * h, (part + 0.5) * h, (part + 1) * h)
            ]
            one = rate(state, *at[0])
            two = rate(state + 0.5 * h * one, *at[1])
            three = rate(state + 0.5 * h * two, *at[1])
            four = rate(state + h * three, *at[2])
            state = state + h / 6.0 * (one + 2.0 * two + 2.0 * three + four)
    return np.array(forces)
