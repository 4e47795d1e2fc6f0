"""Names of a namespace, loaded when they are first used, as its stub lists them.

The imports at the top of `__init__.pyi` are the public tier: what users need, with checked arguments. Those under its
`if` are the lower tier, for the studies: they can be had by name, are not listed by `dir`, and check nothing.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Iterable
from pathlib import Path

import lazy_loader


def attach(package: str, file: str) -> tuple[Callable[[str], object], Callable[[], list[str]], list[str]]:
    """`__getattr__`, `__dir__` and `__all__` of the package whose `__init__.py` is the file."""
    stub = ast.parse(Path(file).with_suffix(".pyi").read_text())
    public = _names(stub.body)
    every = _names(ast.walk(stub))
    attached, _, _ = lazy_loader.attach(package, every.pop("", []), every)
    listed = sorted(name for names in public.values() for name in names)
    return attached, lambda: listed, listed


def _names(nodes: Iterable[ast.AST]) -> dict[str, list[str]]:
    """Imported names by their module; submodules stand under an empty one."""
    names: dict[str, list[str]] = {}
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            names.setdefault(node.module or "", []).extend(each.name for each in node.names)
    return names
