"""Small pieces of MyST text: prose with its special characters escaped, tables, directives."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

# Text between backticks, options and names with an underscore, which are code; and characters that would be markup.
_CODE = r"``.+?``|`[^`\n]+`|(?<![\w-])--[a-z][a-z-]*|\b[A-Za-z]\w*_\w+"
_SPECIAL = re.compile(rf"(?P<code>{_CODE})|[\\<>*_\[\]{{}}|$#~^]")


def prose(text: str) -> str:
    """A text of the package on one line, with what Markdown would take for markup escaped; `code` stays code."""
    return _SPECIAL.sub(_escaped, " ".join(text.split()))


def _escaped(found: re.Match[str]) -> str:
    return code(found["code"].strip("`")) if found["code"] else f"\\{found.group()}"


def unit(text: str) -> str:
    """A unit, which no end of a line divides."""
    return prose(text).replace(" ", "\N{NO-BREAK SPACE}").replace("-", "\N{NON-BREAKING HYPHEN}")


def code(text: str) -> str:
    """A text in the type of code, within a table too."""
    return f"`{text}`".replace("|", "\\|") if text else ""


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table of cells of MyST text; nothing where there are no rows."""
    lines = [f"| {' | '.join(row)} |" for row in rows]
    if not lines:
        return ""
    return "\n".join([f"| {' | '.join(headings)} |", "|" + " --- |" * len(headings), *lines])


def directive(name: str, argument: str = "", body: str = "", **options: str) -> str:
    """A directive with its options and body, fenced by more colons than its body has."""
    inner = max((len(found) for found in re.findall(r"^:{3,}", body, flags=re.MULTILINE)), default=2)
    fence = ":" * (inner + 1)
    lines = [
        f"{fence}{{{name}}} {argument}".rstrip(),
        *(f":{key}: {value}" for key, value in options.items()),
    ]
    return "\n".join([*lines, *(["", body] if body else []), fence])


def fenced(language: str, text: str) -> str:
    """A block of code."""
    return f"```{language}\n{text.rstrip()}\n```"


def toctree(*entries: str, **options: str) -> str:
    """A table of contents of these pages."""
    return directive("toctree", "", "\n".join(entries), **options)


def document(*blocks: str) -> str:
    """Blocks as a page, apart by an empty line; empty ones are left out."""
    return "\n\n".join(block for block in blocks if block) + "\n"
