"""Conclusion of a ranking of families in words: which is chosen, why, and what other criteria say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from mrwork.identification.building_cost import MANY, BuildingCost
from mrwork.uncertainty.choice.ranking import Ranking, Standing, is_as_good

# Number of folds below which a standard error is uncertain.
_FEW_FOLDS = 4
# A smaller difference in BIC is negligible (Kass and Raftery, JASA 90, 1995, 773-795).
_NEGLIGIBLE_BIC = 2.0


def ranking_of(
    standings: tuple[Standing, ...],
    *,
    held_out: str,
    n_folds: int,
    n_blocks: int | None,
    n_effective: float | None,
    remarks: Sequence[str] = (),
    missing: Sequence[str] = (),
) -> Ranking:
    """Ranking of these standings with its sentence."""
    chosen = next(each for each in standings if each.verdict == "chosen")
    parts = [_choice(standings, chosen, held_out)]
    runner_up = next((each for each in standings if each.verdict == "behind"), None)
    if runner_up is not None:
        parts.append(
            f"Next comes {runner_up.title} with {runner_up.n_params} parameters, "
            f"{_points(runner_up, chosen)} behind the best"
        )
    parts += [_by_elpd(standings, chosen, n_blocks), _by_bic(standings, chosen)]
    if 1 < n_folds < _FEW_FOLDS:
        parts.append(f"A standard error from {n_folds} folds is uncertain")
    titles = {each.model: each.title for each in standings}
    parts += [
        f"{each.title} counts as {titles[each.same_as]}: {each.reason}"
        for each in standings
        if each.verdict == "collapsed"
    ]
    failed = [each.title for each in standings if each.verdict == "failed"]
    if failed:
        parts.append(f"Failed: {', '.join(failed)}")
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


def cost_remark(
    standings: Sequence[Standing],
    left_out: Mapping[str, tuple[float, ...]],
    costs: Mapping[str, BuildingCost],
) -> tuple[str, ...]:
    """A sentence where the chosen family is costly in a building; it names the best one that is not.

    `left_out` are the NRMSE of the folds by model, `costs` those of the families that were identified.
    """
    chosen = next(each for each in standings if each.verdict == "chosen")
    if not costs[chosen.model].is_high:
        return ()
    text = f"the fit of {chosen.title} takes {costs[chosen.model].in_words}"
    cheap = [
        each
        for each in standings
        if each.model in costs and left_out.get(each.model) and not costs[each.model].is_high
    ]
    if not cheap:
        return (f"{text}, and so does every other that predicts what was left out",)
    best = min(cheap, key=lambda each: sum(left_out[each.model]))
    found = f"{best.left_out_percent:.2f} % against {chosen.left_out_percent:.2f} %"
    steps = f"{costs[best.model].steps:.0f}"
    if is_as_good(left_out[best.model], left_out[chosen.model]):
        return (
            f"{text}; {best.title} is as good ({found} left out) and takes {steps}: use it in studies of the tested "
            "range",
        )
    return (f"{text}; of those that take fewer than {MANY} {best.title} comes nearest ({found} left out)",)


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
    """Difference in percentage points with the standard error of the paired difference; one of the two is the best."""
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
        return f"PSIS-LOO does not distinguish it from {best.title} ({by}){doubt}"
    return f"PSIS-LOO prefers {best.title}, by {by}{doubt}"


def _by_bic(standings: tuple[Standing, ...], chosen: Standing) -> str:
    best = next((each for each in standings if each.bic_behind == 0.0), None)
    if best is None or chosen.bic_behind is None:
        return ""
    if best is chosen:
        return "BIC agrees"
    if chosen.bic_behind < _NEGLIGIBLE_BIC:
        return f"BIC does not distinguish it from {best.title} ({chosen.bic_behind:.1f})"
    return f"BIC prefers {best.title}, by {chosen.bic_behind:.1f}"
