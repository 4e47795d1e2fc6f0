"""Dampers of users on the command line: the file that has one."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from mrwork.cli.terminal import keep_stdout, note
from mrwork.errors import SettingError

if TYPE_CHECKING:
    from mrwork.dampers.spec import DamperSpec

_SUFFIX = ".py"


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
