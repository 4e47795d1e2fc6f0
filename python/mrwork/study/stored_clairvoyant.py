"""Non-causal optima of a study in its results file."""

from __future__ import annotations

from dataclasses import dataclass, fields

from mrwork.arguments import NotNegative, Positive, Whole
from mrwork.closed_loop.clairvoyant_search import Clairvoyant
from mrwork.store.record import OrNan


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredStart:
    """A start of the search: its score, and the one reached from it."""

    name: str
    start_score: OrNan
    score: OrNan
    evaluations: Whole
    seconds: NotNegative


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredClairvoyant:
    """The non-causal optimum of a motion: command of each interval [A or V], shape (n_intervals, n_devices)."""

    motion: str
    score: OrNan
    ratios: dict[str, OrNan]
    statement: str
    starts: tuple[StoredStart, ...]
    interval: Positive
    command: tuple[tuple[float, ...], ...]


def stored_clairvoyant(found: Clairvoyant) -> StoredClairvoyant:
    """The optimum in the form of the results file."""
    return StoredClairvoyant(
        motion=found.motion,
        score=found.score,
        ratios=dict(found.ratios),
        statement=found.statement,
        starts=tuple(
            StoredStart(**{entry.name: getattr(each, entry.name) for entry in fields(StoredStart)})
            for each in found.starts
        ),
        interval=found.commands.interval,
        command=tuple(map(tuple, found.commands.command.tolist())),
    )
