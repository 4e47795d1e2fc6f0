"""The page of a run: what its fit says by itself, and what each later verb has added."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mrwork.identification.fit import Fit
from mrwork.identification.result import free_run
from mrwork.records import DamperTest
from mrwork.report.comparison import Comparison
from mrwork.report.fit.bands import band_section
from mrwork.report.fit.coverage import coverage_section
from mrwork.report.fit.identifiability import identifiability_section
from mrwork.report.fit.parameter_draws import parameter_draws
from mrwork.report.fit.plan import plan_section
from mrwork.report.fit.posterior import posterior_section
from mrwork.report.fit.ranking import ranking_section
from mrwork.report.fit.residuals import residual_section
from mrwork.report.fit.section import Absent, Section
from mrwork.report.html import identification_report
from mrwork.stored import StoredRun
from mrwork.uncertainty.choice.ranking import Ranking

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


_RANKING = Absent(
    title="Choice of model",
    command="mrwork identify TESTS --model all",
    says="compares families of models by what their fits have not seen, in a run of its own.",
)


_PLAN = Absent(
    title="Next test",
    command="mrwork plan RUN",
    says="ranks candidates for the next test by how much they would narrow a band.",
)


def comparisons_of(fit: Fit, tests: Sequence[DamperTest]) -> tuple[Comparison, ...]:
    """The tests of a fit, each with the force that its model gives; simulated where the fit was read from its file."""
    theta = np.array(fit.theta)
    forces = fit.forces or tuple(
        free_run(fit.spec, theta, test, nuisances=fit.nuisances)[0] for test in tests
    )
    return tuple(
        Comparison(test=test, model_force=force, quality=quality)
        for test, force, quality in zip(tests, forces, fit.quality, strict=True)
    )


def fit_page(
    fit: Fit,
    comparisons: Sequence[Comparison],
    stored: StoredRun | None = None,
    *,
    ranking: Ranking | None = None,
) -> str:
    """The page of a fit.

    Parameters
    ----------
    stored
        The run folder, whose additions are shown; without it none are.
    ranking
        Of the comparison that the fit came out of, where it is not in a run directory yet.
    """
    sections: list[Section] = []
    absent: list[Absent] = []
    profiles = None if stored is None else stored.profiles
    if fit.identifiability is not None:
        sections.append(identifiability_section(fit, fit.identifiability, profiles))
    if profiles is None:
        absent.append(_PROFILES)
    draws = None if stored is None else stored.draws
    if draws is not None:
        sections.append(posterior_section(fit, draws))
    else:
        absent.append(_POSTERIOR)
    sections.append(residual_section(comparisons))
    bands = None if stored is None else stored.bands
    if draws is not None or bands is not None:
        tests = [comparison.test for comparison in comparisons]
        section = band_section(fit, comparisons, parameter_draws(fit, tests, draws), bands)
        sections += [] if section is None else [section]
    if bands is not None:
        sections.append(coverage_section(bands))
    else:
        absent.append(_BANDS)
    if ranking is None and stored is not None:
        ranking = stored.ranking
    if ranking is not None:
        sections.append(ranking_section(ranking))
    else:
        absent.append(_RANKING)
    spec = fit.spec
    plan = None if stored is None else stored.plan
    if plan is not None:
        sections.append(plan_section(plan, None if spec.current is None else spec.current.unit))
    else:
        absent.append(_PLAN)
    return identification_report(
        fit,
        comparisons,
        model_title=spec.title,
        equation=spec.equation,
        source=spec.source,
        sections=sections,
        absent=absent,
    )
