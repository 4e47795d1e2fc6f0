"""How many regulators are designed in a second, beside a loop over SciPy's Riccati equations?

Shear frames with a device across the first storey, each with its own plant and weight, in one call of
`mr.control.regulator_gains`. On one thread of an AMD EPYC (Zen 4) it has 164 times SciPy's designs per second for 6
states, 61 for 10, 21 for 20 and 11 for 40, with gains that agree to 1e-10 and smaller residuals. Ten seconds.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from scipy.linalg import solve_continuous_are

import mrwork as mr
from common import Script
from timing import median_seconds, processor

script = Script(__file__, __doc__, quick="16 equations of 6 and 10 states, once", seed=16)
threads = script.threads or 1
# Equations of a batch by states: about a tenth of a second of ours on one thread. SciPy takes its time for 64.
batches = {6: 16, 10: 16} if script.quick else {6: 8192, 10: 4096, 20: 512, 40: 64}
rng = np.random.default_rng(script.seed)


# %% Frames of 330 kg and 1.45 MN/m a storey, +-10 %, with 1 to 3 % of damping.
def frames(states, batch):
    """A and B in coordinates whose squares are twice the energy, so that SciPy meets well-scaled matrices."""
    n = states // 2
    A, B = np.zeros((batch, states, states)), np.zeros((batch, states, 1))
    for row in range(batch):
        stiffness = 1.448e6 * rng.uniform(0.9, 1.1, n)
        mass = 330.0 * rng.uniform(0.9, 1.1, n)
        # Each spring is stretched by the difference of two floors: K = E' diag(k) E.
        stretch = np.sqrt(stiffness)[:, None] * (np.eye(n) - np.eye(n, k=-1)) / np.sqrt(mass)
        frequencies = np.linalg.svd(stretch, compute_uv=False)
        damping = 2.0 * rng.uniform(0.01, 0.03) / (frequencies[0] + frequencies[-1])
        A[row, :n, n:] = stretch
        A[row, n:, :n] = -stretch.T
        A[row, n:, n:] = -damping * (stretch.T @ stretch + frequencies[0] * frequencies[-1] * np.eye(n))
        B[row, n, 0] = -1.0 / np.sqrt(mass[0])
    return A, B


def residual(A, B, Q, R, P):
    """Largest of A'P + P A - P B R^-1 B'P + Q in a batch, relative to the norms of its terms."""
    PA, PB = P @ A, P @ B
    terms = [np.swapaxes(PA, 1, 2), PA, -PB @ np.swapaxes(PB, 1, 2) / R, np.broadcast_to(Q, A.shape)]
    norms = [np.linalg.norm(term, axis=(1, 2)) for term in terms]
    return float(np.max(np.linalg.norm(np.sum(terms, axis=0), axis=(1, 2)) / np.sum(norms, axis=0)))


# %% The energy is weighed, with R from 1e-9 to 1e-5 1/N^2. SciPy's threads share its equations: LAPACK lets others run.
rows, agreement = {}, {}
pool = ThreadPoolExecutor(threads)
for states, batch in batches.items():
    few = min(batch, 64)
    A, B = frames(states, batch)
    Q, R = np.eye(states), rng.permutation(np.geomspace(1e-9, 1e-5, batch)).reshape(-1, 1, 1)

    def ours(A=A, B=B, Q=Q, R=R):
        return mr.control.regulator_gains(A, B, Q, R, scaling=Q, threads=threads)

    def one(row, A=A, B=B, Q=Q, R=R):
        return solve_continuous_are(A[row], B[row], Q, R[row])

    def scipy(one=one, few=few):
        return np.array(list(map(one, range(few)) if threads == 1 else pool.map(one, range(few))))

    found, P = ours(), scipy()
    gain = np.swapaxes(B[:few], 1, 2) @ P / R[:few]
    sizes = np.linalg.norm(gain, axis=(1, 2))
    difference = float(np.max(np.linalg.norm(gain - found.gain[:few], axis=(1, 2)) / sizes))
    agreement[f"{states} states"] = {
        "solved %": 100.0 * float(found.solved.mean()),
        "gains differ": difference,
        "residual": residual(A, B, Q, R, found.P),
        "of SciPy": residual(A[:few], B[:few], Q, R[:few], P),
    }
    if difference > 1e-7:
        continue  # nothing is timed that does not agree; the check tells it
    seconds = median_seconds({"ours": ours, "scipy": scipy}, *((1, 0.0) if script.quick else (7,)))
    speed = {"ours": batch / seconds["ours"], "scipy": few / seconds["scipy"]}
    rows[f"{states} states"] = {
        "states": states,
        "batch": batch,
        "threads": threads,
        **speed,
        "ratio": speed["ours"] / speed["scipy"],
        "residual": agreement[f"{states} states"]["residual"],
        "scipy_residual": agreement[f"{states} states"]["of SciPy"],
        "difference": difference,
    }

script.table("rows", rows, title=f"Designs per second, medians of rounds in turns; {processor()}", digits=3)
script.table("agreement", agreement, title="Solutions of both", digits=2)
script.check()
