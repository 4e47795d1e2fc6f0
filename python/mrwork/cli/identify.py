"""`mrwork identify`: identify one model, compare several, or choose current laws, and write the report."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict, fields, replace
from functools import partial
from typing import get_args

from mrwork.base.units import COMMAND_SCALES, CommandUnit
from mrwork.cli.command_parser import COMPUTATION, SEARCH, CommandParser, examples
from mrwork.cli.derived import Collect, add_option_of, add_options_of, arguments_of, read_entry
from mrwork.cli.identified import Identification
from mrwork.cli.numbers import finite_number, named_path
from mrwork.cli.options import add_out, add_repeated, add_threads, end_parser
from mrwork.cli.output import in_words
from mrwork.cli.own_models import is_own, own_model
from mrwork.cli.terminal import note
from mrwork.cli.tests import add_files, add_observation, command_unit, nuisances_of
from mrwork.cli.workers import add_workers, on_workers
from mrwork.dampers.laws import LawName
from mrwork.dampers.spec import ALL, DamperSpec, damper
from mrwork.errors import SettingError
from mrwork.identification.fit_file import others_content, read_fit
from mrwork.identification.identify import identify_with
from mrwork.identification.problem import start_from
from mrwork.identification.progress import IdentificationInWords
from mrwork.identification.settings import (
    FitSettings,
    Search,
    has_generations,
    resize_search,
    search_named,
    searches,
)
from mrwork.records import DamperTest
from mrwork.store.run_folder import FIT, LAWS, MODELS, NEAR_SETS, RANKING
from mrwork.store.run_writer import RunAtWork
from mrwork.uncertainty.bands.prediction import Fold

_AUTO = "auto"


def add_options(parser: CommandParser) -> None:
    """Declare the options."""
    parser.description = "Identify one damper model from one or several tests of the same damper."
    parser.epilog = examples(
        "mrwork identify rig --law k_w=quadratic --law c=linear --out out/rig",
        "mrwork identify synthetic:spencer1997 --model dahl,normalised_bouc_wen",
    )
    add_files(parser)
    model, laws = parser.group("model"), parser.group("current laws")
    model.add_argument(
        "--model",
        default="normalised_bouc_wen",
        metavar="NAME",
        help="damper model, see mrwork models; default normalised_bouc_wen; all, or A,B,C, identifies several models "
        "and ranks them, or chooses among their laws with --law auto; FILE.py:NAME, a damper of your own that "
        "mrwork.own_damper has made, runs this file as Python",
    )
    add_options_of(parser, FitSettings, "model", "bounds")
    add_option_of(parser, FitSettings, "model", "ties", metavar="NAME=EXPRESSION")
    model.add_argument(
        "--fix",
        dest="fixed",
        action=Collect,
        default={},
        type=partial(read_entry, finite_number, "VALUE"),
        metavar="NAME=VALUE",
        help="hold a parameter fixed; repeat for more",
    )
    laws.add_argument(
        "--law",
        action=Collect,
        default={},
        type=_law,
        metavar="NAME=LAW",
        help="let a parameter follow the command: linear, quadratic or cubic by two, three or four values at tested "
        "commands, values:0,0.3,1 by values at these, exponential; repeat for more; auto chooses the laws of all other "
        "parameters without bounds by the fit to tests left out",
    )
    laws.add_argument(
        "--command-unit",
        choices=[*COMMAND_SCALES],
        metavar="UNIT",
        help="unit of the command in the laws, where tests have several: A or V, or that of another scalar, as mm, %%, "
        "bar, psi, lb or degC; default A where the tests have a current",
    )
    laws.add_argument(
        "--driver-lag",
        action="store_true",
        help="let the command reach the coil through a first-order lag; its rate eta [1/s] is a parameter of the fit; "
        "for records of a set point that varies, rather than of the current itself; left out where the tests show none",
    )
    comparison = parser.group("comparison of models and laws")
    comparison.add_argument(
        "--leave-out",
        choices=get_args(Fold),
        help="with several models or --law auto: tests that are left out together and predicted: each test alone "
        "(default), all of one motion (default of --law auto from three motions on), or all at one command",
    )
    add_observation(parser)
    search = parser.group(SEARCH)
    add_repeated(
        search,
        "--start",
        "RUN",
        "also start from an earlier fit of this model, or of a model with some of its parameters; repeat for more",
        dest="starts",
        type=named_path,
    )
    elsewhere = ("bounds", "ties", "starts", "nuisances", "observe", "search", "rng")
    add_option_of(parser, FitSettings, SEARCH, "search", choices=searches(), metavar="NAME")
    add_options_of(
        parser,
        FitSettings,
        SEARCH,
        *(each.name for each in fields(FitSettings) if each.name not in elsewhere),
    )
    add_options_of(parser, resize_search, SEARCH, "population", "generations")
    add_options_of(parser, FitSettings, COMPUTATION, "rng")
    add_threads(parser)
    add_workers(parser, "the fits where several models are compared")
    add_out(parser, "run folder, default out/TEST-MODEL")
    end_parser(
        parser,
        run,
        resume="resume a run that was killed or interrupted; all other options as in that run, but "
        "--threads, --workers and --cluster",
    )


def _models_of(options: argparse.Namespace) -> list[str | DamperSpec]:
    """The models, or "all"; a damper of the user as its spec."""
    return [own_model(each) if is_own(each) else each for each in options.model.split(",")]


def _laws_are_chosen(options: argparse.Namespace) -> bool:
    """Whether --law auto is given."""
    return _AUTO in options.law


def _laws_of(options: argparse.Namespace) -> dict[str, LawName]:
    """Current law by name of parameter, of those that are given."""
    if options.driver_lag and not options.law:
        raise SettingError("--driver-lag is of the command, which no parameter follows; give --law NAME=LAW")
    if options.driver_lag and _laws_are_chosen(options):
        raise SettingError(
            "--law auto chooses laws from tests at constant commands, which show no lag; leave --driver-lag out, or "
            "give the laws"
        )
    return {name: law for name, law in options.law.items() if name != _AUTO}


def _law(text: str) -> tuple[str, LawName]:
    return (_AUTO, _AUTO) if text == _AUTO else read_entry(str, "LAW", text)


def settings_of(options: argparse.Namespace) -> FitSettings:
    """The settings that the command line gives; starts from earlier fits are added once the model is known."""
    fixed = {name: (value, value) for name, value in options.fixed.items()}
    own = {"search": _search(options), "bounds": options.bounds | fixed, "nuisances": nuisances_of(options)}
    return FitSettings(**arguments_of(options, FitSettings) | own)


def run(options: argparse.Namespace) -> int:
    """Identify, write the run folder, print the result."""
    settings = settings_of(options)
    several, law_is_auto = is_choice(options), _laws_are_chosen(options)
    if settings.ties and (several or law_is_auto):
        raise SettingError("--tie goes with one model and without --law auto; leave it out")
    needless = "the laws are chosen on the threads of this process" if law_is_auto else ""
    if not (several or law_is_auto):
        needless = "one model is fitted, on the threads of this process"
    with on_workers(options, needless=needless):
        if law_is_auto:
            if options.starts:
                raise SettingError("--law auto finds its own starts; leave --start out")
            ending = "models" if several else options.model.rpartition(":")[2]
            verb = Identification.of(options, settings, ending, kept="the best of what was fitted")
            return fit_best_laws(
                verb,
                _models_of(options),
                settings,
                laws=_laws_of(options),
                unit=command_unit(verb.tests, options.command_unit),
                leave_out=options.leave_out,
            )
        if several:
            if options.engine != "lanes":
                raise SettingError(
                    f"--engine {options.engine} finishes one model; leave it out where models are compared"
                )
            verb = Identification.of(options, settings, "models", kept="what was identified")
            return fit_best_model(
                verb,
                _models_of(options),
                settings,
                laws=_laws_of(options),
                unit=command_unit(verb.tests, options.command_unit),
                lagged=options.driver_lag,
                leave_out=options.leave_out or "test",
            )
        return _identify_model(options, settings)


def _identify_model(options: argparse.Namespace, settings: FitSettings) -> int:
    (model,) = _models_of(options)
    plain = damper(model) if isinstance(model, str) else model
    verb = Identification.of(options, settings, plain.name, kept="the best fit")
    spec = _with_laws(plain, verb.tests, options)
    starts = tuple(start_from(read_fit(run), spec) for run in options.starts)
    return fit_model(verb, spec, replace(settings, starts=starts))


def fit_model(verb: Identification, spec: DamperSpec, settings: FitSettings) -> int:
    """Fit one model to the tests of a verb into its run folder, and show it; return the exit status."""
    with RunAtWork(verb.frame.destination, note=note) as work:
        journal = work.journal()
        fit, status = verb.search(
            lambda line: identify_with(
                spec,
                verb.tests,
                settings,
                threads=verb.frame.options.threads,
                on_progress=line,
                journal=journal,
            ),
            IdentificationInWords(),
            before="any candidate was simulated",
        )
        journal.close()
        verb.frame.note_complete(work)
        return status if fit is None else verb.end(verb.with_command(fit), status, work=work)


def _with_laws(plain: DamperSpec, tests: tuple[DamperTest, ...], options: argparse.Namespace) -> DamperSpec:
    """The model with the current laws of the command line."""
    laws = _laws_of(options)
    if not laws:
        return plain
    # SciPy's optimisers are slow to load, and not needed for a plain model.
    from mrwork.identification.minimise.level_search import spec_by_values, tested_commands

    spec = plain.with_current_laws(
        laws, unit=command_unit(tests, options.command_unit), lagged=options.driver_lag
    )
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
    return resize_search(search, **arguments_of(options, resize_search))


def is_choice(options: argparse.Namespace) -> bool:
    """Whether the command line is for a comparison of models."""
    models = _models_of(options)
    several = models == [ALL] or len(models) > 1
    if not several and options.leave_out and not _laws_are_chosen(options):
        raise SettingError("--leave-out belongs to a comparison; give --model all, or A,B,C")
    if several and options.starts:
        raise SettingError("--start gives one model's parameters; leave it out where models are compared")
    return several


def fit_best_model(
    verb: Identification,
    models: Sequence[str | DamperSpec],
    settings: FitSettings,
    *,
    laws: Mapping[str, LawName] | None = None,
    unit: CommandUnit = "A",
    lagged: bool = False,
    leave_out: Fold = "test",
) -> int:
    """Fit and rank models; the run folder has the best, and the fits of all; return the exit status."""
    # SciPy's optimisers are slow to load.
    from mrwork.uncertainty.choice.choose import choose_model

    if (status := verb.end_complete(RANKING)) is not None:
        return status
    with RunAtWork(verb.frame.destination, note=note) as work:
        choice, status = verb.search(
            lambda line: choose_model(
                verb.tests,
                models,
                leave_out=leave_out,
                laws=laws,
                unit=unit,
                lagged=lagged,
                settings=settings,
                threads=verb.frame.options.threads,
                on_progress=line,
                journal_of=work.step_journal,
            ),
            in_words,
            before="any model was identified",
        )
        if choice is None:
            return status
        ranking, folder = choice.ranking, verb.frame.folder
        fits = {fit.model: verb.with_command(fit) for fit in choice.fits}
        paths = {name: f"{MODELS}/{name}/{FIT}" for name in fits}
        best = fits[ranking.chosen]
        return verb.end(
            best,
            status,
            work=work,
            grown=() if status == 0 else work.step_journals,
            results=(ranking, best) if status == 0 else (ranking,),
            document=asdict(ranking) | {"fits": {name: str(folder / path) for name, path in paths.items()}},
            documents={
                **{paths[name]: fit.as_dict() for name, fit in fits.items()},
                RANKING: asdict(ranking),
            },
        )


def fit_best_laws(
    verb: Identification,
    models: Sequence[str | DamperSpec],
    settings: FitSettings,
    *,
    laws: Mapping[str, LawName] | None = None,
    unit: CommandUnit = "A",
    leave_out: Fold | None = None,
) -> int:
    """Choose the laws of one or several models; the run folder has their fit; return the exit status."""
    # SciPy's optimisers are slow to load.
    from mrwork.uncertainty.choice.laws import choose_laws

    if (status := verb.end_complete(LAWS)) is not None:
        return status
    with RunAtWork(verb.frame.destination, note=note) as work:
        choice, status = verb.search(
            lambda line: choose_laws(
                models,
                verb.tests,
                laws=laws,
                unit=unit,
                leave_out=leave_out,
                settings=settings,
                threads=verb.frame.options.threads,
                on_progress=line,
                journal_of=work.step_journal,
            ),
            in_words,
            before="any laws were fitted",
        )
        if choice is None:
            return status
        table, fit = choice.table, verb.with_command(replace(choice.fit, seconds=choice.seconds))
        if choice.others and not verb.frame.is_quiet:
            note(
                f"{len(choice.others)} other sets of laws predict nearly as well, within 1 point; predict and respond "
                "say how far they are apart where the tests end"
            )
        return verb.end(
            fit,
            status,
            work=work,
            grown=() if status == 0 else work.step_journals,
            results=(table, fit),
            document=fit.document() | {"choice_of_laws": asdict(table)},
            documents={LAWS: asdict(table)}
            | ({NEAR_SETS: others_content(choice.others)} if choice.others else {}),
        )
