"""Ranking of families of models by their left-out fit, with PSIS-LOO and BIC."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import NotNegative, Positive, Whole
from mrwork.errors import SettingError
from mrwork.identification.fit import NEGLIGIBLE
from mrwork.store.record import Related
from mrwork.summary import Summarised, Summary, listed, rounded
from mrwork.uncertainty.choice.collapse import Collapse
from mrwork.uncertainty.choice.leave_one_out import UNRELIABLE, LeaveOneOut

DEFINITIONS = (
    "Left-out fit: 100 (1 - NRMSE) in percent of what the fit has not seen, the mean over folds with its standard "
    "error. A family is as good as the best within one standard error of the paired difference, not more than that "
    f"of the best itself, or within {NEGLIGIBLE:g} points; of those the one with the fewest parameters is chosen.",
    "Collapsed: the fit is that of a simpler family, because the forces of the two differ by no more than chance, and "
    "more of its parameters are on a bound or undetermined. Such a family counts as the simpler one and is not chosen.",
    "ELPD: expected log predictive density of a block of whole cycles given the other blocks (PSIS-LOO), residuals in "
    "deviations of each test's force, the log density tempered by n_eff / n. Cycles of one test repeat, so it "
    "is about more of the same tests, not about another excitation.",
    "BIC: n_eff ln(mean squared residual in deviations) + k ln(n_eff), with k free parameters and n_eff "
    "effective samples, those of the residuals of the family that fits best, for all families alike. Every cycle "
    "counts anew in n_eff though cycles repeat, so that differences in ELPD and BIC are upper limits.",
)

RankVerdict = Literal["chosen", "as good", "behind", "collapsed", "failed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Results of one family with `n_params` free parameters; `seconds` of all its fits.

    `left_out` has the mean NRMSE of each fold, in the same order for all families; it is empty where a prediction
    failed, for the given `reason`. `variance` is the mean square of the residuals in deviations of each test's force.
    Missing results are `None`. `collapse` is there where the fit is that of a simpler family.
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
    collapse: Collapse | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """One row of the ranking; differences to the best family by each criterion are positive.

    The left-out fit of a collapsed family is compared as well, though it is not ranked, so it may be negative.
    `same_as` is the simpler family whose fit it has.
    Fits are in percent; `left_out_behind` is in percentage points, with the standard error of the paired difference.
    `unreliable_blocks` is the number of blocks whose Pareto k is above 0.7.
    """

    model: str
    title: str
    n_params: Whole
    verdict: RankVerdict
    status: str
    reason: str
    seconds: NotNegative
    fit_percent: float | None
    left_out_percent: float | None = None
    left_out_error: NotNegative | None = None
    left_out_behind: float | None = None
    left_out_behind_error: NotNegative | None = None
    elpd: float | None = None
    elpd_error: NotNegative | None = None
    elpd_behind: float | None = None
    elpd_behind_error: NotNegative | None = None
    unreliable_blocks: Whole | None = None
    bic: float | None = None
    bic_behind: float | None = None
    same_as: str = ""


def rank(evidence: Sequence[Evidence], n_effective: float | None) -> tuple[Standing, ...]:
    """Rank families by their left-out fit, best first; collapsed families follow, those that failed come last.

    A family is as good as the best if its mean left-out NRMSE exceeds that of the best by no more than the standard
    error of the paired difference over folds, limited to the standard error of the best itself (a family that fails on
    one test has a large error of its own), or by no more than 0.1 percentage points. Of those as good, the one with the
    fewest parameters is chosen. A family that has collapsed to a simpler one which predicts the tests left out counts
    as that one: it is neither the best nor chosen. BIC is `n_eff ln(variance) + n_params ln(n_eff)`.

    Parameters
    ----------
    n_effective
        Effective number of independent samples, the same for all families.

    Raises
    ------
    SettingError
        Where no family predicted the tests left out.
    """
    predicted = sorted(
        (each for each in evidence if each.left_out), key=lambda each: float(np.mean(each.left_out))
    )
    if not predicted:
        reasons = "; ".join(f"{each.model}: {each.reason}" for each in evidence)
        raise SettingError(f"no family of models predicts what was left out of its fit ({reasons})")
    simpler = {each.model for each in predicted}
    distinct = [each for each in predicted if each.collapse is None or each.collapse.model not in simpler]
    best = distinct[0]
    as_good = [each for each in distinct if is_as_good(each.left_out, best.left_out)]
    chosen = min(as_good, key=lambda each: each.n_params)
    bic = {each.model: _bic(each, n_effective) for each in evidence}
    most_likely = max(
        (each for each in evidence if each.leave_one_out is not None),
        key=lambda each: _elpd(each).sum(),
        default=None,
    )
    standings = []
    same = [each for each in predicted if each not in distinct]
    for each in [*distinct, *same, *(each for each in evidence if not each.left_out)]:
        verdict: RankVerdict = "failed" if not each.left_out else "collapsed" if each in same else "behind"
        if each is chosen:
            verdict = "chosen"
        elif each in as_good:
            verdict = "as good"
        standings.append(_standing(each, verdict, best, most_likely, bic))
    return tuple(standings)


def _standing(
    own: Evidence,
    verdict: RankVerdict,
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
    same = own.collapse if verdict == "collapsed" else None
    return Standing(
        model=own.model,
        title=own.title,
        n_params=own.n_params,
        verdict=verdict,
        status=own.status,
        reason=own.reason if same is None else same.reason,
        seconds=own.seconds,
        fit_percent=own.fit_percent,
        same_as="" if same is None else same.model,
        left_out_percent=100.0 - float(percent.mean()) if percent.size else None,
        left_out_error=error_of_mean(percent),
        left_out_behind=float(difference.mean()) if percent.size else None,
        left_out_behind_error=error_of_mean(difference),
        elpd=float(elpd.sum()) if elpd.size else None,
        elpd_error=_error_of_sum(elpd),
        elpd_behind=float(behind.sum()) if behind.size else None,
        elpd_behind_error=_error_of_sum(behind),
        unreliable_blocks=None
        if own.leave_one_out is None
        else int(np.count_nonzero(~(own.leave_one_out.pareto_k <= UNRELIABLE))),
        bic=value,
        bic_behind=None if value is None or least is None else value - least,
    )


def is_as_good(own: Sequence[float], best: Sequence[float]) -> bool:
    """Whether NRMSE of folds left out are as good as the best: within one standard error, as `rank` describes."""
    difference = 100.0 * (np.array(own) - np.array(best))
    errors = [error_of_mean(difference), error_of_mean(100.0 * np.array(best))]
    allowed = min((error for error in errors if error is not None), default=0.0)
    return float(difference.mean()) <= max(allowed, NEGLIGIBLE)


def _bic(own: Evidence, n_effective: float | None) -> float | None:
    if own.variance is None or n_effective is None:
        return None
    return float(n_effective * np.log(own.variance) + own.n_params * np.log(n_effective))


def _elpd(own: Evidence) -> NDArray[np.float64]:
    return np.empty(0) if own.leave_one_out is None else own.leave_one_out.elpd


def error_of_mean(values: NDArray[np.float64]) -> float | None:
    """Standard error of the mean, `None` for a single value."""
    return float(np.std(values, ddof=1) / np.sqrt(values.size)) if values.size > 1 else None


def _error_of_sum(values: NDArray[np.float64]) -> float | None:
    return float(np.std(values, ddof=1) * np.sqrt(values.size)) if values.size > 1 else None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Ranking(Summarised, Related):
    """Families in order of merit, the chosen one, and the reason in a sentence.

    `held_out` describes the data left out of the fits, in `n_folds`. `remarks` concern the comparison as a whole;
    `missing` names families that an interrupt left undone.
    """

    chosen: str
    sentence: str
    standings: tuple[Standing, ...]
    held_out: str
    n_folds: Whole
    n_blocks: Whole | None
    n_effective: Positive | None
    remarks: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    definitions: tuple[str, ...] = DEFINITIONS

    def disagreement(self) -> str:
        """Whether the chosen family is ranked, and so are those that others are the same as."""
        models = [each.model for each in self.standings]
        if len(set(models)) < len(models):
            return "it ranks a family twice"
        chosen = [each.model for each in self.standings if each.verdict == "chosen"]
        if chosen != [self.chosen]:
            return f"it has chosen {self.chosen} and ranks {listed(chosen) or 'none'} as chosen"
        return ""

    def _summary(self) -> Summary:
        return Summary(
            title=f"Choice of model: {self.chosen}",
            facts=(("evaluated on", self.held_out),),
            columns=("model", "parameters", "fit %", "left out %", "verdict", "reason"),
            rows=[
                (
                    each.model,
                    str(each.n_params),
                    rounded(each.fit_percent),
                    rounded(each.left_out_percent),
                    each.verdict,
                    each.reason,
                )
                for each in self.standings
            ],
            notes=(self.sentence, *(f"note: {remark}" for remark in self.remarks)),
        )
