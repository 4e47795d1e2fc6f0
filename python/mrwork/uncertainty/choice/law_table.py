"""Table of the current laws that were tried for a model, and the choice among them by the one-standard-error rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from mrwork.arguments import NotNegative, Whole, checked
from mrwork.dampers.parameters import CommandUnit, LawName
from mrwork.store.record import OrInfinite, Related
from mrwork.summary import Summarised, Summary, aligned
from mrwork.uncertainty.choice.ranking import NEGLIGIBLE, error_of_mean, is_as_good

# Floor of the NRMSE, for synthetic tests without noise.
_EXACT = 1e-9

LawVerdict = Literal["chosen", "as good", "behind"]

LAW_DEFINITIONS = (
    "Left-out fit: 100 (1 - NRMSE) in percent of tests that the fit has not seen: the geometric mean of the NRMSE in "
    "each fold, then the mean over folds with its standard error. A test that cannot be predicted counts as 0 %. Laws "
    "are as good as the best within one standard error of the paired difference, no more than that of the best itself, "
    f"or within {NEGLIGIBLE:g} points; of those the laws with the fewest parameters are chosen.",
    "A path of laws starts with every positive parameter quadratic in the command and is lowered by one degree at a "
    "time, the one for which the linearised fit to all tests loses least; the best of the path is raised again where "
    "that promises a better fit. A law of degree n is the curve through n + 1 values at commands. Laws are fitted to "
    "cycles from the middle of all tests, and of all but those of each fold, from the fits of the laws before.",
    "The left-out fit of the chosen laws is optimistic, because they were chosen by it; tests that were not given "
    "measure it without bias.",
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TriedLaws(Summarised):
    """One set of laws: those that are not constant, the free parameters, and the fit in percent.

    `fit_percent` is of all tests together; `left_out` has the geometric mean NRMSE of each fold, in which relative
    changes of all tests weigh the same, `left_out_percent` is the fit of their mean with its standard error;
    `median_percent` and `worst_percent` are of single tests left out; those of `not_predicted` could not be simulated.
    """

    laws: dict[str, LawName]
    n_params: Whole
    fit_percent: float
    left_out_percent: float
    left_out_error: NotNegative | None
    left_out: tuple[OrInfinite, ...]
    median_percent: float
    worst_percent: float
    verdict: LawVerdict = "behind"
    not_predicted: tuple[str, ...] = ()

    _units: ClassVar[Mapping[str, str]] = {
        "fit_percent": "%",
        "left_out_percent": "%",
        "left_out_error": "points",
        "median_percent": "%",
        "worst_percent": "%",
    }

    @classmethod
    @checked
    def of(
        cls,
        laws: dict[str, LawName],
        *,
        n_params: int,
        fit_percent: float,
        left_out: Sequence[NDArray[np.float64]],
        not_predicted: Sequence[str] = (),
    ) -> TriedLaws:
        """Laws with the NRMSE of the tests of each fold that was left out."""
        folds = np.array([float(np.exp(np.log(np.maximum(each, _EXACT)).mean())) for each in left_out])
        single = np.concatenate(left_out)
        return cls(
            laws=laws,
            n_params=n_params,
            fit_percent=fit_percent,
            left_out_percent=100.0 * (1.0 - float(folds.mean())),
            left_out_error=error_of_mean(100.0 * folds),
            left_out=tuple(folds.tolist()),
            median_percent=100.0 * (1.0 - float(np.median(single))),
            worst_percent=100.0 * (1.0 - float(single.max())),
            not_predicted=tuple(not_predicted),
        )

    @property
    def in_words(self) -> str:
        """The laws in one line."""
        return ", ".join(f"{name} {law}" for name, law in self.laws.items()) or "all constant"

    @property
    def cells(self) -> tuple[str, ...]:
        """Cells below `LAW_HEADINGS`."""
        error = self.left_out_error
        return (
            str(self.n_params),
            f"{self.fit_percent:.2f}",
            f"{self.left_out_percent:.2f}" + ("" if error is None else f" ± {error:.2f}"),
            f"{self.median_percent:.2f}",
            f"{self.worst_percent:.2f}",
            "" if self.verdict == "behind" else self.verdict,
            self.in_words,
        )


LAW_HEADINGS = ("parameters", "fit %", "left-out fit %", "median", "worst", "", "laws")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawTable(Summarised, Related):
    """Laws that were tried for a model, the best left-out fit first; the reason of the choice in `sentence`.

    `held_out` describes the tests left out of the fits, `given` are laws that were not to be chosen.
    """

    model: str
    unit: CommandUnit
    tried: tuple[TriedLaws, ...]
    sentence: str
    held_out: str
    n_folds: Whole
    given: dict[str, LawName]
    complete: bool = True
    definitions: tuple[str, ...] = LAW_DEFINITIONS

    def disagreement(self) -> str:
        """Whether one set of laws is chosen."""
        chosen = sum(each.verdict == "chosen" for each in self.tried)
        return "" if chosen == 1 else f"of {len(self.tried)} sets of laws {chosen} are chosen"

    @property
    def chosen(self) -> TriedLaws:
        """The chosen laws."""
        return next(each for each in self.tried if each.verdict == "chosen")

    @property
    def lines(self) -> list[str]:
        """The table as aligned text."""
        return aligned([LAW_HEADINGS, *(each.cells for each in self.tried)])

    def _summary(self) -> Summary:
        return Summary(
            title=f"Choice of current laws: {self.model}",
            facts=(("evaluated on", self.held_out),),
            columns=LAW_HEADINGS,
            rows=[each.cells for each in self.tried],
            notes=(self.sentence,),
        )


def law_table(
    tried: Sequence[TriedLaws],
    *,
    model: str,
    unit: CommandUnit,
    held_out: str,
    n_folds: int,
    given: Mapping[str, LawName],
    complete: bool,
) -> LawTable:
    """Rank the laws and choose by the one-standard-error rule."""
    order = sorted(tried, key=lambda each: -each.left_out_percent)
    best = order[0]
    good = [each for each in order if is_as_good(each.left_out, best.left_out)]
    chosen = min(good, key=lambda each: each.n_params)

    def verdict(each: TriedLaws) -> LawVerdict:
        if each is chosen:
            return "chosen"
        return "as good" if each in good else "behind"

    return LawTable(
        model=model,
        unit=unit,
        tried=tuple(replace(each, verdict=verdict(each)) for each in order),
        sentence=_sentence(chosen, best, len(order), held_out, complete=complete),
        held_out=held_out,
        n_folds=n_folds,
        given=dict(given),
        complete=complete,
    )


def _sentence(chosen: TriedLaws, best: TriedLaws, count: int, held_out: str, *, complete: bool) -> str:
    error = "" if chosen.left_out_error is None else f", standard error {chosen.left_out_error:.2g}"
    text = (
        f"Of {count} sets of laws, the one with {chosen.n_params} parameters is chosen ({chosen.in_words}): its mean "
        f"left-out fit is {chosen.left_out_percent:.2f} % ({held_out}{error}), its median {chosen.median_percent:.2f} %"
    )
    if best is not chosen:
        behind = best.left_out_percent - chosen.left_out_percent
        text += (
            f"; that is {behind:.2f} points behind the best, which has {best.n_params} parameters "
            f"({best.in_words}), and within one standard error of it"
        )
    if chosen.not_predicted:
        text += (
            f"; {', '.join(chosen.not_predicted)} could not be simulated when left out, which counts as 0 %"
        )
    if not complete:
        text += "; the choice was interrupted, and further laws were not tried"
    return text + "."
