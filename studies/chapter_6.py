"""How good are control laws for MR dampers on a building beside a constant current, and what does the loop cost?

On five storeys under four earthquakes the best law scores 0.511 of i = 0 at 0.1 g and 0.530 at 0.3 g, the best constant
current 0.577 and 0.560; a viscous damper 0.450 and 0.433, an ideal force 0.32 and 0.31. What laws gain, they gain in
drift and rms; the peak acceleration is worse. Sample times up to 2 ms cost next to nothing, a delay of 5 ms costs most
laws what 10 ms of sample time do, an observer up to 0.03. The driver's lag is part of these laws: without it
clipped-optimal control scores 0.711 at 0.1 g. Settings are those of `chapter_6/tuned.toml`. Five minutes of one core,
the quick form ten seconds; `--tune` searches settings anew.
"""

import tomllib
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import mrwork as mr
from common import Script

tune_option = {
    "nargs": "+",
    "default": [],
    "metavar": "LAW",
    "help": "search the settings of these laws anew",
}
script = Script(__file__, __doc__, quick="a few laws, no conditions", seed=6, tune=tune_option)

# %% Frame, motions and the pair of RD-1005-3 in opposition: both follow one current, and their offsets cancel.
G, LEVELS = 9.80665, (0.1, 0.3)
FRAME, SCORE = mr.building("uts"), ("peak_drift", "peak_acceleration", "rms_drift", "rms_acceleration")
HARDWARE = mr.Hardware(sample_time=1e-3, step=5e-4)  # state feedback, no delay, no noise
FILES = ("el_centro_1940_ns", "hachinohe_1968_ns", "kobe_1995_jma_ns", "northridge_1994_sylmar_ns")
records = [
    mr.motions.trimmed(mr.read_motion(script.data("records") / f"{name}.csv"), end=50.0) for name in FILES
]
motions = {level: [mr.motions.scaled_to_peak(each, level * G) for each in records] for level in LEVELS}
RD1005 = mr.damper("static_hysteretic").preset("kwok2006")
FULL = 1.88  # A; above it the friction of the model decreases again


def pair(
    largest_current: float = FULL,
    *,
    lag: float | None = 190.0,
    differential: bool = True,
    row: Any = FRAME.storeys[0],
) -> mr.Device:
    """Two dampers in opposition across storey 1, or one actuator in their place."""
    return mr.Device(
        name="pair",
        spec=RD1005.spec,
        theta=RD1005.theta,
        row=row,
        largest_command=largest_current,
        lag=lag,
        differential=differential,
    )


def simulated(
    level: float,
    law: mr.ControlLaw,
    device: mr.Device,
    frame: mr.Building = FRAME,
    hardware: mr.Hardware = HARDWARE,
    step_factor: int = 1,
) -> mr.Responses:
    """Responses to the records at a level."""
    return mr.simulate_loop(
        frame, [device], law, motions[level], hardware, step_factor=step_factor, threads=script.threads
    )


def criteria(responses: mr.Responses, frame: mr.Building = FRAME) -> Any:
    """Peaks and rms of the storeys and floors of the plain frame, shape (n_candidates, 4 records, 4 criteria)."""
    storeys = [frame.storey_names.index(name) for name in FRAME.storey_names]
    floors = [frame.floor_names.index(name) for name in FRAME.floor_names]
    places = {"drift": storeys, "acceleration": floors}
    largest = [getattr(responses, name)[:, places[name.partition("_")[2]]].max(axis=1) for name in SCORE]
    return np.stack(largest, axis=1).reshape(-1, len(records), len(SCORE))


def constant(current: Any) -> mr.ControlLaw:
    """A constant current, or a candidate for each."""
    return mr.ControlLaw(name="passive", gains={"command": np.reshape(current, (-1, 1))})


OFF = {level: criteria(simulated(level, constant(0.0), pair()))[0] for level in LEVELS}


def row_of(ratios: Any, responses: mr.Responses, note: str, candidate: int = 0) -> dict[str, Any]:
    """A row of the table of a level: the score phi is the mean over records and criteria of the ratios to i = 0."""
    runs = slice(len(records) * candidate, len(records) * (candidate + 1))
    return {
        "phi": ratios[candidate].mean(),
        **dict(zip(SCORE, ratios[candidate].mean(axis=0), strict=True)),
        "mean current [A]": responses.mean_current[runs, 0].mean(),
        "peak force [N]": responses.peak_force[runs, 0].max(),
        "stroke [mm]": 1e3 * responses.peak_stroke[runs, 0].max(),
        "energy error": responses.energy_error[runs].max(),
        "choice": note,
    }


# %% Constant currents: the best of 48 at each level, and the largest.
tables: dict[float, dict[str, Any]] = {level: {} for level in LEVELS}
currents = np.linspace(0.0, FULL, 48)
for level in LEVELS:
    responses = simulated(level, constant(currents), pair())
    ratios = criteria(responses) / OFF[level]
    best = int(ratios.mean(axis=(1, 2)).argmin())
    for label, candidate in {"i = 0": 0, "best constant": best, "largest current": 47}.items():
        tables[level][label] = row_of(ratios, responses, f"{currents[candidate]:.3g} A", candidate)

# %% Laws with the settings that were tuned at each level; `active` is the ideal force in the place of the dampers.
with (script.folder / "tuned.toml").open("rb") as file:
    tuned = tomllib.load(file)
if script.quick:
    tuned = {name: tuned[name] for name in ("clipped_optimal", "lyapunov_direct", "inverse_direct")}
with (script.folder / "networks.toml").open("rb") as file:
    networks = tomllib.load(file)


def law_of(
    name: str, level: float, setting: Any, sample_time: float = 1e-3, *, lagged: bool = True
) -> tuple[mr.ControlLaw, mr.Device]:
    """The law with these settings, and its device."""
    name = name.removesuffix("_limited")
    device = pair(setting["largest_current"], lag=190.0 if lagged else None, differential=name != "active")
    # A law is designed for the pair with its driver, also where the loop has none.
    believed = pair(setting["largest_current"], differential=name != "active")
    problem = mr.control.DesignProblem(building=FRAME, devices=[believed], sample_time=sample_time)
    network = networks[f"{level:g} g"][f"{1e3 * sample_time:g} ms"] if name == "inverse_network" else {}
    return mr.control.design_law(name, problem, setting["settings"] | network), device


def run(name: str, level: float, setting: Any, *, lagged: bool = True, **loop: Any) -> Any:
    """Ratios of a law to i = 0, shape (1, 4 records, 4 criteria), and its responses."""
    sample_time = loop.get("hardware", HARDWARE).sample_time
    responses = simulated(level, *law_of(name, level, setting, sample_time, lagged=lagged), **loop)
    return criteria(responses) / OFF[level], responses


for name in tuned:
    script.say(f"law: {name}")
    for level in LEVELS:
        setting = tuned[name][f"{level:g} g"]
        ratios, responses = run(name, level, setting)
        tables[level][name] = row_of(ratios, responses, f"{setting['largest_current']:g} A at most")

# %% Devices that are no semi-active ones, each the best of a few at each level.
if not script.quick:
    script.say("baselines")
    buildings = mr.buildings
    baselines = {"no device": {"": FRAME}}
    baselines["viscous damper"] = {
        f"{c / 1e3:.3g} kN s/m": buildings.with_viscous_damper(FRAME, storey=1, damping=c)
        for c in np.geomspace(5e3, 3e5, 13)
    }
    for share in (0.02, 0.05):
        baselines[f"tuned mass, {share:.0%} on the roof"] = {
            each: buildings.with_optimal_tuned_mass(FRAME, floor=5, mass_ratio=share, tuning=each)
            for each in ("warburton", "den_hartog", "sadek")
        }
    isolated = buildings.with_base_isolation_of_period(FRAME, mass=330.0, period=2.0, ratio=0.1)
    baselines["base isolation"] = {"2 s, 10 %": isolated}
    for label, frames in baselines.items():
        for level in LEVELS:
            rows = {}
            for choice, frame in frames.items():
                # An actuator without force takes the place of the pair.
                idle = mr.ControlLaw(name="active", gains={"gain": np.zeros((1, 2 * frame.n_coordinates))})
                row = frame.storeys[frame.storey_names.index(FRAME.storey_names[0])]
                responses = simulated(level, idle, pair(row=row, differential=False), frame)
                rows[choice] = row_of(criteria(responses, frame) / OFF[level], responses, choice)
                # The stroke of what was added: isolators, or the tuned mass.
                added = [i for i, name in enumerate(frame.storey_names) if name not in FRAME.storey_names]
                if added:
                    rows[choice]["stroke [mm]"] = 1e3 * responses.peak_drift[:, added].max()
            tables[level][label] = min(rows.values(), key=lambda row: row["phi"])

for level, rows in tables.items():
    ranked = dict(sorted(rows.items(), key=lambda row: row[1]["phi"]))
    script.table(
        f"laws_{10 * level:02.0f}", ranked, title=f"Four records at {level:g} g, over i = 0", digits=4
    )

# %% The loop as hardware runs it; the settings stay.
OBSERVED = replace(HARDWARE, feedback="observer")
NOISE: dict[str, Any] = {"acceleration_noise": 0.02, "deformation_noise": 2e-5, "force_noise": 10.0}
CONDITIONS: dict[str, Any] = {
    "reference": {},
    "half the step": {"step_factor": 2},
    "Ts 2 ms": {"hardware": replace(HARDWARE, sample_time=2e-3)},
    "Ts 5 ms": {"hardware": replace(HARDWARE, sample_time=5e-3)},
    "Ts 10 ms": {"hardware": replace(HARDWARE, sample_time=1e-2)},
    "delay 2 ms": {"hardware": replace(HARDWARE, delay=2e-3)},
    "delay 5 ms": {"hardware": replace(HARDWARE, delay=5e-3)},
    "observer": {"hardware": OBSERVED},
    "observer, noise": {"hardware": replace(OBSERVED, acceleration_resolution=0.005, **NOISE)},
    "no driver lag": {"lagged": False},
}
dampers = [name for name in tuned if not name.startswith("active")]
conditions: dict[float, dict[str, Any]] = {level: {} for level in LEVELS}
if not script.quick:
    half_step: dict[str, Any] = {}
    for name in dampers:
        script.say(f"conditions: {name}")
        for level in LEVELS:
            setting = tuned[name][f"{level:g} g"]
            found = {label: run(name, level, setting, **loop)[0] for label, loop in CONDITIONS.items()}
            conditions[level][name] = {label: ratios.mean() for label, ratios in found.items()}
            change = found["half the step"] - found["reference"]
            half_step.setdefault(name, {})[f"score, {level:g} g"] = change.mean()
            half_step[name][f"one ratio, {level:g} g"] = np.abs(change).max()
    for level, rows in conditions.items():
        ranked = dict(sorted(rows.items(), key=lambda row: row[1]["reference"]))
        script.table(f"conditions_{10 * level:02.0f}", ranked, title=f"Scores by condition at {level:g} g")
    script.table(
        "half_step", half_step, title="What half the step changes, and the most of one ratio", digits=2
    )

# %% A search: 48 candidates about the settings of a law, a factor exp(N(0, 0.4^2)) on every number.
for name in script.options.tune:
    rng, rows = np.random.default_rng(script.seed), {}
    for level in LEVELS:
        start = tuned[name][f"{level:g} g"]
        chosen, least = start, run(name, level, start)[0].mean()
        rows[f"{level:g} g, as it was"] = {"phi": least, "settings": str(start)}
        for number in range(48):
            settings = {
                key: float(f"{value * np.exp(0.4 * rng.standard_normal()):.3g}")
                for key, value in start["settings"].items()
            }
            largest = min(FULL, start["largest_current"] * (0.7, 0.85, 1.0, 1.2)[number % 4])
            trial = {"largest_current": largest, "settings": settings}
            score = run(name, level, trial)[0].mean()
            if score < least:
                chosen, least = trial, score
        rows[f"{level:g} g, best of 48 about it"] = {"phi": least, "settings": str(chosen)}
    script.table(f"search of {name}", rows)

# %% Figures: scores of all laws beside the best constant current, and scores over the sample time.
figure = Figure(figsize=(8.0, 8.0), layout="constrained")
axes = figure.subplots()
shown = [name for name in tables[0.1] if name in tuned or name in ("best constant", "viscous damper")]
shown.sort(key=lambda name: -tables[0.1][name]["phi"] - tables[0.3][name]["phi"])
for level, colour in zip(LEVELS, ("C0", "C3"), strict=True):
    axes.plot([tables[level][name]["phi"] for name in shown], shown, "o", color=colour, label=f"{level:g} g")
    axes.axvline(tables[level]["best constant"]["phi"], color=colour, linestyle="--", linewidth=0.8)
axes.set(xlabel="Score over i = 0; dashed: best constant current")
axes.legend()
script.figure(figure, "scores")
if not script.quick:
    figure = Figure(figsize=(10.0, 4.0), layout="constrained")
    timed = {1.0: "reference", 2.0: "Ts 2 ms", 5.0: "Ts 5 ms", 10.0: "Ts 10 ms"}
    for axes, level in zip(figure.subplots(1, 2, sharey=True), LEVELS, strict=True):
        for name in ("inverse_direct", "clipped_optimal", "lyapunov_direct", "maximum_energy_dissipation"):
            scores = [conditions[level][name][label] for label in timed.values()]
            axes.semilogx(list(timed), scores, "o-", label=name)
        axes.set(xlabel="Sample time (ms)", title=f"{level:g} g", ylabel="Score over i = 0")
        axes.legend()
    script.figure(figure, "sample_time")
script.check()
