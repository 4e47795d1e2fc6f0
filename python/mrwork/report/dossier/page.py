"""The page of a run: what its fit says by itself, and what each later verb has added."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from mrwork.identification.fit import Fit
from mrwork.identification.judge import judge
from mrwork.records import DamperTest
from mrwork.report.comparison import Comparison
from mrwork.report.dossier.bands import band_section
from mrwork.report.dossier.coverage import coverage_section
from mrwork.report.dossier.identifiability import identifiability_section
from mrwork.report.dossier.parameter_draws import parameter_draws
from mrwork.report.dossier.posterior import posterior_section
from mrwork.report.dossier.residuals import residual_section
from mrwork.report.dossier.section import Absent, Section
from mrwork.report.dossier.stored_bands import read_bands
from mrwork.report.dossier.stored_draws import read_draws
from mrwork.report.fit_json import record_from_json
from mrwork.report.html import identification_report
from mrwork.report.run_directory import PROFILES
from mrwork.uncertainty.profile import Profiles

_PROFILES = Absent(
    title="Profiles",
    command="mrwork profile RUN",
    says="gives each parameter an interval by profile likelihood, which stays open where the data set no bound.",
)
_POSTERIOR = Absent(
    title="Posterior",
    command="mrwork sample RUN",
    says="samples the parameters that the data allow: intervals, pairs that cannot be told apart.",
)
_BANDS = Absent(
    title="Prediction bands",
    command="mrwork calibrate RUN TESTS",
    says="measures on tests that the fit has not seen how far its force is off, and draws bands from that; without "
    "tests the run's own are left out in turn.",
)


def comparisons_of(fit: Fit, tests: Sequence[DamperTest]) -> tuple[Comparison, ...]:
    """The tests of a fit, each with the force that its model gives."""
    theta = np.array(fit.theta)
    return tuple(
        Comparison(
            test=test, model_force=judge(fit.spec, theta, test, nuisances=fit.nuisances)[0], quality=quality
        )
        for test, quality in zip(tests, fit.quality, strict=True)
    )


def dossier_page(fit: Fit, comparisons: Sequence[Comparison], place: Path | None = None) -> str:
    """The page of a fit.

    Parameters
    ----------
    place
        The run directory whose additions are shown; without it none are.

    Raises
    ------
    RecordError
        Where an addition is damaged.
    """
    sections: list[Section] = []
    absent: list[Absent] = []
    profiles = _profiles(place)
    if fit.identifiability is not None:
        sections.append(identifiability_section(fit, fit.identifiability, profiles))
    if profiles is None:
        absent.append(_PROFILES)
    draws = None if place is None else read_draws(place, fit)
    if draws is not None:
        sections.append(posterior_section(fit, draws))
    else:
        absent.append(_POSTERIOR)
    sections.append(residual_section(comparisons))
    bands = None if place is None else read_bands(place)
    if draws is not None or bands is not None:
        tests = [comparison.test for comparison in comparisons]
        section = band_section(fit, comparisons, parameter_draws(fit, tests, draws), bands)
        sections += [] if section is None else [section]
    if bands is not None:
        sections.append(coverage_section(bands))
    else:
        absent.append(_BANDS)
    spec = fit.spec
    return identification_report(
        fit,
        comparisons,
        model_title=spec.title,
        equation=spec.equation,
        source=spec.source,
        sections=sections,
        absent=absent,
    )


def _profiles(place: Path | None) -> Profiles | None:
    if place is None or not (place / PROFILES).is_file():
        return None
    path = place / PROFILES
    return record_from_json(
        Profiles, path.read_text(encoding="utf-8"), origin=str(path), name="profiles", verb="profile"
    )
