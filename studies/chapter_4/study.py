"""Chapter 4 of the thesis: genetic searches for the parameters of an MR damper, judged over many runs.

python studies/chapter_4/study.py [--json] [--out DIRECTORY] [--threads N] [--fresh] [--settings FILE]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import time
from argparse import Namespace
from collections.abc import Iterator
from dataclasses import asdict

from studies.chapter_4.excerpts import measured_excerpts, synthetic_excerpts
from studies.chapter_4.findings import TrialFinding, comparisons_of, findings_of
from studies.chapter_4.page import write_page
from studies.chapter_4.search_cells import cells_of
from studies.chapter_4.search_runs import run_cells
from studies.chapter_4.search_settings import ComparisonSettings
from studies.chapter_4.tables import tables_of
from studies.former.command import Command, Findings, Say, Shown
from studies.former.records import absent, damper_tests

SETTINGS = Path(__file__).parent / "study.toml"


def averages(findings: tuple[TrialFinding, ...]) -> dict[str, dict[str, dict[str, float]]]:
    """Values compared with expected.toml: by model and search, means over the currents."""
    gathered: dict[str, dict[str, dict[str, float]]] = {}
    for model in dict.fromkeys(finding.model for finding in findings):
        trials = [finding for finding in findings if finding.model == model]
        for search in trials[0].searches:
            cells = [trial.searches[search] for trial in trials]
            gathered.setdefault(model, {})[search] = {
                "error_percent": sum(100.0 * cell.mean_error for cell in cells) / len(cells),
                "below_level": sum(cell.below for cell in cells) / len(cells),
                "evaluations": sum(cell.evaluations for cell in cells) / len(cells),
            }
    return gathered


def find(options: Namespace, say: Say) -> Findings | int:
    began = time.perf_counter()
    settings = ComparisonSettings.read(options.settings)
    measured = measured_excerpts(damper_tests(), settings.measured)
    skipped = "" if measured else absent("Skipped: the measured UTFSM tests are", damper_tests()) + "."
    sets = (synthetic_excerpts(settings.synthetic, seed=settings.seed), *((measured,) if measured else ()))
    cells = cells_of(settings, sets)
    kept = options.out / "cells"
    try:
        found = run_cells(cells, kept, threads=options.threads, fresh=options.fresh, say=say)
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
    report = options.out / "report.html"
    footer = f"Seed {settings.seed}; the searches took {searching:.0f} s."
    write_page(comparisons, findings, report, settings=settings, skipped=skipped, footer=footer)
    seconds = time.perf_counter() - began

    def text() -> Iterator[str | Shown]:
        for tests, trials in zip(sets, findings, strict=True):
            yield f"## {tests.name} ({'synthetic' if tests.synthetic else 'measured'})\n"
            yield from tables_of(trials, tests.name)
        yield skipped or "Synthetic and measured tests."
        yield f"Searches {searching:.0f} s, kept ones included; this command {seconds:.0f} s."
        yield f"Report: {report}"

    numbers = {
        "seconds": seconds,
        "seconds_searching": searching,
        "settings": asdict(settings),
        "skipped": skipped,
        "sets": {
            tests.name: [asdict(trial) for trial in trials]
            for tests, trials in zip(sets, findings, strict=True)
        },
        "averages": guarded,
    }
    if options.settings == SETTINGS:
        return Findings(numbers=numbers, text=text(), judged=guarded)
    unjudged = "Not judged: expected.toml is for study.toml."
    return Findings(numbers=numbers, text=text(), judged={}, agreement=unjudged)


if __name__ == "__main__":
    command = Command(__file__, __doc__, threads=True, out=True)
    add = command.parser.add_argument
    add("--fresh", action="store_true", help="run every cell again, also those that are kept")
    add("--settings", type=Path, default=SETTINGS, help="in place of study.toml")
    sys.exit(command.run(find))
