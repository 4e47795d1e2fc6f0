"""`mrwork demo`: the identification of an embedded synthetic test, with nothing to prepare."""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from mrwork.cli.command_parser import COMPUTATION, CommandParser, examples
from mrwork.cli.derived import add_option_of
from mrwork.cli.options import add_threads, end_parser
from mrwork.cli.terminal import show
from mrwork.dampers.spec import damper
from mrwork.identification.settings import FitSettings

_FILE, _MODEL = "synthetic:spencer1997", "normalised_bouc_wen"
_OTHER = "synthetic:spencer1997_slow"
_SEED = 1
_OUT = Path("out") / "demo"


def add_options(parser: CommandParser) -> None:
    """Declare the seed, the threads and the run folder of the demonstration."""
    parser.description = (
        f"Identify the model {_MODEL} from the embedded test {_FILE}: simulated with published parameters and sensor "
        "noise, no measurement. It takes a few seconds and no file."
    )
    parser.epilog = examples("mrwork demo", "mrwork demo --seed 2 --out out/seed2 --quiet")
    add_option_of(parser, FitSettings, COMPUTATION, "rng", default=_SEED)
    add_threads(parser)
    end_parser(
        parser,
        run,
        out=f"run folder, default {_OUT}",
        resume="resume a demo that was killed or interrupted; all other options but --threads as in that demo",
    )
    parser.set_defaults(out=_OUT)


def run(options: argparse.Namespace) -> int:
    """Identify, and say how `mrwork identify` does the same."""
    from mrwork.cli.identified import Identification
    from mrwork.records.reading import Reading

    settings, reading = FitSettings(rng=options.rng), Reading(files=(_FILE,), folder=str(Path.cwd()))
    verb = Identification.of_tests(
        options, settings, reading, reading.tests(), _OUT.name, kept="the best fit"
    )
    status = verb.fit(damper(_MODEL), settings)
    if status == 0 and not options.json:
        same = ["identify", _FILE, "--model", _MODEL, "--seed", str(options.rng), "--out", str(options.out)]
        other = ["predict", str(options.out), _OTHER]
        show(f"\nThe same: {shlex.join(['mrwork', *same])}\nNext:     {shlex.join(['mrwork', *other])}")
    return status
