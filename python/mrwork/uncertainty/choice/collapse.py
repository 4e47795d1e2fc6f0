"""Collapsed fits: a family of models whose fit is that of a simpler family in the same comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mrwork.dampers.coordinates import Box
from mrwork.dampers.spec import damper
from mrwork.identification.fit import Fit
from mrwork.records import DamperTest
from mrwork.uncertainty.identifiability.curvature import Scale

# Residuals of each test, in deviations of its force, shape (n_counted,).
Residuals = Sequence[NDArray[np.float64]]

# Gain in the log-likelihood ratio, for each further parameter, that is not more than chance (Akaike's criterion).
_CHANCE = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Collapse:
    """The simpler family, `model`, that gives the same force, and the reason in words."""

    model: str
    reason: str


def collapsed(
    fits: Mapping[str, Fit],
    residuals: Mapping[str, Residuals],
    n_params: Mapping[str, int],
    tests: tuple[DamperTest, ...],
    n_effective: float,
) -> dict[str, Collapse]:
    """Families, by model, whose fit is that of a simpler one.

    A fit has collapsed if, beside a family with fewer free parameters,

    - its force is the same: the mean square of the difference of the two residuals, and the gain in the log-likelihood,
      `n_eff ln(S_simpler/S)`, are no more than chance, 2 for each further parameter (Akaike's criterion);
    - more of its parameters are on a bound or undetermined, that is with a standard error above their value or half
      their range.

    Of several such families the one with the fewest parameters is named.

    Parameters
    ----------
    fits, residuals, n_params
        By model: fits to all tests, their residuals, and numbers of free parameters.
    n_effective
        Effective number of samples, the same for all families.
    """
    doubtful = {model: doubtful_parameters(fit, tests) for model, fit in fits.items()}
    joined = {model: np.concatenate(residuals[model]) for model in fits}
    found: dict[str, Collapse] = {}
    for model in fits:
        simpler = sorted(
            (each for each in fits if n_params[each] < n_params[model]), key=lambda each: n_params[each]
        )
        for other in simpler:
            chance = _CHANCE * (n_params[model] - n_params[other]) / n_effective
            squared, theirs = (float(np.mean(joined[each] ** 2)) for each in (model, other))
            difference = float(np.mean((joined[model] - joined[other]) ** 2))
            same = difference <= chance * theirs and theirs <= squared * np.exp(chance)
            if same and len(doubtful[model]) > len(doubtful[other]):
                found[model] = Collapse(
                    model=other,
                    reason=f"its force is that of {damper(other).title} to {100.0 * np.sqrt(difference):.2g} % of "
                    f"the force's deviation, and {_in_words(doubtful[model])}",
                )
                break
    return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Doubtful:
    """Names of the free parameters of a fit that are on a bound, and of those that the data do not determine."""

    on_bound: tuple[str, ...]
    undetermined: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.on_bound) + len(self.undetermined)


def doubtful_parameters(fit: Fit, tests: tuple[DamperTest, ...]) -> Doubtful:
    """Free parameters on a bound, and those with a standard error above their value or half their range, or none."""
    spec, theta = fit.spec, np.array(fit.theta)
    bounds = {name: pair for name, pair in fit.settings.bounds.items() if name in spec.names}
    scale = Scale.of(spec, Box.of(spec).with_bounds(bounds), tests, theta)
    free = [(index, each) for index, each in enumerate(fit.estimates) if each.remark != "fixed"]
    return Doubtful(
        on_bound=tuple(each.name for _, each in free if each.remark.startswith("at ")),
        undetermined=tuple(
            each.name
            for index, each in free
            if each.remark == "not identifiable"
            or (each.standard_error is not None and each.standard_error > scale.size[index])
        ),
    )


def _in_words(doubtful: Doubtful) -> str:
    parts = [
        f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} {state}"
        for names, state in ((doubtful.on_bound, "on a bound"), (doubtful.undetermined, "undetermined"))
        if names
    ]
    return " and ".join(parts)
