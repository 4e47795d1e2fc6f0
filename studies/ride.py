"""What is left of skyhook's gain in comfort on a measured damper, with its lag and the delay of the loop?

At equal road holding it gains at most 2.2 % of weighted acceleration over constant currents on a road of class B at 20
m/s, and 3.5 % on class C; with a lag and a delay of 5 ms each 2.0 and 2.7 % are left. Clipped LQG gains 13 and 14 %, of
which 8.9 and 7.7 % are left, groundhook nothing. Four minutes of two cores, the quick form ten seconds.
"""

import csv
from functools import partial
from itertools import product

import numpy as np
from matplotlib.figure import Figure

import mrwork as mr
from common import Script

script = Script(__file__, __doc__, quick="three fronts of class C, short roads, the damper of the full form")

# %% The damper: a joint fit to thirty measured sinusoids, whose authors have averaged them.
if script.quick:
    with (script.folder / "damper.csv").open(newline="") as file:
        identified = {line["row"]: float(line["identified"]) for line in csv.DictReader(file)}
else:
    paths = sorted(script.data("dampers", "utfsm").glob("[0-9]*.csv"))
    tests = [mr.records.repair(test, ["velocity"])[0] for test in mr.read_damper_tests(paths)]
    tests = [mr.records.cut(test, every=max(1, int(4e-3 / (test.frequency * test.dt)))) for test in tests]
    tests = [mr.records.observed(test, ["detect"]) for test in tests]
    spec = mr.damper("normalised_bouc_wen").with_current_laws({"k_w": "cubic", "c": "linear"}, unit="A")
    search = {"bounds": {"sigma": (0.5, 2.0)}, "rng": script.seed, "threads": script.threads}
    fit = mr.identify(spec, tests, observe="none", **search)
    identified = {each.name: each.value for each in fit.estimates}
    script.table("damper", {name: {"identified": value} for name, value in identified.items()})
parameters = {}
for name, value in identified.items():
    parameters.setdefault(name.partition(".")[0], []).append(value)

# %% A quarter car; levers move its two dampers by a third of the travel of the suspension.
NAMES = {"floor_names": ["wheel", "body"], "storey_names": ["tyre", "suspension"]}
STOREYS = {"stiffnesses": [190e3, 18e3], "storey_damping": [150.0, 300.0]}
CAR = mr.buildings.shear_building(masses=[40.0, 300.0], **STOREYS, **NAMES)
DAMPERS = {"storey": "suspension", "row": (-1.0 / 3.0, 1.0 / 3.0), "count": 2, "largest_command": "1 A"}
DAMPERS |= {"model": "normalised_bouc_wen", "parameters": parameters}

# %% Laws: name, settings that are held, that are free, keys of the damper, and of the loop. Cases: lag and delay.
SENSORS = {"feedback": "observer", "measured_storeys": [2], "noise_ratio": 1e4}
SENSORS |= {"acceleration_noise": 0.05, "drift_noise": 2e-4}
LQR, LARGEST = {"accelerations": [0.0, 1.0], "control_weight": 1e-9}, "largest_command"
HOOK, LQG, SPRUNG = {LARGEST: [0.02, 0.47]}, {LARGEST: [0.05, 0.95]}, {"sprung": "body"}
LAWS = {
    "constant": ("passive", {}, {"command": [0.0, 0.5]}, {}, {}),
    "skyhook": ("skyhook_groundhook", {"share": 1.0}, HOOK, SPRUNG, {}),
    "groundhook": ("skyhook_groundhook", {"share": 0.0}, HOOK, SPRUNG, {}),
    "LQG, comfort": ("clipped_optimal", LQR | {"drifts": [1e5, 1.0]}, LQG, {}, SENSORS),
    "LQG, road": ("clipped_optimal", LQR | {"drifts": [1e6, 1.0]}, LQG, {}, SENSORS),
}
LAG, DELAY = {"lag": "190 1/s"}, {"delay": "5 ms"}
CASES = {"ideal": ({}, {}), "lag": (LAG, {}), "delay": ({}, DELAY), "lag and delay": (LAG, DELAY)}
RUNS = [("constant", "ideal"), *product(["skyhook"], CASES)]
RUNS += product([*LAWS][2:], ["ideal", "lag and delay"])
CLASSES, RUNS = ("C", [RUNS[0], RUNS[4], RUNS[7]]) if script.quick else ("BC", RUNS)
CRITERIA = ("weighted_acceleration@body", "rms_drift@tyre", "rms_acceleration@body")
N_TRAINING, N_TEST, DURATION = (1, 2, 3.0) if script.quick else (3, 6, 10.0)


def front(road_class, name, case):
    """Criteria on each test road of points of a front, which is found on other roads: (criteria, points, roads)."""
    law, settings, free, of_damper, of_loop = LAWS[name]
    lag, delay = CASES[case]
    road = partial(mr.motions.iso_8608_road, road_class, speed=20.0, duration=DURATION)
    uses = ["training"] * N_TRAINING + ["test"] * N_TEST
    roads = [{"file": road(rng=script.seed + n, name=str(n)), "use": use} for n, use in enumerate(uses)]
    tables = {"building": CAR, "dampers": [DAMPERS | of_damper | lag], "report": {"criteria": CRITERIA}}
    tables["hardware"] = {"sample_time": "1 ms", **delay, **of_loop}
    tune = {"laws": [law], "settings": settings, "free": free, "population": 30, "budget": 30}
    tune |= dict.fromkeys(("criteria", "objectives"), CRITERIA[:2])
    tuned = mr.tune(mr.study_of(**tables, motions=roads, tune=tune), rng=script.seed, threads=script.threads)
    points = [dict(point.settings) for point in tuned.fronts[0].points]
    points.sort(key=lambda each: [*each.values()])
    laws = [
        {"law": law, "label": str(n), LARGEST: point.pop(LARGEST), "settings": point}
        for n, point in enumerate(points[:: -(-len(points) // 15)])
    ]
    study = mr.study_of(**tables, motions=roads[N_TRAINING:], laws=laws)
    runs = mr.run_study(study, threads=script.threads).to_pandas().loc[[each["label"] for each in laws]]
    return [runs[each].to_numpy().reshape(len(laws), N_TEST).tolist() for each in CRITERIA]


def largest_gain(found, constants, along, of):
    """Largest mean gain over constant currents in a criterion where another is equal, and its spread over roads [%]."""
    gains = []
    for points, held in zip(np.moveaxis(found, 2, 0), np.moveaxis(constants, 2, 0), strict=True):
        levels = np.linspace(*held[along, held[:2].argmin(axis=1)], 21)
        curves = [each[:, each[along].argsort()] for each in (points, held)]
        law, constant = (np.interp(levels, each[along], each[of], left=np.nan) for each in curves)
        gains.append(100.0 * (1.0 - law / constant))
    best = np.nanargmax(np.mean(gains, axis=0))
    return np.mean(gains, axis=0)[best], np.std(gains, axis=0, ddof=1)[best]


# %% Fronts, and what the laws gain on the test roads: in comfort, by W_k and without, and in road holding.
rows, fronts = {}, {}
for road_class, (name, case) in product(CLASSES, RUNS):
    key = f"{road_class}, {name}, {case}"
    fronts[key] = np.array(script.kept(key, partial(front, road_class, name, case)))
    rows[key] = {}
    for gain, pair in {"comfort": (1, 0), "acceleration": (1, 2), "road holding": (0, 1)}.items():
        mean, spread = largest_gain(fronts[key], fronts[f"{road_class}, constant, ideal"], *pair)
        rows[key] |= {f"{gain} [%]": mean, f"{gain} +-": spread}
script.table("gains", rows, title="Largest gains over constant currents, mean and spread of roads", digits=2)

# %% Comfort against road holding, means of the test roads.
figure = Figure(figsize=(4.0 * len(CLASSES) + 2.5, 4.0), layout="constrained")
for axes, road_class in zip(np.ravel(figure.subplots(1, len(CLASSES))), CLASSES, strict=True):
    for name, case in RUNS:
        comfort, holding, _ = fronts[f"{road_class}, {name}, {case}"].mean(axis=2)
        style = {"color": f"C{[*LAWS].index(name)}", "alpha": 1.0 if case == "ideal" else 0.4}
        axes.plot(1e3 * holding, comfort, ".-", label=f"{name}, {case}", **style)
    axes.set(title=f"Class {road_class}", xlabel="Tyre deflection, rms (mm)", ylabel="By W_k (m/s²)")
figure.legend(*axes.get_legend_handles_labels(), loc="outside right upper")
script.figure(figure, "fronts")
script.check()
