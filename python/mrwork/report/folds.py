"""Fits made without some of a run's tests, kept beside it: whoever stops in the middle begins there again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.report.additions import add_to_run
from mrwork.report.fit_json import fit_from_json
from mrwork.report.run_directory import FOLDS
from mrwork.store import digest_of


class Folds:
    """The fits of one run, by the tests that they have seen."""

    def __init__(self, place: Path, fit: Fit) -> None:
        self._place = place
        self._fit = fit

    def fit(self, tests: tuple[DamperTest, ...], identify: Callable[[], Fit]) -> Fit:
        """The fit to these tests: read where it was made before, else made and kept. Only a whole one is kept."""
        seen = [digest_of(test.dt, test.displacement, test.velocity, test.force) for test in tests]
        path = self._place / FOLDS / f"{digest_of(self._fit.model, self._fit.theta, seen)[:16]}.json"
        if path.exists():
            return fit_from_json(path.read_text(encoding="utf-8"), origin=str(path))
        fit = identify()
        add_to_run(self._place, f"{FOLDS}/{path.name}", fit.as_dict(), {})
        return fit
