"""`mrwork export`: a run for MATLAB, OpenSees or a rig, or as a table."""

from __future__ import annotations

import argparse
from typing import get_args

from mrwork.base.summary import list_names
from mrwork.cli.command_parser import OUTPUT, CommandParser, examples
from mrwork.cli.derived import add_option_of, add_options_of, arguments_of
from mrwork.cli.number_texts import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result
from mrwork.errors import SettingError
from mrwork.runs.wanted import Target, Wanted


def add_options(parser: CommandParser) -> None:
    """Declare the run, the format, the command and the accuracy of the exported damper, and the file."""
    parser.describe(
        "mat: parameters, laws, measured and simulated forces for MATLAB, and every array of a study or a tuning, "
        "with units. opensees: a Bouc-Wen damper at one command as materials of OpenSees, in Tcl, or for "
        "openseespy where FILE ends with .py. csv: of a fit the force over velocity and command, of a study or a "
        "tuning its criteria or scores. c: the damper of a fit, or the controller of a study file, in C99 for a "
        "rig or another simulation, in a folder after which it is named, with a program that checks it. fmu: the "
        "same as units of FMI 2.0 and 3.0. All in SI."
    )
    parser.epilog = examples(
        "mrwork export out/rig --target opensees --command 0.5A --error 0.01",
        "mrwork export out/damper --target c --out damper",
        "mrwork export study.toml --target c --law clipped_optimal --out controller",
    )
    parser.add_argument(
        "run_folder",
        type=named_path,
        metavar="RUN",
        help="folder of mrwork identify, respond or tune, or the file of a study whose controller is printed as C",
    )
    parser.option(
        "target",
        "--target --to",
        "mat, opensees, csv, c or fmu",
        metavar="TO",
        choices=get_args(Target),
        required=True,
    )
    add_option_of(parser, Wanted, "target", "command", metavar="COMMAND")
    add_option_of(parser, Wanted, "target", "error", metavar="SHARE")
    add_options_of(parser, Wanted, "target", "time_step", "law", "libm", "single", "example")
    file = "file to write, of c and fmu the folder; without it opensees and csv are printed"
    parser.option(OUTPUT, "--out --output", file, named_path, metavar="PATH", dest="output")
    parser.option(OUTPUT, "--replace", "replace files that are there", bool)
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Write the file, or print the text."""
    from mrwork.identification.fit import Fit
    from mrwork.runs.exported import export, exported, printed
    from mrwork.runs.load import read_run
    from mrwork.runs.printed import files_of, printed_in_words, write_files

    opened = None if options.run_folder.is_file() else read_run(options.run_folder)
    observation = opened.observation_in_words if isinstance(opened, Fit) else ""
    to = options.target
    document: dict[str, object] = {"run": str(options.run_folder), "to": to}
    document |= {"observation": observation} if observation else {}
    asked = arguments_of(options, Wanted)
    if to in ("mat", "c", "fmu") and options.output is None:
        raise SettingError(
            f"--target {to} writes what is no single text; give --out {'FILE' if to == 'mat' else 'DIR'}"
        )
    if to in ("c", "fmu"):
        source = printed(options.run_folder, Wanted(to=to, **asked), options.output)
        paths = write_files(options.output, files_of(source, to), replace=options.replace)
        document |= {"output": str(options.output), "files": [str(path) for path in paths]}
        document |= {"sample_time": source.sample_time, "substeps": source.substeps, "notes": source.notes}
        text = "\n".join(
            filter(
                None,
                (
                    f"Written: {list_names([str(path) for path in paths])}",
                    printed_in_words(source, to),
                    observation,
                ),
            )
        )
        print_result(options, document, text)
        return 0
    if options.output is not None:
        path = export(options.run_folder, to, options.output, replace=options.replace, **asked)
        text = "\n".join(filter(None, (f"Written: {path}", observation)))
        print_result(options, document | {"output": str(path)}, text)
        return 0
    text = exported(options.run_folder, Wanted(to=to, **asked), tcl=True).decode()
    print_result(options, document | {"text": text}, text.rstrip("\n"))
    return 0
