"""One current-dependent model per family, identified jointly from the UTFSM sinusoids, and tried on tests left out.

python studies/one_model_for_a_rig/study.py [--family NAME ...] [--observed yes|no|both] [--leave-out]
                                               [--seed N] [--threads N] [--json]
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2]))

import json
import time
import tomllib
from collections.abc import Callable
from dataclasses import asdict, dataclass

import numpy as np

from mrwork import identify
from mrwork.dampers import DamperSpec, LawName, damper
from mrwork.errors import SimulationError
from mrwork.identification import Fit, Progress, free_run, start_from
from mrwork.records import DamperTest
from mrwork.records import observed as with_observation
from studies.common.command import Command
from studies.common.records import absent, damper_tests
from studies.common.rig import sinusoids, thinned

HERE = Path(__file__).parent


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


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOutFit:
    """Fit % of tests that the descent did not see: which were left out, median and worst."""

    what: str
    median: float
    worst: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RigRow:
    """One family: fit % over all tests with what it took, and on tests left out."""

    family: str
    observed: bool
    n_free: int
    median: float
    worst: float
    worst_test: str
    seconds: float
    status: str
    parameters: dict[str, float]
    left_out: tuple[LeftOutFit, ...]


def families() -> dict[str, Family]:
    """The families of settings.toml."""
    with (HERE / "settings.toml").open("rb") as file:
        table = tomllib.load(file)
    result = {}
    for name, entry in table.items():
        bounds = {key: (float(low), float(high)) for key, (low, high) in entry.get("bounds", {}).items()}
        result[name] = Family(
            model=entry["model"],
            laws=entry.get("laws", {}),
            bounds=bounds,
            power=float(entry.get("power", 2.0)),
            after=entry.get("after"),
            start={key: float(value) for key, value in entry.get("start", {}).items()},
        )
    return result


def fitted(
    name: str,
    tests: tuple[DamperTest, ...],
    *,
    seed: int,
    threads: int,
    on_progress: Callable[[Progress], None] | None,
) -> Fit:
    """Identify one family from these tests, after the family it starts from."""
    family = families()[name]
    starts = []
    if family.after is not None:
        simpler = fitted(family.after, tests, seed=seed, threads=threads, on_progress=on_progress)
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
        on_progress=on_progress,
    )


def _predicted(fit: Fit, test: DamperTest) -> float:
    """Fit % of a test, minus infinity where extrapolated laws make a damper that cannot be simulated."""
    try:
        return free_run(fit.spec, np.array(fit.theta), test)[1].fit_percent
    except SimulationError:
        return -np.inf


def left_out(name: str, tests: tuple[DamperTest, ...], *, seed: int, threads: int) -> tuple[LeftOutFit, ...]:
    """Identify without the tests at one current, or of one motion, from the start, and predict those."""
    results = []
    for what, key in (
        ("one current", lambda test: test.current),
        ("one frequency", lambda test: test.frequency),
    ):
        predicted = []
        for value in sorted({key(test) for test in tests}):
            rest = tuple(thinned(test) for test in tests if key(test) != value)
            fit = fitted(name, rest, seed=seed, threads=threads, on_progress=None)
            predicted += [_predicted(fit, test) for test in tests if key(test) == value]
        results.append(LeftOutFit(what=what, median=float(np.median(predicted)), worst=min(predicted)))
    return tuple(results)


def run(name: str, *, observed: bool, leave_out: bool, seed: int, threads: int) -> RigRow:
    """Identify one family from all tests; if `observed`, with the moving average of their authors."""
    tests = tuple(with_observation(test, ["detect" if observed else "none"]) for test in sinusoids())
    begun = time.perf_counter()

    def show(progress: Progress) -> None:
        if sys.stderr.isatty():
            print(f"\r{name}: {progress.stage}, fit {progress.fit_percent:.2f} %   ", end="", file=sys.stderr)

    fit = fitted(name, tests, seed=seed, threads=threads, on_progress=show)
    seconds = time.perf_counter() - begun
    worst = min(fit.quality, key=lambda quality: quality.fit_percent)
    return RigRow(
        family=name,
        observed=observed,
        n_free=sum(estimate.remark != "fixed" for estimate in fit.estimates),
        median=float(np.median([quality.fit_percent for quality in fit.quality])),
        worst=worst.fit_percent,
        worst_test=worst.test,
        seconds=seconds,
        status=fit.status,
        parameters=dict(zip(fit.spec.names, fit.theta, strict=True)),
        left_out=left_out(name, tests, seed=seed, threads=threads) if leave_out else (),
    )


def line(row: RigRow) -> str:
    observed = "averaged" if row.observed else ""
    outside = "".join(f"   without {each.what} {each.median:6.2f} {each.worst:6.2f}" for each in row.left_out)
    return (
        f"{row.family:<28} {observed:<9} {row.n_free:>3} {row.median:7.2f} {row.worst:7.2f}  {row.worst_test:<16}"
        f"{row.seconds:7.1f} s{outside}"
    )


def main() -> int:
    parser = Command(__file__, __doc__, threads=True, seed=(0, "of the searches")).parser
    add = parser.add_argument
    add("--family", action="append", choices=list(families()), help="default: all of settings.toml")
    add("--observed", choices=["yes", "no", "both"], default="both")
    add("--leave-out", action="store_true")
    options = parser.parse_args()
    if reason := absent("skipped: the records are", damper_tests()):
        print(reason)
        return 0
    rows = []
    if not options.json:
        print(
            f"{'family':<28} {'force':<9} {'n':>3} {'median':>7} {'worst':>7}  {'worst test':<16}{'time':>9}"
        )
    for name in options.family or families():
        for observed in {"yes": (True,), "no": (False,), "both": (False, True)}[options.observed]:
            rows.append(
                run(
                    name,
                    observed=observed,
                    leave_out=options.leave_out,
                    seed=options.seed,
                    threads=options.threads,
                )
            )
            if not options.json:
                print(line(rows[-1]), flush=True)
    if options.json:
        print(json.dumps({"rows": [asdict(row) for row in rows]}))
    return 0


if __name__ == "__main__":
    sys.exit(main())
