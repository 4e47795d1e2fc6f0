"""A run folder as one value: the fit, and what later verbs have added to it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from mrwork.errors import RecordError
from mrwork.identification.fit import Fit
from mrwork.report.calibration_json import read_calibration
from mrwork.report.fit_json import Record, record_from_json
from mrwork.report.run_directory import CALIBRATION, FIT, PLAN, PROFILES, RANKING, read_fit
from mrwork.report.stored_draws import StoredDraws, read_draws
from mrwork.summary import Summarised, Summary
from mrwork.uncertainty.bands.conformal import Calibration
from mrwork.uncertainty.choice.verdict import Ranking
from mrwork.uncertainty.identifiability.profile import Profiles
from mrwork.uncertainty.planning.plan_draws import Check

_STUDY = "results.json"


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class StoredRun(Summarised):
    """What the run folder at `place` holds; what no verb has added is `None`.

    `draws` are of `mrwork sample`, `profiles` of `mrwork profile`, `calibration` of `mrwork calibrate`, `plan` of
    `mrwork plan`, `ranking` of `mrwork identify` with several models.
    """

    place: Path
    fit: Fit
    draws: StoredDraws | None
    profiles: Profiles | None
    calibration: Calibration | None
    plan: Check | None
    ranking: Ranking | None

    def _summary(self) -> Summary:
        added = ("draws", "profiles", "calibration", "plan", "ranking")
        held = [name for name in added if getattr(self, name) is not None]
        fit = self.fit._summary()
        return Summary(
            title=f"Run {self.place.name}: {fit.title}",
            facts=(("folder", str(self.place)), ("holds", ", ".join(["fit", *held])), *fit.facts),
            columns=fit.columns,
            rows=fit.rows,
        )


def load(run: str | Path) -> StoredRun:
    """Read back what a run folder holds.

    Parameters
    ----------
    run
        The folder that `mrwork identify` has written.

    Raises
    ------
    RecordError
        Where it is no run folder, or one of its files is damaged; the message names the file.

    Examples
    --------
    >>> import mrwork as mr
    >>> run = mr.load("out/demo")  # doctest: +SKIP
    >>> run.fit.fit_percent, run.draws is None  # doctest: +SKIP
    (99.41, True)
    """
    place = Path(run)
    if not (place / FIT).exists() and (place / _STUDY).is_file():
        raise RecordError(
            f"{place} is the folder of a study, and a run of `mrwork identify` was expected; "
            f"read its {_STUDY}, or give it to `mrwork respond --resume`"
        )
    fit = read_fit(place)
    return StoredRun(
        place=place,
        fit=fit,
        draws=read_draws(place, fit),
        profiles=read_addition(Profiles, place, PROFILES, name="profiles", verb="profile"),
        calibration=read_calibration(place) if (place / CALIBRATION).is_file() else None,
        plan=read_addition(Check, place, PLAN, name="plan", verb="plan"),
        ranking=read_addition(Ranking, place, RANKING, name="ranking", verb="identify"),
    )


def read_addition(
    kind: type[Record], place: Path | None, file: str, *, name: str, verb: str
) -> Record | None:
    """What a verb has left in a run folder, if it has."""
    if place is None or not (place / file).is_file():
        return None
    text = (place / file).read_text(encoding="utf-8")
    return record_from_json(kind, text, origin=str(place / file), name=name, verb=verb)
