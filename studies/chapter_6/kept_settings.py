"""The tuned settings as a file: one table for each law and level, as `mrwork respond` takes them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

from studies.chapter_6.tried_settings import Setting
from studies.chapter_6.tuning import Found, Tuned
from studies.common.frame import LEVELS, level_name

KEPT = Path(__file__).parent / "tuned.toml"


def kept(path: Path = KEPT) -> dict[str, tuple[Tuned, ...]]:
    """By law, what was tuned at each level."""
    tables = tomllib.loads(path.read_text())
    return {
        law: tuple(
            Tuned(
                # The ideal force is kept twice, without and with a limit.
                law="active" if law.startswith("active") else law,
                settings={
                    name: tuple(value) if isinstance(value, list) else value
                    for name, value in levels[level_name(level)]["settings"].items()
                },
                largest_current=levels[level_name(level)]["largest_current"],
            )
            for level in LEVELS
        )
        for law, levels in tables.items()
    }


_HEADING = "# Found by `study.py --tune`: the least score at each level; largest currents in amperes."


def keep(found: Mapping[str, Found], path: Path = KEPT) -> None:
    """Write what was found; the tables of other laws stay as they are."""
    by_law: dict[str, list[str]] = {}
    for table in path.read_text().rstrip("\n").split("\n\n")[1:] if path.exists() else []:
        by_law.setdefault(table[1:].partition(".")[0], []).append(table)
    for law, each in found.items():
        by_law[law] = list(_tables(law, each))
    path.write_text("\n\n".join([_HEADING, *(table for law in by_law.values() for table in law)]) + "\n")


def _tables(law: str, found: Found) -> Iterator[str]:
    for level, tuned, score in zip(LEVELS, found.at_level, found.scores, strict=True):
        settings = ", ".join(f"{name} = {_written(value)}" for name, value in tuned.settings.items())
        yield "\n".join(
            [
                f'[{law}."{level_name(level)}"] # {score:.4f}, the best of {found.tried}; one setting for both levels: '
                + (" and ".join(f"{value:.4f}" for value in found.both_score)),
                f"largest_current = {tuned.largest_current:g}",
                f"settings = {{ {settings} }}" if settings else "settings = {}",
            ]
        )


def _written(value: Setting) -> str:
    return f"[{', '.join(map(repr, value))}]" if isinstance(value, tuple) else repr(value)
