"""Every table of the study."""

from __future__ import annotations

from typing import Any

from mrwork.report import Table
from studies.chapter_7.controlled_tests import FORCES, NO_DAMPER_NAME, OFF, QUANTITIES
from studies.chapter_7.earthquakes import CORNER, PEAK
from studies.chapter_7.predictions import ALL_TRUE, FULL, JUDGED
from studies.chapter_7.sine_tests import SWEEP_PEAK
from studies.chapter_7.virtual_rig import SENSORS, TABLE
from studies.common.table import table_of

# Keys of the tests in the findings.
KINDS = ("measured", "synthetic", "quick")
_UNITS = {
    "peak displacement": "mm",
    "rms displacement": "mm",
    "peak acceleration": "m/s2",
    "rms acceleration": "m/s2",
    "peak force": "N",
    "rms force": "N",
}
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
        "predictions": (
            _case_table(run["predictions"]["by_case"]),
            _variant_table(run["predictions"]["by_variant"]),
        ),
        "other": _other_tables(run["other"]) if "other" in run else (),
    }


def _limits_table() -> Table:
    return Table(
        title="The table",
        columns=("limit", "value"),
        rows=(
            ("stroke, from the middle", f"{1e3 * TABLE.stroke:g} mm"),
            ("velocity", f"{1e3 * TABLE.velocity:g} mm/s"),
            ("acceleration, with the specimen", f"{TABLE.acceleration:g} m/s2"),
            ("corner frequency of the low-pass", f"{TABLE.bandwidth:g} Hz"),
            ("damping ratio of the low-pass", f"{TABLE.damping:.3g}"),
        ),
        note="Our definition of a table of medium size; those of no particular machine.",
    )


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
            "share [%]": lambda each: f"{100.0 * each['share']:.0f}",
            f"share at {PEAK:g} g [%]": lambda each: f"{100.0 * each['share_scaled']:.0f}",
            "stroke without high-pass [mm]": "{unfiltered_stroke_mm:.0f}",
        },
        note=f"At the natural amplitude and in natural time, high-passed at {CORNER:g} Hz and brought to rest at the "
        f"end; a share above 100 % is refused. The tests are at {PEAK:g} g.",
    )


def _frame_table(frame: dict[str, Any]) -> Table:
    rows = []
    for name, true in frame["true"].items():
        value, error = frame["identified"][name], frame["standard_error"][name]
        rows.append((name, f"{true:.6g}", f"{value:.6g}", f"{error:.1g}", f"{frame['in_errors'][name]:+.1f}"))
    (f, f_error), (zeta, zeta_error) = frame["fourier"].values()
    return Table(
        title="Table 7.1 in form: the frame",
        columns=("number", "true", "identified", "standard error", "deviation in standard errors"),
        rows=tuple(rows),
        note=f"Logarithmic decrement of {frame['extremes']} extremes; the Fourier spectrum gives {f:.6g} +- "
        f"{f_error:.1g} Hz and {zeta:.5g} +- {zeta_error:.1g} %. The errors are those of white noise; a frame that is "
        "not linear, or plates whose mass is not known, would add to them.",
    )


def _sine_table(sines: dict[str, Any]) -> Table:
    frequencies = next(iter(sines.values()))["amplitudes"]
    return Table(
        title=f"Response amplitudes under {SWEEP_PEAK:g} m/s2, measured (predicted)",
        columns=(
            "frequency",
            *(f"displacement at {current} [mm]" for current in sines),
            *(f"acceleration at {current} [m/s2]" for current in sines),
        ),
        rows=tuple(
            (
                frequency,
                *(
                    f"{each[measured]:.2f} ({each[predicted]:.2f})"
                    for measured, predicted in (
                        ("displacement_mm", "predicted_mm"),
                        ("acceleration", "predicted_acceleration"),
                    )
                    for current in sines.values()
                    for each in [current["amplitudes"][frequency]]
                ),
            )
            for frequency in frequencies
        ),
    )


def _damper_table(damper: dict[str, Any]) -> Table:
    rate = damper["rate"]
    rows = []
    for name, each in damper["coefficients"].items():
        factor, error = _FACTORS.get(name, 1.0), each["standard_error"]
        rows.append(
            (
                f"{name} [{_PARAMETER_UNITS[name]}]",
                f"{factor * each['true']:.4g}",
                f"{factor * each['identified']:.4g}",
                "-" if error is None else f"{factor * error:.3g}",
            )
        )
    rows.append(
        (
            "rate of the driver [1/s]",
            f"{rate['true']:g}",
            f"{rate['identified']:.4g}",
            f"{rate['standard_error']:.3g}",
        )
    )
    return Table(
        title="The damper from the sine tests",
        columns=("coefficient", "true", "identified", "standard error"),
        rows=tuple(rows),
        note=f"Static hysteretic model with current laws, {damper['tests']} tests, fit "
        f"{damper['fit_percent']:.2f} %. The gains of load cell and displacement sensor err by "
        f"{100.0 * (SENSORS.force.gain - 1.0):.1f} and {100.0 * (SENSORS.displacement.gain - 1.0):.1f} %, which no "
        "test of the rig can tell.",
    )


def _way_tables(run: dict[str, Any]) -> tuple[Table, ...]:
    if "ways" not in run:
        return ()
    shown = ("c.0", "alpha.1", "beta", "delta.0", "delta.1", "x_s")
    return (
        Table(
            title="The damper identified without a precaution",
            columns=("way", "fit [%]", *(f"{name} [{_PARAMETER_UNITS[name]}]" for name in shown)),
            rows=tuple(
                (
                    name,
                    f"{each['fit_percent']:.2f}" if "fit_percent" in each else "",
                    *(f"{_FACTORS.get(key, 1.0) * each['coefficients'][key]:.4g}" for key in shown),
                )
                for name, each in run["ways"].items()
            ),
            note="From the same records. Small tests are those in which the damper nearly holds the frame; the fit "
            "without them is one to fewer tests.",
        ),
    )


def _choice_table(chosen: dict[str, Any]) -> Table:
    return table_of(
        "Settings",
        "case",
        chosen,
        {
            "setting": "{setting}",
            "score on the choosing motions": "{score:.3f}",
        },
        note="Chosen on the identified rig under synthetic motions that judge nothing. R is the weight of the force "
        "[1/N2], the ratio that of the observer's densities S_ag/S_v.",
    )


def _score_table(tests: dict[str, Any]) -> Table:
    return Table(
        title="Ratios to i = 0, mean over the records",
        columns=(
            "case",
            "score",
            *QUANTITIES,
            "current [A]",
            "at rest [A]",
            "better than best constant",
        ),
        rows=tuple(
            (
                name,
                f"{score:.3f}",
                *(f"{tests['ratios'][name][quantity]:.3f}" for quantity in QUANTITIES),
                f"{mean_of(runs, 'mean current'):.2f}",
                f"{mean_of(runs, 'current at rest'):.2f}",
                f"{tests['better_than_best_constant'][name]} of {tests['comparisons']}"
                if name in tests["better_than_best_constant"]
                else "",
            )
            for name, score in tests["score"].items()
            for runs in [tests["each"][name]]
        ),
        note="The score is the mean of the four ratios. Current: mean of the tests, and of the second before "
        "them, in which the table rests. The last column counts quantities and records.",
    )


def mean_of(runs: dict[str, dict[str, float]], quantity: str) -> float:
    """Mean over the records, without the sign of a zero."""
    return abs(sum(each[quantity] for each in runs.values()) / len(runs))


def _other_tables(other: dict[str, Any]) -> tuple[Table, ...]:
    return (
        _score_table(other["tests"]),
        _case_table(other["predictions"]["by_case"]),
        _variant_table(other["predictions"]["by_variant"]),
    )


def _record_table(tests: dict[str, Any], record: str) -> Table:
    off = tests["each"][OFF][record]
    rows = []
    for name, runs in tests["each"].items():
        each = runs[record]
        cells = []
        for quantity in (*QUANTITIES, *FORCES):
            if name == NO_DAMPER_NAME and quantity in FORCES:
                cells.append("")
            elif quantity in FORCES:
                cells.append(f"{each[quantity]:.0f}")
            else:
                cells.append(f"{each[quantity]:.2f} ({each[quantity] / off[quantity]:.2f})")
        rows.append((name, *cells))
    return Table(
        title=f"{record}, measured",
        columns=("case", *(f"{name} [{_UNITS[name]}]" for name in (*QUANTITIES, *FORCES))),
        rows=tuple(rows),
        note="In brackets the ratio to i = 0.",
    )


def _case_table(by_case: dict[str, Any]) -> Table:
    return Table(
        title="Errors of the prediction by case, rms over the records [%]",
        columns=("case", *JUDGED),
        rows=tuple(
            (name, *(f"{each[quantity]:.1f}" if quantity in each else "" for quantity in JUDGED))
            for name, each in by_case.items()
        ),
    )


def _variant_table(by_variant: dict[str, Any]) -> Table:
    return Table(
        title="Errors with one part replaced by the true one, rms and largest over cases and records [%]",
        columns=("rig", *JUDGED),
        rows=tuple(
            (name, *(f"{each[quantity]['rms']:.1f} ({each[quantity]['largest']:.1f})" for quantity in JUDGED))
            for name, each in by_variant.items()
        ),
        note=f"Against what the sensors measured, so that '{ALL_TRUE}' has the errors of the sensors alone; '{FULL}' "
        "has the identified frame and damper, other noise in the loop, and the table's motion as its accelerometer has "
        "it; 'damper of true gains' is identified with sensors that have noise alone.",
    )
