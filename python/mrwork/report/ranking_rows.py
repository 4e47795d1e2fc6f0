"""A ranking of models as the rows of a table; without its figure, as the command line needs no matplotlib."""

from __future__ import annotations

from dataclasses import dataclass

from mrwork.report import numbers
from mrwork.uncertainty.choice.ranking import Ranking, Standing

HEADINGS = (
    "model",
    "parameters",
    "fit %",
    "left-out fit %",
    "behind, points",
    "Δ ELPD",
    "Δ BIC",
    "seconds",
    "",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RankingRow:
    """One family as text; `remark` holds the verdict and, where the family failed, the reason."""

    model: str
    title: str
    n_params: str
    fit: str
    left_out: str
    behind: str
    elpd_behind: str
    bic_behind: str
    seconds: str
    remark: str
    is_chosen: bool

    @property
    def cells(self) -> tuple[str, ...]:
        """Cells below `HEADINGS` from the second on."""
        return (
            self.n_params,
            self.fit,
            self.left_out,
            self.behind,
            self.elpd_behind,
            self.bic_behind,
            self.seconds,
            self.remark,
        )


def ranking_rows(ranking: Ranking) -> list[RankingRow]:
    """A row per family, best first; failed ones come last."""
    return [_row(each) for each in ranking.standings]


def _row(own: Standing) -> RankingRow:
    remarks: list[str] = ["" if own.verdict == "behind" else own.verdict]
    if own.status == "not_converged":
        remarks.append("not converged")
    if own.unreliable_blocks:
        blocks = "1 block" if own.unreliable_blocks == 1 else f"{own.unreliable_blocks} blocks"
        remarks.append(f"Pareto k above 0.7 in {blocks}")
    remarks.append(own.reason)
    return RankingRow(
        model=own.model,
        title=own.title,
        n_params=str(own.n_params),
        fit=numbers.fixed(own.fit_percent, 2),
        left_out=_with_error(own.left_out_percent, own.left_out_error, 2),
        behind=_with_error(own.left_out_behind, own.left_out_behind_error, 2),
        elpd_behind=_with_error(own.elpd_behind, own.elpd_behind_error, 1),
        bic_behind=numbers.fixed(own.bic_behind, 1),
        seconds=numbers.fixed(own.seconds, 1),
        remark=", ".join(filter(None, remarks)),
        is_chosen=own.verdict == "chosen",
    )


def _with_error(value: float | None, error: float | None, decimals: int) -> str:
    text = numbers.fixed(value, decimals)
    if value is None or error is None or error == 0.0:
        return text
    return f"{text} ± {numbers.fixed(error, decimals)}"
