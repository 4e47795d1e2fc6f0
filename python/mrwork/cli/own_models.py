"""Dampers of users on the command line: the file that has one, and whether equations of a run folder may run."""

from __future__ import annotations

import argparse
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from mrwork.cli.command_parser import CommandParser
from mrwork.cli.terminal import keep_stdout, note
from mrwork.errors import SettingError

if TYPE_CHECKING:
    from mrwork.dampers.spec import DamperSpec

_SUFFIX = ".py"


def add_trust(parser: CommandParser) -> None:
    """--trust, and --model of a verb that takes what another has identified."""
    title = "damper of the user"
    trust = "let the Python equations run that a run folder has of a damper of its user; read them first"
    parser.option(title, "--trust", trust, bool)
    model = "let them run if they equal this file's, which runs as Python"
    parser.option(title, "--model", model, dest="own_model", metavar="FILE.py:NAME")


def admit_equations(options: argparse.Namespace) -> None:
    """Let equations run as the options of `add_trust` say."""
    if getattr(options, "trust", False):
        from mrwork.dampers.own_equations import trust_others

        trust_others(note)
    model = getattr(options, "own_model", None)
    if model is not None:
        if not is_own(model):
            raise SettingError(
                f"--model is {model!r}; give FILE.py:NAME, the file and the name of a damper in it"
            )
        own_model(model)


def is_own(model: str) -> bool:
    """Whether the name of a model is FILE.py:NAME."""
    return model.endswith(_SUFFIX) or model.rpartition(":")[0].endswith(_SUFFIX)


@cache
def own_model(model: str) -> DamperSpec:
    """The damper NAME of FILE.py:NAME, which runs as Python, once."""
    # NumPy is loaded by these, and not needed for a help.
    from mrwork.base.keys import suggestion
    from mrwork.dampers.spec import DamperSpec
    from mrwork.store.user_python import run_file

    file, _, name = (model, "", "") if model.endswith(_SUFFIX) else model.rpartition(":")
    note(f"running {file} as Python, for its damper {name or 'NAME'}")
    with keep_stdout():
        module, _ = run_file(Path(file), what="a damper")
    dampers = {
        key: value
        for key, value in vars(module).items()
        if isinstance(value, DamperSpec) and value.own is not None
    }
    if not name and dampers:
        raise SettingError(f"name one of its dampers, as in {file}:NAME; it has {', '.join(dampers)}")
    if name not in dampers:
        near = suggestion(name, [*dampers], otherwise="it has") if dampers else ""
        raise SettingError(
            f"{file} has no damper {name!r} that mrwork.own_damper has made{near}; write {name or 'NAME'} = "
            "mrwork.own_damper(...) in it"
        )
    return dampers[name]
