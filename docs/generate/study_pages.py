"""Pages of the studies, whose READMEs are included, and of the benchmarks."""

from __future__ import annotations

import importlib.metadata
import tomllib
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from generate.markdown import code, document, prose, table, toctree

ROOT = Path(__file__).resolve().parents[2]
BENCHMARKS = "speed"


def studies() -> dict[str, Path]:
    """README of each study, by the name of its folder."""
    return {path.parent.name: path for path in sorted(ROOT.glob("studies/*/README.md"))}


def study_pages() -> dict[str, str]:
    """Page of each study, and the list of all."""
    return {"index": _index(), **{name: _page(name) for name in studies()}}


def _index() -> str:
    rows = [
        (f"[{prose(_title(path))}]({name}.md)", code(f"studies/{name}")) for name, path in studies().items()
    ]
    return document(
        "# Studies",
        "A study answers one question with numbers that its command measures anew: `python studies/NAME/study.py`, "
        "from the folder of the project. Those on measured records skip what is not there. Each page is the README of "
        "its folder.",
        table(("question", "folder"), rows),
        toctree(*studies(), hidden=""),
    )


def _title(path: Path) -> str:
    return path.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")


def _page(name: str) -> str:
    included = f"```{{include}} ../../../studies/{name}/README.md\n```"
    if name != BENCHMARKS:
        return document(included)
    return document(
        included, "What was measured, and on which machine, stands in {doc}`/explanation/speed`.", _versions()
    )


def _versions() -> str:
    """Versions of the peers and of what they stand on, as `constraints.txt` fixes them for every measurement."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = dict(line.split("==") for line in lines if not line.startswith("#"))
    versions = {canonicalize_name(name): version for name, version in pinned.items()}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras = project["optional-dependencies"]
    wanted = [
        *project["dependencies"],
        *extras["bench"],
        *extras["peers"],
        *extras["nuts"],
        *extras["control"],
    ]
    names = sorted({canonicalize_name(Requirement(text).name) for text in wanted} & versions.keys())
    return document(
        "## Versions",
        f"`make` installs these versions beside mrwork {importlib.metadata.version('mrwork')}, and the benchmarks run "
        "with them:",
        table(("package", "version"), [(code(name), versions[name]) for name in names]),
    )
