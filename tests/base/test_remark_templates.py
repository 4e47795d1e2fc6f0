"""Every kind of remark, also of what no test provokes: its words and numbers are those that its template wants."""

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from string import Formatter

import mrwork
from mrwork.base.remark import REMARK_KINDS, RemarkKind

ROOT = Path(mrwork.__file__).parent


def remarks_written() -> Iterator[tuple[RemarkKind, ast.Call]]:
    """The kind and the call of each remark that is made of kinds by their names."""
    for path in ROOT.rglob("*.py"):
        text = path.read_text()
        if ".remark(" in text:
            module = import_module(".".join(("mrwork", *path.relative_to(ROOT).with_suffix("").parts)))
            for node in ast.walk(ast.parse(text)):
                if isinstance(node, ast.Call) and ast.unparse(node.func).endswith(".remark"):
                    # One kind, or one of two by a condition.
                    names = [each.id for each in ast.walk(node.func) if isinstance(each, ast.Name)]
                    kinds = [getattr(module, name, None) for name in names]
                    yield from ((kind, node) for kind in kinds if isinstance(kind, RemarkKind))


def test_remarks_give_the_words_and_numbers_of_their_templates() -> None:
    written = [*remarks_written()]
    assert len({kind.code for kind, _ in written}) > 0.75 * len(REMARK_KINDS)
    for kind, call in written:
        fields = {field for _, field, *_ in Formatter().parse(f"{kind.text}{kind.cure}") if field is not None}
        words = {int(field) for field in fields if field.isdigit()}
        given = {each.arg for each in call.keywords}
        starred = any(isinstance(word, ast.Starred) for word in call.args)
        # More words than the template has tell remarks apart.
        assert starred or max(words, default=-1) < len(call.args), kind
        assert None in given or fields - {*map(str, words), "value"} <= given, kind
        assert "value" not in fields or given & {"measured", None}, kind
