"""Page of the keys of a study file, from the tables that read it."""

from __future__ import annotations

import inspect

from generate.markdown import code, directive, document, prose, table, unit
from mrwork.base.docstrings import before_sections
from mrwork.base.documents import KeyInWords, keys_in_words, prose_of
from mrwork.base.keys import Table, tables
from mrwork.study.schema import StudyTable

HEADINGS = ("key", "type", "unit", "default", "meaning")


def schema_page() -> str:
    """Every table of a study file with its keys."""
    sections = [
        document(
            f"## {code(heading) if heading else 'At the top'}", documentation(kind), key_table(kind)
        ).rstrip()
        for heading, kind in tables(StudyTable)
    ]
    return document(
        "(study-schema)=\n# Keys of a study file",
        "A study is a TOML file that [`mrwork respond`](verbs/respond.md) and [`mrwork tune`](verbs/tune.md) read. "
        "`mrwork help study` prints this page. Numbers are in the SI unit that is given here, or texts "
        'with another unit of the same dimension, as `"2 mm"`.',
        *sections,
    )


def key_table(kind: Table) -> str:
    """The keys of a table of a document; on a narrow page its rows become blocks."""
    rows = table(HEADINGS, [_row(each) for each in keys_in_words(kind)])
    return directive("div", "keys", rows) if rows else ""


def documentation(kind: Table) -> str:
    """What a table is, and the further text of the docstrings of its functions; a paragraph on a line each."""
    functions = kind if isinstance(kind, tuple) else ()
    further = (before_sections(inspect.getdoc(each) or "").partition("\n\n")[2] for each in functions)
    paragraphs = "\n\n".join(filter(None, (prose_of(kind), *further))).split("\n\n")
    return "\n\n".join(prose(each) for each in paragraphs)


def _row(key: KeyInWords) -> tuple[str, ...]:
    default = "required" if key.default == "required" else code(key.default) if key.default != "-" else ""
    return code(key.name), prose(key.form), unit(key.unit), default, prose(key.meaning)
