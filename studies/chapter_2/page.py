"""The page of the study."""

from __future__ import annotations

from pathlib import Path

from markupsafe import Markup

from mrwork.report import panel, write_study_page
from studies.chapter_2.device_families import FAMILIES
from studies.chapter_2.figures import loop_figure, setting_figures, trade_figure
from studies.chapter_2.findings import Chapter
from studies.chapter_2.tables import SETS, findings, tables


def write_page(chapter: Chapter, path: Path) -> None:
    """Write figures and tables, a section for each part."""
    sets = [name for name in SETS if name in next(iter(chapter.families.values())).figures]
    write_study_page(
        Path(__file__).parent / "page.html.j2",
        path,
        tables={
            name: [Markup(table.html()) for table in each] for name, each in tables(chapter.found).items()
        },
        trades=[
            panel(
                f"trade-{name}", SETS[name], trade_figure(chapter.families, name), f"{SETS[name]}: families"
            )
            for name in sets
        ],
        numbers=[(number, family.name) for number, family in enumerate(FAMILIES, start=1)],
        settings=[
            panel(f"setting-{place}", label, figure, f"Score of {label} over its setting")
            for place, (label, figure) in enumerate(setting_figures(chapter.families))
        ],
        loops=[
            panel(f"loop-{place}", label, loop_figure(judged), f"Force over elongation: {label}")
            for place, (label, judged) in enumerate(chapter.families.items())
        ],
        findings=findings(chapter.found),
    )
