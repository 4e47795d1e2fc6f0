"""Figures of studies in tables and sentences of the pages are those that the studies state, to the digits shown."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
STUDIES = ROOT / "studies"
CITED = re.compile(r"studies/(?:_generated/)?(\w+?)(?:\.md|/)")
# Numbers that are shown as per cent may be stated as shares.
SCALES = (1.0, 100.0)


# Differences of figures, and what a study states in another unit: in them no copy can be looked for.
DERIVED = {
    ("tuned_and_judged", "robust_control"): {"0.041", "0.004"},
    ("models_and_conventions", "boucwen_benchmark"): {"7.1", "1.4"},
}


def files_of(study: str) -> list[Path]:
    """What a study states: its script, notes and expected numbers; nothing where there is no such study."""
    folder = STUDIES / study
    if not ((folder / "expected.toml").is_file() or folder.with_suffix(".py").is_file()):
        return []
    named = (folder.with_suffix(".py"), folder / "README.md", folder / "notes.md", folder / "expected.toml")
    return [*filter(Path.is_file, named), *folder.glob("*.csv")]


def parts_of(page: Path) -> list[tuple[str, str]]:
    """Each paragraph, list and table of a page that cites a study with figures, or follows on that: study and text."""
    found: list[tuple[str, str]] = []
    # A heading ends what a citation is about.
    for section in re.split(r"(?m)^#", page.read_text(encoding="utf-8")):
        study = ""
        for block in re.split(r"\n\s*\n|\n(?=- )", section):
            cited = [name for name in CITED.findall(block) if files_of(name)]
            study = cited[-1] if cited else study
            if study and (cited or block.startswith(("|", "- "))):
                found.append((study, block))
    return found


CASES = [
    pytest.param(page, study, text, id=f"{page.stem}-{number}-{study}")
    for page in sorted((ROOT / "docs").rglob("*.md"))
    if "_generated" not in page.parts
    for number, (study, text) in enumerate(parts_of(page))
]


def stated(study: str) -> set[float]:
    text = "\n".join(file.read_text(encoding="utf-8") for file in files_of(study))
    numbers = [float(each) for each in re.findall(r"-?\d+\.?\d*(?:e[-+]?\d+)?", text.replace(" 000", "000"))]
    return {abs(scale * each) for each in numbers for scale in SCALES}


def shown(text: str) -> list[str]:
    """Numbers with decimals; others count and name things, too."""
    return re.findall(r"(?<![\w.])\d+\.\d+", re.sub(r"`[^`]*`|\]\([^)]*\)", "", text))


def is_stated(number: str, numbers: set[float]) -> bool:
    decimals = len(number.partition(".")[2])
    return any(abs(each - float(number)) <= 0.5000001 * 10.0**-decimals for each in numbers)


@pytest.mark.contract
@pytest.mark.parametrize(("page", "study", "text"), CASES)
def test_every_figure_is_one_of_the_study(page: Path, study: str, text: str) -> None:
    numbers, derived = stated(study), DERIVED.get((page.stem, study), set())
    assert [each for each in shown(text) if each not in derived and not is_stated(each, numbers)] == []
