"""All generated pages by their path below `docs/`, and their writing."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from generate.api_pages import api_pages
from generate.damper_pages import model_pages
from generate.figures import loop_figure
from generate.law_pages import law_pages
from generate.registry_pages import format_page, noise_page, search_page
from generate.study_keys import schema_page
from generate.study_pages import study_pages
from generate.verbs import verb_pages
from mrwork.dampers import damper_models

GENERATED = "_generated"
REFERENCE = Path("reference") / GENERATED
STUDIES = Path("studies") / GENERATED
FOLDERS = (REFERENCE, STUDIES)


def pages() -> dict[Path, str]:
    """Every generated page by its path."""
    folders = {
        REFERENCE / "verbs": verb_pages(),
        REFERENCE / "models": model_pages(),
        REFERENCE / "laws": law_pages(),
        REFERENCE / "api": api_pages(),
        STUDIES: study_pages(),
        REFERENCE: {
            "schema": schema_page(),
            "searches": search_page(),
            "noise_models": noise_page(),
            "formats": format_page(),
        },
    }
    return {folder / f"{name}.md": text for folder, texts in folders.items() for name, text in texts.items()}


def pictures() -> dict[Path, Callable[[], bytes]]:
    """What draws each picture, by its path."""
    figures = REFERENCE / "figures"
    return {figures / f"{spec.name}.svg": partial(loop_figure, spec) for spec in damper_models()}


def write(docs: Path) -> None:
    """Write what has changed, so that Sphinx reads no page twice, and remove what is no longer made."""
    contents = {path: text.encode() for path, text in pages().items()}
    contents |= {path: draw() for path, draw in pictures().items()}
    for path, content in contents.items():
        place = docs / path
        place.parent.mkdir(parents=True, exist_ok=True)
        if not place.is_file() or place.read_bytes() != content:
            place.write_bytes(content)
    for folder in FOLDERS:
        for place in [*(docs / folder).rglob("*")]:
            if place.is_file() and place.relative_to(docs) not in contents:
                place.unlink()
