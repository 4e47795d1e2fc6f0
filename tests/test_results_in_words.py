"""What results say of themselves: singular and plural, reasons in words, empty columns left out."""

import re
from dataclasses import replace

import numpy as np
import pytest
import study_samples
from sinusoidal_tests import sinusoidal_test

import mrwork as mr
from mrwork.report.fit.parameter_sections import caution  # the one sentence of the page on standard errors
from mrwork.search import EfficientGA, StopRules, run_search
from mrwork.search.rules import ended_in_words

pytestmark = pytest.mark.words


def test_a_search_says_in_words_why_it_ended() -> None:
    optimiser = EfficientGA(population=8, stop=StopRules(max_generations=3))
    found = run_search(optimiser, lambda unit: np.sum(unit**2, axis=-1), rng=1, n_params=2)
    assert found.stop_reason == "max_generations"
    assert ended_in_words(found.stop_reason) == "at the limit of generations"
    assert "at the limit of generations, after 3 generations" in repr(found)
    assert found.stop_reason not in repr(found)


def test_the_results_of_a_study_say_which_motions_are_training() -> None:
    results = study_samples.many_motions()
    shown = repr(results)
    for use in ("test", "training"):
        first = next(each.name for each in results.motions if each.use == use)
        assert re.search(rf"{use} motions +{re.escape(first)}", shown), shown
    # Of one use alone nothing is said of the other.
    assert "training" not in repr(study_samples.results())


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_only_the_test_of_the_residuals_calls_them_correlated(noise: float) -> None:
    test = sinusoidal_test("bingham", (400.0, 1e-3, 900.0, 0.0), (0.01, 1.0), noise=noise)
    fit = mr.identify("bingham", replace(test, name="a"), rng=1, threads=1)
    assert "correlated" not in caution(fit)
