"""What a person reads uses the standard terms of the field, in sentences that are short enough to be read once."""

from __future__ import annotations

import argparse
import ast
import re
from pathlib import Path

import pytest

from mrwork.cli import door  # the parsers, of which no public name has the help

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "python" / "mrwork"
PAGES = sorted({ROOT / "README.md", *(ROOT / "docs").rglob("*.md")})
PAGES = [page for page in PAGES if "_generated" not in page.parts]
# Read from the first line to the last by newcomers.
TAUGHT = [
    page
    for page in PAGES
    if page.name in {"README.md", "index.md"} or {"tutorials", "guides"} & set(page.relative_to(ROOT).parts)
]
MOST_WORDS = 30
# What is not said, and what is said in its place.
NEVER = {
    r"(tests?|motions?|records?) (that (was|were|are) )?not seen": "held-out tests",
    r"unseen tests?": "held-out tests",
    r"left-out (tests?|motions?)": "held-out tests; leave one motion out",
    r"share inside": "coverage",
    r"bands? that holds?": "coverage of a prediction band",
    r"effective draws|independent ones": "effective sample size",
    r"what the data permit|the data permit": "practical identifiability",
    r"plan of tests": "optimal experiment design, next test",
    r"given the motion, never the force": "free-run simulation",
    r"minimisations? that meet": "multistart local optimisation",
    r"what is to be made small": "cost, misfit",
    r"dampers? of (its|their) own": "uncontrolled, bare frame",
    r"change of every quantity": "drift ratio, storey shear, base shear",
    r"\belongations?\b": "damper displacement, stroke",
    r"what is sent": "command, coil current",
    r"steps? (that )?a sample wants": "sub-steps per sample",
    r"ends? of (its|their) ranges?": "lower and upper bound",
}
# Labels of cases, in tables, in code and between quotes: the words are right in a sentence, as a name they are not.
FORMER_LABELS = {
    "i = 0": "Passive-off",
    "Largest command": "Passive-on",
    "Best constant command": "Optimal passive",
}
LABEL = rf"(?<=[|\"'*`])\s*({'|'.join(FORMER_LABELS)})(?=(, [\d.]+ [AV])?\s*[|\"'*`])"
# How many there are in what reads folders of earlier versions, and in what keeps the condition i = 0 on one line.
NAME_FORMER = {"schema.py": 3, "table.py": 1}


def prose(text: str) -> str:
    """A page without its header, code, tables, equations and addresses."""
    text = re.sub(r"\A---\n.*?\n---\n", "", text, flags=re.DOTALL)
    text = re.sub(r"^(`{3,}|:{3,}|~{3,})[^\n]*\n.*?^\1\s*$", "\n", text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"<!--.*?-->", "", text, flags=re.DOTALL)
    text = re.sub(r"\$\$.*?\$\$|`[^`\n]*`|\$[^$\n]*\$", "x", text, flags=re.DOTALL)
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text)
    lines = [line for line in text.splitlines() if not re.match(r"\s*[|#]|    |\t|\(.*\)=|\+\+\+", line)]
    return "\n".join(re.sub(r"^\s*([-*]|\d+\.) ", "\n", line) for line in lines)


def sentences(text: str) -> list[str]:
    parts = [
        part for block in re.split(r"\n\s*\n", prose(text)) for part in re.split(r"(?<=[.!?:;])\s+", block)
    ]
    return [" ".join(part.split()) for part in parts if part.strip()]


def helps() -> dict[str, str]:
    """The help of every verb."""
    found = {}
    for verb in door.verbs():
        (verbs,) = (
            action
            for action in door.parser([verb])._actions
            if isinstance(action, argparse._SubParsersAction)
        )
        found[verb] = verbs.choices[verb].format_help()
    return found


def said(text: str) -> list[str]:
    one_line = " ".join(text.split())
    return [
        f"'{match.group()}': say {instead}"
        for words, instead in NEVER.items()
        for match in re.finditer(words, one_line, flags=re.IGNORECASE)
    ]


def labelled(text: str) -> list[str]:
    found = re.finditer(LABEL, text)
    return [f"'{match.group(1)}' as a name: say {FORMER_LABELS[match.group(1)]}" for match in found]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_names_passive_cases_by_the_standard_terms(page: Path) -> None:
    assert labelled(page.read_text(encoding="utf-8")) == []


def test_the_package_names_passive_cases_by_the_standard_terms() -> None:
    found = {
        path: [word for text in literals(path) for word in labelled(f'"{text}"')]
        for path in PACKAGE.rglob("*.py")
    }
    assert [words for path, words in found.items() if len(words) > NAME_FORMER.get(path.name, 0)] == []


def test_a_former_label_is_found_and_a_sentence_is_not() -> None:
    assert labelled("| Largest command | 0.8 |\n- **i = 0**: none") == [
        "'Largest command' as a name: say Passive-on",
        "'i = 0' as a name: say Passive-off",
    ]
    assert labelled('laws["Best constant command, 1.32 A"]') != []
    assert labelled("Largest command of each device; ratios to i = 0.") == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_page_uses_the_standard_terms(page: Path) -> None:
    assert said(prose(page.read_text(encoding="utf-8"))) == []


def test_every_help_uses_the_standard_terms() -> None:
    assert {verb: said(text) for verb, text in helps().items() if said(text)} == {}


@pytest.mark.parametrize("page", TAUGHT, ids=lambda page: str(page.relative_to(ROOT)))
def test_no_sentence_is_too_long_to_be_read_once(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert [each for each in sentences(text) if len(each.split()) > MOST_WORDS] == []


def test_a_term_that_is_not_said_is_found() -> None:
    assert said("It was given the motion,\nnever the force.") == [
        "'given the motion, never the force': say free-run simulation"
    ]
    assert sentences("One.\n\n- two\n- three: four\n") == ["One.", "two", "three:", "four"]


def literals(module: Path) -> list[str]:
    """Texts of a module that are no docstrings, of formatted ones the parts between the values."""
    tree = ast.parse(module.read_text(encoding="utf-8"))
    documented = (ast.Module, ast.ClassDef, ast.FunctionDef)
    docstrings = {
        id(node.body[0].value)
        for node in ast.walk(tree)
        if isinstance(node, documented) and node.body and isinstance(node.body[0], ast.Expr)
    }
    return [
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docstrings
    ]


@pytest.mark.parametrize("room", sorted(path.name for path in PACKAGE.iterdir() if path.is_dir()))
def test_messages_and_pages_use_the_standard_terms(room: str) -> None:
    modules = sorted((PACKAGE / room).rglob("*.py"))
    # Names of columns in the files of rigs are those of their authors.
    texts = [text for path in modules for text in literals(path) if text != "elongation"]
    texts += [path.read_text(encoding="utf-8") for path in (PACKAGE / room).rglob("*.html")]
    assert [word for text in texts for word in said(text)] == []
