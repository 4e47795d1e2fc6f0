"""Prior densities against SciPy, and the syntax of the command line."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import lognorm, norm, uniform
from sentences import Refused

from mrwork.uncertainty.posterior.target import parse_prior

VALUES = np.array([-1.0, 0.3, 2.0, 7.0])


@pytest.mark.parametrize(
    ("text", "known"),
    [
        ("c=normal:2:3", norm(2.0, 3.0)),
        ("c=lognormal:2:0.5", lognorm(0.5, scale=2.0)),
        ("c=uniform:0:5", uniform(0.0, 5.0)),
    ],
)
def test_a_prior_is_the_density_it_is_called(text: str, known: object) -> None:
    name, prior = parse_prior(text)
    assert name == "c"
    np.testing.assert_allclose(prior.log_density(VALUES), known.logpdf(VALUES), rtol=1e-13)  # type: ignore[attr-defined] # a distribution of SciPy


def test_another_form_is_refused_with_the_forms_there_are(refused: Refused) -> None:
    for text in (
        "c",
        "c=normal",
        "=normal:1:2",
        "c=cauchy:1:2",
        "c=normal:1:x",
        "c=normal:1:2:3",
        "c=normal:1:inf",
    ):
        refused(parse_prior, text)


def test_numbers_that_make_no_density_are_refused(refused: Refused) -> None:
    for text in ("c=normal:1:0", "c=lognormal:-1:1", "c=uniform:2:1"):
        refused(parse_prior, text)
