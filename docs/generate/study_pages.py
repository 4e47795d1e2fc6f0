"""Pages of the studies, from their docstrings, expected numbers and notes, and of the benchmarks."""

from __future__ import annotations

import ast
import csv
import importlib.metadata
import re
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from generate.markdown import code, document, prose, table, toctree

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = "speed"


def studies() -> dict[str, Path]:
    """Script of each study, or the README of its folder, by name."""
    scripts = {path.stem: path for path in ROOT.glob("studies/*.py") if path.stem not in ("common", "timing")}
    folders = {path.parent.name: path for path in ROOT.glob("studies/*/README.md")}
    return dict(sorted((folders | scripts).items()))


def study_pages() -> dict[str, str]:
    """Page of each study, and the list of all."""
    return {"index": _index(), **{name: _page(name) for name in studies()}}


_FIRST = ("identification", "weights_tuning")


def listed(link: str) -> str:
    """Table of the scripts: question with a `link` to format with the name, answer, minutes."""
    scripts = [name for name, path in studies().items() if path.suffix == ".py"]
    rows = []
    for name in sorted(scripts, key=lambda each: (each not in _FIRST, each)):
        question, answer = _question_and_answer(studies()[name])
        *sentences, minutes = re.split(r"(?<=[.)])\s+(?=[A-Z0-9])", answer)
        rows.append(
            (
                f"[{prose(question)}]({link.format(name)})",
                prose(" ".join(sentences)),
                prose(minutes.rstrip(".")),
            )
        )
    return table(("question", "answer", "time"), rows)


def readme() -> str:
    """The text of `studies/README.md`."""
    return document(
        "# Studies",
        "A study is a script of public names that answers one question with numbers that it finds anew: `python "
        "studies/NAME.py`, with `--quick` in seconds. It prints tables, saves figures in `out/studies/NAME` and ends "
        "with status 1 where a number is not the expected one of `studies/NAME/*.csv`. Copy the first two.",
        listed("{}.py"),
    )


def _index() -> str:
    return document(
        "# Studies",
        "A study answers one question with numbers that its script finds anew: `python studies/NAME.py`, from the "
        "folder of the project. Those on measured records end with status 2 where the records are not there. "
        "[Study files](respond.md) of `mrwork respond` are beside them.",
        listed("{}.md"),
        toctree(*studies(), hidden=""),
    )


def _question_and_answer(script: Path) -> tuple[str, str]:
    """First line and first paragraph below it of the docstring."""
    text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    question, _, rest = text.partition("\n")
    return question, " ".join(rest.strip().partition("\n\n")[0].split())


def _script_page(script: Path) -> str:
    """Question and answer of its docstring, the numbers that are expected of it, and its notes."""
    text = ast.get_docstring(ast.parse(script.read_text(encoding="utf-8"))) or ""
    question, _, answer = text.partition("\n")
    folder = script.with_suffix("")
    parts = [f"# {question}", answer.strip(), f"```sh\npython studies/{script.name}\n```"]
    for path in sorted(folder.glob("*.csv")):
        with path.open(newline="", encoding="utf-8") as file:
            lines = [line for line in csv.DictReader(file) if line.pop("form") != "quick"]
        if lines:
            headings = [each for each in lines[0] if each != "tolerance"]
            rows = [[prose(line[each]) for each in headings] for line in lines]
            parts += [f"Expected numbers of `{path.stem}`:", table(["", *map(prose, headings[1:])], rows)]
    if (folder / "notes.md").is_file():
        parts.append(f"```{{include}} ../../../studies/{script.stem}/notes.md\n```")
    if script.stem == BENCHMARKS:
        parts.append(_versions())
    return document(*parts)


def _page(name: str) -> str:
    if (path := studies()[name]).suffix == ".py":
        return _script_page(path)
    return document(f"```{{include}} ../../../studies/{name}/README.md\n```")


def _versions() -> str:
    """Versions of the peers and of what they stand on, as `constraints.txt` fixes them for every measurement."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = dict(line.split("==") for line in lines if not line.startswith("#"))
    versions = {canonicalize_name(name): version for name, version in pinned.items()}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = [*project["dependencies"], *extras["bench"], *extras["peers"]]
    names = sorted({canonicalize_name(Requirement(text).name) for text in wanted} & versions.keys())
    return document(
        "## Versions",
        f"`make` installs these versions beside mrwork {importlib.metadata.version('mrwork')}, and the benchmarks run "
        "with them:",
        table(("package", "version"), [(code(name), versions[name]) for name in names]),
    )


if __name__ == "__main__":
    print(readme(), end="")
