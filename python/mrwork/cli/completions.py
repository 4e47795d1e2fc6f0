"""What a shell needs to complete verbs, options, names, files and folders, as `mrwork --completion SHELL` prints it."""

from __future__ import annotations

import argparse

from mrwork.cli.command_parser import CommandParser
from mrwork.cli.number_texts import named_path

# What a path of this name is: a folder.
_FOLDERS = ("RUN", "DIR")


def completion_script(whole: CommandParser, shell: str) -> str:
    """The script of a shell for a parser with the options of every verb; it completes names of models and laws, too."""
    # Nothing else needs it.
    import shtab

    offered = _offered_names()
    for verb, subparser in subcommands(whole).items():
        for action in subparser._actions:
            name = (action.option_strings or [action.dest])[0]
            if (verb, name) in offered:
                action.choices = offered[verb, name]
            elif action.type is named_path or name == "files":
                is_folder = action.metavar in _FOLDERS
                action.complete = shtab.DIRECTORY if is_folder else shtab.FILE  # type: ignore[attr-defined] # read by shtab
    script: str = shtab.complete(whole, shell=shell)
    return script


def subcommands(parser: CommandParser) -> dict[str, CommandParser]:
    """The parser of each verb, by its name."""
    (verbs,) = (action for action in parser._actions if isinstance(action, argparse._SubParsersAction))
    return dict(verbs.choices)


def _offered_names() -> dict[tuple[str, str], list[str]]:
    """Names for arguments that take more than names, by verb and argument."""
    from mrwork.control.laws.control_law import control_laws
    from mrwork.dampers.dependence import LAWS_AT_COMMANDS, named_dependences
    from mrwork.dampers.spec import ALL, damper_models
    from mrwork.records.repairs import REPAIR_KINDS
    from mrwork.uncertainty.noise import NOISES

    models = [spec.name for spec in damper_models()]
    parameters = dict.fromkeys(name for spec in damper_models() for name in spec.names)
    laws = [f"{name}={law}" for name in parameters for law in (*named_dependences(), *LAWS_AT_COMMANDS)]
    return {
        ("models", "name"): models,
        ("identify", "--model"): [*models, ALL],
        ("identify", "--law"): ["auto", *laws],
        ("intervals", "--noise"): list(NOISES),
        ("tune", "--law"): [spec.name for spec in control_laws()],
        **{(verb, "--repair"): list(REPAIR_KINDS) for verb in ("check", "identify", "calibrate", "predict")},
    }
