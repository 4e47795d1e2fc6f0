"""Works that models, control laws and methods rest on, as BibTeX.

They stand in `references.toml`. A source that names none of them, such as one in a study file, becomes an entry of
its own with its words.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """An entry of BibTeX: its key, its type, and its fields in order."""

    key: str
    kind: str
    fields: Mapping[str, str]

    @property
    def bibtex(self) -> str:
        """The entry as text."""
        lines = [f"  {name} = {{{value}}}," for name, value in self.fields.items()]
        return "\n".join([f"@{self.kind}{{{self.key},", *lines, "}"])


@dataclass(frozen=True, slots=True, kw_only=True)
class _Work:
    """A reference, the words by which sources name it, and the names of what uses it."""

    reference: Reference
    cited: str
    used: frozenset[str]


@cache
def _works() -> tuple[_Work, ...]:
    document = tomllib.loads(files("mrwork").joinpath("references.toml").read_text(encoding="utf-8"))
    return tuple(
        _Work(
            cited=table.pop("cited", ""),
            used=frozenset(table.pop("used", ())),
            reference=Reference(key=key, kind=table.pop("type"), fields=_fields(table)),
        )
        for key, table in document.items()
    )


def _fields(table: Mapping[str, object]) -> dict[str, str]:
    return {
        name: " and ".join(value) if isinstance(value, list) else str(value) for name, value in table.items()
    }


def references_in(source: str, name: str) -> tuple[Reference, ...]:
    """Works that a `source` names; where it names none but has a year, an entry with its words, keyed by `name`."""
    named = tuple(work.reference for work in _works() if work.cited and work.cited in source)
    if named or re.search(r"\b(19|20)\d\d\b", source) is None:
        return named
    return (_in_words(name, source),)


def references_of(names: Iterable[str]) -> tuple[Reference, ...]:
    """Works that the searches, methods and motions of these names rest on."""
    wanted = frozenset(names)
    return tuple(work.reference for work in _works() if work.used & wanted)


def reference_of_file(name: str, digest: str) -> Reference:
    """A record by the name of its file and its SHA-256, which say exactly which data were used."""
    fields = {"title": _plain(name), "howpublished": "test record", "note": f"SHA-256 {digest}"}
    return Reference(key=f"record-{digest[:8]}", kind="misc", fields=fields)


def reference_of_motion(name: str, source: str) -> Reference:
    """A recorded ground motion in the words of its file."""
    fields = {"title": _plain(name), "howpublished": "ground motion", "note": _plain(source)}
    return Reference(key=f"motion-{_key(name)}", kind="misc", fields=fields)


def reference_of_package(version: str) -> Reference:
    """The package itself."""
    fields = {
        "title": "{mrwork}: identification of magnetorheological dampers and semi-active control",
        "author": "{mrwork contributors}",
        "version": version,
    }
    return Reference(key="mrwork", kind="software", fields=fields)


def _in_words(name: str, source: str) -> Reference:
    return Reference(key=_key(name), kind="misc", fields={"note": _plain(source)})


def _key(name: str) -> str:
    return re.sub(r"\W+", "-", name).strip("-")


def _plain(text: str) -> str:
    """Text in which no character means something to TeX."""
    return re.sub(r"([#$%&_{}])", r"\\\1", text.replace("\\", "/"))
