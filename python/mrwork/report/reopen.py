"""An identification opened again: its fit, and its tests as they were read then."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from mrwork.errors import RecordError
from mrwork.identification.fit import Fit
from mrwork.identification.reading import Reading
from mrwork.records import DamperTest
from mrwork.report.run_directory import FIT, read_fit

READING = "reading"


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenedRun:
    """The fit of a run directory, and its tests: cut, repaired and with their observation model as in the fit."""

    place: Path
    fit: Fit
    tests: tuple[DamperTest, ...]


def reopen(path: str | Path) -> OpenedRun:
    """Open the run directory at `path`, with the tests it was identified from.

    Raises
    ------
    RecordError
        Where it is no run directory, does not say how its tests were read, a file is gone, or one is not what it was.
    """
    place = Path(path)
    fit = read_fit(place)
    reading = Reading.of_record(fit.provenance.settings.get(READING), origin=str(place / FIT))
    tests = reading.tests()
    if len(tests) != len(fit.quality):
        raise RecordError(
            f"{place / FIT} judges {len(fit.quality)} tests where {len(tests)} were read; "
            "run `mrwork identify` again"
        )
    known = set(fit.provenance.inputs.values())
    for test, quality in zip(tests, fit.quality, strict=True):
        if test.sha256 not in known:
            raise RecordError(
                f"{test.path or test.name} has changed since {place} was identified from it; "
                "bring back the file as it was, or run `mrwork identify` again"
            )
        if test.n_time - test.n_settle != quality.n_time:
            raise RecordError(
                f"{test.path or test.name}: {test.n_time - test.n_settle} samples count where {quality.n_time} did "
                f"when {place} was identified; run `mrwork identify` again with this version"
            )
    observed = tuple(
        replace(test, observation=quality.observation)
        for test, quality in zip(tests, fit.quality, strict=True)
    )
    return OpenedRun(place=place, fit=fit, tests=observed)
