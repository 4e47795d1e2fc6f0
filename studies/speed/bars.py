"""Targets beside the values measured in this run."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """A target and the measured value; `measured` is `None` if one of the contenders never reached the target."""

    claim: str
    threads: int
    aim: float
    measured: float | None
    met: bool = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "met", self.measured is not None and self.measured >= self.aim)

    def __str__(self) -> str:
        where = f", {self.threads} thread(s)" if self.threads else ""
        measured = "nothing to compare" if self.measured is None else f"{self.measured:.3g}"
        return f"{'met' if self.met else 'NOT MET':<8} {self.claim}{where}: {measured}, aim {self.aim:g}"


def ratio_bar(claim: str, threads: int, aim: float, over: float | None, under: float | None) -> Bar:
    """A target of a ratio, of which one part may not be known."""
    return Bar(claim=claim, threads=threads, aim=aim, measured=over / under if over and under else None)
