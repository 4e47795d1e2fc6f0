"""`mrwork export`: a run as a file for MATLAB or OpenSees, or as a table."""

from __future__ import annotations

import argparse

from mrwork.base.hints import node_of
from mrwork.cli.command_parser import OUTPUT, CommandParser, examples
from mrwork.cli.numbers import Range, named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result
from mrwork.cli.own_models import add_trust
from mrwork.dampers.conventions import OpenSeesError, OpenSeesTimeStep
from mrwork.errors import SettingError

_TARGETS = ("mat", "opensees", "csv")


def add_options(parser: CommandParser) -> None:
    """Declare the run, the format, the command and the accuracy of the exported damper, and the file."""
    parser.description = (
        "Write a run for another program, in SI. mat: parameters, laws, measured and simulated forces for MATLAB, "
        "and every array of a study or a tuning, with units. opensees: a Bouc-Wen damper at one command as "
        "materials of OpenSees, in Tcl, or for openseespy where FILE ends with .py. csv: of a fit the force over "
        "velocity and command, of a study or a tuning its criteria or scores."
    )
    parser.epilog = examples(
        "mrwork export out/rig --to mat --output rig.mat",
        "mrwork export out/rig --to opensees --command 0.5A --error 0.01",
    )
    parser.add_argument(
        "run_folder", type=named_path, metavar="RUN", help="folder of mrwork identify, respond or tune"
    )
    parser.option("target", "--to", "mat, opensees or csv", metavar="TO", choices=_TARGETS, required=True)
    command = "command at which the damper is exported, as in 0.5A; csv: default five over the tested ones"
    parser.option("target", "--command", command, metavar="COMMAND")
    error = "wanted error of BoucWen in OpenSees, a share of the largest force of the loop; default 0.005"
    parser.option("target", "--error", error, Range.of(node_of(OpenSeesError)), metavar="SHARE")
    time_step = "step of the analysis in OpenSees, of which the sub-steps are told; default 0.001"
    parser.option("target", "--time-step", time_step, Range.of(node_of(OpenSeesTimeStep)), metavar="S")
    file = "file to write; without it opensees and csv are printed"
    parser.option(OUTPUT, "--output", file, named_path, metavar="FILE")
    parser.option(OUTPUT, "--replace", "replace a file that is there", bool)
    add_trust(parser)
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Write the file, or print the text."""
    from mrwork.identification.fit import Fit
    from mrwork.runs.export import export, exported
    from mrwork.runs.load import read_run

    opened = read_run(options.run_folder)
    observation = opened.observation_in_words if isinstance(opened, Fit) else ""
    document = {"run": str(options.run_folder), "to": options.to}
    document |= {"observation": observation} if observation else {}
    wanted = {name: getattr(options, name) for name in ("command", "error", "time_step")}
    if options.output is not None:
        path = export(options.run_folder, options.to, options.output, replace=options.replace, **wanted)
        text = "\n".join(filter(None, (f"Written: {path}", observation)))
        print_result(options, document | {"output": str(path)}, text)
        return 0
    if options.to == "mat":
        raise SettingError("--to mat writes a file that is no text; give --output FILE")
    text = exported(options.run_folder, options.to, tcl=True, **wanted).decode()
    print_result(options, document | {"text": text}, text.rstrip("\n"))
    return 0
