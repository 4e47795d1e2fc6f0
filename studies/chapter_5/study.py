"""Chapter 5 of the thesis: static models of an MR damper identified against current.

python studies/chapter_5/study.py [--json] [--out DIRECTORY] [--seed N]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import time
from argparse import Namespace
from typing import Any

from mrwork.search import EfficientGA
from studies.chapter_5.damper_tests import measured_sets, synthetic_sets
from studies.chapter_5.outcome import MODELS, WITH_LAWS, Fitting, Laws, SetOutcome, study_set
from studies.chapter_5.page import write_page
from studies.chapter_5.tables import law_rms_table, law_table, per_current_table, rms_table
from studies.chapter_5.thickness_and_mean import as_numbers, compared, loops_table
from studies.former.command import Command, Findings, Say
from studies.former.records import absent, damper_tests


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
                "standard_errors": each.errors.tolist(),
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


def find(options: Namespace, say: Say) -> Findings:
    began = time.perf_counter()
    measured = measured_sets(damper_tests())
    skipped = "" if measured else absent("Skipped: the measured UTFSM tests are", damper_tests()) + "."
    fitting = Fitting(search=EfficientGA(), rng=options.seed, say=say)
    sets = (*synthetic_sets(seed=options.seed), *measured)
    outcomes = [study_set(tests, MODELS, fitting) for tests in sets]
    seconds = time.perf_counter() - began
    found = {outcome.tests.name: summary(outcome) for outcome in outcomes}
    report = options.out / "report.html"
    write_page(outcomes, report, skipped=skipped, footer=f"Seed {options.seed}, {seconds:.0f} s.")
    last = (skipped or "Synthetic and measured tests.", f"Report: {report}; {seconds:.0f} s.")
    return Findings(
        numbers={"seconds": seconds, "seed": options.seed, "skipped": skipped, "sets": found},
        judged=found,
        text=(*map(text_of, outcomes), *last),
    )


def _law(laws: Laws, outcome: SetOutcome) -> dict[str, Any]:
    return {
        "coefficients": laws.coefficients,
        "standard_errors": laws.errors,
        "rms_n": laws.rms_n.tolist(),
        "relative": outcome.tests.relative(laws.rms_n),
    }


if __name__ == "__main__":
    command = Command(__file__, __doc__, out=True, seed=(1, "of the searches and the synthetic noise"))
    sys.exit(command.run(find))
