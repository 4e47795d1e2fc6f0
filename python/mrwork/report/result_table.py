"""A table, once for a terminal and once for a page."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from mrwork.arguments import checked
from mrwork.summary import Summarised, Summary


@checked
@dataclass(frozen=True, slots=True, kw_only=True, repr=False)
class ResultTable(Summarised):
    """Text in rows; the first column names the row."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def markdown(self) -> str:
        """The table for a README."""
        lines = [
            f"**{self.title}**",
            "",
            _line(self.header),
            _line(("---", *["---:"] * (len(self.header) - 1))),
        ]
        return "\n".join([*lines, *map(_line, self.rows), "", *([self.note, ""] if self.note else [])])

    def html(self) -> str:
        """The table for a page, in a region that scrolls."""
        head = "".join(
            f'<th scope="col"{_number(place)}>{escape(text)}</th>' for place, text in enumerate(self.header)
        )
        body = "".join(
            f'<tr><th scope="row">{escape(row[0])}</th>'
            + "".join(f'<td class="number">{escape(text)}</td>' for text in row[1:])
            + "</tr>"
            for row in self.rows
        )
        note = f'<p class="note">{escape(self.note)}</p>' if self.note else ""
        return (
            f'<h3>{escape(self.title)}</h3><div class="scroll" tabindex="0" role="region" '
            f'aria-label="{escape(self.title)}"><table><thead><tr>{head}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>{note}"
        )

    def _summary(self) -> Summary:
        return Summary(
            title=self.title, columns=self.header, rows=self.rows, notes=(self.note,) if self.note else ()
        )


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cells) + " |"


def _number(place: int) -> str:
    return ' class="number"' if place else ""
