"""Results of the study on one set of tests."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from mrwork.search import EfficientGA
from studies.chapter_5.current_laws import (
    STATIC,
    WITH_LAWS,
    LawComparison,
    Laws,
    Model,
    PerCurrent,
    compare_laws,
    identify_each,
    laws_of,
)
from studies.chapter_5.damper_tests import TestSet


@dataclass(frozen=True, slots=True, kw_only=True)
class SetOutcome:
    """Fits and laws by the label of the model; `true_laws` where the static hysteretic model is the truth."""

    tests: TestSet
    each: dict[str, PerCurrent]
    laws: dict[str, LawComparison]
    true_laws: Laws | None


def study_set(
    tests: TestSet,
    *,
    models: tuple[Model, ...],
    search: EfficientGA,
    rng: int,
    on_progress: Callable[[str], None],
) -> SetOutcome:
    """Identify every model at each current, and the laws of those that have them."""
    each = {
        model.label: identify_each(model, tests, search=search, rng=rng, on_progress=on_progress)
        for model in models
    }
    laws = {
        model.label: compare_laws(each[model.label], tests, search=search, rng=rng, on_progress=on_progress)
        for model in models
        if model in WITH_LAWS
    }
    true = None if tests.coefficients is None else laws_of(STATIC, tests.coefficients, tests)
    return SetOutcome(tests=tests, each=each, laws=laws, true_laws=true)
