"""Tables of the findings."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from mrwork.closed_loop import SCORE
from mrwork.control import control_law
from mrwork.report import Table
from studies.chapter_6.conditions import CONDITIONS, HALF_STEP, REFERENCE
from studies.chapter_6.loop_findings import ACTIVE, TUNED_LAWS
from studies.chapter_6.published import QUANTITIES
from studies.common.frame import LEVELS, level_name
from studies.common.table import table_of

_TITLES = {
    "active": "ideal active force",
    "active_limited": "ideal active force, no more than the pair's",
}


def title_of(label: str) -> str:
    """Name of a row: the title of a law, or the label itself."""
    if label in ACTIVE:
        return _TITLES[label]
    return control_law(label).title if label in TUNED_LAWS else label


def tables(found: dict[str, Any]) -> Iterator[Table]:
    """Every table of what was measured."""
    yield _dyke(found["dyke"])
    yield _causes(found["dyke"]["uncontrolled"], found["dyke_causes"], found["dyke_rounding"])
    for level in map(level_name, LEVELS):
        yield _five_storeys(found["five_storeys"], level)
    if "conditions" in found:
        for level in map(level_name, LEVELS):
            yield _conditions(found["conditions"], level)
        yield _steps(found["conditions"])
    yield _faults(found["faults"])
    yield _frequencies(found["frequencies"])


def remarks(found: dict[str, Any]) -> Iterator[str]:
    """Memory and time."""
    if "memory" in found:
        memory = found["memory"]
        yield (
            f"{memory['runs']} runs, {memory['finished']} finished: peak memory {memory['peak_mib']:.0f} MiB "
            f"({memory['before_mib']:.0f} before), {memory['seconds']:.0f} s on one thread."
        )
    yield f"{found['seconds']:.0f} s in all."


def _dyke(found: dict[str, Any]) -> Table:
    labels = tuple(found)
    rows = []
    for name in QUANTITIES:
        cells = []
        for label in labels:
            row = found[label]
            if name not in row["ours"]:
                cells += ["", "", ""]
                continue
            cells += [
                f"{row['published'][name]:g}",
                f"{row['ours'][name]:.3g}" if row["ours"][name] < 100.0 else f"{row['ours'][name]:.0f}",
                f"{row['deviation'][name]:+.1%}",
            ]
        rows.append((name, *cells))
    return Table(
        title="Peaks of Dyke et al. 1996: published, ours, deviation",
        columns=("", *(text for label in labels for text in (label, "ours", "deviation"))),
        rows=tuple(rows),
    )


def _causes(plain: dict[str, Any], found: dict[str, Any], spread: dict[str, dict[str, float]]) -> Table:
    names = tuple(plain["ours"])
    rows = [
        (label, *(f"{entry['deviation'][name]:+.1%}" for name in names), f"{entry['largest']:.1%}")
        for label, entry in {"as printed": plain, **found}.items()
    ]
    rows += [
        (f"M, C, K before rounding: {end}", *(f"{spread[name][end]:+.1%}" for name in names), "")
        for end in ("least", "most")
    ]
    return Table(
        title="The row without a damper: deviations, one thing changed at a time",
        columns=("", *names, "largest"),
        rows=tuple(rows),
    )


def _five_storeys(found: dict[str, Any], level: str) -> Table:
    rows = sorted(found.items(), key=lambda item: item[1][level]["score"])
    return Table(
        title=f"Five storeys, four records at {level}, over i = 0",
        columns=(
            "law",
            "phi",
            "peak drift",
            "peak acc.",
            "rms drift",
            "rms acc.",
            "mean current [A]",
            "peak force [N]",
            "stroke [mm]",
            "energy error",
            "",
        ),
        rows=tuple(
            (
                title_of(label),
                f"{entry[level]['score']:.4f}",
                *(f"{entry[level][name]:.3f}" for name in SCORE),
                f"{entry[level]['mean_current']:.2f}" if not _is_baseline(label) else "",
                f"{entry[level]['peak_force']:.0f}" if not _is_passive_device(label) else "",
                f"{1e3 * entry[level]['stroke']:.1f}",
                f"{entry[level]['energy_error']:.0e}",
                entry[level]["says"] if label not in ACTIVE else "",
            )
            for label, entry in rows
        ),
    )


def _is_passive_device(label: str) -> bool:
    return (
        label not in TUNED_LAWS and label not in ACTIVE and label not in ("i = 0", "best constant", "i_max")
    )


def _is_baseline(label: str) -> bool:
    return _is_passive_device(label) or label in ACTIVE


def _conditions(found: dict[str, Any], level: str) -> Table:
    names = [condition.name for condition in CONDITIONS]
    order = sorted(found, key=lambda law: found[law][REFERENCE.name][level]["score"])
    return Table(
        title=f"Scores by condition at {level}; settings as tuned at Ts 1 ms",
        columns=("law", *names),
        rows=tuple(
            (title_of(law), *(f"{found[law][name][level]['score']:.4f}" for name in names)) for law in order
        ),
    )


def _steps(found: dict[str, Any]) -> Table:
    rows = []
    for law, conditions in found.items():
        cells = []
        for level in map(level_name, LEVELS):
            entry, reference = conditions[HALF_STEP.name][level], conditions[REFERENCE.name][level]
            cells += [
                f"{entry['score'] - reference['score']:+.0e}",
                f"{entry['largest_change']:.0e}",
                entry["of"],
                f"{reference['energy_error']:.0e}",
            ]
        rows.append((title_of(law), *cells))
    headings = ("score", "one ratio", "of", "energy error")
    return Table(
        title="What half the step changes: the score, and the most that one ratio of one record moves",
        columns=("law", *(f"{text}, {level_name(level)}" for level in LEVELS for text in headings)),
        rows=tuple(rows),
    )


def _faults(found: dict[str, Any]) -> Table:
    return table_of(
        "Faults, clipped-optimal, El Centro at 0.3 g",
        "fault",
        found,
        {
            "outcome": "{outcome}",
            "phi": lambda entry: "" if entry["score"] is None else f"{entry['score']:.4f}",
        },
    )


def _frequencies(found: dict[str, Any]) -> Table:
    return table_of(
        "Natural frequencies [Hz]",
        "building",
        found,
        {
            "ours": lambda entry: ", ".join(f"{value:.3f}" for value in entry["hertz"]),
            "stated": lambda entry: ", ".join(f"{value:g}" for value in entry["stated"].values()) or "none",
            "largest deviation": lambda entry: (
                "" if entry["deviation"] is None else f"{entry['deviation']:.2%}"
            ),
        },
    )
