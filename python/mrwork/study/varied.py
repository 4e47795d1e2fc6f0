"""Results of a study over realisations of what is uncertain: bands of criteria, ratios and scores."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.closed_loop.evaluation import SCORE, criteria, ratio
from mrwork.store import Journal
from mrwork.study.batches import Band, RunCriteria, simulated_criteria
from mrwork.study.realisations import Realisations
from mrwork.study.study import Arrangement, Study, digest_of_run
from mrwork.summary import Summarised

Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class VariedResults(Summarised):
    """Criteria over `count` realisations, by row of a study, for the rows that are done."""

    count: int
    rows: Mapping[int, RunCriteria]

    def bands(self, row: int, motion: int) -> dict[str, Band]:
        """Bands of every criterion of a row under a motion; none for a row that is not done."""
        found = self.rows.get(row)
        if found is None:
            return {}
        return {entry.name: Band.of(found.of(entry.name)[0, motion]) for entry in criteria()}

    def ratio_band(self, row: int, reference: int | None, motions: Sequence[int], name: str) -> Band | None:
        """Band of the mean over motions of a criterion over that of a reference row in the same realisation."""
        ratios = self._ratios(row, reference, motions, name)
        return None if ratios is None else Band.of(ratios)

    def score_band(self, row: int, reference: int | None, motions: Sequence[int]) -> Band | None:
        """Band of the score over some motions, against a reference row in the same realisation."""
        parts = [self._ratios(row, reference, motions, name) for name in SCORE]
        known = [each for each in parts if each is not None]
        return Band.of(np.mean(known, axis=0)) if len(known) == len(SCORE) else None

    def scores(self, labels: Sequence[str], reference: int | None, motions: Sequence[int]) -> dict[str, Band]:
        """Bands of the scores of all rows by their labels."""
        found = {label: self.score_band(row, reference, motions) for row, label in enumerate(labels)}
        return {label: band for label, band in found.items() if band is not None}

    def _ratios(self, row: int, reference: int | None, motions: Sequence[int], name: str) -> Floats | None:
        above, below = self.rows.get(row), None if reference is None else self.rows.get(reference)
        if above is None or below is None:
            return None
        chosen = list(motions)
        return np.asarray(ratio(above.of(name)[0, chosen], below.of(name)[0, chosen]).mean(axis=0))


def varied_criteria(
    study: Study,
    arrangement: Arrangement,
    realisations: Realisations,
    journal: Journal | None,
    *,
    threads: int,
) -> RunCriteria:
    """Criteria of an arrangement under all motions of a study with realisations, from the journal if it has them."""
    law = arrangement.law
    assert law is not None

    def simulated() -> RunCriteria:
        return simulated_criteria(
            arrangement,
            law,
            study.grounds,
            study.hardware,
            realisations,
            bare=study.building,
            threads=threads,
        )

    if journal is None:
        return simulated()
    return journal.once("realisations", digest_of_run(arrangement, *study.grounds), RunCriteria, simulated)
