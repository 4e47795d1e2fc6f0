"""Table of the current laws tried for one or several models, and the choice by the one-standard-error rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from mrwork.base.arguments import NotNegative, Whole
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, columns_of, number_labels
from mrwork.base.numbers import format_fixed
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table, TableColumn, text_table
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.laws import CommandLaw, LawName, law_of
from mrwork.identification.fit import NEGLIGIBLE
from mrwork.identification.result import MANY
from mrwork.uncertainty.choice.ranking import error_of_mean, is_as_good
from mrwork.uncertainty.choice.splits import Splits

LawVerdict = Literal["chosen", "as good", "behind", "unusable"]

LAW_DEFINITIONS = (
    "Left-out fit: 100 (1 - NRMSE) in percent of whole tests that the fit has not seen, the mean of two kinds with "
    "equal weights. Inside: tests that lie between those that remain. Beyond: the fastest, slowest and largest "
    "motions, each left out with every test at or beyond it. Both are means over motions of the geometric mean of the "
    "NRMSE of their tests. A test that cannot be predicted counts as 0 %.",
    "Behind: the difference to the best, paired motion by motion, with its standard error. Laws are as good as the "
    f"best within one standard error of it, no more than that of the best itself, or within {NEGLIGIBLE:g} points; of "
    f"those one that takes fewer than {MANY} integration steps a sample in a building is chosen, of these the one with "
    "the fewest parameters.",
    "Unusable: a law vanishes or leaves its range within the tested commands, or no building can be simulated with it. "
    "Such laws are not chosen while others are left.",
    "The search starts with every positive parameter quadratic in the command, then every one but offsets, and tries "
    "neighbours of the best laws, of the simplest as good, and of others as good: those that promise most when the "
    "tests are linearised about the fits before. A law of degree n is the curve through n + 1 values at commands, of "
    "a positive parameter through their logarithms, or direct, through the values themselves. Of two forms that no "
    "test tells apart, one without an extremum between the tested commands is taken. Laws are fitted to cycles from "
    "the middle of all tests, and of all but those of each split, from the fits of the laws before.",
    "The left-out fit of the chosen laws is optimistic, because they were chosen by it; tests that were not given "
    "measure it without bias.",
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class TriedLaws(Summarised):
    """Laws of a model that are not constant, and the fit of all tests together and of those left out, in percent.

    `left_out` has the geometric mean NRMSE of each fold, in which relative changes of all tests weigh the same;
    `median_percent` and `worst_percent` are of single tests left out; those of `not_predicted` could not be simulated.
    """

    laws: dict[str, LawName]
    n_params: Whole
    fit_percent: float
    left_out_percent: float
    left_out_error: NotNegative | None
    left_out: tuple[float, ...]
    median_percent: float
    worst_percent: float
    verdict: LawVerdict = "behind"
    not_predicted: tuple[str, ...] = ()
    model: str = ""
    inside_percent: float | None = None
    outside_percent: float | None = None
    behind: float | None = None
    behind_error: NotNegative | None = None
    objection: str = ""
    is_costly: bool = False

    _units: ClassVar[Mapping[str, str]] = {
        "fit_percent": "%",
        "left_out_percent": "%",
        "left_out_error": "points",
        "median_percent": "%",
        "worst_percent": "%",
    }

    @classmethod
    def of(
        cls,
        laws: dict[str, LawName],
        *,
        n_params: int,
        fit_percent: float,
        left_out: Sequence[Floats],
        splits: Splits,
        not_predicted: tuple[str, ...] = (),
        objection: str = "",
        is_costly: bool = False,
    ) -> TriedLaws:
        """Laws with the NRMSE of the tests of each split."""
        errors = splits.errors(left_out)
        single = np.concatenate(left_out)
        inside, outside = splits.means(left_out)
        return cls(
            laws=laws,
            n_params=n_params,
            fit_percent=fit_percent,
            left_out_percent=100.0 * (1.0 - float(errors.mean())),
            left_out_error=error_of_mean(100.0 * errors),
            left_out=tuple(errors.tolist()),
            median_percent=100.0 * (1.0 - float(np.median(single))),
            worst_percent=100.0 * (1.0 - float(single.max())),
            not_predicted=not_predicted,
            inside_percent=None if inside is None else 100.0 * (1.0 - inside),
            outside_percent=None if outside is None else 100.0 * (1.0 - outside),
            objection=objection,
            is_costly=is_costly,
        )

    @property
    def remark(self) -> str:
        """The verdict, and what speaks against these laws."""
        verdict = "" if self.verdict == "behind" else self.verdict
        return ", ".join(filter(None, (verdict, self.objection, "costly" if self.is_costly else "")))

    @property
    def in_words(self) -> str:
        """The laws in one line."""
        return laws_in_words(self.laws)


def laws_in_words(laws: Mapping[str, LawName | CommandLaw]) -> str:
    """Laws in one line; "direct" are those through values themselves, not through their logarithms."""
    return ", ".join(f"{name} {_law_in_words(law_of(law))}" for name, law in laws.items()) or "all constant"


def _law_in_words(law: CommandLaw) -> str:
    return f"direct {CommandLaw(law.fitted_degree)}" if law.nodes and not law.logarithms else str(law)


def _format_behind(each: TriedLaws) -> str:
    if each.behind is None:
        return ""
    return f"{each.behind:.2f}" + ("" if each.behind_error is None else f" ± {each.behind_error:.2f}")


_MODEL = TableColumn(heading="model", cell=lambda each: each.model)
_COLUMNS = (
    TableColumn(heading="parameters", cell=lambda each: str(each.n_params)),
    TableColumn(heading="fit %", cell=lambda each: f"{each.fit_percent:.2f}"),
    TableColumn(heading="left-out fit %", cell=lambda each: f"{each.left_out_percent:.2f}"),
    TableColumn(heading="inside", cell=lambda each: format_fixed(each.inside_percent, 2)),
    TableColumn(heading="beyond", cell=lambda each: format_fixed(each.outside_percent, 2)),
    TableColumn(heading="behind, points", cell=_format_behind),
    TableColumn(heading="worst", cell=lambda each: f"{each.worst_percent:.2f}"),
    TableColumn(heading="remark", cell=lambda each: each.remark, words=True),
)
_LAWS = TableColumn(heading="laws", cell=lambda each: each.in_words, words=True)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawTable(WithAxes, Summarised):
    """Laws that were tried for one or several models, the best left-out fit first; the reason of the choice.

    `failed` has the reason by the name of a model that could not be fitted; laws that are `given` were not chosen.
    """

    model: str
    unit: CommandUnit
    tried: tuple[TriedLaws, ...]
    sentence: str
    held_out: str
    n_folds: Whole
    given: dict[str, LawName]
    complete: bool
    models: tuple[str, ...]
    failed: dict[str, str]
    remarks: tuple[str, ...]
    definitions: tuple[str, ...] = LAW_DEFINITIONS

    def _named_arrays(self) -> NamedArrays:
        words = {
            "model": ("", "model"),
            "verdict": ("", "place among the laws"),
            "n_params": ("1", "number of parameters"),
            "fit_percent": ("%", "fit to all tests"),
            "left_out_percent": ("%", "fit to what was left out"),
            "left_out_error": ("%", "standard error of the fit to what was left out"),
            "inside_percent": ("%", "fit to what was left out inside the tests that remained"),
            "outside_percent": ("%", "fit to what was left out beyond the tests that remained"),
            "behind": ("%", "difference to the best in the fit to what was left out"),
            "behind_error": ("%", "standard error of that difference"),
            "median_percent": ("%", "median fit of single tests left out"),
            "worst_percent": ("%", "worst fit of single tests left out"),
        }
        laws = {
            f"law_{name}": NamedArray.of(
                [each.laws.get(name, "constant") for each in self.tried], "tried", long_name=f"law of {name}"
            )
            for name in dict.fromkeys(name for each in self.tried for name in each.laws)
        }
        return NamedArrays(
            title=f"Choice of laws of {self.model}",
            rows=("tried",),
            labels={"tried": number_labels(len(self.tried))},
            arrays=columns_of(self.tried, "tried", words) | laws,
        )

    @property
    def chosen_laws(self) -> TriedLaws:
        """The chosen laws."""
        return next(each for each in self.tried if each.verdict == "chosen")

    @property
    def is_of_several(self) -> bool:
        """Whether several models were compared."""
        return len(self.models) > 1

    @property
    def table(self) -> Table:
        """The laws, the longest column last."""
        return text_table((*self._model, *_COLUMNS, _LAWS), self.tried)

    @property
    def _model(self) -> tuple[TableColumn, ...]:
        return (_MODEL,) if self.is_of_several else ()

    @property
    def notes(self) -> tuple[str, ...]:
        """Why models could not be fitted, and the remarks, a clause each."""
        fitted = {each.model for each in self.tried}
        return (
            *(
                f"{model} could not be fitted{' with further laws' if model in fitted else ''}: {reason}"
                for model, reason in self.failed.items()
            ),
            *self.remarks,
        )

    def _summary(self) -> Summary:
        return Summary(
            title=f"Choice of current laws: {f'{len(self.models)} models' if self.is_of_several else self.model}",
            facts=(("evaluated on", self.held_out),),
            tables=[self.table],
            notes=(self.sentence, *self.notes),
        )


def judge_laws(tried: Sequence[TriedLaws]) -> tuple[TriedLaws, ...]:
    """The laws of all models, best first, with verdicts by the rules of `LAW_DEFINITIONS`."""
    order = sorted(tried, key=lambda laws: -laws.left_out_percent)
    sound = [laws for laws in order if not laws.objection] or order
    best = sound[0]
    good = [laws for laws in sound if is_as_good(laws.left_out, best.left_out)]
    chosen = min(good, key=lambda laws: (laws.is_costly, laws.n_params))

    def judged(laws: TriedLaws) -> TriedLaws:
        verdict: LawVerdict = "behind" if laws in sound else "unusable"
        if laws in good:
            verdict = "chosen" if laws is chosen else "as good"
        behind = 100.0 * (np.array(laws.left_out) - np.array(best.left_out))
        error = None if laws is best else error_of_mean(behind)
        return replace(laws, verdict=verdict, behind=float(behind.mean()), behind_error=error)

    return tuple(map(judged, order))


def sentence_on(table: LawTable) -> str:
    """What was chosen, how it predicts, and what lies behind."""
    chosen, names = table.chosen_laws, {each.model for each in table.tried}
    best = next(each for each in table.tried if each.behind == 0.0)
    count = f"{len(table.tried)} sets of laws" + (f" of {len(names)} models" if len(names) > 1 else "")
    of_model = f" of {chosen.model}" if table.is_of_several else ""
    text = (
        f"Of {count}, the one{of_model} with {chosen.n_params} parameters is chosen ({chosen.in_words}): its mean "
        f"left-out fit is {chosen.left_out_percent:.2f} % ({table.held_out}), its median "
        f"{chosen.median_percent:.2f} %"
    )
    if chosen.inside_percent is not None and chosen.outside_percent is not None:
        inside, outside = chosen.inside_percent, chosen.outside_percent
        text += f", {inside:.2f} % inside the tests that remain and {outside:.2f} % beyond them"
    if best is not chosen:
        behind = _format_behind(chosen)
        of_model = f", of {best.model}," if table.is_of_several else ","
        is_small = (chosen.behind or 0.0) > (chosen.behind_error or 0.0)
        within = f"less than {NEGLIGIBLE:g} points" if is_small else "within one standard error of it"
        text += (
            f"; that is {behind} points behind the best{of_model} which has {best.n_params} parameters "
            f"({best.in_words}), and {within}"
        )
    if chosen.not_predicted:
        text += (
            f"; {', '.join(chosen.not_predicted)} could not be simulated when left out, which counts as 0 %"
        )
    if chosen.objection:
        text += (
            f"; it has the best predictions, but of all sets something speaks against it: {chosen.objection}"
        )
    elif behind_best := max(0.0, table.tried[0].left_out_percent - best.left_out_percent):
        reason = table.tried[0].objection
        text += f"; a set that predicts {behind_best:.2f} points better is left alone, because {reason}"
    if not table.complete:
        text += "; the choice was interrupted, and further laws were not tried"
        missing = [name for name in table.models if name not in names and name not in table.failed]
        text += f", nor any of {', '.join(missing)}" if missing else ""
    return text + "."
