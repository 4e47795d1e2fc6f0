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
from mrwork.cli.signals import StopSignals
from mrwork.cli.terminal import note, show, show_all
from mrwork.errors import MistakesError, MrworkError, MrworkWarning, reason_of

_VERBS = {
    "demo": "identify a damper from an embedded synthetic test",
    "init": "write a sample: a rig's test records, or a study file",
    "models": "list the damper models, or show one in full",
    "check": "check test records without fitting",
    "characterise": "from a folder of test records to a damper and its page",
    "identify": "identify a damper model from test records",
    "profile": "compute intervals of the parameters of a fit by profile likelihood",
    "sample": "sample the posterior of the parameters of a fit",
    "calibrate": "calibrate prediction bands of a fit on tests that were not used for it",
    "predict": "simulate other tests with a fit and compare the force",
    "report": "draw the page of a run again, and its figures as files",
    "plan": "rank possible next tests by the variance reduction of a band",
    "respond": "simulate a building with MR dampers under earthquakes",
    "tune": "tune control laws on training motions and judge them on test motions",
    "fragility": "find the intensity at which the arrangements of a study reach a limit",
    "convert": "convert Bouc-Wen parameters between conventions",
    "export": "write a run for MATLAB or OpenSees, or as a table",
    "cite": "print what to cite for a run, as BibTeX",
    "completion": "print the completion of commands for a shell",
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
        epilog="mrwork help VERB describes a verb, with its options and examples; mrwork alone shows where to begin.",
    )
    root.add_argument(
        "-V", "--version", action="store_true", help="show version and instruction sets, and exit"
    )
    root.set_defaults(run=_show_tour)
    commands = root.add_subparsers(title="verbs", metavar="VERB", parser_class=CommandParser)
    for verb, purpose in _VERBS.items():
        command = commands.add_parser(verb, help=purpose, formatter_class=VerbHelp)
        if verb in declared:
            import_module(f"mrwork.cli.{verb}").add_options(command)
    return root


TOUR = """\
mrwork identifies models of magnetorheological dampers from
test records, and simulates buildings with such dampers.

Try in an empty folder:
  mrwork demo
  mrwork init rig rig
  mrwork characterise rig --out out/damper
  mrwork identify rig --law k_w=quadratic --law c=linear --out out/rig
  mrwork init study study.toml
  mrwork respond study.toml

Each writes a page, report.html, and says where it lies.
mrwork --help lists all verbs, mrwork VERB --help has the
options of one with examples, mrwork models the damper models.
mrwork completion SHELL completes commands in bash, zsh, fish."""


def _show_tour(options: argparse.Namespace) -> int:
    """Print where to begin, or the version and the vector instructions: what a command line without a verb does."""
    text = TOUR
    if options.version:
        from mrwork import __version__
        from mrwork.dampers.simulation import instruction_set

        text = f"mrwork {__version__}\n{instruction_set()}"
    show(text)
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
    if list(arguments[:1]) == ["help"]:
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
