"""Chapter 5 of the thesis: static models of an MR damper identified against current.

python studies/chapter_5/study.py [--json] [--out DIRECTORY] [--seed N]
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from current_laws import MODELS, WITH_LAWS, Laws
from damper_tests import measured_sets, synthetic_sets
from law_tables import law_rms_table, law_table, per_current_table, rms_table
from mrwork.report import departures
from mrwork.search import EfficientGA
from outcome import SetOutcome, study_set
from page import write_page
from thickness_and_mean import as_numbers, compared, loops_table

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
DATA = Path(os.environ.get("MRWORK_DATA", ROOT.parent / "shared" / "data"))
RECORDS = DATA / "dampers" / "utfsm"


def summary(outcome: SetOutcome) -> dict[str, Any]:
    """Everything that was found on one set, ready for JSON."""
    laws = {
        label: {way: _law(getattr(comparison, way), outcome) for way in ("through", "weighted", "joint")}
        for label, comparison in outcome.laws.items()
    }
    if outcome.true_laws is not None:
        laws[WITH_LAWS[0].label]["truth"] = _law(outcome.true_laws, outcome)
    return {
        "synthetic": outcome.tests.synthetic,
        "currents": outcome.tests.currents.tolist(),
        "models": {
            label: {
                "parameters": [estimate.name for estimate in each.fits[0].estimates],
                "values": each.values.tolist(),
                "standard_errors": _plain(each.errors),
                "rms_n": each.rms_n.tolist(),
                "mean_rms_n": float(each.rms_n.mean()),
            }
            for label, each in outcome.each.items()
        },
        "laws": laws,
        "loops": as_numbers(compared(outcome)),
    }


def text_of(outcome: SetOutcome) -> str:
    kind = "synthetic" if outcome.tests.synthetic else "measured"
    tables = [rms_table(outcome), loops_table(outcome)]
    for label in outcome.laws:
        each = outcome.each[label]
        tables += [per_current_table(outcome, each), law_table(outcome, each)]
    tables.append(law_rms_table(outcome))
    return "\n".join([f"## {outcome.tests.name} ({kind})", "", *(table.markdown() for table in tables)])


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--json", action="store_true", help="one JSON object on stdout and nothing else")
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "chapter_5", help="where the report goes")
    parser.add_argument("--seed", type=int, default=1, help="of the searches and the synthetic noise")
    options = parser.parse_args()
    began = time.perf_counter()

    def on_progress(doing: str) -> None:
        print(f"{time.perf_counter() - began:6.0f} s  {doing}", file=sys.stderr, flush=True)

    measured = measured_sets(RECORDS)
    skipped = (
        ""
        if measured
        else f"Skipped: the measured UTFSM tests are not at {RECORDS}; point MRWORK_DATA at the data."
    )
    outcomes = [
        study_set(
            tests,
            models=MODELS,
            search=EfficientGA(),
            rng=options.seed,
            on_progress=on_progress,
        )
        for tests in (*synthetic_sets(seed=options.seed), *measured)
    ]
    seconds = time.perf_counter() - began
    found = {outcome.tests.name: summary(outcome) for outcome in outcomes}
    wrong = departures(found, HERE / "expected.toml")
    report = options.out / "report.html"
    write_page(outcomes, report, skipped=skipped, footer=f"Seed {options.seed}, {seconds:.0f} s.")
    if options.json:
        print(
            json.dumps(
                {
                    "seconds": seconds,
                    "seed": options.seed,
                    "skipped": skipped,
                    "sets": found,
                    "departures": wrong,
                }
            )
        )
    else:
        print("\n".join(text_of(outcome) for outcome in outcomes))
        print(skipped or "Synthetic and measured tests.")
        print(f"Report: {report}; {seconds:.0f} s.")
        print("\n".join(wrong) or "Every figure agrees with expected.toml.")
    return 1 if wrong else 0


def _law(laws: Laws, outcome: SetOutcome) -> dict[str, Any]:
    return {
        "coefficients": laws.coefficients,
        "standard_errors": {name: _plain(np.array(errors)) for name, errors in laws.errors.items()},
        "rms_n": laws.rms_n.tolist(),
        "relative": outcome.tests.relative(laws.rms_n),
    }


def _plain(numbers: np.ndarray) -> Any:
    """Nested lists with null for what is not a number, as JSON has it."""
    return np.where(np.isfinite(numbers), numbers.astype(object), None).tolist()


if __name__ == "__main__":
    sys.exit(main())
