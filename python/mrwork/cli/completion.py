"""`mrwork completion`: what a shell needs to complete verbs, options, names, files and folders."""

from __future__ import annotations

import argparse

from mrwork.cli.command_parser import CommandParser, examples
from mrwork.cli.numbers import named_path
from mrwork.cli.options import end_parser
from mrwork.cli.output import print_result

_SHELLS = ("bash", "zsh", "fish")
# What a path of this name is: a folder.
_FOLDERS = ("RUN", "DIR")


def add_options(parser: CommandParser) -> None:
    """Declare the shell that the script is for."""
    parser.description = (
        "Print the completion of mrwork for a shell. bash: write it to "
        "~/.local/share/bash-completion/completions/mrwork. zsh: to a file _mrwork in a folder of fpath. fish: to "
        "~/.config/fish/completions/mrwork.fish. It holds from the next shell on."
    )
    parser.epilog = examples("mrwork completion bash", "mrwork completion fish")
    parser.add_argument("shell", choices=_SHELLS, metavar="SHELL", help=f"one of {', '.join(_SHELLS)}")
    end_parser(parser, run, quiet="")


def run(options: argparse.Namespace) -> int:
    """Print the script of the shell, which also completes names of models, laws and files."""
    # Only this verb needs it.
    import shtab

    from mrwork.cli.door import parser, verbs

    whole, offered = parser(verbs()), _offered_names()
    for verb, subparser in subcommands(whole).items():
        for action in subparser._actions:
            name = (action.option_strings or [action.dest])[0]
            if (verb, name) in offered:
                action.choices = offered[verb, name]
            elif action.type is named_path or name == "files":
                is_folder = action.metavar in _FOLDERS
                action.complete = shtab.DIRECTORY if is_folder else shtab.FILE  # type: ignore[attr-defined] # read by shtab
    script = shtab.complete(whole, shell=options.shell)
    print_result(options, {"shell": options.shell, "script": script}, script)
    return 0


def subcommands(parser: CommandParser) -> dict[str, CommandParser]:
    """The parser of each verb, by its name."""
    (verbs,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return dict(verbs.choices)


def _offered_names() -> dict[tuple[str, str], list[str]]:
    """Names for arguments that take more than names, by verb and argument."""
    from mrwork.control.laws.control_law import control_laws
    from mrwork.dampers.laws import LAWS_AT_COMMANDS, named_laws
    from mrwork.dampers.spec import ALL, damper_models
    from mrwork.records.repairs import REPAIR_KINDS
    from mrwork.uncertainty.noise import NOISES

    models = [spec.name for spec in damper_models()]
    parameters = dict.fromkeys(name for spec in damper_models() for name in spec.names)
    laws = [f"{name}={law}" for name in parameters for law in (*named_laws(), *LAWS_AT_COMMANDS)]
    return {
        ("models", "name"): models,
        ("identify", "--model"): [*models, ALL],
        ("identify", "--law"): ["auto", *laws],
        ("sample", "--noise"): list(NOISES),
        ("tune", "--law"): [spec.name for spec in control_laws()],
        **{(verb, "--repair"): list(REPAIR_KINDS) for verb in ("check", "identify", "calibrate", "predict")},
    }
