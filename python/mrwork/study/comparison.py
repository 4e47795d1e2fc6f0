"""Comparison of the rows of a study: changes of each quantity against a reference, ranks, and groups of motions.

A score hides what became worse. So the change of every quantity comes first, against the building without dampers and
against the best passive damper, and dampers with a constant command are ranked apart from control laws. Scores stand on
the test motions of a study; training motions are shown beside them where they were simulated, too.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mrwork.base.arguments import checked
from mrwork.base.numbers import NOTHING, counted, format_fixed, significant
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.table import Table
from mrwork.base.values import Floats
from mrwork.closed_loop.evaluation import Criterion, criteria, criterion, is_within_spread, ties_in_words
from mrwork.study.damper_size import shares_in_words
from mrwork.study.results import StudyResults
from mrwork.study.row_kinds import LAWS, RANKS, ROW_KINDS, Rank
from mrwork.study.storeys import limits_in_words

BOTH = ("peak_drift", "peak_acceleration")
"""Criteria that a law must lower together to be better than a constant command."""


def times_better(results: StudyResults, row: int, reference: int, names: Sequence[str] = BOTH) -> int | None:
    """Under how many judged motions all these criteria of a row are lower than with a reference row.

    `None` if a run did not finish.
    """
    ratios = results.ratios_over(reference)
    judged = np.array([ratios[name][row, list(results.judged_motions)] for name in names])
    return None if np.isnan(judged).any() else int((judged < 1.0).all(axis=0).sum())


def compared_quantities() -> tuple[Criterion, ...]:
    """The criteria whose change against a reference is meaningful."""
    return tuple(entry for entry in criteria() if entry.ratio)


@dataclass(frozen=True, slots=True, kw_only=True)
class QuantityChange:
    """Change of a quantity relative to a reference, -0.2 for 20 % less: mean over the test motions, and the largest.

    `motion` is the name of the motion of the largest. NaN and `None` if a run is missing or did not finish.
    """

    mean: float
    largest: float
    motion: str | None

    @property
    def worse(self) -> bool:
        """Whether the mean increases."""
        return rounds_to_increase(self.mean)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Comparison(Summarised):
    """A study row by row: its ranks, the best passive damper, and the row that leads.

    `ranks` are the rows of each rank, the lowest score first; rows without a score last, in the order of the study.
    `uncontrolled` is the building without dampers, `passive` the passive damper of the lowest score with one share of
    the largest commands, `leading` the first control law; without one, the best passive damper or other device. The
    last two are `None` if there is no such row. `tables` are the changes of the compared quantities by name, for each
    (row, reference).
    """

    results: StudyResults
    ranks: tuple[tuple[Rank, tuple[int, ...]], ...]
    uncontrolled: int
    passive: int | None
    leading: int | None
    tables: Mapping[tuple[int, int], dict[str, QuantityChange]]

    def _summary(self) -> Summary:
        rows = range(len(self.results.rows))
        return Summary(
            title=f"{self.results.title}: changes",
            facts=[("leading", self.heading)] if self.heading else [],
            tables=[change_table(self, reference, rows) for reference in self.references],
        )

    @property
    def references(self) -> tuple[int, ...]:
        """The building without dampers and the best passive damper, if the study has one."""
        return (self.uncontrolled,) if self.passive is None else (self.uncontrolled, self.passive)

    @property
    def constants(self) -> tuple[int, ...]:
        """The rows of one constant command that tables always show, the best of them first."""
        kinds = [kind for kind, what in ROW_KINDS.items() if what.is_reference]
        rows = (self.passive, *map(self.results.row_of, reversed(kinds)))
        return tuple(dict.fromkeys(row for row in rows if row is not None))

    @property
    def heading(self) -> str:
        """The row that leads, among how many of its rank, and over what its changes are averaged."""
        if self.leading is None:
            return ""
        rank, rows = next((rank, rows) for rank, rows in self.ranks if self.leading in rows)
        parts = [self.results.rows[self.leading].label]
        if len(rows) > 1 and math.isfinite(self.results.score(self.leading).mean):
            parts.append(f"lowest score of {len(rows)} {small_first(rank.title)}")
        if len(self.results.judged_motions) > 1:
            parts.append(f"mean changes over {self.results.motions.in_words}")
        return ", ".join(parts)


# Share of the time, and of the command, up to which a command counts as constant.
_CONSTANT = 0.01


def results_in_words(results: StudyResults) -> tuple[str, ...]:
    """Sentences on the best constant command, on the force of the dampers, on laws that send a constant command.

    And on the drift limit, and scores that the motions do not tell apart.
    """
    return (
        *results.choices,
        *shares_in_words(results),
        *limits_in_words(results),
        *(
            f"{row.label} under every motion: {words}."
            for number, row in enumerate(results.rows)
            if row.what.rank is LAWS and (words := constant_in_words(results, number))
        ),
        *_ties(compared(results)),
    )


def constant_in_words(results: StudyResults, row: int) -> str:
    """What a row is in effect that sends one command under all motions; empty where it sends others, or is not known.

    A command is constant, to a hundredth, where its mean square and squared mean agree.
    """
    dampers, quantities = results.dampers, results.quantities.numbers
    largest = np.array([damper.largest_command for damper in dampers])
    if not (largest.size and results.finished_under(row, range(len(results.motions)))):
        return ""
    means, rms = (quantities[name][row, :, 0, : largest.size] for name in ("mean_current", "rms_current"))
    command = means.mean(axis=0)
    if (rms <= _CONSTANT * largest).all():
        return "idle: sends no command, as passive-off"
    steady = (np.square(rms) - np.square(means) <= _CONSTANT * np.square(rms)).all()
    if not (steady and (np.abs(means - command) <= _CONSTANT * largest).all()):
        return ""
    if (command >= (1.0 - _CONSTANT) * largest).all():
        return "coincides with passive-on"
    sent = zip(command.tolist(), dampers, strict=True)
    words = dict.fromkeys(f"{value:.3g} {damper.command_unit}" for value, damper in sent)
    return f"a constant command in effect, {', '.join(words)}"


def verdict(comparison: Comparison, row: int) -> str:
    """What a control law is worth beside the best passive damper, in words; without one, beside no dampers."""
    results = comparison.results
    judged = results.judged_motions
    ended = [motion for motion in judged if row not in results.finished_rows(motion)]
    if ended:
        more = f" and {len(ended) - 1} more" if len(ended) > 1 else ""
        return f"did not finish under {results.motions[ended[0]].name}{more}"
    if constant := constant_in_words(results, row):
        return constant
    reference, motions = comparison.references[-1], counted(len(judged), "motion")
    if results.has_own_score:
        scores = (
            np.array([results.score(each, (motion,)).mean for motion in judged]) for each in (row, reference)
        )
        lower = int(np.less(*scores).sum())
        tied = comparison.passive is not None and is_tied(results, row, reference)
        return f"lower score on {lower} of {motions}{'; equal within the spread' if tied else ''}"
    counts = [times_better(results, row, reference, names) for names in (BOTH[:1], BOTH[1:], BOTH)]
    if None in counts:
        return f"{results.rows[reference].label} did not finish under every motion"
    drift, acceleration, both = counts
    text = f"better in drift on {drift}, in acceleration on {acceleration} of {motions}"
    if both == len(judged):
        text = f"better in both peaks on {motions}"
    against = "" if comparison.passive is not None else " against no dampers"
    tied = comparison.passive is not None and is_tied(results, row, reference)
    return f"{text}{against}{'; equal within the spread' if tied else ''}"


def peaks_in_words(changes: Mapping[str, Floats]) -> str:
    """Mean change of each peak, with the range over the motions, shape (n_motions,)."""
    if not all(np.isfinite(change).all() for change in changes.values()):
        return "a run did not finish"
    parts = []
    for name, change in changes.items():
        least, mean, most = (
            signed_percent(float(end)) for end in (change.min(), change.mean(), change.max())
        )
        ends = f" ({least} to {most} %)" if change.size > 1 else ""
        parts.append(f"{name.replace('_', ' ')} {mean} %{ends}")
    return ", ".join(parts)


def beaten_in_words(law: str, constant: str, changes: Mapping[str, Floats]) -> str:
    """Whether a law lowers both peaks against a constant command; if not, it is the law of the lowest score."""
    peaks = peaks_in_words(changes)
    if not all(np.isfinite(change).all() for change in changes.values()):
        return f"{law} has no mean change against {constant}: {peaks}"
    if lowers_all(changes):
        return f"{law} lowers both peaks against {constant}: {peaks}"
    return f"No law lowers both peaks against {constant}. {law}, the law with the lowest score: {peaks}"


def scored_in_words(results: StudyResults, row: int, reference: int, constant: str) -> str:
    """Whether a row has a lower score than a constant command, by the criteria that the study states."""
    label, judged_by = results.rows[row].label, list_names([criterion(name).short for name in results.scored])
    own, other = (results.score(each).mean for each in (row, reference))
    if not np.isfinite([own, other]).all():
        return f"{label} has no score against {constant}: a run did not finish"
    numbers = f"{own:.3f} for {other:.3f} ({judged_by}, over i = 0)"
    if own < other:
        return f"{label} has the lowest score, below {constant}: {numbers}"
    return f"No law has a lower score than {constant}. {label}, the best of them: {numbers}"


def lowers_all(changes: Mapping[str, Floats]) -> bool:
    """Whether the mean of every change is a decrease in whole per cent, as sentences show it."""
    return all(rounds_to_increase(-float(change.mean())) for change in changes.values())


def is_tied(results: StudyResults, row: int, reference: int) -> bool:
    """Whether the scores of two rows are not told apart by the motions."""
    return is_within_spread(np.subtract(_scores(results, reference), _scores(results, row)))


def _scores(results: StudyResults, row: int) -> list[float]:
    """Scores of a row under each record, at all its levels together, which are no evidence of their own."""
    places, judged = results.motions.by_record.places, results.judged_motions
    return [results.score(row, tuple(motions[np.isin(motions, judged)].tolist())).mean for motions in places]


def _ties(comparison: Comparison) -> tuple[str, ...]:
    results = comparison.results
    laws = next((rows for rank, rows in comparison.ranks if rank is LAWS), ())
    if not laws or len(results.judged_motions) < 2:
        return ()
    rows = (*laws, *([] if comparison.passive is None else [comparison.passive]))
    scores = {results.rows[row].label: _scores(results, row) for row in rows}
    leading = results.rows[laws[0]].label
    several = len(results.motions.by_record.records) < len(results.judged_motions)
    noun = "records" if several else "motions"
    return ties_in_words(leading, scores.pop(leading), scores, noun)


@checked
def compared(results: StudyResults) -> Comparison:
    """The comparison of the rows of a study."""
    scores = [results.score(row).mean for row in range(len(results.rows))]
    # The best constant command comes before one that is the same by another name.
    best = results.row_of("best_passive")
    order = sorted(range(len(scores)), key=lambda row: (math.isnan(scores[row]), scores[row], row != best))
    every = ((rank, tuple(row for row in order if results.rows[row].what.rank is rank)) for rank in RANKS)
    ranks = tuple((rank, rows) for rank, rows in every if rows)
    uncontrolled = [row.kind for row in results.rows].index("uncontrolled")
    passive = next((row for row in order if results.rows[row].what.is_reference), None)
    return Comparison(
        results=results,
        ranks=ranks,
        uncontrolled=uncontrolled,
        passive=passive,
        leading=next((rows[0] for _, rows in ranks if rows[0] != uncontrolled), None),
        tables={
            (row, reference): changes
            for reference in (uncontrolled, passive)
            if reference is not None
            for row, changes in enumerate(_changes(results, reference))
        },
    )


def rounds_to_increase(change: float) -> bool:
    """Whether a change is an increase in whole percent, as tables show it."""
    return change > 0.005


def signed_percent(change: float) -> str:
    """A change in whole per cent with its sign; a dash if it is not known."""
    text = format_fixed(100.0 * change, 0)
    return f"+{text}" if rounds_to_increase(change) else text


def _changes(results: StudyResults, reference: int) -> Iterator[dict[str, QuantityChange]]:
    judged = list(results.judged_motions)
    changes = {name: ratio[:, judged] - 1.0 for name, ratio in results.ratios_over(reference).items()}

    def change(of_row: Floats) -> QuantityChange:
        if not of_row.size or np.isnan(of_row).any():
            return QuantityChange(mean=math.nan, largest=math.nan, motion=None)
        largest = int(of_row.argmax())
        return QuantityChange(
            mean=math.fsum(of_row) / of_row.size,
            largest=float(of_row[largest]),
            motion=results.motions[judged[largest]].name,
        )

    for row in range(len(results.rows)):
        yield {entry.name: change(changes[entry.name][row]) for entry in compared_quantities()}


def small_first(title: str) -> str:
    """A title within a sentence."""
    return title if title[:2].isupper() else title[:1].lower() + title[1:]


def best_cells(
    results: StudyResults,
    rows: Sequence[int],
    columns: Sequence[Sequence[float]],
    printed: Callable[[float], str] = lambda number: significant(number, 3),
) -> frozenset[tuple[int, int]]:
    """Cells with the smallest printed number of each column, among the rows of each rank; none of a rank of one."""
    strong = set()
    for rank in RANKS:
        candidates = [line for line, row in enumerate(rows) if results.rows[row].what.rank is rank]
        for cell, column in enumerate(columns, start=1):
            values = [column[line] for line in candidates if not math.isnan(column[line])]
            if len(values) > 1:
                least = printed(min(values))
                strong |= {(line, cell) for line in candidates if printed(column[line]) == least}
    return frozenset(strong)


def change_table(comparison: Comparison, reference: int, shown: Collection[int]) -> Table:
    """The changes of the shown rows against a reference, the rows of each rank together."""
    results, quantities = comparison.results, compared_quantities()
    several = len(results.judged_motions) > 1
    # The rows of each rank together, the lowest score first.
    rows = [row for _, ranked in comparison.ranks for row in ranked if row in shown and row != reference]
    changes = [comparison.tables[row, reference] for row in rows]
    columns = [[of_row[entry.name].mean for of_row in changes] for entry in quantities]
    average = f", mean over {results.motions.in_words}" if several else ""
    of_laws = [
        comparison.tables[number, reference]
        for number, row in enumerate(results.rows)
        if row.what.rank is LAWS
    ]
    worse = (sum(of_row[entry.name].worse for of_row in of_laws) for entry in quantities)
    foot = (f"Worse control laws, of {len(of_laws)}", *(format_fixed(count, 0) for count in worse))
    return Table(
        label=f"Change in % against {results.rows[reference].label}{average}",
        columns=("", *(entry.short for entry in quantities), *(["Largest increase"] if several else [])),
        rows=tuple(
            (
                results.rows[row].label,
                *(signed_percent(column[line]) for column in columns),
                *([_largest(changes[line], quantities)] if several else []),
            )
            for line, row in enumerate(rows)
        ),
        foot=(*foot, *([""] if several else [])) if len(of_laws) > 1 else (),
        strong=best_cells(results, rows, columns, signed_percent),
        alarming=frozenset(
            (line, cell)
            for cell, column in enumerate(columns, start=1)
            for line, mean in enumerate(column)
            if rounds_to_increase(mean)
        ),
        headings=rank_headings(comparison, rows),
        note=f"Change in per cent{average}; increases are coloured, and the best of each kind is bold. Peaks unless "
        "stated otherwise." + (" The largest increase is of a quantity under one motion." if several else ""),
    )


def _largest(changes: dict[str, QuantityChange], quantities: tuple[Criterion, ...]) -> str:
    """The largest increase of a quantity under one motion; empty if none increases."""
    known = [entry for entry in quantities if not math.isnan(changes[entry.name].mean)]
    if not known:
        return NOTHING
    entry = max(known, key=lambda entry: changes[entry.name].largest)
    worst = changes[entry.name]
    rises = rounds_to_increase(worst.largest)
    return f"{entry.short} {signed_percent(worst.largest)}, {worst.motion}" if rises else "none"


def rank_headings(comparison: Comparison, rows: Sequence[int]) -> dict[int, str]:
    """Title of each rank, by the place of its first row."""
    return {
        rows.index(shown[0]): rank.title
        for rank, members in comparison.ranks
        if (shown := [row for row in members if row in rows])
    }
