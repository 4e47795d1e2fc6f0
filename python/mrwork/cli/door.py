"""The door of the command line: from its words to the exit status, with one sentence for whatever goes wrong."""

from __future__ import annotations

import argparse
import logging
import warnings
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import TextIO

from mrwork.cli.command_parser import CommandParser, VerbHelp
from mrwork.cli.former_words import in_words_of_today
from mrwork.cli.signals import StopSignals
from mrwork.cli.terminal import note, show, show_all
from mrwork.errors import MistakesError, MrworkError, MrworkWarning, reason_of

_VERBS = {
    "init": "write a sample to begin with: tests of a rig, or a study of a building, a car or a tower in wind",
    "models": "list the damper models, show one in full, or convert parameters of Bouc-Wen",
    "check": "check test records, or the building of a study, without fitting or simulating",
    "characterise": "go from a folder of test records to a damper and its page",
    "identify": "identify a damper model, and laws of its command, from test records",
    "intervals": "compute intervals of the parameters of a fit, by profile likelihood or by draws",
    "calibrate": "calibrate prediction bands of a fit on tests that were not used for it",
    "predict": "simulate other tests with a fit and compare the force",
    "plan": "rank possible next tests by the variance reduction of a band",
    "respond": "simulate a building or a car with MR dampers under earthquakes, wind or on roads",
    "tune": "tune control laws on training motions and judge them on test motions, or size dampers",
    "fragility": "find the intensity at which the arrangements of a study reach a limit",
    "report": "draw the page of a run again, write its figures, or print what to cite",
    "export": "write a run for MATLAB or OpenSees, as a table, or as C or an FMU for a rig",
}


def verbs() -> tuple[str, ...]:
    """The verbs, in the order of the help."""
    return tuple(_VERBS)


def parser(declared: Collection[str] = ()) -> CommandParser:
    """Command line parser, with the options of these verbs only.

    A verb may need libraries that take a second to load, which should not delay the other verbs and the help.
    """
    root = CommandParser(
        prog="mrwork",
        description="Identify magnetorheological dampers from test records, and simulate buildings with them.",
        epilog="mrwork help VERB describes a verb, with its options and examples; mrwork help study lists the keys of "
        "a study file, mrwork help laws the control laws; mrwork alone shows where to begin.",
    )
    root.add_argument(
        "-V", "--version", action="store_true", help="show version and instruction sets, and exit"
    )
    root.add_argument("--completion", choices=_SHELLS, metavar="SHELL", help=_COMPLETION)
    root.set_defaults(run=_show_tour)
    commands = root.add_subparsers(title="verbs", metavar="VERB", parser_class=CommandParser)
    for verb, purpose in _VERBS.items():
        described = f"{purpose[0].upper()}{purpose[1:]}."
        command = commands.add_parser(verb, help=purpose, description=described, formatter_class=VerbHelp)
        if verb in declared:
            import_module(f"mrwork.cli.{verb}").add_options(command)
    return root


TOUR = """\
mrwork identifies models of magnetorheological dampers from
test records, simulates buildings and cars with them, tunes
their control laws, and prints both as C and FMUs.

Try in an empty folder:
  mrwork identify synthetic:spencer1997 --out out/demo
  mrwork init rig rig
  mrwork characterise rig --out out/damper
  mrwork export out/damper --target c --out damper
  mrwork init study study.toml
  mrwork respond study.toml
  mrwork init car car
  mrwork respond car/car.toml

Runs write a page, report.html, and say where it lies.
mrwork --help lists all verbs, mrwork VERB --help has the
options of one with examples, mrwork models the damper models,
mrwork help study the keys of a study, mrwork help laws the
control laws. mrwork --completion SHELL completes commands."""
_SHELLS = ("bash", "zsh", "fish")
_COMPLETION = (
    "print the completion of commands for bash, zsh or fish, and exit. bash: write it to "
    "~/.local/share/bash-completion/completions/mrwork. zsh: to a file _mrwork in a folder of fpath. fish: to "
    "~/.config/fish/completions/mrwork.fish. It holds from the next shell on"
)


def _show_tour(options: argparse.Namespace) -> int:
    """Print where to begin, the version, or a completion: what a command line without a verb does."""
    text = TOUR
    if options.version:
        from mrwork import __version__
        from mrwork.dampers.simulation import instruction_set

        text = f"mrwork {__version__}\n{instruction_set()}"
    elif options.completion is not None:
        from mrwork.cli.completions import completion_script

        text = completion_script(parser(verbs()), options.completion)
    show(text)
    return 0


def _show_topic(topic: str) -> int:
    """Print the keys of a study file, or the control laws with their settings."""
    from mrwork.study.schema import laws_text, schema_text

    show(schema_text() if topic == "study" else laws_text())
    return 0


def status_of(arguments: Sequence[str], signals: StopSignals) -> int:
    """Run a command line; return its exit status."""
    try:
        with warnings_in_one_line():
            status = _run_command(arguments, signals)
            show_all()
    except KeyboardInterrupt as interrupt:
        # How to continue is told by what has kept something.
        note("; ".join(["interrupted", *getattr(interrupt, "__notes__", ())]))
        return signals.status
    except _SAID as error:
        note(*(str(error).split("\n") if isinstance(error, MistakesError) else [_sentence_on(error)]))
        return 2
    return signals.status if status == 130 else status


def _run_command(arguments: Sequence[str], signals: StopSignals) -> int:
    arguments = in_words_of_today(arguments)
    if list(arguments[:1]) == ["help"]:
        if list(arguments[1:]) in (["study"], ["laws"]):
            return _show_topic(arguments[1])
        arguments = [*arguments[1:], "--help"]
    try:
        verb = [argument for argument in arguments if argument in _VERBS][:1]
        options = parser(verb).parse_args(arguments)
        signals.interrupt()
        if not getattr(options, "changed", False):
            return int(options.run(options))
        from mrwork.store.run_folder import reading_changed

        with reading_changed():
            return int(options.run(options))
    except SystemExit as end:
        # The parser has printed its help, or what is wrong.
        return int(end.code or 0)


# What ends a command in a sentence. Any other error is a defect of mrwork, whose traceback is wanted.
_SAID = (MrworkError, OSError, MemoryError, ImportError)


def _sentence_on(error: BaseException) -> str:
    reason = reason_of(error)
    match error:
        case OSError() if not isinstance(error, MrworkError):
            where = f"{error.filename}: " if error.filename else ""
            what = error.strerror or (reason if error.args else "a file could not be read or written")
            return f"{where}{what}; check the path, its permissions and the free space"
        case MemoryError():
            return "there is not enough memory; give fewer or shorter records, or smaller sizes"
        case ImportError():
            return f"a library cannot be loaded ({reason}); install mrwork again"
    return reason


@contextmanager
def warnings_in_one_line() -> Iterator[None]:
    """Warnings of this package and of libraries as notes, in one line each."""

    def show(
        message: Warning | str,
        category: type[Warning],
        filename: str,
        lineno: int,
        file: TextIO | None = None,
        line: str | None = None,
    ) -> None:
        of_library = not issubclass(category, MrworkWarning)
        note(f"warning: {f'a library reports {category.__name__}: ' if of_library else ''}{message}")

    last_resort = logging.lastResort
    logging.lastResort = _Noted(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", MrworkWarning)
            # A number that overflows is told by what comes of it; whoever asks for these warnings has them (-W).
            warnings.simplefilter("ignore", RuntimeWarning, append=True)
            warnings.showwarning = show
            yield
    finally:
        logging.lastResort = last_resort


class _Noted(logging.Handler):
    def emit(self, record: logging.LogRecord) -> None:
        note(f"warning: a library reports: {record.getMessage()}")
