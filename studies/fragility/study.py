"""Fragilities of suites of records whose median and dispersion are known: bias, and how often bands hold the truth.

python studies/fragility/study.py [--quick] [--suites N] [--records N] [--levels N] [--seed N] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

from argparse import Namespace
from itertools import product
from math import exp, isnan, sqrt
from statistics import NormalDist
from typing import Any

import numpy as np

from mrwork.report import Table
from mrwork.study import Fragilities, drawn_weights, fragility_of
from studies.common.command import Command, Findings, Say
from studies.common.table import alike, table_of

# Median intensity without and with a law [m/s^2], dispersion of both, and correlation of their logarithms.
MEDIANS, DISPERSION, CORRELATION = (2.0, 2.6), 0.4, 0.8
CENSORED = (0.0, 0.3, 0.6)
LEVEL = 0.9


def suite(censored: float, n_records: int, n_levels: int, seed: int) -> Fragilities:
    """Records that reach a limit at drawn intensities, a share of them without a law above the highest level."""
    rng = np.random.default_rng([seed, round(100 * censored)])
    shared, own = rng.standard_normal(n_records), rng.standard_normal((2, n_records))
    scatter = sqrt(CORRELATION) * shared + sqrt(1.0 - CORRELATION) * own
    reached = np.array(MEDIANS)[:, None] * np.exp(DISPERSION * scatter)
    quantile = NormalDist().inv_cdf(1.0 - censored) if censored else 3.0
    levels = np.linspace(0.0, MEDIANS[0] * exp(DISPERSION * quantile), n_levels + 1)[1:]
    weights, names = drawn_weights(n_records, seed), [str(number) for number in range(n_records)]
    rows = {
        label: fragility_of(
            *(label, kind, levels / each[:, None], levels, 1.0, weights), level=LEVEL, records=names
        )
        for (label, kind), each in zip(
            (("bare", "uncontrolled"), ("law", "controller")), reached, strict=True
        )
    }
    return Fragilities(criterion="peak_drift", limit=1.0, unit="m", level=LEVEL, rows=rows)


def counted(found: Fragilities) -> dict[str, float]:
    """Whether each band holds the truth, and the errors of what is known."""
    truths = (*MEDIANS, MEDIANS[1] / MEDIANS[0])
    ratio, ends = found.ratio("law", "bare")
    bare, law = found["bare"], found["law"]
    values = (bare.median, law.median, ratio)
    unknown = (bool(bare.bound), bool(law.bound), isnan(ratio))
    numbers: dict[str, float] = {}
    for name, truth, value, band, is_unknown in zip(
        ("median", "median_law", "ratio"), truths, values, (bare.band, law.band, ends), unknown, strict=True
    ):
        numbers[name] = float(band[0] <= truth <= band[1])
        numbers[f"{name}_below"] = float(truth < band[0])
        numbers[f"{name}_error"] = np.nan if is_unknown else float(np.log(value / truth))
        numbers[f"{name}_bounded"] = float(np.isfinite(band[1]))
    return numbers | {"dispersion_error": np.nan if bare.bound else bare.dispersion - DISPERSION}


def shares(rows: list[dict[str, float]]) -> dict[str, Any]:
    """Means in per cent over suites, of errors those of the suites where the number is known."""
    return {
        name: 100.0 * float(np.nanmean([row[name] for row in rows]))
        if any(np.isfinite(row[name]) for row in rows)
        else np.nan
        for name in rows[0]
    } | {"n": len(rows)}


def table(found: dict[str, dict[str, Any]]) -> Table:
    """A row for each share of censored records."""
    columns = {
        "median held": "median",
        "median of law held": "median_law",
        "ratio held": "ratio",
        "truth below ratio": "ratio_below",
        "ratio has an upper end": "ratio_bounded",
        "bias of median": "median_error",
        "bias of ratio": "ratio_error",
        "bias of dispersion": "dispersion_error",
    }
    title = f"{100.0 * LEVEL:.0f} % bands, per cent of the suites"
    return table_of(title, "censored %", found, {**alike(".1f", columns), "suites": "{n}"})


def find(options: Namespace, say: Say) -> Findings:
    rows: dict[str, list[dict[str, float]]] = {}
    for censored, number in product(CENSORED, range(20 if options.quick else options.suites)):
        if number % 100 == 0:
            say(f"{100.0 * censored:.0f} % censored, suite {number}")
        found = suite(censored, options.records, options.levels, options.seed + number)
        rows.setdefault(f"{100.0 * censored:.0f}", []).append(counted(found))
    numbers = {name: shares(each) for name, each in rows.items()}
    return Findings(numbers=numbers, text=[table(numbers)], judged={}, agreement="")


if __name__ == "__main__":
    command = Command(__file__, __doc__, quick="20 suites of each", seed=(0, "of the first suite"))
    for option, default in (("suites", 500), ("records", 20), ("levels", 15)):
        command.parser.add_argument(f"--{option}", type=int, default=default, help=f"default {default}")
    sys.exit(command.run(find))
