"""How long do 4000 closed-loop runs of a building take, beside numba written by hand for this building?

Clipped-optimal control (Dyke et al. 1996) of the five-storey frame `uts` by a differential pair of RD-1005-3 dampers
across its first storey, behind a driver with a lag of 190 1/s: 1000 rows of gains under four motions of 30 s, command
and Runge-Kutta step every 1 ms. mrwork, which takes any building, damper and law, is level with numba that has lanes,
floors and a tanh written out for this one: 7.5 s and 7.9 s on one thread of an Intel Xeon of 2.8 GHz. Three minutes.
"""

import math
import time

import numba
import numpy as np

import mrwork as mr
from common import Script
from timing import median_seconds, processor

script = Script(
    __file__,
    __doc__,
    quick="three candidates, one motion of 1.5 s, once",
    seed=1996,
    candidates={"type": int, "default": 1000, "help": "rows of gains, default 1000"},
    motions={"type": int, "default": 4, "help": "ground motions, default 4"},
    block={"type": int, "default": 16, "help": "runs side by side in numba, default 16"},
    seconds={"type": float, "default": 30.0, "help": "length of each, default 30"},
)
threads = script.threads or 1
numba.set_num_threads(threads)
n_candidates, n_motions, duration = script.options.candidates, script.options.motions, script.options.seconds
rounds = 3
if script.quick:
    # Three candidates fill no block; the device yields and the command switches within 1.5 s.
    n_candidates, n_motions, duration, rounds = 3, 1, 1.5, 1
STEP, LAG, LARGEST = 1e-3, 190.0, 1.88
# Runs of a block lie innermost; with the tanh of the C library numba takes five times as long. Blocks of 8 and 32 are
# the others that may be fastest on a processor.
BLOCK = script.options.block

# %% Building, gains of LQRs with scattered weights of strain, kinetic energy and force, and motions with 0.3 g.
uts = mr.building("uts")
mass = np.diag(uts.mass)
plant = mr.control.plant_of(uts, uts.storeys[0])
rng = np.random.default_rng([script.seed, 0])
strain, kinetic = 10.0 ** rng.uniform(-1.0, 1.0, (2, n_candidates))
cost = 1e-6 * 10.0 ** rng.uniform(0.0, 2.0, n_candidates)
Q = np.zeros((n_candidates, 10, 10))
Q[:, :5, :5] = strain[:, None, None] * uts.stiffness
Q[:, 5:, 5:] = kinetic[:, None, None] * uts.mass
designed = mr.control.regulator_gains(plant.A, plant.B, Q, cost[:, None, None], scaling=plant.scaling)
gains = designed.gain[:, 0]
rng = np.random.default_rng([script.seed, 1])
shaken = [mr.synthetic_motion(rng=rng, duration=duration, peak=0.3 * 9.81) for _ in range(n_motions)]

# %% Ours.
spec = mr.damper("static_hysteretic")
constants = np.array(spec.preset("kwok2006").theta[:12])
laws = {"c": "linear", "k": "linear", "alpha": "quadratic", "delta": "linear"}
pair = mr.Device(
    name="pair",
    spec=spec.with_current_laws(laws, lag="one_rate"),
    theta=[*constants, LAG],
    row=uts.storeys[0],
    largest_command=LARGEST,
    differential=True,
)
law = mr.ControlLaw(name="clipped_optimal", gains={"gain": gains[:, None, :]})
hardware = mr.Hardware(sample_time=STEP, step=STEP)
# What is kept of a run; of the floors five numbers each.
of_both = ("displacement", "acceleration", "drift", "base_shear", "force")
KEPT = (
    *(f"{kind}_{name}" for name in of_both for kind in ("peak", "rms")),
    *("peak_stroke", "peak_rate", "peak_current", "mean_current", "rms_current"),
    *("device_energy", "input_energy", "kinetic_energy", "strain_energy", "damping_energy"),
)
N_KEPT = 44


def ours():
    """Columns of `KEPT`, shape (n_candidates, n_motions, 44)."""
    found = mr.simulate_loop(uts, [pair], law, shaken, hardware, threads=threads)
    return np.column_stack([getattr(found, name) for name in KEPT]).reshape(n_candidates, n_motions, N_KEPT)


# %% numba: lanes of runs, with nothing in the step that is a call.
inlined = numba.njit(forceinline=True, fastmath=True, error_model="numpy")


@inlined
def tanh(x):
    """To 1e-14: e^(-2|x|) by a Taylor series of the argument over 128, squared seven times."""
    size = min(abs(x), 20.0)
    y = size * (-2.0 / 128.0)
    p = 1.0 / 479001600.0
    p = p * y + 1.0 / 39916800.0
    p = p * y + 1.0 / 3628800.0
    p = p * y + 1.0 / 362880.0
    p = p * y + 1.0 / 40320.0
    p = p * y + 1.0 / 5040.0
    p = p * y + 1.0 / 720.0
    p = p * y + 1.0 / 120.0
    p = p * y + 1.0 / 24.0
    p = p * y + 1.0 / 6.0
    p = p * y + 0.5
    p = (p * y + 1.0) * y
    # (1 + p)^2 - 1 = p (p + 2): what is near zero stays exact.
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    p = p * (p + 2.0)
    return math.copysign(-p / (p + 2.0), x)


@inlined
def pull(x, v, i, device):
    """f(x, v) - f(-x, -v) at the coil's current: twice what is odd of the model."""
    c = device[0] + device[1] * i
    k = device[2] + device[3] * i
    alpha = device[4] + (device[5] + device[6] * i) * i
    delta = device[8] + device[9] * i
    return 2.0 * (c * v + k * x + alpha * tanh(device[7] * v + delta * tanh(device[10] * x)))


@inlined
def stage(q, v, f, a_g, k, c, m):
    """Accelerations of the floors relative to the ground, power of the ground and of the structure's damping."""
    d0 = c[0] * v[0] + c[1] * v[1]
    d1 = c[2] * v[0] + c[3] * v[1] + c[4] * v[2]
    d2 = c[5] * v[1] + c[6] * v[2] + c[7] * v[3]
    d3 = c[8] * v[2] + c[9] * v[3] + c[10] * v[4]
    d4 = c[11] * v[3] + c[12] * v[4]
    a = (
        -(d0 + k[0] * q[0] + k[1] * q[1] + f * m[5] + a_g),
        -(d1 + k[2] * q[0] + k[3] * q[1] + k[4] * q[2] + a_g),
        -(d2 + k[5] * q[1] + k[6] * q[2] + k[7] * q[3] + a_g),
        -(d3 + k[8] * q[2] + k[9] * q[3] + k[10] * q[4] + a_g),
        -(d4 + k[11] * q[3] + k[12] * q[4] + a_g),
    )
    p = m[0] * v[0], m[1] * v[1], m[2] * v[2], m[3] * v[3], m[4] * v[4]
    entered = -a_g * (p[0] + p[1] + p[2] + p[3] + p[4])
    return a, entered, p[0] * d0 + p[1] * d1 + p[2] * d2 + p[3] * d3 + p[4] * d4


@inlined
def along(x, h, rate):
    """Floors after a step along a rate."""
    return (
        x[0] + h * rate[0],
        x[1] + h * rate[1],
        x[2] + h * rate[2],
        x[3] + h * rate[3],
        x[4] + h * rate[4],
    )


@inlined
def note(sums, peak, square, j, value):
    """Keep the peak of a quantity, and add its square."""
    sums[peak, j] = max(sums[peak, j], abs(value))
    sums[square, j] += value * value


@numba.njit(parallel=True, fastmath=True, error_model="numpy")
def kernel(k, c, m, springs, device, gains, ground, h, decay, largest):
    n_motions, n_candidates = ground.shape[0], gains.shape[0]
    n_blocks = (n_candidates + BLOCK - 1) // BLOCK
    kept = np.empty((n_candidates, n_motions, N_KEPT))
    half, sixth = 0.5 * h, h / 6.0
    for group in numba.prange(n_motions * n_blocks):
        motion, first = group // n_blocks, (group % n_blocks) * BLOCK
        # A last, incomplete block repeats the last candidate: the loop below keeps a constant length.
        gain = np.empty((10, BLOCK))
        for j in range(BLOCK):
            for row in range(10):
                gain[row, j] = gains[min(first + j, n_candidates - 1), row]
        state = np.zeros((11, BLOCK))
        sums = np.zeros((N_KEPT, BLOCK))
        for step in range(ground.shape[1]):
            g0, g1, g2 = ground[motion, step, 0], ground[motion, step, 1], ground[motion, step, 2]
            for j in range(BLOCK):
                q = state[0, j], state[1, j], state[2, j], state[3, j], state[4, j]
                v = state[5, j], state[6, j], state[7, j], state[8, j], state[9, j]
                i0 = state[10, j]
                f = pull(q[0], v[0], i0, device)
                of_q = gain[0, j] * q[0] + gain[1, j] * q[1] + gain[2, j] * q[2] + gain[3, j] * q[3]
                of_v = gain[5, j] * v[0] + gain[6, j] * v[1] + gain[7, j] * v[2] + gain[8, j] * v[3]
                wanted = -(of_q + gain[4, j] * q[4] + of_v + gain[9, j] * v[4])
                command = largest if (wanted - f) * f > 0.0 else 0.0
                i1 = (i0 - command) * decay + command
                i2 = (i1 - command) * decay + command
                state[10, j] = i2
                a, entered, lost = stage(q, v, f, g0, k, c, m)
                # Peaks and sums at the start of the step.
                note(sums, 0, 5, j, q[0])
                note(sums, 1, 6, j, q[1])
                note(sums, 2, 7, j, q[2])
                note(sums, 3, 8, j, q[3])
                note(sums, 4, 9, j, q[4])
                note(sums, 10, 15, j, a[0] + g0)
                note(sums, 11, 16, j, a[1] + g0)
                note(sums, 12, 17, j, a[2] + g0)
                note(sums, 13, 18, j, a[3] + g0)
                note(sums, 14, 19, j, a[4] + g0)
                note(sums, 20, 25, j, q[0])
                note(sums, 21, 26, j, q[1] - q[0])
                note(sums, 22, 27, j, q[2] - q[1])
                note(sums, 23, 28, j, q[3] - q[2])
                note(sums, 24, 29, j, q[4] - q[3])
                inertia = m[0] * a[0] + m[1] * a[1] + m[2] * a[2] + m[3] * a[3] + m[4] * a[4]
                note(sums, 30, 31, j, m[6] * g0 + inertia)
                note(sums, 32, 33, j, f)
                sums[34, j] = max(sums[34, j], abs(q[0]))
                sums[35, j] = max(sums[35, j], abs(v[0]))
                note(sums, 36, 38, j, i0)
                sums[37, j] += i0
                taken = f * v[0]
                # The second stage, from half a step along the first; the third, from half a step along the second.
                v2, q2 = along(v, half, a), along(q, half, v)
                f = pull(q2[0], v2[0], i1, device)
                a2, power, loss = stage(q2, v2, f, g1, k, c, m)
                entered, lost, taken = entered + 2.0 * power, lost + 2.0 * loss, taken + 2.0 * (f * v2[0])
                v3, q3 = along(v, half, a2), along(q, half, v2)
                f = pull(q3[0], v3[0], i1, device)
                a3, power, loss = stage(q3, v3, f, g1, k, c, m)
                entered, lost, taken = entered + 2.0 * power, lost + 2.0 * loss, taken + 2.0 * (f * v3[0])
                # The fourth, from a whole step along the third.
                v4, q4 = along(v, h, a3), along(q, h, v3)
                f = pull(q4[0], v4[0], i2, device)
                a4, power, loss = stage(q4, v4, f, g2, k, c, m)
                sums[40, j] += sixth * (entered + power)
                sums[43, j] += sixth * (lost + loss)
                sums[39, j] += sixth * (taken + f * v4[0])
                q = along(q, sixth, along(along(along(v, 2.0, v2), 2.0, v3), 1.0, v4))
                v = along(v, sixth, along(along(along(a, 2.0, a2), 2.0, a3), 1.0, a4))
                state[0, j], state[1, j], state[2, j], state[3, j], state[4, j] = q
                state[5, j], state[6, j], state[7, j], state[8, j], state[9, j] = v
        # Peaks at the end, which begins no step.
        for j in range(BLOCK):
            q = state[0, j], state[1, j], state[2, j], state[3, j], state[4, j]
            v = state[5, j], state[6, j], state[7, j], state[8, j], state[9, j]
            f = pull(q[0], v[0], state[10, j], device)
            a, _, _ = stage(q, v, f, g2, k, c, m)
            shear, below = m[6] * g2, 0.0
            for floor in range(5):
                ends = (floor, q[floor]), (10 + floor, a[floor] + g2), (20 + floor, q[floor] - below)
                for place, value in ends:
                    sums[place, j] = max(sums[place, j], abs(value))
                shear, below = shear + m[floor] * a[floor], q[floor]
            for place, value in ((30, shear), (32, f), (34, q[0]), (35, v[0]), (36, state[10, j])):
                sums[place, j] = max(sums[place, j], abs(value))
        for j in range(min(BLOCK, n_candidates - first)):
            for column in range(N_KEPT):
                kept[first + j, motion, column] = sums[column, j]
            kinetic = strain = below = 0.0
            for floor in range(5):
                kinetic += 0.5 * m[floor] * state[5 + floor, j] ** 2
                strain += 0.5 * springs[floor] * (state[floor, j] - below) ** 2
                below = state[floor, j]
            kept[first + j, motion, 41], kept[first + j, motion, 42] = kinetic, strain
    return kept


# Rows of M^-1 K and M^-1 C without their zeros, springs of the storeys, the ground straight between its samples.
near = np.abs(np.subtract.outer(range(5), range(5))) <= 1
k, c = (tuple((matrix / mass[:, None])[near]) for matrix in (uts.stiffness, uts.damping))
above = -np.diag(uts.stiffness, 1)
springs = (uts.stiffness[0, 0] - above[0], *above)
m = (*mass, 1.0 / mass[0], mass.sum())
device = (*constants[:10], 1.0 / constants[10])
n_steps = round(shaken[0].duration / STEP)
instants = STEP * (np.arange(n_steps)[:, None] + np.array([0.0, 0.5, 1.0]))
ground = np.array(
    [
        np.interp(instants, motion.dt * np.arange(motion.acceleration.size), motion.acceleration)
        for motion in shaken
    ]
)
decay = math.exp(-0.5 * LAG * STEP)


def numba_series(gains=gains):
    kept = kernel(k, c, m, springs, device, gains, ground, STEP, decay, LARGEST)
    squares = [*range(5, 10), *range(15, 20), *range(25, 30), 31, 33, 38]
    kept[..., squares] = np.sqrt(kept[..., squares] / n_steps)
    kept[..., 37] /= n_steps
    return kept


# %% What is kept of the runs must agree: no decision is near enough to a tie to be turned by rounding.
script.say("compiling numba")
began = time.perf_counter()
numba_series(gains[:1])
compiling = time.perf_counter() - began
expected = ours()
difference = float(np.max(np.abs(numba_series() - expected) / np.abs(expected).max(axis=(0, 1))))
script.table(
    "agreement", {"numba_series": {"difference": difference}}, title="Largest of what is kept", digits=2
)

# %% Seconds of all runs in turns.
script.say("timing")
seconds = median_seconds({"mrwork": ours, "numba_series": numba_series}, rounds, 0.0)
instructions = mr.instruction_set()
variants = {"mrwork": f"simulate_loop, {instructions.used}", "numba_series": f"blocks of {BLOCK}, fastmath"}
rows = {
    tool: {
        **{"tool": tool, "threads": threads, "runs": n_candidates * n_motions, "seconds": seconds[tool]},
        **{"ratio": seconds[tool] / seconds["mrwork"], "extrapolated": False},
        **{"compile_seconds": compiling if tool == "numba_series" else 0.0, "variant": variants[tool]},
        "difference": difference if tool == "numba_series" else 0.0,
    }
    for tool in seconds
}
title = f"{n_candidates} candidates x {n_motions} motions of {duration:g} s, medians in turns; {processor()}"
script.table("rows", rows, title=title, digits=3)
script.check()
