"""How much do tuned and learned control laws gain over good weights, on motions that they were not tuned on?

Little: on sixteen measured motions the best weights, their R alone scanned on 32 synthetic training motions, score
0.699 and 0.606 of i = 0 (0.1 g and 0.3 g), the best tuned law 0.677 and 0.602, a learned network 0.685 and 0.594. No
law is better than the best constant current in both peaks on more than 13 of 20 motions. Tuned laws bear draws of
damper, building and delay, untuned ones with large gains do not at 0.1 g. The damper is one that was identified from
virtual tests. An hour of two cores, the quick form half a minute; `--level` for one of the levels.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from matplotlib.figure import Figure

import mrwork as mr
from common import DATA, Script

level_option = {"choices": ("0.1 g", "0.3 g"), "help": "one level of the motions instead of both"}
quick = "few short motions at 0.1 g and few candidates of one law; the damper from few tests"
script = Script(__file__, __doc__, quick=quick, level=level_option)
script.data("records", "real")
FILES = {"0.1 g": "robust_level_01.toml", "0.3 g": "robust_level_03.toml"}
LEVELS = [script.options.level] if script.options.level else list(FILES)[: 1 if script.quick else 2]

# %% Virtual tests of an RD-1005-3 at five currents. Without the smallest motion the posterior of x_s, the elongation
# over which the force turns, spans three decades, and with it the floor accelerations.
CURRENTS = (0.0, 0.94, 1.88) if script.quick else (0.0, 0.47, 0.94, 1.41, 1.88)  # A
MOTIONS = ((0.0003, 1.0), (0.002, 3.0), (0.006, 2.0))  # m, Hz
CYCLES, DT, FORCE_NOISE, DISPLACEMENT_NOISE = 4, 1e-3, 15.0, 5e-6  # s, N, m
LAWS = {"c": "linear", "k": "linear", "alpha": "quadratic", "delta": "linear", "f0": "linear"}
RD1005 = mr.damper("static_hysteretic").preset("kwok2006")
rng, tests = np.random.default_rng(2006), []
for current in CURRENTS:
    for amplitude, frequency in MOTIONS:
        omega = 2.0 * np.pi * frequency
        time = DT * np.arange(round(CYCLES / frequency / DT) + 1)
        x, v = amplitude * np.sin(omega * time), amplitude * omega * np.cos(omega * time)
        loading = mr.Loading(dt=DT, displacement=x, velocity=v, command=current, command_unit="A")
        force = mr.simulate_force(RD1005.spec, RD1005.theta, loading)
        test = mr.test_from_arrays(
            time,
            x + DISPLACEMENT_NOISE * rng.standard_normal(time.size),
            force + FORCE_NOISE * rng.standard_normal(time.size),
            velocity=v,
            current=current,
            name=f"{1e3 * amplitude:g} mm, {frequency:g} Hz, {current:g} A",
            synthetic=True,
        )
        tests.append(test)

# %% Its run folder with draws of the posterior, which the study files name; it is made once.
run = script.out / ("damper_quick" if script.quick else "damper")
if not run.exists():
    script.say(f"identification of the damper from {len(tests)} tests, and its posterior")
    model = mr.damper("static_hysteretic").with_current_laws(LAWS, unit="A")
    fit = mr.identify(model, tests, rng=0, threads=script.threads)
    steps = 30 if script.quick else 20_000
    draws = mr.sample(fit, tests, rng=0, most_steps=steps, threads=script.threads)
    mr.save(fit, run)
    mr.save(draws, run)
fit = mr.load(run, mr.StoredRun).fit
truth = dict(zip(RD1005.spec.names, RD1005.theta, strict=True))
rows = {each.name: {"truth": truth[each.name], "identified": each.value} for each in fit.estimates}
script.table("damper", rows, title="The identified damper")

# %% Each level: laws tuned on 32 synthetic motions, judged on four records and sixteen measured motions.
SCORE = ("peak_drift", "peak_acceleration", "rms_drift", "rms_acceleration")
RECORDS = ("el_centro", "hachinohe", "kobe", "northridge")
REFERENCES = ("Passive-off", "Optimal passive", "Passive-on")


def tuned(study: mr.Study, table: Any) -> list[dict[str, Any]]:
    """Rows of the references and laws of a table of the study file."""
    found = mr.tune(study, [table], rng=script.seed, threads=script.threads)
    results = mr.tuning.judge(study, found, threads=script.threads)
    return [{each.label: numbers_of(results, each) for each in (*found.references, *found.laws)}]


def numbers_of(results: mr.tuning.TunedStudy, law: mr.tuning.TunedLaw) -> dict[str, Any]:
    """Training score, and what the law does on the test motions, over i = 0."""
    row, judged = results.row_of_law(law), results.judged_motions
    train, test = results.judgement(law, "training"), results.judgement(law, "test")
    ratios = [results.ratios(row, motion, "passive_off") for motion in judged]
    runs = [results.criteria(row, motion) for motion in judged]
    both = results.realised.part([row, results.row_of("passive_off")], list(judged))
    realised, off = both.of_row(0), both.of_row(1)
    values = {"score": realised.scores(off), "peak_drift": realised.over(off)["peak_drift"]}
    return {
        "training": train.score.mean,
        "motions": {results.motions[motion].name: results.scores(row)[motion] for motion in judged},
        "peaks": [[each[name] for name in SCORE[:2]] for each in ratios],
        "ratios": {name: test.criteria[name].mean for name in SCORE},
        "current": max(each["rms_current"] for each in runs),
        "stroke": max(each["peak_stroke"] for each in runs),
        "bands": {
            name: np.quantile(numbers[0].mean(axis=0), (0.5, 0.05, 0.95)).tolist()
            for name, numbers in values.items()
            if results.n_realisations
        },
    }


figure = Figure(figsize=(6.0 * len(LEVELS), 5.0), layout="constrained")
for axes, level in zip(np.ravel(figure.subplots(1, len(LEVELS))), LEVELS, strict=True):
    text = (script.folder.parent / "rollout" / FILES[level]).read_text(encoding="utf-8")
    text = text.replace("../../out/studies/robust_control/damper", run.resolve().as_posix())
    text = text.replace("../../../shared/data", DATA.resolve().as_posix())
    if script.quick:
        for whole, part in (
            ("end = 50", "end = 6"),
            ("motions = 24", "motions = 4"),
            ("motions = 8", "motions = 2"),
        ):
            text = text.replace(whole, part)
    file = script.out / FILES[level]
    file.write_text(text, encoding="utf-8")
    study = mr.read_study(file)
    laws: dict[str, Any] = {}
    for place, table in enumerate(study.tunes[:1] if script.quick else study.tunes):
        table = replace(table, budget=10, population=5) if script.quick else table
        (found,) = script.kept(
            f"{level}, tuning {place + 1} of {len(study.tunes)}", partial(tuned, study, table)
        )
        laws |= found

    rows = {}
    for label, law in laws.items():
        scores = {
            test: [
                score
                for name, score in law["motions"].items()
                if name.startswith(RECORDS) == (test == "four")
            ]
            for test in ("four", "sixteen")
        }
        both = sorted(law["motions"].values())
        rows[label] = {
            "training": law["training"],
            "four": np.mean(scores["four"]),
            "sixteen": np.mean(scores["sixteen"]),
            "lower quartile": np.quantile(both, 0.25),
            "upper quartile": np.quantile(both, 0.75),
            "worst four": np.mean(both[-4:]),
            **law["ratios"],
            "rms current [A]": law["current"],
            "stroke [mm]": 1e3 * law["stroke"],
        }
    number = FILES[level][-7:-5]
    title = f"{level}: scores on motions that chose nothing, ratios to i = 0 of the twenty"
    script.table(f"laws_{number}", rows, title=title, digits=3)

    # Peaks over those of the best constant current; the best law of each motion is chosen after the fact.
    over = {
        label: np.array(law["peaks"]) / np.array(laws["Optimal passive"]["peaks"])
        for label, law in laws.items()
        if label not in REFERENCES
    }
    larger = np.stack([each.max(axis=1) for each in over.values()])
    each_motion = np.arange(larger.shape[1])
    over["best of them, by motion"] = np.stack(list(over.values()))[larger.argmin(axis=0), each_motion]
    peaks = {
        label: {
            "peak drift lower": int((ratios[:, 0] < 1.0).sum()),
            "peak acc. lower": int((ratios[:, 1] < 1.0).sum()),
            "both": int((ratios.max(axis=1) < 1.0).sum()),
            "both by 1 %": int((ratios.max(axis=1) < 0.99).sum()),
            "larger ratio": ratios.max(axis=1).mean(),
        }
        for label, ratios in over.items()
    }
    title = f"{level}: motions of the twenty on which peaks are below those of the best constant current"
    script.table(f"peaks_{number}", peaks, title=title)
    bands = {
        label: {
            f"{name}, {end}": value
            for name, band in law["bands"].items()
            for end, value in zip(("median", "5 %", "95 %"), band, strict=True)
        }
        for label, law in laws.items()
        if law["bands"]
    }
    script.table(
        f"bands_{number}", bands, title=f"{level}: over draws of damper, building and delay", digits=3
    )

    ranked = sorted(rows, key=lambda label: -rows[label]["sixteen"])
    axes.plot([rows[label]["training"] for label in ranked], ranked, "o", label="training")
    axes.plot([rows[label]["sixteen"] for label in ranked], ranked, "s", label="sixteen measured")
    axes.set(xlabel="Score over i = 0", title=level)
    axes.legend()
script.figure(figure, "scores")
script.check()
