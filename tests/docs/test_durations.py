"""What computing takes, in figures, names its processor; else it is a ratio, or an order of magnitude in words."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted({*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *ROOT.glob("studies/*/README.md")})
PAGES = [page for page in PAGES if "_generated" not in page.parts]
MODULES = sorted((ROOT / "python" / "mrwork").rglob("*.py"))
PROCESSOR = re.compile(r"EPYC|Xeon|Ryzen|Core i\d|Apple M\d|Graviton")
TIME = r"(?<!every )(?<!up to )\b\d[\d.,]* ?(?:ns|us|µs|ms|s|min|seconds?|minutes?|h|hours?)\b"
# What computing costs: not a duration of a motion, a horizon or a delay.
COSTS = re.compile(
    rf"\b(?:takes?|took|taking|spent?|saves?)\b[^.;:|]{{0,80}}?{TIME}(?! (?:of (?:a|the) motion|steps?))"
)
OF_CORES = re.compile(
    rf"{TIME}[^.;|]{{0,20}}\b(?:of (?:one|a|the) (?:core|processor)|of CPU|on (?:one|two) (?:cores?|threads?))"
)
RATES = re.compile(
    r"\d[\d .,]* (?:decisions|designs|candidates|steps|runs|simulations|operations) (?:a|per) second\b"
)


def unnamed(text: str) -> list[str]:
    """Durations and rates of computing in figures, in paragraphs that name no processor."""
    text = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    found = []
    for paragraph in re.split(r"\n\s*\n|\n(?=- )", text):
        line = " ".join(paragraph.split())
        if not PROCESSOR.search(line):
            found += [each.group() for rule in (COSTS, OF_CORES, RATES) for each in rule.finditer(line)]
    return found


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_a_duration_on_a_page_names_its_processor(page: Path) -> None:
    assert unnamed(page.read_text()) == []


def test_a_duration_in_a_docstring_a_help_or_a_comment_names_its_processor() -> None:
    found = {str(path.relative_to(ROOT)): unnamed(path.read_text()) for path in MODULES}
    assert {path: each for path, each in found.items() if each} == {}


@pytest.mark.parametrize(
    "text",
    [
        "A simulation of 4000 runs takes 1.6 s on two cores; others take longer.",
        "In the benchmark 4000 runs of 30 s took\n3.2 s on one thread.",
        "Eleven and 82 minutes of CPU.",
        "That is 60 000 steps a second.",
    ],
)
def test_a_duration_without_a_processor_is_found(text: str) -> None:
    assert unnamed(text)
    assert not unnamed(f"On an AMD EPYC (Zen 5): {text}")


@pytest.mark.parametrize(
    "text",
    [
        "A run takes some seconds on one core.",
        "A simulation takes 55 times as long as at i = 0.",
        "The law takes its readings every 10 ms and holds them.",
        "Horizons from 0.18 to 0.34 s, a delay of 5 ms, motions of 45 s.",
        "| delay | 5 ms |",
    ],
)
def test_what_is_no_duration_of_computing_is_left_alone(text: str) -> None:
    assert not unnamed(text)
