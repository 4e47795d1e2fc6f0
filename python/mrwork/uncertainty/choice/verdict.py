"""A ranking in words: the sentence that a reviewer would write, and how its numbers are defined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mrwork.summary import Summarised, Summary, rounded
from mrwork.uncertainty.choice.ranking import HAIR, Standing

# Folds whose scatter hardly tells a standard error.
_FEW = 4
# A difference in BIC below this is not worth a mention (Kass and Raftery, JASA 90, 1995, 773-795).
_BARE = 2.0

DEFINITIONS = (
    "Left-out fit: 100 (1 - NRMSE) in percent of what the fit has not seen, the mean over folds with its standard "
    "error. A family is as good as the best within one standard error of the paired difference, not more than that "
    f"of the best itself, or within {HAIR:g} points; of those the one with the fewest parameters is chosen.",
    "ELPD: expected log predictive density of a block of whole cycles given the other blocks (PSIS-LOO), residuals in "
    "deviations of each test's force, the log density tempered by n_eff / n. Cycles of one test repeat, so it "
    "is about more of the same tests, not about another excitation.",
    "BIC: n_eff ln(mean squared residual in deviations) + k ln(n_eff), with k free parameters and n_eff "
    "effective samples, those of the residuals of the family that fits best, for all families alike. Every cycle "
    "counts anew in n_eff though cycles repeat, so that differences in ELPD and BIC are upper limits.",
)


@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class Ranking(Summarised):
    """Families in their order, the one to take, and why.

    `held_out` says what each was judged on; `n_folds` of it were left out in turn. `remarks` are about the comparison
    as a whole, `missing` names families that an interrupt left undone.
    """

    chosen: str
    sentence: str
    standings: tuple[Standing, ...]
    held_out: str
    n_folds: int
    n_blocks: int | None
    n_effective: float | None
    remarks: tuple[str, ...] = ()
    missing: tuple[str, ...] = ()
    definitions: tuple[str, ...] = DEFINITIONS

    def _summary(self) -> Summary:
        return Summary(
            title=f"Choice of model: {self.chosen}",
            facts=(("judged on", self.held_out),),
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
            notes=(self.sentence,),
        )


def concluded(
    standings: tuple[Standing, ...],
    *,
    held_out: str,
    n_folds: int,
    n_blocks: int | None,
    n_effective: float | None,
    remarks: Sequence[str] = (),
    missing: Sequence[str] = (),
) -> Ranking:
    """The ranking of these standings, with its sentence."""
    chosen = next(each for each in standings if each.verdict == "chosen")
    parts = [_choice(standings, chosen, held_out)]
    runner_up = next((each for each in standings if each.verdict == "behind"), None)
    if runner_up is not None:
        parts.append(
            f"Next comes {runner_up.title} with {runner_up.n_params} parameters, "
            f"{_points(runner_up, chosen)} behind the best"
        )
    parts += [_by_elpd(standings, chosen, n_blocks), _by_bic(standings, chosen)]
    if 1 < n_folds < _FEW:
        parts.append(f"So few as {n_folds} folds hardly tell a standard error")
    failed = [each.title for each in standings if each.verdict == "failed"]
    if failed:
        parts.append(f"Not judged: {', '.join(failed)}")
    if missing:
        parts.append(f"The comparison was interrupted and lacks {', '.join(missing)}")
    return Ranking(
        chosen=chosen.model,
        sentence=". ".join(part for part in parts if part) + ".",
        standings=standings,
        held_out=held_out,
        n_folds=n_folds,
        n_blocks=n_blocks,
        n_effective=n_effective,
        remarks=tuple(remarks),
        missing=tuple(missing),
    )


def _choice(standings: tuple[Standing, ...], chosen: Standing, held_out: str) -> str:
    count = f"Of {len(standings)} families" if len(standings) > 1 else "The only family"
    error = "" if chosen.left_out_error is None else f", standard error {chosen.left_out_error:.2g}"
    text = (
        f"{count}, {chosen.title} with {chosen.n_params} parameters is chosen: its mean left-out fit is "
        f"{chosen.left_out_percent:.2f} % ({held_out}{error})"
    )
    best = standings[0]
    if best is not chosen:
        more = best.n_params - chosen.n_params
        text += (
            f", {_points(chosen, best)} behind {best.title}, the best, which has {more} parameters more: "
            "as good, and simpler"
        )
    others = [each for each in standings if each.verdict == "as good" and each is not best]
    if others:
        text += f". As good with no fewer parameters: {', '.join(each.title for each in others)}"
    return text


def _points(own: Standing, other: Standing) -> str:
    """How far behind in points, with the error of the paired difference; both are stated against the best."""
    behind = own.left_out_behind or other.left_out_behind or 0.0
    error = own.left_out_behind_error
    return f"{behind:.2f} points" if error is None else f"{behind:.2f} ± {error:.2f} points"


def _by_elpd(standings: tuple[Standing, ...], chosen: Standing, n_blocks: int | None) -> str:
    best = next((each for each in standings if each.elpd_behind == 0.0), None)
    if best is None or chosen.elpd_behind is None:
        return ""
    doubtful = [each for each in (best, chosen) if each.unreliable_blocks]
    doubt = ""
    if doubtful:
        share = max(each.unreliable_blocks or 0 for each in doubtful)
        blocks = "1 block" if share == 1 else f"{share} blocks"
        doubt = f", though the Pareto k of {blocks} is above 0.7: importance weights are not reliable there"
    if best is chosen:
        return f"PSIS-LOO over {n_blocks} blocks agrees{doubt}"
    error = chosen.elpd_behind_error or 0.0
    by = f"{chosen.elpd_behind:.1f} ± {error:.1f} in log density over {n_blocks} blocks"
    if chosen.elpd_behind <= error:
        return f"PSIS-LOO cannot tell it from {best.title} ({by}){doubt}"
    return f"PSIS-LOO prefers {best.title}, by {by}{doubt}"


def _by_bic(standings: tuple[Standing, ...], chosen: Standing) -> str:
    best = next((each for each in standings if each.bic_behind == 0.0), None)
    if best is None or chosen.bic_behind is None:
        return ""
    if best is chosen:
        return "BIC agrees"
    if chosen.bic_behind < _BARE:
        return f"BIC hardly tells it from {best.title} ({chosen.bic_behind:.1f})"
    return f"BIC prefers {best.title}, by {chosen.bic_behind:.1f}"
