"""What to cite for a run, as BibTeX.

The works that models, control laws and methods rest on stand in `references.toml`. A source that names none of them,
such as one in a study file, becomes an entry of its own with its words.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

from mrwork.records.reading import is_synthetic
from mrwork.store.input_file import is_file
from mrwork.store.run_folder import ADDITIONS, FIT_RUN, RANKING, RESULTS, STUDY, RunFolder


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
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


# A part of a run in words, and the works it rests on.
_Part = tuple[str, tuple[Reference, ...]]


def citations(folder: Path | None = None) -> dict[Reference, tuple[str, ...]]:
    """What to cite for a run, and for what: the package, models, control laws, methods and records, each work once."""
    from mrwork import __version__

    parts: list[_Part] = [("mrwork", (reference_of_package(__version__),))]
    parts += [] if folder is None else _parts(folder)
    cited: dict[str, tuple[Reference, list[str]]] = {}
    for reason, works in parts:
        for work in works:
            cited.setdefault(work.key, (work, []))[1].append(reason)
    return {work: tuple(reasons) for work, reasons in cited.values()}


def _parts(folder: Path) -> list[_Part]:
    """Parts of a run, each with the works it rests on; a part without a published source is left out."""
    run = RunFolder.open(folder)
    manifest, study = run.manifest, run.content(STUDY) if is_file(folder / STUDY) else None
    names = dict.fromkeys(_texts(manifest.get("model")))
    names |= {} if study is None else dict.fromkeys(_texts(tomllib.loads(study.decode())))
    settings = manifest.get("settings")
    if isinstance(settings, Mapping):
        names |= dict.fromkeys(_texts([settings.get("search"), settings.get("engine")]))
    names |= dict.fromkeys(name for name in sorted({*ADDITIONS, RANKING}) if is_file(folder / name))
    sources = _sources()
    parts = [(part, references_in(source, name)) for name in names for part, source in sources.get(name, ())]
    parts += [(f"method: {name}", references_of([name])) for name in names]
    return parts + _records(run)


def _records(run: RunFolder) -> list[_Part]:
    """Measured tests of a fit and recorded motions of a study, without what was computed."""
    tests = run.manifest.get("inputs", {}) if run.kind is FIT_RUN else {}
    parts: list[_Part] = [
        (f"record: {name}", (reference_of_file(Path(name).name, digest),))
        for name, digest in tests.items()
        if not is_synthetic(name)
    ]
    results = run.document(RESULTS) if is_file(run.path / RESULTS) else {}
    return parts + [
        (f"record: {each['name']}", (reference_of_motion(str(each["name"]), str(each.get("source"))),))
        for each in results.get("motions", ())
        if not each.get("synthetic")
    ]


def _sources() -> dict[str, list[tuple[str, str]]]:
    """What each name of a model, published set, control law or building stands for, with its source."""
    from mrwork.buildings.frames import buildings
    from mrwork.control.laws.control_law import control_laws
    from mrwork.dampers.spec import damper_models, published_sets

    sources: dict[str, list[tuple[str, str]]] = {}
    for noun, entries in (
        ("model", damper_models()),
        ("published set", published_sets()),
        ("control law", control_laws()),
        ("building", buildings()),
    ):
        for each in entries:
            sources.setdefault(each.name, []).append((f"{noun}: {each.name}", each.source))
    return sources


def _texts(document: object) -> Iterator[str]:
    """Every key and every text of a document."""
    if isinstance(document, str):
        yield document
    elif isinstance(document, Mapping):
        for key, value in document.items():
            yield str(key)
            yield from _texts(value)
    elif isinstance(document, list):
        for each in document:
            yield from _texts(each)


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
            reference=Reference(
                key=key,
                kind=table.pop("type"),
                fields={
                    name: " and ".join(value) if isinstance(value, list) else str(value)
                    for name, value in table.items()
                },
            ),
        )
        for key, table in document.items()
    )


def references_in(source: str, name: str) -> tuple[Reference, ...]:
    """Works that a `source` names; where it names none but has a year, an entry with its words, keyed by `name`."""
    named = tuple(work.reference for work in _works() if work.cited and work.cited in source)
    if named or re.search(r"\b(19|20)\d\d\b", source) is None:
        return named
    return (_misc(_key(name), {"note": source}),)


def references_of(names: Iterable[str]) -> tuple[Reference, ...]:
    """Works that the searches, methods and motions of these names rest on."""
    wanted = frozenset(names)
    return tuple(work.reference for work in _works() if work.used & wanted)


def reference_of_file(name: str, digest: str) -> Reference:
    """A record by the name of its file and its SHA-256, which say exactly which data were used."""
    return _misc(
        f"record-{digest[:8]}", {"title": name, "howpublished": "test record", "note": f"SHA-256 {digest}"}
    )


def reference_of_motion(name: str, source: str) -> Reference:
    """A recorded ground motion in the words of its file."""
    return _misc(f"motion-{_key(name)}", {"title": name, "howpublished": "ground motion", "note": source})


def reference_of_package(version: str) -> Reference:
    """The package itself."""
    fields = {
        "title": "{mrwork}: identification of magnetorheological dampers and semi-active control",
        "author": "{mrwork contributors}",
        "version": version,
    }
    return Reference(key="mrwork", kind="software", fields=fields)


def _misc(key: str, fields: Mapping[str, str]) -> Reference:
    """A reference whose texts, from files, have no character that means something to TeX."""
    plain = {name: re.sub(r"([#$%&_{}])", r"\\\1", text.replace("\\", "/")) for name, text in fields.items()}
    return Reference(key=key, kind="misc", fields=plain)


def _key(name: str) -> str:
    return re.sub(r"\W+", "-", name).strip("-")
