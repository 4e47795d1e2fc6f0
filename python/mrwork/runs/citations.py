"""What to cite for a run, as BibTeX.

The works that models, control laws and methods rest on stand in `references.toml`. A source that names none of them,
such as one in a study file, becomes an entry of its own with its words.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
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
        """The reference as an entry of a BibTeX file."""
        lines = [f"  {name} = {{{value}}}," for name, value in self.fields.items()]
        return "\n".join([f"@{self.kind}{{{self.key},", *lines, "}"])


def citations(folder: Path) -> dict[Reference, tuple[str, ...]]:
    """What to cite for a run, and for what: the package, models, control laws, methods and records, each work once."""
    from mrwork import __version__

    package = {
        "title": "{mrwork}: identification of magnetorheological dampers and semi-active control",
        "author": "{mrwork contributors}",
        "version": __version__,
    }
    cited: dict[str, tuple[Reference, list[str]]] = {}
    parts = [("mrwork", Reference(key="mrwork", kind="software", fields=package))]
    for reason, work in [*parts, *_parts(folder)]:
        cited.setdefault(work.key, (work, []))[1].append(reason)
    return {work: tuple(reasons) for work, reasons in cited.values()}


def _parts(folder: Path) -> Iterator[tuple[str, Reference]]:
    """Parts of a run in words, each with a work it rests on; a part without a published source is left out."""
    from mrwork.buildings.frames import buildings
    from mrwork.control.laws.control_law import control_laws
    from mrwork.dampers.spec import damper_models, published_sets

    run = RunFolder.open(folder)
    manifest, content = run.manifest, run.content(STUDY) if is_file(folder / STUDY) else None
    settings = manifest.get("settings")
    stated = [manifest.get("model"), None if content is None else tomllib.loads(content.decode())]
    stated += [settings.get("search"), settings.get("engine")] if isinstance(settings, Mapping) else []
    names = {*_texts(stated), *(name for name in (*ADDITIONS, RANKING) if is_file(folder / name))}
    for noun, entries in (
        ("model", damper_models()),
        ("published set", published_sets()),
        ("control law", control_laws()),
        ("building", buildings()),
    ):
        for entry in entries:
            works = references_in(entry.source, entry.name) if entry.name in names else ()
            yield from ((f"{noun}: {entry.name}", work) for work in works)
    for name in sorted(names):
        yield from ((f"method: {name}", work) for work in references_of(name))
    # Measured tests of a fit and recorded motions of a study, without what was computed.
    for name, digest in (run.manifest.get("inputs", {}) if run.kind is FIT_RUN else {}).items():
        if not is_synthetic(name):
            # The digest of a file says exactly which data were used.
            facts = {"title": Path(name).name, "howpublished": "test record", "note": f"SHA-256 {digest}"}
            yield f"record: {name}", _misc(f"record-{digest[:8]}", facts)
    results = run.document(RESULTS) if is_file(run.path / RESULTS) else {}
    for motion in results.get("motions", ()):
        if not motion.get("synthetic"):
            name, source = str(motion["name"]), str(motion.get("source"))
            facts = {"title": name, "howpublished": "ground motion", "note": source}
            yield f"record: {name}", _misc(f"motion-{name}", facts)


def _texts(document: object) -> Iterator[str]:
    if isinstance(document, str):
        yield document
    elif isinstance(document, Mapping):
        for key, value in document.items():
            yield from (str(key), *_texts(value))
    elif isinstance(document, list):
        for item in document:
            yield from _texts(item)


@cache
def _works() -> tuple[tuple[Reference, str, frozenset[str]], ...]:
    """References with the words by which sources name them, and the names of what uses them."""
    document = tomllib.loads(files("mrwork").joinpath("references.toml").read_text(encoding="utf-8"))
    works = []
    for key, table in document.items():
        cited, used, kind = table.pop("cited", ""), table.pop("used", ()), table.pop("type")
        fields = {
            name: " and ".join(value) if isinstance(value, list) else str(value)
            for name, value in table.items()
        }
        works.append((Reference(key=key, kind=kind, fields=fields), cited, frozenset(used)))
    return tuple(works)


def references_in(source: str, name: str) -> tuple[Reference, ...]:
    """Works that a `source` names; where it names none but has a year, an entry with its words, keyed by `name`."""
    named = tuple(work for work, cited, _ in _works() if cited and cited in source)
    if named or re.search(r"\b(19|20)\d\d\b", source) is None:
        return named
    return (_misc(name, {"note": source}),)


def references_of(name: str) -> tuple[Reference, ...]:
    """Works that the search, method or motion of this name rests on."""
    return tuple(work for work, _, used in _works() if name in used)


def _misc(key: str, fields: Mapping[str, str]) -> Reference:
    """A reference whose texts, from files, have no character that means something to TeX."""
    plain = {name: re.sub(r"([#$%&_{}])", r"\\\1", text.replace("\\", "/")) for name, text in fields.items()}
    return Reference(key=re.sub(r"[^\w-]+", "-", key).strip("-"), kind="misc", fields=plain)
