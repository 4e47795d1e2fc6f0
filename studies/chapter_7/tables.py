"""Every table of the study."""

from __future__ import annotations

from typing import Any

from mrwork.report import Table
from studies.chapter_7.controlled_tests import FORCES, NO_DAMPER_NAME, OFF, QUANTITIES
from studies.chapter_7.earthquakes import CORNER, PEAK
from studies.chapter_7.predictions import ALL_TRUE, FULL, JUDGED
from studies.chapter_7.sine_tests import SWEEP_PEAK
from studies.chapter_7.virtual_rig import SENSORS, TABLE
from studies.former.table import Cell, alike, table_of

# Keys of the tests in the findings.
KINDS = ("measured", "synthetic", "quick")
_UNITS = {"displacement": "mm", "acceleration": "m/s2", "force": "N"}
_PARAMETER_UNITS = {
    "c.0": "N s/m",
    "c.1": "N s/(m A)",
    "k.0": "N/m",
    "k.1": "N/(m A)",
    "alpha.0": "N",
    "alpha.1": "N/A",
    "alpha.2": "N/A2",
    "beta": "s/m",
    "delta.0": "1",
    "delta.1": "1/A",
    "x_s": "mm",
    "f0.0": "N",
    "f0.1": "N/A",
}
_FACTORS = {"x_s": 1e3}


def tables(found: dict[str, Any]) -> dict[str, tuple[Table, ...]]:
    """Tables by the section that they belong to."""
    run = next(found[kind] for kind in KINDS if kind in found)
    return {
        "table": (_limits_table(), _demand_table(run["table"])),
        "frame": (_frame_table(found["frame"]),),
        "damper": (_sine_table(run["sines"]), _damper_table(run["damper"]), *_way_tables(run)),
        "tests": (
            _choice_table(run["chosen"]),
            _score_table(run["tests"]),
            *(_record_table(run["tests"], record) for record in run["tests"]["each"][OFF]),
        ),
        "predictions": _prediction_tables(run["predictions"]),
        "other": _other_tables(run.get("other")),
    }


def _other_tables(other: dict[str, Any] | None) -> tuple[Table, ...]:
    """The same of another damper; none in the quick form."""
    return () if other is None else (_score_table(other["tests"]), *_prediction_tables(other["predictions"]))


def _limits_table() -> Table:
    limits = {
        "stroke, from the middle": f"{1e3 * TABLE.stroke:g} mm",
        "velocity": f"{1e3 * TABLE.velocity:g} mm/s",
        "acceleration, with the specimen": f"{TABLE.acceleration:g} m/s2",
        "corner frequency of the low-pass": f"{TABLE.bandwidth:g} Hz",
        "damping ratio of the low-pass": f"{TABLE.damping:.3g}",
    }
    note = "Our definition of a table of medium size; those of no particular machine."
    return table_of("The table", "limit", limits, {"value": "{}"}, note=note)


def _demand_table(demands: dict[str, Any]) -> Table:
    return table_of(
        "What the records take of the table",
        "record",
        demands,
        {
            "peak [g]": "{peak_g:.3f}",
            "stroke [mm]": "{stroke_mm:.0f}",
            "velocity [mm/s]": "{velocity_mm_s:.0f}",
            "acceleration [g]": "{acceleration_g:.3f}",
            "nearest limit": "{limit}",
            "share [%]": lambda taken: f"{100.0 * taken['share']:.0f}",
            f"share at {PEAK:g} g [%]": lambda taken: f"{100.0 * taken['share_scaled']:.0f}",
            "stroke without high-pass [mm]": "{unfiltered_stroke_mm:.0f}",
        },
        note=f"At the natural amplitude and in natural time, high-passed at {CORNER:g} Hz and brought to rest at the "
        f"end; a share above 100 % is refused. The tests are at {PEAK:g} g.",
    )


def _frame_table(frame: dict[str, Any]) -> Table:
    (f, f_error), (zeta, zeta_error) = frame["fourier"].values()
    return table_of(
        "Table 7.1 in form: the frame",
        "number",
        ((name, name) for name in frame["true"]),
        {
            "true": lambda name: f"{frame['true'][name]:.6g}",
            "identified": lambda name: f"{frame['identified'][name]:.6g}",
            "standard error": lambda name: f"{frame['standard_error'][name]:.1g}",
            "deviation in standard errors": lambda name: f"{frame['in_errors'][name]:+.1f}",
        },
        note=f"Logarithmic decrement of {frame['extremes']} extremes; the Fourier spectrum gives {f:.6g} +- "
        f"{f_error:.1g} Hz and {zeta:.5g} +- {zeta_error:.1g} %. The errors are those of white noise; a frame that is "
        "not linear, or plates whose mass is not known, would add to them.",
    )


def _sine_table(sines: dict[str, Any]) -> Table:
    columns: dict[str, Cell] = {}
    for quantity, unit, measured, predicted in (
        ("displacement", "mm", "displacement_mm", "predicted_mm"),
        ("acceleration", "m/s2", "acceleration", "predicted_acceleration"),
    ):
        cell = f"{{{measured}:.2f}} ({{{predicted}:.2f}})"
        for current, found in sines.items():
            columns[f"{quantity} at {current} [{unit}]"] = (
                lambda frequency, cell=cell, of=found["amplitudes"]: cell.format_map(of[frequency])
            )
    frequencies = next(iter(sines.values()))["amplitudes"]
    title = f"Response amplitudes under {SWEEP_PEAK:g} m/s2, measured (predicted)"
    return table_of(title, "frequency", ((frequency, frequency) for frequency in frequencies), columns)


def _damper_table(damper: dict[str, Any]) -> Table:
    rows = {
        f"{name} [{_PARAMETER_UNITS[name]}]": {
            key: "-"
            if value is None
            else f"{_FACTORS.get(name, 1.0) * value:.{3 if key == 'standard_error' else 4}g}"
            for key, value in coefficient.items()
        }
        for name, coefficient in damper["coefficients"].items()
    }
    rate = damper["rate"]
    rows["rate of the driver [1/s]"] = {
        "true": f"{rate['true']:g}",
        "identified": f"{rate['identified']:.4g}",
        "standard_error": f"{rate['standard_error']:.3g}",
    }
    return table_of(
        "The damper from the sine tests",
        "coefficient",
        rows,
        {"true": "{true}", "identified": "{identified}", "standard error": "{standard_error}"},
        note=f"Static hysteretic model with current laws, {damper['tests']} tests, fit "
        f"{damper['fit_percent']:.2f} %. The gains of load cell and displacement sensor err by "
        f"{100.0 * (SENSORS.force.gain - 1.0):.1f} and {100.0 * (SENSORS.displacement.gain - 1.0):.1f} %, which no "
        "test of the rig can tell.",
    )


def _way_tables(run: dict[str, Any]) -> tuple[Table, ...]:
    if "ways" not in run:
        return ()
    columns: dict[str, Cell] = {
        "fit [%]": lambda way: f"{way['fit_percent']:.2f}" if "fit_percent" in way else ""
    }
    for name in ("c.0", "alpha.1", "beta", "delta.0", "delta.1", "x_s"):
        columns[f"{name} [{_PARAMETER_UNITS[name]}]"] = lambda way, name=name: (
            f"{_FACTORS.get(name, 1.0) * way['coefficients'][name]:.4g}"
        )
    note = (
        "From the same records. Small tests are those in which the damper nearly holds the frame; the fit "
        "without them is one to fewer tests."
    )
    return (table_of("The damper identified without a precaution", "way", run["ways"], columns, note=note),)


def _choice_table(chosen: dict[str, Any]) -> Table:
    return table_of(
        "Settings",
        "case",
        chosen,
        {"setting": "{setting}", "score on the choosing motions": "{score:.3f}"},
        note="Chosen on the identified rig under synthetic motions that judge nothing. R is the weight of the force "
        "[1/N2], the ratio that of the observer's densities S_ag/S_v.",
    )


def _score_table(tests: dict[str, Any]) -> Table:
    def better(name: str) -> str:
        wins = tests["better_than_best_constant"]
        return f"{wins[name]} of {tests['comparisons']}" if name in wins else ""

    rows = {
        name: {
            "score": score,
            **tests["ratios"][name],
            "mean": mean_of(tests["each"][name], "mean current"),
            "rest": mean_of(tests["each"][name], "current at rest"),
            "better": better(name),
        }
        for name, score in tests["score"].items()
    }
    return table_of(
        "Ratios to i = 0, mean over the records",
        "case",
        rows,
        {
            **alike(".3f", {name: name for name in ("score", *QUANTITIES)}),
            **alike(".2f", {"current [A]": "mean", "at rest [A]": "rest"}),
            "better than best constant": "{better}",
        },
        note="The score is the mean of the four ratios. Current: mean of the tests, and of the second before "
        "them, in which the table rests. The last column counts quantities and records.",
    )


def mean_of(runs: dict[str, dict[str, float]], quantity: str) -> float:
    """Mean over the records, without the sign of a zero."""
    return abs(sum(each[quantity] for each in runs.values()) / len(runs))


def _record_table(tests: dict[str, Any], record: str) -> Table:
    off = tests["each"][OFF][record]
    rows = {name: {"case": name, **runs[record]} for name, runs in tests["each"].items()}
    columns: dict[str, Cell] = {}
    for quantity in (*QUANTITIES, *FORCES):

        def cell(run: dict[str, Any], quantity: str = quantity) -> str:
            if quantity in QUANTITIES:
                return f"{run[quantity]:.2f} ({run[quantity] / off[quantity]:.2f})"
            return "" if run["case"] == NO_DAMPER_NAME else f"{run[quantity]:.0f}"

        columns[f"{quantity} [{_UNITS[quantity.split()[1]]}]"] = cell
    note = "In brackets the ratio to i = 0."
    return table_of(f"{record}, measured", "case", rows, columns, note=note)


def _prediction_tables(predictions: dict[str, Any]) -> tuple[Table, Table]:
    by_case = {
        case: {quantity: f"{errors[quantity]:.1f}" if quantity in errors else "" for quantity in JUDGED}
        for case, errors in predictions["by_case"].items()
    }
    cases = table_of(
        "Errors of the prediction by case, rms over the records [%]",
        "case",
        by_case,
        {quantity: f"{{{quantity}}}" for quantity in JUDGED},
    )
    variants = table_of(
        "Errors with one part replaced by the true one, rms and largest over cases and records [%]",
        "rig",
        predictions["by_variant"],
        {quantity: f"{{{quantity}[rms]:.1f}} ({{{quantity}[largest]:.1f}})" for quantity in JUDGED},
        note=f"Against what the sensors measured, so that '{ALL_TRUE}' has the errors of the sensors alone; '{FULL}' "
        "has the identified frame and damper, other noise in the loop, and the table's motion as its accelerometer has "
        "it; 'damper of true gains' is identified with sensors that have noise alone.",
    )
    return cases, variants
