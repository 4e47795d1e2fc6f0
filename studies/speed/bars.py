"""Targets of the searches beside the values measured in this run."""

from __future__ import annotations

from dataclasses import dataclass

from studies.speed.early_abort import EarlyAbort
from studies.speed.search_rows import SearchRow, TestRow
from studies.speed.usual_way import SOLVERS

# Whose course the usual way is extrapolated from.
USUAL = "pyswarms"


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """A target and the measured value; `measured` is `None` if one of the searches never reached the target."""

    claim: str
    threads: int
    aim: float
    measured: float | None

    @property
    def met(self) -> bool:
        """Whether the aim was reached."""
        return self.measured is not None and self.measured >= self.aim


# Ours alone, with or without early abort, and as a study runs them.
_OURS = {"one seed after another": ("rust", "rust, early abort"), "seeds at once": ("rust, seeds at once",)}
# Ours and its class of peer.
_CLASSES = (
    ("efficient_ga", "pymoo_ga"),
    ("particle_swarm_constriction", "pyswarms"),
    ("differential_evolution", "scipy_differential_evolution"),
)


def bars_of(rows: tuple[SearchRow, ...], tests: tuple[TestRow, ...], aborts: list[EarlyAbort]) -> list[Bar]:
    """The targets, each on each number of threads."""
    bars: list[Bar] = []

    def found(method: str, objectives: tuple[str, ...], threads: int) -> list[SearchRow]:
        return [
            row
            for row in rows
            if row.method == method and row.objective in objectives and row.threads == threads
        ]

    def fastest(method: str, objectives: tuple[str, ...], threads: int) -> float | None:
        """Seconds to the target."""
        known = [row.seconds for row in found(method, objectives, threads) if row.seconds is not None]
        return min(known, default=None)

    def per_simulation(method: str, objectives: tuple[str, ...], threads: int) -> float | None:
        spent = (row.seconds_per_simulation for row in found(method, objectives, threads))
        return min(spent, default=None)

    def times(ours: float | None, theirs: float | None) -> float | None:
        return theirs / ours if ours and theirs else None

    for threads in dict.fromkeys(row.threads for row in rows if not row.extrapolated):
        bars += [
            Bar(
                claim="share of seeds on which identify is near",
                threads=threads,
                aim=0.95,
                measured=row.success,
            )
            for row in rows
            if (row.method, row.threads) == ("identify", threads)
        ]
        for how, objectives in _OURS.items():
            bars += [
                Bar(
                    claim=f"{ours}, {how}: times faster than {theirs} on numba",
                    threads=threads,
                    aim=8.0,
                    measured=times(fastest(ours, objectives, threads), fastest(theirs, ("numba",), threads)),
                )
                for ours, theirs in _CLASSES
            ]
            # Where ours never came near there is still how fast it simulates.
            bars += [
                Bar(
                    claim=f"{ours}, {how}: simulations a second, times those of {theirs} on numba",
                    threads=threads,
                    aim=8.0,
                    measured=times(
                        per_simulation(ours, objectives, threads), per_simulation(theirs, ("numba",), threads)
                    ),
                )
                for ours, theirs in _CLASSES
                if fastest(ours, objectives, threads) is None
            ]
            bars += [
                Bar(
                    claim=f"{ours}, {how}: times faster than the usual way, {solver}",
                    threads=threads,
                    aim=1000.0,
                    measured=times(
                        fastest(ours, objectives, threads), fastest(USUAL, (f"solve_ivp, {solver}",), 1)
                    ),
                )
                for ours in ("particle_swarm_constriction", "multistart", "identify")
                for solver in SOLVERS
                if found(ours, objectives, threads)
            ]
    bars += [
        Bar(
            claim=f"{each.method}: share of steps that an early abort spares",
            threads=each.threads,
            aim=0.5,
            measured=(1.0 - each.steps_share_done) if each.identical else None,
        )
        for each in aborts
    ]
    bars += [
        Bar(
            claim=f"share of seeds on which identify is near, {each.test}",
            threads=max(row.threads for row in rows),
            aim=0.95,
            measured=each.success,
        )
        for each in tests
    ]
    return bars
