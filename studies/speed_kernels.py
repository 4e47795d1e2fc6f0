"""How many Runge-Kutta steps of the normalised Bouc-Wen model are done in a second, beside jax and numba?

Misfits of a batch of candidates on one record of 2000 samples, one step per sample. With a general exponent n, and
exp(n ln|w|) for the peers, which is faster than a power and less accurate, 1024 candidates on one thread of an AMD
EPYC of family 26 took 8.5 times the steps per second of jax and 11 times those of numba; with n = 2 1.5 and 1.1 times.
Three minutes.
"""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numba
import numpy as np
from jax import lax
from jax.sharding import Mesh, NamedSharding, PartitionSpec
from scipy.interpolate import CubicSpline

import mrwork as mr
from common import Script
from timing import median_seconds, processor

script = Script(
    __file__, __doc__, quick="a batch of 64 with a general exponent, 200 samples, once", seed=2007
)
threads = script.threads or 1
jax.config.update("jax_enable_x64", True)
numba.set_num_threads(threads)
MODEL, DT = "normalised_bouc_wen", 1e-3

# %% 10 mm at 1 Hz with a 1 mm sweep from 1 to 8 Hz on top, 0.12 m/s at the most; friction and a dashpot as its force.
time = DT * np.arange(200 if script.quick else 2000)
displacement = 0.010 * np.sin(2.0 * np.pi * time) + 0.001 * np.sin(2.0 * np.pi * (1.0 + 1.75 * time) * time)
velocity = np.gradient(displacement, DT)
measured = 600.0 * np.tanh(velocity / 0.02) + 1500.0 * velocity
test = replace(mr.test_from_arrays(time, displacement, measured, synthetic=True), n_settle=0)
posed = mr.objective(MODEL, test, observe="none", threads=threads)
objective = posed.objective

# The peers are given displacement and velocity at the start, middle and end of each step, so that only steps are timed.
instants = test.time[:-1, None] + DT * np.array([0.0, 0.5, 1.0])
splines = [CubicSpline(test.time, signal)(instants) for signal in (test.displacement, test.velocity)]
stages, force = np.stack(splines, axis=-1), test.force


# %% jax: one scan over the samples for the whole batch, jitted, candidates split over one device per core.
def by_jax(theta, power, unroll, bits):
    """The call that is timed: sums of squared residuals, shape (n_batch,)."""

    def misfit(theta, stages, force):
        c, k, x0, k_w, rho, sigma, n = theta

        def rate(v, w):
            speed = jnp.abs(v)
            opposing = sigma * jnp.where(w < 0, -speed, speed) - (sigma - 1.0) * v
            return rho * (v - power(w, n) * opposing)

        def step(carry, inputs):
            w, total = carry
            table, measured = inputs
            v_start, v_middle, (x_end, v_end) = table[0, 1], table[1, 1], table[2]
            k1 = rate(v_start, w)
            k2 = rate(v_middle, w + 0.5 * DT * k1)
            k3 = rate(v_middle, w + 0.5 * DT * k2)
            k4 = rate(v_end, w + DT * k3)
            w = w + DT / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            residual = c * v_end + k * (x_end - x0) + k_w * w - measured
            return (w, total + residual * residual), None

        begin = c * stages[0, 0, 1] + k * (stages[0, 0, 0] - x0) - force[0]
        (_, total), _ = lax.scan(step, (jnp.zeros_like(c), begin**2), (stages, force[1:]), unroll=unroll)
        return total

    mesh = Mesh(np.array(jax.devices()[: threads if len(theta) % threads == 0 else 1]), ("candidates",))
    split, whole = NamedSharding(mesh, PartitionSpec("candidates")), NamedSharding(mesh, PartitionSpec())
    batch = jax.vmap(misfit, in_axes=(0, None, None))
    compiled = jax.jit(batch, compiler_options={"xla_cpu_prefer_vector_width": str(bits)})
    placed = jax.device_put(theta, split), jax.device_put(stages, whole), jax.device_put(force, whole)
    return lambda: compiled(*placed).block_until_ready()


# %% numba: parallel over blocks of candidates, which lie innermost, so that LLVM fills its vectors with them.
def by_numba(theta, power, block, fastmath):
    """The call that is timed: sums of squared residuals, shape (n_batch,)."""
    inlined = numba.njit(inline="always", fastmath=fastmath)
    power = inlined(power)

    @inlined
    def rate(v, speed, w, rho, sigma, n):
        return rho * (v - power(w, n) * (sigma * math.copysign(speed, w) - (sigma - 1.0) * v))

    @numba.njit(parallel=True, fastmath=fastmath, error_model="numpy")
    def kernel(theta, stages, force, dt):
        n_batch = theta.shape[0]
        misfit = np.empty(n_batch)
        half = 0.5 * dt
        for group in numba.prange((n_batch + block - 1) // block):
            columns = np.empty((7, block))
            w = np.zeros(block)
            total = np.empty(block)
            for j in range(block):
                # A last, incomplete block repeats the last candidate: the loops below keep a constant length.
                row = min(group * block + j, n_batch - 1)
                for q in range(7):
                    columns[q, j] = theta[row, q]
                residual = columns[0, j] * stages[0, 0, 1] + columns[1, j] * (stages[0, 0, 0] - columns[2, j])
                total[j] = (residual - force[0]) * (residual - force[0])
            c, k, x0, k_w = columns[0], columns[1], columns[2], columns[3]
            rho, sigma, n = columns[4], columns[5], columns[6]
            for i in range(force.shape[0] - 1):
                v_start, v_middle, v_end = stages[i, 0, 1], stages[i, 1, 1], stages[i, 2, 1]
                speed_start, speed_middle, speed_end = abs(v_start), abs(v_middle), abs(v_end)
                x_end, measured = stages[i, 2, 0], force[i + 1]
                for j in range(block):
                    z = w[j]
                    k1 = rate(v_start, speed_start, z, rho[j], sigma[j], n[j])
                    k2 = rate(v_middle, speed_middle, z + half * k1, rho[j], sigma[j], n[j])
                    k3 = rate(v_middle, speed_middle, z + half * k2, rho[j], sigma[j], n[j])
                    k4 = rate(v_end, speed_end, z + dt * k3, rho[j], sigma[j], n[j])
                    z += dt / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
                    w[j] = z
                    residual = c[j] * v_end + k[j] * (x_end - x0[j]) + k_w[j] * z - measured
                    total[j] += residual * residual
            for j in range(block):
                if group * block + j < n_batch:
                    misfit[group * block + j] = total[j]
        return misfit

    return lambda: kernel(theta, stages, force, DT)


# %% How the peers form |w|^n, and the fastest of their settings: unrolling and vector bits of jax, block and fast-math
# of numba. Tried on one thread of an AMD EPYC of family 25: unrolling 1 to 8 with 256 and 512 bits, where more is
# slower; blocks of 8 to 128, of which those from 32 on are within a tenth, with and without fast-math.
PEERS = {
    "jax": (by_jax, lambda w, n: jnp.power(jnp.abs(w), n), 1, 512),
    "jax_exp_log": (by_jax, lambda w, n: jnp.exp(n * jnp.log(jnp.abs(w))), 1, 512),
    "numba": (by_numba, lambda w, n: math.pow(abs(w), n), 32, True),
    "numba_exp_log": (by_numba, lambda w, n: math.exp(n * math.log(abs(w))), 32, True),
}
PEERS_OF_SQUARES = {
    "jax": (by_jax, lambda w, n: w * w, 1, 512),
    "numba": (by_numba, lambda w, n: w * w, 32, True),
}

# %% Candidates of small dampers, mild enough (rho |v| n (2 sigma - 1) dt < 0.15) for one step per sample.
lower = np.array([200.0, 500.0, -0.002, 200.0, 50.0, 0.5, 1.2])
upper = np.array([2000.0, 3000.0, 0.002, 1000.0, 300.0, 1.2, 2.8])
rows, agreement = {}, {}
for batch, general in (
    [(64, True)] if script.quick else [(64, True), (64, False), (1024, True), (1024, False)]
):
    name = f"{batch}, {'general exponent' if general else 'n = 2'}"
    theta = np.random.default_rng(script.seed).uniform(lower, upper, (batch, 7))
    theta[:, 6] = theta[:, 6] if general else 2.0
    expected = objective.misfits(theta)[0]
    assert expected.substeps.max() == 1
    runs, variants = {"ours": lambda theta=theta: objective.misfits(theta)}, {}
    for peer, (make, power, first, second) in (PEERS if general else PEERS_OF_SQUARES).items():
        script.say(f"{name}: compiling {peer}")
        run = make(theta, power, first, second)
        difference = float(np.max(np.abs(np.asarray(run()) / expected.squared_error - 1.0)))
        agreement.setdefault(name, {})[peer] = difference
        variants[peer] = (
            f"vmap(scan), unroll {first}, {second}-bit vectors"
            if make is by_jax
            else f"blocks of {first}, fastmath"
        )
        if difference < 1e-9:  # nothing is timed that does not agree; the check tells it
            runs[peer] = run
    seconds = median_seconds(runs, *((1, 0.0) if script.quick else (7,)))
    speeds = {run: batch * (test.n_time - 1) / value for run, value in seconds.items()}
    ratios = {f"ratio_{peer}": speeds["ours"] / speeds[peer] for peer in runs if peer != "ours"}
    flops = mr.dampers.flops_per_step(MODEL, theta[0])
    peak = sorted(mr.dampers.fma_peak(threads, 0.002 if script.quick else 0.04) for _ in range(7))[3]
    of_peers = [
        f"{ratio}{peer}{form}"
        for form in ("", "_exp_log")
        for ratio in ("", "ratio_")
        for peer in ("jax", "numba")
    ]
    rows[name] = {
        **{"model": MODEL, "batch": batch, "threads": threads, "general_exponent": general},
        **dict.fromkeys(of_peers),
        **speeds,
        **ratios,
        "peak_fraction": speeds["ours"] * flops / peak,
        **{"flops_per_step": flops, "fma_peak": peak, "variants": variants},
    }

# %% In million steps per second.
millions = {
    name: {"threads": threads}
    | {run: row[run] / 1e6 for run in ("ours", *PEERS) if row[run]}
    | {f"ours/{peer}": row[f"ratio_{peer}"] for peer in PEERS if row[f"ratio_{peer}"]}
    | {"of FMA peak %": 100.0 * row["peak_fraction"]}
    for name, row in rows.items()
}
instructions = mr.instruction_set()
used = f"{instructions.used}; {processor()}"
script.table(
    "steps", millions, title=f"Million steps per second, medians of rounds in turns; {used}", digits=3
)
script.table("agreement", agreement, title="Misfits, largest relative difference from ours", digits=2)
script.tables["rows"] = rows
script.check()
