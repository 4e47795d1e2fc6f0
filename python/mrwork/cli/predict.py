"""`mrwork predict`: a stored fit run freely on other tests."""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.cli.options import add_files, add_json, read_tests
from mrwork.identification.judge import judge
from mrwork.report.run_directory import read_fit
from mrwork.spec import damper


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser(
        "predict",
        help="run a stored fit on other tests",
        description="Simulate the motion of other tests with a stored fit and compare the force.",
    )
    parser.add_argument("fit", type=Path, metavar="RUN", help="run directory of mrwork identify")
    add_files(parser)
    parser.add_argument(
        "--substep-factor",
        type=int,
        default=1,
        metavar="N",
        help="multiply the sub-steps of the integration by 2, 4, ... to check that nothing changes",
    )
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Predict every test and print how it compares."""
    fit = read_fit(options.fit)
    spec = damper(fit.model)
    theta = np.array(fit.theta)
    rows = []
    for test in read_tests(options):
        _, quality = judge(spec, theta, test, substep_factor=options.substep_factor)
        rows.append(
            {
                "file": test.path or test.name,
                "fit_percent": quality.fit_percent,
                "nrmse": quality.nrmse,
                "rmse_n": quality.rmse_n,
                "error_norms": {
                    "time": quality.error_norms.time,
                    "displacement": quality.error_norms.displacement,
                    "velocity": quality.error_norms.velocity,
                },
                "n_time": quality.n_time,
                "settle_seconds": quality.settle_seconds,
                "substeps": quality.substeps,
            }
        )
    if options.json:
        print(json.dumps({"model": fit.model, "files": rows}))
        return 0
    width = max(len(str(row["file"])) for row in rows)
    print(f"{'file':<{width}}  {'fit %':>8}  {'NRMSE':>8}  {'RMSE [N]':>9}  {'samples':>8}  {'sub-steps':>9}")
    for row in rows:
        print(
            f"{row['file']:<{width}}  {row['fit_percent']:8.2f}  {row['nrmse']:8.4f}  {row['rmse_n']:9.2f}  "
            f"{row['n_time']:8d}  {row['substeps']:9d}"
        )
    return 0
