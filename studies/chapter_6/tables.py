"""Tables of the findings."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from mrwork.control import control_law
from mrwork.report import Table
from studies.chapter_6.conditions import CONDITIONS, HALF_STEP, REFERENCE
from studies.chapter_6.loop_findings import ACTIVE, TUNED_LAWS
from studies.chapter_6.published import QUANTITIES
from studies.former.frame import LEVELS, level_name
from studies.former.scores import TITLES
from studies.former.table import Cell, alike, table_of

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
    columns: list[tuple[str, Cell]] = []
    for label, row in found.items():

        def cell(text: Callable[[float], str], part: str, row: dict[str, Any] = row) -> Cell:
            return lambda name: text(row[part][name]) if name in row[part] else ""

        columns += [
            (label, cell("{:g}".format, "published")),
            ("ours", cell(lambda peak: f"{peak:.3g}" if peak < 100.0 else f"{peak:.0f}", "ours")),
            ("deviation", cell("{:+.1%}".format, "deviation")),
        ]
    title = "Peaks of Dyke et al. 1996: published, ours, deviation"
    return table_of(title, "", ((name, name) for name in QUANTITIES), columns)


def _causes(plain: dict[str, Any], found: dict[str, Any], spread: dict[str, dict[str, float]]) -> Table:
    rows = {
        label: {**entry["deviation"], "largest": f"{entry['largest']:.1%}"}
        for label, entry in {"as printed": plain, **found}.items()
    }
    for end in ("least", "most"):
        ends = {name: deviation[end] for name, deviation in spread.items()}
        rows[f"M, C, K before rounding: {end}"] = {**ends, "largest": ""}
    columns: dict[str, Cell] = {name: lambda row, name=name: f"{row[name]:+.1%}" for name in plain["ours"]}
    title = "The row without a damper: deviations, one thing changed at a time"
    return table_of(title, "", rows, {**columns, "largest": "{largest}"})


def _five_storeys(found: dict[str, Any], level: str) -> Table:
    rows = []
    for label, levels in sorted(found.items(), key=lambda row: row[1][level]["score"]):
        is_active = label in ACTIVE
        is_driven = label in TUNED_LAWS or label in ("i = 0", "best constant", "i_max")
        entry = levels[level]
        texts = {
            "current": f"{entry['mean_current']:.2f}" if is_driven else "",
            "force": f"{entry['peak_force']:.0f}" if is_driven or is_active else "",
            "stroke_mm": 1e3 * entry["stroke"],
            "choice": "" if is_active else entry["says"],
        }
        rows.append((title_of(label), {**entry, **texts}))
    return table_of(
        f"Five storeys, four records at {level}, over i = 0",
        "law",
        rows,
        {
            "phi": "{score:.4f}",
            **alike(".3f", {title: name for name, title in TITLES.items()}),
            "mean current [A]": "{current}",
            "peak force [N]": "{force}",
            "stroke [mm]": "{stroke_mm:.1f}",
            "energy error": "{energy_error:.0e}",
            "": "{choice}",
        },
    )


def _conditions(found: dict[str, Any], level: str) -> Table:
    order = sorted(found, key=lambda law: found[law][REFERENCE.name][level]["score"])
    return table_of(
        f"Scores by condition at {level}; settings as tuned at Ts 1 ms",
        "law",
        (
            (title_of(law), {name: levels[level]["score"] for name, levels in found[law].items()})
            for law in order
        ),
        alike(".4f", {condition.name: condition.name for condition in CONDITIONS}),
    )


def _steps(found: dict[str, Any]) -> Table:
    columns: dict[str, Cell] = {}
    for level in map(level_name, LEVELS):

        def of(form: str, level: str = level) -> Cell:
            def cell(conditions: dict[str, Any]) -> str:
                half, reference = conditions[HALF_STEP.name][level], conditions[REFERENCE.name][level]
                change = half["score"] - reference["score"]
                return form.format(half=half, change=change, error=reference["energy_error"])

            return cell

        columns |= {
            f"score, {level}": of("{change:+.0e}"),
            f"one ratio, {level}": of("{half[largest_change]:.0e}"),
            f"of, {level}": of("{half[of]}"),
            f"energy error, {level}": of("{error:.0e}"),
        }
    title = "What half the step changes: the score, and the most that one ratio of one record moves"
    return table_of(title, "law", ((title_of(law), conditions) for law, conditions in found.items()), columns)


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
