"""The manifest of a run folder, read back and compared with the results beside it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any, Final

from mrwork.errors import RecordError
from mrwork.escaping import escaped
from mrwork.store.codec import finite
from mrwork.store.input_file import is_there, stored, text_of
from mrwork.store.record import parsed
from mrwork.store.run_folder import MANIFEST

# Characters of a value in a message.
_SHOWN: Final = 40


def read_manifest(place: Path, *, verb: str) -> Mapping[str, Any] | None:
    """What the manifest of the folder at `place` states, `None` where there is none; `verb` is what writes it.

    Raises
    ------
    RecordError
        Where it is damaged.
    """
    path, kind = place / MANIFEST, stored(verb, name="the manifest")
    if not is_there(path, kind):
        return None
    stated = parsed(text_of(path, kind), origin=str(path), verb=verb)
    if not isinstance(stated, Mapping):
        raise RecordError(f"{path} is not a manifest, which is an object of JSON; run `mrwork {verb}` again")
    return stated


def check_manifest(
    place: Path, stated: Mapping[str, Any], facts: Mapping[str, Collection[object]], *, file: str, verb: str
) -> None:
    """Check that a manifest states what is in the results beside it; one that says less is that of another version.

    Parameters
    ----------
    place
        The folder.
    stated
        What its manifest states.
    facts
        The values that an entry may have, by its name.
    file, verb
        For messages: name of the file of the results, and the verb of `mrwork` that writes both.

    Raises
    ------
    RecordError
        Where an entry has another value; the message names it.
    """
    for name, permitted in facts.items():
        if name in stated and stated[name] not in [finite(value) for value in permitted]:
            shown = repr(stated[name])
            cut = f"{shown[:_SHOWN]}…" if len(shown) > _SHOWN else shown
            raise RecordError(
                escaped(
                    f"{place / MANIFEST} is of another run than {file} beside it: its {name} is {cut}; "
                    f"restore the one that was written with it, or run `mrwork {verb}` again"
                )
            )
