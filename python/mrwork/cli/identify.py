"""`mrwork identify`: from test records to an identified damper and its report."""

from __future__ import annotations

import argparse
import json
import os
import shlex
import sys
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from mrwork.cli.observe import add_observation, nuisances_of, observed
from mrwork.cli.options import add_files, add_json, parse_bounds, reading_of
from mrwork.cli.progress import ProgressLine
from mrwork.errors import JournalError, MrworkError, OutputError, SettingError
from mrwork.identification.fit import Fit
from mrwork.identification.identify import IdentificationInterrupted, identify
from mrwork.identification.judge import judge
from mrwork.identification.multistart import Multistart
from mrwork.identification.reading import Reading
from mrwork.identification.warm_start import start_from
from mrwork.journal import Journal
from mrwork.parameters import CommandUnit, LawName
from mrwork.records import DamperTest
from mrwork.report.reopen import READING
from mrwork.report.run_directory import check_destination, read_fit, write_run
from mrwork.report.unfinished import begin_journal, discard_journal, is_copy, resume_journal
from mrwork.search import EfficientGA
from mrwork.spec import DamperSpec, damper


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser(
        "identify",
        help="identify a damper model from test records",
        description="Identify one damper model from one or several tests of the same damper.",
    )
    add_files(parser)
    parser.add_argument("--model", default="normalised_bouc_wen", metavar="NAME", help="see mrwork models")
    parser.add_argument(
        "--bound", action="append", default=[], metavar="NAME=LOWER:UPPER", help="range of a parameter"
    )
    parser.add_argument(
        "--fix", action="append", default=[], metavar="NAME=VALUE", help="hold a parameter fixed"
    )
    parser.add_argument(
        "--law",
        action="append",
        default=[],
        metavar="NAME=LAW",
        help="let a parameter follow the command: linear, quadratic, cubic or exponential; repeat for more",
    )
    parser.add_argument(
        "--command-unit",
        choices=["A", "V"],
        help="what the laws take, default A where the tests have a current",
    )
    add_observation(parser)
    parser.add_argument(
        "--start",
        dest="starts",
        action="append",
        default=[],
        type=Path,
        metavar="RUN",
        help="descend also from an earlier fit of this model, or of one with some of its parameters; repeat for more",
    )
    parser.add_argument(
        "--power",
        type=float,
        default=2.0,
        metavar="P",
        help="make (mean NRMSE^P)^(1/P) over the files small: 2, the default, is the root mean square, "
        "more helps the worst file",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the search, default 0")
    parser.add_argument(
        "--search",
        choices=["multistart", "genetic"],
        help="how a plain model is searched: by descents from many starts (default), or by the efficient GA",
    )
    parser.add_argument("--population", type=int, metavar="N", help="chromosomes of a genetic search")
    parser.add_argument("--generations", type=int, metavar="N", help="most generations of a genetic search")
    parser.add_argument("--threads", type=int, default=0, metavar="N", help="threads, default all")
    parser.add_argument("--out", type=Path, metavar="DIR", help="run directory, default out/TEST-MODEL")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on with a run that was killed or interrupted; all else as it was begun, but for --threads",
    )
    parser.add_argument("--quiet", action="store_true", help="no progress")
    add_json(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Identify, write the run directory, say what came out."""
    plain = damper(options.model)
    bounds = parse_bounds(options.bound, options.fix)
    search = _search(options)
    if options.seed < 0 or options.threads < 0:
        raise SettingError(
            f"--seed is {options.seed} and --threads {options.threads}; neither can be negative"
        )
    reading = reading_of(options)
    tests = tuple(observed(test, options) for test in reading.tests())
    spec = _with_laws(plain, tests, options)
    place = options.out or Path("out") / f"{_stem(tests)}-{spec.name}"
    check_destination(place)
    journal = resume_journal(place, note=_note) if options.resume else begin_journal(place)
    line = ProgressLine(quiet=options.quiet or options.json)
    status = 0
    try:
        fit = identify(
            spec,
            tests,
            search=search,
            bounds=bounds,
            nuisances=nuisances_of(options),
            starts=[start_from(read_fit(run), spec) for run in options.starts],
            power=options.power,
            rng=options.seed,
            threads=options.threads,
            on_progress=line,
            journal=journal,
        )
    except IdentificationInterrupted as interrupt:
        fit, status = interrupt.fit, 130
    except MrworkError as error:
        # What cannot be identified at all is not worth going on with; another disk or another setting may be.
        hopeless = not options.resume and not isinstance(error, JournalError | OutputError)
        if hopeless or is_copy(place, journal):
            discard_journal(journal)
        raise
    finally:
        line.close()
        journal.close()
    if status == 0:
        # SciPy's optimisers are slow to load.
        from mrwork.uncertainty.identifiability import identifiability_of

        fit = replace(fit, identifiability=identifiability_of(fit, tests, threads=options.threads))
    fit = _with_command(fit, reading)
    _write(place, fit, tests, journal, with_figures=status == 0)
    discard_journal(journal)
    print(json.dumps(_summary(fit, place)) if options.json else _text(fit, tests, place))
    if status == 130:
        print(
            f"mrwork: interrupted; the best found so far is in {place}, the same with --resume goes on",
            file=sys.stderr,
        )
    return status


def _note(sentence: str) -> None:
    print(f"mrwork: {sentence}", file=sys.stderr)


def _with_laws(plain: DamperSpec, tests: tuple[DamperTest, ...], options: argparse.Namespace) -> DamperSpec:
    """The model with the laws that the command line gives."""
    if not options.law:
        return plain
    laws: dict[str, LawName] = {}
    for text in options.law:
        name, equals, law = text.partition("=")
        if not (name and equals):
            raise SettingError(f"--law is {text!r}; give NAME=LAW, as in k_w=quadratic")
        laws[name] = law
    in_amperes = any(test.current is not None for test in tests)
    unit: CommandUnit = options.command_unit or ("A" if in_amperes else "V")
    return plain.with_current_laws(laws, unit=unit)


def _search(options: argparse.Namespace) -> Multistart | EfficientGA | None:
    """What the command line asks for; `None` leaves it to the model."""
    genetic = options.population is not None or options.generations is not None
    if options.search == "multistart":
        if genetic or options.law:
            raise SettingError(
                "--search multistart takes neither --population, --generations nor --law; leave them or --search out"
            )
        return Multistart()
    if options.search is None and not genetic:
        return None
    search = EfficientGA()
    if options.population is not None:
        search = replace(search, population=options.population)
    if options.generations is not None:
        search = replace(search, stop=replace(search.stop, max_generations=options.generations))
    return search


def _stem(tests: tuple[DamperTest, ...]) -> str:
    first = tests[0].name.replace(" ", "_").replace(os.sep, "_")
    return first if len(tests) == 1 else f"{first}-and-{len(tests) - 1}-more"


def _with_command(fit: Fit, reading: Reading) -> Fit:
    """The fit with what was asked for, and how the tests were read, so that `reopen` can read them again."""
    asked = {"command": shlex.join(["mrwork", *sys.argv[1:]]), READING: reading.as_record()}
    return replace(fit, provenance=replace(fit.provenance, settings=fit.provenance.settings | asked))


def _write(
    place: Path, fit: Fit, tests: tuple[DamperTest, ...], journal: Journal, *, with_figures: bool
) -> None:
    """Write the run directory; an interrupted run is written at once, without the pictures that take time."""
    manifest = {"kind": "identification", "model": fit.model, "status": fit.status} | asdict(fit.provenance)
    if not with_figures:
        write_run(
            place, fit=fit, report_html=_INTERRUPTED, figures={}, manifest=manifest, journal=journal.path
        )
        return
    # Matplotlib is slow to load and needed for reports only.
    from mrwork.report.comparison import Comparison
    from mrwork.report.figures import run_figures
    from mrwork.report.html import identification_report

    spec = fit.spec
    theta = np.array(fit.theta)
    comparisons = [
        Comparison(
            test=test,
            model_force=judge(spec, theta, test, nuisances=fit.nuisances)[0],
            quality=quality,
        )
        for test, quality in zip(tests, fit.quality, strict=True)
    ]
    write_run(
        place,
        fit=fit,
        report_html=identification_report(
            fit, comparisons, model_title=spec.title, equation=spec.equation, source=spec.source
        ),
        figures=run_figures(fit, comparisons),
        manifest=manifest,
        journal=journal.path,
    )


_INTERRUPTED = (
    "<!doctype html><html lang=en><meta charset=utf-8><title>mrwork: interrupted</title>"
    "<p>This identification was interrupted. The best parameters found so far are in fit.json; "
    "run the same command with <code>--resume</code> to go on and for the full report.</p></html>\n"
)


def _summary(fit: Fit, place: Path) -> dict[str, Any]:
    return {
        "model": fit.model,
        "parameters": {
            estimate.name: {
                "value": estimate.value,
                "unit": estimate.unit,
                "standard_error": estimate.standard_error,
                "lower": estimate.lower,
                "upper": estimate.upper,
                "remark": estimate.remark,
            }
            for estimate in fit.estimates
        },
        "current_laws": None if fit.current is None else asdict(fit.current),
        "identifiability": None if fit.identifiability is None else asdict(fit.identifiability),
        "nuisances": fit.nuisances,
        "fit_percent": fit.fit_percent,
        "nrmse": fit.nrmse,
        "rmse_n": fit.rmse_n,
        "error_norms": asdict(fit.error_norms),
        "status": fit.status,
        "stop_reason": fit.stop_reason,
        "evaluations": fit.evaluations,
        "refinement_steps": fit.refinement_steps,
        "seconds": fit.seconds,
        "n_time": fit.n_time,
        "rng": fit.provenance.rng,
        "files": [asdict(quality) for quality in fit.quality],
        "out": str(place),
    }


def _text(fit: Fit, tests: tuple[DamperTest, ...], place: Path) -> str:
    status = fit.status.replace("_", " ")
    lines = [
        f"{damper(fit.model).title}, {status} after {fit.evaluations} simulations, {fit.seconds:.1f} s",
        "",
    ]
    width = max(7, *(len(estimate.name) for estimate in fit.estimates))
    units = max(6, *(len(estimate.unit) for estimate in fit.estimates))
    doubts = {
        each.name: f"{each.verdict} identifiable: {each.reason}"
        for each in (fit.identifiability.verdicts if fit.identifiability else ())
        if each.verdict != "identifiable"
    }
    for estimate in fit.estimates:
        error = "" if estimate.standard_error is None else f"+- {estimate.standard_error:.2g}"
        remark = estimate.remark or doubts.get(estimate.name, "")
        remark = f"({remark})" if remark else ""
        row = f"  {estimate.name:<{width}} {estimate.value:>12.6g}  {error:<12} {estimate.unit:<{units}} {remark}"
        lines.append(row.rstrip())
    lines.append("")
    if fit.identifiability is not None and fit.identifiability.directions:
        lines += [*(f"  - {each.sentence}" for each in fit.identifiability.directions), ""]
    for test, quality in zip(tests, fit.quality, strict=True):
        settle = f", first {quality.settle_seconds:.2g} s not compared" if quality.settle_seconds > 0 else ""
        recorded = ", ".join(filter(None, (quality.observation.in_words, quality.nuisance.in_words)))
        lines.append(
            f"  {test.path or test.name}: fit {quality.fit_percent:.2f} %, RMSE {quality.rmse_n:.4g} N "
            f"over {quality.n_time} samples{settle}{f'; the model force {recorded}' if recorded else ''}"
        )
        lines += [f"    {finding.severity}: {finding.message}" for finding in test.findings]
    lines += ["", f"Report: {place / 'report.html'}"]
    return "\n".join(lines)
