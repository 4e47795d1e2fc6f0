"""The section on the choice of model: how the families compare on what their fits have not seen."""

from __future__ import annotations

from mrwork.report.fit.section import Group, Section, panel, table
from mrwork.report.ranking_figure import ranking_figure
from mrwork.report.ranking_rows import HEADINGS, ranking_rows
from mrwork.uncertainty.choice.ranking import Ranking


def ranking_section(ranking: Ranking) -> Section:
    """The sentence, the table and the figure of a comparison, and how its numbers are defined."""
    rows = ranking_rows(ranking)
    columns = tuple(f"{heading[:1].upper()}{heading[1:]}" for heading in HEADINGS[:-1])
    chosen = next(row for row in rows if row.is_chosen)
    judged = [each for each in ranking.standings if each.left_out_percent is not None]
    return Section(
        anchor="ranking",
        title="Choice of model",
        summary=f"Choice of model: {chosen.title} of {len(rows)} families, left-out fit {chosen.left_out} %.",
        groups=(
            Group(
                prose=(ranking.sentence, *(f"{remark}." for remark in ranking.remarks)),
                table=table(
                    label="Ranking of models",
                    columns=(*columns, "Remark"),
                    words=(len(columns),),
                    rows=tuple(
                        (
                            row.title,
                            row.n_params,
                            row.fit,
                            row.left_out,
                            row.behind,
                            row.elpd_behind,
                            row.bic_behind,
                            row.seconds,
                            row.remark,
                        )
                        for row in rows
                    ),
                ),
                points=ranking.definitions,
            ),
            Group(
                title="Left-out fit of the models",
                panels=(
                    panel(
                        "ranking",
                        "",
                        ranking_figure(ranking),
                        f"Left-out fit of {len(judged)} models with its standard error; {chosen.title} is chosen",
                    ),
                ),
                layout="whole",
            ),
        ),
    )
