"""`mrwork identify`: identify a damper model from test records and write the report."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import Any, get_args

from mrwork.cli import choose
from mrwork.cli.choose import add_choice, is_choice
from mrwork.cli.identified import (
    close_run,
    destination_of,
    run_search,
    stem_of,
    summary_of,
    text_of,
    with_command,
    with_identifiability,
    write_identification,
)
from mrwork.cli.numbers import FORCE_EXPONENT, GENERATIONS, POPULATION, POWER, add_number
from mrwork.cli.options import (
    add_files,
    add_json,
    add_observation,
    add_out,
    add_quiet,
    add_seed,
    add_threads,
    command_unit,
    laws_are_chosen,
    laws_of,
    nuisances_of,
    observation_of,
    parse_bounds,
    reading_of,
    tests_of,
)
from mrwork.cli.paths import named_path
from mrwork.cli.progress import IdentificationInWords
from mrwork.cli.terminal import note
from mrwork.dampers.spec import DamperSpec, damper
from mrwork.errors import SettingError
from mrwork.identification.fit_file import read_fit
from mrwork.identification.identify import identify_with
from mrwork.identification.problem import start_from
from mrwork.identification.settings import (
    Engine,
    FitSettings,
    Search,
    has_generations,
    resized,
    search_named,
    searches,
)
from mrwork.records import DamperTest, observed
from mrwork.store.unfinished import discard_journal, run_journal
from mrwork.units import COMMAND_SCALES


def add_parser(verbs: Any) -> None:
    """Declare the verb."""
    parser = verbs.add_parser(
        "identify",
        description="Identify one damper model from one or several tests of the same damper.",
    )
    add_files(parser)
    parser.add_argument(
        "--model",
        default="normalised_bouc_wen",
        metavar="NAME",
        help="damper model, see mrwork models; all, or A,B,C, identifies several models and ranks them, or chooses "
        "among their laws with --law auto",
    )
    parser.add_argument(
        "--bound",
        action="append",
        default=[],
        metavar="NAME=LOWER:UPPER",
        help="range of a parameter; repeat for more",
    )
    parser.add_argument(
        "--fix",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="hold a parameter fixed; repeat for more",
    )
    parser.add_argument(
        "--law",
        action="append",
        default=[],
        metavar="NAME=LAW",
        help="let a parameter follow the command: linear, quadratic or cubic by two, three or four values at tested "
        "commands, values:0,0.3,1 by values at these, exponential; repeat for more; auto chooses the laws of all other "
        "parameters without bounds by the fit to tests left out",
    )
    parser.add_argument(
        "--command-unit",
        choices=[*COMMAND_SCALES],
        metavar="UNIT",
        help="unit of the command in the laws, where tests have several: A or V, or that of another scalar, as mm, %%, "
        "bar, psi, lb or degC; default A where the tests have a current",
    )
    parser.add_argument(
        "--driver-lag",
        action="store_true",
        help="let the command reach the coil through a first-order lag; its rate eta [1/s] is a parameter of the fit; "
        "for records of a set point that varies, rather than of the current itself; left out where the tests show none",
    )
    add_choice(parser)
    add_observation(parser)
    parser.add_argument(
        "--start",
        dest="starts",
        action="append",
        default=[],
        type=named_path,
        metavar="RUN",
        help="also start from an earlier fit of this model, or of a model with some of its parameters; repeat for more",
    )
    add_number(
        parser,
        "--power",
        POWER,
        "minimise (mean NRMSE^P)^(1/P) over the files: 2, the default, is the root mean square; a higher power gives "
        "more weight to the worst file",
        default=2.0,
        metavar="P",
    )
    add_number(
        parser,
        "--force-exponent",
        FORCE_EXPONENT,
        "assume that errors grow between files with their force to this power: 1, the default, gives all files the "
        "same weight, 0 compares errors in newtons",
        default=1.0,
        metavar="E",
    )
    add_seed(parser, "the search")
    parser.add_argument(
        "--search",
        choices=list(searches()),
        help="global search; default multistart (least squares from many starts), where every command varies genetic "
        "(the efficient genetic algorithm)",
    )
    parser.add_argument(
        "--engine",
        choices=get_args(Engine),
        default="lanes",
        help="engine of the final fit: lanes (default), or twin (JAX), which is slower and serves comparisons",
    )
    add_number(
        parser,
        "--population",
        POPULATION,
        "number of candidates in a generation; not for multistart",
        metavar="N",
    )
    add_number(
        parser,
        "--generations",
        GENERATIONS,
        "largest number of generations; not for multistart",
        metavar="N",
    )
    add_threads(parser)
    add_out(parser, "run folder, default out/TEST-MODEL")
    parser.add_argument(
        "--resume",
        action="store_true",
        help="resume a run that was killed or interrupted; all other options but --threads as in that run",
    )
    add_quiet(parser)
    add_json(parser)
    parser.set_defaults(run=run)


def settings_of(options: argparse.Namespace) -> FitSettings:
    """The settings that the command line gives; starts from earlier fits are added once the model is known."""
    return FitSettings(
        search=_search(options),
        bounds=parse_bounds(options.bound, options.fix),
        power=options.power,
        force_exponent=options.force_exponent,
        engine=options.engine,
        nuisances=nuisances_of(options),
        observe=observation_of(options),
        rng=options.seed,
    )


def run(options: argparse.Namespace) -> int:
    """Identify, write the run folder, print the result."""
    settings = settings_of(options)
    several = is_choice(options)
    if laws_are_chosen(options):
        return choose.run_choice_of_laws(options, settings, several=several)
    if several:
        if options.engine != "lanes":
            raise SettingError(
                f"--engine {options.engine} finishes one model; leave it out where models are compared"
            )
        return choose.run(options, settings)
    plain = damper(options.model)
    reading = reading_of(options, "fit")
    read = tests_of(reading, quiet=options.quiet or options.json)
    tests = tuple(observed(test, settings.observe) for test in read)
    spec = _with_laws(plain, tests, options)
    starts = tuple(start_from(read_fit(run), spec) for run in options.starts)
    folder = options.out or Path("out") / f"{stem_of(tests)}-{spec.name}"
    destination = destination_of(folder, options)
    with run_journal(destination, resume=options.resume, note=note) as journal:
        fit, status = run_search(
            lambda line: identify_with(
                spec,
                tests,
                replace(settings, starts=starts),
                threads=options.threads,
                on_progress=line,
                journal=journal,
            ),
            IdentificationInWords(),
            options,
            before="any candidate was simulated",
        )
        journal.finish()
        if fit is None:
            return status
        if status == 0:
            fit = with_identifiability(fit, tests, options)
        fit = with_command(fit, reading)
        written = write_identification(destination, fit, journal.path, finished=status == 0)
        if written:
            discard_journal(journal)
        return close_run(
            folder,
            fit,
            tests,
            status,
            options,
            text=text_of(fit, tests),
            kept="the best fit",
            written=written,
            document=summary_of(fit, tests, folder),
        )


def _with_laws(plain: DamperSpec, tests: tuple[DamperTest, ...], options: argparse.Namespace) -> DamperSpec:
    """The model with the current laws of the command line."""
    laws = laws_of(options)
    if not laws:
        return plain
    # SciPy's optimisers are slow to load, and not needed for a plain model.
    from mrwork.identification.level_search import spec_by_values, tested_commands

    spec = plain.with_current_laws(laws, unit=command_unit(tests, options), lagged=options.driver_lag)
    return spec_by_values(spec, tested_commands(spec, tests))


def _search(options: argparse.Namespace) -> Search | None:
    """The search of the command line; `None` for the default of the model."""
    sized = options.population is not None or options.generations is not None
    if options.search is None and not sized:
        return None
    search = search_named(options.search or "genetic")
    if sized and not has_generations(search):
        raise SettingError(
            "--search multistart takes neither --population nor --generations; leave them or --search out"
        )
    return resized(search, population=options.population, generations=options.generations)
