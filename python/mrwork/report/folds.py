"""Fits made without some of a run's tests, kept beside it: whoever stops in the middle begins there again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mrwork.identification.fit import Fit
from mrwork.journal import digest_of
from mrwork.records import DamperTest
from mrwork.report.fit_json import fit_from_json, json_document
from mrwork.report.run_directory import FOLDS


class Folds:
    """The fits of one run, by the tests that they have seen."""

    def __init__(self, place: Path, fit: Fit) -> None:
        self._folder = place / FOLDS
        self._fit = fit

    def fit(self, tests: tuple[DamperTest, ...], identify: Callable[[], Fit]) -> Fit:
        """The fit to these tests: read where it was made before, else made and kept. Only a whole one is kept."""
        seen = [digest_of(test.dt, test.displacement, test.velocity, test.force) for test in tests]
        path = self._folder / f"{digest_of(self._fit.model, self._fit.theta, seen)[:16]}.json"
        if path.exists():
            return fit_from_json(path.read_text(encoding="utf-8"), origin=str(path))
        fit = identify()
        self._folder.mkdir(exist_ok=True)
        unfinished = path.with_suffix(".part")
        unfinished.write_text(json_document(fit.as_dict()), encoding="utf-8")
        unfinished.replace(path)
        return fit
