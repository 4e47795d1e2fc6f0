"""Writes LICENCES.md: every dependency with its version, its licence and what needs it.

Python packages are those of pyproject.toml and what they need in turn, Rust crates those of Cargo.lock. Where a
package is not the one of constraints.txt, or what everybody installs has no `PERMITTED` licence, nothing is written
and the exit status is 1.
"""

from __future__ import annotations

import importlib.metadata
import json
import subprocess
import sys
import tomllib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).resolve().parent.parent
TABLE = ROOT / "LICENCES.md"

REQUIRED = "required"
"""What everybody needs, who installs or builds the package."""
DEVELOPMENT = "dev"
UNUSED = "unused"
"""In the lock file, but behind a feature that is off."""

UNPINNED = "any"
OF_THE_ENVIRONMENT = {"setuptools"}
"""Packages that virtual environments bring: constraints.txt does not choose their version."""

PERMITTED = {
    "0BSD", "Apache-2.0", "BSD", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "MIT", "MIT-0", "MIT-CMU", "MPL-2.0",
    "PSF-2.0", "Unicode-3.0", "Zlib",
}  # fmt: skip

# Packages that declare no SPDX expression have a classifier, a name or the text of a licence instead.
_CLASSIFIERS = {
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "GNU Lesser General Public License v3 (LGPLv3)": "LGPL-3.0-only",
    "GNU Library or Lesser General Public License (LGPL)": "LGPL",
}
_NAMES = {"Apache 2.0": "Apache-2.0", "BSD": "BSD", "ISC license": "ISC"}
_TEXTS = {"Permission is hereby granted, free of charge": "MIT", "Apache License": "Apache-2.0"}

# Extras that no check installs; the head of the table has their licences.
_NOT_INSTALLED = {"arviz-plots", "opensees"}

HEAD = """# Licences of the dependencies

Written by `make licences`: the versions of `constraints.txt` and `Cargo.lock`, each with the licence that it declares.
`required` is what everybody installs or compiles, `dev` what tests and checks need, `unused` a crate behind a feature
that is off; other words are the optional dependencies of `pyproject.toml`. A required one is never GPL, AGPL, LGPL or
unknown: the command refuses it. The licence of mrwork itself is in `LICENSE`.

Two optional dependencies are not in the table, because no check installs them. `arviz-plots`, of the extra of that
name, is Apache-2.0. With `openseespy`, of the extra `opensees`, tests compare an exported damper, a study a frame. Its
metadata declare:
"OpenSeesPy is free for research, education, and internal use. Commercial redistribution of OpenSeesPy, such as, but not
limited to, an application or cloud-based service that uses import openseespy, requires a license similar to that
required for commercial redistribution of OpenSees.exe." That is no open source licence. The text that
`mrwork export --target opensees` writes needs OpenSees when it is used, and has no part of it.
"""


@dataclass(frozen=True, slots=True, kw_only=True, order=True)
class Dependency:
    """A row of the table; `licence` is an SPDX expression, or "unknown"."""

    name: str
    version: str
    licence: str
    needed_by: str


def is_permitted(licence: str) -> bool:
    """Whether an expression can be met by permitted licences alone (one of each OR, all of each AND)."""
    alternatives = licence.replace("(", "").replace(")", "")
    return all(
        any(name.partition(" WITH ")[0].strip() in PERMITTED for name in clause.split(" OR "))
        for clause in alternatives.split(" AND ")
    )


def refusals(dependencies: Iterable[Dependency]) -> list[str]:
    """Sentences about the required dependencies whose licence is not permitted."""
    return [
        f"{one.name} {one.version} is required and its licence is {one.licence}; permitted are "
        f"{', '.join(sorted(PERMITTED))}"
        for one in dependencies
        if one.needed_by == REQUIRED and not is_permitted(one.licence)
    ]


def pinned() -> dict[str, str]:
    """Version of each package in constraints.txt."""
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pairs = (line.split("==") for line in lines if not line.startswith("#"))
    return {canonicalize_name(name): version for name, version in pairs}


def version_of(package: str) -> str:
    """Version of a package, which must be installed as pinned."""
    if package in OF_THE_ENVIRONMENT:
        return UNPINNED
    wanted, installed = pinned().get(package), importlib.metadata.version(package)
    if installed != wanted:
        sys.exit(
            f"{package} {installed} is installed and constraints.txt has {wanted}; mend the file, or run make test"
        )
    return installed


def licence_of(package: str) -> str:
    """Licence of an installed Python package, as an SPDX expression where that can be told."""
    metadata = importlib.metadata.metadata(package)
    if metadata["License-Expression"]:
        return str(metadata["License-Expression"])
    classes = [
        line.rpartition(" :: ")[2]
        for line in metadata.get_all("Classifier", [])
        if line.startswith("License ::")
    ]
    declared = [_CLASSIFIERS[line] for line in classes if line in _CLASSIFIERS]
    text = str(metadata["License"] or "")
    if declared:
        return " AND ".join(declared)
    if "\n" not in text.strip() and text.strip():
        return _NAMES.get(text.strip(), text.strip())
    return next((name for words, name in _TEXTS.items() if words in text), "unknown")


def needed_packages(requirements: Iterable[str], project: Mapping[str, list[str]]) -> Iterator[str]:
    """Names of what is installed for requirements, and for theirs; `project` are the extras of this project."""
    waiting = [Requirement(text) for text in requirements]
    seen: set[tuple[str, str]] = set()
    while waiting:
        requirement = waiting.pop()
        name = canonicalize_name(requirement.name)
        for extra in ("", *sorted(requirement.extras)):
            if (name, extra) in seen:
                continue
            seen.add((name, extra))
            if name == "mrwork":
                waiting += [Requirement(text) for text in project.get(extra, [])]
                continue
            yield name
            for text in importlib.metadata.requires(name) or []:
                further = Requirement(text)
                if further.marker is None or further.marker.evaluate({"extra": extra}):
                    waiting.append(further)


def python_packages() -> list[Dependency]:
    """Packages of the project and its extras, as installed."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    extras: dict[str, list[str]] = project["optional-dependencies"]
    needed_by = {name: {REQUIRED} for name in needed_packages(project["dependencies"], extras)}
    for extra, requirements in extras.items():
        if extra in _NOT_INSTALLED:
            continue
        for name in needed_packages(requirements, extras):
            needed_by.setdefault(name, set()).add(extra)
    rows = []
    for name, groups in needed_by.items():
        narrowest = groups - {DEVELOPMENT} or groups
        rows.append(
            Dependency(
                name=name,
                version=version_of(name),
                licence=licence_of(name),
                needed_by=REQUIRED if REQUIRED in groups else ", ".join(sorted(narrowest)),
            )
        )
    return sorted(rows)


def _cargo(*arguments: str) -> str:
    return subprocess.run(
        ["cargo", *arguments, "--locked", *sys.argv[1:]], cwd=ROOT, check=True, capture_output=True, text=True
    ).stdout


def rust_crates() -> list[Dependency]:
    """Crates of Cargo.lock; required are those that the compiled module is built from."""

    def used(kinds: str) -> set[tuple[str, str]]:
        tree = _cargo(
            "tree", "--workspace", "--target", "all", "--edges", kinds, "--prefix", "none", "--format", "{p}"
        )
        pairs = (line.split()[:2] for line in tree.splitlines() if line)
        return {(name, version.removeprefix("v")) for name, version in pairs}

    required, tested = used("normal,build"), used("normal,build,dev")
    metadata = json.loads(_cargo("metadata", "--format-version", "1"))
    rows = []
    for crate in metadata["packages"]:
        if crate["id"] in metadata["workspace_members"]:
            continue
        key = (crate["name"], crate["version"])
        needed_by = REQUIRED if key in required else DEVELOPMENT if key in tested else UNUSED
        licence = (crate["license"] or "unknown").replace("/", " OR ")
        rows.append(Dependency(name=key[0], version=key[1], licence=licence, needed_by=needed_by))
    return sorted(rows)


def table(title: str, dependencies: Iterable[Dependency]) -> str:
    """A section of LICENCES.md."""
    rows = [f"| {one.name} | {one.version} | {one.licence} | {one.needed_by} |" for one in dependencies]
    return "\n".join(
        [f"## {title}", "", "| name | version | licence | for |", "| --- | --- | --- | --- |", *rows, ""]
    )


def main() -> int:
    """Write the table, or say what is not permitted."""
    packages, crates = python_packages(), rust_crates()
    refused = refusals([*packages, *crates])
    for sentence in refused:
        print(sentence, file=sys.stderr)
    if refused:
        return 1
    TABLE.write_text(
        "\n".join([HEAD, table("Python packages", packages), table("Rust crates", crates)]), encoding="utf-8"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
