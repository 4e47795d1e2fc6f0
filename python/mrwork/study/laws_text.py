"""The control laws in words, for `mrwork respond --laws`; apart from what runs them, which is slow to load."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from mrwork.base.documents import heading_lines, key_lines, keys_in_words
from mrwork.control.laws.control_law import control_laws
from mrwork.control.laws.law_settings import SETTINGS
from mrwork.control.laws.weights import WeightWishes
from mrwork.study.schema import CONSTANT_LAWS


def laws_text() -> str:
    """Every control law with its equation, source and settings; what several laws have stands once, below."""
    keys = {spec.name: keys_in_words(SETTINGS[spec.name]) for spec in control_laws()}
    laws_with = Counter(key for key_name in keys.values() for key in key_name)
    shared = [key for key, count in laws_with.items() if count > 1]
    blocks = []
    for spec in control_laws():
        lines = [f"{spec.name}: {spec.title}", *_indented(spec.equation.splitlines())]
        for prose in (spec.description, spec.source):
            lines += heading_lines("", prose)[1:]
        if spec.switches:
            lines.append("  It switches, so its score has no gradient.")
        unique = [key for key in keys[spec.name] if key not in shared]
        if elsewhere := [key.name for key in keys[spec.name] if key in shared]:
            lines += heading_lines("", f"settings described below: {', '.join(elsewhere)}")[1:]
        blocks.append("\n".join([*lines, *(["  settings", *_indented(key_lines(unique))] if unique else [])]))
    blocks.append("\n".join(["Settings of several laws", *key_lines(shared)]))
    heading = "designed: table among the settings of a law with weights"
    lines = _indented(key_lines(keys_in_words(WeightWishes)))
    blocks.append("\n".join([*heading_lines(heading, WeightWishes.__doc__ or ""), *lines]))
    blocks += [f"{name}: {law.description}; no settings" for name, law in CONSTANT_LAWS.items()]
    return "\n\n".join(blocks)


def _indented(lines: Iterable[str]) -> list[str]:
    return [f"  {line}" for line in lines]
