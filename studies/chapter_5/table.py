"""A table, once for a terminal and once for a page."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape

from mrwork.report import symbol


@dataclass(frozen=True, slots=True, kw_only=True)
class ChapterTable:
    """Text in rows; the first column names the row, by the symbol of a parameter if `symbols`."""

    title: str
    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""
    symbols: bool = False

    def markdown(self) -> str:
        lines = [
            f"**{self.title}**",
            "",
            _line(self.header),
            _line(("---", *["---:"] * (len(self.header) - 1))),
        ]
        lines += [_line(row) for row in self.rows]
        return "\n".join([*lines, "", *([self.note, ""] if self.note else [])])

    def html(self) -> str:
        head = "".join(
            f'<th scope="col"{_number(place)}>{_heading(text)}</th>' for place, text in enumerate(self.header)
        )
        body = "".join(
            "<tr>"
            + "".join(
                f'<th scope="row">{symbol(text) if self.symbols else escape(text)}</th>'
                if place == 0
                else f"<td{_number(place)}>{_strong(text)}</td>"
                for place, text in enumerate(row)
            )
            + "</tr>"
            for row in self.rows
        )
        note = f'<p class="note">{escape(self.note)}</p>' if self.note else ""
        return (
            f'<h3>{escape(self.title)}</h3><div class="scroll" tabindex="0" role="region" '
            f'aria-label="{escape(self.title)}"><table><thead><tr>{head}</tr></thead>'
            f"<tbody>{body}</tbody></table></div>{note}"
        )


def _line(cells: tuple[str, ...]) -> str:
    return "| " + " | ".join(cells) + " |"


def _number(place: int) -> str:
    return ' class="number"' if place else ""


def _heading(text: str) -> str:
    name, bracket, unit = text.partition(" [")
    # A parameter's name is one word, RMS aside.
    if not name or " " in name or "-" in name or name == "RMS":
        return escape(text)
    return f"{symbol(name)}{escape(bracket + unit)}"


def _strong(text: str) -> str:
    return f"<strong>{text[2:-2]}</strong>" if text.startswith("**") else escape(text)
