"""Ranking of families of models by their left-out fit, and its conclusion in words.

A family whose fit is that of a simpler one in the same comparison has collapsed, and counts as the simpler one.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mrwork.base.arguments import NotNegative, Whole
from mrwork.base.labelled import NamedArrays, WithAxes, columns_of, labels_of
from mrwork.base.numbers import format_fixed
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.table import Table, TableColumn, text_table
from mrwork.base.values import Floats
from mrwork.dampers.coordinates import Box
from mrwork.errors import SettingError
from mrwork.identification.fit import NEGLIGIBLE, Fit
from mrwork.identification.result import MANY, BuildingCost
from mrwork.identification.verdicts import Scale
from mrwork.records import DamperTest

# Residuals of each test, in deviations of its force, shape (n_counted,).
Residuals = Sequence[Floats]

# Gain in the log-likelihood ratio, for each further parameter, that is not more than chance (Akaike's criterion).
_CHANCE = 2.0
# A family that failed is far better where the error of the chosen one on all tests is above this multiple of its own.
_FAR_BETTER = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Collapse:
    """The simpler family, `model`, that gives the same force, and the reason in words."""

    model: str
    reason: str


def find_collapses(
    fits: Mapping[str, Fit],
    residuals: Mapping[str, Residuals],
    n_params: Mapping[str, int],
    tests: tuple[DamperTest, ...],
    n_effective: float,
) -> dict[str, Collapse]:
    """Families, by model, whose fit is that of a simpler one: the one with the fewest parameters.

    The forces are the same up to chance: the mean square of the difference of the residuals, and the gain in the
    log-likelihood, `n_eff ln(S_simpler/S)`, are at most 2 for each further parameter (Akaike's criterion). And more of
    its parameters are on a bound or undetermined, that is with a standard error above their value or half their range.
    """
    doubtful = {model: _doubtful_parameters(fit, tests) for model, fit in fits.items()}
    n_doubtful = {model: sum(map(len, states.values())) for model, states in doubtful.items()}
    joined = {model: np.concatenate(residuals[model]) for model in fits}
    collapses: dict[str, Collapse] = {}
    for model in fits:
        simpler = sorted(
            (each for each in fits if n_params[each] < n_params[model]), key=lambda each: n_params[each]
        )
        for other in simpler:
            chance = _CHANCE * (n_params[model] - n_params[other]) / n_effective
            squared, theirs = (float(np.mean(joined[each] ** 2)) for each in (model, other))
            difference = float(np.mean((joined[model] - joined[other]) ** 2))
            same = difference <= chance * theirs and theirs <= squared * np.exp(chance)
            if same and n_doubtful[model] > n_doubtful[other]:
                states = [
                    f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} {state}"
                    for state, names in doubtful[model].items()
                    if names
                ]
                collapses[model] = Collapse(
                    model=other,
                    reason=f"its force is that of {fits[other].spec.title} to {100.0 * np.sqrt(difference):.2g} % of "
                    f"the force's deviation, and {' and '.join(states)}",
                )
                break
    return collapses


def _doubtful_parameters(fit: Fit, tests: tuple[DamperTest, ...]) -> dict[str, list[str]]:
    """Free parameters on a bound, and those with a standard error above their value or half their range, or none."""
    spec, theta = fit.spec, np.array(fit.theta)
    scale = Scale.of(spec, Box.of(spec).with_bounds(fit.settings.bounds), tests, theta)
    free = [(index, each) for index, each in enumerate(fit.estimates) if each.is_free]
    return {
        "on a bound": [each.name for _, each in free if each.at_bound],
        "undetermined": [
            each.name
            for index, each in free
            if each.verdict == "not identifiable"
            or (each.standard_error is not None and each.standard_error > scale.size[index])
        ],
    }


DEFINITIONS = (
    "Left-out fit: 100 (1 - NRMSE) in percent of what the fit has not seen, the mean over folds with its standard "
    "error. A family is as good as the best within one standard error of the paired difference, not more than that "
    f"of the best itself, or within {NEGLIGIBLE:g} points; of those one that takes fewer than {MANY} integration steps "
    "a sample in a building is chosen, and of these the one with the fewest parameters.",
    "Unusable: a law vanishes or leaves its range within the tested commands, or no building can be simulated with the "
    "fit. Such a family is not chosen while others are left.",
    "Collapsed: the fit is that of a simpler family, because the forces of the two differ by no more than chance, and "
    "more of its parameters are on a bound or undetermined. Such a family counts as the simpler one and is not chosen.",
    "Provisional: the family that would be chosen of those that predict what was left out, while one that failed there "
    f"has less than 1/{_FAR_BETTER:g} of its error on all tests. None is chosen then.",
)

RankVerdict = Literal["chosen", "provisional", "as good", "behind", "unusable", "collapsed", "failed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Evidence:
    """Results of one family; `left_out` has the error of each unit left out, empty where a prediction failed.

    `objections` speak against the choice of the family, and `cost` is that in a building.
    """

    model: str
    title: str
    n_params: int
    status: str
    seconds: float
    reason: str = ""
    fit_percent: float | None = None
    left_out: tuple[float, ...] = ()
    collapse: Collapse | None = None
    objections: tuple[str, ...] = ()
    cost: BuildingCost | None = None

    @property
    def is_costly(self) -> bool:
        """Whether the family takes many steps in a building."""
        return self.cost is not None and self.cost.is_high


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """One row of the ranking, in percent and percentage points; differences to the best family are positive.

    Those of a collapsed family, which has the fit of `same_as` and is not ranked, may be negative.
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
    same_as: str = ""

    @property
    def is_chosen(self) -> bool:
        """Whether the family is chosen, if only provisionally."""
        return self.verdict in ("chosen", "provisional")

    @property
    def left_out_in_words(self) -> str:
        """The fit to what was left out, with its standard error."""
        return _with_error(self.left_out_percent, self.left_out_error, 2)

    @property
    def remark(self) -> str:
        """The verdict, what makes it doubtful, and why the family failed."""
        parts = (
            "" if self.verdict == "behind" else self.verdict,
            "not converged" if self.status == "not_converged" else "",
            self.reason,
        )
        return ", ".join(filter(None, parts))


def _with_error(value: float | None, error: float | None, decimals: int) -> str:
    text = format_fixed(value, decimals)
    return text if value is None or not error else f"{text} ± {format_fixed(error, decimals)}"


_MODEL = TableColumn(heading="model", cell=lambda each: each.model)
_COLUMNS = (
    TableColumn(heading="parameters", cell=lambda each: str(each.n_params)),
    TableColumn(heading="fit %", cell=lambda each: format_fixed(each.fit_percent, 2)),
    TableColumn(heading="left-out fit %", cell=lambda each: each.left_out_in_words),
    TableColumn(
        heading="behind, points",
        cell=lambda each: _with_error(each.left_out_behind, each.left_out_behind_error, 2),
    ),
    TableColumn(heading="seconds", cell=lambda each: format_fixed(each.seconds, 1)),
    TableColumn(heading="remark", cell=lambda each: each.remark, words=True),
)


def rank(evidence: Sequence[Evidence]) -> tuple[Standing, ...]:
    """Rank families by their left-out fit, best first; collapsed families follow, those that failed come last.

    The rules are those of `DEFINITIONS`; a family counts as collapsed if the simpler one predicts the tests left out.
    """
    predicted = sorted(
        (each for each in evidence if each.left_out), key=lambda each: float(np.mean(each.left_out))
    )
    if not predicted:
        reasons = "; ".join(f"{each.model}: {each.reason}" for each in evidence)
        raise SettingError(f"no family of models predicts what was left out of its fit ({reasons})")
    simpler = {each.model for each in predicted}
    distinct = [each for each in predicted if each.collapse is None or each.collapse.model not in simpler]
    sound = [each for each in distinct if not each.objections] or distinct
    best = sound[0]
    as_good = [each for each in sound if is_as_good(each.left_out, best.left_out)]
    chosen = min(as_good, key=lambda each: (each.is_costly, each.n_params))
    standings = []
    same = [each for each in predicted if each not in distinct]
    failed = [each for each in evidence if not each.left_out]
    unusable = [each for each in distinct if each not in sound]
    for each in [*sound, *unusable, *same, *failed]:
        verdict: RankVerdict = "failed" if not each.left_out else "collapsed" if each in same else "behind"
        if each is chosen:
            verdict = "provisional" if any(_is_far_better(other, chosen) for other in failed) else "chosen"
        elif each in as_good:
            verdict = "as good"
        elif each in unusable:
            verdict = "unusable"
        standings.append(_standing(each, verdict, best))
    return tuple(standings)


def _standing(own: Evidence, verdict: RankVerdict, best: Evidence) -> Standing:
    percent = 100.0 * np.array(own.left_out)
    difference = percent - 100.0 * np.array(best.left_out) if percent.size else percent
    same = own.collapse if verdict == "collapsed" else None
    return Standing(
        model=own.model,
        title=own.title,
        n_params=own.n_params,
        verdict=verdict,
        status=own.status,
        reason=(own.reason or "; ".join(own.objections)) if same is None else same.reason,
        seconds=own.seconds,
        fit_percent=own.fit_percent,
        same_as="" if same is None else same.model,
        left_out_percent=100.0 - float(percent.mean()) if percent.size else None,
        left_out_error=error_of_mean(percent),
        left_out_behind=float(difference.mean()) if percent.size else None,
        left_out_behind_error=error_of_mean(difference),
    )


def is_as_good(own: Sequence[float], best: Sequence[float]) -> bool:
    """Whether NRMSE of folds left out are as good as the best, by the rule of `DEFINITIONS`.

    The error of the difference is limited to that of the best: a family that fails on one test has a large one.
    """
    difference = 100.0 * (np.array(own) - np.array(best))
    errors = [error_of_mean(difference), error_of_mean(100.0 * np.array(best))]
    allowed = min((error for error in errors if error is not None), default=0.0)
    return float(difference.mean()) <= max(allowed, NEGLIGIBLE)


def _is_far_better(failed: Evidence | Standing, chosen: Evidence | Standing) -> bool:
    """Whether a family that failed has far less error on all tests than the chosen one."""
    if failed.fit_percent is None or chosen.fit_percent is None:
        return False
    return 100.0 - chosen.fit_percent > _FAR_BETTER * (100.0 - failed.fit_percent)


def error_of_mean(values: Floats) -> float | None:
    """Standard error of the mean, `None` for a single value."""
    return float(np.std(values, ddof=1) / np.sqrt(values.size)) if values.size > 1 else None


# Units and words of what a ranking has for each family.
_ARRAYS = {
    "title": ("", "name in words"),
    "verdict": ("", "place in the ranking"),
    "status": ("", "how the identification ended"),
    "same_as": ("", "family whose fit it has"),
    "n_params": ("1", "number of parameters"),
    "seconds": ("s", "time of the identifications"),
    "fit_percent": ("%", "fit to all tests"),
    "left_out_percent": ("%", "fit to what was left out"),
    "left_out_error": ("%", "standard error of the fit to what was left out"),
    "left_out_behind": ("%", "difference to the best in the fit to what was left out"),
    "left_out_behind_error": ("%", "standard error of that difference"),
}


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Ranking(WithAxes, Summarised):
    """Families in order of merit, the chosen one, and the reason; an interrupt left those of `missing` undone.

    `chosen` is provisional, as its standing says, where a family that failed fits all tests far better.
    """

    chosen: str
    sentence: str
    standings: tuple[Standing, ...]
    held_out: str
    n_folds: Whole
    remarks: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    definitions: tuple[str, ...] = DEFINITIONS

    def _named_arrays(self) -> NamedArrays:
        return NamedArrays(
            title=f"Choice of model: {self.chosen}",
            rows=("model",),
            labels={"model": labels_of([each.model for each in self.standings])},
            arrays=columns_of(self.standings, "model", _ARRAYS),
        )

    @property
    def chosen_standing(self) -> Standing:
        """The chosen family, or the provisional one."""
        return next(each for each in self.standings if each.is_chosen)

    @property
    def doubts(self) -> tuple[str, ...]:
        """Sentences on families that failed, and on why none is chosen."""
        failed = [each for each in self.standings if each.verdict == "failed"]
        if not failed:
            return ()
        named = list_names([f"{each.model} ({each.reason})" for each in failed])
        their = "its predictions" if len(failed) == 1 else "their predictions"
        none = _none_chosen(self.standings, self.chosen_standing)
        return (f"not compared, as {their} failed: {named}", *([none] if none else []))

    @property
    def table(self) -> Table:
        """The families by name."""
        return text_table((_MODEL, *_COLUMNS), self.standings)

    def _summary(self) -> Summary:
        provisional = ", provisional" if self.chosen_standing.verdict == "provisional" else ""
        return Summary(
            title=f"Choice of model: {self.chosen}{provisional}",
            facts=(("evaluated on", self.held_out),),
            tables=[self.table],
            notes=(self.sentence, *(f"note: {remark}" for remark in self.remarks)),
        )


# Number of folds below which a standard error is uncertain.
_FEW_FOLDS = 4


def ranking_of(
    standings: tuple[Standing, ...],
    *,
    held_out: str,
    n_folds: int,
    remarks: Sequence[str] = (),
    missing: Sequence[str] = (),
) -> Ranking:
    """Ranking of these standings with its sentence."""
    chosen = next(each for each in standings if each.is_chosen)
    failed = [each.title for each in standings if each.verdict == "failed"]
    parts = [f"Failed, and so not compared: {', '.join(failed)}"] if failed else []
    parts += [_none_chosen(standings, chosen), _choice(standings, chosen, held_out)]
    runner_up = next((each for each in standings if each.verdict == "behind"), None)
    if runner_up is not None:
        parts.append(
            f"Next comes {runner_up.title} with {runner_up.n_params} parameters, "
            f"{_points(runner_up, chosen)} behind the best"
        )
    if 1 < n_folds < _FEW_FOLDS:
        parts.append(f"A standard error from {n_folds} folds is uncertain")
    titles = {each.model: each.title for each in standings}
    parts += [
        f"{each.title} counts as {titles[each.same_as]}: {each.reason}"
        for each in standings
        if each.verdict == "collapsed"
    ]
    if missing:
        parts.append(f"The comparison was interrupted and lacks {', '.join(missing)}")
    return Ranking(
        chosen=chosen.model,
        sentence=". ".join(part for part in parts if part) + ".",
        standings=standings,
        held_out=held_out,
        n_folds=n_folds,
        remarks=tuple(remarks),
        missing=tuple(missing),
    )


def cost_remark(standings: Sequence[Standing], evidence: Mapping[str, Evidence]) -> tuple[str, ...]:
    """A sentence where the chosen family is costly in a building; it names the best one that is not."""
    chosen = next(each for each in standings if each.is_chosen)
    cost = evidence[chosen.model].cost
    if cost is None or not cost.is_high:
        return ()
    text = f"the fit of {chosen.title} takes {cost.in_words}"
    cheap = [
        each for each in standings if evidence[each.model].left_out and not evidence[each.model].is_costly
    ]
    if not cheap:
        return (f"{text}, and so does every other that predicts what was left out",)
    best = min(cheap, key=lambda each: sum(evidence[each.model].left_out))
    return (
        f"{text}; of those that take fewer than {MANY} {best.title} comes nearest ({best.left_out_percent:.2f} % "
        f"against {chosen.left_out_percent:.2f} % left out)",
    )


def _none_chosen(standings: Sequence[Standing], chosen: Standing) -> str:
    """A sentence where the choice is provisional, else nothing."""
    if chosen.verdict != "provisional":
        return ""
    better = [each for each in standings if each.verdict == "failed" and _is_far_better(each, chosen)]
    named = list_names(
        [
            f"{each.title}, which failed, fits all tests far better ({each.fit_percent:.2f} %)"
            for each in better
        ]
    )
    return (
        f"No family is chosen: {named} than {chosen.title} ({chosen.fit_percent:.2f} %), the best of those that could "
        "be compared; change what it failed for and compare again"
    )


def _choice(standings: tuple[Standing, ...], chosen: Standing, held_out: str) -> str:
    count = f"Of {len(standings)} families" if len(standings) > 1 else "The only family"
    error = "" if chosen.left_out_error is None else f", standard error {chosen.left_out_error:.2g}"
    verb = "remains" if chosen.verdict == "provisional" else "is chosen"
    text = (
        f"{count}, {chosen.title} with {chosen.n_params} parameters {verb}: its mean left-out fit is "
        f"{chosen.left_out_percent:.2f} % ({held_out}{error})"
    )
    best = standings[0]
    if best is not chosen:
        more = best.n_params - chosen.n_params
        reason = (
            f"which has {more} parameters more: as good, and simpler"
            if more > 0
            else "as good, and it takes fewer steps in a building"
        )
        text += f", {_points(chosen, best)} behind {best.title}, the best, {reason}"
    others = [each for each in standings if each.verdict == "as good" and each is not best]
    if others:
        text += f". As good with no fewer parameters: {', '.join(each.title for each in others)}"
    return text


def _points(own: Standing, other: Standing) -> str:
    """Difference in percentage points with the standard error of the paired difference; one of the two is the best."""
    behind = own.left_out_behind or other.left_out_behind or 0.0
    error = own.left_out_behind_error
    return f"{behind:.2f} points" if error is None else f"{behind:.2f} ± {error:.2f} points"
