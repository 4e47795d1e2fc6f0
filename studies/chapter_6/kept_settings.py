"""The tuned settings as a file: one table for each law and level, as `mrwork respond` takes them."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

from frame_runs import LEVELS, level_name
from tried_settings import Setting
from tuning import Found, Tuned

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


def keep(found: Mapping[str, Found], path: Path = KEPT) -> None:
    """Write what was found."""
    path.write_text("\n".join(_lines(found)) + "\n")


def _lines(found: Mapping[str, Found]) -> Iterator[str]:
    yield "# Found by `study.py --tune`: the least score at each level; largest currents in amperes."
    for law, each in found.items():
        for level, tuned, score in zip(LEVELS, each.at_level, each.scores, strict=True):
            settings = ", ".join(f"{name} = {_written(value)}" for name, value in tuned.settings.items())
            yield ""
            yield (
                f'[{law}."{level_name(level)}"] # {score:.4f}, the best of {each.tried}; one setting for both levels: '
                + (" and ".join(f"{value:.4f}" for value in each.both_score))
            )
            yield f"largest_current = {tuned.largest_current:g}"
            yield f"settings = {{ {settings} }}" if settings else "settings = {}"


def _written(value: Setting) -> str:
    return f"[{', '.join(map(repr, value))}]" if isinstance(value, tuple) else repr(value)
