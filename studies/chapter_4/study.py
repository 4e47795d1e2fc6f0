"""Chapter 4 of the thesis: genetic searches for the parameters of an MR damper, judged over many runs.

python studies/chapter_4/study.py [--json] [--out DIRECTORY] [--threads N] [--fresh] [--settings FILE]
"""

from __future__ import annotations

import argparse
import json
import math
import os
import sys
import time
import tomllib
from dataclasses import asdict
from pathlib import Path
from typing import Any

# Its tests and its tables are those of chapter 5.
sys.path.append(str(Path(__file__).parents[1] / "chapter_5"))

from comparison_page import write_page
from comparison_tables import tables_of
from excerpts import measured_excerpts, synthetic_excerpts
from findings import TrialFinding, comparisons_of, findings_of
from search_cells import cells_of
from search_runs import run_cells
from search_settings import ComparisonSettings

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
DATA = Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data"))
RECORDS = DATA / "dampers" / "utfsm"
SETTINGS = HERE / "study.toml"


def averages(findings: tuple[TrialFinding, ...]) -> dict[str, dict[str, dict[str, float]]]:
    """Values compared with expected.toml: by model and search, means over the currents."""
    gathered: dict[str, dict[str, dict[str, float]]] = {}
    for model in dict.fromkeys(finding.model for finding in findings):
        trials = [finding for finding in findings if finding.model == model]
        gathered[model] = {
            search: {
                "error_percent": _mean([100.0 * trial.searches[search].mean_error for trial in trials]),
                "below_level": _mean([trial.searches[search].below for trial in trials]),
                "evaluations": _mean([trial.searches[search].evaluations for trial in trials]),
            }
            for search in trials[0].searches
        }
    return gathered


def departures(found: dict[str, dict[str, dict[str, dict[str, float]]]]) -> list[str]:
    """One sentence for each value outside the limits of expected.toml; skipped sets are not compared."""
    expected = tomllib.loads((HERE / "expected.toml").read_text(encoding="utf-8"))
    return [
        f"{tests}, {model}, {search}: {name} is {found[tests][model][search][name]:.4g}, "
        f"expected {bounds['value']:g} +- {bounds['tolerance']:g}"
        for tests, models in expected.items()
        if tests in found
        for model, searches in models.items()
        for search, figures in searches.items()
        for name, bounds in figures.items()
        if not abs(found[tests][model][search][name] - bounds["value"]) <= bounds["tolerance"]
    ]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "chapter_4", help="where the report goes")
    parser.add_argument("--threads", type=int, default=0, help="of the simulation; 0 is one per processor")
    parser.add_argument("--fresh", action="store_true", help="run every cell again, also those that are kept")
    parser.add_argument("--settings", type=Path, default=SETTINGS, help="in place of study.toml")
    options = parser.parse_args()
    began = time.perf_counter()
    settings = ComparisonSettings.read(options.settings)
    measured = measured_excerpts(RECORDS, settings.measured)
    skipped = (
        ""
        if measured
        else f"Skipped: the measured UTFSM tests are not at {RECORDS}; point MRWORK_DATA at the data."
    )
    sets = (synthetic_excerpts(settings.synthetic, seed=settings.seed), *((measured,) if measured else ()))
    cells = cells_of(settings, sets)
    kept = options.out / "cells"
    try:
        found = run_cells(cells, kept, threads=options.threads, fresh=options.fresh)
    except KeyboardInterrupt:
        print(
            f"\nInterrupted. Finished cells are kept in {kept}; the same command, without --fresh, goes on there.",
            file=sys.stderr,
        )
        return 130
    comparisons = comparisons_of(sets, cells, found)
    findings = [findings_of(comparison, settings) for comparison in comparisons]
    searching = sum(each.seconds for each in found)
    guarded = {tests.name: averages(trials) for tests, trials in zip(sets, findings, strict=True)}
    wrong = departures(guarded) if options.settings == SETTINGS else []
    report = options.out / "report.html"
    write_page(
        comparisons,
        findings,
        report,
        settings=settings,
        skipped=skipped,
        footer=f"Seed {settings.seed}; the searches took {searching:.0f} s.",
    )
    if options.json:
        print(
            json.dumps(
                _plain(
                    {
                        "seconds": time.perf_counter() - began,
                        "seconds_searching": searching,
                        "settings": asdict(settings),
                        "skipped": skipped,
                        "sets": {
                            tests.name: [asdict(trial) for trial in trials]
                            for tests, trials in zip(sets, findings, strict=True)
                        },
                        "averages": guarded,
                        "departures": wrong,
                    }
                )
            )
        )
    else:
        for tests, trials in zip(sets, findings, strict=True):
            print(f"## {tests.name} ({'synthetic' if tests.synthetic else 'measured'})", end="\n\n")
            for table in tables_of(trials, tests.name):
                print(table.markdown())
        print(skipped or "Synthetic and measured tests.")
        print(
            f"Searches {searching:.0f} s, kept ones included; this command {time.perf_counter() - began:.0f} s."
        )
        print(f"Report: {report}")
        if options.settings != SETTINGS:
            print("Not judged: expected.toml is for study.toml.")
        else:
            print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


def _mean(values: list[float]) -> float:
    return sum(values) / len(values)


def _plain(value: Any) -> Any:
    """The same with null for what is not a finite number, as JSON has it."""
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


if __name__ == "__main__":
    sys.exit(main())
