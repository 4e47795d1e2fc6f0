"""The command line: one module per verb, each with `add_parser` and `run`.

Exit status: 0 done, 2 bad input (one line on stderr), 130 interrupted (what was finished is kept).
"""

from __future__ import annotations

import argparse
import os
import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any, NoReturn

from mrwork import __version__
from mrwork.errors import MrworkError, MrworkWarning

_VERBS = {
    "models": "list the damper models, or show one in full",
    "check": "check test records without fitting",
    "identify": "identify a damper model from test records",
    "profile": "compute intervals of the parameters of a fit by profile likelihood",
    "sample": "sample the posterior of the parameters of a fit",
    "calibrate": "calibrate prediction bands of a fit on tests that were not used for it",
    "predict": "simulate other tests with a fit and compare the force",
    "report": "draw the page of a run again, and its figures as files",
    "plan": "rank possible next tests by the variance reduction of a band",
    "respond": "simulate a building with MR dampers under earthquakes",
    "tune": "tune control laws on training motions and judge them on test motions",
    "convert": "convert Bouc-Wen parameters between conventions",
}


class _Parser(argparse.ArgumentParser):
    """Reports a wrong command line in one line, without the usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def parser(arguments: Sequence[str] = ()) -> argparse.ArgumentParser:
    """Command line parser, with the options of the first verb among `arguments` only.

    A verb may need libraries that take a second to load, which should not delay the other verbs and the help.
    """
    requested = next((each for each in arguments if each in _VERBS), "")
    root = _Parser(
        prog="mrwork",
        description="Identify magnetorheological dampers from test records.",
        epilog="mrwork VERB --help describes a verb and its options.",
    )
    root.add_argument("--version", action="version", version=f"mrwork {__version__}")
    verbs = root.add_subparsers(title="verbs", metavar="VERB", required=True, parser_class=_Parser)
    for verb, purpose in _VERBS.items():
        if verb == requested:
            import_module(f"mrwork.cli.{verb}").add_parser(verbs)
        else:
            verbs.add_parser(verb, help=purpose)
    return root


def _shown_in_one_line(shown_by_python: Callable[..., None]) -> Callable[..., None]:
    """How a command line shows warnings: those of this package in one line, as its errors."""

    def show(message: Warning | str, category: type[Warning], *place: Any) -> None:
        if issubclass(category, MrworkWarning):
            print(f"mrwork: warning: {message}", file=sys.stderr)
        else:
            shown_by_python(message, category, *place)

    return show


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command line and exit with its status."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", MrworkWarning)
            warnings.showwarning = _shown_in_one_line(warnings.showwarning)
            # Inside the block, because the modules of a verb take a moment to load and Ctrl-C may occur meanwhile.
            options = parser(arguments).parse_args(arguments)
            status = int(options.run(options))
        sys.stdout.flush()
    except MrworkError as error:
        print(f"mrwork: {error}", file=sys.stderr)
        status = 2
    except KeyboardInterrupt:
        print("mrwork: interrupted", file=sys.stderr)
        status = 130
    except BrokenPipeError:
        # The reader of the output has closed the pipe; the interpreter must not report that again at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 0
    if status == 130:
        # Another thread may still run compiled code that does not notice the interrupt; all files are written.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)
