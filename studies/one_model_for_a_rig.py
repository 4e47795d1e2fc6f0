"""How well does one current-dependent model predict all tests of a damper, from 2 to 25 mm, 0.1 to 5 Hz and 0 to 1 A?

The median of thirty sinusoids is fitted at 84 to 92 %, the worst at 63 to 85 %, by 11 to 26 numbers; with the moving
average that the authors of the record applied, at 88 to 94 and 65 to 88 %. Twenty minutes of one core, the quick form
twenty seconds; with `--leave-out` the largest family alone takes most of an hour more.
"""

from functools import partial

import numpy as np
from matplotlib.figure import Figure

import mrwork as mr
from common import Script

# One model per family: laws of the parameters that follow the current, ranges narrower than the model admits, and a
# simpler family whose fit is one more start.
FAMILIES = {
    "static_hysteretic": {
        "model": "static_hysteretic",
        "laws": {"alpha": "cubic", "c": "linear", "delta": "linear"},
    },
    "hyperbolic_tangent_guo": {
        "model": "hyperbolic_tangent_guo",
        "laws": {"A1": "quadratic", "A2": "linear", "A3": "quadratic", "omega": "quadratic"},
    },
    "bouc_wen": {"model": "normalised_bouc_wen", "laws": {"k_w": "cubic", "c": "linear"}},
    "non_symmetric_bouc_wen": {
        "model": "non_symmetric_bouc_wen",
        "laws": {"k_w": "quadratic", "c": "linear", "rho": "linear", "mu": "linear"},
        "bounds": {"share": (0.5, 0.5), "w_s": (0.1, 0.1)},
    },
    "elasto_visco_plastic": {
        "model": "elasto_visco_plastic",
        "laws": {"f_y": "quadratic", "c": "cubic", "rho": "quadratic", "v_r": "cubic", "k": "linear"},
        "bounds": {"r": (1e-6, 1e-6)},
    },
    "modified_bouc_wen": {
        "model": "normalised_modified_bouc_wen",
        "laws": dict.fromkeys(("c0", "c1", "rho"), "quadratic")
        | {"k_w": "cubic", "n": "linear", "k1": "linear"},
    },
    "shear_thinning_modified_bouc_wen": {
        "model": "shear_thinning_modified_bouc_wen",
        "laws": dict.fromkeys(("k_w", "c0", "rho"), "cubic")
        | dict.fromkeys(("c1", "c2"), "quadratic")
        | dict.fromkeys(("k1", "sigma", "n"), "linear"),
        "bounds": {"v_s": (0.002, 0.2), "k0": (1e-3, 1e-3)},
        "after": ("modified_bouc_wen", {"c2.0": 500.0, "v_s": 0.03}),
    },
}

script = Script(
    __file__,
    __doc__,
    quick="two families, ten tests, thinned",
    family={"action": "append", "choices": list(FAMILIES), "help": "default: all"},
    leave_out={
        "action": "store_true",
        "help": "predict also the tests at one current, or of one motion, left out",
    },
)

# %% The sinusoids, their velocity derived anew: the column is a backward difference, half a sample late.
motions = ("10mm1Hz*", "5mm3Hz*") if script.quick else ("[0-9]*",)
folder = script.data("dampers", "utfsm")
paths = sorted(path for motion in motions for path in folder.glob(f"{motion}.csv"))
sinusoids = [mr.records.repair(test, ["velocity"])[0] for test in mr.read_damper_tests(paths)]


def thinned(test: mr.DamperTest) -> mr.DamperTest:
    """At most 250 samples of a cycle: the fit of no test changes by more than 0.01."""
    return mr.records.cut(test, every=max(1, int(1.0 / (test.frequency * test.dt * 250))))


# %% One fit to all tests, and fits without those at one current or of one motion.
def fitted(name: str, tests: list[mr.DamperTest]) -> mr.Fit:
    """The joint fit of a family, after that of the family it starts from."""
    family = FAMILIES[name]
    spec = mr.damper(family["model"]).with_current_laws(family["laws"])
    starts = []
    if "after" in family:
        simpler, more = family["after"]
        starts = [mr.start_from(fitted(simpler, tests), spec) | more]
    script.say(f"{name}, {len(tests)} tests")
    return mr.identify(
        spec,
        tests,
        bounds=family.get("bounds", {}),
        observe="none",
        starts=starts,
        rng=script.seed,
        threads=script.threads,
    )


def fit_percent(fit: mr.Fit, test: mr.DamperTest) -> float:
    """Fit [%] to a test, minus infinity where extrapolated laws make a damper that cannot be simulated."""
    try:
        return mr.predict(fit, test).fit_percent
    except mr.errors.SimulationError:
        return -np.inf


def row(name: str, observation: str) -> dict[str, float | str]:
    """Fits [%] of whole records from the end of the start-up on, of free runs."""
    tests = [
        mr.records.observed(thinned(test) if script.quick else test, [observation]) for test in sinusoids
    ]
    fit = fitted(name, tests)
    percents = {quality.test: quality.fit_percent for quality in fit.quality}
    found = {
        "numbers": sum(estimate.state != "fixed" for estimate in fit.estimates),
        "median": float(np.median(list(percents.values()))),
        "worst": min(percents.values()),
        "worst test": min(percents, key=percents.get),
    }
    for what in ("current", "frequency") if script.options.leave_out else ():
        predicted = []
        for value in sorted({getattr(test, what) for test in tests}):
            rest = [thinned(test) for test in tests if getattr(test, what) != value]
            without = fitted(name, rest)
            predicted += [fit_percent(without, test) for test in tests if getattr(test, what) == value]
        found |= {
            f"without one {what}": float(np.median(predicted)),
            f"worst without one {what}": min(predicted),
        }
    return found


FORCES = {"as recorded": "none", "averaged alike": "detect"}
names = script.options.family or (["hyperbolic_tangent_guo", "bouc_wen"] if script.quick else list(FAMILIES))
rows = {
    f"{name}, {force}": script.kept(
        f"{name}, {force}{', left out' * script.options.leave_out}", partial(row, name, observation)
    )
    for force, observation in FORCES.items()
    for name in names
}
script.table("fits", rows, title="Fit of all tests, per cent", digits={"numbers": 3})

# %% Median and worst test of each family.
figure = Figure(figsize=(6.5, 3.5), layout="constrained")
axes = figure.subplots()
for force, colour in zip(FORCES, ("0.5", "tab:blue"), strict=True):
    for number, name in enumerate(names):
        found = rows[f"{name}, {force}"]
        axes.plot([found["worst"], found["median"]], [number, number], color=colour, alpha=0.3)
        axes.plot(
            found["median"], number, "o", color=colour, label=f"{force}, median" if number == 0 else None
        )
        axes.plot(found["worst"], number, "x", color=colour, label="worst test" if number == 0 else None)
axes.set(yticks=range(len(names)), yticklabels=names, xlabel="Fit (%)")
axes.invert_yaxis()
axes.legend(fontsize="small")
script.figure(figure, "fits")
script.check()
