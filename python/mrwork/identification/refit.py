"""The same identification on other tests."""

from __future__ import annotations

from collections.abc import Callable

from mrwork.identification.fit import Fit
from mrwork.identification.identify import identify
from mrwork.identification.multistart import Multistart
from mrwork.identification.run import Progress
from mrwork.records import DamperTest
from mrwork.search import EfficientGA


def identify_again(
    fit: Fit,
    tests: tuple[DamperTest, ...],
    *,
    threads: int = 0,
    on_progress: Callable[[Progress], bool | None] | None = None,
) -> Fit:
    """Identify from other tests with the model, bounds, nuisances, power and seed of an earlier fit.

    The search has its kind and size, but neither the earlier fit nor its starts to begin from: these have seen tests
    that may have been left out.
    """
    settings = fit.provenance.settings
    asked = settings["search"]
    search = EfficientGA(population=asked["population"]) if "population" in asked else Multistart(**asked)
    return identify(
        fit.spec,
        tests,
        search=search,
        bounds={name: (lower, upper) for name, (lower, upper) in settings["bounds"].items()},
        nuisances=fit.nuisances,
        power=settings["power"],
        rng=fit.provenance.rng,
        threads=threads,
        on_progress=on_progress,
    )
