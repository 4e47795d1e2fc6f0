"""Looks through the built pages: dead links within them, pictures without words, what comes from elsewhere.

A page must be complete without a network: links to other places are permitted, what a browser fetches by itself is not.
"""

from __future__ import annotations

import re
import sys
from dataclasses import dataclass, field
from functools import cache
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

# Attributes by which a browser fetches something for a page.
_FETCHED = {"img": "src", "script": "src", "iframe": "src", "source": "src", "object": "data"}
_FETCHED_LINKS = {"stylesheet", "icon", "preload", "prefetch", "modulepreload", "preconnect"}
# Nothing, or the file itself, which stands in the place of words that nobody gave.
_NO_WORDS = re.compile(r"|\S+\.(png|svg|jpe?g|gif|webp)", flags=re.IGNORECASE)
# Words of the picture that a cell of a notebook draws.
_WORDS_OF_CELL = re.compile(r"^    alt: (.+)$", flags=re.MULTILINE)
_FETCHED_BY_CSS = re.compile(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//", flags=re.IGNORECASE)


@dataclass(slots=True)
class Page(HTMLParser):
    """What one page links to, shows and fetches."""

    anchors: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    fetched: list[str] = field(default_factory=list)
    wordless: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        HTMLParser.__init__(self)

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        """Note what a tag refers to."""
        given = {name: value or "" for name, value in attributes}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag == "img" and _NO_WORDS.fullmatch(given.get("alt", "").strip()):
            self.wordless.append(given.get("src", ""))
        if given.get(_FETCHED.get(tag, ""), ""):
            self.fetched.append(given[_FETCHED[tag]])
        if tag == "link" and _FETCHED_LINKS & set(given.get("rel", "").split()):
            self.fetched.append(given.get("href", ""))


@cache
def read(path: Path) -> Page:
    """The page of a file."""
    page = Page()
    page.feed(path.read_text(encoding="utf-8"))
    return page


def findings(root: Path) -> list[str]:
    """Sentences on all pages below a folder."""
    found = []
    for path in sorted(each for each in root.rglob("*.html") if "_static" not in each.parts):
        page, name = read(path), path.relative_to(root)
        found += [f"{name}: the picture {each} has no words" for each in page.wordless]
        found += [f"{name}: {each} is fetched from elsewhere" for each in page.fetched if _is_elsewhere(each)]
        found += [
            f"{name}: {each} leads nowhere" for each in page.links + page.fetched if not _leads(path, each)
        ]
    for path in sorted(Path(__file__).parent.rglob("*.md")):
        name = path.relative_to(Path(__file__).parent).with_suffix(".html")
        built = root / name
        text = unescape(built.read_text(encoding="utf-8")) if built.is_file() else ""
        words = _WORDS_OF_CELL.findall(path.read_text(encoding="utf-8")) if text else []
        found += [f"{name}: a cell draws no picture: {each}" for each in words if each not in text]
    for path in sorted(root.rglob("*.css")):
        if _FETCHED_BY_CSS.search(path.read_text(encoding="utf-8")):
            found.append(f"{path.relative_to(root)}: fetches from elsewhere")
    return found


def _is_elsewhere(link: str) -> bool:
    parts = urlsplit(link)
    return parts.scheme not in ("", "data") or bool(parts.netloc)


def _leads(page: Path, link: str) -> bool:
    """Whether a link leads to a file and a place in it that exist; links to elsewhere are not followed."""
    parts = urlsplit(link)
    if parts.scheme or parts.netloc:
        return True
    target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
    if target.is_dir():
        target = target / "index.html"
    if not target.is_file():
        return False
    fragment = unquote(parts.fragment)
    return not fragment or target.suffix != ".html" or fragment in read(target).anchors


def main() -> int:
    """Print what is wrong; the exit status is 1 where something is."""
    if len(sys.argv) != 2:
        sys.exit("give the folder of the built pages")
    root = Path(sys.argv[1]).resolve()
    if not (root / "index.html").is_file():
        sys.exit(f"{root} has no index.html; run make docs")
    found = findings(root)
    print("\n".join(found) if found else f"{len([*root.rglob('*.html')])} pages: nothing to mend")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
