"""One current-dependent model per family, identified jointly from the UTFSM sinusoids, and tried on tests left out.

python studies/one_model_for_a_rig/study.py [--family NAME ...] [--observed yes|no|both] [--leave-out]
                                               [--seed N] [--threads N] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import time
import tomllib
from argparse import Namespace
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from mrwork import identify
from mrwork.dampers import DamperSpec, LawName, damper
from mrwork.errors import SimulationError
from mrwork.identification import Fit, free_run, start_from
from mrwork.records import DamperTest
from mrwork.records import observed as with_observation
from mrwork.report import Table
from studies.former.command import Command, Findings, Say
from studies.former.records import absent, damper_tests
from studies.former.rig import sinusoids, thinned
from studies.former.table import table_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Family:
    """A model, the laws of its parameters, ranges narrower than it admits, and the power of the mean over tests.

    `after` names a family whose fit is one more start, completed by the values in `start`.
    """

    model: str
    laws: dict[str, LawName]
    bounds: dict[str, tuple[float, float]]
    power: float
    after: str | None
    start: dict[str, float]

    @property
    def spec(self) -> DamperSpec:
        return damper(self.model).with_current_laws(self.laws)


def families() -> dict[str, Family]:
    """The families of settings.toml."""
    table = tomllib.loads((Path(__file__).parent / "settings.toml").read_text(encoding="utf-8"))
    return {
        name: Family(
            model=entry["model"],
            laws=entry.get("laws", {}),
            bounds={key: (low, high) for key, (low, high) in entry.get("bounds", {}).items()},
            power=float(entry.get("power", 2.0)),
            after=entry.get("after"),
            start=entry.get("start", {}),
        )
        for name, entry in table.items()
    }


def fitted(name: str, tests: tuple[DamperTest, ...], *, seed: int, threads: int, say: Say) -> Fit:
    """Identify one family from these tests, after the family it starts from."""
    say(f"{name}, {len(tests)} tests")
    family = families()[name]
    starts = []
    if family.after is not None:
        simpler = fitted(family.after, tests, seed=seed, threads=threads, say=say)
        starts.append(start_from(simpler, family.spec) | family.start)
    return identify(
        family.spec,
        tests,
        bounds=family.bounds,
        observe="none",
        starts=starts,
        power=family.power,
        rng=seed,
        threads=threads,
    )


def _predicted(fit: Fit, test: DamperTest) -> float:
    """Fit % of a test, minus infinity where extrapolated laws make a damper that cannot be simulated."""
    try:
        return free_run(fit.spec, np.array(fit.theta), test)[1].fit_percent
    except SimulationError:
        return -np.inf


def left_out(
    name: str, tests: tuple[DamperTest, ...], *, seed: int, threads: int, say: Say
) -> Iterator[dict[str, Any]]:
    """Identify without the tests at one current, or of one motion, from the start, and predict those in fit %."""
    for what, key in (
        ("one current", lambda test: test.current),
        ("one frequency", lambda test: test.frequency),
    ):
        predicted = []
        for value in sorted({key(test) for test in tests}):
            rest = tuple(thinned(test) for test in tests if key(test) != value)
            fit = fitted(name, rest, seed=seed, threads=threads, say=say)
            predicted += [_predicted(fit, test) for test in tests if key(test) == value]
        yield {"what": what, "median": float(np.median(predicted)), "worst": min(predicted)}


def row_of(name: str, options: Namespace, say: Say, *, observed: bool) -> dict[str, Any]:
    """Fit % of one family over all tests, with their authors' moving average if `observed`, and on tests left out."""
    tests = tuple(with_observation(test, ["detect" if observed else "none"]) for test in sinusoids())
    ways = {"seed": options.seed, "threads": options.threads, "say": say}
    begun = time.perf_counter()
    fit = fitted(name, tests, **ways)
    seconds = time.perf_counter() - begun
    worst = min(fit.quality, key=lambda quality: quality.fit_percent)
    return {
        "family": name,
        "observed": observed,
        "n_free": sum(estimate.remark != "fixed" for estimate in fit.estimates),
        "median": float(np.median([quality.fit_percent for quality in fit.quality])),
        "worst": worst.fit_percent,
        "worst_test": worst.test,
        "seconds": seconds,
        "status": fit.status,
        "parameters": dict(zip(fit.spec.names, fit.theta, strict=True)),
        "left_out": list(left_out(name, tests, **ways)) if options.leave_out else [],
    }


def table(rows: Iterable[dict[str, Any]]) -> Table:
    """A row for each family, with the tests left out where there are any."""

    def outside(row: dict[str, Any]) -> str:
        return ", ".join(
            "without {what} {median:.2f} {worst:.2f}".format_map(part) for part in row["left_out"]
        )

    return table_of(
        "",
        "family",
        ((row["family"], row) for row in rows),
        {
            "force": lambda row: "averaged" if row["observed"] else "",
            "n": "{n_free}",
            "median": "{median:.2f}",
            "worst": "{worst:.2f}",
            "worst test": "{worst_test}",
            "time": "{seconds:.1f} s",
            "left out": outside,
        },
    )


def find(options: Namespace, say: Say) -> Findings | int:
    if reason := absent("skipped: the records are", damper_tests()):
        print(reason)
        return 0
    averaged = {"yes": (True,), "no": (False,), "both": (False, True)}[options.observed]
    rows = [
        row_of(name, options, say, observed=observed)
        for name in options.family or families()
        for observed in averaged
    ]
    return Findings(numbers={"rows": rows}, text=table(rows).lines(), judged={}, agreement="")


if __name__ == "__main__":
    command = Command(__file__, __doc__, threads=True, seed=(0, "of the searches"))
    add = command.parser.add_argument
    add("--family", action="append", choices=list(families()), help="default: all of settings.toml")
    add("--observed", choices=["yes", "no", "both"], default="both")
    add("--leave-out", action="store_true")
    sys.exit(command.run(find))
