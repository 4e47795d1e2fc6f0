"""What a person reads uses the standard terms of the field."""

import argparse
import re
from pathlib import Path

from mrwork.cli import door  # the parsers, of which no public name has the help

ROOT = Path(__file__).resolve().parents[2]
# What is not said, and what is said in its place.
NEVER = {
    r"(tests?|motions?|records?) (that (was|were|are) )?not seen|unseen tests?": "held-out tests",
    r"left-out (tests?|motions?)": "held-out tests; leave one motion out",
    r"share inside|bands? that holds?": "coverage of a prediction band",
    r"effective draws|independent ones": "effective sample size",
    r"(what )?the data permit": "practical identifiability",
    r"plan of tests": "optimal experiment design, next test",
    r"given the motion, never the force": "free-run simulation",
    r"minimisations? that meet": "local optimisation from many starts",
    r"what is to be made small": "cost, misfit",
    r"dampers? of (its|their) own": "uncontrolled, bare frame",
    r"change of every quantity": "drift ratio, storey shear, base shear",
    r"\belongations?\b": "damper displacement, stroke",
    r"what is sent": "command, coil current",
    r"steps? (that )?a sample wants": "sub-steps per sample",
    r"ends? of (its|their) ranges?": "lower and upper bound",
}


def prose(text: str) -> str:
    """A page without its headings, tables, code and addresses, on one line."""
    text = re.sub(r"^\s*[|#].*$", "", text, flags=re.MULTILINE)
    text = re.sub(r"^(`{3,}|:{3,})[^\n]*\n.*?^\1\s*$", "", text, flags=re.DOTALL | re.MULTILINE)
    return " ".join(re.sub(r"`[^`\n]*`|\]\([^)]*\)", "x", text).split())


def test_pages_and_helps_use_the_standard_terms() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    texts = {str(page): page.read_text(encoding="utf-8") for page in pages if "_generated" not in page.parts}
    for verb in door.verbs():
        actions = door.parser([verb])._actions
        (verbs,) = (each for each in actions if isinstance(each, argparse._SubParsersAction))
        texts[f"help of {verb}"] = verbs.choices[verb].format_help()
    found = {
        (name, match.group()): instead
        for name, text in texts.items()
        for words, instead in NEVER.items()
        for match in re.finditer(words, prose(text), flags=re.IGNORECASE)
    }
    assert found == {}
