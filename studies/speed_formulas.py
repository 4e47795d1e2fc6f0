"""What does a formula of a user cost, beside the same formula in the crate?

A law, a static model and a Bouc-Wen loop of the package are written again in NumPy, recorded, and timed in turns with
the compiled ones: `ratio` is the time of the user's over that of the package. A clipped law with one gain runs in the
closed loop of the frame `uts`, 64 motions; dampers are misfits of 256 candidates on one record of 2001 samples.
Recording is the time of one call of `own_damper` with a formula that is new each time. A study with a law of a user is
read in a process of its own, which must not load JAX. Half a minute.
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import mrwork as mr
from common import Script
from timing import median_seconds, processor

script = Script(__file__, __doc__, quick="small batches, once", seed=122)
threads = script.threads or 1
batch, n_time, n_motions, rounds, turn = (16, 200, 4, 1, 0.0) if script.quick else (256, 2001, 64, 9, 0.08)
rows, agreement = {}, {}


def compare(name, runs, difference):
    """A row of the user's time over that of the package; what differs is not timed, and the check tells it."""
    agreement[name] = {"largest difference": difference}
    if difference > 1e-9:
        return
    seconds = median_seconds(runs, rounds, turn)
    rows[name] = {"ours": seconds["ours"], "own": seconds["own"], "ratio": seconds["own"] / seconds["ours"]}


# %% A law: the force that a row of gains wants of the state, switched on where the damper can give it.
script.say("law")
frame, rd1005 = mr.building("uts"), mr.damper("static_hysteretic").preset("kwok2006")
pair = mr.Device(
    name="pair",
    spec=rd1005.spec,
    theta=rd1005.theta,
    row=frame.storeys[0],
    largest_command=1.88,
    differential=True,
)
plant = mr.control.plant_of(frame, [pair.row])
(design,) = mr.control.regulators_of_weights(plant, [plant.energy], [1e-8])
GAIN = np.asarray(design.gain)


def clipped(sample, memory):
    wanted = -(sample.state @ GAIN.T)
    return np.where((wanted - sample.force) * sample.force > 0.0, sample.largest, 0.0)


ground = [
    mr.synthetic_motion(rng=number, duration=1.0 if script.quick else 10.0, peak=3.0, name=f"noise {number}")
    for number in range(n_motions)
]
hardware = mr.Hardware(sample_time=1e-3)
ours = mr.ControlLaw(name="clipped_optimal", gains={"gain": GAIN[None]})
own = mr.closed_loop.UserLaw(name="clipped", command=clipped, record=True)
runs = {
    key: lambda law=law: mr.simulate_loop(frame, [pair], law, ground, hardware, threads=threads)
    for key, law in {"ours": ours, "own": own}.items()
}
found = {key: run() for key, run in runs.items()}
peaks = {key: each.peak_drift for key, each in found.items()}
compare("law", runs, float(np.max(np.abs(peaks["own"] / peaks["ours"] - 1.0))))
agreement["law"]["share of the current"] = float(found["own"].mean_current.mean() / pair.largest_command)


# %% Dampers: a static model, and a Bouc-Wen loop with and without the bound from which sub-steps follow.
def guo_force(p, state, displacement, velocity):
    shifted = velocity + p.omega * displacement
    return p.A1 * np.tanh(p.A3 * shifted) + p.A2 * shifted + p.f0


def loop_force(p, state, displacement, velocity):
    return p.c * velocity + p.k * (displacement - p.x0) + p.k_w * state[0]


def loop_rate(p, state, displacement, velocity):
    w, v = state[0], velocity
    w_n = np.abs(w) ** p.n
    return np.stack([p.rho * (v - p.sigma * np.abs(v) * np.sign(w) * w_n + (p.sigma - 1.0) * v * w_n)])


def loop_relaxation(p, displacement, velocity):
    return p.rho * p.n * np.maximum(1.0, np.abs(1.0 - 2.0 * p.sigma)) * np.abs(velocity)


def again(model, **formulas):
    given = {each.name: each for each in model.parameters}
    return mr.own_damper(f"my_{model.name}", parameters=given, **formulas)


GUO, LOOP = mr.damper("hyperbolic_tangent_guo"), mr.damper("normalised_bouc_wen")
in_states = {"force": loop_force, "rate": loop_rate, "states": 1}
dampers = {
    "static model": (GUO, again(GUO, force=guo_force)),
    "Bouc-Wen, relaxation": (LOOP, again(LOOP, relaxation=loop_relaxation, **in_states)),
    "Bouc-Wen": (LOOP, again(LOOP, **in_states)),
}
instants = 1e-3 * np.arange(n_time)
displacement = 0.01 * np.sin(2.0 * np.pi * instants)
velocity = 0.02 * np.pi * np.cos(2.0 * np.pi * instants)
measured = 600.0 * np.tanh(velocity / 0.02) + 1500.0 * velocity
test = mr.test_from_arrays(instants, displacement, measured, velocity=velocity, synthetic=True)
for name, pair_of_models in dampers.items():
    script.say(name)
    model = pair_of_models[0]
    nominal = np.array(model.nominal)
    theta = nominal * np.random.default_rng(script.seed).uniform(0.9, 1.1, (batch, len(nominal)))
    posed = [mr.objective(each, test, observe="none", threads=threads).objective for each in pair_of_models]
    runs = {
        key: lambda each=each, theta=theta: each.misfits(theta)
        for key, each in zip(("ours", "own"), posed, strict=True)
    }
    errors = [each.misfits(theta)[0].squared_error for each in posed]
    compare(name, runs, float(np.max(np.abs(errors[1] / errors[0] - 1.0))))

# %% Time to record, of formulas that differ by a number.
script.say("recording")
times = []
for number in range(3 if script.quick else 15):

    def shifted(p, state, displacement, velocity, number=number):
        return loop_force(p, state, displacement, velocity) + 1e-9 * number

    began = time.perf_counter()
    again(LOOP, force=shifted, rate=loop_rate, states=1)
    times.append(time.perf_counter() - began)
rows["recording"] = {"own": float(np.median(times))}

# %% A study with a law of a user, read and recorded by a process that must not load JAX.
script.say("study")
LAW = """
import mrwork as mr
import numpy as np

def brake(sample, memory, settings):
    return settings.gain * np.abs(sample.rate)


law = mr.own_law(brake, settings={"gain": ("A s/m", 0.1, 6.0, 100.0)})
"""
READ = """
import sys, time
began = time.perf_counter()
import mrwork as mr
from my_law import law
study = mr.study_of(
    building=mr.building("uts"), dampers=[{"storey": 1, "preset": "kwok2006", "differential": True}], laws=[law],
    motions=[{"synthetic": "kanai_tajimi", "duration": "1 s", "pga": "0.2 g", "seed": 1}],
)
mr.run_study(study)
print(time.perf_counter() - began, int("jax" in sys.modules))
"""
with tempfile.TemporaryDirectory() as folder:
    Path(folder, "my_law.py").write_text(LAW)
    read = subprocess.run(
        [sys.executable, "-c", READ], cwd=folder, capture_output=True, text=True, check=False
    )
if read.returncode:
    raise SystemExit(read.stderr)
seconds, loads_jax = map(float, read.stdout.split()[-2:])
rows["study"] = {"own": seconds}
agreement["study"] = {"loads JAX": loads_jax}

script.table(
    "rows", rows, title=f"Seconds, medians of rounds in turns, {threads} thread(s); {processor()}", digits=3
)
script.table(
    "agreement", agreement, title="Numbers of the user's formulas beside those of the package", digits=2
)
script.check()
