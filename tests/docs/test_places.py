"""Files that pages for contributors name are there and have what is named; cited decisions have these titles."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = ("ARCHITECTURE.md", "CONTRIBUTING.md", "DECISIONS.md", "crates/README.md", "docs/extend.md")
FOLDERS = ("", "python/mrwork", "crates", "crates/mrwork-dynamics/src", "docs")
NAMED = re.compile(r"(?:`(\w+)!?` of )?`([\w.*/-]*/[\w.*-]+\.(?:py|pyi|rs|toml|md))`")

CITED = re.compile(r'(?:DECISIONS\.md,|decisions\.md\):) "([^"]+)"')


@pytest.mark.parametrize("page", PAGES)
def test_named_files_are_there_and_have_what_is_named(page: str) -> None:
    text = re.sub(
        r"^```.*?^```$", "", (ROOT / page).read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE
    )
    missing = []
    for name, place in NAMED.findall(text):
        found = [path for folder in FOLDERS for path in (ROOT / folder).glob(place)]
        if "NAME" not in place and "SUBJECT" not in place and not found:
            missing.append(place)
        elif not all(name in path.read_text(encoding="utf-8") for path in found[:1]):
            missing.append(f"{name} of {place}")
    assert missing == []


def test_cited_decisions_have_these_titles() -> None:
    titles = re.findall(
        r"^### (.*)$", (ROOT / "DECISIONS.md").read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    assert not [title for title in titles if re.match(r"\d+\.", title)]
    sources = [*(ROOT / "python").rglob("*.py"), *(ROOT / "docs").glob("*/*.md")]
    texts = [" ".join(path.read_text(encoding="utf-8").replace("\n# ", "\n").split()) for path in sources]
    cited = {title for text in texts for title in re.findall(CITED, text)}
    assert cited
    assert cited <= set(titles)
