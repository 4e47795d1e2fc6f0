"""A family whose fit has collapsed to a simpler one counts as that one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from sinusoidal_tests import sinusoidal_test

from mrwork import identify
from mrwork.dampers import damper
from mrwork.identification import Fit, Multistart
from mrwork.records import DamperTest
from mrwork.uncertainty.choice.leave_one_out import free_parameters, residuals_of, variance_of
from mrwork.uncertainty.choice.ranking import Collapse, Evidence, find_collapses, rank

FEW = Multistart(samples=10, starts=4, most_rounds=2, found=2)
SIMPLE, RICH = "normalised_bouc_wen", "non_symmetric_bouc_wen"
N_EFFECTIVE = 100.0


def fits_of(test: DamperTest) -> dict[str, Fit]:
    return {model: identify(model, test, search=FEW, threads=1) for model in (SIMPLE, RICH)}


def collapses(fits: dict[str, Fit], test: DamperTest) -> dict[str, Collapse]:
    return find_collapses(
        fits,
        {model: residuals_of(fit, (test,)) for model, fit in fits.items()},
        {model: free_parameters(fit) for model, fit in fits.items()},
        (test,),
        N_EFFECTIVE,
    )


@pytest.fixture(scope="module")
def test() -> DamperTest:
    """A record of the Bouc-Wen model, with noise that a richer model can follow a little."""
    return sinusoidal_test(SIMPLE, damper(SIMPLE).nominal, (0.01, 1.0), noise=0.05, rng=1)


@pytest.fixture(scope="module")
def fits(test: DamperTest) -> dict[str, Fit]:
    return fits_of(test)


def test_a_fit_with_the_force_of_a_simpler_family_and_doubtful_parameters_has_collapsed(
    fits: dict[str, Fit], test: DamperTest
) -> None:
    found = collapses(fits, test)
    assert {model: each.model for model, each in found.items()} == {RICH: SIMPLE}
    assert "Bouc-Wen to " in found[RICH].reason
    assert "share" in found[RICH].reason
    assert found[RICH].reason.endswith(("undetermined", "on a bound"))


def test_it_is_not_chosen_though_it_would_be_without_the_rule(fits: dict[str, Fit], test: DamperTest) -> None:
    same = collapses(fits, test)
    evidence = [
        Evidence(
            model=model,
            title=fit.spec.title,
            n_params=free_parameters(fit),
            status=fit.status,
            seconds=1.0,
            fit_percent=fit.fit_percent,
            left_out=(left_out,),
            variance=variance_of(fit, (test,)),
        )
        for (model, fit), left_out in zip(fits.items(), (0.06, 0.05), strict=True)
    ]
    without = rank(evidence, N_EFFECTIVE)
    assert [(each.model, each.verdict) for each in without] == [(RICH, "chosen"), (SIMPLE, "behind")]
    # BIC prefers the simpler family.
    assert without[0].bic_behind > 8.0
    ranked = rank([replace(each, collapse=same.get(each.model)) for each in evidence], N_EFFECTIVE)
    assert [(each.model, each.verdict, each.same_as) for each in ranked] == [
        (SIMPLE, "chosen", ""),
        (RICH, "collapsed", SIMPLE),
    ]


def test_a_richer_family_that_the_data_need_has_not_collapsed() -> None:
    spec = damper(RICH)
    values = dict(zip(spec.names, spec.nominal, strict=True))
    needed = sinusoidal_test(RICH, tuple(values.values()), (0.01, 1.0), noise=0.005, rng=2)
    fits = fits_of(needed)
    assert np.sqrt(variance_of(fits[SIMPLE], (needed,))) > 2.0 * np.sqrt(variance_of(fits[RICH], (needed,)))
    assert collapses(fits, needed) == {}


def test_a_worse_fit_of_doubtful_parameters_to_another_force_is_no_collapse(
    fits: dict[str, Fit], test: DamperTest
) -> None:
    residuals = {model: residuals_of(fit, (test,)) for model, fit in fits.items()}
    away = tuple(each + 0.1 * np.sin(np.arange(each.size)) for each in residuals[RICH])
    found = find_collapses(
        fits,
        {SIMPLE: residuals[SIMPLE], RICH: away},
        {SIMPLE: 7, RICH: 10},
        (test,),
        N_EFFECTIVE,
    )
    assert found == {}
