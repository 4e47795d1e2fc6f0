"""Ranking of candidates by their fit to what was left out: the rule of a choice, its table, and its sentence.

A candidate is a model with the laws of its parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import inf
from operator import attrgetter
from typing import Any, Literal

import numpy as np

from mrwork.base.arguments import NotNegative, Whole
from mrwork.base.labelled import NamedArray, NamedArrays, WithAxes, columns_of
from mrwork.base.numbers import format_fixed
from mrwork.base.remark import Measured, Remark, RemarkKind
from mrwork.base.summary import Summarised, Summary, list_names
from mrwork.base.table import Column, Table
from mrwork.base.units import CommandUnit
from mrwork.base.values import Floats
from mrwork.dampers.dependence import Dependence, LawName, dependence_of
from mrwork.dampers.spec import DamperSpec
from mrwork.errors import SettingError
from mrwork.identification.fit import FAR_BETTER, NEGLIGIBLE, STATUS_IN_WORDS
from mrwork.identification.result import MANY, BuildingCost
from mrwork.records import DamperTest
from mrwork.uncertainty.choice.objections import objections_to
from mrwork.uncertainty.choice.splits import Split, Splits

# The chosen one is provisional where one that failed has an error on all tests below this share of its.
_PROVISIONAL = 0.5
# NRMSE of a prediction by the mean force, which a test counts that cannot be predicted.
NOT_PREDICTED = 1.0

_RULES = (
    "Left-out fit: 100 (1 - NRMSE) in percent of what the fit has not seen, the mean of two kinds with equal weights. "
    "Inside: tests that lie between those that remain. Beyond: the fastest, slowest and largest motions, each left out "
    "with every test at or beyond it. Both are means over motions, with a standard error, of the geometric mean of the "
    "NRMSE of their tests. A test that cannot be predicted counts as 0 %.",
    "Between: the same of the tests at each constant command that lies between others, predicted without all tests at "
    "it. It has no value where the commands that remain do not determine the candidate.",
    "Behind: the difference to the best, paired motion by motion, with its standard error. A candidate is as good as "
    "the best within one standard error of it, no more than that of the best itself, or within "
    f"{NEGLIGIBLE:g} points, and, where both have a value there, as good between the commands as the best of those; of "
    f"those one that takes fewer than {MANY} integration steps a sample in a building is "
    "chosen, of these the one with the fewest parameters, or another one as simple that predicts as well as it and has "
    f"less than {FAR_BETTER:g} of its error on all tests. Of those as simple, and within an error of "
    "the best of these between the commands, or else of all, polynomials through values come first.",
    "Unusable: a law vanishes or leaves its range within the tested commands, or has an extremum between them that no "
    "test shows, the force falls beyond the tested velocities, or no building can be simulated with it. Such a "
    "candidate is not chosen while others are left.",
    "Provisional: the candidate that would be chosen, while one that could not predict a test has less than "
    f"{_PROVISIONAL:g} of its error on all tests. None is chosen then.",
    "The left-out fit of the chosen candidate is optimistic, because it was chosen by it, and all tests decide which "
    "effects on the force and which rates of the driver are fitted; tests that were not given measure it without bias.",
)
_RULE_OF_COLLAPSE = (
    "Collapsed: the fit is that of a simpler family, because the forces of the two differ by no more than chance, and "
    "more of its parameters are on a bound or undetermined. Such a family counts as the simpler one and is not chosen."
)
_RULES_OF_LAWS = (
    "The search starts with every positive parameter quadratic in the command, then every one but offsets, and tries "
    "neighbours of the best laws, of the simplest as good, and of others as good: those that promise most when the "
    "tests are linearised about the fits before. A law of degree n is the curve through n + 1 values at commands, "
    "or, by a name with log, through the logarithms of a positive parameter; one that saturates has two values and a "
    "rate. Of forms that no test tells apart the least curved one without an extremum between the tested commands is "
    "taken, straight lines last. Laws are fitted to cycles from the middle of all tests, of a varying command to all "
    "cycles with fewer samples, and to all but those of each split: without a split from samples of its own at first, "
    "then from its fit of the laws before. The best set and the chosen one are fitted on to the whole tests; numbers "
    "of the others are of fits to these cycles.",
)

Place = Literal["chosen", "provisional", "as good", "behind", "unusable", "collapsed", "failed", "goes on"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """A candidate of a choice, in percent and percentage points; differences to the best one are positive.

    `laws` are without constant ones. `left_out` has the error (NRMSE) of each unit left out, empty where the
    candidate failed, for the `reason`; `median_percent` and `worst_percent` are of single tests, of which
    `not_predicted` could not be simulated. `steps` are of a sample in a building, `None` where too many. The
    `remarks` speak against a choice. A collapsed candidate, which has the fit of `same_as`, may be ahead. Numbers
    `of_excerpts` are of fits to some cycles of each test.
    """

    model: str
    title: str
    n_params: Whole
    laws: dict[str, LawName] = field(default_factory=dict)
    verdict: Place = "behind"
    status: str = ""
    reason: str = ""
    seconds: NotNegative = 0.0
    fit_percent: float | None = None
    left_out: tuple[float, ...] = ()
    left_out_percent: float | None = None
    left_out_error: NotNegative | None = None
    left_out_behind: float | None = None
    left_out_behind_error: NotNegative | None = None
    inside_percent: float | None = None
    outside_percent: float | None = None
    median_percent: float | None = None
    worst_percent: float | None = None
    not_predicted: tuple[str, ...] = ()
    remarks: tuple[Remark, ...] = ()
    steps: float | None = None
    is_costly: bool = False
    same_as: str = ""
    between: tuple[float, ...] = ()
    between_percent: float | None = None
    held: dict[str, float] = field(default_factory=dict)
    predicted: tuple[tuple[float | None, ...], ...] = ()
    of_excerpts: bool = False

    @classmethod
    def of(cls, model: DamperSpec, *, reason: str = "") -> Standing:
        """The row of a model that is not fitted, or could not be for the reason."""
        n_params = len(model.parameters)
        return cls(model=model.name, title=model.title, n_params=n_params, status="failed", reason=reason)

    def scored(
        self,
        nrmse: Sequence[Floats],
        splits: Splits,
        spec: DamperSpec,
        theta: Floats,
        tests: Sequence[DamperTest],
    ) -> Standing:
        """The candidate with the NRMSE of what each split predicts, infinite where that could not be simulated.

        It is NaN where the split leaves the candidate open. Of its parameters on all tests, shape (n_params,), it has
        what they cost in a building, and what speaks against.
        """
        left_out = [np.minimum(errors, NOT_PREDICTED) for errors in nrmse]
        single = np.concatenate(left_out)
        single = single[np.isfinite(single)]
        between = splits.between(left_out)
        inside, outside = (None if mean is None else 100.0 * (1.0 - mean) for mean in splits.means(left_out))
        failed = {
            splits.tests[index].name: None
            for members, errors in zip(splits.members, nrmse, strict=True)
            for index, error in zip(members, errors, strict=False)
            if np.isinf(error)
        }
        cost = BuildingCost.of(spec, theta, tests)
        return replace(
            self,
            left_out=tuple(splits.errors(left_out).tolist()),
            inside_percent=inside,
            outside_percent=outside,
            median_percent=100.0 * (1.0 - float(np.median(single))),
            worst_percent=100.0 * (1.0 - float(single.max())),
            not_predicted=tuple(failed),
            between=tuple(between.tolist()),
            between_percent=100.0 * (1.0 - float(np.mean(between))) if between.size else None,
            predicted=tuple(
                tuple(None if np.isnan(error) else error for error in errors.tolist()) for errors in left_out
            ),
            steps=cost.steps if cost.is_possible else None,
            is_costly=cost.is_high,
            remarks=tuple(objections_to(spec, theta, tests, cost)),
        )

    @property
    def has_predicted(self) -> bool:
        """Whether the candidate predicts anything that was left out better than the mean force does."""
        return min(self.left_out, default=NOT_PREDICTED) < NOT_PREDICTED

    @property
    def error(self) -> float:
        """Mean error of what was left out, a share of the force's deviation."""
        return float(np.mean(self.left_out))

    @property
    def n_unusual(self) -> int:
        """Number of laws that are no polynomials through values."""
        return sum(dependence_of(law).form != "polynomial" for law in self.laws.values())

    @property
    def is_chosen(self) -> bool:
        """Whether the candidate is chosen, if only provisionally."""
        return self.verdict in ("chosen", "provisional")

    @property
    def laws_in_words(self) -> str:
        """Each law after the name of its parameter, in one line, then what is held; "all constant" without laws."""
        held = [f"{name} = {value:g}" for name, value in self.held.items()]
        return ", ".join([laws_in_words(self.laws), *held])

    @property
    def in_words(self) -> str:
        """The model with its laws, if any follow from the choice."""
        return f"{self.title} ({self.laws_in_words})" if self.laws or self.held else self.title

    @property
    def left_out_in_words(self) -> str:
        """The fit to what was left out, with its standard error."""
        return _with_error(self.left_out_percent, self.left_out_error)

    @property
    def behind_in_words(self) -> str:
        """The difference to the best, with its standard error."""
        return _with_error(self.left_out_behind, self.left_out_behind_error)

    @property
    def objection(self) -> str:
        """What speaks against a choice, in words."""
        return "; ".join(remark.message for remark in self.remarks)

    @property
    def verdict_in_words(self) -> str:
        """The verdict, what makes it doubtful, and why the candidate failed."""
        parts = (
            "" if self.verdict == "behind" else self.verdict,
            "" if self.status == "converged" else STATUS_IN_WORDS.get(self.status, ""),
            self.reason or self.objection,
            f"{len(self.not_predicted)} tests not predicted" if self.not_predicted else "",
            "costly" if self.is_costly else "",
        )
        return ", ".join(filter(None, parts))


def laws_in_words(laws: Mapping[str, LawName | Dependence]) -> str:
    """Laws in one line."""
    return ", ".join(f"{name} {law}" for name, law in laws.items()) or "all constant"


def _with_error(value: float | None, error: float | None) -> str:
    text = format_fixed(value, 2)
    return text if value is None or not error else f"{text} ± {format_fixed(error, 2)}"


def _percent(key: str, heading: str = "", *, words: str) -> Column:
    return Column(key, heading, "%", words, shown=lambda value: format_fixed(value, 2))


# What a ranking has for each candidate, in tables and in arrays.
_COLUMNS = (
    Column("model", "model", words="model"),
    Column("title", words="name in words"),
    Column("verdict", words="place in the ranking"),
    Column("status", words="how the identification ended"),
    Column("same_as", words="family whose fit it has"),
    Column("n_params", "parameters", words="number of parameters"),
    Column("seconds", unit="s", words="time of the identifications"),
    _percent("fit_percent", "fit", words="fit to all tests"),
    _percent("left_out_percent", words="fit to what was left out"),
    Column("", "left-out fit", "%", of=attrgetter("left_out_in_words")),
    _percent("left_out_error", words="standard error of the fit to what was left out"),
    _percent("inside_percent", "inside", words="fit to what lies inside the tests that remained"),
    _percent("outside_percent", "beyond", words="fit to what lies beyond the tests that remained"),
    _percent("between_percent", "between", words="fit to what lies between the commands that remained"),
    _percent("left_out_behind", words="difference to the best in the fit to what was left out"),
    Column("", "behind", "%", of=attrgetter("behind_in_words")),
    _percent("left_out_behind_error", words="standard error of that difference"),
    _percent("median_percent", words="median fit of single tests left out"),
    _percent("worst_percent", "worst", words="worst fit of single tests left out"),
    Column("", "remark", of=attrgetter("verdict_in_words")),
    Column("", "laws", of=attrgetter("laws_in_words")),
)
# The same of families that are screened.
_SCREENED = [
    *(column for column in _COLUMNS if column.heading in ("model", "left-out fit", "behind")),
    Column("steps", "steps of 1 ms in a building", words="steps", shown=lambda steps: format_fixed(steps, 0)),
    _COLUMNS[-2],
]


def rank(candidates: Sequence[Standing]) -> tuple[Standing, ...]:
    """Candidates by their left-out fit, best first, with verdicts by the rules of `_RULES`.

    Unusable and collapsed ones follow, those that failed come last. A candidate counts as collapsed if the simpler one
    predicts what was left out.
    """
    predicted = sorted(
        (candidate for candidate in candidates if candidate.has_predicted), key=attrgetter("error")
    )
    if not predicted:
        reasons = "; ".join(
            f"{candidate.in_words}: {candidate.reason or 'no test could be predicted'}"
            for candidate in candidates
        )
        raise SettingError(f"no model predicts what was left out of its fit ({reasons})")
    simpler = {candidate.model for candidate in predicted}
    distinct = [candidate for candidate in predicted if candidate.same_as not in simpler]
    sound = [candidate for candidate in distinct if not candidate.remarks] or distinct
    good, simplest, chosen = choose_from(sound)
    instead = ""
    if chosen is not simplest:
        instead = f"as good as {simplest.in_words}, with {_on_all(chosen)} instead of {_on_all(simplest)} on all tests"
    failed = [candidate for candidate in candidates if not candidate.has_predicted]
    lost = [*failed, *(candidate for candidate in predicted if candidate.not_predicted)]

    def judged(candidate: Standing) -> Standing:
        verdict: Place = "behind"
        if candidate is chosen:
            verdict = (
                "provisional" if any(_is_better(other, chosen, _PROVISIONAL) for other in lost) else "chosen"
            )
        elif candidate in good:
            verdict = "as good"
        elif candidate in failed:
            verdict = "failed"
        elif candidate not in distinct:
            verdict = "collapsed"
        elif candidate not in sound:
            verdict = "unusable"
        percent = 100.0 * np.array(candidate.left_out)
        behind = percent - 100.0 * np.array(sound[0].left_out) if percent.size else percent
        return replace(
            candidate,
            verdict=verdict,
            same_as=candidate.same_as if verdict == "collapsed" else "",
            reason=instead
            if candidate is chosen
            else candidate.reason
            if verdict in ("collapsed", "failed")
            else "",
            left_out_percent=100.0 - float(percent.mean()) if percent.size else None,
            left_out_error=error_of_mean(percent),
            left_out_behind=float(behind.mean()) if percent.size else None,
            left_out_behind_error=None if candidate is sound[0] else error_of_mean(behind),
        )

    unusable = [candidate for candidate in distinct if candidate not in sound]
    same = [candidate for candidate in predicted if candidate not in distinct]
    return tuple(map(judged, (*sound, *unusable, *same, *failed)))


def choose_from(ordered: Sequence[Standing]) -> tuple[list[Standing], Standing, Standing]:
    """Of candidates, the best first: those as good as the best, the simplest of these, and the chosen one.

    Another one as simple, which predicts as well as the simplest and fits all tests far better, is chosen in its place:
    predictions of what few folds leave out hardly tell apart what all tests do.
    """
    good = [candidate for candidate in ordered if _is_as_good(candidate.left_out, ordered[0].left_out)]
    between = min((each.between for each in good if each.between), key=np.mean, default=())
    good = [each for each in good if not each.between or _is_as_good(each.between, between)]
    as_simple = attrgetter("is_costly", "n_params")
    least = min(map(as_simple, good))
    simplest = _first_of_equals([each for each in good if as_simple(each) == least])
    better = [
        candidate
        for candidate in ordered
        if as_simple(candidate) == as_simple(simplest)
        and _is_better(candidate, simplest, FAR_BETTER)
        and _is_as_good(candidate.left_out, simplest.left_out)
    ]
    return good, simplest, max(better, key=attrgetter("fit_percent"), default=simplest)


def _first_of_equals(equals: Sequence[Standing]) -> Standing:
    """Of candidates as simple, the best first, the one with fewest unusual laws that is within an error of the best.

    Where some have errors between commands these decide, and the others, which are not known there, come after them.
    """
    known = [(each, each.between) for each in equals if each.between]
    judged = known or [(each, each.left_out) for each in equals]
    best = min((errors for _, errors in judged), key=np.mean)
    near = []
    for candidate, errors in judged:
        behind = np.array(errors) - np.array(best)
        if float(behind.mean()) <= (error_of_mean(behind) or 0.0):
            near.append(candidate)
    return min(near, key=attrgetter("n_unusual"))


def _is_as_good(errors: Sequence[float], best: Sequence[float]) -> bool:
    """Whether the mean errors of what was left out differ by no more than a standard error, or negligibly.

    The error of the difference is limited to the error of the best: a candidate that fails on one test has a large one.
    """
    percent, best_percent = 100.0 * np.array(errors), 100.0 * np.array(best)
    difference = percent - best_percent
    spreads = [error for error in map(error_of_mean, (difference, best_percent)) if error is not None]
    return float(difference.mean()) <= max(min(spreads, default=0.0), NEGLIGIBLE)


def _is_better(candidate: Standing, other: Standing, share: float) -> bool:
    """Whether the error on all tests is below this share of that of the other."""
    if candidate.fit_percent is None or other.fit_percent is None:
        return False
    return 100.0 - candidate.fit_percent < share * (100.0 - other.fit_percent)


def error_of_mean(values: Floats) -> float | None:
    """Standard error of the mean, `None` for a single value."""
    return float(np.std(values, ddof=1) / np.sqrt(values.size)) if values.size > 1 else None


# Number of folds below which a standard error is uncertain.
_FEW_FOLDS = 4
_NOT_COMPARED = RemarkKind("not_compared", "not compared, as it failed: {0}", warns=True)
_NONE_CHOSEN = RemarkKind(
    "none_chosen",
    "no {what} is chosen: {0} than {1} ({percent:.2f} %), the best of those that could be compared",
    "change what it failed for and compare again",
)
_COSTLY = RemarkKind("chosen_costly", "the fit of {0} takes {cost}; {others}")


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Ranking(WithAxes, Summarised):
    """Candidates in order of merit, the chosen model, and the reason; an interrupt left the `missing` models undone.

    `chosen` is provisional, as its standing says, where a candidate that could not predict fits all tests far better.
    Where laws were chosen, `unit` is of the command and `given` are laws that were not chosen; an interrupt also
    leaves further laws untried, so that the ranking is not `complete`. `splits` are of the `tests`, by
    name: each candidate has its errors of what they leave out, `predicted`. The `screened` families were compared
    before, with constant parameters.
    """

    chosen: str
    sentence: str = ""
    standings: tuple[Standing, ...]
    held_out: str
    n_folds: Whole
    remarks: tuple[Remark, ...] = ()
    missing: tuple[str, ...] = ()
    unit: CommandUnit | None = None
    given: dict[str, LawName] = field(default_factory=dict)
    complete: bool = True
    screened: tuple[Standing, ...] = ()
    tests: tuple[str, ...] = ()
    splits: tuple[Split, ...] = ()

    @classmethod
    def of(cls, candidates: Sequence[Standing], **facts: Any) -> Ranking:
        """The ranking of candidates, with its sentence; `facts` are further fields."""
        ranking = cls(chosen="", standings=rank(candidates), **facts)
        remarks = (*ranking.remarks, *ranking._found())
        return replace(
            ranking, chosen=ranking.chosen_standing.model, remarks=remarks, sentence=ranking._sentence()
        )

    def _named_arrays(self) -> NamedArrays:
        # Of one model there are several sets of laws.
        labels = range(len(self.standings)) if self.unit else [standing.model for standing in self.standings]
        laws = {
            f"law_{name}": NamedArray.of(
                [standing.laws.get(name, "constant") for standing in self.standings],
                "candidate",
                long_name=f"law of {name}",
            )
            for name in dict.fromkeys(name for standing in self.standings for name in standing.laws)
        }
        return NamedArrays(
            title=f"Choice of {self._what}: {self.chosen}",
            rows=("candidate",),
            labels={"candidate": NamedArray.of(labels)},
            arrays=columns_of(self.standings, "candidate", _COLUMNS) | laws,
        )

    @property
    def _what(self) -> str:
        return "model" if self.unit is None else "current laws"

    @property
    def definitions(self) -> tuple[str, ...]:
        """What the numbers and verdicts mean, a sentence or a few each."""
        return *_RULES, *((_RULE_OF_COLLAPSE,) if self.unit is None else _RULES_OF_LAWS)

    @property
    def chosen_standing(self) -> Standing:
        """The chosen candidate, or the provisional one."""
        return next(standing for standing in self.standings if standing.is_chosen)

    def _of(self, verdict: Place) -> list[Standing]:
        return [standing for standing in self.standings if standing.verdict == verdict]

    @property
    def n_models(self) -> int:
        """Number of different models, each of which may stand with several sets of laws."""
        return len({standing.model for standing in self.standings})

    @property
    def table(self) -> Table:
        """The candidates; columns that are empty are left out, and so is the model where laws of one were tried."""
        # What says the same in every row is told elsewhere.
        told = {"laws"} if self.unit is None else {"model"} if self.n_models == 1 else set()
        return Table.of((column for column in _COLUMNS if column.heading not in told), self.standings)

    def _summary(self) -> Summary:
        provisional = ", provisional" if self.chosen_standing.verdict == "provisional" else ""
        return Summary(
            title=f"Choice of {self._what}: {self.chosen}{provisional}",
            facts=(("evaluated on", self.held_out),),
            tables=[replace(Table.of(_SCREENED, self.screened), title="Screened families"), self.table],
            remarks=self.remarks,
            notes=(self.sentence,),
        )

    def _found(self) -> Iterator[Remark]:
        """Candidates that failed, why none is chosen, and a costly choice beside the best candidate that is not."""
        chosen = self.chosen_standing
        if failed := [f"{standing.model} ({standing.reason})" for standing in self._of("failed")]:
            yield _NOT_COMPARED.remark(list_names(failed))
        if chosen.verdict == "provisional":
            better = [
                f"{standing.in_words}, which failed, fits all tests far better ({standing.fit_percent:.2f} %)"
                for standing in self.standings
                if (standing.verdict == "failed" or standing.not_predicted)
                and _is_better(standing, chosen, _PROVISIONAL)
            ]
            what = "set of laws" if chosen.laws else "family"
            yield _NONE_CHOSEN.remark(
                list_names(better), chosen.title, what=what, percent=chosen.fit_percent or 0.0
            )
        if not chosen.is_costly:
            return
        steps = inf if chosen.steps is None else chosen.steps
        cheap = [standing for standing in self.standings if standing.has_predicted and not standing.is_costly]
        others = "every other that predicts what was left out takes as many"
        if cheap:
            best = min(cheap, key=attrgetter("error"))
            others = (
                f"of those that take fewer than {MANY} {best.in_words} comes nearest "
                f"({best.left_out_percent:.2f} % against {chosen.left_out_percent:.2f} % left out)"
            )
        cost = BuildingCost(steps=steps).in_words
        yield _COSTLY.remark(chosen.in_words, measured=Measured(steps, ""), cost=cost, others=others)

    def _sentence(self) -> str:
        chosen, best = self.chosen_standing, self.standings[0]
        parts = [self._choice()]
        others = [standing.in_words for standing in self._of("as good") if standing is not best]
        if others:
            parts.append(f"As good with no fewer parameters: {list_names(others)}")
        parts += [
            f"Next comes {runner_up.in_words} with {runner_up.n_params} parameters, "
            f"{_points(runner_up, chosen)} behind the best"
            for runner_up in self._of("behind")[:1]
        ]
        if chosen.not_predicted:
            names = list_names(chosen.not_predicted)
            parts.append(f"{names} could not be simulated when left out, which counts as 0 %")
        if chosen.remarks:
            parts.append(
                f"Something speaks against every candidate, against the chosen one that {chosen.objection}"
            )
        for ahead in [standing for standing in self._of("unusable") if standing.error < best.error][:1]:
            points = 100.0 * (best.error - ahead.error)
            parts.append(
                f"{ahead.in_words} predicts {points:.2f} points better and is left alone, because {ahead.objection}"
            )
        if 1 < self.n_folds < _FEW_FOLDS:
            parts.append(f"A standard error from {self.n_folds} folds is uncertain")
        titles = {standing.model: standing.title for standing in self.standings}
        parts += [
            f"{standing.title} counts as {titles[standing.same_as]}: {standing.reason}"
            for standing in self._of("collapsed")
        ]
        if self.missing:
            parts.append(f"The comparison was interrupted and lacks {', '.join(self.missing)}")
        elif not self.complete:
            parts.append("The choice was interrupted, and further laws were not tried")
        return ". ".join(part for part in parts if part) + "."

    def _choice(self) -> str:
        chosen, best, tried = self.chosen_standing, self.standings[0], len(self.standings)
        count = "The only family" if tried == 1 else f"Of {tried} families"
        if self.unit is not None:
            of_models = f" of {self.n_models} models" if self.n_models > 1 else ""
            count = f"Of {tried} sets of laws{of_models}"
        error = "" if chosen.left_out_error is None else f", standard error {chosen.left_out_error:.2g}"
        verb = "remains" if chosen.verdict == "provisional" else "is chosen"
        laws = "" if self.unit is None else f" ({chosen.laws_in_words})"
        text = (
            f"{count}, {chosen.title} with {chosen.n_params} parameters{laws} {verb}: its mean left-out fit is "
            f"{chosen.left_out_percent:.2f} % ({self.held_out}{error})"
        )
        if chosen.inside_percent is not None and chosen.outside_percent is not None:
            inside, outside = chosen.inside_percent, chosen.outside_percent
            text += f", {inside:.2f} % inside the tests that remain and {outside:.2f} % beyond them"
        if best is not chosen:
            more = best.n_params - chosen.n_params
            reason = chosen.reason or (
                f"which has {more} parameters more: as good, and simpler"
                if more > 0
                else "as good, and it takes fewer steps in a building"
            )
            text += f", {_points(chosen, best)} behind {best.in_words}, the best, {reason}"
        return text


def _on_all(standing: Standing) -> str:
    return f"{format_fixed(standing.fit_percent, 2)} %"


def _points(standing: Standing, other: Standing) -> str:
    """Difference in percentage points with the standard error of the paired difference; one of the two is the best."""
    behind = standing.left_out_behind or other.left_out_behind or 0.0
    error = standing.left_out_behind_error
    return f"{behind:.2f} points" if error is None else f"{behind:.2f} ± {error:.2f} points"
