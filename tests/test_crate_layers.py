"""The files of each Rust crate use each other without a circle.

A file uses another one where it names a path into it, in a `use` or elsewhere: an edge to the file of the last module
that the path names. A name that `mod.rs` re-exports is an edge to `mod.rs`, which has an edge of its own to the file
that defines it. `mod name;` and `pub(in path)` are no edges.
"""

import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

Module = tuple[str, ...]

CRATES = Path(__file__).parents[1] / "crates"
# A number owns its elementary functions, which compute with numbers: the two count as one file.
NUMBER, ELEMENTARY = "real.rs", "elementary.rs"

NOT_CODE = re.compile(r'"(?:\\.|[^"\\])*"|\'(?:\\.|[^\'\\])\'|//[^\n]*|/\*.*?\*/|pub\(in [^)]*\)', re.DOTALL)
USE = re.compile(r"\buse\s+([^;]+);")
PATH = re.compile(r"(?<![\w:])\w+(?:\s*::\s*\w+)+")


def expanded(tree: str) -> Iterator[str]:
    """The paths of a tree such as `a::{b, c::{self, d}}`, which has no blanks."""
    head, brace, branches = tree.partition("{")
    if not brace:
        yield head
        return
    depth, branch = 0, ""
    for character in branches.removesuffix("}") + ",":
        depth += (character == "{") - (character == "}")
        if character != "," or depth:
            branch += character
        elif branch:
            yield from (head + path for path in expanded(branch))
            branch = ""


def paths_of(code: str) -> Iterator[list[str]]:
    """The paths that a file names, each as its segments."""
    for tree in USE.findall(code):
        for path in expanded(re.sub(r"\s+as\s+\w+|\s", "", tree)):
            yield path.split("::")
    for path in PATH.findall(USE.sub("", code)):
        yield re.sub(r"\s", "", path).split("::")


def named_module(path: list[str], at: Module, files: dict[Module, str]) -> Module | None:
    """The last module of the crate that a path in the file of module `at` names; none if it leads elsewhere."""
    starts = {"crate": (), "self": at, "super": at[:-1]}
    found = starts.get(path[0], (*at, path[0]))
    if found not in files:
        return None
    for name in path[1:]:
        if name != "super" and (*found, name) not in files:
            break
        found = found[:-1] if name == "super" else (*found, name)
    return found


def edges_of(sources: dict[str, str]) -> dict[str, set[str]]:
    """The files that each file of a crate uses, from the texts of all."""
    files: dict[Module, str] = {}
    for file in sources:
        *folders, stem = file.removesuffix(".rs").split("/")
        files[tuple(folders if stem in ("mod", "lib") else [*folders, stem])] = file
    edges: dict[str, set[str]] = {file: set() for file in sources}
    for module, file in files.items():
        paths = paths_of(NOT_CODE.sub("", sources[file]))
        named = {named_module(path, module, files) for path in paths} - {None, module}
        edges[file] = {files[each] for each in named if each is not None}
    return edges


def circle_of(edges: dict[str, set[str]]) -> str:
    """A circle, each file before one that it uses; empty if there is none."""
    try:
        TopologicalSorter({file: sorted(used) for file, used in sorted(edges.items())}).prepare()
    except CycleError as error:
        return " -> ".join(reversed(error.args[1]))
    return ""


@pytest.mark.parametrize("crate", ["mrwork-dynamics", "mrwork-py"])
def test_files_of_a_crate_use_each_other_without_a_circle(crate: str) -> None:
    root = CRATES / crate / "src"
    edges = edges_of({file.relative_to(root).as_posix(): file.read_text() for file in root.rglob("*.rs")})
    assert any(edges.values())
    if NUMBER in edges:
        edges[NUMBER] |= edges.pop(ELEMENTARY)
        edges = {file: {NUMBER if one == ELEMENTARY else one for one in used} for file, used in edges.items()}
        edges[NUMBER].discard(NUMBER)
    circle = circle_of(edges)
    assert not circle, f"files of {crate} use each other in a circle, {circle}: move out what they share"


@pytest.mark.parametrize(
    "text", ["use crate::room::{a, b::{self, B as C}};", "fn f() { super::b::g::<f64>() }"]
)
def test_a_circle_is_found_in_every_form_of_a_path(text: str) -> None:
    texts = {"lib.rs": "", "room/mod.rs": "mod a;", "room/a.rs": text, "room/b.rs": "use super::a::A;"}
    assert circle_of(edges_of(texts)) == "room/a.rs -> room/b.rs -> room/a.rs"
    unused = '// super::a\nconst A: &str = "super::a::A"; pub(in crate::room::a) const B: char = \'"\';'
    assert not circle_of(edges_of(texts | {"room/b.rs": unused}))
