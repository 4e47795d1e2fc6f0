"""Table of the current laws tried for one or several models, and the choice by the one-standard-error rule."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Literal

import numpy as np

from mrwork.base.arguments import NotNegative, Whole
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, columns_of, number_labels
from mrwork.base.summary import Summarised, Summary
from mrwork.base.table import Table, TableColumn, page_table, text_table
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.parameters import LawName
from mrwork.identification.fit import NEGLIGIBLE
from mrwork.store.codec import OrInfinite, Related
from mrwork.uncertainty.choice.ranking import error_of_mean, is_as_good

# Floor of the NRMSE, for synthetic tests without noise.
_EXACT = 1e-9

LawVerdict = Literal["chosen", "as good", "behind"]

LAW_DEFINITIONS = (
    "Left-out fit: 100 (1 - NRMSE) in percent of whole tests that the fit has not seen: the geometric mean of the "
    "NRMSE in each fold, then the mean over folds with its standard error. A test that cannot be predicted counts as "
    "0 %. Laws are as good as the best within one standard error of the paired difference, no more than that of the "
    f"best itself, or within {NEGLIGIBLE:g} points; of those the laws with the fewest parameters are chosen.",
    "A path of laws starts with every positive parameter quadratic in the command and is lowered by one degree at a "
    "time, the one for which the linearised fit to all tests loses least; the best of the path is raised again where "
    "that promises a better fit. A law of degree n is the curve through n + 1 values at commands. Laws are fitted to "
    "cycles from the middle of all tests, and of all but those of each fold, from the fits of the laws before.",
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
    left_out: tuple[OrInfinite, ...]
    median_percent: float
    worst_percent: float
    verdict: LawVerdict = "behind"
    not_predicted: tuple[str, ...] = ()
    model: str = ""

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


def _format_left_out(each: TriedLaws) -> str:
    error = each.left_out_error
    return f"{each.left_out_percent:.2f}" + ("" if error is None else f" ± {error:.2f}")


_MODEL = TableColumn(heading="model", cell=lambda each: each.model)
_COLUMNS = (
    TableColumn(heading="parameters", cell=lambda each: str(each.n_params)),
    TableColumn(heading="fit %", cell=lambda each: f"{each.fit_percent:.2f}"),
    TableColumn(heading="left-out fit %", cell=_format_left_out),
    TableColumn(heading="median", cell=lambda each: f"{each.median_percent:.2f}"),
    TableColumn(heading="worst", cell=lambda each: f"{each.worst_percent:.2f}"),
    TableColumn(
        heading="remark", cell=lambda each: "" if each.verdict == "behind" else each.verdict, words=True
    ),
)
_LAWS = TableColumn(heading="laws", cell=lambda each: each.in_words, words=True)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class LawTable(WithAxes, Summarised, Related):
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

    def disagreement(self) -> str:
        """First contradiction: not exactly one chosen set of laws, or a model that was not compared."""
        chosen = [each for each in self.tried if each.verdict == "chosen"]
        if len(chosen) != 1:
            return f"of {len(self.tried)} sets of laws {len(chosen)} are chosen"
        if chosen[0].model != self.model:
            return f"it is of {self.model}, and laws of {chosen[0].model} are chosen"
        strange = {*(each.model for each in self.tried), *self.failed} - set(self.models)
        return f"{min(strange)} is none of its models" if strange else ""

    def _named_arrays(self) -> NamedArrays:
        words = {
            "model": ("", "model"),
            "verdict": ("", "place among the laws"),
            "n_params": ("1", "number of parameters"),
            "fit_percent": ("%", "fit to all tests"),
            "left_out_percent": ("%", "fit to what was left out"),
            "left_out_error": ("%", "standard error of the fit to what was left out"),
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
        """The laws for a terminal, the longest column last."""
        return text_table((*self._model, *_COLUMNS, _LAWS), self.tried)

    @property
    def page_table(self) -> Table:
        """The laws for a page, where they name the row."""
        return page_table("Laws that were tried", (*self._model, _LAWS, *_COLUMNS), self.tried)

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
        table = self.table
        return Summary(
            title=f"Choice of current laws: {f'{len(self.models)} models' if self.is_of_several else self.model}",
            facts=(("evaluated on", self.held_out),),
            columns=table.columns,
            rows=table.rows,
            notes=(self.sentence, *self.notes),
        )


def judge_laws(tried: Sequence[TriedLaws]) -> tuple[TriedLaws, ...]:
    """The laws of all models, best first, with verdicts by the one-standard-error rule."""
    order = sorted(tried, key=lambda laws: -laws.left_out_percent)
    good = [laws for laws in order if is_as_good(laws.left_out, order[0].left_out)]
    chosen = min(good, key=lambda laws: laws.n_params)

    def verdict(laws: TriedLaws) -> LawVerdict:
        if laws is chosen:
            return "chosen"
        return "as good" if laws in good else "behind"

    return tuple(replace(laws, verdict=verdict(laws)) for laws in order)


def sentence_on(table: LawTable) -> str:
    """What was chosen, how it predicts, and what lies behind."""
    best, chosen, names = table.tried[0], table.chosen_laws, {each.model for each in table.tried}
    error = "" if chosen.left_out_error is None else f", standard error {chosen.left_out_error:.2g}"
    count = f"{len(table.tried)} sets of laws" + (f" of {len(names)} models" if len(names) > 1 else "")
    of_model = f" of {chosen.model}" if table.is_of_several else ""
    text = (
        f"Of {count}, the one{of_model} with {chosen.n_params} parameters is chosen ({chosen.in_words}): its mean "
        f"left-out fit is {chosen.left_out_percent:.2f} % ({table.held_out}{error}), its median "
        f"{chosen.median_percent:.2f} %"
    )
    if best is not chosen:
        behind = best.left_out_percent - chosen.left_out_percent
        of_model = f", of {best.model}," if table.is_of_several else ","
        text += (
            f"; that is {behind:.2f} points behind the best{of_model} which has {best.n_params} parameters "
            f"({best.in_words}), and within one standard error of it"
        )
    if chosen.not_predicted:
        text += (
            f"; {', '.join(chosen.not_predicted)} could not be simulated when left out, which counts as 0 %"
        )
    if not table.complete:
        text += "; the choice was interrupted, and further laws were not tried"
        missing = [name for name in table.models if name not in names and name not in table.failed]
        text += f", nor any of {', '.join(missing)}" if missing else ""
    return text + "."
