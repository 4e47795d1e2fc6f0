"""The command line: one module per verb, each with `add_parser` and `run`.

Exit status: 0 done, 2 bad input (one line on stderr), 130 interrupted (what was finished is kept).
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from mrwork import __version__
from mrwork.errors import MrworkError

_VERBS = {
    "models": "list the damper models, or show one in full",
    "check": "print what is found in test records, without fitting",
    "identify": "identify a damper model from test records",
    "profile": "say which parameters of a stored fit the data settle, with intervals",
    "sample": "sample the posterior of an identified damper",
    "calibrate": "calibrate a run's prediction bands on tests that its fit has not seen",
    "predict": "run a stored fit on other tests",
    "plan": "say which test narrows a band of a stored fit most",
    "respond": "simulate a building with MR dampers under earthquakes",
    "convert": "convert Bouc-Wen parameters between conventions",
}


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, without repeating the usage."""

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")


def parser(arguments: Sequence[str] = ()) -> argparse.ArgumentParser:
    """The command line: in full for the first verb among `arguments`, of the others the name and what they do.

    A verb may want libraries that take a second to load; neither the others nor the help wait for them.
    """
    wanted = next((each for each in arguments if each in _VERBS), "")
    root = _Parser(
        prog="mrwork",
        description="Identify magnetorheological dampers from test records.",
        epilog="mrwork VERB --help says more of each.",
    )
    root.add_argument("--version", action="version", version=f"mrwork {__version__}")
    verbs = root.add_subparsers(title="verbs", metavar="VERB", required=True, parser_class=_Parser)
    for verb, purpose in _VERBS.items():
        if verb == wanted:
            import_module(f"mrwork.cli.{verb}").add_parser(verbs)
        else:
            verbs.add_parser(verb, help=purpose)
    return root


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run a command line and leave the process with its exit status."""
    arguments = sys.argv[1:] if arguments is None else arguments
    try:
        # Inside, for the modules of a verb take a moment to load, and Ctrl-C may come then.
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
        # Whoever reads our output has read enough; the interpreter must not complain at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = 0
    if status == 130:
        # A refinement may still be inside compiled code that knows no interrupt; nothing is left to be written.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(status)
    sys.exit(status)
