"""LICENCES.md lists what the lock files list, and what everybody installs is permitted."""

import importlib.metadata
import tomllib

import pytest

import licences
from licences import REQUIRED, ROOT, TABLE, Dependency, canonicalize_name


def committed(title: str) -> list[Dependency]:
    section = TABLE.read_text(encoding="utf-8").split(f"## {title}\n")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ") for line in section.splitlines() if line.startswith("| ")]
    return [
        Dependency(name=name, version=version, licence=licence, needed_by=needed_by)
        for name, version, licence, needed_by in rows[2:]
    ]


def test_the_table_names_the_packages_of_the_constraints():
    listed = {one.name: one.version for one in committed("Python packages")}
    environment = dict.fromkeys(licences.OF_THE_ENVIRONMENT & listed.keys(), licences.UNPINNED)
    assert listed == licences.pinned() | environment, "run make licences"


def test_the_table_names_the_crates_of_the_lock_file():
    lock = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))["package"]
    listed = {(one.name, one.version) for one in committed("Rust crates")}
    assert listed == {(crate["name"], crate["version"]) for crate in lock if "source" in crate}, (
        "run make licences"
    )


def test_what_everybody_installs_is_marked_as_required():
    if importlib.metadata.version("arviz-base") != licences.pinned()["arviz-base"]:
        pytest.skip("the table is of the versions of constraints.txt, and these are others")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    listed = {one.name for one in committed("Python packages") if one.needed_by == REQUIRED}
    assert {
        canonicalize_name(name) for name in licences.needed_packages(project["dependencies"], {})
    } <= listed


def test_every_required_licence_is_permitted():
    rows = committed("Python packages") + committed("Rust crates")
    assert sum(one.needed_by == REQUIRED for one in rows) > 50
    assert licences.refusals(rows) == []
    one = Dependency(name="sample", version="1.0", licence="MIT AND GPL-2.0-only", needed_by=REQUIRED)
    assert licences.refusals([one])
