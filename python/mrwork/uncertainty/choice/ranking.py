"""Families of models ranked by how well they predict what they were not fitted to, with two criteria beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.errors import SettingError
from mrwork.uncertainty.choice.psis import UNRELIABLE, LeaveOneOut

# Points of fit that make no difference: the cycles of a real test repeat to 97-99 %.
HAIR = 0.1

Verdict = Literal["chosen", "as good", "behind", "failed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """What is known of one family: `n_params` were free, `seconds` are those of all its fits.

    `left_out` has the mean NRMSE of each fold, in the same order for all families, and is empty where one could not be
    predicted: `reason` says why. `variance` is the mean square of the residuals in deviations of each
    test's force. What did not come about is `None`.
    """

    model: str
    title: str
    n_params: int
    status: str
    seconds: float
    reason: str = ""
    fit_percent: float | None = None
    left_out: tuple[float, ...] = ()
    variance: float | None = None
    leave_one_out: LeaveOneOut | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """One row of the ranking. Differences are to the best family by that criterion, and positive where one is behind.

    Fits in percent; `left_out_behind` in points, its error that of the paired difference over folds.
    `unreliable_blocks` counts those whose Pareto k is above 0.7.
    """

    model: str
    title: str
    n_params: int
    verdict: Verdict
    status: str
    reason: str
    seconds: float
    fit_percent: float | None
    left_out_percent: float | None = None
    left_out_error: float | None = None
    left_out_behind: float | None = None
    left_out_behind_error: float | None = None
    elpd: float | None = None
    elpd_error: float | None = None
    elpd_behind: float | None = None
    elpd_behind_error: float | None = None
    unreliable_blocks: int | None = None
    bic: float | None = None
    bic_behind: float | None = None


def rank(evidence: Sequence[Evidence], n_effective: float | None) -> tuple[Standing, ...]:
    """Rank families by their left-out fit, best first; those that could not be judged come last.

    A family is as good as the best where its mean left-out NRMSE is behind by no more than the standard error of the
    paired difference over folds, nor than that of the best itself (a family that fails badly on one test has a wide
    error, which must not excuse it), or by no more than a tenth of a point. Of those as good, the one with the fewest
    parameters is chosen. BIC is `n_eff ln(variance) + n_params ln(n_eff)`.

    Parameters
    ----------
    n_effective
        Effective number of independent samples, the same for all families.

    Raises
    ------
    SettingError
        Where no family was judged on what was left out.
    """
    judged = sorted(
        (each for each in evidence if each.left_out), key=lambda each: float(np.mean(each.left_out))
    )
    if not judged:
        reasons = "; ".join(f"{each.model}: {each.reason}" for each in evidence)
        raise SettingError(f"no family of models predicts what was left out of its fit ({reasons})")
    best = judged[0]
    as_good = [each for each in judged if _is_as_good(each, best)]
    chosen = min(as_good, key=lambda each: each.n_params)
    bic = {each.model: _bic(each, n_effective) for each in evidence}
    most_likely = max(
        (each for each in evidence if each.leave_one_out is not None),
        key=lambda each: _elpd(each).sum(),
        default=None,
    )
    standings = []
    for each in [*judged, *(each for each in evidence if not each.left_out)]:
        verdict: Verdict = "failed" if not each.left_out else "behind"
        if each is chosen:
            verdict = "chosen"
        elif each in as_good:
            verdict = "as good"
        standings.append(_standing(each, verdict, best, most_likely, bic))
    return tuple(standings)


def _standing(
    own: Evidence,
    verdict: Verdict,
    best: Evidence,
    most_likely: Evidence | None,
    bic: dict[str, float | None],
) -> Standing:
    percent = 100.0 * np.array(own.left_out)
    difference = percent - 100.0 * np.array(best.left_out) if percent.size else percent
    elpd = _elpd(own)
    behind = _elpd(most_likely) - elpd if most_likely is not None and elpd.size else elpd[:0]
    least = min((value for value in bic.values() if value is not None), default=None)
    value = bic[own.model]
    return Standing(
        model=own.model,
        title=own.title,
        n_params=own.n_params,
        verdict=verdict,
        status=own.status,
        reason=own.reason,
        seconds=own.seconds,
        fit_percent=own.fit_percent,
        left_out_percent=100.0 - float(percent.mean()) if percent.size else None,
        left_out_error=_error_of_mean(percent),
        left_out_behind=float(difference.mean()) if percent.size else None,
        left_out_behind_error=_error_of_mean(difference),
        elpd=float(elpd.sum()) if elpd.size else None,
        elpd_error=_error_of_sum(elpd),
        elpd_behind=float(behind.sum()) if behind.size else None,
        elpd_behind_error=_error_of_sum(behind),
        unreliable_blocks=None if own.leave_one_out is None else unreliable(own.leave_one_out),
        bic=value,
        bic_behind=None if value is None or least is None else value - least,
    )


def unreliable(found: LeaveOneOut) -> int:
    """Blocks whose Pareto k is above 0.7 or not a number."""
    return int(np.count_nonzero(~(found.pareto_k <= UNRELIABLE)))


def _is_as_good(own: Evidence, best: Evidence) -> bool:
    difference = 100.0 * (np.array(own.left_out) - np.array(best.left_out))
    errors = [_error_of_mean(difference), _error_of_mean(100.0 * np.array(best.left_out))]
    allowed = min((error for error in errors if error is not None), default=0.0)
    return float(difference.mean()) <= max(allowed, HAIR)


def _bic(own: Evidence, n_effective: float | None) -> float | None:
    if own.variance is None or n_effective is None:
        return None
    return float(n_effective * np.log(own.variance) + own.n_params * np.log(n_effective))


def _elpd(own: Evidence) -> NDArray[np.float64]:
    return np.empty(0) if own.leave_one_out is None else own.leave_one_out.elpd


def _error_of_mean(values: NDArray[np.float64]) -> float | None:
    return float(np.std(values, ddof=1) / np.sqrt(values.size)) if values.size > 1 else None


def _error_of_sum(values: NDArray[np.float64]) -> float | None:
    return float(np.std(values, ddof=1) * np.sqrt(values.size)) if values.size > 1 else None
