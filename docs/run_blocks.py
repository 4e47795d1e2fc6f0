"""Runs the code blocks of the README and of the pages that are no notebooks; `make docs` calls it.

Blocks ``python`` are run, those of a page one after the other with the same variables; a block ``console`` is run where
the comment ``<!-- run -->`` stands above, each line after ``$`` in a shell. A page starts in an empty folder. What has
not changed since it ran is not run again: blocks are told apart by their text and the digest of the package.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
KNOWN = ROOT / "out" / "docs" / "blocks.json"
_NOTEBOOK = re.compile(r"\A---\n(.*\n)*?file_format: mystnb\n")
_BLOCK = re.compile(
    r"(?:^<!-- (?P<comment>.*?) -->\n)?^```(?P<language>python|console)\n(?P<text>.*?)^```$",
    flags=re.MULTILINE | re.DOTALL,
)
_COMMAND = re.compile(r"^\$ ((?:.*\\\n)*.*)$", flags=re.MULTILINE)
_RUN, _NOT_RUN = "run", "not run: "


@dataclass(frozen=True, slots=True, kw_only=True)
class Block:
    """A block that is run: its language, its text, and the line of the page on which the text begins."""

    language: str
    text: str
    line: int


def blocks_of(page: str) -> list[Block]:
    """The blocks of the text of a page that are to be run; none of a notebook."""
    if _NOTEBOOK.match(page):
        return []
    found = []
    for match in _BLOCK.finditer(page):
        comment = match["comment"] or ""
        is_run = comment == _RUN if match["language"] == "console" else not comment.startswith(_NOT_RUN)
        if is_run:
            line = page.count("\n", 0, match.start("text")) + 1
            found.append(Block(language=match["language"], text=match["text"], line=line))
    return found


def commands_of(text: str) -> list[str]:
    """The command lines of a console block."""
    return _COMMAND.findall(text)


def pages() -> list[Path]:
    """The README, and the pages of the documentation that are written by hand."""
    written = sorted(path for path in (ROOT / "docs").rglob("*.md") if "_generated" not in path.parts)
    return [ROOT / "README.md", *written]


def run_page(path: Path) -> None:
    """Run the blocks of a page here and now; an error has the lines of the page."""
    variables: dict[str, object] = {"__name__": "__main__"}
    for block in blocks_of(path.read_text(encoding="utf-8")):
        if block.language == "python":
            exec(compile("\n" * (block.line - 1) + block.text, str(path), "exec"), variables)
            continue
        for command in commands_of(block.text):
            done = subprocess.run(command, shell=True, stdout=subprocess.DEVNULL)
            if done.returncode:
                sys.exit(f"{path}:{block.line}: exit status {done.returncode} of: {command}")


def _run_apart(path: Path) -> bool:
    """Run a page in a process and a folder of its own; whether all of it ended well."""
    programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ.get('PATH', '')}"
    environment = {**os.environ, "PATH": programs, "MPLBACKEND": "Agg"}
    with tempfile.TemporaryDirectory() as folder:
        done = subprocess.run(
            [sys.executable, __file__, "--page", str(path)],
            cwd=folder,
            env=environment,
            stdout=subprocess.DEVNULL,
        )
    return done.returncode == 0


def _package_digest() -> str:
    """Digest of the sources of the package and of its compiled module."""
    digest = hashlib.sha256()
    for path in sorted((ROOT / "python" / "mrwork").rglob("*")):
        if path.suffix in (".py", ".so", ".pyd", ".j2"):
            digest.update(path.read_bytes())
    return digest.hexdigest()


def _digests(paths: Iterable[Path]) -> dict[Path, str]:
    package = _package_digest()
    found = {}
    for path in paths:
        blocks = blocks_of(path.read_text(encoding="utf-8"))
        if blocks:
            texts = [package, *(f"{block.language}\n{block.text}" for block in blocks)]
            found[path] = hashlib.sha256("\0".join(texts).encode()).hexdigest()
    return found


def main() -> int:
    """Run what has changed; the exit status is 1 where a block fails."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--page", type=Path, help="run the blocks of this page here, whether or not they have changed"
    )
    options = parser.parse_args()
    if options.page is not None:
        run_page(options.page)
        return 0
    known = json.loads(KNOWN.read_text()) if KNOWN.is_file() else {}
    digests = _digests(pages())
    failed = []
    for path, digest in digests.items():
        name = str(path.relative_to(ROOT))
        if known.get(name) == digest:
            continue
        start = time.monotonic()
        if _run_apart(path):
            known[name] = digest
            print(f"{name}: blocks run in {time.monotonic() - start:.1f} s")
        else:
            failed.append(name)
    KNOWN.parent.mkdir(parents=True, exist_ok=True)
    KNOWN.write_text(json.dumps(known, indent=1))
    if failed:
        print(f"blocks fail on: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
