"""`mrwork identify`: identify one model, compare several, or choose current laws, and write the report."""

from __future__ import annotations

import argparse
from dataclasses import fields, replace
from functools import partial

from mrwork.cli.command_parser import COMPUTATION, SEARCH, CommandParser, examples
from mrwork.cli.derived import add_option_of, add_options_of, arguments_of, read_entry
from mrwork.cli.number_texts import finite_number, named_path
from mrwork.cli.options import add_threads, end_parser, on_workers
from mrwork.cli.own_models import is_own, own_model
from mrwork.cli.tests import add_files, add_observation, command_unit
from mrwork.dampers.dependence import LawName
from mrwork.dampers.spec import ALL, DEFAULT_MODELS, SCREENED, DamperSpec, damper
from mrwork.errors import SettingError
from mrwork.identification.settings import (
    FitSettings,
    Lagged,
    LawUnit,
    LeaveOut,
    Race,
    Search,
    resize_search,
    search_named,
    searches,
)

_AUTO, _LAWS = "auto", "current laws"


def add_options(parser: CommandParser) -> None:
    """Declare the records, the model with its laws, bounds and ties, and the search of the fit."""
    parser.describe("The tests are of one damper.")
    parser.epilog = examples(
        "mrwork identify rig --law k_w=quadratic --law c=linear --out out/rig",
        "mrwork identify synthetic:spencer1997 --model dahl,normalised_bouc_wen",
    )
    add_files(parser)
    parser.option(
        "model",
        "--model",
        f"damper model, see mrwork models; default {DEFAULT_MODELS[0]}, with --law auto those that predict a few of "
        "the tests best, of all; all, or A,B,C, identifies several models and ranks them, or chooses among their laws "
        "with --law auto; FILE.py:NAME, a damper of your own that mrwork.own_damper has made, runs this file as Python",
        metavar="NAME",
    )
    add_options_of(parser, FitSettings, "model", "bounds")
    add_option_of(parser, FitSettings, "model", "ties", metavar="NAME=EXPRESSION")
    parser.option(
        "model",
        "--fix",
        "hold a parameter fixed",
        partial(read_entry, finite_number, "VALUE"),
        metavar="NAME=VALUE",
        default={},
        dest="fixed",
        repeated=True,
    )
    parser.option(
        _LAWS,
        "--law",
        "let a parameter follow the command: linear, quadratic or cubic by two, three or four values at tested "
        "commands, or at given ones, quadratic:0,0.3,1; log_linear, log_quadratic, log_cubic through the logarithms; "
        "monotone, or monotone:0,0.3,1, by cubics that are monotone where the values are; straight:0,0.3,1 or "
        "straight_log:0,0.3,1 with straight lines; tanh, tanh:0,1 or exponential:0,1 by two values and the rate at "
        "which it saturates; exponential by coefficients; "
        "auto chooses the laws of all other parameters without bounds by the fit to tests left out",
        _law,
        metavar="NAME=LAW",
        default={},
        repeated=True,
    )
    usual = "default A where the tests have a current"
    add_option_of(parser, LawUnit, _LAWS, "command_unit", metavar="UNIT", more=usual)
    add_option_of(parser, Lagged, _LAWS, "driver_lag")
    add_option_of(parser, LeaveOut, "comparison of models and laws", "leave_out")
    add_observation(parser)
    parser.option(
        SEARCH,
        "--start",
        "also start from an earlier fit of this model, or of a model with some of its parameters",
        named_path,
        metavar="RUN",
        default=(),
        dest="starts",
        repeated=True,
    )
    elsewhere = ("bounds", "ties", "starts", "observe", "search", "rng")
    add_option_of(parser, FitSettings, SEARCH, "search", choices=searches(), metavar="NAME")
    add_options_of(
        parser,
        FitSettings,
        SEARCH,
        *(entry.name for entry in fields(FitSettings) if entry.name not in elsewhere),
    )
    add_options_of(parser, resize_search, SEARCH, "population", "generations")
    add_options_of(parser, FitSettings, COMPUTATION, "rng")
    add_threads(parser, "the fits where several models are compared")
    end_parser(
        parser,
        run,
        out="run folder, default out/TEST-MODEL",
        resume="resume a run that was killed or interrupted; all other options as in that run, but "
        "--threads, --workers and --cluster",
    )


def _law(text: str) -> tuple[str, LawName]:
    return (_AUTO, _AUTO) if text == _AUTO else read_entry(str, "LAW", text)


def run(options: argparse.Namespace) -> int:
    """Identify, write the run folder, print the result."""
    law_is_auto = _AUTO in options.law
    # A damper of the user as its spec.
    models = [
        own_model(part) if is_own(part) else part for part in (options.model or DEFAULT_MODELS[0]).split(",")
    ]
    several = models == [ALL] or len(models) > 1
    fixed = {name: (value, value) for name, value in options.fixed.items()}
    extra = {"search": _search(options), "bounds": options.bounds | fixed}
    # Starts from earlier fits are added once the model is known.
    settings = FitSettings(**arguments_of(options, FitSettings) | extra)
    _refuse_together(options, settings, several=several, law_is_auto=law_is_auto)
    needless = "the laws are chosen on the threads of this process" if law_is_auto else ""
    if not (several or law_is_auto):
        needless = "one model is fitted, on the threads of this process"
    with on_workers(options, needless=needless):
        if several or law_is_auto:
            return _choose(options, models, settings, several=several)
        return _identify_model(options, models[0], settings)


def _search(options: argparse.Namespace) -> Search | None:
    """The search of the command line; `None` for the default of the model."""
    sized = options.population is not None or options.generations is not None
    if options.search is None and not sized:
        return None
    search = search_named(options.search or "genetic")
    if sized and isinstance(search, Race):
        raise SettingError(
            "--search race takes neither --population nor --generations; leave them or --search out"
        )
    return resize_search(search, **arguments_of(options, resize_search))


def _refuse_together(
    options: argparse.Namespace, settings: FitSettings, *, several: bool, law_is_auto: bool
) -> None:
    compares = several or law_is_auto
    mistakes = {
        "--tie goes with one model and without --law auto; leave it out": settings.ties and compares,
        "--leave-out belongs to a comparison; give --model all, or A,B,C": options.leave_out and not compares,
        "--start gives one model's parameters; leave it out where models are compared": several
        and options.starts,
        "--law auto finds its own starts; leave --start out": law_is_auto and options.starts,
        f"--engine {options.engine} finishes one model; leave it out where models are compared": (
            several and not law_is_auto and options.engine != "lanes"
        ),
        "--driver-lag is of the command, which no parameter follows; give --law NAME=LAW": (
            options.driver_lag and not options.law
        ),
    }
    for sentence, is_made in mistakes.items():
        if is_made:
            raise SettingError(sentence)


def _choose(
    options: argparse.Namespace, models: list[str | DamperSpec], settings: FitSettings, *, several: bool
) -> int:
    from mrwork.cli.identified import Identification
    from mrwork.uncertainty.choice.choose import choose_model
    from mrwork.uncertainty.choice.choose_laws import choose_laws

    ending = options.model.rpartition(":")[2] if options.model and not several else "models"
    verb = Identification.of_files(options, settings, ending, kept="the best of what was fitted")
    laws = {name: law for name, law in options.law.items() if name != _AUTO}
    kwargs = {
        "laws": laws,
        "unit": command_unit(verb.tests, options.command_unit),
        "lagged": options.driver_lag,
        "leave_out": options.leave_out,
        "settings": settings,
    }
    if _AUTO in options.law:
        # Laws and bounds are of parameters of the default model.
        among = models if options.model or laws or settings.bounds else SCREENED
        return verb.choose(partial(choose_laws, among, **kwargs))
    return verb.choose(partial(choose_model, models=models, **kwargs))


def _identify_model(options: argparse.Namespace, model: str | DamperSpec, settings: FitSettings) -> int:
    from mrwork.cli.identified import Identification
    from mrwork.identification.commands import with_dependences_at
    from mrwork.identification.fit_file import read_fit
    from mrwork.identification.problem import start_from

    spec = damper(model) if isinstance(model, str) else model
    verb = Identification.of_files(options, settings, spec.name, kept="the best fit")
    if options.law:
        unit = command_unit(verb.tests, options.command_unit)
        spec = spec.with_current_laws({}, unit=unit, lag="one_rate" if options.driver_lag else "none")
        spec = with_dependences_at(spec, options.law, verb.tests)
    starts = tuple(start_from(read_fit(run), spec) for run in options.starts)
    screens = options.model is None and len(verb.tests) == 1 and not (options.law or settings.bounds)
    return verb.fit(spec, replace(settings, starts=starts), screens=screens)
